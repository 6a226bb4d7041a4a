"""Colonies whose ants do not wait for each other (§7.3)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.vector import SyncVectorEnv

from acl_gym import (
    ACL,
    Crisp,
    Fuzzy,
    PolicyEvaluation,
    ReturningACL,
    WaitingVectorEnv,
    evaluate_policy_cost,
)
from acl_gym.colony.costs import Steps
from acl_gym.colony.pheromone import Pheromone
from acl_gym.colony.update_rule import TrialResult
from acl_gym.colony.update_rules import UPDATE_RULES, EachVisit
from tests.agents.reference_colony import chains

PENDULUM = "acl_gym/Pendulum-v0"
MODES = ("NextStep", "SameStep", "Disabled")


def pendulum(ants: int = 12, **parameters: Any) -> Any:
    return gym.make_vec(PENDULUM, num_envs=ants, **parameters)


def goals_nearby(ants: int = 12) -> Any:
    """Where many a walk ends soon, and many do not."""
    return pendulum(ants, goal_bounds=(1.0, 4.0))


def grid() -> Fuzzy:
    return Fuzzy([np.linspace(0, 6, 7), np.linspace(-9, 9, 7)], [2 * np.pi, None])


def cells() -> Crisp:
    return Crisp([np.arange(6.0)])


def slippery() -> Any:
    return chains(7, "NextStep", slip=0.3, limit=20)


def cart_poles() -> Any:
    return WaitingVectorEnv.make("CartPole-v1", 5)


SETTINGS: dict[str, tuple[Any, Callable[[], Any], dict[str, Any]]] = {
    "pendulum": (ACL, goals_nearby, {"partition": grid(), "max_steps": 60}),
    "episodes": (
        ACL,
        goals_nearby,
        {
            "partition": grid(),
            "max_steps": 60,
            "cost": Steps() + 0.5,
            "deposit": "rank",
            "update": "once_per_ant",
        },
    ),
    "chains": (ACL, slippery, {"partition": cells(), "update": "in_turn"}),
    "tabu": (ACL, slippery, {"partition": cells(), "tabu": True}),
    "by rank": (
        ACL,
        cart_poles,
        {"partition": Fuzzy([np.linspace(-2, 2, 3)] * 4), "deposit": "rank"},
    ),
    "returning": (ReturningACL, lambda: goals_nearby(5), {"max_steps": 60}),
    "returning, cart-pole": (ReturningACL, cart_poles, {}),
    "returning, cells": (
        ReturningACL,
        slippery,
        {"partition": cells(), "steps_per_walk": 20, "memory_size": 150},
    ),
}
EACH = pytest.mark.parametrize("name", SETTINGS)


def make(name: str, seed: int = 3, **more: Any) -> Any:
    kind, env, keywords = SETTINGS[name]
    keywords = {"schedule": "asynchronous", **keywords, **more}
    if kind is ACL:
        keywords = {"tau0": 1e-6, **keywords}
    return kind(env(), seed=seed, **keywords)


def assert_same(one: Any, other: Any) -> None:
    assert one.table.tobytes() == other.table.tobytes()
    assert one.num_timesteps == other.num_timesteps
    assert one.rng.bit_generator.state == other.rng.bit_generator.state
    assert [{**row, "seconds": 0} for row in one.history] == [
        {**row, "seconds": 0} for row in other.history
    ]


@EACH
def test_the_same_seed_gives_the_same_bits(name: str) -> None:
    colony = make(name).learn(trials=4)
    assert_same(colony, make(name).learn(trials=4))
    assert (colony.table != make(name, seed=4).learn(trials=4).table).any()


@EACH
def test_it_is_another_run_than_the_synchronous_one(name: str) -> None:
    """In the settings there are ants that come back early."""
    other = make(name, schedule="synchronous").learn(trials=4)
    assert make(name).learn(trials=4).num_timesteps != other.num_timesteps


@EACH
def test_two_parts_are_one_run_also_through_a_file(name: str, tmp_path: Path) -> None:
    """Between trials nothing is under way that a file could not hold."""
    whole = make(name).learn(trials=5)
    assert_same(make(name).learn(trials=2).learn(trials=3), whole)
    make(name).learn(trials=2).save(tmp_path / "part")
    kind, env, _ = SETTINGS[name]
    part = kind.load(tmp_path / "part", env())
    assert part.schedule == "asynchronous"
    assert_same(part.learn(trials=3), whole)


@EACH
def test_a_trial_can_be_taken_back(name: str) -> None:
    colony = make(name).learn(trials=2)
    kept = colony.snapshot()
    colony.learn(trials=2)
    for _ in range(2):
        colony.take_back(kept)
        assert_same(colony.learn(trials=3), make(name).learn(trials=5))


@EACH
def test_the_environment_is_free_between_trials(name: str) -> None:
    """An evaluation may use the very slots in which the ants walk."""
    colony = make(name)

    def disturb(agent: Any, row: Any) -> None:
        agent.env.reset(seed=row["trial"])

    colony.learn(trials=3, callback=disturb)
    assert_same(colony, make(name).learn(trials=3))


@pytest.mark.parametrize("update", UPDATE_RULES)
@pytest.mark.parametrize("cost", [None, Steps()])
def test_ants_that_come_back_together_are_a_synchronous_colony(
    update: str, cost: Any
) -> None:
    """Nobody reaches a goal of no size, so that all time out in the same step."""
    colonies = [
        ACL(
            pendulum(goal_bounds=(1e-9, 1e-9)),
            grid(),
            seed=1,
            max_steps=25,
            tau0=1e-6,
            update=update,
            cost=cost,
            deposit="rank",
            schedule=schedule,
        ).learn(trials=3)
        for schedule in ("synchronous", "asynchronous")
    ]
    assert_same(*colonies)


def test_the_same_holds_for_ants_that_walk_back() -> None:
    colonies = [
        ReturningACL(
            pendulum(5, goal_bounds=(1e-9, 1e-9)),
            seed=1,
            max_steps=70,
            schedule=schedule,
        ).learn(trials=6)
        for schedule in ("synchronous", "asynchronous")
    ]
    assert_same(*colonies)


@pytest.mark.parametrize("kind", [ACL, ReturningACL])
def test_every_autoreset_mode_teaches_the_same(kind: Any) -> None:
    envs = [chains(6, mode, slip=0.2, limit=15) for mode in MODES]
    waiting: Any = WaitingVectorEnv([lambda: chains(1, slip=0.2, limit=15).envs[0]] * 6)
    keywords = {"tau0": 1e-3} if kind is ACL else {}
    colonies = [
        kind(
            env, cells(), seed=0, max_steps=12, schedule="asynchronous", **keywords
        ).learn(trials=4)
        for env in [*envs, waiting]
    ]
    for each in colonies[1:]:
        assert_same(each, colonies[0])


@pytest.mark.parametrize("kind", [ACL, ReturningACL])
def test_native_modes_teach_the_same(kind: Any) -> None:
    colonies = [
        kind(
            pendulum(5, goal_bounds=(1.0, 4.0), autoreset_mode=mode),
            grid(),
            seed=0,
            max_steps=40,
            schedule="asynchronous",
        ).learn(trials=3)
        for mode in MODES
    ]
    for each in colonies[1:]:
        assert_same(each, colonies[0])


class Way(gym.Env):
    """A way of a fixed length; each step is noted, and costs 1."""

    action_space = spaces.Discrete(2)
    observation_space = spaces.Box(0.0, 200.0, (1,))

    def __init__(self, length: int, log: list[tuple[float, float]]) -> None:
        self.length, self.log = length, log

    def _seen(self) -> np.ndarray:
        return np.array([self.place], np.float32)

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        self.place = 0.0
        return self._seen(), {}

    def step(self, action: int) -> Any:
        before, self.place = self.place, self.place + 1.0
        self.log.append((before, self.place))
        return self._seen(), -1.0, self.place == self.length, False, {}


LENGTHS = (60, 3, 4, 3)


def ways(log: list[Any], mode: str | None = None) -> Any:
    makers = [lambda n=n: Way(n, log) for n in LENGTHS]
    return (
        SyncVectorEnv(makers, autoreset_mode=mode) if mode else WaitingVectorEnv(makers)
    )


@dataclass
class Noting(EachVisit):
    """The rule of the thesis; it notes who has come back."""

    needs_episodes: ClassVar[bool] = True
    lengths: list[list[int]] = field(default_factory=list)
    begins: list[bool | None] = field(default_factory=list)
    steps: int = 0

    def global_update(
        self, pheromone: Pheromone, result: TrialResult, *decays: float
    ) -> None:
        episodes = result.episodes
        assert episodes is not None
        self.lengths.append(result.solutions.length.tolist())
        self.begins.append(result.begins_batch)
        self.steps += int(result.solutions.length.sum())
        assert result.costs.tolist() == result.solutions.length.tolist()
        assert len(result.deposits) == len(result.costs) == result.solutions.n_ants
        rows = [row for block in result.solutions.blocks() for row in block.index[:, 0]]
        walked = [
            int(seen)
            for ant in range(len(episodes))
            for seen in episodes[ant].observations[:-1, 0]
        ]
        assert rows == walked  # cells and states have the same numbers here
        super().global_update(pheromone, result, *decays)


@pytest.mark.parametrize("mode", [None, *MODES])
def test_slots_of_very_different_length(mode: str | None) -> None:
    """The slow ant walks once, while the others come back fifteen to twenty times."""
    log: list[Any] = []
    partition = Crisp([np.arange(201.0)])
    colony = ACL(
        ways(log, mode),
        partition,
        seed=0,
        max_steps=100,
        update=Noting(),
        schedule="asynchronous",
        tau0=1e-3,
    ).learn(trials=1)
    rule: Any = colony.update
    back = [length for lengths in rule.lengths for length in lengths]
    assert {n: back.count(n) for n in set(back)} == {60: 1, 3: 40, 4: 15}
    assert rule.steps == colony.num_timesteps == 60 + 40 * 3 + 15 * 4
    if mode in (None, "NextStep"):  # with the others, slots that wait are stepped along
        assert rule.steps == len(log)
    # Four ants make a batch; of some that come back together a few belong to the next.
    counts = np.cumsum([0, *map(len, rule.lengths)])
    full = np.diff(counts // 4) > 0
    assert rule.begins == [True, *full[:-1]]
    assert colony.history[0]["ants_cost"] == pytest.approx(np.mean(back))
    # In the synchronous colony each walks once.
    other = ACL(ways([]), partition, seed=0, max_steps=100, tau0=1e-3).learn(trials=1)
    assert other.num_timesteps == sum(LENGTHS)


@pytest.mark.parametrize("mode", [None, *MODES])
@pytest.mark.parametrize("steps_per_walk", [7, 300])
def test_what_is_remembered_is_what_was_done(
    mode: str | None, steps_per_walk: int
) -> None:
    """No step lost, none double: the environment counts them."""
    log: list[Any] = []
    colony = ReturningACL(
        ways(log, mode),
        Crisp([np.arange(201.0)]),
        seed=0,
        max_steps=100,
        steps_per_walk=steps_per_walk,
        schedule="asynchronous",
    ).learn(trials=2)
    memory = colony._memory
    assert colony.num_timesteps == colony.remembered_steps == len(log) == 2 * 240
    done = []
    for first, last, terminated in zip(
        memory.first, memory.last, memory.terminated, strict=True
    ):
        path = memory.index[first : last + 1, 0]
        assert last > first
        assert (np.diff(path) == 1).all()
        assert not terminated or path[-1] in LENGTHS
        done += pairwise(path)
    assert sorted(done) == sorted(log)
    assert memory.terminated.sum() == 2 * (1 + 2 * 20 + 15)


def test_no_slot_waits_where_paths_are_remembered() -> None:
    colony = make("returning").learn(trials=3)
    walked = []

    def note(agent: Any, row: Any) -> None:
        walked.append((agent.rollout.outcome().n_steps, agent.rollout.steps))

    colony.learn(trials=4, callback=note)
    assert all(steps == colony.num_envs * taken for steps, taken in walked)


@dataclass
class Untried(EachVisit):
    """Checks the tabu list of each ant: in one walk, first one action, then the other."""

    needs_episodes: ClassVar[bool] = True
    checked: int = 0

    def global_update(
        self, pheromone: Pheromone, result: TrialResult, *decays: float
    ) -> None:
        assert result.episodes is not None
        for number in range(len(result.episodes)):
            episode = result.episodes[number]
            for cell in np.unique(episode.observations[:-1]):
                there = episode.actions[episode.observations[:-1, 0] == cell]
                if there.size > 1:
                    assert there[0] != there[1]
                    self.checked += 1
        super().global_update(pheromone, result, *decays)


def test_a_tabu_list_begins_anew_for_the_ant_alone() -> None:
    colony = make("tabu", update=Untried()).learn(trials=10)
    assert colony.update.checked > 50  # type: ignore[attr-defined]


def test_ants_are_ranked_among_the_last_that_came_back() -> None:
    """The first to fall would be the best of all if it were compared with itself."""
    seen: list[np.ndarray] = []

    def deposit(costs: np.ndarray) -> np.ndarray:
        seen.append(costs)
        return np.ones(costs.size)

    log: list[Any] = []
    colony = ACL(
        ways(log),
        Crisp([np.arange(201.0)]),
        seed=0,
        max_steps=100,
        deposit=deposit,
        schedule="asynchronous",
        tau0=1e-3,
    )
    colony.learn(trials=2)
    assert [each.tolist() for each in seen[:4]] == [
        [3.0, 3.0],
        [3.0, 3.0, 4.0],
        [3.0, 4.0, 3.0, 3.0],
        [4.0, 3.0, 3.0, 4.0],
    ]
    assert all(each.size == 4 for each in seen[2:])


def test_with_the_schedule_the_pendulum_is_learned_as_well() -> None:
    """Ten seeds came within 25% of J* = 38.4 after 2,500 to 6,500 interactions."""
    colony = ReturningACL(pendulum(5), seed=0, schedule="asynchronous")
    evaluation = PolicyEvaluation(pendulum(100))
    colony.learn(total_timesteps=12_000, callback=evaluation)
    assert min(row["policy_cost"] for row in colony.history) < 1.25 * 38.4


def test_an_asynchronous_colony_finds_the_way_through_the_chain() -> None:
    colony = ACL(
        chains(10, limit=60), cells(), seed=0, tau0=1e-3, schedule="asynchronous"
    ).learn(trials=30)
    assert evaluate_policy_cost(colony, chains(200), seed=0, max_steps=50).cost < 3.2
    assert (colony.table[:5].argmax(axis=1) == 1).all()


@pytest.mark.parametrize("kind", [ACL, ReturningACL])
def test_the_schedule_is_checked_fixed_and_saved(kind: Any, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="schedule must be one of 'synchronous', 'asy"):
        kind(pendulum(), grid(), schedule="sync")
    colony = kind(pendulum(), grid(), max_steps=5)
    assert colony.schedule == colony.parameters()["schedule"] == "synchronous"
    with pytest.raises(
        AttributeError, match="schedule is fixed once the agent is made"
    ):
        colony.schedule = "asynchronous"
    colony.learn(trials=1).save(tmp_path / "a")
    other = kind.load(tmp_path / "a", pendulum(), schedule="asynchronous")
    assert other.learn(trials=1).trials == 2
    assert other.parameters()["schedule"] == "asynchronous"


@pytest.mark.parametrize("kind", [ACL, ReturningACL])
def test_what_cannot_reset_one_slot_is_refused_before_any_step(kind: Any) -> None:
    """Gymnasium's own CartPole of many slots ignores the mask."""
    env = gym.make_vec("CartPole-v1", num_envs=3)
    partition = Fuzzy([np.linspace(-2, 2, 3)] * 4)
    with pytest.raises(ValueError, match="max_steps=50 steps, got CartPoleVectorEnv"):
        kind(env, partition, max_steps=50, schedule="asynchronous")
    # Its own limit it keeps by itself.
    more = {"deposit": "rank"} if kind is ACL else {}
    colony = kind(env, partition, seed=0, schedule="asynchronous", **more)
    colony.learn(trials=3)
    assert colony.history[-1]["ants_cost"] < 0
    env.close()


def test_costs_in_files_from_strangers_are_checked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    colony = make("by rank").learn(trials=1)
    arrays = colony._arrays()
    for wrong in (np.full(5, np.nan), np.zeros((2, 2)), np.array(["a"])):
        changed = {**arrays, "latest_costs": wrong}
        monkeypatch.setattr(colony, "_arrays", lambda changed=changed: changed)
        colony.save(tmp_path / "strange")
        with pytest.raises(ValueError, match="is damaged"):
            ACL.load(tmp_path / "strange")
