"""What is drawn without studies and results."""

from __future__ import annotations

import math
import subprocess
import sys

import gymnasium as gym
import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_hex

from acl_gym.partitions import Fuzzy
from acl_gym.partitions.automatic import thesis_partition
from acl_gym.plotting import Shown, draw_policies, draw_trajectories, pendulum, style
from acl_gym.plotting.intervals import Interval, draw_intervals, draw_pairs
from acl_gym.plotting.learning import draw_learning_curves, steps_of
from acl_gym.plotting.style import as_pi
from acl_gym.policies import TablePolicy


def shown(env_id: str, cells: object = None) -> Shown:
    env = gym.make_vec(env_id, num_envs=2)
    partition = thesis_partition(env, cells, kind=Fuzzy)
    n_actions = int(env.unwrapped.single_action_space.n)
    table = np.random.default_rng(0).random((partition.n_cells, n_actions))
    return Shown("a", "a\ncost 1", env.unwrapped, TablePolicy(partition, table))


def log(costs: list[float], shift: float = 0.0) -> pd.DataFrame:
    at = np.arange(1.0, len(costs) + 1)
    steps = 1_000 * at + shift
    return pd.DataFrame({"env_steps": steps, "seconds": at, "policy_cost": costs})


def test_the_package_does_not_load_matplotlib() -> None:
    code = "import sys, acl_gym; sys.exit('matplotlib' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_systems_without_a_picture_are_refused() -> None:
    with pytest.raises(TypeError, match="got TwoState"):
        draw_policies([shown("acl_gym/TwoState-v0")])
    with pytest.raises(TypeError, match="trajectories are drawn of"):
        draw_trajectories([shown("acl_gym/GridSearch1D-v0")])


def test_cells_of_a_policy() -> None:
    assert pendulum.cells_of(shown("acl_gym/Pendulum-v0", (8, 9)).policy) == (8, 9)
    assert pendulum.cells_of(object()) == (40, 41)


def test_steps_begin_where_all_runs_have_a_policy() -> None:
    rows = [log([9.0, 5.0, 7.0]), log([8.0, 4.0], 14.0)]
    at, values = steps_of(rows, "env_steps")
    assert at.tolist() == [1014, 2000, 2014, 3000]
    assert values.tolist() == [[9, 5, 5, 7], [8, 8, 4, 4]]
    _, best = steps_of(rows, "env_steps", best_so_far=True)
    assert best.tolist() == [[9, 5, 5, 5], [8, 8, 4, 4]]


def test_learning_curves_on_axes_of_ones_own() -> None:
    figure = style.new_figure(2.0)
    ax = figure.subplots()
    draw_learning_curves(ax, {"ACL": [log([9.0, 5.0])]}, [{"color": "#d55e00"}])
    (line,) = ax.lines
    assert line.get_ydata().tolist() == [9.0, 5.0]
    assert to_hex(line.get_color()) == "#d55e00"
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["ACL"]


def test_an_axis_within_one_power_of_ten_has_labels() -> None:
    figure = style.new_figure(2.0)
    ax = figure.subplots()
    pair = [Interval(300.0, 200.0, 400.0), Interval(350.0, 250.0, None, "1 of 3")]
    draw_pairs(ax, [pair], ["#d55e00"], ["first", "second"])
    figure.canvas.draw()
    low, high = ax.get_xlim()
    ticks = zip(ax.get_xticks(), ax.get_xticklabels(), strict=True)
    labels = [text.get_text() for at, text in ticks if low <= at <= high]
    assert {"200", "400"} & set(labels)
    assert [text.get_text() for text in ax.texts] == ["1 of 3"]


@pytest.mark.parametrize(
    ("halves", "text"),
    [(0, "0"), (1, "π/2"), (2, "π"), (-1, "−π/2"), (-2, "−π"), (3, "3π/2"), (4, "2π")],
)
def test_as_pi(halves: int, text: str) -> None:
    assert as_pi(halves * math.pi / 2) == text


def test_an_end_that_rounding_has_put_beyond_the_value_is_drawn() -> None:
    """Equal runs: the sums of the bootstrap differ from that of the value by an ulp."""
    ax = style.new_figure(2.0).subplots()
    above = float(np.nextafter(10.28, 11.0))
    draw_intervals(ax, [0.0, 1.0], [(10.28, above, above), (2.0, 1.0, 4.0)], "o")
    (bars,) = ax.collections
    drawn = [segment[:, 1].tolist() for segment in bars.get_segments()]
    assert drawn[0] == pytest.approx([10.28, 10.28])
    assert drawn[1] == [1.0, 4.0]
