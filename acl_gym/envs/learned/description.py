"""What the numbers of a recording mean: names, bounds, circles and actions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from gymnasium import spaces

from acl_gym.envs.control.lookup import signals_of, system_of
from acl_gym.envs.control.signals import Signals
from acl_gym.envs.plant.targets import checked_names
from acl_gym.utils import validation
from acl_gym.utils.angles import Angles
from acl_gym.utils.boxes import declared_bounds
from acl_gym.utils.typing import FloatArray


@dataclass(frozen=True)
class Description:
    """What the columns of a recording are; see `Transitions` for the arguments.

    Attributes:
        state_names: of the variables.
        input_names: of the inputs.
        low: lower end of each variable, -inf where it is unknown.
        high: upper end, inf where it is unknown; both are finite where it is circular.
        circular: the variables that wrap around.
        angles: pairs of variables that are cosine and sine of one angle.
        values: the inputs of each action, `(n_actions, n_inputs)`; None if they are
            not known.
        numbered: whether inputs are numbers of actions, without order or size.
        sampling_time: s; None if it is not known.
    """

    state_names: tuple[str, ...]
    input_names: tuple[str, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    circular: tuple[int, ...] = ()
    angles: tuple[tuple[int, int], ...] = ()
    values: tuple[tuple[float, ...], ...] | None = None
    numbered: bool = False
    sampling_time: float | None = None

    @property
    def shown_angles(self) -> Angles:
        """How states are read that show angles as cosine and sine."""
        return Angles(self.angles, len(self.low) - len(self.angles))

    def settled(self, states: FloatArray) -> FloatArray:
        """States `(n, d)` with circular variables brought between their ends, a copy."""
        states = states.copy()
        for axis in self.circular:
            low, span = self.low[axis], self.high[axis] - self.low[axis]
            turned = low + np.mod(states[:, axis] - low, span)
            states[:, axis] = np.where(turned >= low + span, low, turned)
        return states

    def difference(self, other: Description) -> str | None:
        """What differs from another recording of the same plant; None if nothing does."""
        for name in ("state_names", "input_names", "circular", "angles", "numbered"):
            own, its = getattr(self, name), getattr(other, name)
            if own != its:
                return f"{name} {own} and {its}"
        # A number means another action where there are others; what one sets does not.
        numbers = self.values, other.values
        if self.numbered and None not in numbers and numbers[0] != numbers[1]:
            return f"the numbers of actions {numbers[0]} and {numbers[1]}"
        own_time, its_time = self.sampling_time, other.sampling_time
        known = own_time is not None and its_time is not None
        if known and not math.isclose(own_time, its_time, rel_tol=0.01):  # type: ignore[arg-type]
            return f"sampling_time {own_time:g} s and {its_time:g} s"
        for axis in self.circular:
            ends = self.low[axis], self.high[axis]
            if ends != (other.low[axis], other.high[axis]):
                return f"the ends of {self.state_names[axis]}"
        return None

    def joined(self, other: Description) -> Description:
        """The description of both recordings: the wider bounds, and what either knows.

        Args:
            other: of another recording of the same plant, without a `difference`.
        """
        values = self.values if self.values is not None else other.values
        if other.values not in (None, values):
            values = None  # each had other actions
        return replace(
            self,
            low=tuple(map(min, self.low, other.low)),
            high=tuple(map(max, self.high, other.high)),
            values=values,
            sampling_time=self.sampling_time or other.sampling_time,
        )

    def check_numbers(self, inputs: FloatArray) -> None:
        """Check that inputs which are to number actions do so.

        Args:
            inputs: of the recording, `(n, n_inputs)`.

        Raises:
            ValueError: one is the number of no action.
        """
        if not self.numbered or self.values is None:
            return
        numbers = np.ravel(self.values)
        strange = ~np.isin(inputs[:, 0], numbers)
        if strange.any():
            row = int(np.argmax(strange))
            raise ValueError(
                f"inputs must be numbers of actions, {validation.shown(numbers.tolist())}, "
                f"got {inputs[row, 0]:g} in row {row}; record the actions, not what they "
                "set."
            )


def described(
    size: int,
    n_inputs: int,
    *,
    state_names: Sequence[str] | None = None,
    input_names: Sequence[str] | None = None,
    low: Any = None,
    high: Any = None,
    circular: Iterable[int | str] = (),
    angles: Any = (),
    values: Any = None,
    numbered: bool = False,
    sampling_time: float | None = None,
) -> Description:
    """Check a description of `size` variables and `n_inputs` inputs.

    Raises:
        ValueError: a name, bound, axis or value is not valid.
        TypeError: `circular` or `angles` are of the wrong kind.
    """
    names = checked_names("state_names", state_names, "x", size)
    of_inputs = checked_names("input_names", input_names, "u", n_inputs)
    axes = _axes(circular, names)
    bottom, top = _end("low", low, -np.inf, size), _end("high", high, np.inf, size)
    for axis in axes:
        if np.isinf(bottom[axis]) and np.isinf(top[axis]):
            bottom[axis], top[axis] = -math.pi, math.pi
        if not np.isfinite([bottom[axis], top[axis]]).all():
            raise ValueError(
                f"low and high of the circular variable {names[axis]} must both be "
                "given, or neither: then they are -pi and pi."
            )
    if not (bottom < top).all():
        raise ValueError(
            "low must be below high in every variable, got "
            f"low={validation.shown(low)} and high={validation.shown(high)}."
        )
    pairs = Angles(angles, size - len(validation.elements(angles) or ())).pairs
    if {axis for pair in pairs for axis in pair} & set(axes):
        raise ValueError(
            "a variable must not be circular and the cosine or sine of an angle at "
            f"once, got circular={axes} and angles={pairs}."
        )
    if sampling_time is not None:
        sampling_time = validation.number("sampling_time", sampling_time, above=0)
    if values is not None:
        rows = rows_of_inputs(values, n_inputs, "values")
        values = tuple(map(tuple, rows.tolist()))
    return Description(
        names,
        of_inputs,
        tuple(bottom.tolist()),
        tuple(top.tolist()),
        axes,
        pairs,
        values,
        validation.boolean("numbered", numbered),
        sampling_time,
    )


def described_by(env: Any, inputs: Any = None) -> dict[str, Any]:
    """What an environment says about its observations and actions.

    Args:
        env: a single or a vector environment, wrapped or not.
        inputs: what each of its numbered actions sets, `(n_actions,)` or
            `(n_actions, n_inputs)`, where the user knows it and the environment does not
            say it.

    Returns:
        Arguments of `described`, and `size` and `n_inputs`.

    Raises:
        TypeError: observations are not a Box of one axis, or actions neither `Discrete`
            nor such a Box.
        ValueError: `inputs` are not a row for each numbered action, or the environment
            says itself what its actions set.
    """
    single = "single_" if hasattr(env, "single_observation_space") else ""
    seen = getattr(env, f"{single}observation_space")
    acted = getattr(env, f"{single}action_space")
    if not isinstance(seen, spaces.Box) or len(seen.shape) != 1 or seen.dtype == bool:
        raise TypeError(
            "a recording needs observations that are a Box of one axis, got "
            f"{validation.shown(seen)}; flatten them with "
            "gymnasium.wrappers.FlattenObservation."
        )
    low, high = declared_bounds(seen)
    facts: dict[str, Any] = {"size": seen.shape[0], "low": low, "high": high}
    if isinstance(acted, spaces.Discrete):
        signals = signals_of(env)
        if inputs is not None:
            values = _inputs_of_actions(inputs, int(acted.n), signals)
            facts |= {"n_inputs": values.shape[1], "values": values}
        elif signals is None:
            first = int(acted.start)
            numbers = np.arange(first, first + int(acted.n), dtype=np.float64)
            facts |= {"n_inputs": 1, "values": numbers[:, None], "numbered": True}
        else:
            facts |= {
                "n_inputs": len(signals.inputs),
                "values": signals.values,
                "input_names": signals.inputs,
                "state_names": signals.observations or None,
            }
    elif isinstance(acted, spaces.Box) and len(acted.shape) == 1:
        if inputs is not None:
            raise ValueError(
                "inputs belong to numbered actions, of which they say what each sets, got "
                f"{validation.shown(inputs)} for {validation.shown(acted)}; leave them out."
            )
        facts |= {"n_inputs": acted.shape[0]}
    else:
        raise TypeError(
            "a recording needs Discrete actions or a Box of one axis, got "
            f"{validation.shown(acted)}."
        )
    system = system_of(env)
    if system is not None and system.observation_space == seen:
        facts["circular"] = system.circular
        facts["sampling_time"] = getattr(system, "sampling_time", None)
    return facts


def _inputs_of_actions(
    inputs: Any, n_actions: int, signals: Signals | None
) -> FloatArray:
    """What each of the numbered actions sets, `(n_actions, n_inputs)`, checked."""
    if signals is not None:
        raise ValueError(
            "inputs belong to continuous actions, or to an environment that does not say "
            f"what its numbered actions set; this one does: {', '.join(signals.inputs)}, "
            f"got inputs={validation.shown(inputs)}; leave them out."
        )
    array = validation.real_array("inputs", inputs)
    array = array[:, None] if array.ndim == 1 else array
    if array.ndim != 2 or len(array) != n_actions:
        raise ValueError(
            f"inputs must hold a number or a row of numbers for each of the {n_actions} "
            f"actions of the environment, got shape {array.shape}."
        )
    return array


def _axes(circular: Any, names: tuple[str, ...]) -> tuple[int, ...]:
    listed = validation.elements([circular] if isinstance(circular, str) else circular)
    found = set()
    for each in listed if listed is not None else [None]:
        if isinstance(each, str) and each in names:
            found.add(names.index(each))
        elif (
            isinstance(each, int | np.integer)
            and not isinstance(each, bool)
            and 0 <= each < len(names)
        ):
            found.add(int(each))
        else:
            raise ValueError(
                f"circular must hold names or numbers of the variables {names}, got "
                f"{validation.shown(circular)}."
            )
    return tuple(sorted(found))


def _end(name: str, values: Any, unknown: float, size: int) -> FloatArray:
    if values is None:
        return np.full(size, unknown)
    listed = validation.elements(values)
    if listed is not None:
        values = [unknown if each is None else each for each in listed]
    array = validation.real_array(name, values, finite=False)
    if array.shape != (size,) or np.isnan(array).any():
        raise ValueError(
            f"{name} must hold a number or None for each of the {size} variables, got "
            f"{validation.shown(values)}."
        )
    return array


def rows_of_inputs(inputs: Any, n_inputs: int, name: str = "inputs") -> FloatArray:
    """Return what each action sets, `(n_actions, n_inputs)`.

    Args:
        inputs: these rows, or a number for each action.
        n_inputs: numbers in a row.
        name: what messages call them.

    Raises:
        ValueError: they are not such rows.
    """
    array = validation.real_array(name, inputs)
    array = array[:, None] if array.ndim == 1 else array
    if array.ndim != 2 or array.shape[1] != n_inputs:
        raise ValueError(
            f"{name} must hold a row of {n_inputs} numbers for each action, got shape "
            f"{array.shape}."
        )
    return array
