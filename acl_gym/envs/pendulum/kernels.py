"""The kernels of the pendulum of §5.2: dynamics, stage cost and goal test."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import prange

from acl_gym.envs.control.system import BLOCK
from acl_gym.utils.compiling import njit
from acl_gym.utils.fast_math import sine
from acl_gym.utils.threads import shared_among_threads
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray

TWO_PI = 2.0 * math.pi


@njit(error_model="numpy")
def integrate(
    theta: FloatArray,
    omega: FloatArray,
    action: IntArray,
    acceleration: FloatArray,
    stiffness: float,
    friction: float,
    step: float,
    substeps: int,
) -> None:
    """Fourth-order Runge-Kutta for (5.1), the torque held constant, in place.

    omega' = acceleration[action] - stiffness sin(theta) - friction omega
    """
    half = 0.5 * step
    sixth = step / 6.0
    push = acceleration[action]
    for _ in range(substeps):
        for i in range(theta.size):
            angle = theta[i]
            speed1 = omega[i]
            rate1 = push[i] - stiffness * sine(angle) - friction * speed1
            speed2 = omega[i] + half * rate1
            rate2 = push[i] - stiffness * sine(angle + half * speed1)
            rate2 -= friction * speed2
            speed3 = omega[i] + half * rate2
            rate3 = push[i] - stiffness * sine(angle + half * speed2)
            rate3 -= friction * speed3
            speed4 = omega[i] + step * rate3
            rate4 = push[i] - stiffness * sine(angle + step * speed3)
            rate4 -= friction * speed4
            theta[i] = angle + sixth * (speed1 + 2.0 * (speed2 + speed3) + speed4)
            omega[i] = speed1 + sixth * (rate1 + 2.0 * (rate2 + rate3) + rate4)


@njit(error_model="numpy")
def settle(
    theta: FloatArray,
    omega: FloatArray,
    action: IntArray,
    omega_max: float,
    cost_theta: float,
    cost_cross: float,
    cost_omega: float,
    action_costs: FloatArray,
    bound_theta: float,
    bound_omega: float,
    rewards: FloatArray,
    reached: BoolArray,
) -> None:
    """Bring the next states into X; reward (5.4) and goal test for them, in place."""
    action_cost = action_costs[action]  # a look-up in the loop would keep it scalar
    for i in range(theta.size):
        angle = theta[i] - TWO_PI * np.floor(theta[i] / TWO_PI)
        # A tiny negative angle rounds to 2 pi itself, which is the state 0.
        angle = 0.0 if angle >= TWO_PI else angle
        speed = min(max(omega[i], -omega_max), omega_max)
        theta[i] = angle
        omega[i] = speed
        error = angle - math.pi
        rewards[i] = -(
            (cost_theta * error + 2.0 * cost_cross * speed) * error
            + cost_omega * speed * speed
            + action_cost[i]
        )
        # Not `and`: a branch here would keep the loop from being vectorised.
        near = abs(error) <= bound_theta
        reached[i] = near & (abs(speed) <= bound_omega)


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
    push, stiffness, friction, step, substeps = dynamics
    omega_max, q1, q12, q2, action_costs, bound_1, bound_2 = goal_and_cost
    part = slice(block * BLOCK, min((block + 1) * BLOCK, actions.size))
    theta, omega, action = states[0, part], states[1, part], actions[part]
    integrate(theta, omega, action, push, stiffness, friction, step, substeps)
    settle(
        theta,
        omega,
        action,
        omega_max,
        q1,
        q12,
        q2,
        action_costs,
        bound_1,
        bound_2,
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
    """One sampling time of all slots, `states` of shape (2, n) changed in place."""
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
    push, stiffness, friction, step, substeps = dynamics
    omega_max, q1, q12, q2, action_costs, bound_1, bound_2 = goal_and_cost
    for block in prange((actions.size + BLOCK - 1) // BLOCK):
        move = push, stiffness, friction, step, substeps
        target = omega_max, q1, q12, q2, action_costs, bound_1, bound_2
        advance_block(states, actions, move, target, rewards, reached, block)
