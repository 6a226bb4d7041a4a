"""Studies of swarms as data, and the channels that they name."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from acl_gym.experiments.study import AnyStudy
from acl_gym.swarm import (
    Channel,
    Delayed,
    Everyone,
    Lossy,
    Nearest,
    Radius,
    Ring,
    VonNeumann,
)
from acl_gym.utils import validation

AGGREGATION, PSO, ANTS = "aggregation", "pso", "moving-ants"
"""The methods, keys of `methods.METHODS`."""

POINTS = 100
"""How many points a curve has, beside the first."""

TOPOLOGIES = ("everyone", "nobody", "ring", "von_neumann", "radius", "nearest")


@dataclass(frozen=True, kw_only=True)
class SwarmStudy(AnyStudy):
    """A swarm with a channel: all that a run depends on but its seed.

    Attributes:
        settings: keyword arguments of the function in `swarms.runs` that makes a run of
            the method.
        channel: see `make_channel`.
        stale: whether Definition 6.2 is followed to the letter, see `swarm.run`.
        steps: how many steps are made; of particle swarms, how many evaluations; of
            ants, how many trials.
    """

    channel: dict[str, Any] = field(default_factory=dict)
    stale: bool = False
    steps: int

    @property
    def subject(self) -> str:
        """See `AnyStudy.subject`."""
        return str(self.settings.get("function") or self.settings.get("env") or "field")

    @property
    def measure(self) -> str:
        """See `AnyStudy.measure`."""
        if self.method == AGGREGATION:
            return "miss" if "profile" in self.settings else "size"
        return {PSO: "value", ANTS: "differing"}[self.method]

    @property
    def unit(self) -> str:
        """See `AnyStudy.unit`."""
        return {AGGREGATION: "step", PSO: "evaluation", ANTS: "trial"}[self.method]

    @property
    def kernels(self) -> tuple[Any, ...]:
        """See `AnyStudy.kernels`."""
        parts = sorted(self.channel), self.channel.get("topology")
        return self.method, str(parts), self.subject, *sorted(self.settings)

    def brief(self) -> SwarmStudy:
        """See `AnyStudy.brief`."""
        return replace(self, steps={AGGREGATION: 5, PSO: 200, ANTS: 1}[self.method])

    def curve_points(self) -> list[int] | None:
        """See `AnyStudy.curve_points`; of ants there is one row, after the last trial."""
        if self.method == ANTS:
            return None
        return recorded_steps(self.steps, first=int(self.method == PSO))

    def __str__(self) -> str:
        """All of it in one line."""
        unit = f"{self.unit}{'s' * (self.steps != 1)}"
        parts = [self.method, f"{self.steps:,} {unit}"]
        for values in (self.channel, self.settings):
            parts += [f"{name} = {value}" for name, value in values.items()]
        return ", ".join(parts + ["Definition 6.2 to the letter"] * self.stale)


def recorded_steps(steps: int, first: int = 0) -> list[int]:
    """The steps after which rows are recorded, evenly spaced to the last one."""
    return [
        int(each)
        for each in np.unique(np.linspace(first, steps, POINTS + 1, dtype=int))
    ]


def make_channel(
    n: int,
    topology: str = "everyone",
    *,
    sigma: float | list[float] = 0.0,
    neighbours: int = 1,
    include_self: bool = True,
    loss: float = 0.0,
    symmetric: bool = False,
    delay: int = 0,
) -> Channel:
    """The channel of a study.

    Args:
        n: the number of agents.
        topology: one of `TOPOLOGIES`.
        sigma: the radius of "radius"; or the least and the largest one, between which
            those of the agents are evenly spaced.
        neighbours: of "ring", on each side, and of "nearest".
        include_self: whether an agent of "nearest" hears itself beside them.
        loss: the probability that a message is lost, in [0, 1].
        symmetric: whether losses are those of both directions together.
        delay: how many steps messages are late.

    Raises:
        ValueError: there is no such topology, or a value is out of range.
    """
    validation.one_of("topology", topology, TOPOLOGIES)
    channel: Channel
    if topology == "radius":
        low, high = sigma if isinstance(sigma, list) else (sigma, sigma)
        channel = Radius(np.linspace(low, high, n))
    elif topology == "nobody":
        channel = Radius(0.0)
    elif topology == "ring":
        channel = Ring(neighbours)
    elif topology == "nearest":
        channel = Nearest(neighbours, include_self)
    else:
        channel = Everyone() if topology == "everyone" else VonNeumann()
    if loss > 0.0:
        channel = Lossy(channel, loss, symmetric)
    return Delayed(channel, delay) if delay else channel
