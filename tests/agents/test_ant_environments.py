"""Where the ant agents walk: vectors of single environments, and changes of the task."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv
from gymnasium.wrappers import RecordEpisodeStatistics, TransformReward
from gymnasium.wrappers.vector import RecordEpisodeStatistics as RecordVector

from acl_gym import (
    AntColonySystem,
    AntSystem,
    Crisp,
    Discrete,
    MaxMinAntSystem,
    WaitingVectorEnv,
)
from acl_gym.envs.graph.instances import TravellingSalesmanInstance
from acl_gym.envs.graph.travelling_salesman import TravellingSalesmanEnv
from acl_gym.envs.graph.travelling_salesman.lookup import salesman_of
from tests.agents.reference_colony import chains

KINDS: list[type[Any]] = [AntSystem, AntColonySystem, MaxMinAntSystem]
SALESMAN = "acl_gym/TravellingSalesman-v0"


def roads(n: int = 12, seed: int = 0) -> np.ndarray:
    distances = np.random.default_rng(seed).integers(1, 30, (n, n)).astype(float)
    return distances + distances.T


def native(ants: int = 3, **parameters: Any) -> Any:
    return gym.make_vec(SALESMAN, num_envs=ants, **parameters)


def of_slots(kind: str, ants: int = 3, **parameters: Any) -> Any:
    """A vector of single salesmen, of each sort that Gymnasium and this package have."""

    def single() -> Any:
        return gym.make(SALESMAN, **parameters)

    if kind in ("sync", "async"):
        return gym.make_vec(
            SALESMAN, num_envs=ants, vectorization_mode=kind, **parameters
        )
    if kind == "async by hand":
        return AsyncVectorEnv([single] * ants)
    return (WaitingVectorEnv if kind == "waiting" else SyncVectorEnv)([single] * ants)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "vector", ["sync", "sync by hand", "waiting", "async", "async by hand"]
)
def test_a_vector_of_salesmen_is_the_salesman(kind: type[Any], vector: str) -> None:
    """Tours are built at once, and they are those of the native environment."""
    env = of_slots(vector, distances=roads())
    try:
        colony = kind(env, seed=3).learn(trials=5)
        expected = kind(native(distances=roads()), seed=3).learn(trials=5)
        assert colony.builds_tours
        assert colony.candidates == 20
        assert colony.symmetric
        assert colony.max_steps == expected.max_steps == 13
        assert colony.table.tobytes() == expected.table.tobytes()
        np.testing.assert_array_equal(colony.best_tour, expected.best_tour)
        np.testing.assert_array_equal(colony.heuristic, expected.heuristic)
        for row, other in zip(colony.history, expected.history, strict=True):
            names = ("env_steps", "ants_cost", "trial_best_cost", "best_cost")
            assert [row[n] for n in names] == [other[n] for n in names]
    finally:
        env.close()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("vector", ["sync", "waiting"])
def test_ants_that_walk_in_slots_do_the_same(kind: type[Any], vector: str) -> None:
    """Where all of them begin in the same city, so that no seed matters."""
    env = of_slots(vector, distances=roads(), start=4)
    walked = kind(env, walk=True, seed=3).learn(trials=4)
    built = kind(env, seed=3).learn(trials=4)
    assert not walked.builds_tours
    assert walked.table.tobytes() == built.table.tobytes()
    assert walked.best_cost == built.best_cost


def test_wrappers_of_the_slots_see_every_step() -> None:
    def single() -> Any:
        return RecordEpisodeStatistics(gym.make(SALESMAN, distances=roads()))

    slots = [single(), single()]
    env = SyncVectorEnv([lambda each=each: each for each in slots])
    colony = AntSystem(env, seed=0)
    assert colony.instance == slots[0].unwrapped.instance
    assert colony.candidates == 20
    assert not colony.builds_tours
    colony.learn(trials=3)
    assert [len(each.return_queue) for each in slots] == [3, 3]


@pytest.mark.parametrize(
    "env",
    [
        lambda: RecordVector(of_slots("sync", distances=roads())),
        lambda: SyncVectorEnv([lambda: TravellingSalesmanEnv(distances=roads())] * 2),
        lambda: of_slots("sync", distances=roads(), max_episode_steps=5),
        lambda: SyncVectorEnv(
            [lambda s=s: gym.make(SALESMAN, distances=roads(), start=s) for s in (0, 1)]
        ),
        lambda: SyncVectorEnv(
            [
                lambda: TransformReward(
                    gym.make(SALESMAN, distances=roads()), lambda reward: 2 * reward
                )
            ]
        ),
    ],
    ids=["wrapped", "by hand", "short", "starts", "rewards"],
)
def test_where_a_step_may_be_another_ants_walk(env: Any) -> None:
    found = salesman_of(env())
    assert found is not None
    assert not found.is_plain
    assert found.instance.n_cities == 12


LIMIT = (
    r"env must have a time limit of at least 12 .*got max_episode_steps=5, .*without"
)


def test_the_limit_of_the_environment_is_not_called_that_of_the_ants() -> None:
    for env in (
        native(distances=roads(), max_episode_steps=5),
        RecordVector(native(distances=roads(), max_episode_steps=5)),
    ):
        for given in ({}, {"max_steps": 13}):
            with pytest.raises(ValueError, match=LIMIT):
                AntSystem(env, **given)
    with pytest.raises(ValueError, match=r"max_steps must be at least .* 12, got 5"):
        AntSystem(native(distances=roads()), max_steps=5)


@pytest.mark.parametrize("vector", ["sync", "sync by hand", "async"])
def test_a_limit_that_ends_tours_is_refused(vector: str) -> None:
    env = of_slots(vector, distances=roads(), max_episode_steps=5)
    with pytest.raises(ValueError, match=LIMIT):
        AntSystem(env)
    env.close()


@pytest.mark.parametrize("vector", [SyncVectorEnv, AsyncVectorEnv])
def test_slots_with_different_instances_are_refused(vector: type[Any]) -> None:
    instances = [
        TravellingSalesmanInstance.from_distances(roads(seed=seed), name=name)
        for seed, name in ((0, "first"), (0, "first"), (1, "second"))
    ]
    env = vector([lambda i=i: gym.make(SALESMAN, instance=i) for i in instances])
    with pytest.raises(
        ValueError, match="got 'first' in slot 0 and 'second' in slot 2"
    ):
        AntSystem(env)
    env.close()


def test_other_environments_are_left_alone() -> None:
    """A worker that is asked for an attribute it has not would end."""
    env = AsyncVectorEnv([lambda: gym.make("CliffWalking-v1")] * 2)
    try:
        assert salesman_of(env) is None
        assert env.reset(seed=0)[0].shape == (2,)
    finally:
        env.close()
    assert salesman_of(native()) is not None
    assert salesman_of(chains(2)) is None
    assert salesman_of("env") is None


def lake(slots: int = 10, mode: str | None = "sync", **arguments: Any) -> Any:
    if mode is None:
        return WaitingVectorEnv.make("FrozenLake-v1", slots, **arguments)
    return gym.make_vec(
        "FrozenLake-v1", num_envs=slots, vectorization_mode=mode, **arguments
    )


def bridge(ants: int = 5, **parameters: Any) -> Any:
    return gym.make_vec("acl_gym/DoubleBridge-v0", num_envs=ants, **parameters)


def learned(kind: type[Any], env: Any) -> Any:
    deposit = "inverse_cost" if env.spec.id.startswith("acl_gym") else "return"
    colony = kind(env, deposit=deposit, tabu=True, max_steps=100, seed=0)
    colony.learn(trials=20)
    assert colony.best_tour is not None
    return colony


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("before", "after", "kept"),
    [
        (lake, lambda: lake(3), True),
        (lake, lambda: lake(3, None), True),
        (lake, lambda: RecordVector(lake(3)), True),
        (lake, lambda: lake(max_episode_steps=100), True),
        (lambda: lake(is_slippery=False), lambda: lake(is_slippery=True), False),
        (lake, lambda: WaitingVectorEnv([Lake] * 3), False),
        (lambda: bridge(lengths=(3, 5)), lambda: bridge(7, lengths=(3, 5)), True),
        (lambda: bridge(lengths=(3, 5)), lambda: bridge(lengths=(4, 4)), False),
    ],
)
def test_the_best_solution_stays_for_the_same_task_only(
    kind: type[Any], before: Any, after: Any, kept: bool
) -> None:
    colony = learned(kind, before())
    table, best, cost = colony.table.copy(), colony.best_solution, colony.best_cost
    colony.set_env(after())
    np.testing.assert_array_equal(colony.table, table)  # knowledge that may be of use
    if kept:
        np.testing.assert_array_equal(colony.best_solution, best)
        assert colony.best_cost == cost
    else:
        assert colony.best_solution is None
        assert colony.best_cost == np.inf
        assert all(not each.found for each in colony.update.solutions)
    colony.learn(trials=2)
    colony.set_env(colony.env)  # the same object
    assert kept or colony.best_solution is None or colony.best_cost < np.inf


class Lake(gym.Env[Any, Any]):
    """As many states and actions as the lake, but another task; no id."""

    observation_space = gym.spaces.Discrete(16)
    action_space = gym.spaces.Discrete(4)

    def reset(self, **kwargs: Any) -> tuple[int, dict[str, Any]]:
        super().reset(**kwargs)
        return 0, {}

    def step(self, action: int) -> tuple[int, float, bool, bool, dict[str, Any]]:
        return 1, 1.0, True, False, {}


class Ring(gym.Env[Any, Any]):
    """Twelve states and twelve actions, of which each leads to the end."""

    observation_space = gym.spaces.Discrete(12)
    action_space = gym.spaces.Discrete(12)

    def reset(self, **kwargs: Any) -> tuple[int, dict[str, Any]]:
        super().reset(**kwargs)
        return 0, {}

    def step(self, action: int) -> tuple[int, float, bool, bool, dict[str, Any]]:
        return 1, -500.0, True, False, {}


@pytest.mark.parametrize("kind", KINDS)
def test_from_the_salesman_to_another_task_and_back(kind: type[Any]) -> None:
    colony = kind(native(distances=roads()), seed=0).learn(trials=3)
    tour = colony.best_tour
    colony.set_env(native(7, distances=roads()))
    np.testing.assert_array_equal(colony.best_tour, tour)
    colony.set_env(WaitingVectorEnv([Ring] * 3))
    assert colony.best_tour is None
    colony.learn(trials=1)
    assert colony.best_cost == 500.0  # which no tour costs
    colony.set_env(native(distances=roads()))
    assert colony.best_tour is None
    assert sorted(colony.learn(trials=1).best_tour) == list(range(12))


def test_a_refused_environment_leaves_the_agent_as_it_was() -> None:
    colony = AntSystem(native(distances=roads()), seed=0).learn(trials=3)
    env, tour = colony.env, colony.best_tour
    with pytest.raises(ValueError, match="env must have the distances by"):
        colony.set_env(native(distances=roads(seed=1)))
    assert colony.env is env
    np.testing.assert_array_equal(colony.best_tour, tour)
    alone = AntSystem(None, Discrete(12), n_actions=12, max_steps=3)
    with pytest.raises(ValueError, match="max_steps must be at least"):
        alone.set_env(native(distances=roads()))
    assert alone.env is None
    with pytest.raises(ValueError, match="no environment"):
        alone.learn(trials=1)


def test_the_same_object_keeps_what_is_known_of_a_task_of_ones_own() -> None:
    env = chains(30, length=5)
    colony = AntSystem(env, Crisp([np.arange(5.0)]), seed=2).learn(trials=12)
    best = colony.best_solution
    colony.set_env(env)
    np.testing.assert_array_equal(colony.best_solution, best)
    colony.set_env(chains(30, length=5))  # may be anything
    assert colony.best_solution is None
