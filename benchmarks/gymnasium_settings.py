"""What gymnasium_envs.py runs: every environment, method and setting, as data.

The first candidate of each list is the one that the published table was made with;
docs/gymnasium.md says how it was chosen.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from acl_gym.colony.deposits import InverseCost, Rank
from acl_gym.colony.schedules import Linear

Candidate = dict[str, Any]
"""Settings of one method. For those with a table: `slots`, `trials` or `total` (steps of
all slots), `every` (trials between evaluations), and as needed `cells`, `bounds`, `kind`
("crisp", or "growing": the agent chooses); the rest goes to the agent. For networks:
`slots`, `steps`, `every` (steps), `net_arch`, and `scaled` where they see scaled
observations and rewards; the rest goes to the model."""


@dataclass(frozen=True)
class Environment:
    """One row of the table.

    Attributes:
        env_id: as registered with Gymnasium.
        target: mean return from which a policy counts as a success.
        why: what that figure is.
        kwargs: keywords of the environment.
        episodes: evaluated for the table; one where all episodes are the same.
        choosing: evaluated, on other seeds, to choose the best policy.
        limit: steps of an episode, where Gymnasium has no limit of its own.
        on_the_way: the target of the episodes that choose the best policy, which also say
            when it was reached; None: the same.
        candidates: method -> settings; the first is the chosen one.
    """

    env_id: str
    target: float
    why: str
    kwargs: dict[str, Any] = field(default_factory=dict)
    episodes: int = 100
    choosing: int = 50
    limit: int | None = None
    on_the_way: float | None = None
    candidates: dict[str, list[Candidate]] = field(default_factory=dict)


# Stable-Baselines3's zoo was where the search for DQN's settings began.
_CARTPOLE_DQN: Candidate = {
    "slots": 1,
    "steps": 50_000,
    "every": 2_500,
    "net_arch": (256, 256),
    "learning_rate": 2.3e-3,
    "batch_size": 64,
    "buffer_size": 100_000,
    "learning_starts": 1_000,
    "gamma": 0.99,
    "target_update_interval": 10,
    "train_freq": 256,
    "gradient_steps": 128,
    "exploration_fraction": 0.16,
    "exploration_final_eps": 0.04,
}
_MOUNTAIN_DQN: Candidate = {
    "slots": 1,
    "steps": 120_000,
    "every": 5_000,
    "net_arch": (256, 256),
    "learning_rate": 4e-3,
    "batch_size": 128,
    "buffer_size": 10_000,
    "learning_starts": 1_000,
    "gamma": 0.98,
    "target_update_interval": 600,
    "train_freq": 16,
    "gradient_steps": 8,
    "exploration_fraction": 0.2,
    "exploration_final_eps": 0.07,
}
_ACROBOT_DQN: Candidate = {
    "slots": 1,
    "steps": 80_000,
    "every": 5_000,
    "net_arch": (256, 256),
    "learning_rate": 6.3e-4,
    "batch_size": 128,
    "buffer_size": 50_000,
    "learning_starts": 1_000,
    "gamma": 0.99,
    "target_update_interval": 250,
    "train_freq": 4,
    "gradient_steps": 2,
    "exploration_fraction": 0.12,
    "exploration_final_eps": 0.1,
}
_TOY_DQN: Candidate = {
    "slots": 4,
    "steps": 40_000,
    "every": 2_000,
    "net_arch": (64,),
    "learning_rate": 1e-3,
    "batch_size": 64,
    "buffer_size": 50_000,
    "learning_starts": 1_000,
    "gamma": 0.99,
    "target_update_interval": 500,
    "train_freq": 1,
    "gradient_steps": 1,
    "exploration_fraction": 0.3,
    "exploration_final_eps": 0.05,
}

# Also from the zoo, whose normalised observations are scaled ones here.
_CARTPOLE_PPO: Candidate = {
    "slots": 8,
    "steps": 100_000,
    "every": 4_000,
    "net_arch": (64, 64),
    "n_steps": 32,
    "batch_size": 256,
    "gae_lambda": 0.8,
    "gamma": 0.98,
    "n_epochs": 20,
    "ent_coef": 0.0,
    "learning_rate": 1e-3,
    "clip_range": 0.2,
}
_MOUNTAIN_PPO: Candidate = {
    "slots": 16,
    "steps": 300_000,
    "every": 12_000,
    "net_arch": (64, 64),
    "n_steps": 16,
    "batch_size": 64,
    "gae_lambda": 0.98,
    "gamma": 0.99,
    "n_epochs": 4,
    "ent_coef": 0.0,
    "scaled": True,
}
_ACROBOT_PPO: Candidate = {
    **_MOUNTAIN_PPO,
    "n_steps": 256,
    "gae_lambda": 0.94,
}
_TOY_PPO: Candidate = {
    "slots": 8,
    "steps": 100_000,
    "every": 5_000,
    "net_arch": (64, 64),
    "n_steps": 128,
    "batch_size": 256,
    "learning_rate": 1e-3,
    "ent_coef": 0.01,
}
_A2C: Candidate = {
    "slots": 8,
    "steps": 200_000,
    "every": 10_000,
    "net_arch": (64, 64),
    "ent_coef": 0.0,
}
_TOY_A2C: Candidate = {**_A2C, "ent_coef": 0.01}

_POLE = {0: (-2.4, 2.4), 1: (-3.0, 3.0), 2: (-0.21, 0.21), 3: (-3.5, 3.5)}
_CAR = {1: (-0.05, 0.05)}
# Only the few best ants of a trial count, and the colony commits itself slowly.
_ELITE: Candidate = {"deposit": Rank(20), "alpha": 1.5, "global_decay": 0.2}


def _remembering(total: int, every: int = 1) -> dict[str, list[Candidate]]:
    """The methods that remember, everywhere alike but for the length of a run.

    The returning colony has its defaults. Q-learning has the discount, replays and optimism
    of these, and the epsilon, rate and lambda of ablation.py.
    """
    common = {"slots": 5, "total": total, "every": every, "kind": "growing"}
    q = {"learning_rate": 0.3, "discount": 0.99, "epsilon": 0.1, "trace_decay": 0.6}
    replay = {"replay": 30, "optimism": 1.0, "grows": True}
    return {"returning": [common], "q-replay": [{**common, **q, **replay}]}


ENVIRONMENTS: dict[str, Environment] = {
    "CartPole-v1": Environment(
        "CartPole-v1",
        475,
        "Gymnasium's threshold",
        candidates={
            **_remembering(30_000, 2),
            "ppo": [_CARTPOLE_PPO],
            "a2c": [{**_A2C, "steps": 100_000}],
            "acl": [
                {
                    "slots": 200,
                    "trials": 60,
                    "every": 3,
                    "cells": (3, 3, 7, 7),
                    "bounds": _POLE,
                    "deposit": Rank(5),
                },
            ],
            "q-learning": [
                {
                    "slots": 10,
                    "trials": 150,
                    "every": 10,
                    "cells": (3, 3, 7, 7),
                    "bounds": _POLE,
                    "learning_rate": 0.1,
                    "discount": 0.99,
                    "epsilon": 0.05,
                    "trace_decay": 0.9,
                },
            ],
            "dqn": [
                _CARTPOLE_DQN,
            ],
        },
    ),
    "MountainCar-v0": Environment(
        "MountainCar-v0",
        -110,
        "Gymnasium's threshold",
        candidates={
            **_remembering(100_000, 2),
            "ppo": [_MOUNTAIN_PPO],
            "a2c": [{**_A2C, "slots": 16, "scaled": True}],
            "acl": [
                {
                    "slots": 100,
                    "trials": 60,
                    "every": 5,
                    "cells": (41, 41),
                    "bounds": _CAR,
                    **_ELITE,
                    "epsilon": 0.05,
                    "local_decay": 0.0,
                    "cost": "highest_point",
                },
            ],
            "q-learning": [
                {
                    "slots": 10,
                    "trials": 150,
                    "every": 10,
                    "cells": (21, 21),
                    "discount": 0.99,
                    "epsilon": 0.02,
                },
            ],
            "dqn": [
                _MOUNTAIN_DQN,
            ],
        },
    ),
    "Acrobot-v1": Environment(
        "Acrobot-v1",
        -100,
        "Gymnasium's threshold",
        candidates={
            **_remembering(100_000, 2),
            "ppo": [_ACROBOT_PPO],
            "a2c": [{**_A2C, "slots": 16, "scaled": True}],
            "acl": [
                {
                    "slots": 50,
                    "trials": 30,
                    "every": 5,
                    "angles": True,
                    "cells": (7, 7, 7, 7),
                    **_ELITE,
                    "epsilon": 0.05,
                    "local_decay": 0.0,
                },
            ],
            "q-learning": [
                {
                    "slots": 10,
                    "trials": 150,
                    "every": 5,
                    "angles": True,
                    "cells": (7, 7, 7, 7),
                    "discount": 0.99,
                    "epsilon": 0.02,
                    "trace_decay": 0.7,
                },
                {
                    "slots": 10,
                    "trials": 60,
                    "every": 5,
                    "angles": True,
                    "cells": (7, 7, 7, 7),
                    "discount": 0.99,
                    "epsilon": 0.02,
                },
                {
                    "slots": 10,
                    "trials": 60,
                    "every": 5,
                    "angles": True,
                    "cells": (7, 7, 7, 7),
                    "discount": 0.99,
                    "epsilon": 0.02,
                    "trace_decay": 0.9,
                },
                {
                    "slots": 10,
                    "trials": 60,
                    "every": 5,
                    "angles": True,
                    "cells": (7, 7, 7, 7),
                    "discount": 0.99,
                    "epsilon": 0.02,
                    "trace_decay": 0.9,
                    "learning_rate": 0.1,
                },
            ],
            "dqn": [
                _ACROBOT_DQN,
            ],
        },
    ),
    "FrozenLake-v1": Environment(
        "FrozenLake-v1",
        1.0,
        "the optimum",
        kwargs={"is_slippery": False},
        episodes=1,
        choosing=1,
        candidates={
            **_remembering(10_000, 2),
            "ppo": [_TOY_PPO],
            "a2c": [_TOY_A2C],
            "acl": [{"slots": 50, "trials": 30, "every": 2, "deposit": "return"}],
            "q-learning": [
                {"slots": 10, "trials": 60, "every": 2, "discount": 0.95},
                {"slots": 50, "trials": 30, "every": 2, "discount": 0.95},
            ],
            "dqn": [
                {**_TOY_DQN, "steps": 20_000, "every": 1_000},
                {**_TOY_DQN, "steps": 20_000, "every": 1_000, "learning_rate": 3e-3},
                {**_TOY_DQN, "steps": 20_000, "every": 1_000, "gamma": 0.95},
                {
                    **_TOY_DQN,
                    "steps": 20_000,
                    "every": 1_000,
                    "exploration_fraction": 0.8,
                },
            ],
        },
    ),
    "FrozenLake-v1-slippery": Environment(
        "FrozenLake-v1",
        0.72,
        "the optimum within 100 steps is 0.744; 500 episodes estimate it to 0.02",
        episodes=500,
        choosing=100,
        candidates={
            **_remembering(40_000, 10),
            "ppo": [_TOY_PPO],
            "a2c": [_TOY_A2C],
            "acl": [
                {
                    "slots": 500,
                    "trials": 40,
                    "every": 4,
                    "deposit": "return",
                    "selection": "boltzmann",
                    "alpha": Linear(0.3, 1, 40),
                    "global_decay": 0.05,
                    "local_decay": 0.0,
                },
            ],
            "q-learning": [
                {
                    "slots": 10,
                    "trials": 400,
                    "every": 20,
                    "learning_rate": 0.1,
                    "discount": 0.99,
                    "epsilon": 0.3,
                },
            ],
            "dqn": [
                _TOY_DQN,
                {**_TOY_DQN, "learning_rate": 3e-4},
            ],
        },
    ),
    "CliffWalking-v1": Environment(
        "CliffWalking-v1",
        -13,
        "the optimum",
        limit=200,
        episodes=1,
        choosing=1,
        candidates={
            **_remembering(20_000, 1),
            "ppo": [_TOY_PPO],
            "a2c": [_TOY_A2C],
            "acl": [
                {
                    "slots": 100,
                    "trials": 40,
                    "every": 4,
                    "deposit": Rank(30),
                    "alpha": 1.0,
                    "epsilon": 0.05,
                    "global_decay": 0.3,
                },
                {"slots": 50, "trials": 30, "every": 2},
            ],
            "q-learning": [{"slots": 10, "trials": 40, "every": 2}],
            "dqn": [
                {**_TOY_DQN, "exploration_fraction": 0.8},
                _TOY_DQN,
                {**_TOY_DQN, "learning_rate": 3e-4},
                {**_TOY_DQN, "net_arch": (128, 128)},
            ],
        },
    ),
    "Taxi-v4": Environment(
        "Taxi-v4",
        8.0,
        "the optimum is 8.05 from the starts of the table, 7.93 over all",
        choosing=100,
        on_the_way=7.5,  # the optimum from these is 7.58
        candidates={
            **_remembering(40_000, 3),
            "ppo": [_TOY_PPO],
            "a2c": [_TOY_A2C],
            "acl": [
                {
                    "slots": 200,
                    "trials": 30,
                    "every": 3,
                    "deposit": InverseCost(21),
                    "alpha": 1.0,
                    "epsilon": 0.05,
                    "global_decay": 0.3,
                    "local_decay": 0.0,
                },
            ],
            "q-learning": [{"slots": 10, "trials": 150, "every": 15}],
            "dqn": [
                {
                    **_TOY_DQN,
                    "steps": 60_000,
                    "net_arch": (128, 128),
                    "exploration_fraction": 0.6,
                },
            ],
        },
    ),
}
