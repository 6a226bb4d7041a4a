"""The dynamics of a plant, learned from recorded transitions."""

from __future__ import annotations

from typing import Any, Self

import numpy as np
from scipy.spatial import KDTree

from acl_gym.envs.learned.description import Description
from acl_gym.envs.learned.features import Features, periods_of, variable_ends
from acl_gym.envs.learned.regression import LEAST_STEPS, Fit, checked_kind
from acl_gym.envs.learned.transitions import Transitions
from acl_gym.utils import validation
from acl_gym.utils.text import digits
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray


class LearnedDynamics:
    """x(t+1) = f(x(t), u(t)), fitted to recorded steps.

    Args:
        transitions: the steps, `LEAST_STEPS` or more.
        regressor: what predicts the change in a step: "gaussian process", "random
            features", "nearest neighbours", "gradient boosting", or an object with
            scikit-learn's `fit` and `predict`, which gets one output at a time. "auto"
            takes the one with the smallest error in cross-validation.
        per_action: fit one regression for each action instead of one that takes the
            input as a number. Each then knows its own steps only.
        n_draws: how many other functions there are that fit the data as well: draws from
            the posterior of a Gaussian process, or of random features. Other kinds of
            regression have the five of cross-validation.
        seed: of the draws; None takes another one each time.
        begin: dynamics learned from fewer steps of the same plant. The search for length
            scales begins there, and "auto" takes its kind of regression unless there are
            1.5 times as many steps as when kinds were last compared.

    Attributes:
        features: of states and inputs.

    Raises:
        ValueError: there are too few steps, an action was never tried with
            `per_action`, or the seed is negative.
        TypeError: `transitions` or `begin` are of another type, `per_action` is not True or
            False, or the seed is no integer.
    """

    def __init__(
        self,
        transitions: Transitions,
        regressor: Any = "auto",
        *,
        per_action: bool = False,
        n_draws: int = 0,
        seed: int | None = 0,
        begin: LearnedDynamics | None = None,
    ) -> None:
        if not isinstance(transitions, Transitions):
            raise TypeError(
                "transitions must be acl_gym.Transitions, got "
                f"{validation.shown(transitions)}."
            )
        if begin is not None and not isinstance(begin, LearnedDynamics):
            raise TypeError(
                "begin must be a LearnedDynamics or None, got "
                f"{validation.shown(begin)}."
            )
        kind = checked_kind(regressor)
        if len(transitions) < LEAST_STEPS:
            raise ValueError(
                f"a model needs {LEAST_STEPS} steps or more, got {len(transitions)}; "
                "record more."
            )
        n_draws = validation.integer("n_draws", n_draws, at_least=0, at_most=1_000)
        per_action = validation.boolean("per_action", per_action)
        seed = validation.seed(seed)
        if seed is None:
            seed = int(np.random.default_rng().integers(2**32))
        self.description = transitions.description
        angles = self.description.shown_angles
        before = angles.variables(transitions.states)
        after = angles.variables(transitions.next_states)
        inputs = transitions.inputs
        self.features = Features.of(self.description, before, inputs, after)
        rows = self.features.rows(
            np.ascontiguousarray(before.T), np.ascontiguousarray(inputs.T)
        )
        targets = self.features.targets(before, after)
        self._recorded = KDTree(rows)
        usable = ~_held_at_ends(self.description, after)
        self._inputs: FloatArray | None = None
        groups = [np.ones(len(rows), np.bool_)]
        if per_action:
            self._inputs, of_row = np.unique(inputs, axis=0, return_inverse=True)
            groups = [of_row.ravel() == each for each in range(len(self._inputs))]
            self._check_groups(groups)
        self._fits: list[Fit] = []
        for number, group in enumerate(groups):
            matching = begin is not None and len(begin._fits) == len(groups)
            self._fits.append(
                Fit(
                    rows[group],
                    targets[group],
                    kind,
                    usable=usable[group],
                    n_draws=n_draws,
                    seed=seed,
                    begin=begin._fits[number]
                    if begin is not None and matching
                    else None,
                )
            )

    def __deepcopy__(self, memo: Any) -> Self:
        """Itself: it does not change."""
        return self

    def _check_groups(self, groups: list[Any]) -> None:
        for values, group in zip(self._inputs, groups, strict=True):  # type: ignore[arg-type]
            if group.sum() < LEAST_STEPS:
                raise ValueError(
                    f"per_action needs {LEAST_STEPS} steps or more with each action, got "
                    f"{int(group.sum())} with the input {values.tolist()}; record more, "
                    "or leave per_action out."
                )

    @property
    def n_members(self) -> int:
        """The mean, and how many other functions there are."""
        return min(fit.regression.n_members for fit in self._fits)

    @property
    def regressor(self) -> str:
        """The kind of regression that was chosen."""
        return ", ".join(dict.fromkeys(fit.regression.name for fit in self._fits))

    @property
    def errors(self) -> dict[str, float]:
        """For each variable the error in cross-validation, relative to the mean change.

        0 is perfect; 1 is no better than to predict the same change everywhere.
        """
        columns = self.description.shown_angles.columns
        names = [self.description.state_names[column] for column in columns]
        mean = np.mean([fit.regression.errors for fit in self._fits], axis=0)
        return dict(zip(names, mean.tolist(), strict=True))

    @property
    def tried(self) -> dict[str, float]:
        """The mean error of each kind of regression that was tried."""
        names = self._fits[0].tried
        return {
            name: float(np.mean([fit.tried[name] for fit in self._fits]))
            for name in names
            if all(name in fit.tried for fit in self._fits)
        }

    def __repr__(self) -> str:
        """The kind of regression and its errors."""
        errors = ", ".join(
            f"{name.split(',')[0]} {digits(error)}"
            for name, error in self.errors.items()
        )
        return f"LearnedDynamics({self.regressor}; errors: {errors})"

    def next_variables(
        self, variables: FloatArray, inputs: FloatArray, members: IntArray | None = None
    ) -> FloatArray:
        """Predict the next states; circular variables may lie beyond their ends.

        Args:
            variables: states, angles as one variable each, `(n_variables, n)`.
            inputs: `(n_inputs, n)`.
            members: which function predicts each, `(n,)`, 0 to `n_members` - 1; None
                takes the mean, 0.

        Returns:
            A new array `(n_variables, n)`.
        """
        rows = self.features.rows(variables, inputs)
        if members is None:
            found = self._of_fits(rows, inputs, lambda fit, mine: fit.mean(rows[mine]))
        else:
            found = self._of_fits(
                rows,
                inputs,
                lambda fit, mine: fit.of_members(rows[mine], members[mine]),
            )
        return np.asarray(variables + self.features.changes(found).T)

    def spread(self, variables: FloatArray, inputs: FloatArray) -> FloatArray:
        """How uncertain the next states are, `(n,)`.

        The deviation of the least certain variable, given the data, in units of the
        deviation of its change in a step: 0 where everything is known, 1 and more where
        the data say nothing.

        Args:
            variables: `(n_variables, n)`.
            inputs: `(n_inputs, n)`.
        """
        rows = self.features.rows(variables, inputs)
        found = self._of_fits(rows, inputs, lambda fit, mine: fit.deviation(rows[mine]))
        return np.asarray(found.max(axis=1))

    def distance(self, variables: FloatArray, inputs: FloatArray) -> FloatArray:
        """How far the nearest recorded step is, `(n,)`.

        In features of unit size: 0 is a recorded step, and 1 is as far away as the
        standard deviation of one feature. Unlike `spread`, it does not assume that the
        dynamics are smooth.

        Args:
            variables: `(n_variables, n)`.
            inputs: `(n_inputs, n)`.
        """
        found, _ = self._recorded.query(self.features.rows(variables, inputs))
        return np.asarray(found)

    def _of_fits(self, rows: FloatArray, inputs: FloatArray, of: Any) -> FloatArray:
        """What `of` a fit and a mask or slice of its rows gives, for all rows."""
        if self._inputs is None:
            found: FloatArray = of(self._fits[0], slice(None))
            return found
        found = np.empty((len(rows), self.features.change_mean.size))
        left = np.ones(len(rows), np.bool_)
        for values, fit in zip(self._inputs, self._fits, strict=True):
            mine = (values == inputs.T).all(axis=1)
            if mine.any():
                found[mine] = of(fit, mine)
                left &= ~mine
        if left.any():
            raise ValueError(
                "per_action knows the inputs of its data only, got "
                f"{inputs.T[left][0].tolist()}; leave per_action out."
            )
        return found


def _held_at_ends(description: Description, variables: FloatArray) -> BoolArray:
    """Which variables are at a known end, `(n, n_variables)`.

    A wall holds them there, or a clip: what the dynamics would have done without it is
    not known, and the jump would spoil what is learned beside it.
    """
    low, high = variable_ends(description)
    ends = (variables <= low) | (variables >= high)
    return np.asarray(ends & (periods_of(description) == 0.0))
