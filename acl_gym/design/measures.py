"""Figures of a controller: success, cost, settling time, overshoot, what it does then."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from acl_gym.costs import Episodes, Overshoot
from acl_gym.design.simulation import Responses
from acl_gym.envs.plant import Plant
from acl_gym.utils.typing import BoolArray, FloatArray


@dataclass(frozen=True)
class Spread:
    """A quantity over many starts.

    Attributes:
        mean: its mean.
        median: its median.
        high: what 95% of the starts do not exceed.
        worst: the largest value.
    """

    mean: float
    median: float
    high: float
    worst: float


@dataclass(frozen=True)
class Measures:
    """What a controller does from many starts.

    Attributes:
        starts: how many.
        success_rate: the share from which the goal is reached within the time limit.
        cost: until the goal is reached, or of the whole time where it is not.
        time_to_goal: s, of the starts that reach it; None if none does.
        settled_rate: the share whose states are in the goal during the whole last quarter of
            twice the time limit, the controller going on all the time.
        settling_time: s, of those starts, the time after which the state does not leave
            the goal again; None if there are none.
        overshoot: for each variable, how far it goes beyond the goal as seen from where it
            began, in its unit; empty where the goal is not a place.
        remaining: for each variable, the largest distance from the middle of the goal
            during that quarter, of the starts that have reached the goal; in its unit.
        worst_start: the start of the highest cost; one that fails if any does.
        typical_start: the successful start whose cost is the median of all successful
            ones; of all starts if none succeeds.
        late_rate: the share from which the goal is reached, but after the time limit.
        nearest: how near those that fail come to the goal within the time limit: the
            median over them of the least distance, in multiples of the half-widths of the
            goal; None where none fails, or the goal is no place.
    """

    starts: int
    success_rate: float
    cost: Spread
    time_to_goal: Spread | None
    settled_rate: float
    settling_time: Spread | None
    overshoot: dict[str, Spread]
    remaining: dict[str, Spread]
    worst_start: tuple[float, ...]
    typical_start: tuple[float, ...]
    late_rate: float
    nearest: float | None

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers, for JSON."""
        return asdict(self)


def measure(responses: Responses, plant: Plant) -> Measures:
    """Measure responses that are simulated for twice the time limit.

    Args:
        responses: see `simulate`.
        plant: the system.
    """
    step, inside = plant.sampling_time, responses.inside
    to_goal, success = responses.steps_to_goal(), responses.success()
    costs = responses.episode_costs()
    settled = responses.settled()
    outside = ~inside
    # The step after the last one that ends outside the goal.
    last_outside = len(inside) - outside[::-1].argmax(axis=0)
    settling = np.where(outside.any(axis=0), last_outside + 1, 1)
    names = plant.variable_names
    return Measures(
        starts=responses.count,
        success_rate=float(success.mean()),
        cost=_spread(costs),
        time_to_goal=_spread_of(step * to_goal, success),
        settled_rate=float(settled.mean()),
        settling_time=_spread_of(step * settling, settled),
        overshoot=dict(zip(names, _overshoots(responses, plant), strict=False)),
        remaining=dict(zip(names, _remaining(responses, plant, success), strict=False)),
        worst_start=_state(responses, worst(responses)),
        typical_start=_state(responses, typical(responses)),
        late_rate=float((inside.any(axis=0) & ~success).mean()),
        nearest=_nearest(responses, plant, ~success),
    )


def worst(responses: Responses) -> int:
    """The number of the worst start."""
    costs, success = responses.episode_costs(), responses.success()
    if not success.all():
        costs = np.where(success, -np.inf, costs)
    return int(costs.argmax())


def typical(responses: Responses) -> int:
    """The number of the start whose cost is the median."""
    costs, success = responses.episode_costs(), responses.success()
    among = np.flatnonzero(success) if success.any() else np.arange(len(costs))
    return int(among[np.argsort(costs[among], kind="stable")[(len(among) - 1) // 2]])


def periods(plant: Plant) -> list[float | None]:
    """The period of each variable, None where it does not wrap around."""
    return [
        float(plant.high[axis] - plant.low[axis]) if axis in plant.circular else None
        for axis in range(plant.low.size)
    ]


def distances(states: FloatArray, plant: Plant) -> FloatArray | None:
    """How far states lie from the middle of the goal, the short way round.

    Args:
        states: `(..., state_size)`.
        plant: the system.

    Returns:
        Of the same shape, >= 0; None where the goal is a function, or there is none.
    """
    box = plant.goal_box
    if box is None or not np.isfinite(box).all():
        return None
    error: FloatArray = states - box.mean(axis=0)
    for axis, period in enumerate(periods(plant)):
        if period is not None:
            error[..., axis] -= period * np.round(error[..., axis] / period)
    return np.abs(error)


def _overshoots(responses: Responses, plant: Plant) -> list[Spread]:
    box = plant.goal_box
    if box is None or not np.isfinite(box).all():
        return []
    count = responses.count
    lengths = np.full(count, len(responses.actions))
    episodes = Episodes(
        responses.states,
        responses.actions,
        responses.costs,
        lengths,
        np.zeros(count, np.bool_),
    )
    centre = box.mean(axis=0)
    return [
        _spread(Overshoot(axis, float(centre[axis]), period)(episodes))
        for axis, period in enumerate(periods(plant))
    ]


def _remaining(responses: Responses, plant: Plant, success: BoolArray) -> list[Spread]:
    """The largest distance of each start that succeeds in the last quarter."""
    error = distances(responses.states[-responses.last_quarter :], plant)
    if error is None or not success.any():
        return []
    return [_spread(values) for values in error.max(axis=0)[success].T]


def _nearest(responses: Responses, plant: Plant, failed: BoolArray) -> float | None:
    # Where a start fails, no state is in the goal until then but perhaps the first.
    within = responses.states[1 : responses.limit + 1, failed]
    error, box = distances(within, plant), plant.goal_box
    if error is None or box is None or not failed.any():
        return None
    half = np.maximum((box[1] - box[0]) / 2, np.finfo(float).tiny)
    return float(np.median((error / half).max(axis=-1).min(axis=0)))


def _state(responses: Responses, start: int) -> tuple[float, ...]:
    return tuple(responses.states[0, start].tolist())


def _spread(values: Any) -> Spread:
    array = np.asarray(values, dtype=np.float64)
    return Spread(
        float(array.mean()),
        float(np.median(array)),
        float(np.quantile(array, 0.95)),
        float(array.max()),
    )


def _spread_of(values: Any, chosen: BoolArray) -> Spread | None:
    return _spread(np.asarray(values)[chosen]) if chosen.any() else None
