"""A walk holds what ants did, and which paths that makes."""

from __future__ import annotations

import numpy as np

from acl_gym import Crisp
from acl_gym.colony.memory import Memory
from acl_gym.colony.walk import Walk

# Ant 0 comes back twice and is cut off; ant 1 never ends; ant 2 sets out late and is
# timed out. A state is ten times the ant and the time.
STEPS = [([0, 1], [0]), ([0, 1], []), ([0, 1, 2], [0]), ([0, 1, 2], [2]), ([0, 1], [])]
GOALS = [True, False, False]


def walk_of_three() -> Walk:
    walk = Walk(3)
    goals = iter(GOALS)
    for t, (ants, back) in enumerate(STEPS):
        who = np.array(ants)
        seen = np.arange(3)[:, None] * 10.0 + t
        walk.append(who, seen[who], who % 2, -1.0 * who - t, None)
        if back:
            end = np.array(back)
            ended = np.array([next(goals)])
            walk.stop(end, np.full((3, 1), 0.5 + t), ended, None)
    on_the_way = np.array([0, 1])
    walk.stop(on_the_way, np.full((3, 1), 9.5), np.zeros(2, np.bool_), None)
    return walk


PATHS = [
    ([0.0, 0.5], True),
    ([1.0, 2.0, 2.5], False),
    ([3.0, 4.0, 9.5], False),
    ([10.0, 11.0, 12.0, 13.0, 14.0, 9.5], False),
    ([22.0, 23.0, 3.5], False),
]


def test_an_ant_may_make_several_paths() -> None:
    walk = walk_of_three()
    assert walk.steps == 12
    states = walk.states()
    paths, rows = walk.rows()
    assert len(states) == len(rows["seen"]) == 12 + 5
    found = [
        (rows["seen"][first : last + 1, 0].tolist(), bool(terminated))
        for first, last, terminated in zip(*paths, strict=True)
    ]
    assert found == PATHS
    assert rows["reward"][paths.first].tolist() == [0.0, -1.0, -3.0, -1.0, -4.0]


def test_they_are_remembered_one_by_one() -> None:
    memory = Memory(1_000, 2, Crisp([np.linspace(0.0, 30.0, 61)]))
    for begun in (0, 5):
        numbers = memory.add(walk_of_three())
        assert numbers.tolist() == list(range(begun, begun + 5))
    assert memory.n_steps == 24
    assert memory.terminated.tolist() == [True, *[False] * 4] * 2
    cells = memory.index[memory.first[1] : memory.last[1] + 1, 0]
    assert (cells / 2.0).tolist() == PATHS[1][0]
