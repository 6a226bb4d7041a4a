"""Ants that walk back lay what the equation says, in any order."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acl_gym import Crisp, Fuzzy
from acl_gym.colony.memory import Memory
from acl_gym.colony.walk import Walk
from acl_gym.colony.walking_back import WalkBack
from acl_gym.partitions import locate_all
from tests.colony import reference_walk_back as reference
from tests.colony.reference_walk_back import Path

Array = np.ndarray
NO_BOUNDS = (-np.inf, np.inf)
SHAPES = [(Crisp, (3,), 2), (Fuzzy, (4,), 3), (Fuzzy, (3, 4), 2), (Fuzzy, (2, 2, 2), 3)]


def grid(kind: Any, shape: tuple[int, ...]) -> Any:
    return kind([np.linspace(0.0, 1.0, n) for n in shape])


class Colony:
    """A memory with random paths, and the same paths for the reference."""

    def __init__(
        self, rng: np.random.Generator, shape: Any, masked: bool, most: int = 10_000
    ) -> None:
        kind, cells, self.n_actions = shape
        self.partition = grid(kind, cells)
        self.memory = Memory(most, self.n_actions, self.partition)
        self.paths: list[Path] = []
        self.rng, self.masked, self.n = rng, masked, len(cells)

    def walk(self, ants: int, longest: int) -> None:
        """Let ants walk at random; some never start, the others stop at some time."""
        rng, walk = self.rng, Walk(ants)
        length = rng.integers(0, longest + 1, size=ants)
        length[rng.integers(ants)] = longest
        terminated = rng.random(ants) < 0.5
        own: list[list[Any]] = [[] for _ in range(ants)]
        for t in range(longest + 1):
            seen = rng.uniform(-0.2, 1.2, (ants, self.n))
            mask = rng.random((ants, self.n_actions)) < 0.6
            mask[~mask.any(axis=1), 0] = True
            mask[:] |= not self.masked
            for ant in range(ants):
                if length[ant] > 0 and t <= length[ant]:
                    index, degree = locate_all(self.partition, seen[[ant]], 10**6)
                    beta = np.zeros(self.partition.n_cells)
                    np.add.at(beta, index[0], degree[0])
                    own[ant].append([beta, mask[ant]])
            walking = np.flatnonzero((length > 0) & (t < length))
            ending = np.flatnonzero((length > 0) & (t == length))
            if walking.size:
                actions = rng.integers(self.n_actions, size=walking.size)
                rewards = rng.normal(scale=10.0, size=walking.size)
                for ant, u, r in zip(walking, actions, rewards, strict=True):
                    own[ant][-1] += [int(u), float(r)]
                masks = mask[walking] if self.masked else None
                walk.append(walking, seen[walking], actions, rewards, masks)
            if ending.size:
                masks = mask[ending] if self.masked else None
                walk.stop(ending, seen, terminated[ending], masks)
        self.memory.add(walk)
        self.paths += [
            (
                [state[0] for state in states],
                [state[2] for state in states[:-1]],
                [state[3] for state in states[:-1]],
                bool(end),
                [state[1] for state in states],
            )
            for states, end in zip(own, terminated, strict=True)
            if states
        ]


@given(
    seed=st.integers(0, 2**32 - 1),
    shape=st.sampled_from(SHAPES),
    masked=st.booleans(),
    discount=st.sampled_from([0.0, 0.9, 1.0]),
    mix=st.sampled_from([0.0, 0.3, 1.0]),
    trust=st.sampled_from([0.0, 0.5, 1.0]),
    bounds=st.sampled_from([NO_BOUNDS, (-5.0, 2.0)]),
)
def test_levels_are_those_of_the_equation(
    seed: int,
    shape: Any,
    masked: bool,
    discount: float,
    mix: float,
    trust: float,
    bounds: tuple[float, float],
) -> None:
    rng = np.random.default_rng(seed)
    colony = Colony(rng, shape, masked)
    for _ in range(2):
        colony.walk(ants=3, longest=4)
    levels = rng.normal(scale=10.0, size=(colony.partition.n_cells, colony.n_actions))
    walk_back = WalkBack(levels.copy())
    paths = np.flatnonzero(rng.random(colony.memory.n_paths) < 0.7)
    if not paths.size:
        paths = np.arange(1)
    how: Any = {"discount": discount, "mix": mix, "rate": 0.7, "trust": trust}
    how["bounds"] = bounds
    walk_back.walk(colony.memory, paths, **how)
    walked = [colony.paths[path] for path in paths]
    expected = reference.after(levels, walked, colony.paths, **how)
    np.testing.assert_allclose(walk_back.levels, expected, rtol=1e-9, atol=1e-9)
    changed = expected != levels
    assert (walk_back.known | ~changed).all()


@given(seed=st.integers(0, 2**32 - 1), shape=st.sampled_from(SHAPES))
def test_the_order_of_the_ants_does_not_change_a_bit(seed: int, shape: Any) -> None:
    rng = np.random.default_rng(seed)
    colony = Colony(rng, shape, masked=False)
    colony.walk(ants=9, longest=12)
    levels = rng.normal(scale=100.0, size=(colony.partition.n_cells, colony.n_actions))
    how: Any = {"discount": 0.97, "mix": 0.2, "rate": 0.9, "trust": 1.0}
    how["bounds"] = NO_BOUNDS
    results = []
    for _ in range(3):
        walk_back = WalkBack(levels.copy())
        walk_back.walk(colony.memory, rng.permutation(colony.memory.n_paths), **how)
        results.append(walk_back.levels.tobytes())
    assert len(set(results)) == 1


@given(
    seed=st.integers(0, 2**32 - 1),
    shape=st.sampled_from(SHAPES),
    masked=st.booleans(),
)
def test_ants_may_come_back_in_any_order(seed: int, shape: Any, masked: bool) -> None:
    """Other slots for the same walks, which are remembered in another order then."""
    order = np.random.default_rng(seed + 1).permutation(9)
    how: Any = {"discount": 0.97, "mix": 0.2, "rate": 0.9, "trust": 0.5}
    how["bounds"] = NO_BOUNDS
    results = []
    for slots in (np.arange(9), order):
        rng = np.random.default_rng(seed)
        memory = Memory(10_000, shape[2], grid(*shape[:2]))
        walk_back = WalkBack(rng.normal(size=(memory.partition.n_cells, shape[2])))
        for _ in range(3):  # so that older walks are merged as well
            length, walk = rng.integers(1, 12, size=9), Walk(9)
            terminated = rng.random(9) < 0.5
            for t in range(length.max() + 1):
                own = rng.uniform(size=(9, len(shape[1])))
                allowed = rng.random((9, shape[2])) < 0.6
                allowed[:, 0] = True
                actions, rewards = rng.integers(shape[2], size=9), rng.normal(size=9)
                seen = np.empty_like(own)
                seen[slots] = own
                for who, take in ((t < length, True), (t == length, False)):
                    ants = np.flatnonzero(who)
                    ants = ants[np.argsort(slots[ants])]
                    masks = allowed[ants] if masked else None
                    if ants.size and take:
                        own_rows = seen[slots[ants]]
                        walk.append(
                            slots[ants], own_rows, actions[ants], rewards[ants], masks
                        )
                    elif ants.size:
                        walk.stop(slots[ants], seen, terminated[ants], masks)
            memory.add(walk)
            walk_back.walk(memory, np.arange(memory.n_paths), **how)
        results.append(walk_back.levels.tobytes())
    assert results[0] == results[1]


def test_what_is_forgotten_leaves_nothing_behind() -> None:
    """A memory that has forgotten is the memory of those who came later."""
    rng = np.random.default_rng(0)
    colony = Colony(rng, SHAPES[2], masked=False, most=60)
    for _ in range(30):
        colony.walk(ants=4, longest=6)
    memory = colony.memory
    assert memory.n_paths < len(colony.paths)
    rows = (memory.last - memory.first + 1).sum()
    assert rows <= 60
    kept = colony.paths[-memory.n_paths :]
    evidence = np.zeros((colony.partition.n_cells, colony.n_actions))
    for states, actions, *_ in kept:
        for beta, action in zip(states, actions, strict=False):
            evidence[:, action] += beta
    np.testing.assert_allclose(
        memory.evidence / 2**36, evidence.ravel(), rtol=0, atol=1e-7
    )
    assert (memory.evidence[evidence.ravel() == 0] == 0).all()


def test_a_finer_partition_locates_everything_anew() -> None:
    rng = np.random.default_rng(1)
    coarse, fine = (Fuzzy([np.linspace(0, 1, n)] * 2) for n in (3, 5))
    colony = Colony(rng, (Fuzzy, (3, 3), 2), masked=False)
    colony.walk(ants=5, longest=7)
    seen = colony.memory._rows["seen"].copy()
    before = colony.memory.evidence.sum()
    colony.memory.set_partition(fine)
    index, degree = locate_all(fine, seen, fine.n_cells)
    used = slice(0, int(colony.memory.last[-1]) + 1)
    assert np.array_equal(colony.memory.index[used], index[used])
    assert np.array_equal(colony.memory.degree[used], degree[used])
    assert abs(colony.memory.evidence.sum() - before) < 1000
    colony.memory.set_partition(coarse)
    assert abs(colony.memory.evidence.sum() - before) < 1000


def test_levels_that_cannot_be_added_up_are_refused() -> None:
    colony = Colony(np.random.default_rng(2), SHAPES[0], masked=False)
    colony.walk(ants=2, longest=3)
    walk_back = WalkBack(np.full((3, 2), 1e305))
    with pytest.raises(ValueError, match="must be numbers that can be added up"):
        walk_back.walk(
            colony.memory,
            np.arange(2),
            discount=1.0,
            mix=0.5,
            rate=1.0,
            trust=1.0,
            bounds=NO_BOUNDS,
        )


def test_rows_that_are_moved_stay_what_they_were(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A memory in little space moves its rows often; one with much space never does."""
    colonies = []
    for rows in (4, 4_096):
        monkeypatch.setattr("acl_gym.colony.memory.FIRST_ROWS", rows)
        rng = np.random.default_rng(3)
        colonies.append(Colony(rng, SHAPES[2], masked=True, most=60))
        colonies[-1].walk(ants=2, longest=3)
    tight, roomy = (colony.memory for colony in colonies)
    monkeypatch.setattr("acl_gym.colony.memory.FIRST_ROWS", 4)
    most_rows = 0
    for number in range(200):
        then = {name: array.copy() for name, array in tight.arrays().items()}
        copied = number % 7 == 0  # shared rows are not moved, but others are
        kept = tight.copy() if copied else tight
        for colony in colonies:
            colony.walk(ants=2, longest=3)
        for name, array in roomy.arrays().items():
            np.testing.assert_array_equal(tight.arrays()[name], array, err_msg=name)
            if copied:
                np.testing.assert_array_equal(kept.arrays()[name], then[name])
        np.testing.assert_array_equal(tight.evidence, roomy.evidence)
        live = slice(int(tight.first[0]), int(tight.last[-1]) + 1)
        other = slice(int(roomy.first[0]), int(roomy.last[-1]) + 1)
        np.testing.assert_array_equal(tight.index[live], roomy.index[other])
        np.testing.assert_array_equal(tight.degree[live], roomy.degree[other])
        most_rows = max(most_rows, len(tight.action))
    # At most 8 states are added at a time.
    assert most_rows <= 1.25 * (60 + 8)
    assert int(roomy.last[-1]) > 10 * most_rows
