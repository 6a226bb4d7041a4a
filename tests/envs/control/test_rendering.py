"""Frames of all systems, and of the pendulum, single and vector, without a screen."""

from __future__ import annotations

import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import DependencyNotInstalled, ResetNeeded
from gymnasium.utils.env_checker import check_env

from acl_gym.envs.pendulum import PendulumEnv, PendulumVectorEnv
from tests.envs.systems import SystemCase

ID = "acl_gym/Pendulum-v0"
POLE = np.array([0, 114, 178])
TORQUE = np.array([213, 94, 0])


def pixels(frame: np.ndarray, colour: np.ndarray) -> np.ndarray:
    """Rows and columns of the pixels that are nearly of a colour, `(n, 2)`."""
    near = (np.abs(frame.astype(int) - colour) < 20).all(axis=-1)
    return np.argwhere(near)


def frame_at(theta: float, action: int | None = None) -> np.ndarray:
    env = gym.make(ID, render_mode="rgb_array")
    env.reset(options={"state": [theta, 0.0]})
    if action is not None:
        env.step(action)
    return env.render()


@pytest.mark.parametrize(
    ("theta", "row", "column"),
    [(0.0, 1, 0), (np.pi / 2, 0, 1), (np.pi, -1, 0), (3 * np.pi / 2, 0, -1)],
)
def test_the_pole_points_where_the_angle_says(theta, row, column) -> None:
    frame = frame_at(theta)
    assert frame.shape == (480, 480, 3)
    assert frame.dtype == np.uint8
    centre = pixels(frame, POLE).mean(axis=0) - 240
    np.testing.assert_allclose(centre, [row * 120, column * 120], atol=25)


def test_the_torque_is_drawn_on_the_side_it_turns_to() -> None:
    assert len(pixels(frame_at(0.0), TORQUE)) == 0
    assert len(pixels(frame_at(0.0, action=1), TORQUE)) == 0
    left, right = frame_at(0.0, action=2), frame_at(0.0, action=0)
    # The arc runs over the pivot; its head is the heavier end.
    assert pixels(left, TORQUE)[:, 1].mean() < 239 < pixels(right, TORQUE)[:, 1].mean()


def test_vector_frames_are_those_of_single_environments(case: SystemCase) -> None:
    env = gym.make_vec(case.env_id, num_envs=2, render_mode="rgb_array", **case.easy)
    env.reset(seed=1)
    states = env.unwrapped.states
    env.step([0, 1])
    frames = env.render()
    assert isinstance(frames, tuple)
    for state, action, frame in zip(states, [0, 1], frames, strict=True):
        single = gym.make(case.env_id, render_mode="rgb_array", **case.easy)
        single.reset(options={"state": state})
        single.step(action)
        assert frame.shape == (480, 480, 3)
        assert frame.dtype == np.uint8
        np.testing.assert_array_equal(frame, single.render())


def test_frames_are_new_arrays(case: SystemCase) -> None:
    env = gym.make(case.env_id, render_mode="rgb_array")
    env.reset(seed=0)
    first = env.render()
    first[:] = 0
    assert env.render().any()


def test_a_window_opens_and_closes(case: SystemCase) -> None:
    env = gym.make(case.env_id, render_mode="human")
    env.reset(seed=0)
    env.step(0)
    env.close()
    env.close()


def test_checked_by_gymnasium(case: SystemCase) -> None:
    env = gym.make(case.env_id, render_mode="rgb_array").unwrapped
    env.action_space.seed(0)  # where an action may not be allowed
    check_env(env)


def test_recorded_by_gymnasium(case: SystemCase) -> None:
    env = gym.make(case.env_id, render_mode="rgb_array", **case.narrow)
    env = gym.wrappers.RenderCollection(env)
    env.reset(options={"state": case.away})
    for action in (0, 0) if case.takes_any_action else (1, 2):
        env.step(action)
    assert len(env.render()) == 3


def test_an_unknown_mode_is_refused(case: SystemCase) -> None:
    for kind in (case.single, case.vector):
        with pytest.raises(ValueError, match="render_mode must be None or one of"):
            kind(render_mode="ansi")


@pytest.mark.parametrize("make", [gym.make, gym.make_vec])
def test_mistakes(case: SystemCase, make) -> None:
    env = make(case.env_id)
    env.reset(seed=0)
    with pytest.warns(UserWarning, match="render"):
        env.unwrapped.render()
    with pytest.raises(ResetNeeded):
        make(case.env_id, render_mode="rgb_array").unwrapped.render()


def test_without_pygame_the_error_says_what_to_install(case, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)
    env = gym.make(case.env_id, render_mode="rgb_array").unwrapped
    env.reset(seed=0)
    with pytest.raises(DependencyNotInstalled, match=r"acl-gym\[render\]"):
        env.render()


@pytest.mark.parametrize("kind", [PendulumEnv, PendulumVectorEnv])
def test_a_system_without_cells_draws_no_table(kind) -> None:
    with pytest.raises(ValueError, match=r"GridSearch1D.*not Pendulum"):
        kind(render_mode="rgb_array").show_table(np.ones((4, 3)))


def test_an_environment_without_a_painter_cannot_be_drawn() -> None:
    class Bare(PendulumEnv):
        painter = None

    env = Bare(render_mode="rgb_array")
    env.reset(seed=0)
    with pytest.raises(NotImplementedError, match="Pendulum cannot be drawn"):
        env.render()


def test_environments_import_painters_only_to_draw() -> None:
    program = """
import sys, gymnasium as gym, acl_gym
for name in ("Pendulum", "Navigation", "GridSearch1D", "GridSearch2D", "TwoState",
             "TravellingSalesman"):
    gym.make_vec(f"acl_gym/{name}-v0", 2).reset(seed=0)
print([name for name in sys.modules if "painter" in name or "pygame" in name])
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"
