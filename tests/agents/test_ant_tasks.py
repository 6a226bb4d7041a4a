"""By which cities and costs ant agents go on, from files and with wrappers."""

from __future__ import annotations

import io
import pickle
import warnings
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import SyncVectorEnv
from gymnasium.wrappers import TransformReward as TransformRewardOfSlot
from gymnasium.wrappers.vector import RecordEpisodeStatistics, TransformReward

from acl_gym import AntColonySystem, AntSystem, InverseCost, MaxMinAntSystem
from acl_gym.colony.deposits import UndefinedDepositError
from acl_gym.envs.graph import TravellingSalesmanInstance
from acl_gym.utils.archives import Archive, save

KINDS: list[type[Any]] = [AntSystem, AntColonySystem, MaxMinAntSystem]
SALESMAN = "acl_gym/TravellingSalesman-v0"


def roads(n: int = 12, seed: int = 0) -> np.ndarray:
    distances = np.random.default_rng(seed).integers(1, 30, (n, n)).astype(float)
    return distances + distances.T


def salesman(ants: int = 3, **parameters: Any) -> Any:
    return gym.make_vec(
        SALESMAN, num_envs=ants, **({"distances": roads()} | parameters)
    )


def in_thousands(rewards: Any) -> Any:
    return rewards * 1e-3


def doubled(rewards: Any) -> Any:
    return rewards * 2.0


def file_of(agent: Any) -> io.BytesIO:
    buffer = io.BytesIO()
    agent.save(buffer)
    buffer.seek(0)
    return buffer


@pytest.mark.parametrize("kind", KINDS)
def test_costs_that_a_wrapper_changes_are_no_lengths(kind: type[Any]) -> None:
    """tau0 follows them too: ants deposit 1,000 times as much, on every level."""

    def env() -> Any:
        return TransformReward(salesman(start=2), in_thousands)

    colony = kind(env(), seed=4).learn(trials=3)
    length = colony.instance.length(colony.best_tour)
    assert colony.best_cost == pytest.approx(1e-3 * length, rel=1e-12)
    again = kind.load(file_of(colony), env=env())
    assert again.best_cost == colony.best_cost
    again.learn(trials=2)
    assert again.table.tobytes() == colony.learn(trials=2).table.tobytes()
    # Watched, but not changed, so that tau0 is found in the same way.
    plain = kind(RecordEpisodeStatistics(salesman(start=2)), seed=4).learn(trials=5)
    np.testing.assert_array_equal(plain.best_tour, colony.best_tour)
    np.testing.assert_allclose(colony.table, 1e3 * plain.table, rtol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_a_file_of_other_costs_is_refused_where_costs_are_lengths(
    kind: type[Any],
) -> None:
    wrapped = TransformReward(salesman(), in_thousands)
    file = file_of(kind(wrapped, seed=0).learn(trials=2))
    with pytest.raises(ValueError, match=r"best tour has a length of .*its wrappers"):
        kind.load(file, env=salesman())


@pytest.mark.parametrize("trials", [0, 2])
@pytest.mark.parametrize("kind", KINDS)
def test_a_file_knows_its_cities_also_before_the_first_trial(
    kind: type[Any], trials: int
) -> None:
    colony = kind(salesman(), seed=0)
    if trials:
        colony.learn(trials=trials)
    other = salesman(distances=roads(seed=1))
    # Also where it is saved again without having met an environment.
    twice = file_of(kind.load(file_of(colony)))
    for file in (file_of(colony), twice):
        with pytest.raises(ValueError, match="got others, of <distances: 12 cities"):
            kind.load(file, env=other)
        file.seek(0)
        same = kind.load(file, env=salesman(5)).learn(trials=1)
        np.testing.assert_array_equal(same.heuristic, colony.heuristic)
    loaded = kind.load(file_of(colony))
    with pytest.raises(ValueError, match="those with which its file was made"):
        loaded.set_env(other)
    assert loaded.env is None
    loaded.set_env(salesman())


def test_files_that_do_not_tell_their_cities_are_read() -> None:
    colony = AntSystem(salesman(), seed=0).learn(trials=2)
    archive = Archive(file_of(colony))
    header = {k: v for k, v in archive.header.items() if k not in ("format", "version")}
    arrays = dict(archive.arrays)
    del arrays["instance"]
    older = io.BytesIO()
    save(older, header, arrays)
    older.seek(0)
    again = AntSystem.load(older, env=salesman()).learn(trials=1)
    assert again.table.tobytes() == colony.learn(trials=1).table.tobytes()
    older.seek(0)
    with pytest.raises(ValueError, match="env must be the instance on which the best"):
        AntSystem.load(older, env=salesman(distances=roads(seed=1)))
    damaged = io.BytesIO()
    save(damaged, header, {**arrays, "instance": np.zeros(31, np.uint8)})
    damaged.seek(0)
    with pytest.raises(ValueError, match="instance must be a hash of 32 bytes"):
        AntSystem.load(damaged)


def test_only_distances_tell_instances_apart() -> None:
    colony = AntSystem(salesman(), seed=0).learn(trials=2)
    tour = colony.best_tour
    same = TravellingSalesmanInstance.from_distances(
        roads(), name="mine", coordinates=np.zeros((12, 2)), optimum=3.0
    )
    colony.set_env(salesman(instance=same, distances=None))
    np.testing.assert_array_equal(colony.best_tour, tour)
    changed = roads()
    changed[3, 7] += 0.25
    with pytest.raises(
        ValueError,
        match=rf"of 'mine', got a distance of {changed[3, 7]} from city 3 to city 7 in "
        rf"place of {changed[3, 7] - 0.25}; make",
    ):
        colony.set_env(salesman(distances=changed))


@pytest.mark.parametrize("kind", KINDS)
def test_another_number_of_cities_is_said_so(kind: type[Any]) -> None:
    colony = kind(salesman(), seed=0)
    with pytest.raises(ValueError, match="got 11 cities in place of 12; make a new"):
        colony.set_env(salesman(distances=roads(11)))
    with pytest.raises(ValueError, match="got others, of <distances: 11 cities"):
        kind.load(file_of(colony), env=salesman(distances=roads(11)))
    assert colony.learn(trials=1).best_tour.size == 12


def lake(wrapper: Any = None, slots: int = 10) -> Any:
    env = gym.make_vec("FrozenLake-v1", num_envs=slots, vectorization_mode="sync")
    return env if wrapper is None else TransformReward(env, wrapper)


def lake_of(wrapper: Any, slots: int = 10) -> Any:
    """The wrapper around each slot."""

    def single() -> Any:
        return TransformRewardOfSlot(gym.make("FrozenLake-v1"), wrapper)

    return SyncVectorEnv([single] * slots)


def lake_by_id(slots: int = 10, **arguments: Any) -> Any:
    return gym.make_vec("FrozenLake-v1", num_envs=slots, **arguments)


def watched(env: Any) -> Any:
    return RecordEpisodeStatistics(env)


def wrapped_slot(env: Any) -> Any:
    return TransformRewardOfSlot(env, in_thousands)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("before", "after", "kept"),
    [
        (lake, lambda: lake(in_thousands), False),
        (lambda: lake(in_thousands), lake, False),
        (lambda: lake(in_thousands), lambda: lake(doubled), False),
        (lambda: lake(in_thousands), lambda: lake(in_thousands, 4), True),
        (lambda: lake(in_thousands), lambda: watched(lake(in_thousands)), True),
        (lambda: watched(lake()), lake, True),
        (lake, lambda: lake_of(doubled), False),
        (lambda: lake_of(doubled), lambda: lake_of(doubled, 4), True),
        (lambda: lake_of(doubled), lambda: lake_of(in_thousands), False),
        (lake, lambda: lake_by_id(wrappers=[wrapped_slot]), False),
    ],
)
def test_a_best_cost_is_one_of_the_same_rewards(
    kind: type[Any], before: Any, after: Any, kept: bool
) -> None:
    colony = kind(before(), deposit="return", max_steps=100, seed=0).learn(trials=20)
    cost = colony.best_cost
    assert cost < np.inf
    colony.set_env(after())
    assert colony.best_cost == (cost if kept else np.inf)


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_environment_with_other_rewards(kind: type[Any]) -> None:
    """Below the wrappers there is the same object."""
    env = salesman()
    colony = kind(env, seed=0).learn(trials=2)
    tour = colony.best_tour
    colony.set_env(env)
    np.testing.assert_array_equal(colony.best_tour, tour)
    colony.set_env(TransformReward(env, in_thousands))
    assert colony.best_tour is None
    colony.learn(trials=1)
    assert colony.best_cost < 1.0
    wrapped = colony.env
    colony.set_env(wrapped)
    assert colony.best_cost < 1.0
    colony.set_env(env)
    assert colony.best_tour is None


@pytest.mark.parametrize("kind", KINDS)
def test_remedies_are_those_that_ant_agents_take(kind: type[Any]) -> None:
    with pytest.raises(ValueError, match="take 'inverse_cost' for costs") as refused:
        kind(salesman(), deposit="rank")
    assert "'inverse'" not in str(refused.value)
    one_place = salesman(coordinates=np.zeros((4, 2)), distances=None)
    with pytest.raises(ValueError, match="got 0 for ant 0; a tour of length 0") as zero:
        kind(one_place, seed=0).learn(trials=1)
    flat = kind(one_place, deposit=InverseCost(offset=1), seed=0).learn(trials=1)
    assert flat.best_cost == 0.0
    with pytest.raises(ValueError, match=r"got -.*; leave deposit out") as returns:
        kind(salesman(), deposit="return")
    ice = gym.make_vec("FrozenLake-v1", num_envs=20)
    with pytest.raises(ValueError, match='pass deposit="return" where') as lake_words:
        kind(ice, seed=0).learn(trials=50)
    cliff = gym.make_vec("CliffWalking-v1", num_envs=20)
    with pytest.raises(ValueError, match='pass deposit="inverse_cost" where') as steps:
        kind(cliff, deposit="return", tabu=True, seed=0).learn(trials=50)
    for words in (zero, returns, lake_words, steps):
        assert "rank" not in str(words.value)


@pytest.mark.parametrize("local_search", [None, "2-opt", "or-opt", "3-opt"])
def test_the_best_cost_is_the_length_of_the_best_tour_bit_for_bit(
    local_search: str | None,
) -> None:
    """Sums of forty distances that are no whole numbers round in the order of adding."""
    for seed in range(5):
        places = np.random.default_rng(seed).uniform(0, 9, (40, 2))
        env = salesman(10, coordinates=places, distances=None)
        colony = MaxMinAntSystem(env, seed=0, local_search=local_search).learn(trials=3)
        assert colony.best_cost == colony.instance.length(colony.best_tour)


def test_what_other_agents_say_passes_through_processes() -> None:
    with pytest.raises(UndefinedDepositError, match='elsewhere deposit="rank"') as said:
        InverseCost()(np.array([1.0, 0.0]), 1.0)
    again = pickle.loads(pickle.dumps(said.value))
    assert (str(again), again.cost) == (str(said.value), 0.0)


def test_a_wrapper_around_no_slots_is_no_surprise() -> None:
    """Wrappers of one's own that do not keep their arguments are never the same."""

    class Secret(TransformReward):
        def __init__(self, env: Any, factor: float) -> None:
            super().__init__(env, lambda rewards: factor * rewards)

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = Secret(salesman(), 2.0)
        colony = AntSystem(env, seed=0).learn(trials=1)
        cost = colony.best_cost
        colony.set_env(env)
        assert colony.best_cost == cost
        colony.set_env(Secret(salesman(), 2.0))
    assert colony.best_cost == np.inf
