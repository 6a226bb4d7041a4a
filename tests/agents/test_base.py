"""Predicting, seeds, environments and files: what every agent with a table shares."""

from __future__ import annotations

import copy
import subprocess
import sys
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor

from acl_gym import ACL, Crisp, Fuzzy, Partition, QLearning
from acl_gym.agents.base import TabularAgent
from acl_gym.policies import TablePolicy
from acl_gym.utils import archives
from tests.agents.reference_colony import Chain, chains

ROW = Crisp([np.arange(6.0)])
PENDULUM = "acl_gym/Pendulum-v0"
BOTH = pytest.mark.parametrize("kind", [ACL, QLearning])


def on_chain(kind: type[TabularAgent], seed: int = 0, **parameters: Any) -> Any:
    if kind is ACL:
        parameters = {"tau0": 1e-3, **parameters}
    return kind(chains(4, slip=0.2), ROW, max_steps=20, seed=seed, **parameters)


def on_pendulum(kind: type[TabularAgent], seed: int | None = 0) -> Any:
    env = gym.make_vec(PENDULUM, num_envs=10)
    grid = Fuzzy.from_box(env.single_observation_space, (6, 7), circular=[0])
    parameters = {"tau0": 1e-6} if kind is ACL else {}
    return kind(env, grid, max_steps=30, seed=seed, **parameters)


def assert_same(one: TabularAgent, other: TabularAgent) -> None:
    """The same knowledge to the last bit, and the same record but for the clock."""
    assert one.table.tobytes() == other.table.tobytes()
    assert (one.trials, one.num_timesteps) == (other.trials, other.num_timesteps)
    rows = [[{**r, "seconds": 0.0} for r in agent.history] for agent in (one, other)]
    assert rows[0] == rows[1]
    states = np.random.default_rng(0).uniform([0, -9], [6, 9], (50, 2))
    if one.partition.cells_per_state == 1:
        states = np.arange(6.0)[:, None]
    for deterministic in (True, False):
        actions = [
            agent.predict(states, None, None, deterministic)[0]
            for agent in (one, other)
        ]
        np.testing.assert_array_equal(*actions)


# --- seeds ---------------------------------------------------------------------


@BOTH
@pytest.mark.parametrize("make", [on_chain, on_pendulum])
def test_a_run_is_a_function_of_its_seed(kind: type, make: Any) -> None:
    one, other, another = (make(kind, seed).learn(trials=6) for seed in (7, 7, 8))
    assert_same(one, other)
    assert (one.table != another.table).any()


@BOTH
def test_without_a_seed_runs_differ(kind: type) -> None:
    one, other = (on_pendulum(kind, None).learn(trials=2) for _ in range(2))
    assert (one.table != other.table).any()


@BOTH
def test_a_seed_set_anew_begins_anew(kind: type) -> None:
    fresh, used = on_chain(kind, 3), on_chain(kind, 1)
    start = used.table.copy()
    used.learn(trials=2)
    used.predict([[0.0]], deterministic=False)
    used.set_table(start)
    used.set_random_seed(3)
    assert used.seed == 3
    np.testing.assert_array_equal(
        fresh.learn(trials=5).table, used.learn(trials=5).table
    )
    with pytest.raises(ValueError, match="seed must be at least 0, got -1"):
        used.set_random_seed(-1)
    with pytest.raises(TypeError, match="seed must be an integer"):
        used.set_random_seed(1.5)
    assert used.seed == 3


@BOTH
@pytest.mark.parametrize("make", [on_chain, on_pendulum])
def test_learning_in_parts_is_learning_at_once(kind: type, make: Any) -> None:
    whole, parts = make(kind).learn(trials=50), make(kind)
    assert parts.learn(trials=20).learn(trials=30) is parts
    assert_same(whole, parts)


@BOTH
def test_predictions_do_not_change_what_is_learned(kind: type) -> None:
    quiet, asked = on_pendulum(kind), on_pendulum(kind)
    states = gym.make_vec(PENDULUM, num_envs=9).reset(seed=0)[0]
    for _ in range(4):
        quiet.learn(trials=1)
        for deterministic in (True, False, True):
            asked.predict(states, deterministic=deterministic)
        asked.learn(trials=1)
    assert quiet.table.tobytes() == asked.table.tobytes()


# --- predict -------------------------------------------------------------------


@BOTH
@pytest.mark.parametrize("deterministic", [True, False])
def test_one_observation_or_many(kind: type, deterministic: bool) -> None:
    agent = on_pendulum(kind).learn(trials=2)
    memory = object()
    states = np.random.default_rng(0).uniform([0, -9], [6, 9], (25, 2))
    actions, passed = agent.predict(
        states, state=memory, episode_start=np.ones(25), deterministic=deterministic
    )
    assert passed is memory
    assert actions.shape == (25,)
    assert actions.dtype == np.int64
    action, passed = agent.predict(list(states[3]), deterministic=deterministic)
    assert passed is None
    assert np.ndim(action) == 0
    assert agent.env.single_action_space.contains(action)
    assert agent.predict(states[:0], deterministic=deterministic)[0].shape == (0,)
    if deterministic:
        assert action == actions[3]
        np.testing.assert_array_equal(actions, agent.predict(states.astype("f4"))[0])


@BOTH
def test_the_policy_is_a_function_also_where_actions_tie(kind: type) -> None:
    """Ties are broken at random over the cells, once for an agent and a seed."""
    one, again, other = (on_pendulum(kind, seed) for seed in (0, 0, 1))
    states = np.random.default_rng(0).uniform([0, -9], [6, 9], (300, 2))
    actions = one.predict(states)[0]
    assert set(actions) == {0, 1, 2}
    for agent in (one, again):
        np.testing.assert_array_equal(agent.predict(states)[0], actions)
        np.testing.assert_array_equal(
            [agent.predict(state)[0] for state in states], actions
        )
    assert (other.predict(states)[0] != actions).any()
    centres = one.partition.cell_states()
    np.testing.assert_array_equal(one.predict(centres)[0], one.policy.best_actions())


@BOTH
@pytest.mark.parametrize("deterministic", [True, False])
@pytest.mark.parametrize(
    "observation",
    [
        [np.nan, 0.0],
        [0.0, np.inf],
        [1.0],
        [1.0, 2.0, 3.0],
        [[1.0]],
        1.0,
        ["a", "b"],
        [],
    ],
)
def test_bad_observations(kind: type, deterministic: bool, observation: Any) -> None:
    with pytest.raises(ValueError, match="states must"):
        on_pendulum(kind).predict(observation, deterministic=deterministic)


@BOTH
@pytest.mark.parametrize("deterministic", [True, False])
def test_evaluate_policy_of_stable_baselines3(kind: type, deterministic: bool) -> None:
    """On the chain each move that succeeds costs 1: a good policy is near -3."""
    agent = on_chain(kind).learn(trials=60)
    env = Monitor(gym.wrappers.TimeLimit(Chain(), 30))
    env.reset(seed=0)
    mean, _ = evaluate_policy(
        agent, env, n_eval_episodes=20, deterministic=deterministic
    )
    assert -5.0 <= mean <= -1.0


def test_a_policy_of_a_bare_table_breaks_ties_by_a_fixed_order() -> None:
    grid = Crisp([np.arange(40.0)])
    one, other = (
        TablePolicy(grid, np.zeros((40, 3)), first_action=7) for _ in range(2)
    )
    actions = one.predict(np.arange(40.0)[:, None])[0]
    assert set(actions) == {7, 8, 9}
    np.testing.assert_array_equal(actions, other.predict(grid.cell_states())[0])


def test_a_soft_policy_calls_the_actions_as_its_agent_does() -> None:
    agent = ACL(chains(2, first_action=5), ROW, seed=0)
    memory = object()
    action, passed = agent.soft_policy().predict([2.0], memory)
    assert passed is memory
    assert np.ndim(action) == 0
    assert action in (5, 6)


# --- environments --------------------------------------------------------------


@BOTH
def test_another_environment_with_other_slots(kind: type) -> None:
    agent = on_chain(kind).learn(trials=3)
    agent.set_env(chains(11, mode="SameStep"))
    assert agent.num_envs == 11
    agent.learn(trials=30)
    assert agent.trials == 33
    assert agent.policy.best_actions()[:-1].tolist() == [1] * 5
    before = agent.env
    with pytest.raises(ValueError, match="2 actions as the table has, got 3"):
        agent.set_env(gym.make_vec(PENDULUM, num_envs=2))
    with pytest.raises(TypeError, match="VectorEnv"):
        agent.set_env(Chain())
    assert agent.env is before
    assert agent.num_envs == 11


@BOTH
def test_without_environment(kind: type) -> None:
    agent = kind(None, ROW, n_actions=2, seed=0)
    assert agent.predict([3.0])[0] in (0, 1)
    for use in (agent.learn, lambda: agent.num_envs):
        with pytest.raises(ValueError, match="set_env"):
            use()
    agent.set_env(chains(2))
    agent.learn(trials=1)


# --- files ---------------------------------------------------------------------


@BOTH
@pytest.mark.parametrize("make", [on_chain, on_pendulum])
def test_a_file_holds_all_of_the_agent(kind: type, make: Any, tmp_path: Path) -> None:
    agent = make(kind, seed=2**40).learn(trials=5)
    agent.predict(agent.partition.cell_states(), deterministic=False)
    path = agent.save(tmp_path / "agent")
    assert path == tmp_path / "agent.npz"
    assert [file.name for file in tmp_path.iterdir()] == ["agent.npz"]
    for name in ("agent", "agent.npz", str(path)):
        loaded = kind.load(tmp_path / name)
        assert loaded.parameters() == agent.parameters()
        assert repr(loaded.partition) == repr(agent.partition)
        assert loaded.partition.settings() == agent.partition.settings()
        assert loaded.history == agent.history
        assert loaded.seconds == agent.seconds
        assert_same(loaded, copy.deepcopy(agent))


@BOTH
def test_the_way_ties_are_broken_is_in_the_file(kind: type, tmp_path: Path) -> None:
    """Also without a seed, from which it could be had again."""
    agent = on_pendulum(kind, None)
    states = agent.partition.cell_states()
    loaded = kind.load(agent.save(tmp_path / "agent"))
    assert loaded.seed is None
    np.testing.assert_array_equal(loaded.predict(states)[0], agent.predict(states)[0])


@BOTH
@pytest.mark.parametrize("make", [on_chain, on_pendulum])
def test_a_loaded_agent_learns_on_as_if_nothing_had_happened(
    kind: type, make: Any, tmp_path: Path
) -> None:
    whole, first = make(kind).learn(trials=50), make(kind).learn(trials=20)
    first.save(tmp_path / "agent")
    second = kind.load(tmp_path / "agent", env=make(kind).env)
    assert_same(whole, second.learn(trials=30))


def test_files_from_another_process(tmp_path: Path) -> None:
    code = f"""
import gymnasium as gym
from acl_gym import ACL, Fuzzy, QLearning
for kind, parameters in ((ACL, {{"tau0": 1e-6}}), (QLearning, {{}})):
    env = gym.make_vec({PENDULUM!r}, num_envs=10)
    grid = Fuzzy.from_box(env.single_observation_space, (6, 7), circular=[0])
    agent = kind(env, grid, max_steps=30, seed=0, **parameters)
    agent.learn(trials=20).save(kind.__name__)
"""
    command = [sys.executable, "-W", "error", "-c", code]
    subprocess.run(command, cwd=tmp_path, check=True, timeout=120)
    for kind in (ACL, QLearning):
        whole = on_pendulum(kind).learn(trials=50)
        second = kind.load(tmp_path / kind.__name__, env=on_pendulum(kind).env)
        assert_same(whole, second.learn(trials=30))


@BOTH
def test_a_loaded_agent_calls_the_actions_as_before(kind: type, tmp_path: Path) -> None:
    agent = kind(chains(4, first_action=5), ROW, seed=0).learn(trials=3)
    agent.save(tmp_path / "agent")
    states = np.arange(6.0)[:, None]
    expected = agent.predict(states)[0]
    with_env = kind.load(tmp_path / "agent", env=agent.env)
    np.testing.assert_array_equal(with_env.predict(states)[0], expected)
    without = kind.load(tmp_path / "agent")
    np.testing.assert_array_equal(without.predict(states)[0], expected)


def test_notes_are_in_the_file(tmp_path: Path) -> None:
    agent = on_chain(ACL)
    assert ACL.load(agent.save(tmp_path / "agent")).metadata == {}
    agent.metadata = {"env": "Chain", "args": {"slip": np.float64(0.2), "list": [1]}}
    loaded = ACL.load(agent.save(tmp_path / "agent"))
    assert loaded.metadata == {"env": "Chain", "args": {"slip": 0.2, "list": [1]}}
    agent.metadata = {"env": object()}
    with pytest.raises(TypeError, match=r"metadata\['env'\] must be numbers, text"):
        agent.save(tmp_path / "agent")
    agent.metadata = ["env"]  # type: ignore[assignment]
    with pytest.raises(TypeError, match="metadata must be a dict"):
        agent.save(tmp_path / "agent")
    with pytest.raises(TypeError, match="metadata must be a dict"):
        agent.learn(trials=1)
    assert agent.trials == 0


def test_a_file_from_before_there_were_notes_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    agent = on_chain(ACL)
    save = archives.save

    def old(path: Path, header: dict[str, Any], arrays: Any) -> Path:
        del header["metadata"]
        return save(path, header, arrays)

    monkeypatch.setattr(archives, "save", old)
    assert ACL.load(agent.save(tmp_path / "agent")).metadata == {}


def test_the_wrong_class_is_refused(tmp_path: Path) -> None:
    on_chain(ACL).save(tmp_path / "agent")
    with pytest.raises(
        ValueError, match="must hold an agent of class QLearning, got 'ACL'; load it"
    ):
        QLearning.load(tmp_path / "agent")


@BOTH
def test_a_wrong_environment_is_not_blamed_on_the_file(
    kind: type, tmp_path: Path
) -> None:
    on_chain(kind).save(tmp_path / "agent")
    with pytest.raises(ValueError, match="2 actions as the table has, got 3"):
        kind.load(tmp_path / "agent", env=gym.make_vec(PENDULUM, num_envs=2))
    with pytest.raises(TypeError, match="VectorEnv"):
        kind.load(tmp_path / "agent", env=Chain())


def test_rows_with_numbers_of_numpy_can_be_saved(tmp_path: Path) -> None:
    """A callback may add measures to a row, and NumPy's are what it has at hand."""
    agent = on_chain(ACL)
    agent.learn(trials=1, callback=lambda _, row: row.update(ants=np.int64(4)))
    agent.save(tmp_path / "agent")
    assert ACL.load(tmp_path / "agent").history[0]["ants"] == 4


def test_a_partition_that_leaves_its_own_range_is_refused() -> None:
    class Wrong(Partition):
        n_cells = 3
        cells_per_state = 1

        def locate(self, states, slots, index, degree):
            index[: slots.size] = 1_000_000
            degree[: slots.size] = 1.0

        def settings(self):
            return {}

        def cell_states(self):
            return np.zeros((3, 1))

    for kind in (ACL, QLearning):
        with pytest.raises(ValueError, match=r"Wrong.locate must give cells in 0..2"):
            kind(chains(4), Wrong(), max_steps=9, seed=0).learn(trials=1)
