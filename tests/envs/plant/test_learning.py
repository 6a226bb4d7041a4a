"""Everything that works on the systems of the package works on a plant."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acl_gym import (
    ACL,
    Crisp,
    Fuzzy,
    QLearning,
    VectorEnvAdapter,
    automatic_partition,
    evaluate_policy_cost,
    fuzzy_q_iteration,
    plant,
)
from acl_gym.envs.wrappers.perturbations import HiddenVariables
from tests.envs.plant import plants
from tests.envs.plant.plants import make_mass

GRID = Fuzzy([np.linspace(-1, 1, 21)] * 2)


@pytest.mark.parametrize("dynamics", [plants.mass, plants.compiled_mass])
def test_a_colony_learns_and_its_file_is_loaded(
    dynamics: object, tmp_path: Path
) -> None:
    env = make_mass(dynamics=dynamics, num_envs=100)
    colony = ACL(env, GRID, tau0=1e-3, seed=0).learn(trials=30)
    result = evaluate_policy_cost(colony, env)
    # The time-optimal mean from uniform states is 1.5 s; hovering would cost 6 s.
    assert result.cost < 2.5
    assert result.success.all()
    colony.save(tmp_path / "mass")
    loaded = ACL.load(tmp_path / "mass", env)
    assert evaluate_policy_cost(loaded, env).cost == result.cost
    text = loaded.policy.to_c(tmp_path / "mass.h").read_text()
    assert "2  u[0] = 1.0" in text


def rod(x: Any, u: Any) -> Any:
    return [x[1], 9.81 * np.sin(x[0]) - 0.5 * x[1] + u[0]]


def test_the_example_of_the_documentation(tmp_path: Path) -> None:
    """An inverted pendulum, in a few seconds; 55.5 to 58.7 for five seeds.

    Fuzzy Q-iteration, which knows the model, comes to 52.1 on the same cells.
    """
    env = plant(
        rod,
        low=[-np.pi, -8],
        high=[np.pi, 8],
        circular=[0],
        inputs=[-6, 0, 6],
        sampling_time=0.1,
        goal=[0, 0],
        tolerance=[0.1, 0.3],
        cost=([1, 0.1], 0.01),
        max_episode_steps=100,
        num_envs=200,
    )
    colony = ACL(env, tau0=1e-4, seed=0).learn(trials=50)
    result = evaluate_policy_cost(colony, env)
    assert 50 < result.cost < 62
    assert result.success is not None
    assert result.success.all()
    assert colony.policy.to_c(tmp_path / "rod.h").is_file()


def test_success_is_told() -> None:
    many = make_mass(num_envs=2, max_episode_steps=2)
    many.reset(options={"state": [[0.1, 0.0], [0.9, 0.0]]})
    infos = [many.step([1, 1])[4] for _ in range(2)]
    assert infos[0]["is_success"][0]
    assert not infos[1]["is_success"][1]
    single = make_mass()
    single.reset(options={"state": [0.1, 0.0]})
    assert single.step(1)[4]["is_success"]


def test_q_learning_is_near_q_iteration() -> None:
    env = make_mass(num_envs=50)
    iterated = evaluate_policy_cost(fuzzy_q_iteration(env, GRID).policy, env).cost
    agent = QLearning(env, GRID, seed=0).learn(total_timesteps=100_000)
    learned = evaluate_policy_cost(agent, env).cost
    assert learned < 1.2 * iterated


def test_partitions_and_wrappers() -> None:
    env = make_mass(num_envs=10, circular=[0])
    partition = automatic_partition(env, kind=Crisp)
    assert partition.periods == (2.0, None)
    hidden = HiddenVariables(make_mass(num_envs=10), [0])
    colony = ACL(hidden, automatic_partition(hidden), tau0=1e-3, seed=0)
    colony.learn(trials=2)


def test_stable_baselines_sees_it() -> None:
    env = VectorEnvAdapter(make_mass(num_envs=4, autoreset_mode="Disabled"))
    observed = env.reset()
    assert observed.shape == (4, 2)
    rewards = env.step(np.array([0, 1, 2, 0]))[1]
    assert rewards == pytest.approx([-0.1] * 4)


def test_the_same_seed_gives_the_same_bits() -> None:
    tables = [
        ACL(make_mass(num_envs=20), GRID, tau0=1e-3, seed=5).learn(trials=5).table
        for _ in range(2)
    ]
    assert (tables[0] == tables[1]).all()
