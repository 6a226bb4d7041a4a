"""Pictures of colonies on the double bridge show what they are given."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from acl_gym.plotting import plot_branch_choice, plot_crossing_law, plot_crossings
from acl_gym.theory import crossing_law, simulate_crossings


def test_a_line_for_each_colony_and_colours_for_the_winners() -> None:
    ax = plot_crossings([[1, 8], [0, 2]], [1, 10])
    assert [line.get_ydata().tolist() for line in ax.lines] == [[1.0, 0.8], [0.0, 0.2]]
    assert ax.lines[0].get_color() != ax.lines[1].get_color()
    assert ax.get_xscale() == "log"
    assert ax.get_xlim() == (1.0, 10.0)


@pytest.mark.parametrize("bins", [10, 21, 50])
def test_the_density_of_a_law_is_one_in_all(bins: int) -> None:
    law = crossing_law(421)  # no number of crossings lies between two classes
    ax = plot_crossing_law({"2": law}, bins=bins)
    (line,) = ax.lines
    density = line.get_ydata()
    # The classes hold nearly the same number of crossings each.
    assert density.mean() == pytest.approx(1.0, abs=0.02)
    assert np.allclose(density, density[::-1]), "no branch is preferred"
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["2"]


def test_a_law_that_is_even_is_a_level_line() -> None:
    """C = 1 and alpha = 1: every number of crossings is as likely."""
    ax = plot_crossing_law({"even": crossing_law(119, 1.0, 1.0)}, bins=7)
    assert np.allclose(ax.lines[0].get_ydata(), 1.0)


def test_simulated_colonies_are_dots_beside_their_law() -> None:
    law = crossing_law(99)
    counts = simulate_crossings(99, 20_000, seed=0)
    ax = plot_crossing_law(
        {"1": crossing_law(99, 1.0), "2": law}, simulated={"2": counts}
    )
    assert len(ax.lines) == 3
    exact, dots = ax.lines[1:]
    assert exact.get_color() == dots.get_color()
    # Each of 50 classes holds 400 colonies on average; 5 standard errors.
    error = np.sqrt(exact.get_ydata() / 400) * 5 + 0.01
    assert (np.abs(dots.get_ydata() - exact.get_ydata()) < error).all()


def test_colonies_are_counted_in_fifths() -> None:
    shares = {"one": [0.0, 0.1, 0.5, 1.0], "other": [0.9]}
    ax = plot_branch_choice(shares)
    heights = [bar.get_height() for bar in ax.patches]
    assert heights == [0.5, 0.0, 0.25, 0.0, 0.25, 0.0, 0.0, 0.0, 0.0, 1.0]
    names = [label.get_text() for label in ax.get_xticklabels()]
    assert names[0] == "0\N{EN DASH}20%"
    assert names[-1] == "80\N{EN DASH}100%"


def test_they_draw_where_they_are_told() -> None:
    axes = Figure().subplots(3)
    assert plot_crossings([[1]], [2], axes[0]) is axes[0]
    assert plot_crossing_law({"": [0.5, 0.5]}, axes[1], bins=2) is axes[1]
    assert plot_branch_choice({"": [0.5]}, axes[2]) is axes[2]
    with pytest.raises(TypeError, match="ax must be Matplotlib axes"):
        plot_crossings([[1]], [2], "here")


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: plot_crossings([1, 2], [1, 2]), "a row for each colony"),
        (lambda: plot_crossings([[1, 2]], [1, 2, 3]), "a row for each colony"),
        (lambda: plot_crossings([[3]], [2]), "must not be more than the ants"),
        (lambda: plot_crossings([[-1]], [2]), "chosen must lie in"),
        (lambda: plot_crossing_law({}), "laws must name one law or more"),
        (
            lambda: plot_crossing_law({"a": [0.5, 0.5]}, simulated={"b": [1]}),
            "simulated some of them",
        ),
        (lambda: plot_crossing_law({"a": [1.0]}), "N >= 1"),
        (lambda: plot_crossing_law({"a": [0.5, 0.5]}, bins=0), "bins must be at least"),
        (
            lambda: plot_crossing_law({"a": [0.5, 0.5]}, simulated={"a": [2]}),
            "must lie in",
        ),
        (lambda: plot_branch_choice({}), "one experiment or more"),
        (lambda: plot_branch_choice({"a": [1.1]}), "must lie in"),
    ],
)
def test_what_cannot_be_drawn_is_refused(call: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        call()


@pytest.mark.parametrize(
    ("draw", "name"),
    [
        (lambda: plot_branch_choice([0.5]), "shares"),  # type: ignore[arg-type]
        (lambda: plot_crossing_law([0.5, 0.5]), "laws"),  # type: ignore[arg-type]
        (
            lambda: plot_crossing_law({"a": [0.5, 0.5]}, simulated=["a"]),  # type: ignore[arg-type]
            "simulated",
        ),
    ],
)
def test_what_has_no_names_is_refused(draw: Any, name: str) -> None:
    with pytest.raises(TypeError, match=f"{name} must be a dict from names to arrays"):
        draw()
