"""Agents on a line or in dense groups: the tree of boxes finds what the grid finds."""

from __future__ import annotations

import math

import numpy as np
import pytest

from acl_gym.envs.swarm_aggregation import SwarmAggregation
from acl_gym.envs.swarm_aggregation.boxes import look_in_boxes, tree_of_boxes
from acl_gym.envs.swarm_aggregation.world import World
from tests.envs.swarm_aggregation.reference_world import others_by_distance


def crowded(name: str, n: int) -> np.ndarray:
    """Positions where a grid of equal cells is of no use, `(n, 2)`."""
    rng = np.random.default_rng(3)
    x = rng.uniform(-10.0, 10.0, (n, 2))
    if name == "line":
        x[:, 0] = 10.0
    elif name == "diagonal":
        x[:, 1] = x[:, 0]
    elif name == "outliers":
        x[2:] *= 1e-3
    elif name == "groups":
        x[: n // 2] = 1e-3 * x[: n // 2] + 9.0
        x[n // 2 :] = 1e-3 * x[n // 2 :] - 9.0
    elif name == "corner":
        x[n // 3 :] = 10.0
    return x


SHAPES = ("even", "line", "diagonal", "outliers", "groups", "corner")


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("k", [0, 1, 3])
@pytest.mark.parametrize("distance", [0.0, 0.01, 0.3])
@pytest.mark.parametrize("n", [1, 2, 9, 70])
def test_boxes_find_what_a_look_at_each_pair_finds(shape, k, distance, n):
    x = crowded(shape, n)
    collisions, nearest = np.empty(n, np.int64), np.empty((n, 2 * k))
    look_in_boxes(tree_of_boxes(x), distance, collisions, nearest)
    for agent in range(n):
        others = others_by_distance(x, agent)
        assert collisions[agent] == sum(r < distance for r, _ in others)
        seen = np.zeros((k, 2))
        found = [x[other] - x[agent] for _, other in others[:k]]
        seen[: len(found)] = np.reshape(found, (-1, 2))
        assert np.array_equal(nearest[agent], seen.reshape(-1))


def test_an_agent_at_the_collision_distance_does_not_collide():
    x = np.array([[0.0, 0.0], [0.25, 0.0], [0.0, -0.2]])
    collisions = np.empty(3, np.int64)
    look_in_boxes(tree_of_boxes(x), 0.25, collisions, np.empty((3, 0)))
    assert collisions.tolist() == [1, 0, 1]


@pytest.mark.parametrize("shape", SHAPES)
def test_the_work_grows_almost_linearly_wherever_agents_are(shape):
    looks = []
    for n in (1_000, 4_000):
        out = np.empty(n, np.int64), np.empty((n, 6))
        looks.append(look_in_boxes(tree_of_boxes(crowded(shape, n)), 1e-9, *out))
    assert looks[1] < 8 * looks[0]  # each pair would make 16 of it


@pytest.mark.parametrize("shape", SHAPES)
def test_a_world_sees_the_same_with_boxes_and_without(shape, monkeypatch):
    module = "acl_gym.envs.swarm_aggregation.world"
    used, looks = [], []

    def counted(*args):
        used.append(True)
        return look_in_boxes(*args)

    monkeypatch.setattr(f"{module}.look_in_boxes", counted)
    for crowd in (100, math.inf):
        monkeypatch.setattr(f"{module}._CROWD", crowd)
        world = World(SwarmAggregation(), 600, 0)
        world.start(np.random.default_rng(0), crowded(shape, 600))
        looks.append(world.look())
    assert bool(used) == (shape not in ("even", "diagonal"))
    for one, other in zip(*looks, strict=True):
        assert np.array_equal(one, other)
