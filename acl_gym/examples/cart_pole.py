"""A pole that hangs from a cart: swing it up, and bring it to rest near the middle.

Four variables and three forces. The equations are compiled with Numba, for one state at a
time, because half a million steps are made.

    acl-gym design cart_pole.py
"""

import math

from numba import njit

import acl_gym

CART = 1.0  # kg
POLE = 0.1  # kg
LENGTH = 0.5  # m, from the hinge to the middle of the pole
GRAVITY = 9.81  # m/s^2


@njit
def cart_pole(x, u):
    """What x' is, for one cart with its pole."""
    speed, angle, turning = x[1], x[2], x[3]
    sine, cosine, mass = math.sin(angle), math.cos(angle), CART + POLE
    push = (u[0] + POLE * LENGTH * turning**2 * sine) / mass
    inertia = LENGTH * (4.0 / 3.0 - POLE * cosine**2 / mass)
    turn = (GRAVITY * sine - cosine * push) / inertia
    return speed, push - POLE * LENGTH * turn * cosine / mass, turning, turn


env = acl_gym.plant(
    cart_pole,
    low=[-2.4, -4.0, -math.pi, -9.0],  # m, m/s, rad from upright, rad/s
    high=[2.4, 4.0, math.pi, 9.0],
    circular=[2],
    inputs=[-10.0, 0.0, 10.0],  # N
    sampling_time=0.05,  # s
    goal=[0.0, 0.0, 0.0, 0.0],
    tolerance=[1.0, 1.0, 0.2, 1.0],  # from where a linear controller holds it
    cost=([0.1, 0.02, 1.0, 0.1], 0.0),  # each step, on the squares of the four errors
    max_episode_steps=120,  # 6 s
    state_names=["position, m", "speed, m/s", "angle, rad", "turning, rad/s"],
    input_names=["force, N"],
    num_envs=10,
)
