"""The single environment: what Gymnasium asks of it, states, errors, pictures."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from stable_baselines3.common.env_checker import check_env as sb3_check_env

from acl_gym.envs.swarm_aggregation import (
    SwarmAggregationEnv,
    SwarmAggregationVectorEnv,
)

ID = "acl_gym/SwarmAggregation-v0"
VARIANTS: list[dict[str, Any]] = [
    {},
    {"followers": 0},
    {"directions": 8, "nearest": 3, "sensing_radius": 2.0},
    {"continuous": True, "observe": "potential"},
    {"continuous": True, "point_mass": True},
    {"valleys": [(1, 1, 2, 1)], "obstacles": [(-2, 0, 1)]},
]
EVERY_VARIANT = pytest.mark.parametrize("variant", VARIANTS, ids=str)


@EVERY_VARIANT
def test_the_checkers_find_nothing(variant: dict[str, Any]) -> None:
    check_env(gym.make(ID, **variant).unwrapped)
    if not variant.get("continuous"):  # it recommends actions within [-1, 1] as float32
        sb3_check_env(gym.make(ID, **variant))


@EVERY_VARIANT
def test_it_is_a_vector_environment_of_one_agent(variant: dict[str, Any]) -> None:
    """And as many followers: the same bits from the same seed."""
    single = SwarmAggregationEnv(**variant)
    company = {"followers": 9, **variant}
    vector = SwarmAggregationVectorEnv(1, autoreset_mode="Disabled", **company)
    mine, _ = single.reset(seed=3)
    other, _ = vector.reset(seed=3)
    single.action_space.seed(0)
    for _ in range(30):
        assert mine.tobytes() == other[0].tobytes()
        action = single.action_space.sample()
        mine, reward, terminated, truncated, info = single.step(action)
        other, rewards, *flags, infos = vector.step([action])
        assert (reward, terminated, truncated) == (rewards[0], *(f[0] for f in flags))
        assert info == {name: infos[name][0] for name in ("distance", "collisions")}
    assert single.states.tobytes() == vector.states.tobytes()


def test_a_state_of_the_agent_or_of_all() -> None:
    env = SwarmAggregationEnv(followers=2)
    one, info = env.reset(seed=1, options={"state": [1.0, -2.0]})
    assert info == {}
    assert env.states[0].tolist() == one[:2].tolist() == [1.0, -2.0]
    rows = np.arange(6.0).reshape(3, 2) - 3.0
    env.reset(options={"state": rows})
    np.testing.assert_array_equal(env.states, rows)
    env.states[:] = 9.0  # a copy
    np.testing.assert_array_equal(env.states, rows)


def test_states_of_all_draw_no_random_numbers() -> None:
    env, other = SwarmAggregationEnv(followers=1), SwarmAggregationEnv(followers=1)
    for each in (env, other):
        each.reset(seed=5)
    other.reset(options={"state": np.zeros((2, 2))})
    assert env.reset()[0].tobytes() == other.reset()[0].tobytes()


@pytest.mark.parametrize(
    "state",
    [
        [0.0],
        [[0.0, 0.0]] * 3,
        [0.0, 0.0, 0.0],
        [np.nan, 0.0],
        [0.0, 5.1],
        [0.0, -np.inf],
        ["a", "b"],
        [2.5, 2.5],
        [],
    ],
    ids=str,
)
def test_a_bad_state_is_refused_and_changes_nothing(state: Any) -> None:
    env, twin = (SwarmAggregationEnv(obstacles=[(2.5, 2.5, 1.0)]) for _ in range(2))
    for each in (env, twin):
        each.reset(seed=6)
    with pytest.raises(ValueError, match="state"):
        env.reset(seed=7, options={"state": state})
    for _ in range(3):
        assert env.step(1)[0].tobytes() == twin.step(1)[0].tobytes()
    assert env.reset()[0].tobytes() == twin.reset()[0].tobytes()


@pytest.mark.parametrize(
    ("action", "error"),
    [(5, ValueError), (-1, ValueError), (1.5, TypeError), ([1, 2], ValueError)],
)
def test_what_is_no_action(action: Any, error: type[Exception]) -> None:
    env = SwarmAggregationEnv()
    with pytest.raises(ResetNeeded, match="call reset"):
        env.step(0)
    env.reset(seed=0)
    with pytest.raises(error, match="actions must"):
        env.step(action)


def test_what_is_no_velocity() -> None:
    env = SwarmAggregationEnv(continuous=True)
    env.reset(seed=0)
    for action in (1, [np.nan, 0.0], [1.0], ["a", "b"]):
        with pytest.raises((TypeError, ValueError), match="actions must"):
            env.step(action)
    with pytest.raises(TypeError, match="Did you mean 'nearest'"):
        SwarmAggregationEnv(nearst=3)
    with pytest.raises(ValueError, match="render_mode must be"):
        SwarmAggregationEnv(render_mode="ansi")
    with pytest.raises(ValueError, match="among \\['state'\\], got \\['states'\\]"):
        env.reset(options={"states": [0, 0]})


def test_time_limit_of_make() -> None:
    env = gym.make(ID)
    env.reset(seed=0)
    flags = [env.step(0)[2:4] for _ in range(100)]
    assert flags == [(False, False)] * 99 + [(False, True)]


def test_following_the_rule_keeps_the_swarm_together() -> None:
    """Who takes the observed input pays less than who stays, and who walks at random."""
    returns = {}
    for name in ("rule", "stay", "random"):
        env = SwarmAggregationEnv(observe="potential", continuous=True)
        env.action_space.seed(0)
        total = 0.0
        for seed in range(5):
            seen, _ = env.reset(seed=seed)
            for _ in range(100):
                action = {
                    "rule": seen,
                    "stay": np.zeros(2),
                    "random": env.action_space.sample(),
                }[name]
                seen, reward, *_ = env.step(action)
                total += reward / 5
        returns[name] = total
    # Costs of about 71, 176 and 186.
    assert 0.0 > returns["rule"] > 0.6 * returns["stay"]
    assert returns["rule"] > 0.6 * returns["random"]


# --- pictures ---------------------------------------------------------------------------

pygame = pytest.importorskip("pygame")


def colours(frame: np.ndarray) -> set[tuple[int, ...]]:
    return set(map(tuple, frame.reshape(-1, 3).tolist()))


def test_frames_show_agents_where_they_are() -> None:
    env = SwarmAggregationEnv(
        render_mode="rgb_array", followers=1, obstacles=[(0.0, 0.0, 1.0)]
    )
    env.reset(options={"state": [[-4.0, 4.0], [4.0, -4.0]]})
    frame = env.render()
    assert frame.shape == (480, 480, 3)
    assert frame.dtype == np.uint8
    # x to the right, y upwards: the learner is top left, in orange.
    assert tuple(frame[48, 48]) == (213, 94, 0)
    assert tuple(frame[432, 432]) == (0, 40, 85)
    assert tuple(frame[240, 240]) == (110, 110, 116)
    assert tuple(frame[48, 432]) == (255, 255, 255)


def test_trails_and_speeds_are_seen() -> None:
    env = SwarmAggregationEnv(render_mode="rgb_array", followers=1)
    env.reset(options={"state": [[-4.0, 0.0], [4.0, 0.0]]})
    still = colours(env.render())
    for _ in range(8):
        env.step(2)
    moving = colours(env.render())
    assert (242, 196, 160) not in still  # the trail of the learner
    assert (242, 196, 160) in moving
    assert (203, 219, 235) in moving
    assert (50, 150, 225) in moving  # the follower at full speed


def test_valleys_are_green_and_hills_orange() -> None:
    env = SwarmAggregationEnv(
        render_mode="rgb_array",
        followers=0,
        valleys=[(-3, 0, 2, 0.7), (3, 0, -2, 0.7)],
    )
    env.reset(options={"state": [0.0, 4.0]})
    frame = env.render().astype(int)
    left, right = frame[240, 96], frame[240, 384]
    assert left[1] > left[0] + 30
    assert right[0] > right[2] + 30
    assert (frame[470, 240] == 255).all()


def test_a_window_and_no_picture() -> None:
    env = SwarmAggregationEnv(render_mode="human")
    env.reset(seed=0)
    env.step(1)
    assert env.render() is None
    env.close()
    env.close()
    quiet = SwarmAggregationEnv()
    quiet.reset(seed=0)
    with pytest.warns(UserWarning, match="render"):
        assert gym.make(ID).unwrapped.render() is None
    shown = SwarmAggregationEnv(render_mode="rgb_array")
    with pytest.raises(ResetNeeded):
        shown.render()


def test_a_thousand_agents_in_a_picture() -> None:
    env = SwarmAggregationVectorEnv(1_000, render_mode="rgb_array")
    env.reset(seed=0)
    env.step(np.ones(1_000, dtype=np.int64))
    frames = env.render()
    assert len(frames) == 1_000
    assert frames[0] is frames[-1]
    # Dots of the fast colour; an agent covers a pixel or more.
    blue = frames[0].astype(int)
    assert ((blue[..., 2] > 200) & (blue[..., 0] < 120)).sum() > 1_000
