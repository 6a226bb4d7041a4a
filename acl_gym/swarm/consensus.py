"""Agents that meet, or agree on a value, by averaging what they hear."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acl_gym.swarm.inbox import Inbox
from acl_gym.swarm.protocols import DynamicAgents
from acl_gym.swarm.rows import checked_positions, per_agent
from acl_gym.utils.typing import FloatArray


class ConsensusAgents(DynamicAgents):
    """Agents that go a share of the way to the mean of the positions that they hear.

        u_i = gain_i (mean of the heard x_j - x_i)

    An agent that hears nobody stays where it is. The thesis has no such swarm. With
    gain = 1 and channels in which agents hear themselves it is the nearest neighbour rule
    of Jadbabaie, Lin and Morse (2003), IEEE Transactions on Automatic Control 48(6).

    Args:
        gain: the share, in [0, 1]; a number, or one for each agent, `(n,)`.

    Attributes:
        positions: the last observation of each agent, `(n, dim)`.

    Raises:
        ValueError: `gain` is neither, or out of range.
    """

    positions: FloatArray

    def __init__(self, gain: ArrayLike = 0.5) -> None:
        self.gain = per_agent("gain", gain, at_least=0.0, at_most=1.0)

    def reset(self, n: int, rng: np.random.Generator) -> None:
        """Check that there is a gain for each of n agents, and forget the last run."""
        per_agent("gain", self.gain, n)
        self._n = n
        self.positions = self._mean = np.zeros((n, 0))

    def observe(self, y: Any) -> None:
        """Take in where each agent is.

        Args:
            y: the positions x_i, `(n, dim)`.

        Raises:
            ValueError: they do not have this shape, or one is no number.
        """
        self.positions = checked_positions(y, self._n)

    def send(self) -> dict[str, NDArray[Any]]:
        """Say where each agent is: `"position"`, `(n, dim)`."""
        return {"position": self.positions}

    def hear(self, inbox: Inbox) -> None:
        """Average the positions that have arrived."""
        self._mean = inbox.mean(inbox.message("position"), default=self.positions)

    def decide(self, rng: np.random.Generator) -> FloatArray:
        """The inputs u_i, `(n, dim)`; nothing is random."""
        share = self.gain[..., np.newaxis]  # over the coordinates of each agent
        return share * (self._mean - self.positions)
