"""Agents that average: their arithmetic, agent by agent, and what they refuse."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from acl_gym.swarm import ConsensusAgents, Inbox, Links, Lossy, Ring

RNG = np.random.default_rng(0)


def inputs(agents: ConsensusAgents, x: np.ndarray, links: Links) -> np.ndarray:
    """What agents at positions `x` do after one exchange of messages."""
    agents.reset(len(x), RNG)
    agents.observe(x)
    agents.hear(Inbox(links, agents.send()))
    return agents.decide(RNG)


@pytest.mark.parametrize("gain", [0.0, 0.3, 1.0, [0.0, 0.2, 0.4, 0.6, 0.8]])
def test_inputs_are_those_of_the_loop_over_agents(gain: Any) -> None:
    x = np.random.default_rng(1).normal(size=(5, 3))
    heard = [[1, 2], [0], [], [0, 1, 2, 3, 4], [4]]
    expected = np.zeros((5, 3))
    for i, senders in enumerate(heard):
        share = gain[i] if isinstance(gain, list) else gain
        if senders:
            mean = sum(x[j] for j in senders) / len(senders)
            expected[i] = share * (mean - x[i])
    pairs = [(i, j) for i, senders in enumerate(heard) for j in senders]
    links = Links.from_pairs(5, *zip(*pairs, strict=True))
    found = inputs(ConsensusAgents(gain), x, links)
    np.testing.assert_allclose(found, expected, atol=1e-15)
    np.testing.assert_array_equal(found[2], 0.0)  # it has heard nobody


def test_agents_that_lose_all_messages_stand_still() -> None:
    x = np.random.default_rng(2).normal(size=(6, 2))
    agents = ConsensusAgents()
    agents.reset(6, RNG)
    agents.observe(x)
    lost = Lossy(Ring(include_self=False), 1.0)
    agents.hear(lost.deliver(agents.send(), x, RNG))
    np.testing.assert_array_equal(agents.decide(RNG), 0.0)


@pytest.mark.parametrize("gain", [-0.1, 1.1, math.nan, math.inf, [0.5, 2.0]])
def test_a_gain_outside_its_range_is_refused(gain: Any) -> None:
    with pytest.raises(ValueError, match=r"gain must lie in \[0, 1\], got"):
        ConsensusAgents(gain)


@pytest.mark.parametrize("gain", ["0.5", None, [[0.5]], []])
def test_a_gain_that_is_no_number_for_each_agent_is_refused(gain: Any) -> None:
    with pytest.raises(ValueError, match="gain must be"):
        ConsensusAgents(gain)


def test_there_must_be_a_gain_for_each_agent() -> None:
    agents = ConsensusAgents([0.5, 0.5])
    with pytest.raises(ValueError, match="one for each of the 3 agents, got an array"):
        agents.reset(3, RNG)


@pytest.mark.parametrize("y", [np.zeros((4, 2)), np.zeros(3), {"slope": 1}, "here"])
def test_observations_must_be_positions(y: Any) -> None:
    agents = ConsensusAgents()
    agents.reset(3, RNG)
    with pytest.raises(ValueError, match=r"positions must be .* shape \(3, dim\)"):
        agents.observe(y)
