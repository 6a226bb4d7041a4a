"""The control systems that ants walk through, as Gymnasium environments.

The table of all environment ids, which are registered when `acl_gym` is imported.
"""

from __future__ import annotations

import gymnasium as gym

# id: (single environment, native vector environment). No time limit is registered:
# `max_episode_steps` is a keyword of `make` and `make_vec`.
ENVIRONMENTS = {
    "acl_gym/GridSearch1D-v0": (
        "acl_gym.envs.grid_search:GridSearch1DEnv",
        "acl_gym.envs.grid_search:GridSearch1DVectorEnv",
    ),
    "acl_gym/GridSearch2D-v0": (
        "acl_gym.envs.grid_search:GridSearch2DEnv",
        "acl_gym.envs.grid_search:GridSearch2DVectorEnv",
    ),
    "acl_gym/Pendulum-v0": (
        "acl_gym.envs.pendulum:PendulumEnv",
        "acl_gym.envs.pendulum:PendulumVectorEnv",
    ),
    "acl_gym/Navigation-v0": (
        "acl_gym.envs.navigation:NavigationEnv",
        "acl_gym.envs.navigation:NavigationVectorEnv",
    ),
    "acl_gym/TwoState-v0": (
        "acl_gym.envs.two_state:TwoStateEnv",
        "acl_gym.envs.two_state:TwoStateVectorEnv",
    ),
}


def register_environments() -> None:
    """Register every id of the table with Gymnasium; calling it again is harmless."""
    for env_id, (entry_point, vector_entry_point) in ENVIRONMENTS.items():
        if env_id not in gym.registry:
            gym.register(
                env_id,
                entry_point=entry_point,
                vector_entry_point=vector_entry_point,
            )
