"""Learning curves from agents and histories."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from acl_gym.plotting import plot_learning_curve
from tests.plotting.agents import pendulum


def history(costs: list[float], name: str = "ants_cost") -> list[dict[str, float]]:
    return [
        {"trial": i + 1, "env_steps": 100 * (i + 1), "seconds": i + 1.0, name: cost}
        for i, cost in enumerate(costs)
    ]


def test_an_agent_its_history_and_a_frame_give_the_same_curve() -> None:
    agent = pendulum(3)
    runs = [agent, agent.history, pd.DataFrame(agent.history)]
    curves = [plot_learning_curve(run).lines[0] for run in runs]
    expected = [row["ants_cost"] for row in agent.history]
    for curve in curves:
        assert curve.get_ydata().tolist() == expected
        steps = [row["env_steps"] for row in agent.history]
        assert curve.get_xdata().tolist() == steps


def test_several_runs_are_a_median_with_a_band() -> None:
    runs = [history([4.0, 2.0]), history([6.0, 1.0]), history([5.0, 3.0])]
    ax = plot_learning_curve(runs, x="trial")
    assert ax.lines[0].get_ydata().tolist() == [5.0, 2.0]
    (band,) = ax.collections
    heights = band.get_paths()[0].vertices[:, 1]
    assert (heights.min(), heights.max()) == (1.0, 6.0)
    assert "median of 3 runs" in ax.get_title(loc="left")


def test_names_make_a_legend() -> None:
    ax = plot_learning_curve({"a": history([4.0]), "b": [history([3.0])]})
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["a", "b"]


def test_the_best_so_far_is_the_lowest_cost_and_the_highest_return() -> None:
    low = plot_learning_curve(history([4.0, 5.0, 3.0]), best_so_far=True)
    assert low.lines[0].get_ydata().tolist() == [4.0, 4.0, 3.0]
    rows = history([1.0, 0.5, 2.0], "ants_return")
    high = plot_learning_curve(rows, best_so_far=True)
    assert high.lines[0].get_ydata().tolist() == [1.0, 1.0, 2.0]


def test_returns_are_preferred_and_policies_to_ants() -> None:
    rows = history([4.0, 3.0])
    assert plot_learning_curve(rows).get_ylabel() == "mean cost of the ants"
    for row in rows:
        row["ants_return"] = -row["ants_cost"]
    assert plot_learning_curve(rows).get_ylabel() == "mean return of the ants"
    rows[1]["policy_return"] = -1.0  # evaluated in the second trial only
    ax = plot_learning_curve(rows)
    assert ax.get_ylabel() == "return of the policy"
    assert ax.lines[0].get_xdata().tolist() == [200]


def test_a_wide_range_of_costs_is_logarithmic() -> None:
    assert plot_learning_curve(history([100.0, 10.0])).get_yscale() == "log"
    assert plot_learning_curve(history([12.0, 10.0])).get_yscale() == "linear"


@pytest.mark.parametrize(
    ("runs", "options", "error", "message"),
    [
        (3, {}, TypeError, "runs must be agents or their histories"),
        ([3], {}, TypeError, "runs must be agents or their histories"),
        ("history", {}, TypeError, "runs must be agents or their histories"),
        ([], {}, ValueError, "got an empty history; call learn first"),
        ({}, {}, ValueError, "one curve or more"),
        (history([1.0]), {"x": "time"}, ValueError, "x must be one of"),
        (history([1.0]), {"y": "policy_cost"}, ValueError, "pass a PolicyEvaluation"),
        (history([1.0]), {"ax": 1}, TypeError, "ax must be Matplotlib axes"),
        ([{"ants_cost": 1.0}], {}, ValueError, "must have the column 'env_steps'"),
    ],
)
def test_errors_say_what_is_expected(
    runs: Any, options: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        plot_learning_curve(runs, **options)


def test_runs_that_know_a_value_from_different_steps_on() -> None:
    late = [{**row, "env_steps": row["env_steps"] + 50} for row in history([8.0, 2.0])]
    ax = plot_learning_curve([history([4.0, 2.0]), late])
    x, y = ax.lines[0].get_data()
    assert np.asarray(x).tolist() == [150, 200, 250]
    assert np.asarray(y).tolist() == [6.0, 5.0, 2.0]


@pytest.mark.parametrize(
    ("row", "x", "message"),
    [
        (
            {"env_steps": 0, "policy_cost": 1.0},
            "env_steps",
            r"greater than 0 .* \[\[0\]\]",
        ),
        (
            {"seconds": 0.0, "policy_cost": 1.0},
            "seconds",
            "must be greater than 0 where",
        ),
        (
            {"env_steps": 1, "policy_cost": "a"},
            "env_steps",
            r"'policy_cost', got \['a'\]",
        ),
        ({"env_steps": "a", "policy_cost": 1.0}, "env_steps", "numbers in the column"),
    ],
)
def test_histories_that_cannot_be_drawn_are_refused(
    row: dict[str, Any], x: str, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        plot_learning_curve([row], x=x)
