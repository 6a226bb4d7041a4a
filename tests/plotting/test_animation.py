"""Films of agents that learn."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from matplotlib.animation import FuncAnimation, writers
from matplotlib.figure import Figure
from PIL import Image

from acl_gym import ACL, QLearning, ReturningACL, plant
from acl_gym.plotting import animate, scenes
from tests.plotting.agents import colony, pendulum, q_learning

LOOKS = dict.fromkeys(("axes", "slice", "labels", "actions"))
QUICK: dict[str, Any] = {"seconds": 0.4, "dpi": 40}


def pictures(path: Path) -> list[Any]:
    with Image.open(path) as film:
        frames = []
        for number in range(film.n_frames):
            film.seek(number)
            frames.append(np.asarray(film.convert("RGB"), dtype=np.int64))
    return frames


def test_a_new_agent_learns_and_a_gif_moves(tmp_path: Path) -> None:
    agent = pendulum(0)
    path = animate(agent, tmp_path / "film.gif", trials=(0, 2), **QUICK)
    assert path == tmp_path / "film.gif"
    assert agent.trials == 2
    frames = pictures(path)
    assert frames[0].shape == (110, 288, 3)  # 2.75 by 7.2 inches
    assert np.abs(frames[0] - frames[3]).max() > 50
    assert (frames[0][0] == 255).all()  # the paper is white
    assert list(tmp_path.iterdir()) == [path]


def test_a_film_does_not_change_what_is_learned(tmp_path: Path) -> None:
    filmed, plain = pendulum(0), pendulum(0)
    animate(filmed, tmp_path / "film.gif", trials=(1, 3), **QUICK)
    assert filmed.table.tolist() == plain.learn(trials=3).table.tolist()


def test_an_agent_that_has_learned_is_shown_as_it_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(scenes, "_LAST_HOLD", 0.0)  # Matplotlib draws frames slowly
    agent = pendulum(2)
    film = animate(agent, seconds=0.1, dpi=40)
    assert isinstance(film, FuncAnimation)
    assert agent.trials == 2
    html = film.to_jshtml(fps=10, default_mode="once")
    assert "<img" in html


@pytest.mark.parametrize(
    ("make", "start"),
    [
        # From the first cell this policy walks into the wall, where nothing moves.
        (lambda: q_learning("acl_gym/GridSearch2D-v0", trials=30), [40.0]),
        (lambda: colony("acl_gym/Navigation-v0"), None),
        (lambda: q_learning("MountainCar-v0"), None),
        (lambda: q_learning("FrozenLake-v1"), None),
    ],
)
def test_every_kind_of_agent_has_a_film(make: Any, start: Any, tmp_path: Path) -> None:
    path = animate(make(), tmp_path / "film.gif", start=start, **QUICK)
    assert len(pictures(path)) > 1


def test_stages_say_how_much_was_learned_from_and_what_is_shown() -> None:
    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=3)
    for kind, levels in (
        (ACL, "strongest pheromone"),
        (QLearning, "value of the best"),
    ):
        agent = kind(env, max_steps=20, seed=0)
        stages = scenes.stages_of(agent, [0, 1], 0.2, None, None, LOOKS)
        assert stages[0].title.startswith("before learning\n")
        assert stages[1].title.startswith("after 60 interactions\npolicy cost ")
        panels = Figure().subplots(1, 3)
        scenes.draw_stage(panels, stages[1])
        assert panels[1].get_title().startswith(levels)


def test_a_film_of_one_state_variable(tmp_path: Path) -> None:
    def tank(x: Any, u: Any) -> Any:
        return [u[0] - 0.5 * np.sqrt(np.maximum(x[0], 0.0))]

    agent = ACL(
        plant(
            *(tank,), low=[0], high=[4], inputs=[0, 1, 2], sampling_time=0.1, goal=[2],
            cost=([1], 0), max_episode_steps=20, num_envs=5
        ),
        seed=0,
    ).learn(trials=1)  # fmt: skip
    (stage,) = scenes.stages_of(agent, [1], 0.4, None, [0.5], LOOKS)
    panels = Figure().subplots(1, 3)
    move = scenes.draw_stage(panels, stage)
    # Lines have names, no colours to be explained by a bar.
    assert [ax.child_axes for ax in panels] == [[], [], []]
    assert [ax.get_title() for ax in panels[:2]] == ["policy", "pheromone"]
    for frame in (0, 2):
        across = [artist.get_xdata()[0] for artist in move(frame)]
        assert across == [stage.states[frame, 0]] * 4  # a line and a dot in both
    path = animate(agent, tmp_path / "film.gif", start=[0.5], **QUICK)
    assert len(pictures(path)) > 1


def test_the_name_of_a_high_bar_does_not_cover_the_title() -> None:
    agent = colony("acl_gym/Navigation-v0")  # nine actions
    looks = {**LOOKS, "axes": (0, 1)}
    (stage,) = scenes.stages_of(agent, [2], 0.4, None, None, looks)
    panels = Figure().subplots(1, 3)
    scenes.draw_stage(panels, stage)
    (bar,) = panels[0].child_axes
    assert bar.get_title() == ""
    assert "force" in bar.get_xlabel()


def test_arrows_need_no_bar() -> None:
    agent = colony("acl_gym/Navigation-v0")
    (stage,) = scenes.stages_of(agent, [2], 0.4, None, None, LOOKS)
    panels = Figure().subplots(1, 3)
    scenes.draw_stage(panels, stage)
    assert [len(ax.child_axes) for ax in panels] == [0, 1, 0]


@pytest.mark.skipif(not writers.is_available("ffmpeg"), reason="needs ffmpeg")
def test_an_mp4(tmp_path: Path) -> None:
    path = animate(pendulum(1), tmp_path / "film.mp4", **QUICK)
    assert path.stat().st_size > 1000


def test_without_ffmpeg_there_is_a_word(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(writers, "is_available", lambda name: False)
    with pytest.raises(RuntimeError, match=r"needs ffmpeg.* write 'film.gif'"):
        animate(pendulum(1), tmp_path / "film.mp4")


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"path": "film.avi"}, ValueError, r"path must end in \.gif or \.mp4"),
        ({"path": "no/such/film.gif"}, ValueError, "a folder that exists"),
        ({"path": 3}, TypeError, "path must be a path"),
        ({"path": f"{'x' * 300}.gif"}, OSError, "give another name"),
        ({"trials": 3}, TypeError, "trials must be a list of integers"),
        ({"trials": ()}, ValueError, "one integer or more, increasing"),
        ({"trials": (3, 2)}, ValueError, "one integer or more, increasing"),
        ({"trials": (0, 2)}, ValueError, r"trials\[0\] must be at least 1"),
        ({"seconds": 0}, ValueError, "seconds must lie in"),
        ({"dpi": 1e9}, ValueError, "dpi must lie in"),
    ],
)
def test_errors_say_what_is_expected(
    options: dict[str, Any], error: type[Exception], message: str
) -> None:
    agent = pendulum(1)
    with pytest.raises(error, match=message):
        animate(agent, **options)
    assert agent.trials == 1  # nothing was learned before


def test_policies_do_not_learn() -> None:
    with pytest.raises(TypeError, match="agent must be an agent that learns a table"):
        animate(pendulum().policy)


def test_a_film_without_end_is_refused() -> None:
    agent = ReturningACL(gym.make_vec("acl_gym/Pendulum-v0", 2), seed=0)
    with pytest.raises(
        ValueError, match=r"seconds must lie in \(0, 3600\], got 1e\+308"
    ):
        animate(agent, seconds=1e308)
    with pytest.raises(ValueError, match="path must be the name of a file"):
        animate(agent, "a\0.gif")
