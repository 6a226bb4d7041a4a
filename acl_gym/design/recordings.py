"""The plant that recorded measurements describe, in the words of a command line."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces

from acl_gym.design.simulation import Responses
from acl_gym.envs.learned.env import LearnedVectorEnv
from acl_gym.envs.learned.quality import UNSURE
from acl_gym.envs.learned.transitions import Transitions
from acl_gym.utils.typing import FloatArray

_AT_ONCE = 20_000  # steps, so that memory does not matter


@dataclass(frozen=True)
class Recording:
    """What a file of measurements holds, and what is wanted of the plant.

    Attributes:
        state: names of the columns of the state.
        input: names of the columns of the inputs.
        goal: the state to which the plant is to be brought.
        tolerance: half-widths of the goal.
        cost: "time", or a pair of weights on error and input, see `acl_gym.plant`.
        circular: names of the variables that wrap around.
        low: lower ends of the variables, None where the data say.
        high: upper ends.
        starts: lower and upper ends of the states in which episodes begin, uniformly; which
            must lie within the range. None begins in recorded states.
        actions: the inputs of each action, `(n_actions, n_inputs)`; None takes those that
            occur in the data.
        time: the column of the time, s; None where rows follow at `sampling_time`.
        run: the column whose value changes from one run to the next, or None.
        sampling_time: s.
        max_steps: T, steps within which the goal is to be reached.
    """

    state: tuple[str, ...]
    input: tuple[str, ...]
    goal: tuple[float, ...]
    tolerance: tuple[float, ...] | None = None
    cost: Any = "time"
    circular: tuple[str, ...] = ()
    low: tuple[float | None, ...] | None = None
    high: tuple[float | None, ...] | None = None
    starts: tuple[tuple[float, ...], tuple[float, ...]] | None = None
    actions: tuple[tuple[float, ...], ...] | None = None
    time: str | None = None
    run: str | None = None
    sampling_time: float | None = None
    max_steps: int = 100


def plant_of_recording(path: str | Path, recording: Recording) -> LearnedVectorEnv:
    """Learn the dynamics that measurements show.

    Args:
        path: a CSV or Parquet file with a row for each moment.
        recording: what its columns are, and what is wanted.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: a column is missing, holds what is no number, or does not fit.

    Warns:
        DataWarning: something speaks against learning from this data.
    """
    file = Path(path)
    read = Transitions.from_csv
    if file.suffix.lower() == ".parquet":
        read = Transitions.from_parquet
    if recording.time is None and recording.sampling_time is None:
        raise ValueError(
            "the time between two rows must be known, got neither the column of the time "
            "in seconds nor the sampling time; give --time NAME or --sampling-time S."
        )
    size = len(recording.state)
    if len(recording.goal) != size:
        raise ValueError(
            f"goal must hold a number for each of the {size} columns of the state, got "
            f"{len(recording.goal)}."
        )
    ends = {} if recording.low is None else {"low": _circular_only(recording, "low")}
    if recording.high is not None:
        ends["high"] = _circular_only(recording, "high")
    data = read(
        file,
        state=list(recording.state),
        input=list(recording.input),
        time=recording.time,
        run=recording.run,
        sampling_time=recording.sampling_time,
        circular=list(recording.circular),
        **ends,
    )
    initial: Any = "data"
    if recording.starts is not None:
        initial = _box_of_starts(recording.starts, size)
    return LearnedVectorEnv(
        data,
        goal=list(recording.goal),
        tolerance=None if recording.tolerance is None else list(recording.tolerance),
        cost=recording.cost,
        inputs=recording.actions,
        low=recording.low,
        high=recording.high,
        initial=initial,
        max_episode_steps=recording.max_steps,
    )


def _box_of_starts(
    starts: tuple[tuple[float, ...], tuple[float, ...]], size: int
) -> spaces.Box:
    """The states in which episodes begin."""
    low, high = (np.array(ends, dtype=np.float64) for ends in starts)
    good = low.shape == high.shape == (size,)
    if not good or not np.isfinite(high - low).all() or (low > high).any():
        raise ValueError(
            f"starts must hold {size} lower and {size} upper ends, one for each column of "
            f"the state, finite and low <= high, got {low.tolist()} and {high.tolist()}."
        )
    return spaces.Box(low, high, dtype=np.float64)


def _circular_only(recording: Recording, end: str) -> list[float | None]:
    """Ends of circular variables; those of others are limits, no part of the data."""
    values = getattr(recording, end)
    if len(values) != len(recording.state):
        raise ValueError(
            f"{end} must hold a number, or nothing, for each of the "
            f"{len(recording.state)} columns of the state, got {len(values)}."
        )
    return [
        value if name in recording.circular else None
        for name, value in zip(recording.state, values, strict=True)
    ]


def model_facts(env: LearnedVectorEnv, responses: Responses) -> dict[str, Any]:
    """What is known of a learned model, and how sure it is on the ways of a controller.

    Args:
        env: the model.
        responses: of the controller.

    Returns:
        Plain numbers and texts: `steps` and `runs` that were recorded, `regressor`, the
        `errors` of each variable in cross-validation, `doubts` about the data, the
        `starts`, lower and upper ends where these were given, else None, and the `spread`, the largest on the way to the goal from each start: its median, 95%
        quantile and worst, and the share of starts, `unsure`, for which it exceeds the `limit`.
    """
    data, dynamics = env.transitions, env.dynamics
    largest = largest_spreads(env, responses)
    return {
        "steps": len(data),
        "runs": len(data.starts),
        "regressor": dynamics.regressor,
        "errors": dynamics.errors,
        "doubts": data.doubts(),
        "starts": _ends_of_starts(env),
        "sampling_time": env.system.sampling_time,
        "spread": {
            "median": float(np.median(largest)),
            "high": float(np.quantile(largest, 0.95)),
            "worst": float(largest.max()),
            "limit": UNSURE,
            "unsure": float((largest > UNSURE).mean()),
        },
    }


def _ends_of_starts(env: LearnedVectorEnv) -> list[list[float]] | None:
    box = env.parameters["initial"]
    return (
        [box.low.tolist(), box.high.tolist()] if isinstance(box, spaces.Box) else None
    )


def spread_over(env: LearnedVectorEnv, states: FloatArray) -> FloatArray:
    """The spread of the least certain action in each of some states, `(n,)`."""
    spreads = [
        env.spread(states, np.full(len(states), action))
        for action in range(len(env.system.inputs))
    ]
    return np.asarray(np.max(spreads, axis=0))


def largest_spreads(env: LearnedVectorEnv, responses: Responses) -> FloatArray:
    """The largest spread on the way to the goal, of each start, `(n,)`."""
    steps = np.minimum(responses.steps_to_goal(), responses.limit)
    times, starts = np.nonzero(np.arange(responses.limit)[:, None] < steps)
    states = responses.states[times, starts]
    actions = responses.actions[times, starts]
    spreads = np.concatenate(
        [
            env.spread(states[i : i + _AT_ONCE], actions[i : i + _AT_ONCE])
            for i in range(0, len(states), _AT_ONCE)
        ]
    )
    largest = np.zeros(responses.count)
    np.maximum.at(largest, starts, spreads)
    return largest
