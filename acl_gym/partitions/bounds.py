"""The range of each observed variable: declared by the space, given, or estimated."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv

from acl_gym.envs import received
from acl_gym.utils import validation
from acl_gym.utils.boxes import declared_bounds
from acl_gym.utils.typing import FloatArray

Env = gym.Env[Any, Any] | VectorEnv[Any, Any, Any]

MARGIN = 0.25
"""`estimate_bounds` widens the observed range by this share of it on either side."""


class Bounds(NamedTuple):
    """The range of each variable, both arrays `(d,)`."""

    low: FloatArray
    high: FloatArray


def estimate_bounds(env: Env, random_steps: int, seed: int = 0) -> Bounds:
    """Estimate the range of each variable from the observations of random actions.

    The environment itself is reset with `seed` and stepped, not a copy; reset it
    before further use, as agents do. The observed range is widened by a quarter on
    either side (a decision), because a learned policy gets further.
    The result is a function of `seed`, if the environment is.

    Args:
        env: a vector environment or a single one, with observations of one axis.
        random_steps: how many steps of all slots together to make at most, at least
            one for each slot.
        seed: of the environment and of the actions.

    Returns:
        `(low, high)`. They are equal where a variable never changed.

    Raises:
        TypeError: `env` is not an environment.
        ValueError: an observation is not finite or has more than one axis.
    """
    dimensions = real_box(observation_space(env)).low.size
    slots = env.num_envs if isinstance(env, VectorEnv) else 1
    validation.integer("random_steps", random_steps, at_least=slots)
    seed = validation.integer("seed", seed, at_least=0, at_most=None)
    step = _vector_steps if isinstance(env, VectorEnv) else _single_steps
    low, high = np.full(dimensions, np.inf), np.full(dimensions, -np.inf)
    for seen in step(env, random_steps // slots, seed):
        states = validation.as_array(seen)
        if (
            states is None
            or states.dtype.kind not in "biuf"
            or states.shape[1:] != (dimensions,)
        ):
            raise ValueError(
                f"observations must be rows of {dimensions} real numbers, got "
                f"{validation.shown(seen)}; check the environment."
            )
        states = states.astype(np.float64)
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
    mode, n = received.autoreset_mode_of(env), env.num_envs
    actions = copy.deepcopy(env.action_space)
    actions.seed(seed)
    yield received.observations(env.reset(seed=seed)[0], n)
    for _ in range(steps):
        observation, _, terminated, truncated, infos = received.parts(
            "step", env.step(actions.sample()), 5
        )
        yield received.observations(observation, n)
        done = received.flags("terminated", terminated, n) | received.flags(
            "truncated", truncated, n
        )
        if not done.any():
            continue
        final = received.infos(infos, n).get("final_obs")
        if final is not None:
            yield [final[slot] for slot in np.flatnonzero(done)]
        if mode is AutoresetMode.DISABLED:
            yield env.reset(options={"reset_mask": done})[0]


def complete_bounds(
    env: Env,
    space: spaces.Box,
    bounds: Mapping[int, tuple[float, float]] | None,
    circular: Sequence[int],
    random_steps: int | None,
    seed: int,
) -> Bounds:
    """Return the bounds of all variables: given, declared by the space, or estimated.

    See `automatic_partition` for the arguments and errors.
    """
    low, high = declared_bounds(space)
    for axis, pair in _checked_bounds(bounds, low.size, circular).items():
        low[axis], high[axis] = pair
    no_low, no_high = np.isinf(low), np.isinf(high)
    unbounded = np.flatnonzero(no_low | no_high)
    if not unbounded.size:
        return Bounds(low, high)
    if random_steps is None:
        variables = ", ".join(str(axis) for axis in unbounded)
        example = ", ".join(f"{axis}: (low, high)" for axis in unbounded)
        raise ValueError(
            "observations must be bounded, got "
            f"{validation.shown(space)} without bounds for variables "
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
            f"{validation.shown(bounds)}; write bounds={{0: (-1.0, 1.0)}}."
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
                f"bounds[{axis}] must be (low, high) with low < high, got "
                f"{validation.shown(pair)}."
            )
        pairs[int(axis)] = (float(ends[0]), float(ends[1]))
    return pairs


def observation_space(env: Any) -> spaces.Space[Any]:
    """Return the space of one observation of a single or a vector environment.

    Raises:
        TypeError: `env` is not an environment.
    """
    if isinstance(env, VectorEnv):
        return env.single_observation_space
    if isinstance(env, gym.Env):
        return env.observation_space
    raise TypeError(
        "env must be a Gymnasium environment, single or vector, got "
        f"{type(env).__name__}; make it with gym.make_vec(id, num_envs=...)."
    )


def real_box(space: spaces.Space[Any]) -> spaces.Box:
    """Return `space` if its elements are a row of real variables.

    Raises:
        TypeError: it is not a Box.
        ValueError: it has more or fewer axes than one.
    """
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
