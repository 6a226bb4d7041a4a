"""Cost and ends of episodes, learned from recorded rewards and terminations."""

from __future__ import annotations

from typing import Any, Self

import numpy as np
from threadpoolctl import threadpool_limits

from acl_gym.envs.learned.features import Features
from acl_gym.envs.learned.regression import LEAST_STEPS, Fit, folds_of
from acl_gym.envs.learned.transitions import Transitions
from acl_gym.utils.typing import BoolArray, FloatArray

WHOLE_TREE = 1_000
"""Leaves that the tree of a learned goal may have."""


class LearnedCost:
    """What a step costs, learned from recorded rewards.

    Some environments reward the state that a step begins in, others the one that it
    leads to. Both are tried, and the one with the smaller error in cross-validation is
    taken. Most costs are quadratic, so the squares of variables and inputs are among the
    features.

    Args:
        transitions: with rewards.
        regressor: see `LearnedDynamics`.

    Attributes:
        error: root mean square error in cross-validation, in units of the deviation of
            the costs; 0 is perfect, 1 is no better than the mean.
        of_next_state: whether the cost depends on the state that the step leads to.
        largest: of the recorded costs.

    Raises:
        ValueError: there are no rewards, or too few steps.
    """

    def __init__(self, transitions: Transitions, regressor: Any = "auto") -> None:
        rewards = transitions.rewards
        remedy = 'give cost=, such as a function of x and u, (Q, R) or "time"'
        if rewards is None:
            raise ValueError(
                "a cost can be learned from rewards only, which this recording lacks; "
                f"{remedy}."
            )
        if len(transitions) < LEAST_STEPS:
            raise ValueError(
                f"a cost can be learned from {LEAST_STEPS} steps or more, got "
                f"{len(transitions)}; record more, or {remedy}."
            )
        self._mean = float(-rewards.mean())
        self._scale = float(rewards.std()) or 1.0
        self.largest = float(-rewards.min())
        targets = ((-rewards - self._mean) / self._scale)[:, None]
        angles = transitions.description.shown_angles
        before = angles.variables(transitions.states)
        after = angles.variables(transitions.next_states)
        self._features = Features.of(
            transitions.description, before, transitions.inputs, after
        )
        inputs = np.ascontiguousarray(transitions.inputs.T)
        self._numbered = transitions.description.numbered
        self._centre = before.mean(axis=0)
        self._per_unit = _per_unit(before)
        self._per_input = _per_unit(transitions.inputs)
        fits = []
        for states in (after, before):
            rows = self._rows(np.ascontiguousarray(states.T), inputs)
            fits.append(Fit(rows, targets, regressor))
        errors = [float(fit.regression.errors[0]) for fit in fits]
        best = int(np.argmin(errors))
        self.error, self.of_next_state = errors[best], best == 0
        self._fit = fits[best]

    def __deepcopy__(self, memo: Any) -> Self:
        """Itself: it does not change."""
        return self

    def __call__(
        self, before: FloatArray, after: FloatArray, inputs: FloatArray
    ) -> FloatArray:
        """The costs `(n,)` of steps from `before` to `after`, `(n_variables, n)`."""
        states = after if self.of_next_state else before
        found = self._fit.mean(self._rows(states, inputs))
        return np.asarray(self._mean + self._scale * found[:, 0])

    def _rows(self, states: FloatArray, inputs: FloatArray) -> FloatArray:
        """Features, circular variables as they are, and all squares."""
        plain = (states.T - self._centre) * self._per_unit
        turned = plain[:, self._features.period > 0.0]
        parts = [self._features.rows(states, inputs), turned, plain**2]
        if not self._numbered:
            parts.append((inputs.T * self._per_input) ** 2)
        return np.concatenate(parts, axis=1)


class LearnedGoal:
    """Where episodes end, learned from recorded terminations: a decision tree.

    Ends mostly lie behind thresholds, which a tree finds exactly. It knows ends only
    where it has seen some: it does not know a small goal that was never reached.

    Args:
        transitions: with terminations, of which some are True and some are not.

    Attributes:
        n_ends: how many ends were seen.
        recall: the share of the ends that are found by a tree which does not know their
            part of the data.
        precision: the share of the ends so found that are ends. None where none was
            found.
    """

    def __init__(self, transitions: Transitions) -> None:
        from sklearn.tree import DecisionTreeClassifier

        ends = transitions.terminated
        if ends is None or not can_be_learned(transitions):
            raise ValueError(
                "a goal can be learned only where some recorded steps ended an episode "
                "and others did not; give goal=."
            )
        angles = transitions.description.shown_angles
        after = angles.variables(transitions.next_states)
        before = angles.variables(transitions.states)
        inputs = transitions.inputs
        self._features = Features.of(transitions.description, before, inputs, after)
        self._n_inputs = inputs.shape[1]
        rows = self._rows(np.ascontiguousarray(after.T))

        def tree() -> Any:
            return DecisionTreeClassifier(max_leaf_nodes=WHOLE_TREE, random_state=0)

        with threadpool_limits(1):
            self._tree = tree().fit(rows, ends)
            folds, found = folds_of(len(rows)), np.zeros(len(rows), np.bool_)
            for fold in np.unique(folds):
                out = folds == fold
                found[out] = tree().fit(rows[~out], ends[~out]).predict(rows[out])
        self.n_ends = int(ends.sum())
        hits = int((found & ends).sum())
        self.recall = hits / self.n_ends
        self.precision = hits / int(found.sum()) if found.any() else None

    def __deepcopy__(self, memo: Any) -> Self:
        """Itself: it does not change."""
        return self

    def __call__(self, x: FloatArray) -> BoolArray:
        """Whether an episode ends in each of the states `(n_variables, n)`."""
        found: BoolArray = self._tree.predict(self._rows(x))
        return found

    def _rows(self, x: FloatArray) -> FloatArray:
        """The features of states; what the inputs are does not matter."""
        return self._features.rows(x, np.zeros((self._n_inputs, x.shape[1])))


def _per_unit(columns: FloatArray) -> FloatArray:
    """One over the deviation of each column, 1 where it does not change."""
    deviation = columns.std(axis=0)
    return np.asarray(1.0 / np.where(deviation > 0.0, deviation, 1.0))


def can_be_learned(transitions: Transitions) -> bool:
    """Whether some steps ended an episode, and others did not."""
    ends = transitions.terminated
    return ends is not None and bool(ends.any()) and not bool(ends.all())
