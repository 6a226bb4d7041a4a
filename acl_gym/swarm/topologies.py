"""Who hears whom: by number (everyone, ring, grid) or by position (radius, nearest)."""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from acl_gym.swarm.channel import Topology
from acl_gym.swarm.links import Links
from acl_gym.swarm.near import nearest, within_radius
from acl_gym.swarm.rows import check_room, checked_positions, per_agent
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray


class _ByNumber(Topology):
    """A topology of agents that know each other's numbers, wherever they are."""

    _kept: Links | None = None  # of the last number of agents

    def __setattr__(self, name: str, value: Any) -> None:
        """Set an attribute; links that were made with another value are forgotten."""
        super().__setattr__(name, value)
        if name != "_kept":
            super().__setattr__("_kept", None)

    def links(self, x: FloatArray) -> Links:
        """See `Topology.links`; positions do not matter."""
        n = len(x)
        if self._kept is None or self._kept.n != n:
            self._kept = self._links_of(n)
        return self._kept

    @abstractmethod
    def _links_of(self, n: int) -> Links:
        """Say who hears whom among n agents."""


class Everyone(_ByNumber):
    """Every agent hears all agents. Time and memory are O(n).

    Args:
        include_self: whether an agent hears itself.
    """

    def __init__(self, include_self: bool = True) -> None:
        self.include_self = validation.boolean("include_self", include_self)

    def _links_of(self, n: int) -> Links:
        return Links.everyone(n, self.include_self)

    def __repr__(self) -> str:
        """The call that makes it."""
        return f"Everyone(include_self={self.include_self})"


class Ring(_ByNumber):
    """The agents form a ring in the order of their numbers.

    Args:
        k: how many neighbours an agent hears on each side, >= 1. Where the ring is so
            short that they meet, it hears all agents.
        include_self: whether an agent hears itself.

    Raises:
        TypeError: `k` is not an integer.
        ValueError: it is < 1, or, as soon as the number of agents is known, no memory is
            large enough for the links.
    """

    def __init__(self, k: int = 1, include_self: bool = True) -> None:
        self.k = validation.integer("k", k, at_least=1)
        self.include_self = validation.boolean("include_self", include_self)

    def _links_of(self, n: int) -> Links:
        if 2 * self.k + 1 >= n:
            return Links.everyone(n, self.include_self)
        each = 2 * self.k + self.include_self
        check_room(n * each, "use a smaller k", n_agents=n)
        steps = np.arange(-self.k, self.k + 1)
        if not self.include_self:
            steps = steps[steps != 0]
        sender = np.arange(n)[:, None] + steps
        sender %= n
        sender.sort(axis=1)
        return Links._from_rows(n, sender.reshape(-1), np.arange(n + 1) * each)

    def __repr__(self) -> str:
        """The call that makes it."""
        return f"Ring(k={self.k}, include_self={self.include_self})"


class VonNeumann(_ByNumber):
    """The agents form a grid whose ends meet; each hears the four beside it.

    Args:
        rows: of the grid, which are filled with agents in the order of their numbers;
            must divide the number of agents. None takes the number of rows that makes
            the grid most like a square: one, a ring, if the number of agents is prime.
        include_self: whether an agent hears itself.

    Raises:
        TypeError: `rows` is not an integer.
        ValueError: it is < 1, or, as soon as the number of agents is known, does not
            divide that.
    """

    def __init__(self, rows: int | None = None, include_self: bool = True) -> None:
        if rows is not None:
            rows = validation.integer("rows", rows, at_least=1)
        self.rows = rows
        self.include_self = validation.boolean("include_self", include_self)

    def _links_of(self, n: int) -> Links:
        rows = self.rows
        if rows is None:
            rows = max(r for r in range(1, math.isqrt(n) + 1) if n % r == 0)
        if n % rows:
            raise ValueError(
                f"rows must divide the number of agents, got {rows} rows for {n} agents."
            )
        check_room(5 * n, "use fewer agents", n_agents=n)
        grid = np.arange(n).reshape(rows, -1)
        beside = [np.roll(grid, by, axis) for axis in (0, 1) for by in (-1, 1)]
        if self.include_self:
            beside.append(grid)
        sender = np.concatenate([each.reshape(-1) for each in beside])
        receiver = np.tile(np.arange(n), len(beside))
        if not self.include_self:  # the only row or column is beside itself
            other = sender != receiver
            receiver, sender = receiver[other], sender[other]
        return Links.from_pairs(n, receiver, sender)

    def __repr__(self) -> str:
        """The call that makes it."""
        return f"VonNeumann(rows={self.rows}, include_self={self.include_self})"


class Radius(Topology):
    """Agents hear all within a radius: N_i = {j : |x_i - x_j| < sigma_i}, §6.3.3.

    With different radii an agent may hear another one that does not hear it.

    Args:
        sigma: the radius, >= 0 and perhaps infinite; a number, or one for each agent.
        include_self: whether an agent hears itself. If so, then by the same rule: not
            where its radius is 0.

    Raises:
        ValueError: a radius is out of range, or, as soon as there are positions, there
            is not one for each agent, or no memory is large enough for the links.
    """

    def __init__(self, sigma: ArrayLike, include_self: bool = True) -> None:
        self.sigma = per_agent("sigma", sigma, infinite=True, at_least=0)
        self.include_self = validation.boolean("include_self", include_self)

    def links(self, x: FloatArray) -> Links:
        """See `Topology.links`.

        Raises:
            ValueError: positions are not numbers of shape `(n, dim)`, or NaN.
        """
        x = checked_positions(x)
        n = len(x)
        sigma = per_agent("sigma", self.sigma, n, infinite=True, at_least=0)
        return Links._from_rows(
            n, *within_radius(x, np.full(n, sigma), self.include_self)
        )

    def __repr__(self) -> str:
        """The call that makes it."""
        return f"Radius({self.sigma.tolist()}, include_self={self.include_self})"


class Nearest(Topology):
    """Each agent hears the k others that are nearest to it, and itself.

    An agent may hear another one that does not hear it. Where others are equally
    distant, it is left open which of them it hears; in the same positions it is always
    the same ones.

    Args:
        k: how many, >= 1, and less than the number of agents.
        include_self: whether an agent hears itself beside them, as it does within a
            radius, where its distance of 0 counts. A particle that does not hear itself
            settles badly: if it has found the best point of its neighbourhood, its local
            best is a worse one.

    Raises:
        TypeError: `k` is not an integer.
        ValueError: it is < 1, or, as soon as there are positions, there are not so many
            others.
    """

    def __init__(self, k: int, include_self: bool = True) -> None:
        self.k = validation.integer("k", k, at_least=1)
        self.include_self = validation.boolean("include_self", include_self)

    def links(self, x: FloatArray) -> Links:
        """See `Topology.links`.

        Raises:
            ValueError: positions are not numbers of shape `(n, dim)`, or NaN; or there
                are not k other agents.
        """
        x = checked_positions(x)
        n = len(x)
        if self.k >= n:
            raise ValueError(
                f"k must be less than the number of agents, got {self.k} for {n} agents; "
                "use Everyone(include_self=False) to hear all others."
            )
        return Links._from_rows(n, *nearest(x, self.k, self.include_self))

    def __repr__(self) -> str:
        """The call that makes it."""
        return f"Nearest({self.k}, include_self={self.include_self})"
