"""Swarms of moving agents: the framework of chapter 6 of the thesis.

A moving agent is a row of arrays, and a swarm is a set of rows. Its body, a particle, is
a row of an `Environment`; its mind is a row of `DynamicAgents`; a `Channel` carries
messages between minds. `run` lets them run. docs/moving-agents.md has the framework in
words, and an example to begin with.

Nothing in this package needs Gymnasium.
"""

from acl_gym.swarm.channel import Channel, Delayed, Lossy, Topology
from acl_gym.swarm.inbox import Inbox
from acl_gym.swarm.links import Links
from acl_gym.swarm.protocols import DynamicAgents, Environment
from acl_gym.swarm.run import History, run
from acl_gym.swarm.topologies import Everyone, Nearest, Radius, Ring, VonNeumann

__all__ = [
    "Channel",
    "Delayed",
    "DynamicAgents",
    "Environment",
    "Everyone",
    "History",
    "Inbox",
    "Links",
    "Lossy",
    "Nearest",
    "Radius",
    "Ring",
    "Topology",
    "VonNeumann",
    "run",
]
