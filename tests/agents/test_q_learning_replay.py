"""Q-learning that remembers and whose partition grows: by hand, resumed, masked."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from acl_gym import (
    Crisp,
    Discrete,
    Fuzzy,
    PolicyEvaluation,
    QLearning,
    WaitingVectorEnv,
)
from tests.agents.reference_colony import chains
from tests.agents.remembering import (
    J_STAR,
    assert_same,
    crisp,
    gymnasium_env,
    pendulum,
)
from tests.agents.test_q_learning import ROW, VALUES
from tests.agents.test_returning import Corridor
from tests.planning.chains import corridor, vector

SETTINGS: dict[str, tuple[Callable[[], Any], dict[str, Any]]] = {
    "pendulum": (pendulum, {"replay": 3, "grows": True, "visits_to_grow": 1.0}),
    "traces": (
        pendulum,
        {"replay": 2, "grows": True, "visits_to_grow": 1.0, "trace_decay": 0.7},
    ),
    "growth alone": (pendulum, {"grows": True, "trace_decay": 0.5}),
    "crisp": (pendulum, {"partition": crisp(), "replay": 3, "grows": True}),
    "taxi": (lambda: gymnasium_env("Taxi-v4"), {"replay": 3, "optimism": 1.0}),
    "lake": (lambda: gymnasium_env("FrozenLake-v1"), {"replay": 3, "optimism": 0.5}),
    "small memory": (pendulum, {"replay": 2, "memory_size": 700, "older_steps": 3}),
}
EACH = pytest.mark.parametrize("name", SETTINGS)


def make(name: str, seed: int = 3, **more: Any) -> QLearning:
    env, keywords = SETTINGS[name]
    return QLearning(env(), seed=seed, **(keywords | more))


@EACH
def test_the_same_seed_gives_the_same_bits(name: str) -> None:
    assert_same(make(name).learn(trials=4), make(name).learn(trials=4))


@EACH
def test_two_parts_are_one_run_also_through_a_file(name: str, tmp_path: Path) -> None:
    whole = make(name).learn(trials=5)
    make(name).learn(trials=2).save(tmp_path / "part")
    part = QLearning.load(tmp_path / "part", SETTINGS[name][0]())
    assert part.parameters() == whole.parameters()
    assert_same(part.learn(trials=3), whole)


@EACH
def test_a_trial_can_be_taken_back(name: str) -> None:
    agent = make(name).learn(trials=2)
    kept = agent.snapshot()
    agent.learn(trials=2)
    for _ in range(2):  # twice from the same snapshot
        agent.take_back(kept)
        assert_same(agent.learn(trials=3), make(name).learn(trials=5))


def test_all_can_be_taken_back_before_anything_was_remembered() -> None:
    agent = make("pendulum")
    kept = agent.snapshot()
    agent.learn(trials=2)
    agent.take_back(kept)
    assert_same(agent.learn(trials=3), make("pendulum").learn(trials=3))


@pytest.mark.parametrize(("trace_decay", "first"), [(0.0, -1.0875), (1.0, -1.425)])
def test_an_episode_by_hand(trace_decay: float, first: float) -> None:
    """Two steps from cell 0 of three, to the goal; alpha 0.5, gamma 0.9.

    Learning as it walks, without traces: Q(0) = 0.5 * -1 = -0.5, Q(1) = -0.5.
    Replayed from the end: Q(1) = -0.5 + 0.5 * (-1 + 0.5) = -0.75. With lambda = 0 the
    first step then promises -1 + 0.9 * -0.75 = -1.675, so that
    Q(0) = -0.5 + 0.5 * (-1.675 + 0.5) = -1.0875.
    With lambda = 1 the trace of the first step is 0.9 in the second, so that walking
    gives Q(0) = -0.5 - 0.5 * 0.9 = -0.95, Q(1) = -0.5. Replayed:
    Q(1) = -0.75; the only action is greedy, so that the return of the first step is
    -1 + 0.9 * -1 = -1.9, and Q(0) = -0.95 + 0.5 * (-1.9 + 0.95) = -1.425.
    """
    agent = QLearning(
        vector(corridor(3), 1, start=0),
        Crisp([np.arange(3.0)]),
        learning_rate=0.5,
        discount=0.9,
        epsilon=0.0,
        trace_decay=trace_decay,
        replay=1,
        seed=0,
    ).learn(trials=1)
    np.testing.assert_allclose(agent.table[:, 0], [first, -0.75, 0.0], rtol=1e-14)
    assert agent.remembered_steps == 2


@pytest.mark.parametrize("trace_decay", [0.0, 0.7])
def test_memory_finds_the_values_of_the_chain_in_fewer_trials(
    trace_decay: float,
) -> None:
    """Six trials of two slots are too few without it."""
    errors = []
    for replay in (0, 5):
        agent = QLearning(
            chains(2),
            ROW,
            learning_rate=1.0,
            discount=1.0,
            epsilon=0.5,
            trace_decay=trace_decay,
            replay=replay,
            seed=0,
        ).learn(trials=6)
        errors.append(np.abs(agent.table - VALUES).max())
    assert errors[1] == 0.0 < errors[0]


@pytest.mark.parametrize("steps", [1, 7, 10**9])
def test_paths_may_be_cut_anywhere(steps: int) -> None:
    """A path that goes on in the next part promises what its last state promises."""
    agent = QLearning(
        chains(4),
        ROW,
        learning_rate=1.0,
        discount=1.0,
        epsilon=0.5,
        replay=3,
        steps_per_replay=steps,
        seed=0,
    ).learn(trials=30)
    np.testing.assert_array_equal(agent.table, VALUES)


def test_the_pendulum_is_near_the_optimum_after_ten_thousand_steps() -> None:
    """Ten seeds took 1,300 to 5,700 steps; without memory it takes 30,000 and more."""
    agent = QLearning(
        pendulum(),
        replay=10,
        grows=True,
        learning_rate=0.1,
        discount=0.99,
        trace_decay=0.6,
        seed=0,
    )
    evaluation = PolicyEvaluation(pendulum(100))
    agent.learn(total_timesteps=10_000, callback=evaluation)
    assert min(row["policy_cost"] for row in agent.history) < 1.25 * J_STAR


def test_what_is_masked_is_neither_done_nor_promised() -> None:
    agent = QLearning(
        WaitingVectorEnv([Corridor] * 3),
        learning_rate=0.9,
        discount=1.0,
        replay=5,
        max_steps=60,
        seed=0,
    )
    # So good that it would be taken, and count in V, wherever masks did not hold.
    table = np.zeros((11, 3))
    table[:, 2] = 1_000.0
    agent.set_table(table)
    agent.learn(trials=30)
    assert (agent.table[:, 2] == 1_000.0).all()
    way = agent.table[:10, :2]
    assert (way.argmax(axis=1) == 1).all()
    assert np.allclose(way[:, 1], -np.arange(10.0, 0.0, -1.0), atol=0.5)


@pytest.mark.parametrize("mode", list(AutoresetMode))
@pytest.mark.parametrize("fresh", [True, False], ids=["fresh", "used again"])
def test_every_environment_teaches_the_same(mode: AutoresetMode, fresh: bool) -> None:
    """Whatever it does with slots that have finished and with its arrays."""
    made = [lambda: gym.make("MountainCar-v0", max_episode_steps=40)] * 3
    keywords: dict[str, Any] = {"replay": 2, "grows": True, "seed": 0}
    env = SyncVectorEnv(made, copy=fresh, autoreset_mode=mode)
    agent = QLearning(env, epsilon=0.0, **keywords).learn(trials=1)
    waiting = QLearning(WaitingVectorEnv(made), epsilon=0.0, **keywords)
    assert agent.table.tobytes() == waiting.learn(trials=1).table.tobytes()


def test_untried_pairs_promise_what_could_be_had() -> None:
    """20 is the best reward of the taxi, at an end."""
    agent = make("taxi").learn(trials=60)
    assert (agent.table[~agent._known] == 20.0).any()
    agent = make("taxi", optimism=None).learn(trials=60)
    assert (agent.table[~agent._known] == 0.0).all()


def test_the_partition_grows_with_what_is_seen() -> None:
    env = gymnasium_env("CartPole-v1")
    agent = QLearning(env, grows=True, visits_to_grow=0.1, trace_decay=0.5, seed=3)
    assert agent.partition.n_cells == 1
    agent.learn(trials=1)
    seen = agent._memory._rows["seen"][: int(agent._memory.last[-1]) + 1]
    for axis, line in enumerate(agent.partition.centres):
        assert line[0] <= seen[:, axis].min() <= seen[:, axis].max() <= line[-1]
    before = agent.partition.n_cells
    agent.learn(total_timesteps=5_000)
    assert before < agent.partition.n_cells <= agent.max_cells
    assert agent.table.shape == (agent.partition.n_cells, 2)
    assert agent.history[-1]["cells"] == agent.partition.n_cells


def test_the_limit_on_cells_is_kept() -> None:
    agent = make("pendulum", max_cells=200, visits_to_grow=0.1)
    assert agent.learn(total_timesteps=3_000).partition.n_cells <= 200


def test_values_stay_where_a_fuzzy_partition_becomes_finer() -> None:
    agent = make("pendulum").learn(trials=3)
    # Values that differ: where they do not, another partition breaks ties anew.
    agent.set_table(np.random.default_rng(0).normal(size=agent.table.shape))
    old, finer = agent.policy.copy(), agent.partition.refined(1)
    agent._grow_to(finer)
    states = pendulum(50).reset(seed=1)[0]
    assert agent.partition is finer
    assert np.array_equal(agent.predict(states)[0], old.predict(states)[0])


def test_a_partition_stays_unless_it_is_to_grow() -> None:
    partition = crisp()
    agent = QLearning(pendulum(), partition, replay=2, seed=0).learn(trials=3)
    assert agent.partition is partition
    assert agent.history[-1]["cells"] == 49
    agent.grows, agent.visits_to_grow = True, 0.5
    assert agent.learn(trials=3).partition.n_cells > 49


def test_untried_pairs_stay_at_zero_where_the_partition_grows() -> None:
    """Before the range is known all is one cell, which the first steps make bad."""
    env = gymnasium_env("MountainCar-v0")
    agent = QLearning(env, grows=True, visits_to_grow=1e9, max_steps=50, seed=0)
    agent.learn(trials=1)
    assert agent.partition.n_cells > 1
    assert (agent.table[~agent._known] == 0.0).all()
    assert (agent.table[agent._known] < 0.0).all()


def test_discrete_states_do_not_grow() -> None:
    agent = make("taxi", grows=True).learn(trials=2)
    assert isinstance(agent.partition, Discrete)
    assert isinstance(make("pendulum").partition, Fuzzy)


def test_who_remembers_nothing_has_nothing_to_save(tmp_path: Path) -> None:
    agent = QLearning(chains(2), ROW, seed=0).learn(trials=2)
    assert agent._arrays() == {}
    assert agent.remembered_steps == 0
    assert "cells" not in agent.history[-1]
    agent.save(tmp_path / "plain")
    # It may begin to remember at any time.
    again = QLearning.load(tmp_path / "plain", chains(2), replay=3)
    assert again.learn(trials=1).remembered_steps > 0
    again.replay = 0
    again.learn(trials=1).save(tmp_path / "plain")
    assert QLearning.load(tmp_path / "plain").remembered_steps == 0


def test_the_size_of_the_memory_may_change() -> None:
    agent = make("pendulum").learn(trials=2)
    kept = agent.snapshot()
    assert agent.remembered_steps > 500
    agent.memory_size = 500
    assert agent.learn(trials=1).remembered_steps <= 500
    agent.take_back(kept)
    assert agent.remembered_steps > 500
    assert agent.learn(trials=1).remembered_steps <= 500


def test_another_number_of_slots() -> None:
    agent = make("traces").learn(trials=2)
    agent.set_env(pendulum(9))
    steps = agent.num_timesteps
    assert agent.learn(trials=1).num_timesteps > steps
    assert agent.rollout.num_envs == 9


BAD: list[tuple[str, Any, type[Exception]]] = [
    *[("replay", value, ValueError) for value in (-1, 10**10)],
    *[("replay", value, TypeError) for value in (1.5, "3", True, None)],
    *[("older_steps", value, ValueError) for value in (-1, 10**10)],
    ("steps_per_replay", 0, ValueError),
    *[("memory_size", value, ValueError) for value in (0, 10**9)],
    *[("optimism", value, ValueError) for value in (-0.1, 1.1, np.nan)],
    *[("optimism", value, TypeError) for value in ("1", True)],
    *[("grows", value, TypeError) for value in (None, 1, "yes")],
    *[("visits_to_grow", value, ValueError) for value in (0, -1.0)],
    *[("max_cells", value, ValueError) for value in (0, 10**10)],
]


@pytest.mark.parametrize(("name", "value", "error"), BAD)
def test_bad_parameters(name: str, value: Any, error: type[Exception]) -> None:
    with pytest.raises(error, match=f"{name} must"):
        QLearning(chains(2), ROW, **{name: value})
    agent = QLearning(chains(2), ROW)
    with pytest.raises(error, match=f"{name} must"):
        setattr(agent, name, value)


def test_values_that_overflow_in_memory_are_refused() -> None:
    env = chains(6, reward=-1e308)
    agent = QLearning(env, ROW, discount=1.0, replay=2, max_steps=9, seed=0)
    with pytest.raises(ValueError, match=r"must stay finite, .* in trial"):
        agent.learn(trials=20)


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("known", lambda a: a[1:]),
        ("growth_turn", lambda a: a - 10),
        ("memory_last", lambda a: -a),
    ],
)
def test_memories_from_strangers_are_checked(
    name: str, change: Callable[[Any], Any], tmp_path: Path, monkeypatch: Any
) -> None:
    agent = make("pendulum").learn(trials=1)
    arrays = agent._arrays()
    arrays[name] = change(arrays[name])
    monkeypatch.setattr(agent, "_arrays", lambda: arrays)
    agent.save(tmp_path / "strange")
    with pytest.raises(ValueError, match="is damaged"):
        QLearning.load(tmp_path / "strange")
