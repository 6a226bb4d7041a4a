"""What a trial's record holds, however it is kept, and how much memory it takes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import given, settings
from hypothesis import strategies as st

from acl_gym.colony import solutions as module
from acl_gym.colony.solutions import Solutions
from acl_gym.partitions import Crisp, Discrete, Fuzzy, Partition
from tests.colony.listed import Listed, recorded

Array = np.ndarray
SQUARE = spaces.Box(-1.0, 1.0, (2,), np.float64)


def walk(partition: Partition, length: Array, seed: int, dtype: Any = float) -> Any:
    """Record ants that see random states; return the record and what it must give."""
    rng = np.random.default_rng(seed)
    n, steps = len(length), int(length.max())
    solutions = Solutions(n, steps, 5, partition)
    seen = rng.uniform(-1.5, 1.5, (steps, n, 2)).astype(dtype)
    actions = rng.integers(5, size=(steps, n))
    for t in range(steps):
        ants = np.flatnonzero(length > t)
        index, _ = partition(seen[t])
        solutions.append(ants, seen[t], index[ants], actions[t, ants])
    rows = [(t, ant) for ant in range(n) for t in range(length[ant])]
    states = np.array([seen[row] for row in rows])
    return solutions, *partition(states), np.array([actions[row] for row in rows])


@pytest.mark.parametrize("kind", [Crisp, Fuzzy])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@given(st.lists(st.integers(1, 9), min_size=1, max_size=9), st.integers(0, 99))
@settings(max_examples=20)
def test_blocks_hold_every_pair_ant_by_ant(
    kind: Any, dtype: Any, lengths: list[int], rows: int
) -> None:
    length = np.array(lengths)
    partition = kind.from_box(SQUARE, (4, 3))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "ROWS_PER_BLOCK", rows)
        solutions, *expected = walk(partition, length, rows, dtype)
        parts = [
            (b.ants, *map(np.array, (b.index, b.degree, b.action, b.ends)))
            for b in solutions.blocks()
        ]
    for field, array in enumerate(expected, start=1):
        got = np.concatenate([part[field] for part in parts])
        np.testing.assert_array_equal(got, array)
    counts = [np.diff(part[4], prepend=0) for part in parts]
    assert np.concatenate(counts).tolist() == lengths
    assert [part[0].start for part in parts][1:] == [p[0].stop for p in parts][:-1]
    # A block is one ant, or no more rows than it should hold.
    assert all(c.size == 1 or c.sum() <= rows for c in counts)


def test_a_record_that_is_cleared_is_as_new() -> None:
    partition = Fuzzy.from_box(SQUARE, 3)
    solutions, *_ = walk(partition, np.array([3, 1]), 0)
    solutions.clear()
    assert [block.action.size for block in solutions.blocks()] == [0]
    seen = np.array([[0.3, -0.2], [0.5, 0.5]])
    solutions.append(np.array([1]), seen, partition(seen[1:])[0], np.array([4]))
    (block,) = solutions.blocks()
    assert block.ends.tolist() == [0, 1]
    np.testing.assert_array_equal(block.index, partition(seen[1:])[0])
    np.testing.assert_array_equal(block.degree, partition(seen[1:])[1])
    assert block.action.tolist() == [4]


@pytest.mark.parametrize("kinds", [("f4", "f8"), ("f8", "f4"), ("f4", "f8", "f4")])
def test_observations_may_change_their_type_within_a_trial(kinds: Any) -> None:
    partition = Fuzzy.from_box(SQUARE, 3)
    solutions, ants = Solutions(2, len(kinds), 3, partition), np.arange(2)
    steps = [
        np.array([[0.25, -0.5], [t / 8, 0.75]], kind) for t, kind in enumerate(kinds)
    ]
    for seen in steps:
        solutions.append(ants, seen, partition(seen)[0], np.array([2, 1]))
    (block,) = solutions.blocks()
    index, degree = partition(np.stack(steps, axis=1).reshape(-1, 2))
    np.testing.assert_array_equal(block.index, index)
    np.testing.assert_array_equal(block.degree, degree)
    with pytest.raises(ValueError, match=r"as many variables .* got 2, then 3"):
        solutions.append(ants, np.zeros((2, 3)), index, np.array([0, 0]))


def test_nothing_recorded_gives_no_blocks() -> None:
    assert list(Solutions(3, 2, 2, Fuzzy.from_box(SQUARE, 3)).blocks()) == []


@pytest.mark.parametrize(
    ("partition", "n_actions", "state", "expected"),
    [
        (Crisp.from_box(SQUARE, 3), 3, np.zeros(2), 4 + 1),
        (Fuzzy.from_box(SQUARE, 3), 3, np.zeros(2), 16 + 1),
        (Fuzzy.from_box(SQUARE, 3), 256, np.zeros(2), 16 + 1),
        (Fuzzy.from_box(SQUARE, 3), 257, np.zeros(2, np.float32), 8 + 2),
        (Discrete([7]), 4, np.zeros(1), 4 + 1),
    ],
)
def test_a_step_takes_few_bytes(
    partition: Partition, n_actions: int, state: Array, expected: int
) -> None:
    solutions = Solutions(2, 5, n_actions, partition)
    seen = np.stack([state] * 2)
    actions = np.full(2, n_actions - 1)
    solutions.append(np.arange(2), seen, partition(seen)[0], actions)
    rows = solutions._rows
    assert rows is not None
    assert rows.itemsize * rows.shape[1] + solutions._action.itemsize == expected
    (block,) = solutions.blocks()
    assert block.action.tolist() == actions.tolist()


def test_a_partition_that_changes_its_mind_is_held_to_its_cells() -> None:
    class Growing(Listed):
        checked = False

    index = np.array([[[0, 1]], [[1, 2]]])
    solutions = recorded(index, np.full(index.shape, 0.5), np.zeros((2, 1), int))
    assert next(solutions.blocks()).index.max() == 2
    solutions.partition.__class__ = Growing
    solutions.partition.index = index[:, 0] + 1
    with pytest.raises(ValueError, match=r"cells in 0\.\.2, got 1 to 3"):
        next(solutions.blocks())


def test_kernels_agree_with_themselves_as_plain_python() -> None:
    rng = np.random.default_rng(1)
    length = np.array([2, 0, 3])
    seen = rng.random((3, 3, 2))
    actions = rng.integers(5, size=(3, 3))
    results = []
    for name in ("__call__", "py_func"):
        size = 3 * module.RUN
        rows, cells = np.zeros((size, 2)), np.zeros((size, 1), np.int32)
        action, own = np.zeros((2, size), np.uint8)
        walked, again = np.zeros((2, 3), np.int64)
        append = getattr(module._append, name)
        for t in range(3):
            ants = np.flatnonzero(length > t)
            index = ants[:, None].astype(np.int32)
            append(0, ants, seen[t], True, actions[t, ants], 5, 3, rows, action, walked)
            append(0, ants, index, False, actions[t, ants], 5, 3, cells, own, again)
        np.testing.assert_array_equal(walked, length)
        places, out = np.zeros(5, np.int64), np.zeros(5, np.uint8)
        collect = getattr(module._collect, name)
        collect(np.arange(3), walked, 3, action, places, out)
        results.append((rows, cells, action, own, walked, again, places, out))
    for compiled, plain in zip(*results, strict=True):
        np.testing.assert_array_equal(compiled, plain)
    pairs = [(t, ant) for ant in range(3) for t in range(length[ant])]
    rows, *_, places, out = results[0]
    np.testing.assert_array_equal(rows[places], [seen[pair] for pair in pairs])
    np.testing.assert_array_equal(out, [actions[pair] for pair in pairs])


@given(st.integers(1, 40), st.integers(1, 12))
def test_every_step_has_a_place_of_its_own(steps: int, n_ants: int) -> None:
    solutions = Solutions(n_ants, steps, 2, Fuzzy.from_box(SQUARE, 3))
    places = [
        int(module._place(t, ant, n_ants))
        for t in range(steps)
        for ant in range(n_ants)
    ]
    assert len(set(places)) == len(places)
    assert max(places) < solutions._size


@pytest.mark.parametrize(
    "partition", [Crisp.from_box(SQUARE, 3), Fuzzy.from_box(SQUARE, 3)]
)
@pytest.mark.parametrize("steps", [1, 5, 6, 23])
def test_memory_grows_with_the_steps_that_are_made(
    partition: Partition, steps: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever the limit of steps, and what was there stays, trial after trial."""
    monkeypatch.setattr(module, "FIRST_STEPS", 5)
    rng = np.random.default_rng(steps)
    found = []
    for limit in (steps, 10**12):
        solutions = Solutions(3, limit, 4, partition)
        rng = np.random.default_rng(steps)
        for _ in range(2):
            solutions.clear()
            for t in range(steps):
                ants = np.flatnonzero(np.array([steps, steps // 2, 1]) > t)
                seen = rng.random((3, 2))
                index = partition(seen[ants])[0]
                solutions.append(ants, seen, index, rng.integers(4, size=ants.size))
        found.append(
            [(b.index, b.degree, b.action, b.ends) for b in solutions.blocks()]
        )
        assert solutions._size <= 3 * max(2 * steps + 5, 10)
    for one, other in zip(*found, strict=True):
        for left, right in zip(one, other, strict=True):
            np.testing.assert_array_equal(left, right)
