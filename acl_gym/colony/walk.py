"""What the ants of a colony do until it is remembered, step by step."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray

_STEP, _END, _GOAL = 0, 1, 2  # what a row is: a step, or where a path ends, and how


class Paths(NamedTuple):
    """Where paths lie in rows of states, `(n_paths,)` each."""

    first: IntArray
    """The row of the first state."""
    last: IntArray
    """The row of the last state."""
    terminated: BoolArray
    """Whether that is a terminal state."""


class Walk:
    """What the ants do in a part of a trial, step by step, until it is remembered.

    An ant that sets out again after it has stopped begins another path.

    Args:
        n_slots: M, the number of ants.
    """

    def __init__(self, n_slots: int) -> None:
        self._n_slots = n_slots
        self._ants: list[IntArray] = []
        self._seen: list[NDArray[Any]] = []
        self._actions: list[IntArray] = []
        self._rewards: list[FloatArray] = []
        self._allowed: list[BoolArray | None] = []
        self._ends: list[tuple[int, NDArray[np.int8]]] = []
        self._n_rows = 0
        self.steps = 0

    def append(
        self,
        ants: IntArray,
        seen: NDArray[Any],
        actions: IntArray,
        rewards: FloatArray,
        allowed: BoolArray | None,
    ) -> None:
        """Add a step.

        Args:
            ants: the ants that took it, `(m,)`.
            seen: what they saw before the step, `(m, ...)`, a copy made by then: the
                environment may write the next observations to the same array.
            actions: what these ants did, `(m,)`.
            rewards: what they got for it, `(m,)`.
            allowed: U_q of each of them before the step, `(m, n_actions)`; None: all.
        """
        self._add(ants, seen, actions, rewards, allowed)
        self.steps += ants.size

    def stop(
        self,
        ants: IntArray,
        observation: NDArray[Any],
        terminated: BoolArray,
        allowed: BoolArray | None,
    ) -> None:
        """Add the states in which paths end, so that they can be remembered.

        Args:
            ants: whose paths, `(m,)`; each has made a step since the last one ended.
            observation: of all slots, `(n_slots, ...)`.
            terminated: whether these are terminal states, `(m,)`.
            allowed: see `append`.
        """
        kinds = np.where(terminated, _GOAL, _END).astype(np.int8)
        self._ends.append((self._n_rows, kinds))
        self._add(ants, observation[ants], _zeros(ants), _zeros(ants), allowed)

    def _add(
        self, ants: Any, seen: Any, actions: Any, rewards: Any, allowed: Any
    ) -> None:
        self._n_rows += ants.size
        self._ants.append(ants)
        self._seen.append(seen)
        self._actions.append(actions)
        self._rewards.append(rewards)
        self._allowed.append(allowed)

    def states(self) -> NDArray[Any]:
        """All observations, in the order of time, `(n, ...)`."""
        return np.concatenate(self._seen)

    def rows(self) -> tuple[Paths, dict[str, NDArray[Any]]]:
        """All of it, ant by ant, and the paths of an ant in the order of time.

        Ask once: what is returned is not kept.

        Returns:
            The paths, all of which have ended, and of all states, `(n, ...)`, what was
            "seen", the "action", the "reward", and what was "allowed", if there are
            masks.
        """
        ants = np.concatenate(self._ants)
        count = np.bincount(ants, minlength=self._n_slots)
        order = _by_ant(ants, np.cumsum(count) - count)
        parts: dict[str, list[Any]] = {
            "seen": self._seen,
            "action": self._actions,
            "reward": self._rewards,
        }
        masks = [each for each in self._allowed if each is not None]
        if masks:
            parts["allowed"] = [
                np.ones((ant.size, masks[0].shape[1]), np.bool_) if m is None else m
                for ant, m in zip(self._ants, self._allowed, strict=True)
            ]
        rows = {}
        for name, part in parts.items():
            rows[name] = np.take(np.concatenate(part), order, axis=0)
            part.clear()  # a long walk of many ants would not fit into memory twice
        kinds = np.full(self._n_rows, _STEP, dtype=np.int8)
        for begin, ends in self._ends:
            kinds[begin : begin + ends.size] = ends
        kinds = kinds[order]
        last = np.flatnonzero(kinds)
        first = np.concatenate([[0], last[:-1] + 1])
        return Paths(first, last, kinds[last] == _GOAL), rows


def _zeros(ants: IntArray) -> Any:
    return np.zeros(ants.size, dtype=np.int64)


@njit
def _by_ant(ants: IntArray, first: IntArray) -> IntArray:
    """The order of the rows in which those of an ant stand together, in time."""
    order = np.empty(ants.size, np.int64)
    for row in range(ants.size):
        order[first[ants[row]]] = row
        first[ants[row]] += 1
    return order
