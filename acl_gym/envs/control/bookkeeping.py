"""Checks of arguments and short kernels of the control environments."""

from __future__ import annotations

import inspect
from typing import Any, Protocol, TypeVar

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from acl_gym.envs.control.system import ControlSystem
from acl_gym.utils import validation
from acl_gym.utils.boxes import input_bounds
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray

System = TypeVar("System")


def made_system(kind: type[System], parameters: dict[str, Any]) -> System:
    """A system with these parameters.

    Raises:
        TypeError: it has no parameter of such a name.
        ValueError: a parameter is not valid.
    """
    known = inspect.signature(kind).parameters
    if all(each.kind is not each.VAR_KEYWORD for each in known.values()):
        for name in parameters:
            if name not in known:
                raise TypeError(
                    f"{kind.__name__} has no parameter {name!r}; choose from "
                    f"{', '.join(known) or 'none'}."
                    f"{validation.did_you_mean(name, known)}"
                )
    return kind(**parameters)


def of_this_package(kind: type) -> bool:
    """Whether a class was defined in this package, so that it does as it should."""
    return kind.__module__.startswith("acl_gym.")


def real_input_bounds(system: ControlSystem) -> tuple[FloatArray, FloatArray] | None:
    """The bounds of the inputs of a system whose actions are a Box, else None.

    Raises:
        ValueError: the Box is not bounded, or has not one axis of floats.
    """
    space = system.action_space
    if isinstance(space, spaces.Discrete):
        return None
    return input_bounds(f"the actions of {type(system).__name__}", space)


def n_actions_of(system: ControlSystem) -> int:
    """The number of actions; 0 where the inputs are real."""
    space = system.action_space
    return int(space.n) if isinstance(space, spaces.Discrete) else 0


def drawn_action(action: Any) -> int | FloatArray:
    """An action as painters take it: its number, or its inputs."""
    return int(action) if np.ndim(action) == 0 else np.asarray(action)


class Seeded(Protocol):
    """What has random numbers of its own, as environments have."""

    @property
    def np_random(self) -> np.random.Generator:
        """The generator."""


_INT = np.dtype(np.int64)


def checked_options(
    options: dict[str, Any] | None, allowed: tuple[str, ...]
) -> dict[str, Any]:
    """Refuse reset options that would otherwise be ignored silently."""
    if options is not None and not isinstance(options, dict):
        raise TypeError(
            f"reset options must be a dict, got {validation.shown(options)} of type "
            f"{type(options).__name__}."
        )
    unknown = sorted(set(options or ()) - set(allowed), key=str)
    if unknown:
        raise ValueError(
            f"reset options must be among {list(allowed)}, got {unknown}; "
            "check the spelling."
        )
    return dict(options or {})


def checked_trial_steps(options: dict[str, Any], mask: BoolArray | None) -> int | None:
    """T that reset options set, None where they set none.

    Args:
        options: of a reset.
        mask: the slots to be reset, None for all.

    Raises:
        TypeError: it is not an integer.
        ValueError: it is less than 1, or only some slots are reset.
    """
    if "max_steps" not in options:
        return None
    if mask is not None:
        raise ValueError(
            "options['max_steps'] is for a full reset, got it with 'reset_mask'; "
            "leave one of them out."
        )
    return validation.integer("options['max_steps']", options["max_steps"], at_least=1)


def check_new_states(
    system: ControlSystem, states: Any, count: int, size: int | None
) -> None:
    """Check states that a system, perhaps of a user's own, gives slots to start in.

    Args:
        system: what gave them.
        states: the candidate, `(state_size, count)`.
        count: how many slots start.
        size: of a state that other slots are in; None if there are none.

    Raises:
        ValueError: they are not what kernels rely on.
    """
    good = (
        isinstance(states, np.ndarray)
        and states.dtype == np.float64
        and states.ndim == 2
        and states.shape[1] == count
        and size in (None, len(states))
    )
    if not good:
        raise ValueError(
            f"sample_states and checked_states of {type(system).__name__} must "
            f"give float64 states of a fixed size for {count} slots, got "
            f"{validation.shown(states)}."
        )
    if not of_this_package(type(system)):
        # Kernels of this package address by them.
        system.checked_states(states.T)


@njit
def count_step(
    limit: int, steps: IntArray, terminated: BoolArray, truncated: BoolArray
) -> int:
    """Count a step of every slot; return how many have finished."""
    n_finished = 0
    for slot in range(steps.size):
        steps[slot] += 1
        truncated[slot] = (limit > 0) & (steps[slot] >= limit)
        n_finished += terminated[slot] | truncated[slot]
    return n_finished


@njit
def finish(
    terminated: BoolArray,
    truncated: BoolArray,
    finished: BoolArray,
    walking: IntArray,
    ended: BoolArray,
    success: BoolArray,
) -> int:
    """Record the slots that finish; write the others into `walking`, return how many.

    `ended` receives which slots finish in this step, `success` which of them are at the
    goal.
    """
    n_walking = 0
    for slot in range(finished.size):
        ended[slot] = terminated[slot] | truncated[slot]
        success[slot] = terminated[slot]
        finished[slot] |= ended[slot]
        walking[n_walking] = slot
        n_walking += not finished[slot]
    return n_walking


@njit
def copy_if_below(actions: IntArray, n_actions: int, copied: IntArray) -> bool:
    """Copy actions; return whether all are in 0..n_actions - 1, vectorised."""
    good = True
    for slot in range(actions.size):
        copied[slot] = actions[slot]
        good &= (actions[slot] >= 0) & (actions[slot] < n_actions)
    return good


def draw_uniforms(system: ControlSystem, env: Seeded, count: int) -> FloatArray | None:
    """Draw the random numbers of one step of `count` slots; None if it needs none."""
    draws = system.draws_per_step
    return env.np_random.random((draws, count)) if draws else None


def checked_actions(actions: Any, count: int, n_actions: int) -> IntArray:
    """Return actions as a new int64 array `(count,)` within 0..n_actions - 1."""
    checked = np.empty(count, np.int64)
    array = actions if type(actions) is np.ndarray else validation.as_array(actions)
    if array is None:
        raise TypeError(
            f"actions must be {count} integers, one a slot, got "
            f"{validation.shown(actions)}."
        )
    ready = array.dtype == _INT and array.shape == (count,)
    if ready and copy_if_below(array, n_actions, checked):
        return checked
    if array.dtype.kind not in "iu":
        raise TypeError(
            f"actions must be integers, got dtype {array.dtype}; "
            "cast with .astype(np.int64)."
        )
    if array.shape != (count,):
        raise ValueError(
            f"actions must have shape ({count},), one a slot, got {array.shape}."
        )
    if array.dtype == np.uint64:  # beyond int64 they would come out as negative
        array = np.minimum(array, np.uint64(n_actions))
    if not copy_if_below(array.astype(np.int64), n_actions, checked):
        slot = int(np.argmax((checked < 0) | (checked >= n_actions)))
        raise ValueError(
            f"actions must lie in 0..{n_actions - 1}, got {np.asarray(actions)[slot]} "
            f"in slot {slot}."
        )
    return checked


def checked_inputs(
    inputs: Any, count: int, low: FloatArray, high: FloatArray
) -> FloatArray:
    """Return real inputs as a new float64 array `(count, n_inputs)` within bounds.

    What lies beyond a bound is set to it, as an actuator saturates.

    Args:
        inputs: a row for each slot.
        count: how many slots there are.
        low: of each input, `(n_inputs,)`.
        high: of each input.

    Raises:
        TypeError: they are not real numbers.
        ValueError: there is not a row for each slot, or one is NaN or infinite.
    """
    array = inputs if type(inputs) is np.ndarray else validation.as_array(inputs)
    if array is None or array.dtype.kind not in "iuf":
        raise TypeError(
            f"actions must be real numbers of shape ({count}, {low.size}), the inputs of "
            f"each slot, got {validation.shown(inputs)}; cast with .astype(np.float64)."
        )
    if array.shape != (count, low.size):
        raise ValueError(
            f"actions must have shape ({count}, {low.size}), a row of inputs for each "
            f"slot, got {array.shape}."
        )
    array = validation.float64(array)
    if not np.isfinite(array).all():
        slot, axis = np.argwhere(~np.isfinite(array))[0]
        raise ValueError(
            f"actions must be finite, got {array[slot, axis]} as input {axis} in slot "
            f"{slot}; check what computes them."
        )
    return np.clip(array, low, high)


def final_infos(
    observations: NDArray[Any], finished: BoolArray, infos: dict[str, Any]
) -> dict[str, Any]:
    """Return the final observations and infos of finished slots that are reset.

    Args:
        observations: of the last states, `(num_envs, ...)`.
        finished: whether each slot has finished, `(num_envs,)`.
        infos: of the last states, arrays `(num_envs, ...)`; set to 0 in place where
            slots have not finished.
    """
    final_obs = np.full(finished.size, None, dtype=object)
    for slot in np.flatnonzero(finished):
        final_obs[slot] = observations[slot]
    for array in infos.values():
        array[~finished] = 0
    return {
        "final_obs": final_obs,
        "_final_obs": finished.copy(),
        "final_info": infos,
        "_final_info": finished.copy(),
    }


def checked_render_mode(mode: str | None, metadata: dict[str, Any]) -> str | None:
    """Return `mode` if it is None or among the modes of `metadata`."""
    if mode is not None and mode not in metadata["render_modes"]:
        raise ValueError(
            f"render_mode must be None or one of {metadata['render_modes']}, "
            f"got {validation.shown(mode)}."
        )
    return mode


def warn_of_no_render_mode(metadata: dict[str, Any]) -> None:
    """Warn that `render` was called on an environment that draws nothing."""
    modes = " or ".join(f'"{mode}"' for mode in metadata["render_modes"])
    gym.logger.warn(
        "render() draws nothing without a render_mode; make the environment with "
        f"render_mode={modes}."
    )


def states_of_slots(
    given: Any, slots: IntArray, num_envs: int, current: FloatArray | None
) -> FloatArray:
    """Return `options["state"]` of a reset as rows for all slots.

    Args:
        given: one row for each slot; `(num_envs,)` for states of one variable.
        slots: those that are reset.
        num_envs: number of slots.
        current: the states that the slots are in, `(num_envs, state_size)`; None
            before the first reset. They take the place of given rows of slots that are
            not reset, which may hold anything.

    Raises:
        ValueError: `given` does not have a row for each slot.
    """
    rows = validation.real_array("options['state']", given, finite=False)
    if rows.shape[:1] != (num_envs,):
        raise ValueError(
            "options['state'] must hold one row for each slot, shape "
            f"({num_envs}, ...), got shape {rows.shape}."
        )
    if current is None:
        return rows
    if rows.ndim == 1 and current.shape[1] == 1:
        rows = rows[:, None]
    if rows.ndim == 2:  # a plant lets uncertain parameters be left out
        current = current[:, : rows.shape[1]]
    if rows.shape != current.shape:
        return rows
    merged = current.copy()
    merged[slots] = rows[slots]
    return merged
