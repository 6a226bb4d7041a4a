"""PPO and A2C: made from settings, and a function of their seed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from stable_baselines3 import A2C, PPO

from acl_gym.sb3.actor_critic import A2CSettings, PPOSettings, make_a2c, make_ppo
from acl_gym.sb3.callback import PolicyCostCallback
from acl_gym.sb3.dqn import scaled_env
from acl_gym.sb3.models import MODELS

PENDULUM, ROW = "acl_gym/Pendulum-v0", "acl_gym/GridSearch1D-v0"
SMALL: dict[str, Any] = {"num_envs": 2, "n_steps": 8}


def test_settings_become_those_of_the_models() -> None:
    ppo = make_ppo(
        PENDULUM,
        PPOSettings(
            **SMALL,
            discount=0.9,
            trace_decay=0.7,
            learning_rate=1e-2,
            final_learning_rate=1e-3,
            entropy_weight=0.1,
            max_grad_norm=2.0,
            net_arch=(8,),
            batch_size=6,
            epochs=3,
            clip_range=0.3,
        ),
        seed=0,
    )
    assert isinstance(ppo, PPO)
    assert (ppo.n_envs, ppo.n_steps, ppo.n_epochs) == (2, 8, 3)
    assert ppo.batch_size == 4  # the largest that divides 16 and is not above 6
    assert (ppo.gamma, ppo.gae_lambda) == (0.9, 0.7)
    assert (ppo.ent_coef, ppo.max_grad_norm, ppo.clip_range(1.0)) == (0.1, 2.0, 0.3)
    rates = [ppo.lr_schedule(left) for left in (1.0, 0.0)]
    assert rates == pytest.approx([1e-2, 1e-3])
    assert ppo.policy.net_arch == [8]
    a2c = make_a2c(PENDULUM, A2CSettings(**SMALL), seed=0)
    assert isinstance(a2c, A2C)
    assert (a2c.n_steps, a2c.gae_lambda) == (8, 1.0)


@pytest.mark.parametrize("name", ["ppo", "a2c"])
@pytest.mark.parametrize("env_id", [PENDULUM, ROW])
def test_the_same_seed_gives_the_same_policies(name: str, env_id: str) -> None:
    kind, found = MODELS[name], []
    for seed in (0, 0, 1):
        model = kind.make(env_id, kind.settings(**SMALL), seed)
        costs = PolicyCostCallback(scaled_env(env_id), every=16, max_steps=20)
        model.learn(48, callback=costs)
        assert [row["env_steps"] for row in costs.history] == [16, 32, 48]
        weights = model.policy.parameters_to_vector()
        found.append(weights)
    assert np.array_equal(found[0], found[1])
    assert not np.array_equal(found[0], found[2])


def test_ppo_learns_the_shortest_ways_on_the_row() -> None:
    """The mean of the shortest ways is 5; a policy that never arrives costs 50."""
    settings = PPOSettings(n_steps=32, max_episode_steps=50, learning_rate=3e-3)
    model = make_ppo(ROW, settings, seed=0)
    costs = PolicyCostCallback(scaled_env(ROW), every=2_048, max_steps=50)
    model.learn(8_192, callback=costs)
    assert costs.best is not None
    assert costs.best.cost == 5.0


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"n_steps": 0}, "n_steps must be"),
        ({"discount": 1.5}, "discount must lie in"),
        ({"trace_decay": -0.1}, "trace_decay must lie in"),
        ({"entropy_weight": -1.0}, "entropy_weight must lie in"),
        ({"net_arch": (0,)}, "net_arch must be"),
        ({"clip_range": 0.0}, "clip_range must lie in"),
        ({"num_envs": 1, "n_steps": 1}, r"num_envs \* n_steps must be at least 2"),
    ],
)
def test_wrong_settings_are_refused(wrong: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        PPOSettings(**wrong)
