"""The policy between the actions of a table: real inputs from levels of a few."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acl_gym.colony.greedy import greedy_actions, weighted_value
from acl_gym.envs.control.signals import Signals
from acl_gym.policies.table import TablePolicy
from acl_gym.utils import validation
from acl_gym.utils.compiling import njit
from acl_gym.utils.input_grid import InputGrid
from acl_gym.utils.parameters import Fixed
from acl_gym.utils.text import short
from acl_gym.utils.typing import CellArray, FloatArray, IntArray


class InterpolatedPolicy(Fixed):
    """Chooses real inputs between the best action of a table and its neighbours.

    The actions of the table are points of a grid over the inputs. At a state, let v0 be
    the value (4.16) of the best action u0, and v-, v+ those of its neighbours u-, u+
    along one input. The input chosen is the vertex of the parabola through the three,

        u = u0 + (d- h+ / s) h+ / 2 - (d+ h- / s) h- / 2,    s = d- h+ + d+ h-,

    with d = v0 - v and h the distance to the neighbour: the mean of the three inputs,
    weighted by differences of their levels, and exact where values are quadratic in the
    input, as those of a quadratic cost nearly are. It lies no farther from u0 than halfway to a
    neighbour, depends on differences only, and so holds alike for levels of pheromone,
    action values and expected costs of any sign. It changes with the state as the values
    do, but where the best action changes from one point to the next of the same values.

    Along each input by itself. Where u0 is at the end of the grid, where all three values
    are the same, or where one is infinite, the input is that of u0.
    docs/continuous-actions.md compares this with other rules, and with more actions.

    Args:
        policy: the greedy policy over the table, which it follows if that changes.
        inputs: of each action, `(n_actions,)` or `(n_actions, n_inputs)`; None takes
            those that the policy knows.

    Attributes:
        greedy: the policy over the table.
        grid: the inputs of the actions.
        dtype: of the inputs that `predict` returns: the one that the environment takes,
            float64 where `inputs` were given.

    Raises:
        TypeError: `policy` is no `TablePolicy`.
        ValueError: the inputs are not known, do not form a grid, or are not one row for
            each action.
    """

    _fixed = ("greedy", "grid", "dtype")

    def __init__(self, policy: TablePolicy, inputs: ArrayLike | None = None) -> None:
        if not isinstance(policy, TablePolicy):
            raise TypeError(
                f"policy must be a TablePolicy, got {validation.shown(policy)}; pass "
                "agent.policy, or call agent.interpolated_policy()."
            )
        signals = policy.signals
        if inputs is not None:
            names = () if signals is None else signals.observations
            signals = Signals.of_inputs(inputs, names)
        elif signals is None:
            raise ValueError(
                "the inputs of the actions must be known to interpolate between them, "
                "got an environment that does not tell; pass inputs=, a row for each "
                f"of the {policy.n_actions} actions, or learn in acl_gym.ActionGrid."
            )
        self.grid = InputGrid(signals.values)
        if len(self.grid.values) != policy.n_actions:
            raise ValueError(
                f"inputs must hold a row for each of the {policy.n_actions} actions, got "
                f"{len(self.grid.values)}."
            )
        self.greedy = policy
        self.dtype = np.dtype(signals.dtype)
        self._signals = signals

    def __repr__(self) -> str:
        """Partition and grid."""
        counts = " x ".join(map(str, self.grid.counts))
        partition = short(repr(self.greedy.partition))
        return f"InterpolatedPolicy({partition}, between {counts} actions)"

    def predict(
        self,
        observation: ArrayLike,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[Any], Any]:
        """Choose inputs, as in Stable-Baselines3 for a Box of actions.

        Args:
            observation: one observation or a batch of them.
            state: returned as it is.
            episode_start: not used.
            deterministic: not used, the policy draws nothing.

        Returns:
            `(inputs, state)`, an array `(n, n_inputs)`, for a single observation
            `(n_inputs,)`, of type `dtype`.

        Raises:
            ValueError: an observation is not finite or has the wrong shape.
        """
        index, degree, single = self.greedy.located(observation)
        inputs = self._inputs(index, degree)
        return (inputs[0] if single else inputs), state

    def copy(self) -> InterpolatedPolicy:
        """The same policy over a table that no longer changes."""
        copied = object.__new__(type(self))
        copied.__dict__.update({**self.__dict__, "greedy": self.greedy.copy()})
        return copied

    def _inputs(self, index: CellArray, degree: FloatArray) -> NDArray[Any]:
        """The inputs for cells and degrees `(n, k)`."""
        table, grid = self.greedy.table, self.grid
        best = greedy_actions(table, self.greedy.ranks, index, degree)
        inputs = np.empty((len(index), grid.n_inputs))
        _interpolate(
            table, index, degree, best, grid.values, grid.below, grid.above, inputs
        )
        return inputs.astype(self.dtype, copy=False)


@njit
def vertex(
    lower: float, middle: float, upper: float, low: float, best: float, high: float
) -> float:
    """Where the parabola through three points is highest, if the middle one is.

    Args:
        lower: the input below.
        middle: the input whose value is the largest.
        upper: the input above.
        low: the value of the input below.
        best: the largest value.
        high: the value of the input above.

    Returns:
        An input between the middles of the two intervals; `middle` where all values are
        alike, or one is not finite.
    """
    # Halved, so that no difference of finite numbers overflows.
    fall_below = 0.5 * best - 0.5 * low
    fall_above = 0.5 * best - 0.5 * high
    largest = max(fall_below, fall_above)
    if not (np.isfinite(fall_below) and np.isfinite(fall_above) and largest > 0.0):
        return middle
    down, up = middle - lower, upper - middle
    towards_upper = fall_below / largest * up
    towards_lower = fall_above / largest * down
    share = towards_upper / (towards_upper + towards_lower)
    return middle + 0.5 * (share * up - (1.0 - share) * down)


@njit
def _interpolate(
    table: FloatArray,
    index: CellArray,
    degree: FloatArray,
    best: IntArray,
    values: FloatArray,
    below: IntArray,
    above: IntArray,
    inputs: FloatArray,
) -> None:
    """Write the input between the best action of each state and its neighbours.

    Args:
        table: `(n_cells, n_actions)`.
        index: cells of the states, `(n, k)`.
        degree: their degrees, `(n, k)`.
        best: the best action of each state, `(n,)`.
        values: inputs of the actions, `(n_actions, n_inputs)`.
        below: see `InputGrid`.
        above: see `InputGrid`.
        inputs: receives the result, `(n, n_inputs)`.
    """
    for j in range(index.shape[0]):
        u = best[j]
        top = weighted_value(table, index[j], degree[j], u)
        for i in range(values.shape[1]):
            middle, lower, upper = values[u, i], below[u, i], above[u, i]
            inputs[j, i] = middle
            if lower >= 0 and upper >= 0:
                inputs[j, i] = vertex(
                    values[lower, i],
                    middle,
                    values[upper, i],
                    weighted_value(table, index[j], degree[j], lower),
                    top,
                    weighted_value(table, index[j], degree[j], upper),
                )
