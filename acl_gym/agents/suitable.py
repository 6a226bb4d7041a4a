"""What suits an environment for which nobody has chosen settings."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv

from acl_gym.colony.deposits import Deposit, Rank
from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.evaluation.rollout import Rollout

PROBES = 20
"""Random episodes from which it is seen whether rewards are negative costs."""

BY_RANK = Rank(5)
"""Where they are not. It was the best in a search on CartPole, see docs/gymnasium.md."""


def suitable_deposit(
    env: VectorEnv[Any, Any, Any], max_steps: int, seed: int = 0
) -> Deposit | None:
    """A deposit for an environment whose rewards are not negative costs.

    Args:
        env: any vector environment with Discrete actions; it is reset and stepped,
            unless it is of this package. `PROBES` slots are enough.
        max_steps: the most steps of a random walk.
        seed: of the walks, >= 0.

    Returns:
        `BY_RANK`; None if 1 / cost will do, because all random walks cost something.
    """
    if isinstance(env.unwrapped, ControlVectorEnv):
        return None
    rollout, rng = Rollout(env, max_steps), np.random.default_rng(seed)
    rollout.start(seed=seed)
    while rollout.ants.size:
        allowed = rollout.allowed()
        chances = rng.random((rollout.ants.size, rollout.n_actions))
        if allowed is not None:
            chances[~allowed] = -1.0
        rollout.step(chances.argmax(axis=1))
    return None if (rollout.cost > 0.0).all() else BY_RANK
