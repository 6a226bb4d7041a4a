"""A line through each output, and what it leaves for a regression."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray

LINEAR_RIDGE = 1e-3
"""Steps' worth of evidence for a line without slope."""


class Output:
    """What is known of one output.

    Most outputs are nearly linear, and outside the data a line is a better guess than
    the mean. So a line is fitted first, and a regression to what it leaves.

    Args:
        rows: features, `(n, n_features)`.
        targets: `(n,)`, of about unit size.
        folds: the number of the fold of each row, `(n,)`.

    Attributes:
        line: weight of each feature, and last what is added, `(n_features + 1,)`.
        unsure: what is not known of these weights, the inverse of the normal matrix,
            `(n_features + 1, n_features + 1)`.
        scale: deviation of what the line leaves.
        targets: what it leaves, divided by that.
    """

    def __init__(self, rows: FloatArray, targets: FloatArray, folds: IntArray) -> None:
        self.rows, self.folds = rows, folds
        self.every = np.ones(len(rows), np.bool_)
        self._deviation = float(targets.std()) or 1.0
        self.line, left, self.unsure = _line(rows, targets)
        self.scale = max(float(left.std()), 1e-6)
        self.targets = left / self.scale

    def estimator(self, make: Callable[[], Any], rows: BoolArray) -> Any:
        """One of a library, fitted to some rows."""
        made = make()
        made.fit(self.rows[rows], self.targets[rows])
        return made

    def relative(self, missed: FloatArray) -> float:
        """The root mean square of errors, in units of the deviation of the output."""
        return float(np.sqrt(np.mean(missed**2))) * self.scale / self._deviation


def _line(
    rows: FloatArray, targets: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Weights of a linear fit, what it leaves of the targets, and what is not known."""
    wide = np.concatenate([rows, np.ones((len(rows), 1))], axis=1)
    # Features that say the same twice share their weight.
    normal = wide.T @ wide + LINEAR_RIDGE * np.eye(wide.shape[1])
    line = np.linalg.solve(normal, wide.T @ targets)
    return line, targets - wide @ line, np.linalg.inv(normal)


@njit(error_model="numpy")
def add_lines(
    rows: FloatArray, lines: FloatArray, scale: FloatArray, left: FloatArray
) -> None:
    """Add the lines; not a matrix product, whose bits depend on the number of rows."""
    last = rows.shape[1]
    for i in range(len(rows)):
        for o in range(len(lines)):
            total = lines[o, last] + scale[o] * left[i, o]
            for f in range(last):
                total += lines[o, f] * rows[i, f]
            left[i, o] = total


@njit(error_model="numpy")
def add_leverage(
    rows: FloatArray, unsure: FloatArray, scale: FloatArray, found: FloatArray
) -> None:
    """scale * sqrt(found^2 + z' unsure z) for z = (row, 1), in place."""
    last = rows.shape[1]
    wide = np.ones(last + 1)
    for i in range(len(rows)):
        wide[:last] = rows[i]
        for o in range(len(unsure)):
            leverage = 0.0
            for a in range(last + 1):
                part = 0.0
                for b in range(last + 1):
                    part += unsure[o, a, b] * wide[b]
                leverage += part * wide[a]
            total = found[i, o] * found[i, o] + max(leverage, 0.0)
            found[i, o] = scale[o] * np.sqrt(total)
