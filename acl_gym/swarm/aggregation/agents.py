"""The minds of an aggregating swarm: they follow the potential, §6.3.3."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from acl_gym.swarm.aggregation.forces import forces_over_links
from acl_gym.swarm.aggregation.interaction import (
    BoundedRepulsion,
    Interaction,
    check_interaction,
    coefficients_of,
)
from acl_gym.swarm.inbox import Inbox
from acl_gym.swarm.protocols import DynamicAgents
from acl_gym.swarm.rows import checked_positions, checked_rows
from acl_gym.utils.typing import FloatArray


class AggregatingAgents(DynamicAgents):
    """Agents with the input u_i = sum_j g(x_i - x_j) - grad sigma(x_i), (6.5).

    Each sends its position. It hears those of its neighbours N_i, and adds up what they
    do to it. Its own message, if it hears that, does not count.

    Args:
        interaction: g; None takes `BoundedRepulsion()`.

    Raises:
        TypeError: `interaction` is none.
    """

    def __init__(self, interaction: Interaction | None = None) -> None:
        self.interaction = BoundedRepulsion() if interaction is None else interaction
        check_interaction(self.interaction)
        self._position: FloatArray = np.empty((0, 0))
        self._slope: FloatArray | None = None
        self._force: FloatArray = np.empty((0, 0))

    def reset(self, n: int, rng: np.random.Generator) -> None:
        """Check that the parameters are those of n agents, and forget the last run."""
        coefficients_of(self.interaction, n)
        self._position = self._force = np.zeros((n, 0))
        self._slope = None

    def observe(self, y: Any) -> None:
        """Take in where each agent is, and the slope of the field there.

        Args:
            y: a dict with `"position"`, `(n, dim)`, and perhaps `"slope"`, as of a
                `Field`; or the positions alone.

        Raises:
            ValueError: there are no positions, or they or slopes are no rows of numbers.
        """
        seen = y if isinstance(y, dict) else {"position": y}
        if "position" not in seen:
            raise ValueError(
                "observations must have a 'position', as those of a Field have, got "
                f"{sorted(map(str, seen))}; use another environment."
            )
        self._position = checked_positions(seen["position"])
        slope = seen.get("slope")
        if slope is not None:
            slope = checked_rows("slope", slope, self._position.shape)
        self._slope = slope

    def send(self) -> dict[str, NDArray[Any]]:
        """Say where each agent is: `"position"`, `(n, dim)`."""
        return {"position": self._position}

    def hear(self, inbox: Inbox) -> None:
        """Add up what the neighbours do, by the positions that have arrived."""
        self._force = forces_over_links(
            self._position, inbox.message("position"), inbox.links, self.interaction
        )

    def decide(self, rng: np.random.Generator) -> FloatArray:
        """The inputs u_i, `(n, dim)`; nothing is random."""
        return self._force if self._slope is None else self._force - self._slope
