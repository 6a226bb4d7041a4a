"""The kernels that threads share, for `acl_gym.threads`; imported only when asked for.

Each does what its namesake does, block by block: the blocks do not depend on the
number of threads, and none reads what another writes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit, prange

from acl_gym.agents.pheromone import BoolArray
from acl_gym.agents.selection import draw_action
from acl_gym.envs import navigation_kernels, pendulum_kernels
from acl_gym.envs.system import BLOCK as SLOTS
from acl_gym.membership import (
    BLOCK as STATES,
)
from acl_gym.membership import (
    Axes,
    CellArray,
    FloatArray,
    IntArray,
    locate_block,
    scratch_for,
)


@njit(cache=True, parallel=True, error_model="numpy")
def locate(
    states: FloatArray,
    slots: IntArray,
    edges: FloatArray,
    axes: Axes,
    fuzzy: bool,
    index: CellArray,
    degree: FloatArray,
) -> int:
    """See `membership.locate`."""
    # Threads are given plain tuples only, not tuples of tuples.
    first, count, cells, period, rate = axes
    n_blocks = (slots.size + STATES - 1) // STATES
    bad = np.empty(n_blocks, np.int64)
    for block in prange(n_blocks):
        own = first, count, cells, period, rate
        ends, reals = scratch_for(len(first))
        bad[block] = locate_block(
            states, slots, edges, own, fuzzy, index, degree, block, ends, reals
        )
    for slot in bad:
        if slot >= 0:
            return int(slot)
    return -1


@njit(cache=True, parallel=True, error_model="numpy")
def boltzmann(
    levels: FloatArray,
    alpha: float,
    probabilities: FloatArray,
    index: CellArray,
    degree: FloatArray,
    draws: FloatArray,
    epsilon: float,
    allowed: BoolArray,
    columns: tuple[int, ...],
    corners: tuple[int, ...],
    actions: IntArray,
) -> None:
    """See `selection.choose_actions`."""
    for j in prange(actions.size):
        actions[j] = draw_action(
            levels,
            alpha,
            probabilities,
            index,
            degree,
            draws,
            epsilon,
            allowed,
            columns,
            corners,
            j,
        )


@njit(cache=True, parallel=True, error_model="numpy")
def advance_pendulum(
    states: FloatArray,
    actions: IntArray,
    dynamics: tuple[Any, ...],
    goal_and_cost: tuple[Any, ...],
    rewards: FloatArray,
    reached: BoolArray,
) -> None:
    """See `pendulum_kernels.advance`."""
    push, stiffness, friction, step, substeps = dynamics
    omega_max, q1, q12, q2, price, bound_1, bound_2 = goal_and_cost
    for block in prange((actions.size + SLOTS - 1) // SLOTS):
        move = push, stiffness, friction, step, substeps
        settle = omega_max, q1, q12, q2, price, bound_1, bound_2
        pendulum_kernels.advance_block(
            states, actions, move, settle, rewards, reached, block
        )


@njit(cache=True, parallel=True, error_model="numpy")
def advance_navigation(
    states: FloatArray,
    actions: IntArray,
    dynamics: tuple[Any, ...],
    goal_and_cost: tuple[Any, ...],
    rewards: FloatArray,
    reached: BoolArray,
) -> None:
    """See `navigation_kernels.advance`."""
    push, base, peaks, step, substeps = dynamics
    x_max, v_max, weight, price, product, goal_x, goal_v = goal_and_cost
    for block in prange((actions.size + SLOTS - 1) // SLOTS):
        move = push, base, peaks, step, substeps
        settle = x_max, v_max, weight, price, product, goal_x, goal_v
        navigation_kernels.advance_block(
            states, actions, move, settle, rewards, reached, block
        )
