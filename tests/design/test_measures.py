"""Measures of responses that are written down by hand, and of a plant that is simple."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import acl_gym
from acl_gym.design.advice import (
    advice,
    advice_on_model,
    fault_of_model,
    forgotten_angles,
    state_in_words,
)
from acl_gym.design.learning import Choice, Learned, Quality
from acl_gym.design.measures import measure, typical, worst
from acl_gym.design.simulation import Responses, simulate
from acl_gym.evaluation import evaluate_policy_cost
from acl_gym.policies import TablePolicy
from acl_gym.utils.text import percent


def integrator(**changes: Any) -> Any:
    """x(t+1) = x + u, goal 0 to within 0.5, ten steps of 0.1 s; the second wraps around."""
    settings: dict[str, Any] = {
        "low": [-10.0, -np.pi],
        "high": [10.0, np.pi],
        "inputs": [[-1.0, 0.0], [0.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
        "sampling_time": 0.1,
        "goal": [0.0, 0.0],
        "tolerance": [0.5, 0.5],
        "circular": [1],
        "cost": ([1.0, 0.0], 0.0),
        "max_episode_steps": 10,
        "discrete_time": True,
        "state_names": ["place, m", "angle, rad"],
        "num_envs": 1,
        **changes,
    }
    return acl_gym.plant(lambda x, u: x + u, **settings)


class Scripted:
    """Takes the actions of a list, one a step, in all slots."""

    def __init__(self, actions: list[int]) -> None:
        self.actions = iter(actions)

    def predict(self, observation: Any, *, deterministic: bool = True) -> Any:
        return np.full(len(observation), next(self.actions)), None


def respond(actions: list[int], starts: list[list[float]]) -> Responses:
    return simulate(Scripted(actions), integrator(), np.array(starts), len(actions))


def test_a_response_by_hand() -> None:
    # From 2 down to -1, back to 0 and there: in the goal from step 2, but for one step.
    actions = [0, 0, 0, 2] + [1] * 16
    found = respond(actions, [[2.0, 0.0]])
    np.testing.assert_array_equal(
        found.states[:6, 0, 0], [2.0, 1.0, 0.0, -1.0, 0.0, 0.0]
    )
    assert found.steps_to_goal().tolist() == [2]
    assert found.episode_costs().tolist() == [1.0]  # 1^2 + 0^2
    plant = integrator().system
    measures = measure(found, plant)
    assert measures.success_rate == measures.settled_rate == 1.0
    assert measures.cost.mean == measures.cost.worst == 1.0
    assert measures.time_to_goal is not None
    assert measures.time_to_goal.median == pytest.approx(0.2)
    assert measures.settling_time is not None
    assert measures.settling_time.median == pytest.approx(0.4)
    assert measures.overshoot["place, m"].worst == 1.0
    assert measures.overshoot["angle, rad"].worst == 0.0
    assert measures.remaining["place, m"].worst == 0.0
    assert measures.nearest is None
    assert measures.worst_start == measures.typical_start == (2.0, 0.0)


def test_angles_are_measured_the_short_way_round() -> None:
    # 3 rad on, then 1 rad more: 4 rad is -2.28 rad.
    found = respond([3] * 4 + [1] * 16, [[0.0, 3.0 - 2.0 * np.pi]])
    measures = measure(found, integrator().system)
    # It begins below the goal: -3.28 rad is 3 rad, and comes from there to 7 rad, 0.72.
    assert found.states[4, 0, 1] == pytest.approx(7.0 - 2.0 * np.pi)
    assert measures.remaining["angle, rad"].worst == pytest.approx(7.0 - 2.0 * np.pi)


def test_a_start_that_fails() -> None:
    # Two starts: one comes to the goal and leaves it, one comes no nearer than 2.
    found = respond([0, 0] + [2] * 8 + [1] * 10, [[2.0, 0.0], [4.0, 0.0]])
    measures = measure(found, integrator().system)
    assert measures.success_rate == 0.5
    assert measures.settled_rate == 0.0
    assert measures.settling_time is None
    assert measures.nearest == pytest.approx(2.0 / 0.5)
    assert worst(found) == 1  # although the other may cost more
    assert typical(found) == 0
    assert measures.worst_start == (4.0, 0.0)


def test_the_cost_is_that_of_the_evaluation() -> None:
    """Where the plant is not stopped at the goal, the sum is cut there."""
    env = integrator(tolerance=[2.0, np.pi])
    # Towards 0 by steps of 1 from far away, and no step from near by: so some fail.
    partition = acl_gym.Fuzzy([[-5.0, 0.0, 5.0], [0.0]], [None, None])
    policy = TablePolicy(partition, np.eye(4)[[2, 1, 0]])
    rng = np.random.default_rng(0)
    starts = env.system.sample_states(rng, 200).T.copy()
    found = simulate(policy, env, starts, 20)
    result = evaluate_policy_cost(policy, env, starts)
    np.testing.assert_allclose(found.episode_costs(), result.costs)
    np.testing.assert_array_equal(found.success(), result.success)
    assert 0.0 < result.success_rate < 1.0


def test_a_goal_that_is_a_function_has_no_distance() -> None:
    env = integrator(goal=lambda x: np.abs(x[0]) < 0.5, tolerance=None, cost="time")
    found = simulate(Scripted([0] * 20), env, np.array([[2.0, 0.0]]), 20)
    measures = measure(found, env.system)
    assert (measures.overshoot, measures.remaining) == ({}, {})
    assert measures.success_rate == 1.0


def policy(number: int) -> TablePolicy:
    return TablePolicy(acl_gym.Fuzzy([[0.0, 1.0]]), np.full((2, 2), float(number)))


def test_success_comes_first_then_cost() -> None:
    choice = Choice()
    assert choice.look_at(policy(0), Quality(9.0, 0.5, 1.0), 10)
    # Cheaper, with less success.
    assert not choice.look_at(policy(1), Quality(1.0, 0.4, 1.0), 20)
    assert choice.look_at(policy(2), Quality(10.0, 0.9, 1.0), 30)
    # As good, and cheaper.
    assert choice.look_at(policy(3), Quality(5.0, 0.89, 1.0), 40)
    # Within 1% of the last, but not of the best ever.
    assert not choice.look_at(policy(4), Quality(4.0, 0.88, 1.0), 50)
    # Kept, though it is hardly better.
    assert not choice.look_at(policy(5), Quality(4.99, 0.9, 1.0), 60)
    assert choice.interactions == 60
    assert choice.policy is not None
    assert choice.policy.table[0, 0] == 5.0


def test_what_stays_in_the_goal_is_better_than_what_is_a_little_cheaper() -> None:
    choice = Choice()
    choice.look_at(policy(0), Quality(5.0, 1.0, 0.0), 10)
    assert choice.look_at(policy(1), Quality(8.0, 1.0, 1.0), 20)
    assert not choice.look_at(policy(2), Quality(5.0, 1.0, 0.0), 30)
    assert choice.look_at(policy(3), Quality(3.0, 1.0, 0.0), 40)


RATES = st.floats(0, 1)


@given(st.lists(st.tuples(st.floats(1, 100), RATES, RATES), min_size=1, max_size=30))
def test_the_choice_never_falls_far_below_the_highest(
    seen: list[tuple[float, float, float]],
) -> None:
    choice = Choice()
    for step, each in enumerate(seen):
        choice.look_at(policy(step), Quality(*each), step)
    assert choice.best is not None
    highest = max(rate for _, rate, _ in seen)
    assert choice.best.success_rate >= highest - 0.01


def learned(ended: str) -> Learned:
    return Learned(policy(0), 100, 50, 3.0, ended, (), 5)


def test_advice_names_the_worst_start_and_what_to_try() -> None:
    plant = integrator().system
    well = measure(respond([0, 0] + [1] * 18, [[2.0, 0.0]]), plant)
    assert advice(learned("time"), well, plant) == []
    far = measure(respond([1] * 20, [[4.0, 0.0]]), plant)
    tips = " ".join(advice(learned("time"), far, plant))
    for word in ("--seconds", "inputs=", "place 4 m, angle 0 rad", "sampling_time="):
        assert word in tips
    near = measure(respond([1] * 20, [[1.0, 0.0]]), plant)
    first, *_ = advice(learned("converged"), near, plant)
    assert "tolerance=" in first
    late = measure(respond([1] * 10 + [0] * 10, [[4.0, 0.0]]), plant)
    assert (late.success_rate, late.late_rate) == (0.0, 1.0)
    first, *_ = advice(learned("converged"), late, plant)
    assert "max_episode_steps=" in first
    assert "reached later" in first


@pytest.mark.parametrize(
    ("name", "low", "high", "suspected"),
    [
        ("q", -np.pi, np.pi, True),
        ("q", 0.0, 6.28, True),
        ("q", -180.0, 180.0, True),
        ("q", -np.pi / 2, np.pi / 2, False),
        ("q", -4.0, 4.0, False),
        ("shaft angle, rad", -4.0, 4.0, True),
        ("q, rad", -4.0, 4.0, True),
        ("q, rad/s", -4.0, 4.0, False),
        ("rectangle", -4.0, 4.0, False),
        ("theta, rad", -0.5, 0.5, False),
    ],
)
def test_an_angle_that_was_not_named_in_circular_comes_first(
    name: str, low: float, high: float, suspected: bool
) -> None:
    far = {"low": [-5.0, low], "high": [5.0, high], "state_names": ["place, m", name]}
    plant = integrator(circular=[], **far).system
    failed = measure(respond([1] * 20, [[4.0, 0.0]]), plant)
    assert failed.success_rate == 0.0
    first, *_, last = advice(learned("converged"), failed, plant)
    short = name.split(", ", maxsplit=1)[0]
    assert first.startswith(f"Name {short} in circular=") == suspected
    assert ("Name the angles" in last) != suspected
    assert forgotten_angles(integrator(circular=[1], **far).system) == []


def model(unsure: float, *errors: float) -> dict[str, Any]:
    return {
        "steps": 300,
        "doubts": [],
        "errors": dict(zip(("place", "speed"), errors, strict=True)),
        "spread": {"limit": 0.5, "unsure": unsure},
    }


def test_a_model_has_a_fault_where_it_is_unsure_or_predicts_nothing() -> None:
    assert fault_of_model(None) is None
    assert fault_of_model(model(0.2, 0.7, 0.1)) is None
    fault = fault_of_model(model(0.999, 0.7, 0.1))
    assert fault is not None
    assert "unsure (spread above 0.5) on the way from 99.9% of the starts" in fault
    fault = fault_of_model(model(0.0, 0.1, 0.98))
    assert fault is not None
    assert "does not predict speed: its error in cross-validation is 0.98" in fault
    tips = " ".join(advice_on_model(model(0.999, 0.7, 0.1)))
    assert "--circular" in tips
    assert "Record more than these 300 steps" in tips


def test_words_and_percents() -> None:
    assert (
        state_in_words((1.0, -2.5), integrator().system) == "place 1 m, angle -2.5 rad"
    )
    shown = [percent(share) for share in (0.0, 1e-5, 0.5, 0.9999, 1.0)]
    assert shown == ["0%", "0.1%", "50%", "99.9%", "100%"]
