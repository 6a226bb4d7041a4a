"""A partition for any environment, so that an agent can do without being given one."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv

from acl_gym.envs.control.environments import ControlEnv, ControlVectorEnv
from acl_gym.envs.control.system import ControlSystem
from acl_gym.partitions import named
from acl_gym.partitions.base import Partition
from acl_gym.partitions.discrete import FINITE_SPACES, Discrete
from acl_gym.partitions.grid import Fuzzy, Grid
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray

Env = gym.Env[Any, Any] | VectorEnv[Any, Any, Any]

CENTRES = {1: 101, 2: 41, 3: 15, 4: 7, 5: 5, 6: 3}
"""Number of variables -> centres of each."""

INFINITE = 1e30
"""A bound beyond this is none: some spaces write the largest float for infinity."""

MARGIN = 0.25
"""`estimate_bounds` widens what it saw by this share of the range on either side."""

_NAMED: dict[str, Callable[[Any, type[Grid]], Grid]] = {
    "acl_gym.envs.pendulum.system.Pendulum": lambda system, kind: named.pendulum(
        kind=kind, omega_max=system.omega_max
    ),
    "acl_gym.envs.navigation.system.Navigation": lambda system, kind: named.navigation(
        "regular", kind=kind
    ),
}
"""Class of a system -> the partition that the thesis gives it."""


def automatic_partition(
    env: Env,
    *,
    kind: type[Grid] = Fuzzy,
    cells: int | Sequence[int] | None = None,
    bounds: Mapping[int, tuple[float, float]] | None = None,
    random_steps: int | None = None,
    seed: int = 0,
) -> Partition:
    """Choose a partition for the observations of an environment.

    - `Discrete`, `MultiDiscrete` and `MultiBinary` observations are cells already.
    - The systems of the thesis have its own centres: `named.pendulum` and
      `named.navigation("regular")`, if the ranges of their variables are its own.
    - Other Boxes of one axis get evenly spread centres, both ends included. The
      more variables, the fewer for each (a decision): 101 for one variable, 41 for
      two, as in (5.3), 15 for three, 7 for four, 5 for five, 3 for six. This keeps the
      whole to a few thousand cells. The numbers are odd, so that the middle of the
      range is a centre. A variable that this package's environments declare circular
      has one centre more, so that each centre has one opposite to it.

    What lies behind an `AsyncVectorEnv` or a wrapper that changes the observations is
    not known here: such an environment is like any other, without circular variables.

    This is a start, not the best partition for a task: give `cells` where a variable
    needs more of them, and `refine` it around a narrow goal.

    Args:
        env: a vector environment or a single one.
        kind: `Fuzzy` or `Crisp`; for observations that are not cells already.
        cells: number of centres, for all variables or for each; None follows the
            rule above.
        bounds: variable -> (low, high), in place of the bounds of the space; for
            variables that have none, or to leave out what is never visited. States
            beyond belong to the outermost cells.
        random_steps: estimate the bounds of variables that have none from so many
            random steps, see `estimate_bounds`. The environment is reset and stepped;
            where all variables have bounds it is left alone.
        seed: of those steps.

    Raises:
        TypeError: `env` is no environment, or its observations are of a kind that has
            no cells, such as Dict, Tuple or Text.
        ValueError: a variable has no bounds, there are more than six variables or
            more than one axis, or an argument does not fit the observations.
    """
    space = _observation_space(env)
    named.checked_kind(kind)
    if isinstance(space, FINITE_SPACES):
        if cells is not None or bounds is not None:
            raise ValueError(
                "cells and bounds must be None where observations are cells already, "
                f"got cells={cells!r} and bounds={bounds!r} for {space}."
            )
        return Discrete.from_space(space)
    box = _box(space)
    system = _system(env, box)
    if cells is None and bounds is None and system is not None:
        for base in type(system).__mro__:
            make = _NAMED.get(f"{base.__module__}.{base.__qualname__}")
            if make is not None and _spans(grid := make(system, kind), box):
                return grid
    circular = () if system is None else system.circular
    number = _centres(box.low.size) if cells is None else 0
    low, high = _bounded(env, box, bounds, circular, random_steps, seed)
    if cells is None:
        # One centre is enough for a variable that cannot change.
        cells = [
            number + (axis in circular) if low[axis] < high[axis] else 1
            for axis in range(low.size)
        ]
    return kind.from_box(spaces.Box(low, high, dtype=np.float64), cells, circular)


class Bounds(NamedTuple):
    """The range of each variable, both arrays `(d,)`."""

    low: FloatArray
    high: FloatArray


def estimate_bounds(env: Env, random_steps: int, seed: int = 0) -> Bounds:
    """Estimate the range of each variable from what random actions meet.

    The environment itself is reset with `seed` and stepped, not a copy; reset it
    before further use, as agents do. What was seen is widened by a quarter of its
    range on either side (a decision), for a policy that has learned gets further.
    The result is a function of `seed`, if the environment is.

    Args:
        env: a vector environment or a single one, with observations of one axis.
        random_steps: how many steps of all slots together to make at most, at least
            one for each slot.
        seed: of the environment and of the actions.

    Returns:
        `(low, high)`. They are equal where a variable never changed.

    Raises:
        TypeError: `env` is no environment.
        ValueError: an observation is not finite or has more than one axis.
    """
    dimensions = _box(_observation_space(env)).low.size
    slots = env.num_envs if isinstance(env, VectorEnv) else 1
    validation.integer("random_steps", random_steps, at_least=slots)
    seed = validation.integer("seed", seed, at_least=0)
    step = _vector_steps if isinstance(env, VectorEnv) else _single_steps
    low, high = np.full(dimensions, np.inf), np.full(dimensions, -np.inf)
    for seen in step(env, random_steps // slots, seed):
        states = np.asarray(seen, dtype=np.float64)
        if not np.isfinite(states).all():
            raise ValueError(
                "observations must be finite, got "
                f"{states[~np.isfinite(states).all(axis=1)][0].tolist()}; check the "
                "environment."
            )
        low = np.minimum(low, states.min(axis=0))
        high = np.maximum(high, states.max(axis=0))
    margin = MARGIN * (high - low)
    return Bounds(low - margin, high + margin)


def _single_steps(env: Any, steps: int, seed: int) -> Any:
    """Yield what is observed, `(m, d)`, from one episode after the other."""
    actions = copy.deepcopy(env.action_space)
    actions.seed(seed)
    yield [env.reset(seed=seed)[0]]
    for _ in range(steps):
        observation, _, terminated, truncated, _ = env.step(actions.sample())
        yield [observation]
        if terminated or truncated:
            yield [env.reset()[0]]


def _vector_steps(env: Any, steps: int, seed: int) -> Any:
    """Yield what is observed, `(m, d)`, in any autoreset mode."""
    mode = env.metadata.get("autoreset_mode", AutoresetMode.NEXT_STEP)
    actions = copy.deepcopy(env.action_space)
    actions.seed(seed)
    yield env.reset(seed=seed)[0]
    for _ in range(steps):
        observation, _, terminated, truncated, infos = env.step(actions.sample())
        yield observation
        done = np.logical_or(terminated, truncated)
        if not done.any():
            continue
        if "final_obs" in infos:
            yield np.stack(infos["final_obs"][done])
        if AutoresetMode(mode) is AutoresetMode.DISABLED:
            yield env.reset(options={"reset_mask": done})[0]


def _observation_space(env: Any) -> spaces.Space[Any]:
    if isinstance(env, VectorEnv):
        return env.single_observation_space
    if isinstance(env, gym.Env):
        return env.observation_space
    raise TypeError(
        "env must be a Gymnasium environment, single or vector, got "
        f"{type(env).__name__}; make it with gym.make_vec(id, num_envs=...)."
    )


def _box(space: spaces.Space[Any]) -> spaces.Box:
    """Refuse observations that are not a row of real variables."""
    if not isinstance(space, spaces.Box):
        raise TypeError(
            "observations must be a Box, Discrete, MultiDiscrete or MultiBinary, got "
            f"{space}; turn them into one of these with "
            "gymnasium.wrappers.TransformObservation (for vectors the one in "
            "gymnasium.wrappers.vector), or write a Partition of your own."
        )
    if len(space.shape) != 1:
        raise ValueError(
            "observations must have one axis of variables, got shape "
            f"{space.shape}; flatten small ones with "
            "gymnasium.wrappers.FlattenObservation, and choose a few features of "
            "images with TransformObservation: a table has a row for every cell."
        )
    return space


def _centres(dimensions: int) -> int:
    if dimensions not in CENTRES:
        raise ValueError(
            f"observations must have 1 to {max(CENTRES)} variables for an automatic "
            f"partition, got {dimensions}: cells grow as n^d, and a fuzzy state "
            f"belongs to 2^d = {2**dimensions} of them; choose a few features with "
            "gymnasium.wrappers.TransformObservation, or give cells, such as 1 for "
            "each variable that does not matter."
        )
    return CENTRES[dimensions]


def _system(env: Any, space: spaces.Space[Any]) -> ControlSystem | None:
    """The system behind one of this package's environments, if `env` shows it as is."""
    base = env.unwrapped
    if isinstance(base, gym.vector.SyncVectorEnv):
        base = base.envs[0].unwrapped
    if not isinstance(base, (ControlEnv, ControlVectorEnv)):
        return None
    # A wrapper may have changed what is observed.
    return base.system if base.system.observation_space == space else None


def _spans(grid: Grid, box: spaces.Box) -> bool:
    """Whether the outermost centres of `grid` are the bounds of `box`."""
    ends = zip(grid.centres, grid.periods, box.low, box.high, strict=True)
    return all(
        period is not None or (axis[0] == low and axis[-1] == high)
        for axis, period, low, high in ends
    )


def _bounded(
    env: Env,
    space: spaces.Box,
    bounds: Mapping[int, tuple[float, float]] | None,
    circular: Sequence[int],
    random_steps: int | None,
    seed: int,
) -> Bounds:
    """The bounds of all variables, given, declared or estimated."""
    low, high = space.low.astype(np.float64), space.high.astype(np.float64)
    for axis, pair in _checked_bounds(bounds, low.size, circular).items():
        low[axis], high[axis] = pair
    no_low, no_high = low < -INFINITE, high > INFINITE
    unbounded = np.flatnonzero(no_low | no_high)
    if not unbounded.size:
        return Bounds(low, high)
    if random_steps is None:
        variables = ", ".join(str(axis) for axis in unbounded)
        example = ", ".join(f"{axis}: (low, high)" for axis in unbounded)
        raise ValueError(
            f"observations must be bounded, got {space} without bounds for variables "
            f"{variables}; give them, automatic_partition(env, bounds={{{example}}}), "
            "or estimate them, automatic_partition(env, random_steps=10_000)."
        )
    seen = estimate_bounds(env, random_steps, seed)
    low[no_low], high[no_high] = seen.low[no_low], seen.high[no_high]
    if (still := [int(axis) for axis in unbounded if low[axis] >= high[axis]]) != []:
        raise ValueError(
            f"random steps must vary every variable without bounds, but {still} never "
            f"changed in {random_steps} of them; give their bounds."
        )
    return Bounds(low, high)


def _checked_bounds(
    bounds: Any, dimensions: int, circular: Sequence[int]
) -> dict[int, tuple[float, float]]:
    if bounds is None:
        return {}
    if not isinstance(bounds, Mapping):
        raise TypeError(
            "bounds must map variables to pairs (low, high), got "
            f"{bounds!r}; write bounds={{0: (-1.0, 1.0)}}."
        )
    pairs = {}
    for axis, pair in bounds.items():
        if validation.integer("a variable of bounds", axis, at_least=0) >= dimensions:
            raise ValueError(
                f"bounds must be of variables 0..{dimensions - 1}, got {axis}."
            )
        if axis in circular:
            raise ValueError(
                f"bounds must not be of circular variables, got {axis}: its range is "
                "its period."
            )
        ends = validation.real_array(f"bounds[{axis}]", pair, ndim=1)
        if ends.size != 2 or ends[0] >= ends[1]:
            raise ValueError(
                f"bounds[{axis}] must be (low, high) with low < high, got {pair!r}."
            )
        pairs[int(axis)] = (float(ends[0]), float(ends[1]))
    return pairs


def thesis_partition(env: Env, cells: Any = None, *, kind: type[Grid] = Fuzzy) -> Partition:
    """The partition of the thesis (provisional)."""
    system = env.unwrapped.system
    name = type(system).__name__
    if cells is not None and not isinstance(cells, str) and np.ndim(cells[0]) == 1:
        return kind(cells, circular=list(system.circular)) if system.circular else kind(cells)
    if name == "Pendulum":
        return named.pendulum(*(cells or (40, 41)), kind=kind, omega_max=system.omega_max)
    if name == "Navigation":
        return named.navigation(cells or "regular", kind=kind)
    return Discrete(system.observation_space.n)
