"""Value iteration and the exact value of a policy, on values known in closed form."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import SyncVectorEnv
from hypothesis import given, settings
from hypothesis import strategies as st

from acl_gym.planning import value_iteration as module
from acl_gym.planning.model import TabularModel
from acl_gym.planning.value_iteration import policy_value, value_iteration
from tests.planning.chains import Table, TableEnv, corridor, model, vector

# --- closed forms --------------------------------------------------------------


@pytest.mark.parametrize("length", [2, 3, 20])
def test_the_chain_costs_its_length(length: int) -> None:
    found = value_iteration(model(corridor(length)))
    np.testing.assert_array_equal(found.values, np.arange(length) - length + 1.0)
    np.testing.assert_array_equal(found.action_values[:, 0], found.values)
    assert found.change == 0.0


@pytest.mark.parametrize("discount", [0.0, 0.5, 0.9])
def test_discounted_values_are_geometric_sums(discount: float) -> None:
    found = value_iteration(model(corridor(9)), discount=discount)
    steps = 8 - np.arange(9)
    expected = [-sum(discount**i for i in range(n)) for n in steps]
    np.testing.assert_allclose(found.values, expected, rtol=1e-12)


@pytest.mark.parametrize("success", [0.5, 0.9])
def test_moves_that_fail_cost_distance_over_p(success: float) -> None:
    table = corridor(8, success=success)
    found = value_iteration(table_model := model(table), tolerance=1e-13)
    expected = -(7 - np.arange(8)) / success
    np.testing.assert_allclose(found.values, expected, rtol=1e-10)
    np.testing.assert_allclose(
        policy_value(table_model, np.zeros(8, dtype=int)), expected, rtol=1e-12
    )


@pytest.mark.parametrize(("jump", "first", "cost"), [(5, 1, 4), (1, 0, 8)])
def test_a_shortcut_is_taken_where_it_is_one(jump: int, first: int, cost: int) -> None:
    """From cell 0 of 9, action 1 jumps; a jump by 1 is tied, and the first wins."""
    found = value_iteration(model(corridor(9, jump=jump)))
    assert found.values[0] == -cost
    assert found.actions.tolist() == [first] + [0] * 8


def test_a_discount_that_never_settles_is_reported() -> None:
    wall: Table = {0: {0: [(1.0, 0, -1.0, False)]}, 1: {0: [(1.0, 1, 0.0, True)]}}
    found = value_iteration(model(wall), max_iterations=50)
    assert (found.iterations, found.change) == (50, 1.0)
    assert found.values.tolist() == [-50.0, 0.0]
    settled = value_iteration(model(wall), discount=0.9, tolerance=1e-12)
    assert settled.values[0] == pytest.approx(-10.0, rel=1e-9)


def test_to_stand_still_is_no_way_to_a_reward() -> None:
    """A goal worth 1, nothing costs: every action of the best is worth 1.

    Action 0 stands still, action 1 goes on: values tie, and only one ever ends.
    """
    table: Table = {
        q: {
            0: [(1.0, q, 0.0, False)],
            1: [(0.2, q + 1, float(q == 2), q == 2), (0.8, q, 0.0, False)],
        }
        for q in range(3)
    }
    table[3] = {u: [(1.0, 3, 0.0, True)] for u in range(2)}
    found = value_iteration(model(table), tolerance=1e-12)
    np.testing.assert_allclose(found.values, [1, 1, 1, 0], rtol=1e-9)
    assert found.actions.tolist() == [1, 1, 1, 0]
    np.testing.assert_allclose(policy_value(model(table), found.actions), [1, 1, 1, 0])
    np.testing.assert_array_equal(policy_value(model(table), [0, 0, 0, 0]), np.zeros(4))


# --- random models -------------------------------------------------------------


@st.composite
def random_models(draw: st.DrawFn, ending: bool = True) -> TabularModel:
    """Every action ends the episode with a probability of 1% or more, if `ending`.

    With 1e-5, which chance draws now and then, 100,000 sweeps do not reach the tolerance.
    """
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1), label="seed"))
    shape = (
        draw(st.integers(1, 7), label="states"),
        draw(st.integers(1, 3), label="actions"),
        draw(st.integers(1, 3), label="outcomes") + ending,
    )
    probability = rng.dirichlet(np.ones(shape[2]), size=shape[:2])
    if ending:
        probability = 0.99 * probability
        probability[..., 0] += 0.01
    terminated = rng.random(shape) < 0.2
    terminated[..., 0] |= ending
    next_state = rng.integers(shape[0], size=shape)
    return TabularModel(probability, next_state, rng.normal(size=shape), terminated)


@given(random_models(), st.sampled_from([0.0, 0.9, 1.0]))
@settings(max_examples=40)
def test_values_solve_the_bellman_equation(case: TabularModel, discount: float) -> None:
    """(3.39), and the policy is worth what value iteration says: (3.38) = (3.42)."""
    found = value_iteration(case, discount=discount, tolerance=1e-13)
    q = np.zeros((case.n_states, case.n_actions))
    for s, u, i in np.ndindex(case.probability.shape):
        after = (
            0.0 if case.terminated[s, u, i] else found.values[case.next_state[s, u, i]]
        )
        q[s, u] += case.probability[s, u, i] * (case.reward[s, u, i] + discount * after)
    np.testing.assert_allclose(found.action_values, q, atol=1e-9)
    np.testing.assert_allclose(found.values, q.max(axis=1), atol=1e-9)
    values = policy_value(case, found.actions, discount)
    np.testing.assert_allclose(values, found.values, atol=1e-8)


@given(random_models(), st.integers(0, 2**32 - 1), st.sampled_from([0.5, 1.0]))
@settings(max_examples=40)
def test_policy_values_are_sums_over_time(
    case: TabularModel, seed: int, discount: float
) -> None:
    """A policy of any kind, against long sums of expected rewards."""
    n = case.n_states
    actions = np.random.default_rng(seed).integers(case.n_actions, size=n)
    chain, reward = np.zeros((n, n)), np.zeros(n)
    for s, u in enumerate(actions):
        for i, p in enumerate(case.probability[s, u]):
            reward[s] += p * case.reward[s, u, i]
            if not case.terminated[s, u, i]:
                chain[s, case.next_state[s, u, i]] += p
    # I + A + A^2 + ... = (I + A) (I + A^2) (I + A^4) ...
    power, total = discount * chain, np.eye(n)
    for _ in range(40):
        total = total + power @ total
        power = power @ power
    expected = total @ reward
    np.testing.assert_allclose(
        policy_value(case, actions, discount), expected, rtol=1e-5, atol=1e-5
    )


@given(random_models(), st.data())
@settings(max_examples=20)
def test_kernels_equal_their_python(case: TabularModel, data: st.DataObject) -> None:
    arrays = (case.probability, case.next_state, case.reward, case.terminated)
    compiled, plain = np.zeros((2, case.n_states))
    for _ in range(3):
        a = module._sweep(*arrays, 0.9, compiled)
        b = module._sweep.py_func(*arrays, 0.9, plain)
        assert a == pytest.approx(b, rel=1e-12)
    np.testing.assert_allclose(compiled, plain, rtol=1e-12)
    np.testing.assert_allclose(
        module._action_values(*arrays, 0.9, compiled),
        module._action_values.py_func(*arrays, 0.9, compiled),
        rtol=1e-12,
    )
    rng = np.random.default_rng(data.draw(st.integers(0, 99)))
    tied = rng.random(case.probability.shape[:2]) < 0.6
    tied[:, 0] |= ~tied.any(axis=1)
    nearest = (
        case.probability,
        case.next_state,
        case.terminated & (rng.random() < 0.5),
    )
    actions = module._nearest_to_an_end(*nearest, tied)
    np.testing.assert_array_equal(
        actions, module._nearest_to_an_end.py_func(*nearest, tied)
    )
    assert tied[np.arange(case.n_states), actions].all()


# --- policies that never end ---------------------------------------------------


def rows(*outcomes: list[tuple[float, int, float, bool]]) -> TabularModel:
    """A model of one action: the outcomes of each state."""
    return model({state: {0: listed} for state, listed in enumerate(outcomes)})


END = [(1.0, 0, -1.0, True)]


@pytest.mark.parametrize(
    ("states", "expected"),
    [
        # 1 stands still forever at a cost; 2 may come to it, 3 cannot.
        (
            [
                END,
                [(1.0, 1, -1.0, False)],
                [(0.5, 0, -1.0, False), (0.5, 1, -1.0, False)],
                [(1.0, 0, -1.0, False)],
            ],
            [-1, -np.inf, -np.inf, -2],
        ),
        # Standing still costs nothing: worth 0, as an end.
        ([END, [(1.0, 1, 0.0, False)], [(1.0, 1, -3.0, False)]], [-1, 0, -3]),
        # A cycle of two that pays in one of its states.
        ([END, [(1.0, 2, 0.0, False)], [(1.0, 1, 2.0, False)]], [-1, np.inf, np.inf]),
        # A cycle that may be left is no cycle: 1 / 0.25 steps, and then one more.
        ([END, [(0.75, 1, -1.0, False), (0.25, 0, -1.0, False)]], [-1, -5]),
        # An end of probability 0 is no end.
        ([END, [(1.0, 1, -1.0, False), (0.0, 0, -1.0, True)]], [-1, -np.inf]),
    ],
)
def test_policies_that_never_end(states: Any, expected: list[float]) -> None:
    case = rows(*states)
    actions = np.zeros(len(states), dtype=int)
    np.testing.assert_allclose(policy_value(case, actions), expected, rtol=1e-12)
    assert np.isfinite(policy_value(case, actions, discount=0.99)).all()


@pytest.mark.parametrize(
    "states",
    [
        [[(1.0, 1, 1.0, False)], [(1.0, 0, -1.0, False)]],
        [
            [(1.0, 0, 1.0, False)],
            [(1.0, 1, -1.0, False)],
            [(0.5, 0, 0.0, False), (0.5, 1, 0.0, False)],
        ],
    ],
    ids=["in one cycle", "in two"],
)
def test_endless_costs_and_rewards_have_no_sum(states: Any) -> None:
    with pytest.raises(ValueError, match="both endless costs and endless rewards"):
        policy_value(rows(*states), np.zeros(len(states), dtype=int))
    assert np.isfinite(
        policy_value(rows(*states), np.zeros(len(states), int), 0.9)
    ).all()


# --- Gymnasium's own -----------------------------------------------------------


def test_frozen_lake() -> None:
    """Undiscounted, the values are probabilities to get across: 14 / 17 at best."""
    found = value_iteration(gym.make("FrozenLake-v1"))
    assert found.values[0] == pytest.approx(14 / 17, abs=1e-7)
    exact = policy_value(gym.make("FrozenLake-v1"), found.actions)
    assert exact[0] == pytest.approx(14 / 17, rel=1e-12)
    firm = gym.make("FrozenLake-v1", is_slippery=False)
    found = value_iteration(firm)
    assert found.values[0] == 1.0
    np.testing.assert_array_equal(policy_value(firm, found.actions), found.values)


def test_cliff_walking() -> None:
    env = gym.make("CliffWalking-v1")
    found = value_iteration(env)
    assert found.values[36] == -13.0
    np.testing.assert_array_equal(policy_value(env, found.actions), found.values)


def test_taxi() -> None:
    """Also as the first of a vector environment, behind wrappers."""
    single = gym.make("Taxi-v4")
    starts = single.unwrapped.initial_state_distrib
    assert (starts > 0).sum() == 300
    for env in (single, gym.make_vec("Taxi-v4", num_envs=2, vectorization_mode="sync")):
        found = value_iteration(env)
        assert starts @ found.values == pytest.approx(7.93, rel=1e-12)


def test_the_policy_walks_as_well_as_its_values_say() -> None:
    env = gym.make("CliffWalking-v1")
    policy = value_iteration(env).policy
    state, _ = env.reset(seed=0)
    total, terminated = 0.0, False
    while not terminated:
        state, reward, terminated, _, _ = env.step(int(policy.predict(state)[0]))
        total += float(reward)
    assert total == -13.0


def test_the_policy_takes_the_actions_found() -> None:
    """Also where others tie with them, and where spaces do not begin at 0."""
    lake = TabularModel.from_env(gym.make("FrozenLake-v1", is_slippery=False))
    arrays = (lake.probability, lake.next_state, lake.reward, lake.terminated)
    found = value_iteration(TabularModel(*arrays, first_state=5, first_action=2))
    assert (found.action_values[0] == 1.0).sum() > 1
    np.testing.assert_array_equal(found.policy.best_actions(), found.actions)
    actions, _ = found.policy.predict(np.arange(5, 21))
    np.testing.assert_array_equal(actions, found.actions + 2)


# --- models --------------------------------------------------------------------


def test_models_of_this_package_are_those_of_the_system() -> None:
    """Any environment whose system has `outcomes()`, single or vector."""
    built = model(corridor(4, success=0.5))
    arrays = (built.probability, built.next_state, built.reward, built.terminated)
    for kind in (gym.Env, gym.vector.VectorEnv):
        env: Any = kind()
        env.system = SimpleNamespace(outcomes=lambda: arrays)
        env.single_observation_space = gym.spaces.Discrete(4, start=3)
        env.single_action_space = gym.spaces.Discrete(1, start=7)
        env.observation_space = env.single_observation_space
        env.action_space = env.single_action_space
        read = TabularModel.from_env(env)
        assert (read.first_state, read.first_action) == (3, 7)
        for name in ("probability", "next_state", "reward", "terminated"):
            np.testing.assert_array_equal(getattr(read, name), getattr(built, name))


def test_tables_are_padded_by_outcomes_that_never_happen() -> None:
    read = model(corridor(3, success=0.8))
    assert read.probability.tolist() == [
        [[0.8, 1 - 0.8]],
        [[0.8, 1 - 0.8]],
        [[1.0, 0.0]],
    ]
    assert (read.n_states, read.n_actions) == (3, 1)
    same = TabularModel.from_env(vector(corridor(3, success=0.8), 2))
    np.testing.assert_array_equal(same.probability, read.probability)


@pytest.mark.parametrize("env_id", ["CartPole-v1", "acl_gym/Pendulum-v0"])
def test_environments_that_tell_no_model(env_id: str) -> None:
    single = gym.make(env_id)
    for env in (single, SyncVectorEnv([lambda: gym.make(env_id)])):
        for ask in (
            TabularModel.from_env,
            value_iteration,
            lambda e: policy_value(e, [0]),
        ):
            with pytest.raises(TypeError, match=r"publish its model, .* learn with"):
                ask(env)
    with pytest.raises(TypeError, match=r"publish its model, .*got str"):
        TabularModel.from_env("FrozenLake-v1")  # type: ignore[arg-type]


GOOD: dict[str, Any] = {
    "probability": [[[0.5, 0.5]], [[1.0, 0.0]]],
    "next_state": [[[0, 1]], [[1, 1]]],
    "reward": [[[-1.0, -1.0]], [[0.0, 0.0]]],
    "terminated": [[[False, True]], [[True, True]]],
}


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("probability", [[[0.5, 0.4]], [[1, 0]]], r"sum to 1 .* action 0 in state 0"),
        ("probability", [[[0.5, 0.5]], [[2, -1]]], r">= 0 .* action 0 in state 1"),
        ("probability", [[[0.5, np.nan]], [[1, 0]]], "probability must be an array"),
        ("probability", [[0.5, 0.5], [1, 0]], "probability must be an array of 3"),
        ("next_state", [[[0, 2]], [[1, 1]]], r"lie in 0\.\.1, got 0 to 2"),
        ("next_state", [[[0, -1]], [[1, 1]]], r"lie in 0\.\.1, got -1 to 1"),
        ("next_state", [[[0.0, 1.0]], [[1.0, 1.0]]], "next_state must hold integers"),
        ("reward", [[[-1, np.inf]], [[0, 0]]], "reward must be an array"),
        ("reward", [[[-1]], [[0]]], "reward must have the shape of probability"),
        ("terminated", [[[0, 1]], [[1, 1]]], "terminated must hold bools"),
    ],
)
def test_bad_models(name: str, value: Any, message: str) -> None:
    TabularModel(**GOOD)
    with pytest.raises(ValueError, match=message):
        TabularModel(**{**GOOD, name: value})


def test_a_model_cannot_be_changed_from_outside() -> None:
    arrays = {name: np.array(value) for name, value in GOOD.items()}
    kept = TabularModel(**arrays)
    arrays["next_state"][:] = 99
    assert kept.next_state.max() == 1
    with pytest.raises(ValueError, match="read-only"):
        kept.reward[:] = 0


@pytest.mark.parametrize("keys", [{1: {0: []}}, {0: {1: []}}, {0: {0: []}, 1: {}}])
def test_bad_tables(keys: Any) -> None:
    env = TableEnv(corridor(3))
    env.P = keys
    with pytest.raises(ValueError, match="P must have the keys"):
        TabularModel.from_env(env)


@pytest.mark.parametrize(
    ("name", "value"),
    [("discount", 1.1), ("discount", -0.1), ("tolerance", 0.0), ("max_iterations", 0)],
)
def test_bad_parameters(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=name):
        value_iteration(model(corridor(3)), **{name: value})


@pytest.mark.parametrize("actions", [[0, 0], [0, 0, 1], [0, 0, -1], [0.0, 0.0, 0.0]])
def test_bad_policies(actions: Any) -> None:
    with pytest.raises(ValueError, match="policy_actions must"):
        policy_value(model(corridor(3)), actions)
    with pytest.raises(ValueError, match="discount"):
        policy_value(model(corridor(3)), [0, 0, 0], discount=2)


def test_values_that_overflow_are_refused() -> None:
    wall: Table = {0: {0: [(1.0, 0, -1e308, False)]}, 1: {0: [(1.0, 1, 0.0, True)]}}
    with pytest.raises(ValueError, match="must stay finite"):
        value_iteration(model(wall))
