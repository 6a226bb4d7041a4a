"""Success that is owed to the limits of the range, at which the model stops a state."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import acl_gym
from acl_gym.design import design
from acl_gym.design.advice import advice_on_limits
from acl_gym.design.limits import Limits, measure_limits, touched_limits
from acl_gym.design.measures import measure
from acl_gym.design.simulation import simulate

STARTS = np.array([[-1.0], [-0.65], [-1.9], [0.5]])


def falling(dynamics: Any = lambda x, u: 3.0 * x + u, **changes: Any) -> Any:
    """A ball below a magnet: x(t+1) = 3 x + u, the goal 0 to within 0.2.

    The strongest input, 5.7, catches it at -1.9, the lower limit, and no more below -2.85.
    """
    settings: dict[str, Any] = {
        "low": -1.9,
        "high": 1.0,
        "inputs": [0.0, 5.7],
        "sampling_time": 0.1,
        "goal": [0.0],
        "tolerance": [0.2],
        "max_episode_steps": 10,
        "discrete_time": True,
        "state_names": ["height, m"],
        "num_envs": 1,
        **changes,
    }
    return acl_gym.plant(dynamics, **settings)


class CatchAtTheFloor:
    """Switches the magnet on at the lower limit and below, and nowhere else."""

    def predict(self, observation: Any, *, deterministic: bool = True) -> Any:
        return (observation[:, 0] <= -1.9).astype(np.int64), None


def limits_of(env: Any) -> Limits:
    found = simulate(CatchAtTheFloor(), env, STARTS, 20)
    np.testing.assert_array_equal(found.success(), [True, True, True, False])
    return measure_limits(found, CatchAtTheFloor(), env)


def test_a_ball_that_is_caught_because_it_lies_on_the_floor() -> None:
    # With the floor: -1, -1.9 (not -3), 0. Without it: -1, -3, -3.3, and further down.
    # The second start falls to -1.95 and is caught with and without the floor.
    # The third begins on the floor, which is no touch. The last rests at the upper limit.
    limits = limits_of(falling())
    assert limits.touched_rate == 0.75
    assert limits.touched_success_rate == pytest.approx(2 / 3)
    assert limits.by_variable == {"height, m": pytest.approx(2 / 3)}
    assert limits.success_rate_unlimited == 0.5
    assert limits.most == "height"
    words = limits.in_words()
    assert "66.7% of the paths to the goal touch a limit" in words
    assert "reached from 50% of the starts" in words


def test_what_becomes_infinite_has_failed_and_the_others_go_on() -> None:
    def explodes(x: Any, u: Any) -> Any:
        return np.where(np.abs(x) > 2.0, 1e308 * x, 3.0 * x + u)

    assert limits_of(falling(explodes)).success_rate_unlimited == 0.5


def test_functions_that_fail_beyond_the_limits_leave_the_rate_unknown() -> None:
    def fails(x: Any, u: Any) -> Any:
        if (x < -2.0).any():
            raise ValueError("no such height")
        return 3.0 * x + u

    limits = limits_of(falling(fails))
    assert limits.success_rate_unlimited is None
    assert limits.touched_success_rate == pytest.approx(2 / 3)


def test_circular_variables_have_no_limits_and_the_way_ends_at_the_goal() -> None:
    env = acl_gym.plant(
        lambda x, u: x + u,
        low=[-3.0, -np.pi],
        high=[3.0, np.pi],
        inputs=[[-1.0, 1.0], [0.0, 0.0]],
        sampling_time=0.1,
        goal=[0.0, 0.0],
        tolerance=[0.4, np.pi],
        circular=[1],
        max_episode_steps=10,
        discrete_time=True,
        num_envs=1,
    )

    class Down:
        def predict(self, observation: Any, *, deterministic: bool = True) -> Any:
            return np.zeros(len(observation), dtype=np.int64), None

    # From 2 through the goal at 0 on to -3, long after; from -1 it is not reached.
    found = simulate(Down(), env, np.array([[2.0, 3.0], [-1.0, 0.0]]), 20)
    assert touched_limits(found, env.system).tolist() == [[False, False], [True, False]]
    limits = measure_limits(found, Down(), env)
    assert (limits.touched_rate, limits.touched_success_rate) == (0.5, 0.0)
    assert limits.in_words() == "No path to the goal touches a limit of the range."


@pytest.mark.parametrize(
    ("touched", "unlimited", "warns"),
    [
        (0.5, 0.745, False),  # the limits are touched and do no harm
        (0.5, 0.72, True),
        (0.02, None, True),
        (0.005, None, False),
    ],
)
def test_advice_where_success_is_owed_to_the_limits(
    touched: float, unlimited: float | None, warns: bool
) -> None:
    env = falling()
    measures = measure(simulate(CatchAtTheFloor(), env, STARTS, 20), env.system)
    assert measures.success_rate == 0.75
    limits = Limits(touched, touched, {"height, m": touched}, unlimited)
    tips = advice_on_limits(limits, measures, env.system)
    assert bool(tips) == warns
    for tip in tips:
        for word in ("those of height", "low=", "initial="):
            assert word in tip


def test_a_design_that_needs_the_floor_says_so(tmp_path: Path) -> None:
    box = gym.spaces.Box(-1.9, -0.25, (1,), dtype=np.float64)
    made = design(falling(initial=box), tmp_path / "ball", seed=0, steps=3_000)
    assert made.succeeded  # in the model
    found = made.summary["limits"]
    assert found["touched_success_rate"] > 0.5
    assert found["success_rate_unlimited"] < 0.5
    (tip,) = made.advice
    assert "Unless the plant stops at the ends of its range" in tip
    page = (made.folder / "report.html").read_text()
    assert tip in page
    assert made.limits.in_words() in page
    assert "In the model, which stops the state at the ends of its range" in page


def test_a_range_that_is_wide_enough_gives_no_advice(tmp_path: Path) -> None:
    box = gym.spaces.Box(-1.95, -1.85, (1,), dtype=np.float64)
    env = falling(initial=box, low=-20.0, high=20.0)
    made = design(env, tmp_path / "ball", seed=0, steps=3_000)
    assert made.succeeded
    assert made.advice == ()
    assert made.limits.success_rate_unlimited == made.measures.success_rate
