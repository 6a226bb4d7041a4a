"""DQN on our environments: what is wired to what, one seed one run, the callback."""

from collections.abc import Iterator
from dataclasses import FrozenInstanceError, fields, replace
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from stable_baselines3 import DQN
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import VecMonitor

import acl_gym
from acl_gym.sb3.actor_critic import A2CSettings, PPOSettings, make_a2c, make_ppo
from acl_gym.sb3.callback import PolicyCostCallback
from acl_gym.sb3.dqn import (
    DQNSettings,
    ScaledPolicy,
    ScaledReward,
    make_dqn,
    scaled_env,
)
from tests.sb3.tiny import FEATURES, PENDULUM, TINY, parameters


def mountain_cars(num_envs: int, autoreset_mode: str, **kwargs: Any) -> SyncVectorEnv:
    return SyncVectorEnv(
        [lambda: gym.make("MountainCar-v0", **kwargs)] * num_envs,
        autoreset_mode=AutoresetMode(autoreset_mode),
    )


@pytest.fixture
def foreign_id() -> Iterator[str]:
    """An environment of others whose vector form lets autoreset be disabled."""
    gym.register("MountainCars-v0", vector_entry_point=mountain_cars)
    yield "MountainCars-v0"
    del gym.registry["MountainCars-v0"]


# --- settings ------------------------------------------------------------------------


def test_every_setting_is_explained() -> None:
    for field in fields(DQNSettings):
        assert f"{field.name}: " in (DQNSettings.__doc__ or "")


def test_settings_do_not_change() -> None:
    with pytest.raises(FrozenInstanceError):
        TINY.discount = 0.5  # type: ignore[misc]
    assert hash(replace(TINY, net_arch=[8, 8])) == hash(replace(TINY, net_arch=(8, 8)))


@pytest.mark.parametrize("settings", [DQNSettings, A2CSettings, PPOSettings])
@pytest.mark.parametrize("layers", [8, "88", None])
def test_hidden_layers_must_be_a_sequence(settings: Any, layers: Any) -> None:
    with pytest.raises(
        TypeError, match=r"net_arch must be a sequence .*\(64, 64\), got"
    ):
        settings(net_arch=layers)


@pytest.mark.parametrize(
    ("make", "kind", "other"),
    [
        (make_dqn, DQNSettings, A2CSettings()),
        (make_a2c, A2CSettings, DQNSettings()),
        (make_ppo, PPOSettings, A2CSettings()),
        (make_ppo, PPOSettings, {}),
    ],
)
def test_settings_of_another_model_are_refused(
    make: Any, kind: Any, other: Any
) -> None:
    with pytest.raises(
        TypeError, match=f"settings must be {kind.__name__} or None, got"
    ):
        make("acl_gym/Pendulum-v0", other)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("num_envs", 0),
        ("updates_per_step", 0.0),
        ("updates_per_step", 0.3),
        ("updates_per_step", 0.1),
        ("discount", 1.1),
        ("discount", 0.0),
        ("reward_scale", -1.0),
        ("learning_rate", float("nan")),
        ("final_learning_rate", 0.0),
        ("batch_size", 0),
        ("buffer_size", 3),
        ("learning_starts", -1),
        ("target_update_interval", 0),
        ("target_update_rate", 2.0),
        ("n_steps", 0),
        ("exploration_fraction", 0.0),
        ("exploration_initial", 1.5),
        ("exploration_final", -0.1),
        ("max_grad_norm", 0.0),
        ("net_arch", (64, 0)),
        ("max_episode_steps", 0),
    ],
)
def test_settings_out_of_range_are_refused(name: str, value: Any) -> None:
    with pytest.raises(ValueError, match=name):
        replace(TINY, **{name: value})


def test_settings_of_the_wrong_type_are_refused() -> None:
    with pytest.raises(TypeError, match="batch_size"):
        DQNSettings(batch_size=64.0)  # type: ignore[arg-type]


# --- wiring --------------------------------------------------------------------------


def test_settings_arrive() -> None:
    settings = DQNSettings(
        num_envs=4,
        updates_per_step=0.5,
        discount=0.9,
        reward_scale=0.25,
        learning_rate=2e-3,
        final_learning_rate=1e-3,
        batch_size=17,
        buffer_size=4_000,
        learning_starts=33,
        target_update_interval=44,
        target_update_rate=0.7,
        exploration_fraction=0.3,
        exploration_initial=0.8,
        exploration_final=0.1,
        max_grad_norm=5.0,
        net_arch=(7, 9),
        max_episode_steps=11,
    )
    model = make_dqn(PENDULUM, settings, seed=1)
    assert type(model) is DQN
    assert model.n_envs == 4
    assert model.gradient_steps == settings.gradient_steps == 2
    assert model.gamma == 0.9
    assert model.lr_schedule(1.0) == 2e-3
    assert model.lr_schedule(0.0) == pytest.approx(1e-3)
    assert model.batch_size == 17
    assert model.replay_buffer.buffer_size == 1_000  # of each slot
    assert model.learning_starts == 33
    assert model.target_update_interval == 44
    assert model.tau == 0.7
    assert model.n_steps == 1
    assert model.exploration_schedule(1.0) == 0.8
    assert model.exploration_schedule(0.7) == pytest.approx(0.1)
    assert model.max_grad_norm == 5.0
    assert model.policy.net_arch == [7, 9]
    assert model.device.type == "cpu"
    assert model.seed == 1
    env = model.get_env()
    assert isinstance(env, ScaledReward)
    assert env.scale == 0.25
    assert isinstance(env.venv, VecMonitor)
    adapter = env.unwrapped
    assert isinstance(adapter, acl_gym.VectorEnvAdapter)
    assert adapter.env.metadata["autoreset_mode"] is AutoresetMode.DISABLED
    assert adapter.env.unwrapped.max_episode_steps == 11
    assert model.observation_space == FEATURES


def test_keywords_reach_the_environment() -> None:
    model = make_dqn(PENDULUM, TINY, torques=(-1.0, -0.5, 0.0, 0.5, 1.0), substeps=3)
    assert model.action_space == spaces.Discrete(5)
    assert model.get_env().get_attr("system")[0].substeps == 3


def test_which_variables_are_circular() -> None:
    assert make_dqn(PENDULUM, TINY, circular=()).observation_space.shape == (2,)
    assert make_dqn(PENDULUM, TINY, circular=[0, 1]).observation_space.shape == (4,)


def test_other_peoples_environments(foreign_id: str) -> None:
    model = make_dqn(foreign_id, replace(TINY, max_episode_steps=5), seed=0)
    assert model.observation_space == spaces.Box(-1, 1, (2,), np.float32)
    model.learn(80)
    assert model.num_timesteps == 80


def test_monitor_sees_true_rewards_and_the_agent_scaled_ones() -> None:
    model = make_dqn(PENDULUM, TINY, seed=0)
    model.learn(4 * 20)
    buffer = model.replay_buffer
    returns = buffer.rewards[:20].sum(axis=0) / TINY.reward_scale
    logged = [episode["r"] for episode in model.ep_info_buffer]
    np.testing.assert_allclose(sorted(logged), sorted(returns), rtol=1e-5)
    assert buffer.timeouts[19].all()
    assert not buffer.timeouts[:19].any()


def test_reward_scale_is_checked() -> None:
    venv = make_dqn(PENDULUM, TINY).get_env()
    with pytest.raises(ValueError, match="scale"):
        ScaledReward(venv, 0.0)


# --- scaled environments and policies --------------------------------------------------


def test_scaled_env(foreign_id: str) -> None:
    env = scaled_env(PENDULUM, omega_max=12.0)
    assert env.num_envs == 100
    assert env.single_observation_space == FEATURES
    assert env.unwrapped.system.omega_max == 12.0
    assert scaled_env(PENDULUM, 3, circular=[]).observation_space.shape == (3, 2)
    with pytest.raises(ValueError, match="num_envs"):
        scaled_env(PENDULUM, 0)
    with pytest.raises(ValueError, match="num_envs is needed"):
        scaled_env(foreign_id)


def test_both_ways_to_evaluate_agree() -> None:
    model = make_dqn(PENDULUM, TINY, seed=3)
    raw = gym.make_vec(PENDULUM, num_envs=2)
    policy = ScaledPolicy(
        model, raw.single_observation_space, raw.unwrapped.system.circular
    )
    one = acl_gym.evaluate_policy_cost(model, scaled_env(PENDULUM), max_steps=40)
    two = acl_gym.evaluate_policy_cost(policy, raw, max_steps=40)
    np.testing.assert_allclose(one.costs, two.costs)
    assert one.costs.shape == (100,)


def test_scaled_policy_predicts_one_or_many() -> None:
    model = make_dqn(PENDULUM, TINY, seed=3)
    space = gym.make(PENDULUM).observation_space
    policy = ScaledPolicy(model, space, [0])
    states = gym.make(PENDULUM).unwrapped.system.evaluation_states()
    actions, _ = policy.predict(states)
    assert actions.shape == (100,)
    assert set(actions.tolist()) <= {0, 1, 2}
    assert policy.predict(states[5])[0] == actions[5]


def test_evaluate_policy_of_stable_baselines() -> None:
    model = make_dqn(PENDULUM, TINY, seed=3)
    mean, _ = evaluate_policy(model, model.get_env(), n_eval_episodes=4)
    assert mean < 0


# --- learning --------------------------------------------------------------------------


def test_one_seed_one_run() -> None:
    def run(seed: int) -> np.ndarray:
        return parameters(make_dqn(PENDULUM, TINY, seed).learn(400))

    first = run(5)
    np.testing.assert_array_equal(first, run(5))
    assert not np.array_equal(first, run(6))


def test_saved_and_loaded_by_stable_baselines(tmp_path: Path) -> None:
    model = make_dqn(PENDULUM, TINY, seed=0)
    model.save(tmp_path / "dqn")
    again = DQN.load(tmp_path / "dqn", device="cpu")
    observation = FEATURES.sample()[None].repeat(5, axis=0)
    np.testing.assert_array_equal(
        model.predict(observation, deterministic=True)[0],
        again.predict(observation, deterministic=True)[0],
    )


class TestFiniteObservations:
    """On the grids a state is a number, which the network sees one-hot."""

    def test_observations_stay_as_they_are(self):
        env = scaled_env("acl_gym/GridSearch1D-v0", 3, n_states=6)
        assert env.single_observation_space == gym.spaces.Discrete(6)
        observation, _ = env.reset(seed=0)
        assert observation.shape == (3,)
        assert scaled_env("acl_gym/GridSearch1D-v0").num_envs == 9

    def test_the_network_has_an_input_for_each_state(self):
        model = make_dqn("acl_gym/GridSearch1D-v0", seed=0, n_states=6)
        first = next(iter(model.q_net.parameters()))
        assert first.shape == (64, 6)

    def test_nothing_is_circular_there(self):
        with pytest.raises(ValueError, match="circular must be empty"):
            scaled_env("acl_gym/GridSearch1D-v0", 2, circular=[0])

    def test_it_learns_to_walk_east(self):
        settings = DQNSettings(learning_starts=100, max_episode_steps=20)
        model = make_dqn("acl_gym/GridSearch1D-v0", settings, 0, n_states=4)
        evaluation = scaled_env("acl_gym/GridSearch1D-v0", n_states=4)
        costs = PolicyCostCallback(evaluation, every=200)
        model.learn(800, callback=costs)
        assert costs.best.cost == 2.0
        assert costs.best.success_rate == 1.0
