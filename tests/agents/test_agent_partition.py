"""Agents over partitions of every kind: their choice, their fit, one state or many."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.vector import SyncVectorEnv

from acl_gym import ACL, Crisp, Discrete, Fuzzy, Partition, QLearning
from acl_gym.partitions.automatic import thesis_partition
from tests.agents.reference_colony import Chain

PENDULUM = "acl_gym/Pendulum-v0"
BOTH = pytest.mark.parametrize("kind", [ACL, QLearning])


class Relabelled(gym.Env):
    """The chain, its cells observed as elements of another space."""

    def __init__(self, space: Any, labels: Any) -> None:
        self.chain = Chain(slip=0.2)
        self.observation_space, self.labels = space, labels
        self.action_space = self.chain.action_space

    def reset(self, *, seed: Any = None, options: Any = None) -> Any:
        observation, info = self.chain.reset(seed=seed, options=options)
        return self.labels[int(observation[0])], info

    def step(self, action: Any) -> Any:
        observation, *rest = self.chain.step(action)
        return self.labels[int(observation[0])], *rest


PAIRS = np.array([[0, 1], [0, 2], [0, 3], [1, 1], [1, 2], [1, 3]])
CHAINS: dict[str, tuple[Any, Any, Partition]] = {
    "crisp": (
        spaces.Box(0.0, 5.0, (1,), np.float64),
        np.arange(6.0)[:, None],
        Crisp([np.arange(6.0)]),
    ),
    "discrete": (spaces.Discrete(6), range(6), Discrete(6)),
    "from -3": (spaces.Discrete(6, start=-3), range(-3, 3), Discrete(6, -3)),
    "pairs": (
        spaces.MultiDiscrete([2, 3], start=[0, 1]),
        PAIRS,
        Discrete([2, 3], [0, 1]),
    ),
}


def chains(name: str, slots: int = 4) -> SyncVectorEnv:
    space, labels, _ = CHAINS[name]
    return SyncVectorEnv([lambda: Relabelled(space, labels)] * slots)


def learned(kind: Any, name: str) -> Any:
    parameters = {"tau0": 1e-3} if kind is ACL else {}
    partition = CHAINS[name][2]
    agent = kind(chains(name), partition, max_steps=20, seed=0, **parameters)
    return agent.learn(trials=30)


@BOTH
@pytest.mark.parametrize("name", ["discrete", "from -3", "pairs"])
def test_discrete_cells_are_crisp_cells(kind: Any, name: str) -> None:
    """The same states under other names: the same table, to the last bit."""
    agent, crisp = learned(kind, name), learned(kind, "crisp")
    assert agent.table.tobytes() == crisp.table.tobytes()
    assert agent.policy.best_actions()[:5].tolist() == [1] * 5


@BOTH
@pytest.mark.parametrize("name", CHAINS)
@pytest.mark.parametrize("deterministic", [True, False])
def test_one_state_or_many(kind: Any, name: str, deterministic: bool) -> None:
    agent, labels = learned(kind, name), CHAINS[name][1]
    batch = np.array(list(labels))
    actions = agent.predict(batch, deterministic=deterministic)[0]
    assert actions.shape == (6,)
    for state in (labels[2], np.asarray(labels[2])):
        action = agent.predict(state, deterministic=deterministic)[0]
        assert np.ndim(action) == 0
        assert action in (0, 1)
    if deterministic:
        assert [agent.predict(state)[0] for state in labels] == actions.tolist()
        floats = agent.predict(batch.astype(np.float32))[0]
        np.testing.assert_array_equal(floats, actions)
    with pytest.raises(ValueError, match=r"^states must"):
        agent.predict(batch[0] + 100 if name != "crisp" else [np.nan])
    if name != "crisp":
        with pytest.raises(ValueError, match=r"whole numbers in .* got [01]\.5"):
            agent.predict(batch[:1] * 0 + 0.5 + (name == "pairs"))


@BOTH
@pytest.mark.parametrize("name", ["discrete", "from -3", "pairs"])
def test_files_hold_discrete_partitions(kind: Any, name: str, tmp_path: Path) -> None:
    agent = learned(kind, name)
    loaded = kind.load(agent.save(tmp_path / "agent"), env=chains(name, 2))
    assert loaded.partition.settings() == agent.partition.settings()
    assert loaded.table.tobytes() == agent.table.tobytes()
    loaded.learn(trials=1)


@BOTH
def test_without_a_partition_the_agent_chooses(kind: Any) -> None:
    for name in ("discrete", "from -3", "pairs"):
        chosen, given = kind(chains(name), seed=0), CHAINS[name][2]
        assert chosen.partition.settings() == given.settings()
    env = gym.make_vec(PENDULUM, 5)
    parameters: Any = {"tau0": 1e-6} if kind is ACL else {}
    parameters |= {"max_steps": 5, "seed": 0}
    chosen = kind(env, **parameters).learn(trials=2)
    given = kind(env, thesis_partition(env), **parameters).learn(trials=2)
    assert chosen.partition.settings() == given.partition.settings()
    assert chosen.table.shape == (40 * 41, 3)
    np.testing.assert_array_equal(chosen.table, given.table)


@BOTH
def test_the_agent_tells_why_it_cannot_choose(kind: Any) -> None:
    with pytest.raises(ValueError, match="needs a partition, or env"):
        kind(None, n_actions=2)
    with pytest.raises(TypeError, match=r"gymnasium.vector.VectorEnv, got"):
        kind(gym.make(PENDULUM))
    with pytest.raises(ValueError, match=r"random_steps=10_000"):
        kind(gym.make_vec("CartPole-v1", 2))
    with pytest.raises(TypeError, match="partition must be a Partition"):
        kind(gym.make_vec(PENDULUM, 2), [[0.0, 1.0]])


@BOTH
@pytest.mark.parametrize(
    ("name", "partition"),
    [
        ("crisp", Discrete(6)),
        ("crisp", Fuzzy([[0.0, 5.0]] * 2)),
        ("discrete", Crisp([np.arange(6.0)])),
        ("discrete", Discrete(7)),
        ("from -3", Discrete(6)),
        ("pairs", Discrete([3, 2], [0, 1])),
        ("pairs", Discrete(6)),
    ],
)
def test_a_partition_of_other_observations_is_refused(
    kind: Any, name: str, partition: Partition
) -> None:
    env = chains(name)
    with pytest.raises(ValueError, match=r"takes observations from .* got .*build"):
        kind(env, partition)
    agent = kind(None, partition, n_actions=2)
    with pytest.raises(ValueError, match="takes observations from"):
        agent.set_env(env)
    assert agent.env is None


@BOTH
def test_a_partition_of_ones_own_is_asked_in_its_own_way(kind: Any) -> None:
    class Halves(Partition):
        n_cells, cells_per_state = 2, 1

        def locate(self, states, slots, index, degree):
            index[: slots.size, 0] = states[slots, 0] > 2.5
            degree[: slots.size] = 1.0

        def settings(self):
            return {}

        def cell_states(self):
            return np.array([[1.0], [4.0]])

    kind(chains("crisp"), Halves(), max_steps=9, seed=0).learn(trials=1)
    Halves.check_space = lambda self, space: Crisp([[0.0]] * 2).check_space(space)
    with pytest.raises(ValueError, match=r"Box of shape \(2,\)"):
        kind(chains("crisp"), Halves())
