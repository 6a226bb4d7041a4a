"""What the figures of swarms show, on results made by formula."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from acl_gym.experiments import plots
from acl_gym.experiments.results import Results
from acl_gym.experiments.study import Experiment
from acl_gym.experiments.swarms.measures import least_values, size_swing
from acl_gym.experiments.thesis import chapter6
from tests.experiments.synthetic import make_results

BY_PLOT = {each.plots[0]: each for each in chapter6.EXPERIMENTS}


@cache
def drawn(plot: str) -> tuple[Experiment[Any], Results, Figure]:
    experiment = BY_PLOT[plot]
    results = make_results(experiment)
    figure = plots.draw(plot, experiment, results)
    figure.canvas.draw()  # warnings are errors: what cannot be laid out fails
    return experiment, results, figure


def points(ax: Any) -> list[Any]:
    """The runs, three of each study, in the order of the studies."""
    return [line for line in ax.lines if len(line.get_xdata()) == 3]


@pytest.mark.parametrize(
    ("plot", "panel", "measure"),
    [("centre", 0, "drift"), ("centre", 1, "rms"), ("centre", 2, "parts")],
)
def test_a_row_for_each_channel(plot: str, panel: int, measure: str) -> None:
    experiment, results, figure = drawn(plot)
    labels = [text.get_text() for text in figure.axes[0].get_yticklabels()]
    assert labels == list(experiment.studies)
    for place, (line, study) in enumerate(
        zip(points(figure.axes[panel]), experiment.studies.values(), strict=True)
    ):
        np.testing.assert_array_equal(line.get_xdata(), results.last(study, measure))
        assert (line.get_ydata() == place).all()


def test_delays_are_shown_in_percent_of_the_size() -> None:
    experiment, results, figure = drawn("delays")
    for line, study in zip(
        points(figure.axes[1]), experiment.studies.values(), strict=True
    ):
        np.testing.assert_allclose(line.get_xdata(), 100 * size_swing(results, study))
    limits = [ax.lines[-1].get_xdata()[0] for ax in figure.axes[:2]]
    assert limits == [0.01, 5.0]


def test_foraging_shows_agents_and_their_centre() -> None:
    _, results, figure = drawn("foraging")
    for ax, (profile, row) in zip(figure.axes, chapter6.FORAGING.items(), strict=True):
        assert ax.get_title(loc="left") == profile
        lines = points(ax)
        assert len(lines) == 2 * len(row)
        for k, study in enumerate(row.values()):
            for line, measure in zip(
                lines[2 * k : 2 * k + 2], ("miss", "centre_miss"), strict=True
            ):
                ends = results.last(study, measure)
                np.testing.assert_array_equal(line.get_xdata(), ends)


def test_the_optimum_and_the_median_of_each_channel() -> None:
    _, results, figure = drawn("optimum")
    for ax, (function, row) in zip(figure.axes, chapter6.SWARMS.items(), strict=True):
        assert ax.get_title(loc="left") == function
        bars = [line for line in ax.lines if len(line.get_xdata()) == 2]
        for line, bar, study in zip(points(ax), bars, row.values(), strict=True):
            values = least_values(results, study)
            np.testing.assert_array_equal(line.get_xdata(), values)
            assert set(bar.get_xdata()) == {np.median(values)}


def test_least_values_are_medians_over_the_evaluations() -> None:
    experiment, results, figure = drawn("least_values")
    (ax,) = figure.axes
    for line, study in zip(ax.lines, experiment.studies.values(), strict=True):
        np.testing.assert_array_equal(line.get_xdata(), study.curve_points())
        values = np.median(results.values(study, "value"), axis=0)
        np.testing.assert_array_equal(line.get_ydata(), values)
    (legend,) = figure.legends
    shown = [text.get_text() for text in legend.get_texts()]
    assert shown == list(experiment.studies)


def test_levels_of_both_colonies() -> None:
    experiment, results, figure = drawn("colonies")
    for ax, study in zip(figure.axes, experiment.studies.values(), strict=True):
        learned, swarm = results.runs(study)[0].table.reshape(2, -1)
        (dots,) = [line for line in ax.lines if len(line.get_xdata()) > 2]
        np.testing.assert_array_equal(dots.get_xdata(), learned)
        np.testing.assert_array_equal(dots.get_ydata(), swarm)
