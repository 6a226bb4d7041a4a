"""Two coupled tanks: a pump fills the first, which runs into the second, which runs out.

The level of the second tank is to come to 15 cm and stay there, so the first must come
to its level of equilibrium as well.

    acl-gym design two_tanks.py
"""

import numpy as np

import acl_gym

AREA = 15.5  # cm^2, the cross-section of each tank
OUTLET = 0.178  # cm^2, of the hole at the bottom of each
PUMP = 3.3  # cm^3/s for each volt
GRAVITY = 981.0  # cm/s^2
LEVEL = 15.0  # cm, wanted in both: the holes are alike, so the levels at rest are too
HOLD = OUTLET * np.sqrt(2.0 * GRAVITY * LEVEL) / PUMP  # V, what holds that level


def tanks(x, u):
    """What x' is, for many pairs of tanks at once; Torricelli's law for each hole."""
    upper, lower = np.sqrt(2.0 * GRAVITY * np.maximum(x, 0.0))  # cm/s
    return [
        (PUMP * u[0] - OUTLET * upper) / AREA,
        (OUTLET * upper - OUTLET * lower) / AREA,
    ]


env = acl_gym.plant(
    tanks,
    low=[0.0, 0.0],  # cm
    high=[30.0, 30.0],
    inputs=[0.0, 0.5 * HOLD, HOLD, 1.5 * HOLD, 2.0 * HOLD],  # V
    sampling_time=2.0,  # s
    goal=[LEVEL, LEVEL],
    tolerance=[1.0, 0.5],  # cm
    cost=([0.1, 1.0], 0.0),  # each step: the squared errors of both levels
    max_episode_steps=100,  # 200 s
    state_names=["upper level, cm", "lower level, cm"],
    input_names=["pump, V"],
    num_envs=5,
)
