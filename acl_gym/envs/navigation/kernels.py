"""The kernels of the navigation of §4.5: dynamics, stage cost and goal test."""

from __future__ import annotations

from typing import Any

from numba import prange

from acl_gym.envs.control.system import BLOCK
from acl_gym.utils.compiling import njit
from acl_gym.utils.fast_math import exponential
from acl_gym.utils.threads import shared_among_threads
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray

Peak = tuple[float, float, float, float, float]
Row = tuple[float, float, float, float]


@njit(error_model="numpy", inline="always")
def damping_at(c1: float, c2: float, base: float, peaks: tuple[float, ...]) -> float:
    """The damping at one position; a peak is height, m1, m2, 1 / sigma1, 1 / sigma2.

    The peaks, one after the other, are a tuple, so that their number is known when the
    kernel is compiled and the loop over the slots is the innermost one that is left.
    """
    total = base
    for k in range(len(peaks) // 5):
        distance_1 = (c1 - peaks[5 * k + 1]) * peaks[5 * k + 3]
        distance_2 = (c2 - peaks[5 * k + 2]) * peaks[5 * k + 4]
        total += peaks[5 * k] * exponential(
            -(distance_1 * distance_1 + distance_2 * distance_2)
        )
    return total


@njit(error_model="numpy")
def integrate(
    c1: FloatArray,
    v1: FloatArray,
    c2: FloatArray,
    v2: FloatArray,
    action: IntArray,
    acceleration: FloatArray,
    base: float,
    peaks: tuple[float, ...],
    step: float,
    substeps: int,
) -> None:
    """Fourth-order Runge-Kutta for §4.5.1, the force held constant, in place.

    c_j' = v_j,  v_j' = acceleration[j, action] - b(c1, c2) v_j,  for j = 1, 2
    """
    half = 0.5 * step
    sixth = step / 6.0
    push1 = acceleration[0][action]
    push2 = acceleration[1][action]
    for _ in range(substeps):
        for i in range(c1.size):
            x1, x2 = c1[i], c2[i]
            p1, p2 = push1[i], push2[i]
            sa1, sa2 = v1[i], v2[i]
            b = damping_at(x1, x2, base, peaks)
            ra1, ra2 = p1 - b * sa1, p2 - b * sa2
            sb1, sb2 = sa1 + half * ra1, sa2 + half * ra2
            b = damping_at(x1 + half * sa1, x2 + half * sa2, base, peaks)
            rb1, rb2 = p1 - b * sb1, p2 - b * sb2
            sc1, sc2 = sa1 + half * rb1, sa2 + half * rb2
            b = damping_at(x1 + half * sb1, x2 + half * sb2, base, peaks)
            rc1, rc2 = p1 - b * sc1, p2 - b * sc2
            sd1, sd2 = sa1 + step * rc1, sa2 + step * rc2
            b = damping_at(x1 + step * sc1, x2 + step * sc2, base, peaks)
            rd1, rd2 = p1 - b * sd1, p2 - b * sd2
            c1[i] = x1 + sixth * (sa1 + 2.0 * (sb1 + sc1) + sd1)
            c2[i] = x2 + sixth * (sa2 + 2.0 * (sb2 + sc2) + sd2)
            v1[i] = sa1 + sixth * (ra1 + 2.0 * (rb1 + rc1) + rd1)
            v2[i] = sa2 + sixth * (ra2 + 2.0 * (rb2 + rc2) + rd2)


@njit(error_model="numpy")
def settle(
    c1: FloatArray,
    v1: FloatArray,
    c2: FloatArray,
    v2: FloatArray,
    action: IntArray,
    position_max: float,
    velocity_max: float,
    weight: tuple[float, ...],
    action_costs: FloatArray,
    product: bool,
    goal_position: float,
    goal_velocity: float,
    rewards: FloatArray,
    reached: BoolArray,
) -> None:
    """Clip the next states to X; reward (3.2) and goal test for them, in place.

    The goal is a product of triangles > 0.5 if `product`, else a box. `weight` is the
    symmetric Q, row by row.
    """
    w11, w12, w13, w14, _, w22, w23, w24, _, _, w33, w34, _, _, _, w44 = weight
    action_cost = action_costs[action]
    for i in range(c1.size):
        x1 = min(max(c1[i], -position_max), position_max)
        x2 = min(max(c2[i], -position_max), position_max)
        s1 = min(max(v1[i], -velocity_max), velocity_max)
        s2 = min(max(v2[i], -velocity_max), velocity_max)
        c1[i], v1[i], c2[i], v2[i] = x1, s1, x2, s2
        rewards[i] = -(
            (w11 * x1 + 2.0 * (w12 * s1 + w13 * x2 + w14 * s2)) * x1
            + (w22 * s1 + 2.0 * (w23 * x2 + w24 * s2)) * s1
            + (w33 * x2 + 2.0 * w34 * s2) * x2
            + w44 * s2 * s2
            + action_cost[i]
        )
        x1, s1, x2, s2 = abs(x1), abs(s1), abs(x2), abs(s2)
        if product:
            degree = max(1.0 - x1 / goal_position, 0.0)
            degree *= max(1.0 - s1 / goal_velocity, 0.0)
            degree *= max(1.0 - x2 / goal_position, 0.0)
            degree *= max(1.0 - s2 / goal_velocity, 0.0)
            reached[i] = degree > 0.5
        else:
            # Not `and`: a branch here would keep the loop from being vectorised.
            near = max(x1, x2) <= goal_position
            reached[i] = near & (max(s1, s2) <= goal_velocity)


@njit(error_model="numpy")
def advance_block(
    states: FloatArray,
    actions: IntArray,
    dynamics: tuple[Any, ...],
    goal_and_cost: tuple[Any, ...],
    rewards: FloatArray,
    reached: BoolArray,
    block: int,
) -> None:
    """Do what `advance` does for the `BLOCK` slots from `block` * `BLOCK` on."""
    push, base, peaks, step, substeps = dynamics
    x_max, v_max, weight, action_costs, product, goal_x, goal_v = goal_and_cost
    part = slice(block * BLOCK, min((block + 1) * BLOCK, actions.size))
    c1, v1 = states[0, part], states[1, part]
    c2, v2 = states[2, part], states[3, part]
    action = actions[part]
    integrate(c1, v1, c2, v2, action, push, base, peaks, step, substeps)
    settle(
        c1,
        v1,
        c2,
        v2,
        action,
        x_max,
        v_max,
        weight,
        action_costs,
        product,
        goal_x,
        goal_v,
        rewards[part],
        reached[part],
    )


@njit
def advance(
    states: FloatArray,
    actions: IntArray,
    dynamics: tuple[Any, ...],
    goal_and_cost: tuple[Any, ...],
    rewards: FloatArray,
    reached: BoolArray,
) -> None:
    """One sampling time of all slots, `states` of shape (4, n) changed in place."""
    for block in range((actions.size + BLOCK - 1) // BLOCK):
        advance_block(states, actions, dynamics, goal_and_cost, rewards, reached, block)


@shared_among_threads
@njit(parallel=True, error_model="numpy")
def advance_in_parallel(
    states: FloatArray,
    actions: IntArray,
    dynamics: tuple[Any, ...],
    goal_and_cost: tuple[Any, ...],
    rewards: FloatArray,
    reached: BoolArray,
) -> None:
    """Do what `advance` does, its blocks shared among threads."""
    # Numba takes no tuple within a tuple into a parallel loop.
    push, base, peaks, step, substeps = dynamics
    x_max, v_max, weight, action_costs, product, goal_x, goal_v = goal_and_cost
    for block in prange((actions.size + BLOCK - 1) // BLOCK):
        move = push, base, peaks, step, substeps
        target = x_max, v_max, weight, action_costs, product, goal_x, goal_v
        advance_block(states, actions, move, target, rewards, reached, block)
