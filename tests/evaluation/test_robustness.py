"""Policies over the range in which the parameters of a plant lie."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from acl_gym import Fuzzy, evaluate_over_range, evaluate_policy_cost, fuzzy_q_iteration
from acl_gym.envs.wrappers.perturbations import RoundedObservation
from acl_gym.policies import TablePolicy
from tests.envs.plant.plants import UNCERTAIN, make_mass, make_uncertain

STATES = np.array([[0.0, 0.0], [1.0, 2.0], [6.0, -3.0]])


@pytest.fixture(scope="module")
def policy() -> TablePolicy:
    env = make_uncertain(num_envs=1).with_parameters(mass=0.1, damping=0.01)
    grid = Fuzzy.from_box(env.single_observation_space, (20, 21), circular=[0])
    return fuzzy_q_iteration(env, grid, max_iterations=200).policy


def test_each_plant_is_evaluated_by_itself(policy: TablePolicy) -> None:
    env = make_uncertain(num_envs=2)
    found = evaluate_over_range(policy, env, draws=7, seed=3, states=STATES)
    assert found.parameters.shape == (7, 2)
    assert found.costs.shape == found.success_rates.shape == (7,)
    for row, cost, rate in zip(
        found.parameters, found.costs, found.success_rates, strict=True
    ):
        known = env.with_parameters(mass=float(row[0]), damping=float(row[1]))
        alone = evaluate_policy_cost(policy, known, STATES)
        # Not to the bit: numbers in place of arrays round otherwise.
        assert cost == pytest.approx(alone.cost, rel=1e-9)
        assert rate == alone.success_rate
    nominal = evaluate_policy_cost(policy, env, STATES)
    assert (found.nominal.costs == nominal.costs).all()
    assert found.worst.cost == max(found.costs.max(), found.nominal.cost)
    at = list(found.worst_parameters.values())
    assert at == found.parameters[np.argmax(found.costs)].tolist()
    assert "worst=" in repr(found)


def test_all_corners_then_draws_of_the_seed(policy: TablePolicy) -> None:
    env = make_uncertain(num_envs=1)
    rows = evaluate_over_range(policy, env, draws=6, states=STATES).parameters
    corners = {(m, d) for m in UNCERTAIN["mass"] for d in UNCERTAIN["damping"]}
    assert {tuple(row) for row in rows[:4].tolist()} == corners
    low, high = np.array(list(UNCERTAIN.values())).T
    assert ((rows > low) & (rows < high))[4:].all()
    again = evaluate_over_range(policy, env, draws=6, states=STATES).parameters
    other = evaluate_over_range(policy, env, draws=6, states=STATES, seed=1).parameters
    assert (rows == again).all()
    assert (rows[4:] != other[4:]).all()
    # Too few for all corners: half of them are.
    few = evaluate_over_range(policy, env, draws=3, states=STATES).parameters
    assert np.isin(few, [low, high]).all(axis=1).tolist() == [True, False, False]


def test_batches_are_the_same(
    policy: TablePolicy, monkeypatch: pytest.MonkeyPatch
) -> None:
    env = make_uncertain(num_envs=1)
    whole = evaluate_over_range(policy, env, draws=5, states=STATES)
    monkeypatch.setattr("acl_gym.evaluation.robustness._SLOTS", 6)
    parts = evaluate_over_range(policy, env, draws=5, states=STATES)
    assert (whole.costs == parts.costs).all()


def test_other_systems_and_wrapped_ones(policy: TablePolicy) -> None:
    pendulum = gym.make_vec("acl_gym/Pendulum-v0", num_envs=2)
    # A few steps from states where no two actions are equally good: later, rounding may
    # decide between actions.
    few: Any = {"draws": 5, "states": STATES[1:], "max_steps": 10}
    own = evaluate_over_range(policy, pendulum, uncertain=UNCERTAIN, **few)
    # The same pendulum as a plant, where the parameters are drawn by slots.
    plant = evaluate_over_range(policy, make_uncertain(num_envs=1), **few)
    np.testing.assert_array_equal(own.parameters, plant.parameters)
    np.testing.assert_allclose(own.costs, plant.costs, rtol=1e-9)
    wrapped = RoundedObservation(make_uncertain(num_envs=2), [0, 0])
    same = evaluate_over_range(policy, wrapped, **few)
    np.testing.assert_array_equal(same.costs, plant.costs)


def test_the_nominal_plant_may_be_the_worst(policy: TablePolicy) -> None:
    pendulum = gym.make_vec("acl_gym/Pendulum-v0", num_envs=2).unwrapped
    heavy = pendulum.with_parameters(mass=0.2)
    found = evaluate_over_range(
        policy, heavy, draws=2, states=STATES, uncertain={"mass": (0.099, 0.101)}
    )
    assert found.worst.cost == found.nominal.cost > found.costs.max()
    assert found.worst_parameters == {"mass": 0.2}


@pytest.mark.parametrize(
    ("settings", "error", "words"),
    [
        ({"draws": 0}, ValueError, "draws must be at least 1"),
        ({"draws": 1.5}, TypeError, "draws must be an integer"),
        ({"seed": -1}, ValueError, "seed must be at least 0"),
        ({"uncertain": {}}, ValueError, "must have uncertain parameters"),
        ({"uncertain": {"length": (1.0, 2.0)}}, TypeError, "parameters of this plant"),
        ({"uncertain": {"mass": (2.0, 1.0)}}, ValueError, "low < high"),
        ({"states": 3.0}, ValueError, "states must hold one row"),
    ],
)
def test_what_is_refused(
    policy: TablePolicy, settings: Any, error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        evaluate_over_range(policy, make_uncertain(num_envs=1), **settings)


def test_environments_that_are_refused(policy: TablePolicy) -> None:
    with pytest.raises(ValueError, match="got Plant without any; pass uncertain="):
        evaluate_over_range(policy, make_mass(num_envs=1))
    with pytest.raises(ValueError, match="not wrapped, got RoundedObservation"):
        evaluate_over_range(
            policy,
            RoundedObservation(make_uncertain(num_envs=3), [0, 0]),
            uncertain=UNCERTAIN,
        )
    with pytest.raises(TypeError, match="vector environment of acl_gym"):
        evaluate_over_range(policy, gym.make_vec("CartPole-v1", num_envs=2))
    with pytest.raises(TypeError, match="model must be an agent"):
        evaluate_over_range(3, make_uncertain(num_envs=1))  # type: ignore[arg-type]
