"""Policies over tables: greedy and soft."""

from __future__ import annotations

import copy
import json
import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces

from acl_gym import (
    ACL,
    Crisp,
    Discrete,
    Fuzzy,
    PolicyEvaluation,
    VectorEnvAdapter,
    evaluate_policy_cost,
)
from acl_gym.policies import SoftPolicy, TablePolicy, random_ranks

GRID = Fuzzy([[0.0, 1.0, 2.0]])


def test_table_policy_follows_the_weighted_table() -> None:
    table = np.array([[3.0, 1.0], [0.0, 2.0], [0.0, 1.0]])
    policy = TablePolicy(GRID, table, first_action=4)
    # Between 0 and 1 the actions tie at 3 (1 - x) = 1 - x + 2 x, that is x = 1/2.
    actions, state = policy.predict([[0.49], [0.51], [2.0]], state="kept")
    assert actions.tolist() == [4, 5, 5]
    assert state == "kept"
    assert policy.predict([0.0])[0] == 4
    assert policy.best_actions().tolist() == [0, 1, 1]


def test_a_copy_no_longer_follows_the_table() -> None:
    policy = TablePolicy(GRID, np.eye(3, 2))
    kept = policy.copy()
    policy.table[:] = [[0.0, 1.0]] * 3
    assert policy.predict([0.0])[0] == 1
    assert kept.predict([0.0])[0] == 0


def test_ranks_are_permutations_of_all_orders() -> None:
    ranks = random_ranks(400, 3, np.random.default_rng(0))
    assert (np.sort(ranks, axis=1) == np.arange(3)).all()
    assert len(np.unique(ranks, axis=0)) == 6


@pytest.mark.parametrize("exponent", [1.0, 2.0, 10.0, 2.5])
def test_soft_policy_draws_from_the_distribution(exponent: float) -> None:
    """(4.11) without epsilon, in the middle between two cells."""
    levels = np.array([[1.0, 2.0, 4.0], [5.0, 4.0, 1.0], [1.0, 1.0, 1.0]])
    policy = SoftPolicy(GRID, levels, exponent, seed=1)
    n = 40_000
    drawn = np.bincount(policy.predict(np.full((n, 1), 0.25))[0], minlength=3) / n
    weights = levels**exponent
    rows = weights / weights.sum(axis=1, keepdims=True)
    expected = 0.75 * rows[0] + 0.25 * rows[1]
    np.testing.assert_allclose(drawn, expected, atol=4 * 0.5 / np.sqrt(n))


def test_soft_policy_is_seeded_and_keeps_its_own_levels() -> None:
    levels = np.ones((3, 2))
    states = np.linspace(0, 2, 50)[:, None]
    first = SoftPolicy(GRID, levels, seed=3)
    second = SoftPolicy(GRID, levels, seed=3)
    levels[:] = [[1e9, 1.0]] * 3
    drawn = first.predict(states)[0]
    assert set(drawn.tolist()) == {0, 1}
    np.testing.assert_array_equal(drawn, second.predict(states)[0])


def soft_pendulum() -> tuple[ACL, SoftPolicy]:
    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=20)
    grid = Fuzzy.from_box(env.single_observation_space, (8, 9), circular=[0])
    colony = ACL(env, grid, tau0=1e-6, seed=4).learn(trials=3)
    return colony, colony.soft_policy(exponent=2.0, seed=7)


def test_evaluations_of_a_soft_policy_are_a_function_of_its_seed() -> None:
    colony, policy = soft_pendulum()
    states = colony.partition.cell_states()
    found = []
    for other in (policy, policy, colony.soft_policy(exponent=2.0, seed=7)):
        found.append(evaluate_policy_cost(other, colony.env, max_steps=30).costs)
        other.predict(states)  # whatever is predicted in between
        other.predict(states, None, np.ones(len(states)))
    np.testing.assert_array_equal(found[0], found[1])
    np.testing.assert_array_equal(found[0], found[2])
    differs = colony.soft_policy(exponent=2.0, seed=8)
    result = evaluate_policy_cost(differs, colony.env, max_steps=30)
    assert (result.costs != found[0]).any()


def test_an_evaluation_draws_what_a_new_policy_draws_by_hand() -> None:
    """Batches may shrink on the way, as ants arrive."""
    colony, policy = soft_pendulum()
    by_hand = colony.soft_policy(exponent=2.0, seed=7)
    states, memory = colony.partition.cell_states(), None
    for step, size in enumerate((70, 70, 31, 1)):
        start = np.full(size, step == 0)
        drawn, memory = policy.predict(states[:size], memory, start)
        np.testing.assert_array_equal(drawn, by_hand.predict(states[:size])[0])


def test_stable_baselines3_evaluates_a_soft_policy_repeatably() -> None:
    evaluation = pytest.importorskip("stable_baselines3.common.evaluation")
    _, policy = soft_pendulum()
    env = VectorEnvAdapter(
        gym.make_vec(
            "acl_gym/Pendulum-v0",
            num_envs=5,
            autoreset_mode="Disabled",
            max_episode_steps=40,
        )
    )
    found = []
    for _ in range(2):
        env.seed(3)
        rewards, _ = evaluation.evaluate_policy(
            policy, env, 5, return_episode_rewards=True, warn=False
        )
        found.append(rewards)
    assert found[0] == found[1]


def test_a_soft_policy_leaves_a_cycle() -> None:
    """Asked again and again in one state it does not always answer the same."""
    policy = SoftPolicy(GRID, np.ones((3, 2)), seed=0)
    by_hand = {int(policy.predict([0.3])[0]) for _ in range(40)}
    assert by_hand == {0, 1}
    evaluated, memory = set(), None
    for step in range(40):
        actions, memory = policy.predict([[0.3]], memory, np.array([step == 0]))
        evaluated.add(int(actions[0]))
    assert evaluated == {0, 1}


@pytest.mark.parametrize("exponent", [0.0, -1.0, float("nan"), float("inf")])
def test_soft_policy_refuses_a_bad_exponent(exponent: float) -> None:
    with pytest.raises(ValueError, match="exponent"):
        SoftPolicy(GRID, np.ones((3, 2)), exponent)


def test_soft_policy_refuses_a_bad_seed() -> None:
    with pytest.raises(ValueError, match="seed must be at least 0, got -1"):
        SoftPolicy(GRID, np.ones((3, 2)), seed=-1)
    with pytest.raises(TypeError, match="seed must be an integer"):
        SoftPolicy(GRID, np.ones((3, 2)), seed=0.5)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("levels", "problem"),
    [
        (np.ones((2, 2)), r"shape \(3, n_actions\), a row .* got shape \(2, 2\)"),
        (np.ones((4, 2)), r"shape \(3, n_actions\), a row .* got shape \(4, 2\)"),
        (np.ones(3), r"shape \(3, n_actions\), a row .* got shape \(3,\)"),
        (np.ones((3, 2, 1)), r"shape \(3, n_actions\)"),
        (np.ones((3, 0)), "an array of finite real numbers"),
        (np.full((3, 2), np.nan), "an array of finite real numbers"),
        (np.full((3, 2), np.inf), "an array of finite real numbers"),
        (np.zeros((3, 2)), "all be > 0, got 0"),
        (np.array([[1.0, 1.0], [1.0, -2.0], [1.0, 1.0]]), "all be > 0, got -2"),
    ],
)
def test_soft_policy_refuses_levels_that_it_cannot_draw_from(
    levels: np.ndarray, problem: str
) -> None:
    with pytest.raises(ValueError, match=f"^levels must .*{problem}"):
        SoftPolicy(GRID, levels)


def test_colony_hands_out_a_soft_policy_and_learns_on_as_before() -> None:
    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=20)
    grid = Fuzzy.from_box(env.single_observation_space, (8, 9), circular=[0])
    plain, watched = (ACL(env, grid, tau0=1e-6, seed=4) for _ in range(2))
    evaluation = PolicyEvaluation(
        env, every=2, max_steps=20, policy=lambda colony: colony.soft_policy(seed=0)
    )
    plain.learn(trials=4)
    watched.learn(trials=4, callback=evaluation)
    np.testing.assert_array_equal(plain.table, watched.table)
    assert isinstance(evaluation.best_policy, SoftPolicy)
    assert evaluation.best is not None
    assert evaluation.best.cost == min(
        row["policy_cost"] for row in watched.history if "policy_cost" in row
    )


def test_a_table_of_nothing_finite_still_gives_actions() -> None:
    """No entry is larger than another, so any action will do, but it must be one."""
    states = np.random.default_rng(0).uniform(0, 2, (2_000, 1))
    for value in (-np.inf, np.inf):
        actions = TablePolicy(GRID, np.full((3, 4), value)).predict(states)[0]
        assert set(actions.tolist()) <= {0, 1, 2, 3}


@pytest.mark.parametrize(
    ("table", "ranks"),
    [
        (np.ones((2, 3)), None),
        (np.ones((3, 3), dtype=int), None),
        (np.ones(3), None),
        (np.ones((3, 2)), np.zeros((3, 3), dtype=np.int32)),
    ],
)
def test_a_table_that_does_not_fit_is_refused(table, ranks) -> None:
    with pytest.raises(ValueError, match=r"^(table|ranks) must"):
        TablePolicy(GRID, table, ranks)


# --- the actions of predict -------------------------------------------------------


@pytest.mark.parametrize(
    "single",
    [
        [0.3],
        (0,),
        np.array([0.3]),
        np.array([0.3], dtype=np.float32),
        np.array([0.3], dtype=">f8"),
        np.array([1], dtype=np.uint8),
    ],
    ids=repr,
)
@pytest.mark.parametrize("deterministic", [True, False])
def test_one_observation_gives_one_action_without_axes(
    single: Any, deterministic: bool
) -> None:
    policy = TablePolicy(GRID, np.arange(6.0).reshape(3, 2), first_action=4)
    action, state = policy.predict(single, deterministic=deterministic)
    assert isinstance(action, np.ndarray)
    assert (action.shape, action.dtype) == ((), np.int64)
    assert action == 5
    assert state is None
    batch, _ = policy.predict([single, single], deterministic=deterministic)
    assert type(batch) is np.ndarray
    assert (batch.shape, batch.dtype) == ((2,), np.int64)
    assert batch.tolist() == [5, 5]


@pytest.mark.parametrize("cell", [2, 2.0, np.uint8(2), np.array(2)])
def test_a_cell_as_a_number_is_one_observation(cell: Any) -> None:
    policy = TablePolicy(Discrete.from_space(spaces.Discrete(3)), np.eye(3))
    action, _ = policy.predict(cell)
    assert action.shape == ()
    assert action == 2
    assert policy.predict([cell])[0].shape == (1,)


def test_one_action_is_also_a_number() -> None:
    """Gymnasium's toy environments look actions up in a dict."""
    action = TablePolicy(GRID, np.arange(6.0).reshape(3, 2)).predict([0.3])[0]
    assert {1: "right"}[action] == "right"
    assert ["left", "right"][action] == "right"
    assert {0, 1} == {0, action}
    for other in (copy.deepcopy(action), pickle.loads(pickle.dumps(action))):
        assert hash(other) == hash(1)
        assert other == action
    assert f"{action} {action:02d} {int(action)}" == "1 01 1"
    for result, kind in (
        (action + 1, np.int64),
        (action == 1, np.bool_),
        (action / 2, np.float64),
        (np.arange(3) + action, np.ndarray),
    ):
        assert type(result) is kind
    assert json.dumps(action.item()) == json.dumps(action.tolist()) == "1"


@pytest.mark.parametrize(
    "env_id",
    ["FrozenLake-v1", "CliffWalking-v1", "Taxi-v4", "CartPole-v1", "MountainCar-v0"],
)
def test_one_action_goes_into_a_step_as_it_is(env_id: str) -> None:
    env = gym.make(env_id)
    finite = isinstance(env.observation_space, spaces.Discrete)
    if finite:
        grid: Any = Discrete.from_space(env.observation_space)
    else:
        low = np.full(env.observation_space.shape, -1.0)
        grid = Crisp.from_box(spaces.Box(low, -low, dtype=np.float64), 3)
    policy = TablePolicy(grid, np.ones((grid.n_cells, int(env.action_space.n))))
    observation, _ = env.reset(seed=0)
    action, _ = policy.predict(observation)
    assert env.action_space.contains(action)
    env.step(action)
