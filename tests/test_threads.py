"""Threads change no bit, lose no error and no work, and survive a fork."""

from __future__ import annotations

import multiprocessing
import threading
import time
from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import acl_gym
from acl_gym import ACL, Crisp, Fuzzy, QLearning, automatic_partition, threads


@pytest.fixture(autouse=True)
def one_thread_afterwards(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(threads, "LEAST_ANTS", 5)  # small colonies wake threads too
    yield
    acl_gym.set_num_threads(1)


def learned(env_id: str, kind: Any, agent: Any, **options: Any) -> tuple[Any, ...]:
    env = gym.make_vec(env_id, num_envs=57, **options)
    partition = automatic_partition(env)
    if kind is Crisp:
        partition = Crisp(partition.centres, partition.periods)
    colony = agent(env, partition, seed=3, max_steps=40).learn(trials=3)
    row = {k: v for k, v in colony.history[-1].items() if k != "seconds"}
    return colony.table.tobytes(), row


@pytest.mark.parametrize(
    ("env_id", "kind", "options"),
    [
        ("acl_gym/Pendulum-v0", Fuzzy, {}),
        ("acl_gym/Pendulum-v0", Crisp, {"max_episode_steps": 30}),
        ("acl_gym/Navigation-v0", Fuzzy, {}),
        ("acl_gym/GridSearch2D-v0", None, {"transition_probability": 0.7}),
        ("acl_gym/GridSearch1D-v0", None, {"mask_blocked": True}),
    ],
)
@pytest.mark.parametrize("agent", [ACL, QLearning])
@pytest.mark.filterwarnings("ignore:tau0")
def test_any_number_of_threads_gives_the_same_bits(
    env_id: str, kind: Any, options: dict[str, Any], agent: Any
) -> None:
    expected = learned(env_id, kind, agent, **options)
    for count in (2, 3, 16):
        acl_gym.set_num_threads(count)
        assert learned(env_id, kind, agent, **options) == expected


def test_an_environment_alone_gives_the_same_bits() -> None:
    results = []
    for count in (1, 2, 5):
        acl_gym.set_num_threads(count)
        env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=33, max_episode_steps=7)
        observation, _ = env.reset(seed=1)
        rng, seen = np.random.default_rng(0), [observation]
        for _ in range(20):
            seen += env.step(rng.integers(3, size=33))[:4]
        results.append([array.tobytes() for array in seen])
    assert results[0] == results[1] == results[2]


def test_parts_cover_everything_once_and_in_order() -> None:
    for count in (1, 2, 3, 7):
        acl_gym.set_num_threads(count)
        for size in (0, 1, 9, 10, 23, 100):
            parts = threads.each(lambda own, n=size: np.arange(n)[own], size)
            assert np.concatenate(parts).tolist() == list(range(size))
            assert len(parts) == threads.parts(size) <= count


def test_parts_are_done_at_the_same_time() -> None:
    acl_gym.set_num_threads(3)
    meeting = threading.Barrier(3, timeout=30)
    assert len(threads.each(lambda own: meeting.wait(), 15)) == 3


@pytest.mark.parametrize("bad", [0, 2])
def test_an_error_arrives_when_all_have_stopped(bad: int) -> None:
    acl_gym.set_num_threads(3)
    stopped = []

    def work(own: slice) -> None:
        number = own.start // 5
        if number == bad:
            raise ValueError(f"part {number}")
        time.sleep(0.05)
        stopped.append(number)

    with pytest.raises(ValueError, match=f"part {bad}"):
        threads.each(work, 15)
    assert sorted(stopped) == [n for n in range(3) if n != bad]


@pytest.mark.parametrize("count", [1, 2, 4])
def test_working_ahead_keeps_the_order(count: int) -> None:
    acl_gym.set_num_threads(count)
    begun: list[int] = []

    def work(item: int) -> int:
        begun.append(item)
        return item * item

    results = threads.ahead(work, range(20))
    for item in range(20):
        assert next(results) == item * item
        time.sleep(0.001)
        # No room is taken that is still in use: at most `count` items beyond this one.
        assert max(begun) <= item + (count if count > 1 else 0)
    assert list(results) == []
    assert sorted(begun) == list(range(20))


def test_an_error_ahead_arrives_in_its_turn() -> None:
    acl_gym.set_num_threads(2)
    results = threads.ahead(lambda item: 1 // item, [2, 1, 0, 5])
    assert [next(results), next(results)] == [0, 1]
    with pytest.raises(ZeroDivisionError):
        next(results)


def square_in_parts(size: int) -> int:
    return sum(threads.each(lambda own: int((np.arange(size)[own] ** 2).sum()), size))


@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
@pytest.mark.skipif(
    "fork" not in multiprocessing.get_all_start_methods(), reason="no fork here"
)
def test_a_forked_process_makes_threads_of_its_own() -> None:
    acl_gym.set_num_threads(2)
    expected = square_in_parts(50)  # the pool has its threads now
    with multiprocessing.get_context("fork").Pool(1) as pool:
        assert pool.apply_async(square_in_parts, (50,)).get(timeout=30) == expected


@pytest.mark.parametrize(
    ("count", "error"), [(0, ValueError), (-1, ValueError), (1.5, TypeError)]
)
def test_a_number_of_threads_that_is_none(count: Any, error: type[Exception]) -> None:
    with pytest.raises(error, match="count"):
        acl_gym.set_num_threads(count)
    assert acl_gym.get_num_threads() == 1
