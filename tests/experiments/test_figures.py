import math
import sys

import numpy as np
import pytest
from matplotlib.colors import to_hex
from PIL import Image

from acl_gym.experiments import drawing, figures, statistics
from tests.experiments.factory import (
    LABELS,
    OPTIMAL_COST,
    make_comparison,
    make_run,
    make_trajectory,
)


@pytest.fixture(scope="module")
def comparison():
    return make_comparison()


@pytest.fixture(scope="module")
def drawn(comparison):
    """Every figure of the comparison, drawn once."""
    made = {
        name: draw(comparison) for name, draw in figures.figures_of(comparison).items()
    }
    for figure in made.values():
        figure.canvas.draw()
    return made


def lines_of(ax, agent):
    color = drawing.style(agent).color
    return [line for line in ax.lines if to_hex(line.get_color()) == color.lower()]


def texts(figure):
    found = [text.get_text() for ax in figure.axes for text in ax.texts]
    for ax in figure.axes:
        found += [ax.get_title(loc=side) for side in ("left", "center")]
    for legend in figure.legends:
        found += [text.get_text() for text in legend.get_texts()]
    return found


def test_every_agent_has_a_colour_of_its_own():
    colors = [drawing.style(agent).color for agent in (*LABELS, "another")]
    assert len(set(colors)) == len(colors)


class TestLearningCurves:
    def test_four_panels_with_logarithmic_axes(self, drawn):
        axes = drawn["learning_curves"].axes
        assert len(axes) == 4
        assert {ax.get_xscale() for ax in axes} == {"log"}
        assert {ax.get_yscale() for ax in axes} == {"log"}
        assert axes[2].get_xlabel() == "Environment steps"
        assert axes[3].get_xlabel() == "Wall-clock time (s)"
        assert "at the time" in axes[0].get_ylabel()
        assert "best" in axes[2].get_ylabel()

    @pytest.mark.parametrize(
        ("panel", "x", "best_so_far"),
        [
            (0, "env_steps", False),
            (1, "seconds", False),
            (2, "env_steps", True),
            (3, "seconds", True),
        ],
    )
    def test_lines_are_medians_and_bands_ranges(
        self, drawn, comparison, panel, x, best_so_far
    ):
        ax = drawn["learning_curves"].axes[panel]
        groups = statistics.by_agent(comparison["runs"])
        assert len(ax.collections) == len(groups)
        for (agent, runs), area in zip(groups.items(), ax.collections, strict=True):
            band = statistics.curve_band(runs, x, best_so_far=best_so_far)
            (line,) = lines_of(ax, agent)
            np.testing.assert_array_equal(line.get_xdata(), band.x)
            np.testing.assert_array_equal(line.get_ydata(), band.median)
            assert line.get_drawstyle() == "steps-post"
            corners = area.get_paths()[0].vertices[:, 1]
            assert corners.min() == pytest.approx(band.low.min())
            assert corners.max() == pytest.approx(band.high.max())

    def test_optimal_cost_is_a_line_with_its_name(self, drawn):
        figure = drawn["learning_curves"]
        for ax in figure.axes:
            assert any(
                np.all(np.asarray(line.get_ydata()) == OPTIMAL_COST)
                for line in ax.lines
            )
            assert ax.get_ylim()[0] < OPTIMAL_COST
        assert "J* = 40.0" in texts(figure)

    def test_one_legend_names_every_agent(self, drawn):
        (legend,) = drawn["learning_curves"].legends
        assert [text.get_text() for text in legend.get_texts()] == list(LABELS.values())


class TestPolicyMaps:
    def test_pictures_are_the_median_runs_and_the_optimum(self, drawn, comparison):
        axes = drawn["policy_maps"].axes
        runs = [
            statistics.median_run(own)
            for own in statistics.by_agent(comparison["runs"]).values()
        ]
        maps = [run["picture"]["policy_map"] for run in runs]
        maps.append(comparison["reference"]["picture"]["policy_map"])
        assert len(axes) == 8
        for ax, actions in zip(axes, maps, strict=True):
            # One more column closes the circle.
            shown = ax.collections[0].get_array().reshape(9, 9)
            np.testing.assert_array_equal(shown[:, :8], actions)
            np.testing.assert_array_equal(shown[:, 8], np.array(actions)[:, 0])
        for ax, run in zip(axes, runs, strict=False):
            assert f"{run['label']} (seed {run['seed']})" in ax.get_title()
        assert axes[-1].get_title() == "Optimum\nJ* = 40.0, on 400 × 401 cells"

    def test_axes_in_multiples_of_pi(self, drawn):
        ax = drawn["policy_maps"].axes[-1]
        ticks = zip(ax.get_xticks(), ax.get_xticklabels(), strict=True)
        shown = [tick.get_text() for at, tick in ticks if 0.0 <= at <= 2 * math.pi]
        assert shown == ["0", "π/2", "π", "3π/2", "2π"]
        assert ax.get_xlim() == (0.0, 2 * math.pi)
        assert ax.get_ylim() == (-9.0, 9.0)

    def test_goal_is_marked(self, drawn):
        for ax in drawn["policy_maps"].axes:
            (goal,) = ax.lines
            assert goal.get_xydata().tolist() == [[math.pi, 0.0]]

    def test_white_is_the_largest_torque_in_whatever_order(self, comparison):
        scene = {**comparison["scene"], "torques": [0.8, -0.8, 0.0]}
        turned = {**comparison, "scene": scene}
        mesh = figures.pendulum.policy_maps(turned).axes[-1].collections[0]
        actions = np.array(comparison["reference"]["picture"]["policy_map"])
        colors = mesh.to_rgba(mesh.get_array()).reshape(9, 9, 4)[:, :8, 0]
        for action, grey in ((0, 1.0), (1, 0.0), (2, 0.5)):
            np.testing.assert_allclose(colors[actions == action], grey, atol=0.01)

    def test_legend_of_torques(self, drawn):
        shown = texts(drawn["policy_maps"])
        assert shown[-4:] == ["−0.8 N m", "0 N m", "+0.8 N m", "goal"]


class TestTrajectories:
    def test_panels_show_the_trajectories(self, drawn, comparison):
        axes = drawn["trajectories"].axes
        assert len(axes) == 4
        for run in statistics.by_agent(comparison["runs"]).values():
            chosen = statistics.median_run(run)
            path = chosen["picture"]["trajectory"]
            for panel, key in ((0, "theta"), (1, "omega"), (3, "cost")):
                line = lines_of(axes[panel], chosen["agent"])[0]
                np.testing.assert_array_equal(line.get_xdata(), path["time"])
                np.testing.assert_array_equal(line.get_ydata(), path[key])

    def test_torques_are_steps_in_rows(self, drawn, comparison):
        ax = drawn["trajectories"].axes[2]
        rows = [label.get_text() for label in ax.get_yticklabels()]
        assert rows == ["Optimum", *LABELS.values()]
        run = statistics.median_run(comparison["runs"][:3])
        (line,) = lines_of(ax, "acl-fuzzy")
        torque = run["picture"]["trajectory"]["torque"]
        # Upwards is positive on an axis that counts rows downwards.
        np.testing.assert_allclose(
            (1 - line.get_ydata()) * 0.8 / 0.38, [*torque, torque[-1]], atol=1e-12
        )
        assert line.get_drawstyle() == "steps-post"

    def test_legend_says_who_arrives_and_when(self, drawn):
        (legend,) = drawn["trajectories"].legends
        shown = [text.get_text() for text in legend.get_texts()]
        assert shown[0] == "Optimum: goal at 1.8 s, cost 90.0"
        assert shown[1] == "ACL, fuzzy (seed 1): goal at 2.1 s, cost 90.0"
        assert shown[7] == "DQN (seed 1): no goal in 2 s, cost 90.0"

    def test_hovering_does_not_push_the_rest_aside(self, comparison):
        runs = [
            *comparison["runs"][:3],
            {
                **make_run("dqn", 0, [90.0]),
                "picture": {"trajectory": make_trajectory(steps=300, reached=False)},
            },
        ]
        axes = figures.pendulum.trajectories({**comparison, "runs": runs}).axes
        assert axes[0].get_xlim() == pytest.approx((0.0, 1.3 * 2.1))

    def test_nobody_arrives(self, comparison):
        lost = make_trajectory(steps=300, reached=False)
        picture = {"trajectory": lost}
        runs = [{**make_run("dqn", 0, [90.0]), "picture": picture}]
        reference = {**comparison["reference"], "picture": picture}
        given = {**comparison, "runs": runs, "reference": reference}
        assert figures.pendulum.trajectories(given).axes[0].get_xlim() == (0.0, 30.0)


class TestSummaryDots:
    def test_medians_and_intervals(self, drawn, comparison):
        axes = drawn["summary"].axes
        summary = statistics.summarise(comparison["runs"], OPTIMAL_COST)
        keys = (
            ("final_policy_cost", "best_policy_cost"),
            ("seconds_to_25", "seconds_to_10"),
            ("env_steps_to_25", "env_steps_to_10"),
        )
        for ax, pair in zip(axes, keys, strict=True):
            for entry in summary:
                shown = [
                    line.get_xdata().tolist() for line in lines_of(ax, entry["agent"])
                ]
                for estimate in (entry[key] for key in pair):
                    if estimate["median"] is not None:
                        assert [estimate["median"]] in shown
                        assert [estimate["low"], estimate["high"]] in shown

    def test_rows_are_agents_the_first_on_top(self, drawn):
        ax = drawn["summary"].axes[0]
        assert [label.get_text() for label in ax.get_yticklabels()] == [
            *LABELS.values()
        ]
        assert ax.yaxis_inverted()

    def test_optimal_cost_is_in_sight(self, drawn):
        figure = drawn["summary"]
        assert "J* = 40.0" in texts(figure)
        low, high = figure.axes[0].get_xlim()
        assert low < OPTIMAL_COST < high

    def test_says_who_never_came_close(self, comparison):
        runs = [
            *(make_run("dqn", i, [c]) for i, c in enumerate([43.0, 90.0, 95.0])),
            make_run("acl-crisp", 0, [90.0]),
        ]
        shown = texts(figures.common.summary_dots({**comparison, "runs": runs}))
        assert shown.count("1 of 3") == 4
        assert shown.count("never") == 4

    def test_nobody_came_close(self, comparison):
        runs = [make_run("dqn", 0, [90.0])]
        assert "never" in texts(
            figures.common.summary_dots({**comparison, "runs": runs})
        )


@pytest.mark.parametrize(
    "draw", [*figures.COMMON.values(), *figures.OF_SYSTEM["pendulum"].values()]
)
def test_one_agent_with_one_seed_and_one_evaluation(draw):
    given = make_comparison(("q-fuzzy",), seeds=1, evaluations=1)
    # Warnings are errors here: a figure that cannot be laid out fails.
    draw(given).canvas.draw()


def test_save_figures(tmp_path, monkeypatch):
    comparison = make_comparison(("acl-crisp", "q-fuzzy", "dqn"), seeds=2)
    monkeypatch.setattr(figures, "DPI", 60)
    paths = figures.save_figures(comparison, tmp_path)
    assert list(paths) == ["summary", "learning_curves", "policy_maps", "trajectories"]
    for name, path in paths.items():
        assert path == tmp_path / f"{name}.png"
        with Image.open(path) as image:
            assert image.width == round(60 * drawing.WIDTH)
    # Written under another name and renamed: nothing else is left behind.
    assert sorted(tmp_path.iterdir()) == sorted(paths.values())


def test_a_figure_that_fails_leaves_the_old_one(comparison, tmp_path, monkeypatch):
    (tmp_path / "summary.png").write_bytes(b"old")

    def fail(comparison):
        raise RuntimeError("no ink")

    monkeypatch.setitem(figures.COMMON, "summary", fail)
    with pytest.raises(RuntimeError, match="no ink"):
        figures.save_figures(comparison, tmp_path)
    assert (tmp_path / "summary.png").read_bytes() == b"old"


def test_pyplot_is_not_touched(comparison):
    figures.common.learning_curves(comparison)
    pyplot = sys.modules.get("matplotlib.pyplot")
    assert pyplot is None or pyplot.get_fignums() == []


@pytest.mark.parametrize(
    ("halves", "text"),
    [(0, "0"), (1, "π/2"), (2, "π"), (-1, "−π/2"), (-2, "−π"), (3, "3π/2"), (4, "2π")],
)
def test_as_pi(halves, text):
    assert drawing.as_pi(halves * math.pi / 2) == text
