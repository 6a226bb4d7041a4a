"""A pendulum on a weak motor: swing it up, and arrive upright at rest.

The motor cannot lift the pendulum directly. It must first swing the other way.

    acl-gym design pendulum.py
"""

import numpy as np

import acl_gym

INERTIA = 0.005  # kg m^2
MASS = 0.1  # kg
LENGTH = 0.1  # m, from the axis to the centre of mass
GRAVITY = 9.81  # m/s^2
DAMPING = 0.01  # N m s/rad
GAIN = 0.1  # N m of torque for each unit of input


def pendulum(x, u):
    """What x' is, for many pendulums at once: x[0] holds the angles of all of them."""
    angle, speed = x  # rad from upright; rad/s
    torque = MASS * GRAVITY * LENGTH * np.sin(angle) - DAMPING * speed + GAIN * u[0]
    return [speed, torque / INERTIA]


env = acl_gym.plant(
    pendulum,
    low=[-np.pi, -9.0],  # the range: episodes begin in it,
    high=[np.pi, 9.0],  # and the model stops a state at its ends
    circular=[0],  # variable 0 is an angle: pi and -pi are the same
    inputs=[-0.8, -0.2, 0.0, 0.2, 0.8],  # what the controller can choose among
    sampling_time=0.05,  # s, the input is held so long
    goal=[0.0, 0.0],  # upright, at rest,
    tolerance=[0.1, 1.0],  # to within 0.1 rad and 1 rad/s
    cost=([1.0, 0.1], 0.05),  # each step: angle^2 + 0.1 speed^2 + 0.05 input^2
    max_episode_steps=200,  # 10 s
    state_names=["angle, rad", "speed, rad/s"],
    input_names=["motor input"],
    num_envs=5,
)
