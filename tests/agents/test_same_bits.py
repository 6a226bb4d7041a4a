"""What colonies learned before the kernels were made fast, they learn still."""

from __future__ import annotations

import warnings

import gymnasium as gym
import numpy as np
import pytest

from acl_gym import ACL
from acl_gym.agents.acl import PheromoneBoundWarning
from acl_gym.partitions import Crisp, Partition
from acl_gym.partitions.automatic import thesis_partition

# Ant-steps, and pheromone added up with weights that tell pairs apart, of six trials.
KNOWN = {
    "pendulum, fuzzy": (53566, 0.007966423125680407),
    "pendulum, crisp": (53706, -1.1359506088938927),
    "navigation, fuzzy": (53938, 0.059259280961399076),
    "navigation, irregular, crisp": (53684, -0.0982249997370031),
    "1-D grid": (5226, -1.8549591132479875),
    "2-D grid": (18721, 0.793458531529861),
}


def learned(system: str, partition: Partition | None, ants: int) -> tuple[int, float]:
    env = gym.make_vec(f"acl_gym/{system}-v0", num_envs=ants)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PheromoneBoundWarning)
        colony = ACL(env, partition, seed=3, max_steps=150, tau0=1e-4)
    colony.learn(trials=6)
    weights = np.cos(np.arange(colony.table.size)).reshape(colony.table.shape)
    return colony.num_timesteps, float((colony.table * weights).sum())


CASES = {
    "pendulum, fuzzy": ("Pendulum", thesis_partition(gym.make("acl_gym/Pendulum-v0"))),
    "pendulum, crisp": (
        "Pendulum",
        thesis_partition(gym.make("acl_gym/Pendulum-v0"), kind=Crisp),
    ),
    "navigation, fuzzy": (
        "Navigation",
        thesis_partition(gym.make("acl_gym/Navigation-v0"), "regular"),
    ),
    "navigation, irregular, crisp": (
        "Navigation",
        thesis_partition(gym.make("acl_gym/Navigation-v0"), "damping", kind=Crisp),
    ),
    "1-D grid": ("GridSearch1D", None),
    "2-D grid": ("GridSearch2D", None),
}


@pytest.mark.parametrize("case", CASES)
def test_a_seed_gives_what_it_gave(case: str) -> None:
    steps, total = learned(*CASES[case], ants=60)
    assert steps == KNOWN[case][0]
    assert total == pytest.approx(KNOWN[case][1], rel=1e-9)
