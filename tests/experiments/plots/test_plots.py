"""What figures show, on results made by formula."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from PIL import Image

from acl_gym.evaluation import actions_in
from acl_gym.experiments import plots, systems
from acl_gym.experiments.methods import restore_policy
from acl_gym.experiments.plots.looks import in_symbols, look_of
from acl_gym.experiments.results import Results
from acl_gym.experiments.study import Experiment, Study
from acl_gym.plotting.learning import steps_of
from acl_gym.plotting.style import WIDTH
from tests.experiments.plots.test_swarms import BY_PLOT as OF_SWARMS
from tests.experiments.synthetic import (
    OPTIMUM,
    TRIALS,
    make_experiment,
    make_results,
    pendulums,
)

TABLES = {name: study for name, study in pendulums().items() if name != "DQN"}


def navigations() -> dict[str, Study]:
    return {kind: systems.navigation("quadratic", kind) for kind in ("crisp", "fuzzy")}


def grids() -> dict[str, Study]:
    return {f"p = {p:g}": systems.grid_2d(p=p) for p in (0.5, 1.0)}


def rows() -> dict[str, Study]:
    return {f"M = {ants}": systems.grid_1d(ants) for ants in (1, 9)}


def two_states() -> dict[str, Study]:
    return {f"M = {ants}": systems.two_state(ants) for ants in (1, 8)}


def _rows_of_tasks() -> dict[str, Any]:
    acl, _, q, q_lambda, _ = pendulums().values()
    row = {"acl": acl, "q": q, "q-lambda": q_lambda}
    finer = {name: replace(study, cells=(10, 11)) for name, study in row.items()}
    long = replace(acl, trials=400)
    return {
        "coarse, 8 x 9": {**row, "acl-long": long},
        "fine": {**finer, "acl-long": acl},
    }


def _flat(table: dict[str, Any]) -> dict[str, Study]:
    return {f"{a}, {b}": study for a, row in table.items() for b, study in row.items()}


def _pairs() -> dict[str, Any]:
    return {
        label: (study, replace(study, reversed_slots=True))
        for label, study in list(TABLES.items())[:2]
    }


_ROWS, _PAIRS = _rows_of_tasks(), _pairs()
CASES: dict[str, tuple[dict[str, Study], str, dict[str, Any]]] = {
    "bands": (TABLES, "bands", {}),
    "returns": (rows(), "returns", {}),
    "sensitivity": (rows(), "bands", {"measure": "sensitivity", "columns": 1}),
    "measures": (grids(), "measures", {}),
    "pendulum": (TABLES, "policies", {}),
    "navigation": (navigations(), "policies", {}),
    "grid": (grids(), "policies", {}),
    "row": (rows(), "policies", {}),
    "baseline": (navigations(), "baseline", {}),
    "bands_and_policies": (dict(list(TABLES.items())[:2]), "bands_and_policies", {}),
    "swing": (dict(list(TABLES.items())[:1]), "swing", {}),
    "level_band": (two_states(), "level_band", {}),
    "policy_gap": (two_states(), "policy_gap", {}),
    "race": (pendulums(), "race", {}),
    "strips": (_flat(_ROWS), "strips", {"rows": _ROWS}),
    "sweep": (
        _flat(_ROWS),
        "sweep",
        {"rows": _ROWS, "x": (72, 110), "xlabel": "cells"},
    ),
    "order": (
        {f"{label} {i}": s for label, p in _PAIRS.items() for i, s in enumerate(p)},
        "order",
        {"pairs": _PAIRS},
    ),
    "summary": (pendulums(), "summary", {}),
    "learning_curves": (pendulums(), "learning_curves", {}),
    "policy_maps": (TABLES, "policy_maps", {}),
    "forces": (navigations(), "policy_maps", {"optimum": False}),
    "trajectories": (TABLES, "trajectories", {}),
    "paths": (navigations(), "trajectories", {}),
}


@cache
def case(name: str) -> tuple[Experiment, Results]:
    studies, plot, options = CASES[name]
    experiment = make_experiment(studies, plot, **options)
    return experiment, make_results(experiment)


@cache
def drawn(name: str) -> Figure:
    experiment, results = case(name)
    figure = plots.draw(CASES[name][1], experiment, results)
    figure.canvas.draw()  # warnings are errors: what cannot be laid out fails
    return figure


def texts(figure: Figure) -> list[str]:
    found = [text.get_text() for ax in figure.axes for text in ax.texts]
    found += [ax.get_title(loc="left") for ax in figure.axes]
    for legend in figure.legends:
        found += [text.get_text() for text in legend.get_texts()]
    return found


def lines_of(ax: Any, study: Study) -> list[Any]:
    color = look_of(study).color.lower()
    return [line for line in ax.lines if to_hex(line.get_color()) == color]


def test_every_plot_has_a_case_and_a_caption() -> None:
    cases = {plot for _, plot, _ in CASES.values()}
    assert cases | set(OF_SWARMS) == set(plots.PLOTS)
    assert set(plots.CAPTIONS) == set(plots.PLOTS)
    for caption in plots.CAPTIONS.values():
        assert caption["text"].endswith(".")
        assert caption["alt"].endswith(".")


@pytest.mark.parametrize("name", CASES)
def test_every_figure_is_drawn_under_its_title(name: str) -> None:
    figure = drawn(name)
    assert figure.get_suptitle() == r"A trial, $\rho$ = 0.1"
    assert any(ax.has_data() for ax in figure.axes)


def test_every_method_has_a_look_of_its_own() -> None:
    looks = [look_of(study) for study in pendulums().values()]
    assert len({each.color for each in looks}) == len(looks)


class TestBands:
    def test_mean_range_and_optimum(self) -> None:
        experiment, results = case("bands")
        axes = drawn("bands").axes
        for ax, study in zip(axes, experiment.studies.values(), strict=True):
            values = results.values(study)
            mean, optimum = ax.lines
            np.testing.assert_allclose(mean.get_ydata(), values.mean(axis=0))
            np.testing.assert_array_equal(mean.get_xdata(), np.arange(1, TRIALS + 1))
            assert set(optimum.get_ydata()) == {systems.PENDULUM_OPTIMUM}
            corners = ax.collections[0].get_paths()[0].vertices[:, 1]
            assert corners.min() == pytest.approx(values.min())
            assert corners.max() == pytest.approx(values.max())

    def test_another_measure_has_no_optimum(self) -> None:
        (ax, _) = drawn("sensitivity").axes
        assert len(ax.lines) == 1
        assert ax.get_yscale() == "linear"


class TestCurves:
    def test_lines_are_medians_and_bands_ranges(self) -> None:
        experiment, results = case("learning_curves")
        ax = drawn("learning_curves").axes[0]
        for study, area in zip(
            experiment.studies.values(), ax.collections, strict=True
        ):
            at, values = steps_of(
                [run.rows for run in results.runs(study)], "env_steps"
            )
            (line,) = lines_of(ax, study)
            np.testing.assert_array_equal(line.get_xdata(), at)
            np.testing.assert_array_equal(line.get_ydata(), np.median(values, axis=0))
            assert line.get_drawstyle() == "steps-post"
            corners = area.get_paths()[0].vertices[:, 1]
            assert corners.max() == pytest.approx(values.max())

    def test_the_reference_is_in_sight_and_high_costs_are_not(self) -> None:
        figure = drawn("learning_curves")
        low, high = figure.axes[0].get_ylim()
        assert low < OPTIMUM < high <= 10 * OPTIMUM
        assert texts(figure).count(" J* = 40") == 4

    def test_one_legend_names_every_method(self) -> None:
        for name in ("learning_curves", "race"):
            (legend,) = drawn(name).legends
            shown = [text.get_text() for text in legend.get_texts()]
            assert shown == list(pendulums())


class TestPolicies:
    def test_maps_show_the_reference_and_the_median_runs(self) -> None:
        experiment, results = case("policy_maps")
        axes = drawn("policy_maps").axes
        assert axes[0].get_title(loc="left") == "Optimum\nJ* = 40"
        for ax, (label, study) in zip(
            axes[1:], experiment.studies.items(), strict=True
        ):
            assert ax.get_title(loc="left") == f"{label} (seed 1)\ncost 41"
            policy = restore_policy(study, results.runs(study)[1])
            centres = np.stack(np.meshgrid(*study.make_partition().centres), axis=-1)
            env = study.task.make_system_env(72)
            actions = actions_in(policy, env, centres.reshape(-1, 2))
            mesh = ax.collections[0].get_array()
            # Every fourth point of the map is a centre; the last column closes the circle.
            np.testing.assert_array_equal(
                mesh[::4, :-1:4], actions.reshape(centres.shape[:2])
            )
            np.testing.assert_array_equal(mesh[:, 0], mesh[:, -1])

    def test_white_is_the_largest_torque(self) -> None:
        mesh = drawn("policy_maps").axes[0].collections[0]
        shades = mesh.to_rgba(np.arange(3))[:, 0]  # torques -0.8, 0 and 0.8
        np.testing.assert_allclose(shades, [0.0, 0.5, 1.0], atol=0.01)
        shown = texts(drawn("policy_maps"))
        assert shown[-4:] == ["−0.8 N m", "0 N m", "+0.8 N m", "goal"]

    def test_best_policy_known_is_no_optimum(self) -> None:
        title = drawn("forces").axes[0].get_title(loc="left")
        assert title == "Best policy known\ncost 40"

    def test_axes_in_multiples_of_pi(self) -> None:
        ax = drawn("policy_maps").axes[-1]
        ticks = zip(ax.get_xticks(), ax.get_xticklabels(), strict=True)
        shown = [tick.get_text() for at, tick in ticks if 0 <= at <= 2 * math.pi + 1e-9]
        assert shown == ["0", "π/2", "π", "3π/2", "2π"]

    def test_arrows_point_where_moves_go_and_tell_whether_they_are_best(self) -> None:
        experiment, results = case("grid")
        study = experiment.studies["p = 1"]
        system: Any = study.task.make_system_env(1).system
        ax = drawn("grid").axes[1]
        (quiver,) = [each for each in ax.collections if hasattr(each, "U")]
        starts = np.setdiff1d(np.arange(system.n_states), system.goal_states)
        policy = restore_policy(study, results.runs(study)[0])
        actions = policy.best_actions()[starts]
        moves = np.array(system.directions)[actions]
        np.testing.assert_array_equal(np.stack([quiver.V, quiver.U], axis=1), moves)
        cells = np.stack([quiver.Y, quiver.X], axis=1)
        np.testing.assert_array_equal(cells, np.array(system.cells)[starts])
        assert ax.yaxis_inverted(), "a row further is further down"
        assert {to_hex(c) for c in quiver.get_facecolors()} == {"#1a1a1a", "#d55e00"}

    def test_trajectories_tell_who_arrives(self) -> None:
        figure = drawn("trajectories")
        shown = [text.get_text() for text in figure.legends[0].get_texts()]
        assert len(shown) == 1 + len(TABLES)
        assert all(": goal at " in each or ": no goal" in each for each in shown)
        labels = [tick.get_text() for tick in figure.axes[2].get_yticklabels()]
        assert labels == ["Optimum", *TABLES]

    def test_one_swing_has_its_ending_as_a_title(self) -> None:
        figure = drawn("swing")
        assert figure.legends == []
        title = figure.axes[0].get_title(loc="left")
        assert title.startswith("ACL, fuzzy (seed 0): ")

    def test_paths_count_who_arrives(self) -> None:
        for ax in drawn("paths").axes:
            assert " of 8 times, mean cost " in ax.get_title(loc="left")


class TestDots:
    def test_each_run_beside_the_mean_with_its_interval(self) -> None:
        experiment, results = case("strips")
        ax = drawn("strips").axes[0]
        (points, *_) = lines_of(ax, experiment.options["rows"]["fine"]["q"])
        study = experiment.options["rows"]["coarse, 8 x 9"]["q"]
        np.testing.assert_array_equal(points.get_ydata(), results.last(study))
        labels = [tick.get_text() for tick in ax.get_xticklabels()]
        assert labels == ["ACL", "Q", "Q(λ)", "4 ACL"]

    def test_next_to_no_difference_is_not_made_much_of(self) -> None:
        studies = {"acl": TABLES["ACL, fuzzy"]}
        experiment = make_experiment(studies, "strips", rows={"one": studies})
        results = make_results(experiment, acl=[[40.0], [40.001]])
        low, high = plots.draw("strips", experiment, results).axes[0].get_ylim()
        assert high / low > 1.09

    def test_order_is_one_point_a_run(self) -> None:
        ax = drawn("order").axes[0]
        _, points = ax.lines
        np.testing.assert_array_equal(points.get_xdata(), points.get_ydata())
        assert len(points.get_xdata()) == 3

    def test_summary_has_medians_and_who_never_came_close(self) -> None:
        experiment = make_experiment(dict(list(TABLES.items())[:2]), "summary")
        costs = {"ACL, fuzzy": [[43.0], [90.0], [95.0]], "ACL, crisp": [[90.0]] * 3}
        figure = plots.draw("summary", experiment, make_results(experiment, **costs))
        shown = texts(figure)
        assert shown.count("1 of 3") == 4
        assert shown.count("never") == 4
        assert " J* = 40" in shown
        medians = [
            line.get_xdata()[0]
            for line in figure.axes[0].lines
            if len(line.get_xdata()) == 1
        ]
        assert sorted(medians) == [90, 90, 90, 90]
        labels = [tick.get_text() for tick in figure.axes[0].get_yticklabels()]
        assert labels == ["ACL, fuzzy", "ACL, crisp"]
        assert figure.axes[0].yaxis_inverted()


def test_one_run_with_one_evaluation() -> None:
    studies = dict(list(TABLES.items())[:1])
    experiment = make_experiment(studies, "summary", "learning_curves", "race")
    results = make_results(experiment, 1, **{"ACL, fuzzy": [[50.0]]})
    for plot in experiment.plots:
        plots.draw(plot, experiment, results).canvas.draw()


def test_files_are_named_after_the_experiment_or_the_figure(tmp_path: Path) -> None:
    experiment, results = case("bands")
    plots.save(experiment, results, tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "trial.png",
        "trial.svg",
    ]
    with Image.open(tmp_path / "trial.png") as image:
        assert image.width == round(150 * WIDTH)
    several = replace(experiment, plots=("bands", "policies"))
    names = [plots.file_name(several, plot) for plot in several.plots]
    assert names == ["bands", "policies"]


def test_a_figure_that_fails_leaves_the_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    experiment, results = case("bands")
    (tmp_path / "trial.png").write_bytes(b"old")

    def fail(experiment: Experiment, results: Results) -> Figure:
        raise RuntimeError("no ink")

    monkeypatch.setitem(plots.PLOTS, "bands", fail)
    with pytest.raises(RuntimeError, match="no ink"):
        plots.save(experiment, results, tmp_path)
    assert (tmp_path / "trial.png").read_bytes() == b"old"


def test_pyplot_is_not_touched() -> None:
    drawn("bands")
    pyplot = sys.modules.get("matplotlib.pyplot")
    assert pyplot is None or pyplot.get_fignums() == []


def test_the_animation_is_a_gif(tmp_path: Path) -> None:
    plots.write_animation(tmp_path / "learning.gif", trials=(0, 1))
    with Image.open(tmp_path / "learning.gif") as image:
        assert image.n_frames > 10


def test_in_symbols() -> None:
    assert in_symbols("gamma = 0.1, tau0") == r"$\gamma$ = 0.1, $\tau_0$"
