"""The features that a regression gets from states and inputs, and what it predicts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from acl_gym.envs.learned.description import Description
from acl_gym.utils.angles import FULL_CIRCLE
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import FloatArray, IntArray

LINEAR, COSINE, SINE, IS_ACTION = range(4)
"""What a feature is of its variable or input."""

_LEAST = 1e-12
"""A deviation that is less than this share of the largest number comes from rounding.

It is relative, since a plant may be described in any unit."""


@dataclass(frozen=True)
class Features:
    """A state and an input as a row of numbers of about unit size.

    A circular variable becomes its cosine and sine, so that nothing jumps where it wraps
    around. Another is shifted and scaled to mean 0 and deviation 1, an input as well.
    Inputs that number actions become flags, one for each action.

    Attributes:
        kind: of each feature, `(n_features,)`.
        source: the row that it is made of, states first, then inputs.
        offset: what is subtracted, or the number of the action.
        scale: the factor on the difference.
        period: of each variable, 0 where it is not circular, `(n_variables,)`.
        change_mean: of the changes of variables in a step, `(n_variables,)`.
        change_scale: their deviations.
    """

    kind: IntArray
    source: IntArray
    offset: FloatArray
    scale: FloatArray
    period: FloatArray
    change_mean: FloatArray
    change_scale: FloatArray

    @classmethod
    def of(
        cls,
        description: Description,
        variables: FloatArray,
        inputs: FloatArray,
        next_variables: FloatArray,
    ) -> Features:
        """Choose the features for recorded steps.

        Args:
            description: of the recording.
            variables: states, angles as one variable each, `(n, n_variables)`.
            inputs: `(n, n_inputs)`.
            next_variables: the next states.
        """
        period = periods_of(description)
        rows: list[tuple[int, int, float, float]] = []
        low = variable_ends(description)[0]
        for axis, span in enumerate(period):
            if span > 0.0:
                turn = FULL_CIRCLE / span
                rows += [(COSINE, axis, low[axis], turn), (SINE, axis, low[axis], turn)]
            else:
                rows.append((LINEAR, axis, *_standard(variables[:, axis])))
        size = variables.shape[1]
        if description.numbered:
            known = description.values
            numbers = np.unique(inputs) if known is None else np.ravel(known)
            rows += [(IS_ACTION, size, float(number), 1.0) for number in numbers]
        else:
            rows += [
                (LINEAR, size + column, *_standard(inputs[:, column]))
                for column in range(inputs.shape[1])
            ]
        kinds, sources, offsets, scales = (
            np.array(each) for each in zip(*rows, strict=True)
        )
        change = differences(variables, next_variables, period)
        deviation = change.std(axis=0)
        largest = np.maximum(np.abs(variables), np.abs(next_variables)).max(axis=0)
        return cls(
            kinds.astype(np.int64),
            sources.astype(np.int64),
            offsets.astype(np.float64),
            scales.astype(np.float64),
            period,
            change.mean(axis=0),
            np.where(_varies(deviation, largest), deviation, 1.0),
        )

    def __len__(self) -> int:
        """The number of features."""
        return self.kind.size

    def rows(self, variables: FloatArray, inputs: FloatArray) -> FloatArray:
        """The features of states and inputs, variables first.

        Args:
            variables: `(n_variables, n)`.
            inputs: `(n_inputs, n)`.

        Returns:
            `(n, n_features)`.
        """
        found = np.empty((variables.shape[1], len(self)))
        _fill(
            np.concatenate([variables, inputs]),
            self.kind,
            self.source,
            self.offset,
            self.scale,
            found,
        )
        return found

    def targets(self, variables: FloatArray, next_variables: FloatArray) -> FloatArray:
        """The changes in a step, of mean 0 and deviation 1, `(n, n_variables)`."""
        change = differences(variables, next_variables, self.period)
        return (change - self.change_mean) / self.change_scale

    def changes(self, targets: FloatArray) -> FloatArray:
        """What `targets` was made of: changes in the units of the variables."""
        return self.change_mean + self.change_scale * targets

    def arrays(self) -> dict[str, Any]:
        """The numbers of all features, by name."""
        return dict(vars(self))


def periods_of(description: Description) -> FloatArray:
    """Of each variable, 0 where it is not circular; an angle is one variable."""
    angles = description.shown_angles
    low, high = variable_ends(description)
    circular = [
        column in description.circular or axis in angles.circular
        for axis, column in enumerate(angles.columns)
    ]
    return np.where(circular, high - low, 0.0)


def variable_ends(description: Description) -> tuple[FloatArray, FloatArray]:
    """Lower and upper ends of the variables, `(n_variables,)`, an angle from -pi to pi."""
    angles = description.shown_angles
    low = np.array(description.low)[list(angles.columns)]
    high = np.array(description.high)[list(angles.columns)]
    turned = list(angles.circular)
    low[turned], high[turned] = -math.pi, math.pi
    return low, high


def differences(
    before: FloatArray, after: FloatArray, period: FloatArray
) -> FloatArray:
    """after - before, the short way round a circle, `(n, n_variables)`."""
    change = after - before
    for axis in np.flatnonzero(period):
        change[:, axis] -= period[axis] * np.rint(change[:, axis] / period[axis])
    return change


def _standard(column: FloatArray) -> tuple[float, float]:
    """Mean and one over the deviation."""
    deviation = float(column.std())
    varies = _varies(deviation, np.abs(column).max())
    return float(column.mean()), 1.0 / deviation if varies else 1.0


def _varies(deviation: Any, largest: Any) -> Any:
    """Whether a deviation is more than rounding, of numbers up to `largest`."""
    return deviation > np.maximum(_LEAST * largest, np.finfo(np.float64).tiny)


@njit(error_model="numpy")
def _fill(
    sources: FloatArray,
    kind: IntArray,
    source: IntArray,
    offset: FloatArray,
    scale: FloatArray,
    found: FloatArray,
) -> None:
    for feature in range(kind.size):
        row = sources[source[feature]]
        least, times = offset[feature], scale[feature]
        if kind[feature] == LINEAR:
            for i in range(row.size):
                found[i, feature] = (row[i] - least) * times
        elif kind[feature] == COSINE:
            for i in range(row.size):
                found[i, feature] = math.cos((row[i] - least) * times)
        elif kind[feature] == SINE:
            for i in range(row.size):
                found[i, feature] = math.sin((row[i] - least) * times)
        else:
            for i in range(row.size):
                found[i, feature] = 1.0 if row[i] == least else 0.0
