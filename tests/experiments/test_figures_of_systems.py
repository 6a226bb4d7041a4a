"""Figures of the grids and of the navigation; those of the pendulum are elsewhere."""

import numpy as np
import pytest
from matplotlib.colors import to_hex

from acl_gym.experiments import drawing, figures
from acl_gym.experiments.courses import COURSES
from tests.experiments.factory import make_comparison, make_grid, make_navigation

COMPARISONS = {
    "pendulum": make_comparison,
    "navigation": make_navigation,
    "grid": make_grid,
}


@pytest.mark.parametrize("kind", COMPARISONS)
def test_every_kind_has_figures_that_can_be_drawn(kind, tmp_path, monkeypatch):
    monkeypatch.setattr(figures, "DPI", 40)
    paths = figures.save_figures(COMPARISONS[kind](), tmp_path)
    assert {"summary", "learning_curves", "policy_maps"} <= set(paths)
    assert all(path.stat().st_size > 1000 for path in paths.values())


def test_figures_of_another_system_do_not_stay(tmp_path, monkeypatch):
    monkeypatch.setattr(figures, "DPI", 30)
    figures.save_figures(make_navigation(), tmp_path)
    assert (tmp_path / "trajectories.png").exists()
    paths = figures.save_figures(make_grid(), tmp_path)
    assert sorted(tmp_path.iterdir()) == sorted(paths.values())


def test_every_course_has_figures():
    for course in COURSES.values():
        assert course.pictures in figures.OF_SYSTEM
        assert set(course.methods) <= set(drawing.STYLES)


class TestGrid:
    def test_arrows_point_where_the_moves_go_and_tell_whether_they_are_best(self):
        comparison = make_grid()
        axes = figures.grid.policy_maps(comparison).axes
        scene = comparison["scene"]
        run = comparison["runs"][0]
        (quiver,) = [each for each in axes[1].collections if hasattr(each, "U")]
        starts = [i for i in range(len(scene["cells"])) if i not in scene["goals"]]
        actions = [run["picture"]["policy_map"][i] for i in starts]
        down, right = np.array([scene["directions"][a] for a in actions]).T
        np.testing.assert_array_equal(quiver.U, right)
        np.testing.assert_array_equal(quiver.V, down)
        assert axes[1].yaxis_inverted(), "a row further is further down"
        row, column = np.array([scene["cells"][i] for i in starts]).T
        np.testing.assert_array_equal(quiver.X, column)
        np.testing.assert_array_equal(quiver.Y, row)
        best = [
            a in scene["optimal_actions"][i]
            for a, i in zip(actions, starts, strict=True)
        ]
        colors = [to_hex(color) for color in quiver.get_facecolors()]
        assert len({c for c, yes in zip(colors, best, strict=True) if yes}) <= 1
        other = {c for c, yes in zip(colors, best, strict=True) if not yes}
        assert not other & {c for c, yes in zip(colors, best, strict=True) if yes}

    def test_optimum_first_then_each_method(self):
        axes = figures.grid.policy_maps(make_grid()).axes
        titles = [ax.get_title() for ax in axes[:4]]
        assert titles[0].startswith("Optimum")
        assert [title.split(" (")[0] for title in titles[1:]] == ["ACL", "Q(λ)", "DQN"]

    def test_cells_without_an_end_are_hatched(self):
        comparison = make_grid()
        axes = figures.grid.policy_maps(comparison).axes
        for ax, lost in zip(axes[:4], (0, 0, 2, 4), strict=True):
            hatched = [patch for patch in ax.patches if patch.get_hatch()]
            assert len(hatched) == lost

    def test_a_row_is_a_strip(self):
        figure = figures.grid.policy_maps(make_grid(strip=True))
        width, height = figure.get_size_inches()
        assert height < 0.5 * width
        assert figure.axes[0].get_ylabel().startswith("Optimum")


class TestNavigation:
    def test_arrows_are_forces(self):
        comparison = make_navigation()
        axes = figures.navigation.policy_maps(comparison).axes
        assert axes[0].get_title().startswith("Best policy known")
        run = comparison["runs"][1]
        (quiver,) = [each for each in axes[2].collections if hasattr(each, "U")]
        forces = np.array(comparison["scene"]["forces"])[
            np.array(run["picture"]["policy_map"])
        ].reshape(-1, 2)
        some = forces.any(axis=1)
        np.testing.assert_array_equal(quiver.U, forces[some, 0])
        np.testing.assert_array_equal(quiver.V, forces[some, 1])
        # Rows of the map go upwards, columns to the right.
        c1, c2 = np.meshgrid(*[comparison["scene"]["positions"]] * 2)
        np.testing.assert_array_equal(quiver.X, c1.ravel()[some])
        np.testing.assert_array_equal(quiver.Y, c2.ravel()[some])

    def test_damping_is_darker_where_it_is_stronger(self):
        comparison = make_navigation()
        (image,) = figures.navigation.policy_maps(comparison).axes[0].images
        shades = image.to_rgba(image.get_array())[..., :3].mean(axis=-1)
        damping = np.array(comparison["scene"]["damping"])
        assert shades[damping.argmax() // 9, damping.argmax() % 9] == shades.min()
        assert image.origin == "lower"
        assert tuple(image.get_extent()) == (-5.0, 5.0, -5.0, 5.0)

    def test_ways_and_how_they_end(self):
        comparison = make_navigation()
        axes = figures.navigation.trajectories(comparison).axes
        assert "arrives 3 of 3 times, mean cost 50.0" in axes[0].get_title()
        assert "arrives 1 of 3 times" in axes[3].get_title()
        for ax, arrived in zip(axes, (3, 3, 2, 1), strict=True):
            markers = [line.get_marker() for line in ax.lines if line.get_marker()]
            assert markers.count("o") == arrived
            assert markers.count("x") == 3 - arrived
