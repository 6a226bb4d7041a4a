"""Swarms of moving agents: the framework of chapter 6 of the thesis.

A moving agent is a row of arrays, and a swarm is a set of rows. Its body, a particle, is
a row of an `Environment`; its mind is a row of `DynamicAgents`; a `Channel` carries
messages between minds. `run` lets them run. docs/moving-agents.md has the framework in
words, and an example to begin with.

Two methods of chapter 6 have packages of their own, `acl_gym.swarm.pso`, particle swarm
optimization (§6.3.2), and `acl_gym.swarm.aggregation`, swarms that aggregate and forage
(§6.3.3). What one begins with is imported when it is first used, and is here by name as
well: `minimize`, `Landscape` and `ParticleSwarm`; `AggregatingAgents`, `Field` and `flow`.
Ant Colony Learning (§6.3.1) in this framework is `acl_gym.agents.moving_ants`.

Nothing in this package needs Gymnasium.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from acl_gym.swarm.channel import (
    Channel,
    ChannelWrapper,
    Delayed,
    Lossy,
    Topology,
)
from acl_gym.swarm.consensus import ConsensusAgents
from acl_gym.swarm.inbox import Inbox
from acl_gym.swarm.links import Links
from acl_gym.swarm.protocols import DynamicAgents, Environment
from acl_gym.swarm.run import History, run
from acl_gym.swarm.topologies import Everyone, Nearest, Radius, Ring, VonNeumann

if TYPE_CHECKING:
    from acl_gym.swarm import aggregation, pso
    from acl_gym.swarm.aggregation import AggregatingAgents, Field, flow
    from acl_gym.swarm.pso import Landscape, ParticleSwarm, minimize

# Name -> module, imported on first use.
_LAZY = {
    "AggregatingAgents": "acl_gym.swarm.aggregation",
    "Field": "acl_gym.swarm.aggregation",
    "Landscape": "acl_gym.swarm.pso",
    "ParticleSwarm": "acl_gym.swarm.pso",
    "flow": "acl_gym.swarm.aggregation",
    "minimize": "acl_gym.swarm.pso",
}
_PACKAGES = ("aggregation", "pso")

__all__ = [
    "AggregatingAgents",
    "Channel",
    "ChannelWrapper",
    "ConsensusAgents",
    "Delayed",
    "DynamicAgents",
    "Environment",
    "Everyone",
    "Field",
    "History",
    "Inbox",
    "Landscape",
    "Links",
    "Lossy",
    "Nearest",
    "ParticleSwarm",
    "Radius",
    "Ring",
    "Topology",
    "VonNeumann",
    "aggregation",
    "flow",
    "minimize",
    "pso",
    "run",
]


def __getattr__(name: str) -> Any:
    if name in _PACKAGES:
        return import_module(f"{__name__}.{name}")
    if name in _LAZY:
        return getattr(import_module(_LAZY[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_LAZY, *_PACKAGES})
