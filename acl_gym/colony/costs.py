"""What a solution costs: any function of the complete solution.

By default an ant's cost J is the sum of the stage costs that the environment charges
(3.2). A `Cost` is computed from the complete solution instead, so it can express what no
reward per step expresses, such as a short rise time or little overshoot (§3.5.3,
§7.3). Costs add up: `SettlingTime(0, 3.14, 0.1) + 2.0 * Overshoot(0, 3.14) + 0.1`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from acl_gym.colony.cost import Constant, Cost, Sum, Weighted
from acl_gym.colony.episodes import Episode, Episodes
from acl_gym.colony.response_costs import Overshoot, RiseTime, SettlingTime
from acl_gym.utils import validation
from acl_gym.utils.serialization import Unsaved, from_settings, make_plain
from acl_gym.utils.typing import FloatArray


@dataclass(frozen=True)
class StageCosts(Cost):
    """The sum of the environment's stage costs: what J is without a cost object."""

    def __call__(self, episodes: Episodes) -> FloatArray:
        """See `Cost`."""
        return np.asarray(np.sum(episodes.stage_costs, axis=0, where=episodes.taken()))


@dataclass(frozen=True)
class Steps(Cost):
    """The number of steps: the cost of the grid searches (§3.6.2)."""

    def __call__(self, episodes: Episodes) -> FloatArray:
        """See `Cost`."""
        return episodes.lengths.astype(np.float64)


@dataclass(frozen=True)
class Quadratic(Cost):
    """The quadratic cost (3.2): the sum over t of e(t+1)' Q e(t+1) + u(t)' R u(t).

    Attributes:
        goal: x_g, `(d,)`.
        state_weight: Q, the diagonal `(d,)` or the matrix `(d, d)`.
        inputs: u of each action, `(n_actions, m)`; None: actions cost nothing. Where a
            policy sets real inputs, its own are weighed.
        input_weight: R, the diagonal `(m,)` or the matrix `(m, m)`.
        periods: for each variable its period if circular, else None; an error is then
            measured the short way round.
    """

    goal: tuple[float, ...]
    state_weight: tuple[Any, ...]
    inputs: tuple[tuple[float, ...], ...] | None = None
    input_weight: tuple[Any, ...] | None = None
    periods: tuple[float | None, ...] | None = None

    def __post_init__(self) -> None:
        make_plain(self)
        size = validation.real_array("goal", self.goal, ndim=1).size
        _weight("state_weight", self.state_weight, size)
        if (self.inputs is None) != (self.input_weight is None):
            raise ValueError(
                "inputs and input_weight belong together, got one of them only."
            )
        if self.inputs is not None:
            inputs = validation.real_array("inputs", self.inputs, ndim=2)
            _weight("input_weight", self.input_weight, inputs.shape[1])
        if self.periods is not None:
            periods: Any = self.periods
            listed = isinstance(periods, (tuple, list)) or np.shape(periods) == (size,)
            if not listed or len(periods) != size:
                raise ValueError(
                    f"periods must hold one entry for each of the {size} variables, got "
                    f"{validation.shown(self.periods)}."
                )
            for axis, period in enumerate(self.periods):
                if period is not None:
                    validation.number(f"periods[{axis}]", period, above=0)

    def __call__(self, episodes: Episodes) -> FloatArray:
        """See `Cost`."""
        goal = np.asarray(self.goal, dtype=np.float64)
        error = episodes.observations[1:].astype(np.float64)
        error = error.reshape(*error.shape[:2], -1) - goal
        for axis, period in enumerate(self.periods or ()):
            if period is not None:
                turns = np.round(error[..., axis] / period)
                error[..., axis] -= period * turns
        weight = _weight("state_weight", self.state_weight, goal.size)
        stage = np.einsum("tni,ij,tnj->tn", error, weight, error)
        if self.inputs is not None:
            inputs = np.asarray(self.inputs, dtype=np.float64)
            weight = _weight("input_weight", self.input_weight, inputs.shape[1])
            actions = episodes.actions
            if actions.dtype.kind == "f":  # the inputs themselves
                stage += np.einsum("tni,ij,tnj->tn", actions, weight, actions)
            else:
                of_action = np.einsum("ui,ij,uj->u", inputs, weight, inputs)
                stage += of_action[actions]
        return np.asarray(np.sum(stage, axis=0, where=episodes.taken()))


@dataclass(frozen=True)
class FunctionCost(Cost):
    """A user's function of one solution.

    Attributes:
        function: takes an `Episode`, returns its cost.
    """

    function: Callable[[Episode], float]

    def __call__(self, episodes: Episodes) -> FloatArray:
        """See `Cost`."""
        return np.array(
            [
                validation.number(
                    f"the cost of ant {ant}", self.function(episodes[ant])
                )
                for ant in range(len(episodes))
            ]
        )


class MissingCost(Unsaved, Cost):
    """Stands in for a user's own cost in an agent read from a file."""


_KINDS = (
    StageCosts,
    Steps,
    Quadratic,
    RiseTime,
    SettlingTime,
    Overshoot,
    Constant,
    Sum,
    Weighted,
    FunctionCost,
)


def as_cost(cost: Cost | Callable[[Episode], float] | None) -> Cost | None:
    """Bring every accepted form of `cost` into an object; None stays None.

    Raises:
        TypeError: it is neither a `Cost` nor a function.
    """
    if cost is None or isinstance(cost, Cost):
        return cost
    if callable(cost) and not isinstance(cost, type):
        return FunctionCost(cost)
    raise TypeError(
        "cost must be a Cost such as Steps(), or a function of one solution, got "
        f"{validation.shown(cost)}."
    )


def solution_costs(cost: Cost, episodes: Episodes) -> FloatArray:
    """J of each ant, checked.

    Raises:
        ValueError: the cost does not give one finite number for each ant.
    """
    found = cost(episodes)
    costs = validation.as_array(found)
    if (
        costs is None
        or costs.dtype.kind not in "biuf"
        or costs.shape != (len(episodes),)
        or not np.isfinite(costs).all()
    ):
        raise ValueError(
            f"a cost must give one finite number for each of the {len(episodes)} ants, "
            f"got {validation.shown(found)} from {validation.shown(cost)}."
        )
    return costs.astype(np.float64)


def cost_from_settings(settings: Any) -> Cost | None:
    """A cost from the settings in a file.

    Raises:
        ValueError: they are not those of a cost.
    """
    cost = from_settings("cost", settings, _KINDS, MissingCost)
    if cost is not None and not isinstance(cost, Cost):
        raise ValueError(f"cost must be a Cost, got {validation.shown(settings)}.")
    return cost


def _weight(name: str, values: Any, size: int) -> FloatArray:
    weight = validation.real_array(name, values)
    if weight.shape == (size,):
        weight = np.diag(weight)
    valid = weight.shape == (size, size) and np.array_equal(weight, weight.T)
    if not (valid and np.linalg.eigvalsh(weight)[0] >= -1e-12 * np.abs(weight).max()):
        raise ValueError(
            f"{name} must be a diagonal of {size} numbers or a symmetric positive "
            f"semi-definite ({size}, {size}) matrix, got {validation.shown(values)}."
        )
    return weight
