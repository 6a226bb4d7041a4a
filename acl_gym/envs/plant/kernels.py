"""The kernels of a plant: Runge-Kutta around a compiled function, bounds, goal, cost."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, lru_cache
from typing import Any

import numba
import numpy as np
from numba import literal_unroll

from acl_gym.envs.plant.uncertain import parameter_tuple
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray

Advance = Callable[
    [FloatArray, IntArray, FloatArray, float, int, FloatArray, IntArray, FloatArray],
    int,
]
"""Advances `states` `(state_size, n)` in place by `substeps` steps of `step` seconds with
the inputs `inputs[actions]` and the parameters `nominal` `(k,)`, of which those at the
indices `drawn` `(m,)` are a slot's own, `own` `(m, n)`; returns a slot whose next state is
not finite, which keeps its state, or -1."""


@lru_cache(maxsize=64)  # so that the kernels below, which depend on it, are shared too
def with_parameters(dynamics: Any, names: tuple[str, ...]) -> Any:
    """A compiled f(x, u, values) around a compiled f(x, u), or f(x, u, p) with names.

    They are not cached on disk, where nothing could tell the types of two processes
    apart.

    Args:
        dynamics: compiled by Numba.
        names: of the parameters; `values` of the function returned holds theirs in this
            order, `(k,)`.
    """
    if not names:

        @numba.njit
        def without(x: FloatArray, u: FloatArray, values: FloatArray) -> Any:
            return dynamics(x, u)

        return without
    made, tuple_of = parameter_tuple(names), _first_entries(len(names))

    @numba.njit
    def by_name(x: FloatArray, u: FloatArray, values: FloatArray) -> Any:
        return dynamics(x, u, made(*tuple_of(values)))

    return by_name


@cache
def _first_entries(count: int) -> Any:
    """A compiled function that makes a tuple of the first entries of an array."""
    if count == 0:

        @numba.njit
        def none(values: FloatArray) -> Any:
            return ()

        return none
    others = _first_entries(count - 1)

    @numba.njit
    def some(values: FloatArray) -> Any:
        return (*others(values), values[count - 1])

    return some


@njit
def put_tuple(values: Any, out: FloatArray) -> None:
    """Copy a tuple, whose numbers may be of different types."""
    i = 0
    for value in literal_unroll(values):
        out[i] = value
        i += 1  # noqa: SIM113 - Numba unrolls no enumerate


@njit
def put_sequence(values: Any, out: FloatArray) -> None:
    """Copy an array or a list, which may be of another length each time."""
    if len(values) != out.size:
        raise ValueError(
            "dynamics compiled by Numba must return one number for each state variable "
            "in each call, got another count than for the first state; return a tuple."
        )
    for i in range(out.size):
        out[i] = values[i]


@lru_cache(maxsize=64)  # copies of an environment share what was compiled
def advance_ode(dynamics: Any, size: int, put: Any, writes: bool) -> Advance:
    """Fourth-order Runge-Kutta around a compiled x' = f(x, u), the input held constant.

    Args:
        dynamics: of `with_parameters`; takes the state `(size,)`, the input
            `(n_inputs,)` and the parameters `(k,)` of one slot.
        size: the number of state variables.
        put: `put_tuple` or `put_sequence`, for what `dynamics` returns.
        writes: whether `dynamics` may write to its arguments. It then gets fresh copies
            in each call, which take a sixth of the time of a simple plant.
    """

    @njit(error_model="numpy")
    def advance(
        states: FloatArray,
        actions: IntArray,
        inputs: FloatArray,
        step: float,
        substeps: int,
        nominal: FloatArray,
        drawn: IntArray,
        own: FloatArray,
    ) -> int:
        x, y = np.empty(size), np.empty(size)
        k1, k2, k3, k4 = np.empty(size), np.empty(size), np.empty(size), np.empty(size)
        n_inputs = inputs.shape[1]
        copied = np.empty(n_inputs)
        p = nominal.copy()
        bad = -1
        for slot in range(actions.size):
            action = actions[slot]
            u = copied if writes else inputs[action]
            for i in range(size):
                x[i] = states[i, slot]
            for i in range(drawn.size):
                p[drawn[i]] = own[i, slot]
            for _ in range(substeps):
                if writes:
                    for i in range(size):
                        y[i] = x[i]
                    for i in range(n_inputs):
                        u[i] = inputs[action, i]
                    put(dynamics(y, u, p), k1)
                else:
                    put(dynamics(x, u, p), k1)
                for i in range(size):
                    y[i] = x[i] + 0.5 * step * k1[i]
                if writes:
                    for i in range(n_inputs):
                        u[i] = inputs[action, i]
                put(dynamics(y, u, p), k2)
                for i in range(size):
                    y[i] = x[i] + 0.5 * step * k2[i]
                if writes:
                    for i in range(n_inputs):
                        u[i] = inputs[action, i]
                put(dynamics(y, u, p), k3)
                for i in range(size):
                    y[i] = x[i] + step * k3[i]
                if writes:
                    for i in range(n_inputs):
                        u[i] = inputs[action, i]
                put(dynamics(y, u, p), k4)
                for i in range(size):
                    x[i] += step / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])
            finite = True
            for i in range(size):
                finite &= np.isfinite(x[i])
            if finite:
                for i in range(size):
                    states[i, slot] = x[i]
            elif bad < 0:
                bad = slot
        return bad

    return advance


@lru_cache(maxsize=64)
def advance_map(dynamics: Any, size: int, put: Any) -> Advance:
    """One step of a compiled map x(t+1) = f(x, u); see `advance_ode`."""

    @njit(error_model="numpy")
    def advance(
        states: FloatArray,
        actions: IntArray,
        inputs: FloatArray,
        step: float,
        substeps: int,
        nominal: FloatArray,
        drawn: IntArray,
        own: FloatArray,
    ) -> int:
        x, y = np.empty(size), np.empty(size)
        u = np.empty(inputs.shape[1])
        p = nominal.copy()
        bad = -1
        for slot in range(actions.size):
            for i in range(size):
                x[i] = states[i, slot]
            for i in range(drawn.size):
                p[drawn[i]] = own[i, slot]
            for i in range(u.size):
                u[i] = inputs[actions[slot], i]
            put(dynamics(x, u, p), y)
            finite = True
            for i in range(size):
                finite &= np.isfinite(y[i])
            if finite:
                for i in range(size):
                    states[i, slot] = y[i]
            elif bad < 0:
                bad = slot
        return bad

    return advance


@njit(error_model="numpy")
def settle(
    states: FloatArray, low: FloatArray, high: FloatArray, period: FloatArray
) -> None:
    """Bring finite states into X in place: circular variables wrap, others are clipped.

    Args:
        states: `(state_size, n)`.
        low: of each variable.
        high: of each variable.
        period: of each variable, 0 where it is not circular.
    """
    for row in range(states.shape[0]):
        x, bottom, top, turn = states[row], low[row], high[row], period[row]
        if turn > 0.0:
            for slot in range(x.size):
                wrapped = x[slot] - turn * np.floor((x[slot] - bottom) / turn)
                # Rounding may lead to the upper end, which is the lower one.
                inside = (wrapped >= bottom) & (wrapped < top)
                x[slot] = wrapped if inside else bottom
        else:
            for slot in range(x.size):
                x[slot] = min(max(x[slot], bottom), top)


@njit(error_model="numpy")
def judge(
    states: FloatArray,
    actions: IntArray,
    centre: FloatArray,
    half: FloatArray,
    period: FloatArray,
    weight: FloatArray,
    action_costs: FloatArray,
    rewards: FloatArray,
    reached: BoolArray,
) -> None:
    """Reward and goal test of the next states.

    Args:
        states: `(state_size, n)`, within X.
        actions: `(n,)`.
        centre: of the goal, `(state_size,)`.
        half: half-widths of the goal; negative if there is none.
        period: of each variable, 0 where it is not circular.
        weight: Q of the quadratic cost, `(state_size, state_size)`; `(0, 0)` if
            errors cost nothing.
        action_costs: what each action costs.
        rewards: receives -(e' Q e + cost of the action).
        reached: receives whether the error is within `half`.
    """
    # Row by row, so that the loops over slots are vectorised.
    errors = np.empty_like(states)
    reached[:] = True
    for i in range(states.shape[0]):
        x, e, middle, turn, width = states[i], errors[i], centre[i], period[i], half[i]
        for slot in range(x.size):
            e[slot] = x[slot] - middle
        if turn > 0.0:
            for slot in range(x.size):
                e[slot] -= turn * np.floor(e[slot] / turn + 0.5)
        for slot in range(x.size):
            reached[slot] &= abs(e[slot]) <= width
    for slot in range(rewards.size):
        rewards[slot] = -action_costs[actions[slot]]
    for i in range(weight.shape[0]):
        for j in range(weight.shape[1]):
            factor = weight[i, j]
            if factor != 0.0:
                for slot in range(rewards.size):
                    rewards[slot] -= factor * errors[i, slot] * errors[j, slot]
