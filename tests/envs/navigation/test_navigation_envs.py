"""The navigation's environments, single and vector, and their frames."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import SyncVectorEnv

from acl_gym.envs.navigation import Navigation, NavigationEnv, NavigationVectorEnv
from acl_gym.envs.navigation.painter import goal_outline
from tests.envs.navigation import reference_navigation as reference
from tests.envs.vector_helpers import (
    assert_same_bits,
    assert_same_step,
    mask_of,
    success_at_ends,
)

ID = "acl_gym/Navigation-v0"
VEHICLE = np.array([0, 114, 178])
FORCE = np.array([213, 94, 0])
GOAL = np.array([0, 158, 115])

# A goal that random forces reach now and then.
EASY: dict[str, Any] = {"goal_bounds": (2.5, 1.0)}
SETTINGS = [
    EASY,
    {"cost": "time", "goal_rule": "membership", "goal_spacing": (9.0, 6.0)},
    {"substeps": 3, "force_weight": 0.5, "peaks": (), **EASY},
]


def states_in(rng: np.random.Generator, count: int) -> np.ndarray:
    return rng.uniform(-1, 1, (count, 4)) * [5, 2, 5, 2]


@pytest.mark.parametrize("setting", SETTINGS)
def test_vector_is_many_single_environments(setting: dict[str, Any]) -> None:
    n = 5
    native = NavigationVectorEnv(
        n, max_episode_steps=25, autoreset_mode="Disabled", **setting
    )
    sync = SyncVectorEnv(
        [lambda: gym.make(ID, max_episode_steps=25, **setting)] * n,
        autoreset_mode=native.autoreset_mode,
    )
    rng = np.random.default_rng(6)
    states = states_in(rng, n)
    native.reset(seed=1, options={"state": states})
    # One state option cannot serve five single environments: each gets its own.
    sync.reset(seed=1)
    for env, state in zip(sync.envs, states, strict=True):
        env.reset(options={"state": state})
    ends = {"terminated": 0, "truncated": 0}
    for _ in range(120):
        actions = rng.integers(0, 9, n)
        ours, theirs = native.step(actions), sync.step(actions)
        assert_same_step(ours, success_at_ends(theirs))
        ends["terminated"] += int(ours[2].sum())
        ends["truncated"] += int(ours[3].sum())
        finished = ours[2] | ours[3]
        if finished.any():
            states = states_in(rng, n)
            native.reset(options={"reset_mask": finished, "state": states})
            sync.reset(options={"reset_mask": finished})
            for i in np.flatnonzero(finished):
                sync.envs[i].reset(options={"state": states[i]})
    assert min(ends.values()) > 2


def test_resetting_a_slot_leaves_the_others_alone() -> None:
    envs = [NavigationVectorEnv(3, autoreset_mode="Disabled") for _ in range(2)]
    for env in envs:
        env.reset(seed=4)
    rng = np.random.default_rng(7)
    for step in range(30):
        if step % 7 == 3:
            envs[0].reset(options={"reset_mask": mask_of(3, 1)})
        actions = rng.integers(0, 9, 3)
        ours, theirs = (env.step(actions) for env in envs)
        for mine, other in zip(ours[:4], theirs[:4], strict=True):
            assert_same_bits(mine[[0, 2]], other[[0, 2]])
    assert not np.array_equal(ours[0][1], theirs[0][1])


def test_a_slot_at_the_goal_waits() -> None:
    env = NavigationVectorEnv(2)
    options = {"state": [[0.1, 0.0, 0.0, 0.0], [3.0, 0.0, 0.0, 1.0]]}
    env.reset(options={**options, "finished": "wait"})
    _, rewards, terminated, _, _ = env.step([4, 4])
    assert terminated.tolist() == [True, False]
    assert rewards[0] == pytest.approx(-0.2 * 0.01)
    observation, rewards, terminated, _, _ = env.step([8, 8])
    assert observation[0].tolist() == [0.1, 0.0, 0.0, 0.0]
    assert rewards[0] == 0.0
    assert rewards[1] < 0.0
    assert not terminated.any()


@pytest.mark.parametrize("setting", SETTINGS)
def test_episodes_begin_outside_the_goal(setting: dict[str, Any]) -> None:
    observation, _ = NavigationVectorEnv(500, **setting).reset(seed=8)
    assert not reference.is_goal(Navigation(**setting), observation).any()


def test_checked_by_gymnasium() -> None:
    check_env(gym.make(ID, render_mode="rgb_array").unwrapped)
    check_env(gym.make(ID, cost="time", goal_rule="membership").unwrapped)


def pixels(frame: np.ndarray, colour: np.ndarray) -> np.ndarray:
    """Rows and columns of the pixels that are nearly of a colour, `(n, 2)`."""
    near = (np.abs(frame.astype(int) - colour) < 20).all(axis=-1)
    return np.argwhere(near)


def frame_at(state: Any, action: int | None = None, **setting: Any) -> np.ndarray:
    env = gym.make(ID, render_mode="rgb_array", **setting)
    env.reset(options={"state": state})
    if action is not None:
        env.step(action)
    return env.render()


@pytest.mark.parametrize(
    ("c1", "c2", "row", "column"),
    [(4, 0, 0, 1), (-4, 0, 0, -1), (0, 4, -1, 0), (0, -4, 1, 0), (-4, 4, -1, -1)],
)
def test_the_vehicle_is_where_its_position_says(c1, c2, row, column) -> None:
    frame = frame_at([c1, 0, c2, 0])
    assert frame.shape == (480, 480, 3)
    assert frame.dtype == np.uint8
    centre = pixels(frame, VEHICLE).mean(axis=0) - 239.5
    np.testing.assert_allclose(centre, [row * 175, column * 175], atol=3)


def test_the_force_points_where_it_pushes() -> None:
    heavy = {"mass": 1e9}
    assert len(pixels(frame_at([2, 0, 2, 0]), FORCE)) == 0
    assert len(pixels(frame_at([2, 0, 2, 0], 4, **heavy), FORCE)) == 0
    for action, (u1, u2) in enumerate(Navigation().forces):
        if action == 4:
            continue
        frame = frame_at([2, 0, 2, 0], action, **heavy)
        from_vehicle = pixels(frame, FORCE).mean(axis=0) - pixels(frame, VEHICLE).mean(
            axis=0
        )
        np.testing.assert_array_equal(np.round(from_vehicle / 30), [-u2, u1])


def test_the_velocity_is_a_line() -> None:
    still, moving = (frame_at([-2, v, 2, -v]) for v in (0.0, 1.5))
    moved = pixels(moving, VEHICLE).mean(axis=0) - pixels(still, VEHICLE).mean(axis=0)
    assert (moved > 2.0).all()  # to the right and downwards


def test_the_damping_is_dark() -> None:
    frame = frame_at([-4, 0, 4, 0]).astype(int).sum(axis=-1)
    scale = 0.455 * 480 / 5

    def shade(c1: float, c2: float) -> int:
        return int(frame[round(239.5 - scale * c2), round(239.5 + scale * c1)])

    assert shade(0.0, -2.3) < shade(1.5, -2.3) < shade(3.0, -2.3) < shade(-2.0, 2.0)
    assert shade(4.7, 1.0) < shade(4.7, 3.0) < shade(2.0, 4.0)
    even = frame_at([-4, 0, 4, 0], peaks=())
    assert (even[300:400, 100:300] == 255).all()


@pytest.mark.parametrize(
    "setting",
    [
        {},
        {"goal_bounds": (1.0, 0.1)},
        {"goal_rule": "membership", "goal_spacing": (0.3, 2.0)},
        {"goal_rule": "membership", "goal_spacing": (2.0, 2.0)},
    ],
)
def test_the_outline_is_that_of_the_goal(setting: dict[str, Any]) -> None:
    system = Navigation(**setting)
    outline = goal_outline(system)
    for share, inside in ((0.999, True), (1.001, False)):
        states = np.zeros((len(outline), 4))
        states[:, [0, 2]] = share * outline
        assert (reference.is_goal(system, states) == inside).all()
    assert len(pixels(frame_at([-4, 0, 4, 0], **setting), GOAL)) > 150


def test_vector_frames_are_those_of_single_environments() -> None:
    env = gym.make_vec(ID, num_envs=2, render_mode="rgb_array")
    states = np.array([[0.3, 0.0, 3.0, 1.0], [2.0, 1.0, -3.0, 0.0]])
    env.reset(options={"state": states})
    env.step([0, 2])
    frames = env.render()
    assert not np.array_equal(*frames)
    for state, action, frame in zip(states, [0, 2], frames, strict=True):
        np.testing.assert_array_equal(frame, frame_at(state, action))


def test_frames_do_not_touch_the_next_ones() -> None:
    env = NavigationEnv(render_mode="rgb_array")
    env.reset(options={"state": [1, 0, 1, 0]})
    first = env.render()
    kept = first.copy()
    first[:] = 0
    np.testing.assert_array_equal(env.render(), kept)
