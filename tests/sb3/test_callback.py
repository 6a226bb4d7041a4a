"""The callback that measures the policy cost while an agent of SB3 learns."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3 import DQN, PPO
from stable_baselines3.common.callbacks import ConvertCallback
from stable_baselines3.common.vec_env import VecMonitor

import acl_gym
from acl_gym.sb3.callback import PolicyCostCallback
from acl_gym.sb3.dqn import make_dqn, scaled_env
from tests.sb3.tiny import PENDULUM, TINY, parameters


def test_evaluation_does_not_change_learning() -> None:
    costs = PolicyCostCallback(scaled_env(PENDULUM), every=100, max_steps=10)
    evaluated = make_dqn(PENDULUM, TINY, 5).learn(400, callback=costs)
    plain = make_dqn(PENDULUM, TINY, 5).learn(400)
    np.testing.assert_array_equal(parameters(evaluated), parameters(plain))


def test_rows() -> None:
    env = scaled_env(PENDULUM)
    costs = PolicyCostCallback(env, every=150, max_steps=30)
    model = make_dqn(PENDULUM, TINY, seed=0).learn(400, callback=costs)
    assert [row["env_steps"] for row in costs.history] == [152, 300, 400]
    for row in costs.history:
        assert list(row) == ["env_steps", "seconds", "policy_cost", "success_rate"]
        assert 0 <= row["success_rate"] <= 1
    seconds = [row["seconds"] for row in costs.history]
    assert seconds == sorted(seconds)
    assert seconds[0] > 0
    # The last row is the policy as it is now, updates after the last step included.
    now = acl_gym.evaluate_policy_cost(model, env, max_steps=30)
    assert costs.history[-1]["policy_cost"] == now.cost


def test_training_may_go_on() -> None:
    costs = PolicyCostCallback(scaled_env(PENDULUM), every=100, max_steps=5)
    model = make_dqn(PENDULUM, TINY, seed=0).learn(200, callback=costs)
    model.learn(160, callback=costs, reset_num_timesteps=False)
    assert [row["env_steps"] for row in costs.history] == [100, 200, 300, 360]
    seconds = [row["seconds"] for row in costs.history]
    assert seconds == sorted(seconds)


def test_given_states() -> None:
    states = np.array([[np.pi + 0.03, -0.166], [0.0, 0.0]])
    env = scaled_env(PENDULUM, 2)
    costs = PolicyCostCallback(env, states, every=1_000, max_steps=1)
    make_dqn(PENDULUM, TINY, seed=0).learn(8, callback=costs)
    assert costs.best is not None
    assert costs.best.costs[1] == pytest.approx(np.pi**2, rel=0.1)


def test_the_best_parameters_are_kept() -> None:
    env = scaled_env(PENDULUM)
    costs = PolicyCostCallback(env, every=40, max_steps=60)
    model = make_dqn(PENDULUM, TINY, seed=1).learn(400, callback=costs)
    best = min(row["policy_cost"] for row in costs.history)
    assert costs.best is not None
    assert costs.best.cost == best
    assert costs.history[-1]["policy_cost"] > best  # or the test shows nothing
    costs.restore_best()
    assert acl_gym.evaluate_policy_cost(model, env, max_steps=60).cost == best


def test_nothing_to_restore() -> None:
    with pytest.raises(RuntimeError, match="learn"):
        PolicyCostCallback(scaled_env(PENDULUM)).restore_best()


def test_environment_with_other_observations_is_refused() -> None:
    costs = PolicyCostCallback(gym.make_vec(PENDULUM, num_envs=100))
    with pytest.raises(ValueError, match="scaled_env"):
        make_dqn(PENDULUM, TINY).learn(8, callback=costs)


@pytest.mark.parametrize("every", [0, -5])
def test_every_is_checked(every: int) -> None:
    with pytest.raises(ValueError, match="every"):
        PolicyCostCallback(scaled_env(PENDULUM), every=every)


def test_callback_works_with_other_agents() -> None:
    env = VecMonitor(acl_gym.VectorEnvAdapter(scaled_env(PENDULUM, 4)))
    costs = PolicyCostCallback(scaled_env(PENDULUM), every=64, max_steps=5)
    PPO("MlpPolicy", env, n_steps=16, batch_size=32, device="cpu").learn(
        128, callback=costs
    )
    assert [row["env_steps"] for row in costs.history] == [64, 128]


def test_time_in_evaluations_is_not_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every step of the slots takes a second here, and every evaluation a hundred."""
    clock = [0.0]
    monkeypatch.setattr("time.perf_counter", lambda: clock[0])
    evaluate = acl_gym.evaluate_policy_cost

    def slow(*arguments: Any, **keywords: Any) -> Any:
        clock[0] += 100.0
        return evaluate(*arguments, **keywords)

    def tick(*_: Any) -> bool:
        clock[0] += 1.0
        return True

    monkeypatch.setattr("acl_gym.sb3.callback.evaluate_policy_cost", slow)
    costs = PolicyCostCallback(scaled_env(PENDULUM), every=100, max_steps=5)
    make_dqn(PENDULUM, TINY, 0).learn(400, callback=[costs, ConvertCallback(tick)])
    assert len(costs.history) >= 4
    for row in costs.history:
        assert row["seconds"] == row["env_steps"] / TINY.num_envs


def test_evaluations_of_a_random_environment_use_the_same_random_numbers() -> None:
    def model_and_callback(seed: int | None) -> PolicyCostCallback:
        env = acl_gym.WaitingVectorEnv.make("CartPole-v1", 2)
        callback = PolicyCostCallback(
            acl_gym.WaitingVectorEnv.make("CartPole-v1", 50), every=20, seed=seed
        )
        # It never learns, so that only the starts can differ.
        model = DQN(
            "MlpPolicy", acl_gym.VectorEnvAdapter(env), learning_starts=1_000, seed=0
        )
        model.learn(120, callback=callback)
        return callback

    same = {row["policy_cost"] for row in model_and_callback(3).history}
    assert len(same) == 1
    # Six means of fifty episodes: chance alone hardly ever makes all of them equal.
    others = {row["policy_cost"] for row in model_and_callback(None).history}
    assert len(others) > 1
    with pytest.raises(ValueError, match="seed"):
        PolicyCostCallback(acl_gym.WaitingVectorEnv.make("CartPole-v1", 1), seed=-1)
