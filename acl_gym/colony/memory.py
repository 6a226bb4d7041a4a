"""What a colony remembers of its solutions, so that ants can walk them back again."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acl_gym.colony.greedy import ALL
from acl_gym.colony.walk import Walk
from acl_gym.partitions import Grid, Partition, locate_checked
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import (
    ActionArray,
    BoolArray,
    CellArray,
    FloatArray,
    IntArray,
)

FIRST_ROWS = 4_096
"""States for which there is memory at first; more is made when needed."""

SPARE = 1.25
"""For how many times as many states as are remembered there is memory at most."""

UNITS = 2**36
"""Parts of a degree in which evidence is counted."""


class Memory:
    """The newest solutions of a colony, each a path of states, actions and rewards.

    A path of T steps has T + 1 states; to the last belongs no action. Cells and degrees
    of the states are kept, and the observations of those that a finer partition may
    locate anew. The oldest paths are forgotten when there are more states than `most`.

    Args:
        most: how many states are remembered; the newest walk always is.
        n_actions: how many actions there are.
        partition: turns observations into cells and degrees.

    Attributes:
        partition: the present one.
        first: the row of the first state of each path, `(n_paths,)`.
        last: the row of its last state, `(n_paths,)`.
        terminated: whether it ended in a terminal state, `(n_paths,)`.
        evidence: how often each pair of a cell and an action was tried: the sum of the
            degrees, in units of 1 / `UNITS`, `(n_cells * n_actions,)`. Integers, so that
            the sum does not depend on the order, and forgetting undoes adding exactly.
        largest_reward: of all steps that are remembered, without its sign.
    """

    def __init__(self, most: int, n_actions: int, partition: Partition) -> None:
        self.most, self.n_actions = most, n_actions
        self.first: IntArray = np.empty(0, np.int64)
        self.last: IntArray = np.empty(0, np.int64)
        self.terminated: BoolArray = np.empty(0, np.bool_)
        self.largest_reward = 0.0
        self._used = 0  # rows, those of forgotten paths before them included
        self._shared = False  # whether a copy has the same rows
        self._borrowed = False  # whether it is such a copy, and has none of its own
        self._rows: dict[str, NDArray[Any]] = {
            "action": np.empty(0, np.min_scalar_type(n_actions - 1)),
            "reward": np.empty(0),
        }
        self.set_partition(partition)

    @property
    def n_paths(self) -> int:
        """How many paths are remembered."""
        return int(self.first.size)

    @property
    def n_steps(self) -> int:
        """How many steps they have together."""
        return int(self.last.sum() - self.first.sum())

    @property
    def index(self) -> CellArray:
        """Cells of the states, `(rows, k)`."""
        return self._rows["index"]

    @property
    def degree(self) -> FloatArray:
        """Their degrees, `(rows, k)`."""
        return self._rows["degree"]

    @property
    def action(self) -> ActionArray:
        """What was done there, `(rows,)`."""
        return self._rows["action"]

    @property
    def reward(self) -> FloatArray:
        """What that gave, `(rows,)`."""
        return self._rows["reward"]

    @property
    def allowed(self) -> BoolArray:
        """U_q of each state, `(rows, n_actions)`; empty where all is allowed."""
        return self._rows.get("allowed", ALL)

    def add(self, walk: Walk) -> IntArray:
        """Remember what ants have done, in the order of their numbers.

        Args:
            walk: their paths.

        Returns:
            The numbers of these paths.

        Raises:
            ValueError: an observation does not belong to the partition, or is not like
                those before.
        """
        added, new = walk.rows()
        seen = new["seen"]
        size = len(seen)
        self.forget(self.most - size)
        if not isinstance(self.partition, Grid):
            del new["seen"]
        rows = self._room(size, new)
        for name, kept in self._rows.items():
            if name in new:
                kept[rows] = new.pop(name)
            elif name == "allowed":
                kept[rows] = True
        self._locate(seen, rows)
        paths = np.arange(self.n_paths, self.n_paths + added.first.size)
        self.first = np.concatenate([self.first, rows.start + added.first])
        self.last = np.concatenate([self.last, rows.start + added.last])
        self.terminated = np.concatenate([self.terminated, added.terminated])
        self._count(paths, 1)
        self._find_largest_reward()
        return paths

    def live_rows(self) -> IntArray:
        """The rows of all states that are remembered, in the order of time."""
        begin = int(self.first[0]) if self.n_paths else self._used
        return np.arange(begin, self._used)

    def with_older(
        self, newest: IntArray, most: int, rng: np.random.Generator
    ) -> IntArray:
        """Paths to be walked again: the newest, and before them older ones.

        Args:
            newest: the numbers of the newest paths, as `add` gave them.
            most: how many steps the older ones have together; the last that is drawn
                may exceed it.
            rng: draws them.

        Returns:
            Their numbers, in the order of time.
        """
        older = self.n_paths - newest.size
        drawn = np.arange(older)
        sizes = self.last[:older] - self.first[:older]
        if sizes.sum() > most:
            order = rng.permutation(older)
            enough = int(np.searchsorted(np.cumsum(sizes[order]), most)) + (most > 0)
            drawn = np.sort(order[:enough])
        return np.concatenate([drawn, newest])

    def set_partition(self, partition: Partition) -> None:
        """Locate everything anew, in a partition of the same state variables.

        Raises:
            ValueError: an observation does not belong to it.
        """
        self.partition = partition
        shape = len(self.action), partition.cells_per_state
        self._rows["index"] = np.zeros(shape, np.int32)
        self._rows["degree"] = np.zeros(shape)
        self.evidence: IntArray = np.zeros(partition.n_cells * self.n_actions, np.int64)
        if self.n_paths:
            rows = slice(int(self.first[0]), self._used)
            self._locate(self._rows["seen"][rows], rows)
            self._count(np.arange(self.n_paths), 1)

    def copy(self) -> Memory:
        """What is remembered now, to come back to; what is added later is not in it."""
        copied = copy.copy(self)
        # This memory adds rows behind those in use and moves none of them; the copy adds
        # to rows of its own, since others may have come behind by then.
        copied._rows = dict(self._rows)
        copied._shared = self._shared = copied._borrowed = True
        copied.evidence = self.evidence.copy()
        return copied

    def arrays(self) -> dict[str, NDArray[Any]]:
        """What a file holds of it, for `restore`."""
        begin = int(self.first[0]) if self.n_paths else self._used
        located = ("index", "degree") if "seen" in self._rows else ()
        kept = {
            name: rows[begin : self._used]
            for name, rows in self._rows.items()
            if name not in located
        }
        paths = {"first": self.first - begin, "last": self.last - begin}
        return {**paths, "terminated": self.terminated, **kept}

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Take over what `arrays` gave, perhaps from a stranger's file.

        Raises:
            KeyError: an array is missing.
            ValueError: one is not what it should be.
        """
        first, last = (arrays[name].astype(np.int64) for name in ("first", "last"))
        action, reward = arrays["action"], arrays["reward"].astype(np.float64)
        size = len(action)
        begins = np.append(first, size)
        good = (
            first.ndim == 1
            and first.shape == last.shape == arrays["terminated"].shape
            and action.shape == reward.shape == (size,)
            and action.dtype.kind in "iu"
            and arrays["terminated"].dtype.kind == "b"
            and (first < last).all()
            and (last < begins[1:]).all()
            and (first.size == 0 or first[0] >= 0)
            and np.isfinite(reward).all()
            and (size == 0 or 0 <= action.min() <= action.max() < self.n_actions)
        )
        if not good:
            raise ValueError("the paths of its memory do not fit together")
        if (
            size == 0
        ):  # of an agent that has learned nothing: how states look is unknown
            return
        rows = {"action": action.astype(self.action.dtype), "reward": reward}
        if "allowed" in arrays:
            allowed = arrays["allowed"]
            if allowed.shape != (size, self.n_actions) or allowed.dtype.kind != "b":
                raise ValueError("the masks of its memory do not fit its paths")
            rows["allowed"] = allowed.copy()
        located = isinstance(self.partition, Grid)
        for name in ("seen",) if located else ("index", "degree"):
            if len(arrays[name]) != size or arrays[name].ndim != 2:
                raise ValueError(
                    f"the array {name} of its memory does not fit its paths"
                )
            rows[name] = np.ascontiguousarray(arrays[name])
        if not located:
            self._check_cells(rows["index"], rows["degree"])
        self._rows, self._used = rows, size
        self._shared = self._borrowed = False
        self.first, self.last = first, last
        self.terminated = arrays["terminated"].copy()
        self._find_largest_reward()
        if located:
            self.set_partition(self.partition)
        else:
            n_pairs = self.partition.n_cells * self.n_actions
            self.evidence = np.zeros(n_pairs, np.int64)
            self._count(np.arange(self.n_paths), 1)

    def _check_cells(self, index: NDArray[Any], degree: NDArray[Any]) -> None:
        k = self.partition.cells_per_state
        good = (
            index.shape == degree.shape == (len(index), k)
            and index.dtype == np.int32
            and degree.dtype == np.float64
            and (index.size == 0 or index.min() >= 0)
            and (index.size == 0 or index.max() < self.partition.n_cells)
            and bool(((degree >= 0) & (degree <= 1)).all())
        )
        if not good:
            raise ValueError("the cells of its memory are not those of its partition")

    def _locate(self, states: NDArray[Any], rows: slice) -> None:
        index, degree = self.index[rows], self.degree[rows]
        every = np.arange(len(states))
        n_cells = self.partition.n_cells
        locate_checked(self.partition, states, every, index, degree, n_cells)

    def _count(self, paths: IntArray, sign: int) -> None:
        """Add the degrees of paths to the evidence, or subtract them."""
        first, last = self.first[paths], self.last[paths]
        _count(
            first,
            last,
            self.index,
            self.degree,
            self.action,
            self.n_actions,
            sign * UNITS,
            self.evidence,
        )

    def _find_largest_reward(self) -> None:
        """Find it once for each walk, since each walk back needs it."""
        begin = int(self.first[0]) if self.n_paths else self._used
        rows = self.reward[begin : self._used]
        self.largest_reward = float(max(-rows.min(initial=0.0), rows.max(initial=0.0)))

    def forget(self, most: int) -> None:
        """Forget the oldest paths, until at most so many states are left."""
        sizes = self.last - self.first + 1
        newer = np.cumsum(sizes[::-1])[::-1]  # states of each path and all after it
        gone = int(np.count_nonzero(newer > most))
        if gone:
            self._count(np.arange(gone), -1)
            self.first, self.last = self.first[gone:], self.last[gone:]
            self.terminated = self.terminated[gone:]

    def _room(self, size: int, new: dict[str, NDArray[Any]]) -> slice:
        """Make room for rows; forgotten ones go first, then memory doubles."""
        for name, array in new.items():
            kept = self._rows.get(name)
            if kept is None:
                fill = np.ones if name == "allowed" else np.zeros
                shape = len(self.action), *array.shape[1:]
                self._rows[name] = fill(shape, dtype=array.dtype)
            elif kept.shape[1:] != array.shape[1:]:
                raise ValueError(
                    "observations must have as many variables in every trial, got "
                    f"{kept.shape[1:]}, then {array.shape[1:]}; check the environment."
                )
            elif name == "seen" and kept.dtype != array.dtype:
                kind = np.result_type(kept, array)
                self._rows[name] = kept.astype(kind)
        if self._borrowed or self._used + size > len(self.action):
            self._move_to_the_front(size)
        rows = slice(self._used, self._used + size)
        self._used += size
        return rows

    def _move_to_the_front(self, size: int) -> None:
        """Let the rows in use begin at 0, so that `size` rows fit behind them."""
        begin = int(self.first[0]) if self.n_paths else self._used
        live = self._used - begin
        # Where not everything is remembered any more, a quarter is spare, so that rows
        # are moved seldom; before that, memory doubles.
        enough = int(SPARE * (max(self.most, live) + size))
        length = max(len(self.action), FIRST_ROWS)
        while length < 2 * live + size and length < enough:
            length = min(2 * length, enough)
        if length > len(self.action) or self._shared:
            for name, kept in self._rows.items():
                moved = np.zeros((length, *kept.shape[1:]), dtype=kept.dtype)
                moved[:live] = kept[begin : self._used]
                self._rows[name] = moved
            self._shared = self._borrowed = False
        else:
            for kept in self._rows.values():
                # In parts that do not overlap, which NumPy moves without a copy.
                for row in range(0, live, max(begin, 1)):
                    end = min(row + begin, live)
                    kept[row:end] = kept[begin + row : begin + end]
        self.first, self.last = self.first - begin, self.last - begin
        self._used = live


@njit
def _count(
    first: IntArray,
    last: IntArray,
    index: CellArray,
    degree: FloatArray,
    action: ActionArray,
    n_actions: int,
    unit: int,
    evidence: IntArray,
) -> None:
    for path in range(first.size):
        for row in range(first[path], last[path]):
            for c in range(index.shape[1]):
                pair = np.int64(index[row, c]) * n_actions + np.int64(action[row])
                evidence[pair] += np.int64(np.rint(degree[row, c] * unit))
