"""A DC motor with a gear: turn the shaft to angle 0 and stop there, against friction.

The power stage knows five voltages. The current follows the voltage so fast that it is no
state of its own; dry friction is smoothed, so that it has no jump at standstill.

    acl-gym design dc_motor.py
"""

import numpy as np
from gymnasium.spaces import Box

import acl_gym

# All values at the output shaft, behind the gear.
INERTIA = 0.02  # kg m^2, of the load
RESISTANCE = 4.0  # ohm
CONSTANT = 0.5  # N m/A, and V s/rad
DAMPING = 0.01  # N m s/rad
FRICTION = 0.1  # N m, dry friction


def motor(x, u):
    """What x' is, for many motors at once: x[0] holds the angles of all of them."""
    speed = x[1]
    current = (u[0] - CONSTANT * speed) / RESISTANCE
    friction = DAMPING * speed + FRICTION * np.tanh(speed / 0.2)
    return [speed, (CONSTANT * current - friction) / INERTIA]


env = acl_gym.plant(
    motor,
    low=[-4.0, -20.0],  # rad, rad/s: what is ever met
    high=[4.0, 20.0],
    initial=Box(np.array([-np.pi, -5.0]), np.array([np.pi, 5.0]), dtype=float),
    inputs=[-12.0, -3.0, 0.0, 3.0, 12.0],  # V
    sampling_time=0.02,  # s
    goal=[0.0, 0.0],
    tolerance=[0.03, 0.5],  # 0.03 rad are 1.7 degrees
    cost=([1.0, 0.002], 0.0005),  # each step: angle^2 + 0.002 speed^2 + 0.0005 V^2
    max_episode_steps=150,  # 3 s
    state_names=["angle, rad", "speed, rad/s"],
    input_names=["voltage, V"],
    num_envs=5,
)
