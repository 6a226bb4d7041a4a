"""Threads change no bit of a result, and refuse impossible numbers."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import acl_gym
from acl_gym import ACL, Crisp, Fuzzy, QLearning
from acl_gym.partitions.automatic import thesis_partition
from acl_gym.utils import threads

BITS_FOR_EACH_COUNT = """
import hashlib, json, sys
import gymnasium as gym
from acl_gym import ACL, Fuzzy, set_num_threads
from acl_gym.utils import threads
threads.LEAST_ANTS = 1
tables = []
for count in (1, 2, 3, 5):
    set_num_threads(count)
    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=2_000)
    grid = Fuzzy.from_box(env.single_observation_space, (40, 41), circular=[0])
    colony = ACL(env, grid, seed=3, max_steps=40).learn(trials=2)
    tables.append(hashlib.sha256(colony.table.tobytes()).hexdigest())
print(json.dumps(tables))
"""


TWO_PYTHON_THREADS = """
import json, threading
import gymnasium as gym
import numba
from acl_gym import ACL, Fuzzy, set_num_threads
from acl_gym.utils import threads
threads.LEAST_ANTS = 1
set_num_threads(2)
learned, used = {}, {}
def learn(name):
    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=500)
    grid = Fuzzy.from_box(env.single_observation_space, (20, 21), circular=[0])
    learned[name] = ACL(env, grid, seed=3, max_steps=50).learn(trials=4).table.sum()
    used[name] = numba.get_num_threads()
workers = [threading.Thread(target=learn, args=(name,)) for name in "abc"]
for worker in workers:
    worker.start()
for worker in workers:
    worker.join()
learn("main")
print(json.dumps([sorted(set(learned.values())), used]))
"""


@pytest.fixture(autouse=True)
def one_thread_afterwards(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(threads, "LEAST_ANTS", 1)  # small colonies wake threads too
    yield
    acl_gym.set_num_threads(1)


def learned(env_id: str, partition: Any, agent: Any) -> tuple[Any, ...]:
    env = gym.make_vec(env_id, num_envs=1_200)
    colony = agent(env, partition, seed=3, max_steps=30).learn(trials=2)
    row = {k: v for k, v in colony.history[-1].items() if k != "seconds"}
    return colony.table.tobytes(), row


def same_with_two_threads(env_id: str, partition: Any, agent: Any) -> None:
    if os.cpu_count() == 1:  # pragma: no cover
        pytest.skip("one core only")
    expected = learned(env_id, partition, agent)
    acl_gym.set_num_threads(2)
    assert acl_gym.get_num_threads() == 2
    assert learned(env_id, partition, agent) == expected


@pytest.mark.parametrize("agent", [ACL, QLearning])
def test_a_fuzzy_colony_learns_the_same_bits(agent: Any) -> None:
    same_with_two_threads(
        "acl_gym/Pendulum-v0", thesis_partition(gym.make("acl_gym/Pendulum-v0")), agent
    )


def test_a_crisp_colony_learns_the_same_bits() -> None:
    fuzzy = thesis_partition(gym.make("acl_gym/Pendulum-v0"))
    crisp = Crisp(fuzzy.centres, fuzzy.periods)
    same_with_two_threads("acl_gym/Pendulum-v0", crisp, ACL)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:tau0")
def test_a_colony_of_vehicles_learns_the_same_bits() -> None:
    same_with_two_threads(
        "acl_gym/Navigation-v0",
        thesis_partition(gym.make("acl_gym/Navigation-v0"), "regular"),
        ACL,
    )


def test_any_number_of_threads_gives_the_same_bits() -> None:
    """More threads than cores, which Numba allows if it is configured beforehand."""
    done = subprocess.run(
        [sys.executable, "-c", BITS_FOR_EACH_COUNT],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "NUMBA_NUM_THREADS": "5"},
    )
    assert len(set(json.loads(done.stdout))) == 1


def test_a_state_that_is_not_finite_is_named_by_its_row() -> None:
    partition = Fuzzy([np.arange(5.0), np.arange(4.0)])
    states = np.random.default_rng(0).uniform(0, 3, (1_000, 2))
    states[[700, 300], 1] = np.nan
    messages = []
    for count in (1, 2):
        acl_gym.set_num_threads(count)
        with pytest.raises(ValueError, match="finite") as error:
            partition(states)
        messages.append(str(error.value))
    assert messages[0] == messages[1]
    assert "in row 300" in messages[0]


def test_threads_wake_for_many_ants_only(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threads, "LEAST_ANTS", 100)
    assert not threads.worth_it(1_000)
    acl_gym.set_num_threads(2)
    assert [threads.worth_it(n) for n in (99, 100)] == [False, True]


@pytest.mark.parametrize(
    ("count", "error", "words"),
    [
        (0, ValueError, "count"),
        (1.5, TypeError, "count"),
        (
            10_000,
            ValueError,
            r"at most \d+, got 10000: one thread per core, .*NUMBA_NUM",
        ),
    ],
)
def test_a_number_of_threads_that_cannot_be(
    count: Any, error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        acl_gym.set_num_threads(count)
    assert acl_gym.get_num_threads() == 1


def test_colonies_in_several_python_threads_share_kernels_and_setting() -> None:
    """Under the layer that ends the process where two threads enter kernels at once."""
    done = subprocess.run(
        [sys.executable, "-c", TWO_PYTHON_THREADS],
        check=False,
        capture_output=True,
        text=True,
        env={
            **os.environ,
            "NUMBA_NUM_THREADS": "4",
            "NUMBA_THREADING_LAYER": "workqueue",
        },
    )
    assert done.returncode == 0, done.stderr
    tables, used = json.loads(done.stdout)
    assert len(tables) == 1
    assert used == dict.fromkeys("abc", 2) | {"main": 2}
