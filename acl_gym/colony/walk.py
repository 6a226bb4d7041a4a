"""What the ants of a colony do until it is remembered, step by step."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray


class Walk:
    """What the ants do in a part of a trial, step by step, until it is remembered.

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
        self, ants: IntArray, observation: NDArray[Any], allowed: BoolArray | None
    ) -> None:
        """Add the states in which ants stand when their walks are remembered.

        Args:
            ants: who stops, `(m,)`.
            observation: of all slots, `(n_slots, ...)`.
            allowed: see `append`.
        """
        self._add(ants, observation[ants], _zeros(ants), _zeros(ants), allowed)

    def _add(
        self, ants: Any, seen: Any, actions: Any, rewards: Any, allowed: Any
    ) -> None:
        self._ants.append(ants)
        self._seen.append(seen)
        self._actions.append(actions)
        self._rewards.append(rewards)
        self._allowed.append(allowed)

    def states(self) -> NDArray[Any]:
        """All observations, in the order of time, `(n, ...)`."""
        return np.concatenate(self._seen)

    def rows(self) -> tuple[IntArray, dict[str, NDArray[Any]]]:
        """All of it, ant by ant.

        Returns:
            The number of states of each ant, `(n_slots,)`, and of all states, `(n, ...)`,
            what was "seen", the "action", the "reward", and what was "allowed", if there
            are masks.
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
        rows = {
            name: np.take(np.concatenate(part), order, axis=0)
            for name, part in parts.items()
        }
        return count, rows


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
