"""The double bridge: its ways, its modules, closed branches, and colonies on it."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from acl_gym import ACL, evaluate_policy_cost
from acl_gym.envs.graph.double_bridge import (
    DoubleBridge,
    DoubleBridgeEnv,
    DoubleBridgeVectorEnv,
    Place,
    kernels,
)
from acl_gym.theory import choice_probability, crossing_law, majority_probability

ENV_ID = "acl_gym/DoubleBridge-v0"


def way(env: Any, *sides: int) -> tuple[list[int], float]:
    """The states from the nest to the food, and the return; `sides` where it forks."""
    state, info = env.reset()
    states, total, turns = [int(state)], 0.0, iter(sides)
    while states[-1] != env.unwrapped.system.food:
        action = next(turns) if info["action_mask"].all() else 0
        state, reward, _, _, info = env.step(action)
        states.append(int(state))
        total += reward
    return states, total


@pytest.mark.parametrize(
    ("lengths", "action", "states"),
    [
        ((5, 10), 0, [0, 1, 2, 3, 4, 14]),
        ((5, 10), 1, [0, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14]),
        ((2, 1), 0, [0, 1, 2]),
        ((2, 1), 1, [0, 2]),
        ((1, 2), 0, [0, 2]),
        ((1, 2), 1, [0, 1, 2]),
        ((1, 1), 0, [0, 1]),
        ((1, 1), 1, [0, 1]),
        ((3, 3), 1, [0, 3, 4, 5]),
    ],
)
def test_a_branch_is_as_long_as_it_says(
    lengths: tuple[int, int], action: int, states: list[int]
) -> None:
    env = gym.make(ENV_ID, lengths=lengths)
    walked, total = way(env, action)
    assert walked == states
    assert total == -lengths[action]
    assert env.observation_space.n == states[-1] + 1


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("second", [0, 1])
def test_the_second_module_is_turned(first: int, second: int) -> None:
    """Always left, or always right, is one short branch and one long one."""
    env = gym.make(ENV_ID, lengths=(3, 7), modules=2)
    _, total = way(env, first, second)
    assert total == -((3, 7)[first] + (7, 3)[second])


def test_places_say_where_states_are() -> None:
    system = DoubleBridge(lengths=(2, 4), modules=2)
    assert [system.place(state) for state in range(system.n_states)] == [
        Place(0, None, 0.0),
        Place(0, 0, 0.5),
        Place(0, 1, 0.25),
        Place(0, 1, 0.5),
        Place(0, 1, 0.75),
        Place(1, None, 0.0),
        Place(1, 0, 0.5),
        Place(1, 1, 0.25),
        Place(1, 1, 0.5),
        Place(1, 1, 0.75),
        Place(2, None, 0.0),
    ]


def test_on_a_branch_the_action_makes_no_difference() -> None:
    system = DoubleBridge(lengths=(4, 6), modules=3)
    for state in range(system.n_states):
        env = gym.make(ENV_ID, lengths=(4, 6), modules=3)
        seen = []
        for action in (0, 1):
            _, info = env.reset(options={"state": state})
            seen.append(env.step(action)[:3])
        forks = system.place(state).branch is None and state != system.food
        assert info["action_mask"].tolist() == [True, forks]
        assert (seen[0] == seen[1]) is not forks


@pytest.mark.parametrize("closed", [0, 1])
def test_nobody_crosses_a_closed_branch(closed: int) -> None:
    env = gym.make(ENV_ID, lengths=(2, 3), modules=2, closed=closed)
    system = env.unwrapped.system
    fork = system.n_states // 2
    for start, side in ((0, closed), (fork, 1 - closed)):
        state, info = env.reset(options={"state": start})
        assert info["action_mask"].tolist() == [side == 1, side == 0]
        assert env.step(side)[:3] == (start, -1.0, False), "it turns back"
        state, reward, _, _, info = env.step(1 - side)
        assert state != start
        assert reward == -1.0


def test_the_food_is_the_end() -> None:
    env = DoubleBridgeVectorEnv(3, lengths=(1, 2))
    env.reset(options={"state": [0, 1, 2], "finished": "wait"})
    seen, rewards, terminated, _, infos = env.step(np.zeros(3, dtype=np.int64))
    assert seen.tolist() == [2, 2, 2]
    assert rewards.tolist() == [-1.0, -1.0, 0.0]
    assert terminated.all()
    assert infos["is_success"].all()


def test_the_kernel_runs_the_same_without_the_compiler() -> None:
    system = DoubleBridge(lengths=(2, 3), modules=2)
    starts = np.repeat(np.arange(float(system.n_states)), 2)
    actions = np.tile([0, 1], system.n_states)
    results = []
    for run in (kernels.advance, kernels.advance.py_func):
        states, rewards = starts.copy(), np.empty(starts.size)
        reached = np.empty(starts.size, dtype=np.bool_)
        run(states, actions, system._next_state, rewards, reached)
        results.append([each.tobytes() for each in (states, rewards, reached)])
    assert results[0] == results[1]


@pytest.mark.parametrize(
    ("parameters", "error", "message"),
    [
        ({"lengths": (5,)}, ValueError, "lengths must be two integers"),
        ({"lengths": (5, 6, 7)}, ValueError, "lengths must be two integers"),
        ({"lengths": 5}, ValueError, "lengths must be two integers"),
        ({"lengths": "57"}, (TypeError, ValueError), "lengths"),
        ({"lengths": (0, 5)}, ValueError, r"lengths\[0\] must be at least 1"),
        ({"lengths": (5, 7.0)}, TypeError, r"lengths\[1\] must be an integer"),
        ({"lengths": (10**6, 1)}, ValueError, None),
        ({"lengths": (10**12, 10**12)}, ValueError, "make the branches shorter"),
        ({"modules": 0}, ValueError, "modules must be at least 1"),
        ({"modules": 10**7}, ValueError, "at most 1,000,000 states"),
        ({"modules": True}, TypeError, "modules must be an integer"),
        ({"closed": 2}, ValueError, "closed must be at most 1"),
        ({"closed": -1}, ValueError, "closed must be at least 0"),
        ({"closed": False}, TypeError, "closed must be an integer"),
    ],
)
def test_invalid_parameters_are_refused(
    parameters: dict[str, Any], error: Any, message: str | None
) -> None:
    with pytest.raises(error, match=message):
        DoubleBridge(**parameters)


def test_lengths_may_be_a_list_or_an_array() -> None:
    for lengths in ([3, 4], np.array([3, 4]), (np.int32(3), 4)):
        assert DoubleBridge(lengths=lengths) == DoubleBridge(lengths=(3, 4))


def test_frames_show_the_ant_on_its_branch() -> None:
    pytest.importorskip("pygame")
    env = DoubleBridgeEnv("rgb_array", lengths=(2, 4))
    rows = {}
    for name, state in (("short", 1), ("long", 3)):  # both half way
        env.reset(options={"state": state})
        found = np.argwhere((env.render() == (213, 94, 0)).all(axis=-1))
        row, column = found.mean(axis=0)
        assert column == pytest.approx(240, abs=2)
        rows[name] = row
    assert rows["short"] < 240 < rows["long"], "the first branch is on the left, above"
    assert 240 - rows["short"] < rows["long"] - 240, "the longer one swings out further"


def test_frames_show_that_a_branch_is_closed() -> None:
    pytest.importorskip("pygame")
    frames = []
    for closed in (None, 0, 1):
        env = DoubleBridgeEnv("rgb_array", closed=closed)
        env.reset()
        frames.append(env.render())
    bridge = [(frame == (150, 150, 150)).all(axis=-1) for frame in frames]
    above = [picture[:238].sum() for picture in bridge]
    below = [picture[242:].sum() for picture in bridge]
    assert above[1] < 0.8 * above[0]
    assert above[2] == above[0]
    assert below[2] < 0.8 * below[0]
    assert below[1] == below[0]


def test_a_colony_finds_the_shortest_way() -> None:
    env = gym.make_vec(ENV_ID, num_envs=10, lengths=(3, 6), modules=2)
    colony = ACL(env, seed=0)
    colony.learn(trials=60)
    assert evaluate_policy_cost(colony, env).cost == 6.0


def test_a_colony_without_pheromone_evaporation_meets_the_short_branch_late() -> None:
    """The slots choose by (2.1) from what all have left: nobody takes the new branch."""
    rng = np.random.default_rng(0)
    # Branch 0 is short. Ten ants at a time, each leaves 1 where it has crossed.
    crossed = np.zeros(2)
    for closed, trials in ((0, 100), (None, 100)):
        env = gym.make_vec(ENV_ID, num_envs=10, lengths=(2, 4), closed=closed)
        for _ in range(trials):
            _, infos = env.reset()
            weight = (20.0 + crossed) ** 2 * infos["action_mask"]
            short = rng.random(10) * weight.sum(axis=1) < weight[:, 0]
            env.step(np.where(short, 0, 1))
            crossed += short.sum(), 10 - short.sum()
        if closed == 0:
            assert crossed.tolist() == [0, 1_000]
    # The expected share of short crossings is below (20 / 1,020)^2 = 0.0004 at first.
    assert crossed[0] < 10


def test_colonies_on_the_environment_follow_the_exact_law() -> None:
    """Each slot is the next ant of a colony of its own, which chooses by (2.1).

    The share of 4,000 colonies in which one branch has more than 80% of 60 crossings is
    within 4.4 standard errors of the exact one: wrong once in 90,000 seeds.
    """
    n_colonies, n_ants = 4_000, 60
    env = gym.make_vec(ENV_ID, num_envs=n_colonies, lengths=(1, 1))
    rng = np.random.default_rng(1)
    crossed = np.zeros((2, n_colonies))
    for _ in range(n_ants):
        env.reset()
        first = rng.random(n_colonies) < choice_probability(*crossed, 2.0, 5.0)
        _, _, terminated, _, _ = env.step(np.where(first, 0, 1))
        assert terminated.all()
        crossed += first, ~first
    found = np.mean(crossed.max(axis=0) > 0.8 * n_ants)
    exact = majority_probability(crossing_law(n_ants, alpha=2.0, offset=5.0))
    assert abs(found - exact) < 4.4 * np.sqrt(exact * (1 - exact) / n_colonies)
