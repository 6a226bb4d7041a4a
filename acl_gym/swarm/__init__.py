"""Swarms of moving agents: the framework of chapter 6 of the thesis.

A moving agent is a row of arrays, and a swarm is a set of rows. Its body, a particle, is
a row of an `Environment`; its mind is a row of `DynamicAgents`; a `Channel` carries
messages between minds. `run` lets them run. docs/moving-agents.md has the framework in
words, and an example to begin with.

`acl_gym.swarm.pso` has particle swarm optimization; `minimize` and its parts, which are
imported when they are first used, are names of this package as well.

Nothing in this package needs Gymnasium.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from acl_gym.swarm.channel import Channel, Delayed, Lossy, Topology
from acl_gym.swarm.inbox import Inbox
from acl_gym.swarm.links import Links
from acl_gym.swarm.protocols import DynamicAgents, Environment
from acl_gym.swarm.run import History, run
from acl_gym.swarm.topologies import Everyone, Nearest, Radius, Ring, VonNeumann

if TYPE_CHECKING:
    from acl_gym.swarm.pso import Landscape, ParticleSwarm, minimize

# Name -> module, imported on first use.
_LAZY = {
    "Landscape": "acl_gym.swarm.pso",
    "ParticleSwarm": "acl_gym.swarm.pso",
    "minimize": "acl_gym.swarm.pso",
}

__all__ = [
    "Channel",
    "Delayed",
    "DynamicAgents",
    "Environment",
    "Everyone",
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
    "minimize",
    "run",
]


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        return getattr(import_module(_LAZY[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_LAZY})
