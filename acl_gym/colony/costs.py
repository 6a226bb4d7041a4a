"""What a solution costs: any function of the complete solution.

By default an ant's cost J is the sum of the stage costs that the environment charges
(3.2). A `Cost` is computed from the complete solution instead, so it can express what no
reward per step expresses, such as a short rise time or little overshoot (§3.5.3,
§7.3). Costs add up: `SettlingTime(0, 3.14, 0.1) + 2.0 * Overshoot(0, 3.14) + 0.1`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from acl_gym.colony.episodes import Episode, Episodes
from acl_gym.utils import validation
from acl_gym.utils.serialization import Savable, Unsaved, from_settings, make_plain
from acl_gym.utils.typing import FloatArray


class Cost(Savable, ABC):
    """A cost of complete solutions; lower is better."""

    @abstractmethod
    def __call__(self, episodes: Episodes) -> FloatArray:
        """Return J of each ant, `(n,)`."""

    def __add__(self, other: Cost | float) -> Cost:
        """The sum of two costs, or of a cost and a constant."""
        term = other if isinstance(other, Cost) else Constant(other)
        # One sum of many terms, not sums in sums, which Python limits.
        return Sum((*self.terms, term) if type(self) is Sum else (self, term))

    __radd__ = __add__

    def __mul__(self, factor: float) -> Cost:
        """The cost times a factor > 0."""
        return Weighted(factor, self)

    __rmul__ = __mul__


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
class _Response(Cost):
    """A measure of how one state variable goes from where it was to a target.

    Attributes:
        variable: index of the state variable.
        target: its desired value.
    """

    variable: int
    target: float

    @property
    @abstractmethod
    def period(self) -> float | None:
        """The period of a circular variable, > 0; else None."""

    def __post_init__(self) -> None:
        make_plain(self)
        validation.integer("variable", self.variable, at_least=0)
        validation.number("target", self.target)
        if self.period is not None:
            validation.number("period", self.period, above=0)

    def _error(self, episodes: Episodes) -> FloatArray:
        """Target less value, `(longest + 1, n)`; circular: to the nearest target."""
        period = self.period
        values = episodes.variable(self.variable, period)
        target = np.full(len(episodes), self.target)
        if period is not None:
            # Unwrapped, the target lies at every period: the one where the ant ends.
            target += period * np.round((values[-1] - target) / period)
        return np.asarray(target - values)


@dataclass(frozen=True)
class RiseTime(_Response):
    """The time from `low` to `high` of the way to the target.

    Crossings are interpolated between samples. A solution that never gets as far as
    `high` costs its whole duration; one that begins at the target costs 0.

    Attributes:
        low: fraction of the way, in [0, 1).
        high: fraction of the way, in (low, 1].
        sampling_time: s, the time of a step.
        period: of a circular variable.
    """

    low: float = 0.1
    high: float = 0.9
    sampling_time: float = 1.0
    period: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        validation.number("low", self.low, at_least=0, below=1)
        validation.number("high", self.high, above=self.low, at_most=1)
        validation.number("sampling_time", self.sampling_time, above=0)

    def __call__(self, episodes: Episodes) -> FloatArray:
        """See `Cost`."""
        error = self._error(episodes)
        span = error[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            progress = np.where(span == 0.0, 1.0, 1.0 - error / span)
        begin = _first_crossing(progress, self.low)
        end = _first_crossing(progress, self.high)
        steps = episodes.lengths.astype(np.float64)
        np.subtract(end, begin, out=steps, where=np.isfinite(end))
        return np.asarray(self.sampling_time * steps)


@dataclass(frozen=True)
class SettlingTime(_Response):
    """The time after which the variable stays within a band around the target.

    A solution that ends outside the band costs its whole duration, as does one that
    enters it with its last step.

    Attributes:
        tolerance: half-width of the band, > 0, in units of the variable.
        sampling_time: s, the time of a step.
        period: of a circular variable.
    """

    tolerance: float = 0.05
    sampling_time: float = 1.0
    period: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        validation.number("tolerance", self.tolerance, above=0)
        validation.number("sampling_time", self.sampling_time, above=0)

    def __call__(self, episodes: Episodes) -> FloatArray:
        """See `Cost`."""
        outside = np.abs(self._error(episodes)) > self.tolerance
        times = np.arange(len(outside))[:, None]
        # The first time of those after which it is inside for good.
        settled = np.max(np.where(outside, times + 1, 0), axis=0)
        return np.asarray(self.sampling_time * np.minimum(settled, episodes.lengths))


@dataclass(frozen=True)
class Overshoot(_Response):
    """How far the variable goes beyond the target, seen from where it began.

    In units of the variable; 0 without overshoot, so that it cannot be used alone,
    because 1 / J would be infinite: add another cost or a constant.

    Attributes:
        period: of a circular variable.
    """

    period: float | None = None

    def __call__(self, episodes: Episodes) -> FloatArray:
        """See `Cost`."""
        error = self._error(episodes)
        beyond = -np.sign(error[0]) * error
        return np.asarray(np.max(beyond, axis=0, initial=0.0))


@dataclass(frozen=True)
class Constant(Cost):
    """The same for every solution.

    Attributes:
        value: >= 0.
    """

    value: float

    def __post_init__(self) -> None:
        make_plain(self)
        validation.number("value", self.value, at_least=0)

    def __call__(self, episodes: Episodes) -> FloatArray:
        """See `Cost`."""
        return np.full(len(episodes), float(self.value))


@dataclass(frozen=True)
class Sum(Cost):
    """The sum of costs.

    Attributes:
        terms: the costs.
    """

    terms: tuple[Cost, ...]

    def __post_init__(self) -> None:
        make_plain(self)
        if not isinstance(self.terms, (tuple, list)) or not self.terms:
            raise TypeError(f"terms must be Costs, got {validation.shown(self.terms)}.")
        _check_costs("terms", self.terms)

    def __call__(self, episodes: Episodes) -> FloatArray:
        """See `Cost`."""
        return np.asarray(sum(term(episodes) for term in self.terms))


@dataclass(frozen=True)
class Weighted(Cost):
    """A cost times a factor.

    Attributes:
        factor: > 0.
        cost: the cost.
    """

    factor: float
    cost: Cost

    def __post_init__(self) -> None:
        make_plain(self)
        validation.number("factor", self.factor, above=0)
        _check_costs("cost", (self.cost,))

    def __call__(self, episodes: Episodes) -> FloatArray:
        """See `Cost`."""
        return self.factor * self.cost(episodes)


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


def _first_crossing(progress: FloatArray, level: float) -> FloatArray:
    """When each column first reaches `level`, interpolated; inf where it never does."""
    above = progress >= level
    step = np.argmax(above, axis=0)
    columns = np.arange(progress.shape[1])
    after, before = progress[step, columns], progress[np.maximum(step - 1, 0), columns]
    with np.errstate(divide="ignore", invalid="ignore"):
        part = np.where(step > 0, (after - level) / (after - before), 0.0)
    return np.where(above.any(axis=0), step - part, np.inf)


def _check_costs(name: str, costs: Any) -> None:
    for cost in costs if isinstance(costs, (tuple, list)) else (costs,):
        if not isinstance(cost, Cost):
            raise TypeError(
                f"{name} must be made of Costs such as Steps(), got "
                f"{validation.shown(cost)}; make "
                "a Cost of a function with FunctionCost(function)."
            )


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
