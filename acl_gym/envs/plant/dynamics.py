"""The user's equations: checked on sample states, then integrated for all slots."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numba import typeof, types
from numba.core.dispatcher import Dispatcher
from numba.core.errors import NumbaError

from acl_gym.envs.plant import kernels
from acl_gym.envs.plant.models import Model, is_model
from acl_gym.envs.plant.uncertain import PlantParameters
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray, IntArray

_SAMPLES = 7  # no usual number of variables, so that mixed-up axes are noticed


class Equations:
    """x' = f(x, u, p) or x(t+1) = f(x, u, p), for many states at once.

    Args:
        dynamics: see `plant`.
        samples: states to try it on, `(state_size, n)`.
        inputs: `(n_actions, n_inputs)`.
        discrete_time: whether it gives the next state.
        parameters: p. Where there are none, the dynamics is a function of x and u.

    Raises:
        TypeError: `dynamics` cannot be called.
        ValueError: it fails, or does not give finite numbers of the right shape.
    """

    def __init__(
        self,
        dynamics: Any,
        samples: FloatArray,
        inputs: FloatArray,
        discrete_time: bool,
        parameters: PlantParameters,
    ) -> None:
        self._dynamics = dynamics
        self._discrete_time = discrete_time
        self._parameters = parameters
        self._compiled: kernels.Advance | None = None
        self._reuses_memory = False
        drawn = parameters.draw(np.random.default_rng(1), samples.shape[1])
        if is_model(dynamics):
            self._dynamics = _checked_model(
                dynamics, samples, inputs, parameters, drawn
            )
        elif hasattr(dynamics, "ninputs"):
            raise TypeError(
                "dynamics must be a python-control system with a state, got "
                f"{type(dynamics).__name__}; convert it with control.tf2ss."
            )
        elif not callable(dynamics):
            raise TypeError(
                f"dynamics must be a function of {_arguments(parameters.names)} or a "
                "python-control system, "
                f"got {validation.shown(dynamics)}."
            )
        elif isinstance(dynamics, Dispatcher):
            self._check_compiled(samples, inputs, drawn)
        else:
            _check(dynamics, samples, inputs, parameters, drawn)
        if not isinstance(self._dynamics, Dispatcher):
            f, u = (
                _bound(self._dynamics, parameters, drawn),
                _inputs_for(samples, inputs),
            )
            self._reuses_memory = _reuses_memory(f, samples, u)

    def __getstate__(self) -> dict[str, Any]:
        """A kernel is compiled again in each process."""
        return {**self.__dict__, "_compiled": None}

    def advance(
        self,
        states: FloatArray,
        actions: IntArray,
        inputs: FloatArray,
        step: float,
        substeps: int,
        own: FloatArray,
    ) -> int:
        """Advance states in place; see `kernels.Advance`."""
        parameters = self._parameters
        if isinstance(self._dynamics, Dispatcher):
            if self._compiled is None:
                self._compiled = self._compile(states, inputs)
            more = parameters.for_kernel(own)
            return self._compiled(states, actions, inputs, step, substeps, *more)
        f, u = _bound(self._dynamics, parameters, own), inputs.T[:, actions]
        u.setflags(write=False)
        copied = self._reuses_memory
        # What is not finite is an error of its own; no need to warn of it as well.
        with np.errstate(all="ignore"):
            x = states
            if self._discrete_time:
                x = _evaluated(f, validation.read_only(x), u, copied)
            else:
                for _ in range(substeps):
                    # The others are temporary arrays.
                    k1 = _evaluated(f, validation.read_only(x), u, copied)
                    k2 = _evaluated(f, x + 0.5 * step * k1, u, copied)
                    k3 = _evaluated(f, x + 0.5 * step * k2, u, copied)
                    k4 = _evaluated(f, x + step * k3, u, copied)
                    x = x + step / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
            finite = np.isfinite(x)
        if finite.all():
            states[:] = x
            return -1
        good = finite.all(axis=0)
        states[:, good] = x[:, good]
        return int(np.argmin(good))

    def _compile(self, states: FloatArray, inputs: FloatArray) -> kernels.Advance:
        known = self._parameters
        p = [known.of(known.nominal_drawn)] if known.names else []
        given = self._dynamics(states[:, 0].copy(), inputs[0].copy(), *p)
        put = kernels.put_sequence
        if isinstance(given, tuple):
            put = kernels.put_tuple
        parts = kernels.with_parameters(self._dynamics, known.names)
        if self._discrete_time:
            return kernels.advance_map(parts, len(states), put)
        writes = _may_write(self._dynamics, p)
        return kernels.advance_ode(parts, len(states), put, writes)

    def _check_compiled(
        self, samples: FloatArray, inputs: FloatArray, drawn: FloatArray
    ) -> None:
        """Check a function that takes one state after the other."""
        size, known = len(samples), self._parameters
        named = ""
        if known.names:
            named = f", and parameters p with numbers such as p.{known.names[0]}"
        expects = (
            f"dynamics compiled by Numba must take a state x of shape ({size},) and an "
            f"input u of shape ({inputs.shape[1]},){named}, and return {size} finite "
            "numbers, such as (x[1], -x[0] + u[0])"
        )
        for j, x in enumerate(np.ascontiguousarray(samples.T)):
            u = inputs[j % len(inputs)]
            p = [known.of(drawn[:, j])] if known.names else []
            try:
                given = self._dynamics(x.copy(), u.copy(), *p)
                values = np.asarray(given, dtype=np.float64)
            except (
                NumbaError,
                ArithmeticError,
                LookupError,
                TypeError,
                ValueError,
            ) as error:
                raise ValueError(
                    f"{expects}; it failed: {_first_line(error)}"
                ) from error
            if values.shape != (size,) or not np.isfinite(values).all():
                at = f"x = {x.tolist()}, u = {u.tolist()}"
                at += f", p = {p[0]}" if p else ""
                raise ValueError(f"{expects}, got {validation.shown(given)} for {at}.")
        try:
            self._compiled = self._compile(samples, inputs)
            actions = np.zeros(1, dtype=np.int64)
            self._compiled(
                *(samples[:, :1].copy(), actions, inputs, 0.0, 1),
                *known.for_kernel(drawn[:, :1].copy()),
            )
        except NumbaError as error:
            raise ValueError(f"{expects}; it failed: {_first_line(error)}") from error


def sample_count() -> int:
    """How many states equations are tried on."""
    return _SAMPLES


def _bound(
    dynamics: Any, parameters: PlantParameters, drawn: FloatArray
) -> Callable[[FloatArray, FloatArray], Any]:
    """f(x, u) of plants with these parameters, `(m, n)`."""
    if not parameters.names:
        return dynamics  # type: ignore[no-any-return]
    p = parameters.of(drawn)
    return lambda x, u: dynamics(x, u, p)


def _arguments(names: tuple[str, ...]) -> str:
    return "(x, u, p)" if names else "(x, u)"


def _may_write(dynamics: Dispatcher, parameters: list[Any]) -> bool:
    """Whether a compiled function may write to its arguments: read-only ones tell."""
    read_only = types.Array(types.float64, 1, "C", readonly=True)
    try:
        dynamics.compile((read_only, read_only, *map(typeof, parameters)))
    except (NumbaError, RuntimeError):  # the latter where its types are fixed
        return True
    return False


def _expects(size: int, n_inputs: int, names: tuple[str, ...] = ()) -> str:
    named = f", and parameters p, such as p.{names[0]} of all n," if names else ""
    return (
        f"dynamics must take states x of shape ({size}, n) and inputs u of shape "
        f"({n_inputs}, n), so that x[0] is the first variable of all n states,{named} "
        f"and return {size} rows of n numbers, such as [x[1], -np.sin(x[0]) + u[0]]"
    )


def _reuses_memory(
    f: Callable[[FloatArray, FloatArray], Any], x: FloatArray, u: FloatArray
) -> bool:
    """Whether each call writes to the array that the call before it returned."""
    x, u = validation.read_only(x), validation.read_only(u)
    with np.errstate(all="ignore"):
        one, other = f(x, u), f(x, u)
    arrays = isinstance(one, np.ndarray) and isinstance(other, np.ndarray)
    return arrays and np.may_share_memory(one, other)


def _evaluated(
    dynamics: Any, x: FloatArray, u: FloatArray, copied: bool = False
) -> FloatArray:
    """f(x, u) as an array.

    Args:
        dynamics: f.
        x: states, `(state_size, n)`.
        u: inputs, `(n_inputs, n)`.
        copied: whether the result is needed beyond the next call, which overwrites it.

    Raises:
        ValueError: it writes to read-only arguments, or does not give a row of real
            numbers for each variable.
    """
    try:
        given = dynamics(x, u)
    except ValueError as error:
        if "read-only" not in str(error):
            raise
        raise ValueError(
            "dynamics must not change x and u, which belong to the environment, got "
            f"{_first_line(error)}; write to a copy, x.copy()."
        ) from error
    shape = x.shape
    if (
        isinstance(given, np.ndarray)
        and given.shape == shape
        and given.dtype.kind in "iuf"
    ):
        return given.copy() if copied else given
    stacked = np.empty(shape)
    try:
        for row, value in zip(stacked, given, strict=True):
            entries = value if isinstance(value, np.ndarray) else np.asarray(value)
            if entries.dtype.kind not in "biuf":  # an assignment would convert them
                raise TypeError(f"got a row of {entries.dtype}")
            row[...] = entries
    except (TypeError, ValueError) as error:
        got = validation.shown(given)
        if isinstance(given, np.ndarray):
            got = f"shape {given.shape} of {given.dtype}"
        elif isinstance(given, list | tuple):
            got = f"{len(given)} rows"
        raise ValueError(
            f"{_expects(len(x), len(u))}, in each call, got {got} for {shape[1]} states: "
            f"{_first_line(error)}"
        ) from error
    return stacked


def _checked_model(
    system: Any,
    samples: FloatArray,
    inputs: FloatArray,
    parameters: PlantParameters,
    drawn: FloatArray,
) -> Model:
    """A python-control system as a function; one by one if it takes no arrays."""
    size, n_inputs = system.nstates, system.ninputs
    if (size, n_inputs) != (len(samples), inputs.shape[1]):
        raise ValueError(
            f"low, high and inputs must fit the system {system.name}, which has {size} "
            f"states and {n_inputs} inputs, got {len(samples)} states and "
            f"{inputs.shape[1]} inputs."
        )
    model = Model(system)
    model.check_names(parameters.names)
    try:
        _check(model, samples, inputs, parameters, drawn)
    except ValueError:
        model = Model(system, one_by_one=True)
        _check(model, samples, inputs, parameters, drawn)
    u = _inputs_for(samples, inputs)
    now, later = (
        _evaluated(_bound(partial(model.at, time), parameters, drawn), samples, u)
        for time in (0.0, 17.3)
    )
    if not np.array_equal(now, later):
        raise ValueError(
            f"the system {system.name} must not depend on time, which a policy of the "
            "state does not see; make the time, or what follows it, a state."
        )
    return model


def _inputs_for(samples: FloatArray, inputs: FloatArray) -> FloatArray:
    return inputs.T[:, np.arange(samples.shape[1]) % len(inputs)]


def _check(
    dynamics: Any,
    samples: FloatArray,
    inputs: FloatArray,
    parameters: PlantParameters,
    drawn: FloatArray,
) -> None:
    """Check a function of many states on samples, together and one by one."""
    count, names = samples.shape[1], parameters.names
    u = _inputs_for(samples, inputs)
    together = _tried(_bound(dynamics, parameters, drawn), samples, u, names)
    for j in range(count):
        one = slice(j, j + 1)
        by_itself = _bound(dynamics, parameters, drawn[:, one])
        alone = _tried(by_itself, samples[:, one], u[:, one], names)
        if not np.allclose(alone[:, 0], together[:, j], rtol=1e-9, atol=1e-12):
            of = "x, u and p" if names else "x and u"
            raise ValueError(
                f"dynamics must treat each column of {of} by itself, and the same "
                f"each time; for x = {samples[:, j].tolist()}, u = {u[:, j].tolist()} "
                f"it gave {together[:, j].tolist()} among {count} columns and "
                f"{alone[:, 0].tolist()} alone."
            )


def _tried(
    dynamics: Any, x: FloatArray, u: FloatArray, names: tuple[str, ...]
) -> FloatArray:
    size, count = x.shape
    expects = _expects(size, len(u), names)
    x, u = x.copy(), u.copy()
    x.flags.writeable = u.flags.writeable = False
    try:
        with np.errstate(all="ignore"):
            given = dynamics(x, u)
    except Exception as error:  # whatever the user's code raises
        hint = ""
        if "truth value" in str(error):
            hint = "; np.where chooses for each state where `if` cannot"
        if "read-only" in str(error):
            hint = "; it must not change x and u"
        if not names and "required positional argument" in str(error):
            hint = "; a third argument needs parameters= or uncertain="
        raise ValueError(
            f"{expects}; for {count} states it raised {_first_line(error)}{hint}"
        ) from error
    try:
        rows = [np.asarray(row) for row in given]
        stacked = np.stack([np.broadcast_to(row, (count,)) for row in rows])
    except (TypeError, ValueError) as error:
        shape = getattr(given, "shape", None)
        got = f"shape {shape}" if shape is not None else validation.shown(given)
        raise ValueError(f"{expects}, got {got} for {count} states.") from error
    if len(stacked) != size or stacked.dtype.kind not in "iuf":
        raise ValueError(
            f"{expects}, got shape {stacked.shape} of {stacked.dtype} for {count} states."
        )
    if not np.isfinite(stacked).all():
        j = int(np.flatnonzero(~np.isfinite(stacked).all(axis=0))[0])
        raise ValueError(
            f"dynamics must be finite within low and high, got {stacked[:, j].tolist()} "
            f"for x = {x[:, j].tolist()}, u = {u[:, j].tolist()}; check divisions, "
            "roots and logarithms, or narrow the bounds."
        )
    return stacked.astype(np.float64)


def _first_line(error: Exception) -> str:
    lines = [line for line in str(error).splitlines() if line.strip()]
    return f"{type(error).__name__}: {lines[0] if lines else ''}"
