"""What a vector environment returns, held against its number of slots.

Environments of others may return anything, and what does not fit would be read as
garbage, or beyond the end of an array, by kernels. What is unambiguous is taken: floats
of any precision and byte order, a column of rewards, infos as a list. Anything else is
refused with what was expected, what came, and where to look.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, FloatArray

_FLOAT, _BOOL = np.dtype(np.float64), np.dtype(np.bool_)
_KERNEL_CODES = frozenset("?bBhHiIlLqQfd")
"""Types that kernels are compiled for; others, such as float16, are converted."""

_MASK_KEYS = ("action_mask", "is_success", "final_obs", "final_info")


def autoreset_mode_of(env: Any) -> AutoresetMode:
    """What an environment does with a slot that has finished; NextStep if it says nothing.

    The mode in `env.metadata` may be a member of `AutoresetMode` or its text.

    Raises:
        ValueError: there is no such mode.
    """
    metadata = getattr(env, "metadata", None) or {}
    mode = metadata.get("autoreset_mode", AutoresetMode.NEXT_STEP)
    try:
        return AutoresetMode(mode)
    except ValueError:
        known = ", ".join(repr(each.value) for each in AutoresetMode)
        raise ValueError(
            f"env.metadata['autoreset_mode'] must be an AutoresetMode or one of {known}, "
            f"got {validation.shown(mode)}."
        ) from None


def parts(name: str, result: Any, count: int) -> Any:
    """Return what `env.reset` or `env.step` gave if it is a tuple of `count` parts.

    Raises:
        ValueError: it is not.
    """
    if not isinstance(result, (tuple, list)) or len(result) != count:
        raise ValueError(
            f"env.{name} must return {count} parts, as gymnasium.vector.VectorEnv "
            f"describes, got {validation.shown(result)}."
        )
    return result


def step_result(result: Any, n_slots: int) -> tuple[Any, ...]:
    """Return what `env.step` gave, part by part, each in the form that kernels take.

    Raises:
        ValueError: a part is not what it should be.
    """
    observation, reward, terminated, truncated, told = parts("step", result, 5)
    return (
        observations(observation, n_slots),
        rewards(reward, n_slots),
        flags("terminated", terminated, n_slots),
        flags("truncated", truncated, n_slots),
        infos(told, n_slots),
    )


def observations(value: Any, n_slots: int, name: str = "observations") -> Any:
    """Return observations with one row a slot, in a type that kernels take.

    Args:
        value: an array `(n_slots, ...)`, or a dict or tuple of such arrays.
        n_slots: how many slots there are.
        name: what messages call them.

    Returns:
        The array, which may be `value` itself; dicts and tuples part by part.

    Raises:
        ValueError: there is not one row for each slot.
    """
    if type(value) is not np.ndarray:
        if isinstance(value, Mapping):
            return {
                key: observations(part, n_slots, f"{name}[{key!r}]")
                for key, part in value.items()
            }
        if isinstance(value, tuple):
            return tuple(
                observations(part, n_slots, f"{name}[{i}]")
                for i, part in enumerate(value)
            )
    array = validation.as_array(value)
    if array is None or array.shape[:1] != (n_slots,):
        what = validation.shown(value) if array is None else f"shape {array.shape}"
        raise ValueError(
            f"{name} must have one row for each of the {n_slots} slots, got {what}; "
            "check the environment's reset and step."
        )
    kind = array.dtype
    if not (kind.isnative and kind.char in _KERNEL_CODES):
        if kind.kind == "f":
            wide = np.float64 if kind.itemsize > 4 else np.float32
            return array.astype(wide)
        return array.astype(kind.newbyteorder("="))
    return array


def rewards(value: Any, n_slots: int) -> FloatArray:
    """Return rewards as float64 `(n_slots,)`; a column `(n_slots, 1)` is taken.

    Raises:
        ValueError: they are not real numbers, one for each slot.
    """
    if type(value) is np.ndarray and value.dtype == _FLOAT and value.ndim == 1:
        array = value
    else:
        array = _vector("rewards", value, n_slots, "biuf", "real numbers")
        array = array.astype(np.float64)
    if array.size != n_slots:
        raise _wrong_shape("rewards", array, n_slots)
    return array


def not_finite(rewards: FloatArray, slot: int) -> ValueError:
    """The error for a reward that is NaN or infinite."""
    return ValueError(
        f"rewards must be finite, got {rewards[slot]} in slot {slot}; check the "
        "environment's reward function."
    )


def flags(name: str, value: Any, n_slots: int) -> BoolArray:
    """Return `terminated` or `truncated` as bool `(n_slots,)`; 0 and 1 are taken.

    Raises:
        ValueError: they are not flags, one for each slot.
    """
    if type(value) is np.ndarray and value.dtype == _BOOL and value.ndim == 1:
        array = value
    else:
        array = _vector(name, value, n_slots, "biuf", "bools")
        wrong = (array != 0) & (array != 1)
        if wrong.any():
            slot = int(np.argmax(wrong))
            raise ValueError(
                f"{name} must be True or False for each slot, got {array[slot]} in slot "
                f"{slot}; check the environment's step."
            )
        array = array != 0
    if array.size != n_slots:
        raise _wrong_shape(name, array, n_slots)
    return array


def infos(value: Any, n_slots: int) -> Mapping[str, Any]:
    """Return infos in the form of a vector environment, a dict of arrays.

    Args:
        value: such a dict; None; or a list with one dict for each slot. Of a list only
            action masks, success and what is final are taken over.
        n_slots: how many slots there are.

    Raises:
        ValueError: they are none of these.
    """
    if isinstance(value, Mapping):
        return value
    if value is None:
        return {}
    rows = list(value) if isinstance(value, Sequence) else None
    if (
        rows is None
        or len(rows) != n_slots
        or not all(isinstance(row, Mapping) for row in rows)
    ):
        raise ValueError(
            f"infos must be a dict of arrays, or a list of {n_slots} dicts, one for each "
            f"slot, got {validation.shown(value)}; check the environment and its "
            "wrappers."
        )
    found: dict[str, Any] = {}
    for key in _MASK_KEYS:
        present = np.array([row.get(key) is not None for row in rows])
        if not present.any():
            continue
        if key == "final_info":
            found[key] = infos([row.get(key) or {} for row in rows], n_slots)
        else:
            values = np.full(n_slots, None, dtype=object)
            for slot in np.flatnonzero(present):
                values[slot] = rows[slot][key]
            found[key] = values
        found[f"_{key}"] = present
    return found


def action_mask(value: Any, n_slots: int, n_actions: int) -> BoolArray | None:
    """Return which actions each slot may take, from infos; None: all.

    Args:
        value: infos as `infos` returns them.
        n_slots: how many slots there are.
        n_actions: how many actions there are.

    Returns:
        A new array `(n_slots, n_actions)`. A slot without a mask may take any action.

    Raises:
        ValueError: a mask is not of that shape, or holds other values than 0 and 1.
    """
    mask = value.get("action_mask")
    if mask is None:
        return None
    shape = (n_slots, n_actions)
    if type(mask) is np.ndarray and mask.dtype == _BOOL and mask.shape == shape:
        allowed = mask.copy()
    else:
        allowed = _checked_mask(_stacked(mask, shape), shape)
    given = value.get("_action_mask")
    if given is not None:
        allowed |= ~flags("infos['_action_mask']", given, n_slots)[:, None]
    return allowed


def success(value: Any, n_slots: int) -> tuple[BoolArray, BoolArray] | None:
    """Return what infos say of success: `(success, given)`, `(n_slots,)` each.

    Args:
        value: infos as `infos` returns them.
        n_slots: how many slots there are.

    Returns:
        Whether each slot's episode is a success, and for which slots that is said; None
        if it is said for none.

    Raises:
        ValueError: success is said in other values than 0 and 1.
    """
    told = value.get("is_success")
    if told is None:
        return None
    given = value.get("_is_success")
    if given is None:
        given = np.ones(n_slots, dtype=np.bool_)
    given = flags("infos['_is_success']", given, n_slots)
    if isinstance(told, np.ndarray) and told.dtype == object:
        told = [
            bool(one) if has else False for one, has in zip(told, given, strict=True)
        ]
    return flags("infos['is_success']", told, n_slots), given


def _stacked(mask: Any, shape: tuple[int, int]) -> Any:
    """An array of one mask for each slot; slots with None may take any action."""
    if (
        isinstance(mask, np.ndarray)
        and mask.dtype == object
        and mask.shape[:1] == shape[:1]
    ):
        every = np.ones(shape[1], dtype=np.bool_)
        mask = [every if row is None else row for row in mask]
    array = validation.as_array(mask)
    if array is None:
        raise ValueError(
            f"infos['action_mask'] must have shape {shape}, one row per slot, got "
            f"{validation.shown(mask)}; check the environment's infos."
        )
    return array


def _checked_mask(mask: Any, shape: tuple[int, int]) -> BoolArray:
    name = "infos['action_mask']"
    if not isinstance(mask, np.ndarray) or mask.shape != shape:
        what = mask.shape if isinstance(mask, np.ndarray) else validation.shown(mask)
        raise ValueError(
            f"{name} must have shape {shape}, one row per slot, got {what}; check the "
            "environment's infos."
        )
    if mask.dtype.kind not in "biuf":
        raise ValueError(
            f"{name} must hold bools or 0 and 1, got {mask.dtype}; check the "
            "environment's infos."
        )
    wrong = (mask != 0) & (mask != 1)
    if wrong.any():
        slot = int(np.argmax(wrong.any(axis=1)))
        raise ValueError(
            f"{name} must hold 1 for actions that are allowed and 0 for others, got "
            f"{validation.shown(mask[slot].tolist())} in slot {slot}; check the "
            "environment's infos."
        )
    return np.asarray(mask != 0)


def _vector(name: str, value: Any, n_slots: int, kinds: str, what: str) -> NDArray[Any]:
    """`value` as an array of one entry a slot, of one of the `kinds` of numbers."""
    array = validation.as_array(value)
    if array is None or array.dtype.kind not in kinds:
        got = validation.shown(value) if array is None else f"dtype {array.dtype}"
        raise ValueError(
            f"{name} must be {what}, one for each of the {n_slots} slots, got {got}; "
            "check the environment's step."
        )
    if array.shape == (n_slots, 1):
        return array[:, 0]
    if array.shape != (n_slots,):
        raise _wrong_shape(name, array, n_slots)
    return array


def _wrong_shape(name: str, array: NDArray[Any], n_slots: int) -> ValueError:
    return ValueError(
        f"{name} must have shape ({n_slots},), one for each slot, got shape "
        f"{array.shape}; check the environment's step."
    )
