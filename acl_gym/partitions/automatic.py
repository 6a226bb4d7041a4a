"""A partition for any environment, so that an agent can do without being given one."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper

from acl_gym.envs.control.environments import ControlEnv, ControlVectorEnv
from acl_gym.envs.control.system import ControlSystem
from acl_gym.envs.wrappers.perturbations import HiddenVariables
from acl_gym.partitions.base import Partition
from acl_gym.partitions.discrete import FINITE_SPACES, Discrete
from acl_gym.partitions.grid import Fuzzy, Grid, checked_kind
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray

Env = gym.Env[Any, Any] | VectorEnv[Any, Any, Any]

CENTRES = {1: 101, 2: 41, 3: 15, 4: 7, 5: 5, 6: 3}
"""Number of variables -> centres of each."""

INFINITE = 1e30
"""A bound beyond this is none: some spaces write the largest float for infinity."""

MARGIN = 0.25
"""`estimate_bounds` widens what it saw by this share of the range on either side."""


def thesis_partition(
    env: Env, cells: Any = None, *, kind: type[Grid] = Fuzzy
) -> Partition:
    """Build the partition that the thesis uses for an environment of this package.

    Args:
        env: a single or a vector environment of this package. Wrappers may perturb or
            hide variables (`HiddenVariables`), but not transform them.
        cells: which centres: what the system's `thesis_centres` takes, such as
            (40, 41) for the pendulum and "regular" or "damping" for the navigation, or
            the centres themselves, one increasing sequence for each variable that is
            observed. None takes the default of the system.
        kind: `Fuzzy` or `Crisp`; for observations that are not cells already.

    Returns:
        `Discrete` where a state is a cell, otherwise a partition of that kind; the
        circular variables are those of the system.

    Raises:
        TypeError: `env` is not an environment of this package, or `kind` or a number
            in `cells` has the wrong type.
        ValueError: there are no such centres, or a wrapper transforms the variables.
    """
    space = _observation_space(env)
    checked_kind(kind)
    system = _system(env)
    if system is None:
        raise TypeError(
            f"env must be a control environment of this package, got {env}; use "
            "automatic_partition(env) for others."
        )
    if isinstance(space, FINITE_SPACES):
        if cells is not None:
            raise ValueError(
                "cells must be None where observations are cells already, got "
                f"{cells!r} for {space}."
            )
        return Discrete.from_space(space)
    shown = _shown_variables(env, system)
    if _are_centres(cells):
        centres = list(cells)
        if len(centres) != len(shown):
            raise ValueError(
                f"cells must hold the centres of {len(shown)} variables, got "
                f"{len(centres)} sequences."
            )
    else:
        named = system.thesis_centres(cells)
        if named is None:
            raise ValueError(
                f"the thesis has no centres for {type(system).__name__}; give them in "
                "cells, one sequence for each variable, or use "
                "automatic_partition(env)."
            )
        centres = [named[variable] for variable in shown]
    full = _box(system.observation_space)
    periods = [
        float(full.high[variable] - full.low[variable])
        if variable in system.circular
        else None
        for variable in shown
    ]
    return kind(centres, periods)


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
    - The systems of the thesis get its centres, see `thesis_partition`, if these reach
      to the bounds of the variables.
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
    checked_kind(kind)
    if isinstance(space, FINITE_SPACES):
        if cells is not None or bounds is not None:
            raise ValueError(
                "cells and bounds must be None where observations are cells already, "
                f"got cells={cells!r} and bounds={bounds!r} for {space}."
            )
        return Discrete.from_space(space)
    box = _box(space)
    system = _system(env)
    if system is not None and system.observation_space != space:
        system = None  # a wrapper has changed what is observed
    if cells is None and bounds is None and system is not None:
        centres = system.thesis_centres()
        if centres is not None and _span(centres, system.circular, box):
            return thesis_partition(env, kind=kind)
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


def _system(env: Any) -> ControlSystem | None:
    """The system of an environment of this package, None for any other."""
    base = env.unwrapped
    if isinstance(base, gym.vector.SyncVectorEnv):
        base = base.envs[0].unwrapped
    if not isinstance(base, (ControlEnv, ControlVectorEnv)):
        return None
    return base.system


def _shown_variables(env: Any, system: ControlSystem) -> list[int]:
    """The variables of a system that are observed through its wrappers, in order."""
    full = _box(system.observation_space)
    shown = list(range(full.low.size))
    wrappers = []
    while isinstance(env, (gym.Wrapper, VectorWrapper)):
        wrappers.append(env)
        env = env.env
    for wrapper in reversed(wrappers):
        if isinstance(wrapper, HiddenVariables):
            shown = [shown[i] for i in wrapper.shown]
    space = _observation_space(wrappers[0] if wrappers else env)
    if space != spaces.Box(full.low[shown], full.high[shown], dtype=full.dtype.type):
        raise ValueError(
            "env must show variables of its system as they are, got observations "
            f"from {space} of the system's {full}; use automatic_partition(env), or "
            "leave out the wrapper that transforms them."
        )
    return shown


def _are_centres(cells: Any) -> bool:
    """Whether `cells` are sequences of centres, not numbers of them or a name."""

    def is_list(value: Any) -> bool:
        return isinstance(value, Sequence | np.ndarray) and not isinstance(value, str)

    return is_list(cells) and len(cells) > 0 and all(map(is_list, cells))


def _span(
    centres: Sequence[FloatArray], circular: Sequence[int], box: spaces.Box
) -> bool:
    """Whether the outermost centres are the bounds of `box`."""
    return all(
        axis in circular or (line[0] == box.low[axis] and line[-1] == box.high[axis])
        for axis, line in enumerate(centres)
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
