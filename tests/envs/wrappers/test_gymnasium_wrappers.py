"""Gymnasium's own wrappers, copies and specifications, on every id of this package."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces, wrappers
from gymnasium.envs.registration import EnvSpec
from gymnasium.wrappers import vector as vector_wrappers

from acl_gym.envs import ENVIRONMENTS

EVERY_ID = pytest.mark.parametrize("env_id", ENVIRONMENTS)
BOX_IDS = (  # others are Discrete
    *("acl_gym/Pendulum-v0", "acl_gym/Navigation-v0"),
    "acl_gym/SwarmAggregation-v0",
)
# Where an action that the mask does not allow is an error, none can be repeated.
STRICT, REPEATING = "acl_gym/TravellingSalesman-v0", ("MaxAndSkip", "StickyAction")
LIMIT = 8
Wrap = Callable[[Any], Any]


def single(env_id: str, **keywords: Any) -> Any:
    return gym.make(env_id, max_episode_steps=LIMIT, **keywords)


def sample(env: Any, info: dict[str, Any]) -> Any:
    """A random action, of those that are allowed."""
    mask = info.get("action_mask")
    return env.action_space.sample(None if mask is None else mask.astype(np.int8))


def sample_all(env: Any, infos: Any) -> Any:
    """A random action for each slot, of those that are allowed."""
    if isinstance(infos, list):
        masks = [row.get("action_mask") for row in infos]
    else:
        masks = list(infos.get("action_mask", [None]))
    if masks[0] is None:
        return env.action_space.sample()
    return env.action_space.sample(tuple(mask.astype(np.int8) for mask in masks))


def flat(space: spaces.Space[Any], value: Any) -> np.ndarray:
    return np.asarray(spaces.flatten(space, value), dtype=np.float64)


# --- single environments ------------------------------------------------------------

SINGLE: dict[str, Wrap] = {
    "FlattenObservation": wrappers.FlattenObservation,
    "TimeAwareObservation": wrappers.TimeAwareObservation,
    "FrameStackObservation": lambda env: wrappers.FrameStackObservation(env, 3),
    "DelayObservation": lambda env: wrappers.DelayObservation(env, 2),
    "MaxAndSkipObservation": lambda env: wrappers.MaxAndSkipObservation(env, 2),
    "TransformObservation": lambda env: wrappers.TransformObservation(
        env, lambda observation: observation, env.observation_space
    ),
    "ClipReward": lambda env: wrappers.ClipReward(env, -1, 0),
    "NormalizeReward": wrappers.NormalizeReward,
    "TransformReward": lambda env: wrappers.TransformReward(env, lambda r: 2 * r),
    "TransformAction": lambda env: wrappers.TransformAction(
        env, lambda action: action, env.action_space
    ),
    "StickyAction": lambda env: wrappers.StickyAction(env, 0.3),
    "TimeLimit": lambda env: wrappers.TimeLimit(env, 4),
    "Autoreset": wrappers.Autoreset,
    "RecordEpisodeStatistics": wrappers.RecordEpisodeStatistics,
}
BOXES: dict[str, Wrap] = {
    "NormalizeObservation": wrappers.NormalizeObservation,
    "RescaleObservation": lambda env: wrappers.RescaleObservation(
        env, np.float64(-1), np.float64(1)
    ),
    "ReshapeObservation": lambda env: wrappers.ReshapeObservation(
        env, (env.observation_space.shape[0] // 2, 2)
    ),
    "DiscretizeObservation": lambda env: wrappers.DiscretizeObservation(env, 5),
}


@pytest.mark.parametrize(
    ("env_id", "name"),
    [
        (env_id, name)
        for env_id in ENVIRONMENTS
        for name in (*SINGLE, *(BOXES if env_id in BOX_IDS else ()))
        if env_id != STRICT or not name.startswith(REPEATING)
    ],
)
def test_every_wrapper_takes_a_walk(env_id: str, name: str) -> None:
    env = {**SINGLE, **BOXES}[name](single(env_id))
    env.action_space.seed(0)
    observation, info = env.reset(seed=0)
    assert env.observation_space.contains(observation)
    ended = 0
    for _ in range(4 * LIMIT):
        observation, reward, terminated, truncated, info = env.step(sample(env, info))
        assert env.observation_space.contains(observation)
        assert np.isfinite(reward)
        if terminated or truncated:
            ended += 1
            if name != "Autoreset":
                _, info = env.reset()
    assert ended >= 2
    env.close()


@EVERY_ID
def test_what_observation_wrappers_show(env_id: str) -> None:
    plain = single(env_id)
    space = plain.observation_space
    flattened, aware, stacked = (
        SINGLE[f"{name}Observation"](single(env_id))
        for name in ("Flatten", "TimeAware", "FrameStack")
    )
    envs = (plain, flattened, aware, stacked)
    begun = [env.reset(seed=4) for env in envs]
    first, seen, timed, stack = (each[0] for each in begun)
    info = begun[0][1]
    for step in range(2):
        np.testing.assert_array_equal(seen, flat(space, first))
        np.testing.assert_array_equal(timed[:-1], flat(space, first))
        assert timed[-1] == step
        np.testing.assert_array_equal(stack[-1], first)
        action = int(np.argmax(info.get("action_mask", [True])))
        steps = [env.step(action) for env in envs]
        first, seen, timed, stack = (each[0] for each in steps)
        info = steps[0][4]


@EVERY_ID
def test_what_reward_wrappers_give(env_id: str) -> None:
    plain = single(env_id)
    clipped, doubled = (
        SINGLE[name](single(env_id)) for name in ("ClipReward", "TransformReward")
    )
    for env in (plain, clipped, doubled):
        env.reset(seed=4)
    reward = plain.step(1)[1]
    assert clipped.step(1)[1] == max(reward, -1.0)
    assert doubled.step(1)[1] == 2 * reward


@EVERY_ID
def test_a_frame_as_observation(env_id: str) -> None:
    pytest.importorskip("pygame")
    env = wrappers.AddRenderObservation(single(env_id, render_mode="rgb_array"))
    observation, _ = env.reset(seed=0)
    assert env.observation_space.contains(observation)
    assert observation.shape == (480, 480, 3)
    env.close()


# --- vector environments ------------------------------------------------------------

VECTOR: dict[str, tuple[Wrap, str]] = {  # and the autoreset modes that it supports
    "RecordEpisodeStatistics": (vector_wrappers.RecordEpisodeStatistics, "NSD"),
    "ClipReward": (lambda env: vector_wrappers.ClipReward(env, -1, 0), "NSD"),
    "NormalizeReward": (vector_wrappers.NormalizeReward, "NSD"),
    "TransformReward": (
        lambda env: vector_wrappers.TransformReward(env, lambda r: 2 * r),
        "NSD",
    ),
    "DictInfoToList": (vector_wrappers.DictInfoToList, "NSD"),
    "FlattenObservation": (vector_wrappers.FlattenObservation, "ND"),
    "TransformObservation": (
        lambda env: vector_wrappers.TransformObservation(env, lambda seen: seen),
        "ND",
    ),
    "NormalizeObservation": (vector_wrappers.NormalizeObservation, "N"),
    "RescaleObservation": (
        lambda env: vector_wrappers.RescaleObservation(
            env, np.float64(-1), np.float64(1)
        ),
        "ND",
    ),
}
FOR_BOXES = ("NormalizeObservation", "RescaleObservation")


@pytest.mark.parametrize(
    ("env_id", "name", "mode"),
    [
        (env_id, name, mode)
        for env_id in ENVIRONMENTS
        for name, (_, modes) in VECTOR.items()
        for mode in ("NextStep", "SameStep", "Disabled")
        if mode[0] in modes and (name not in FOR_BOXES or env_id in BOX_IDS)
    ],
)
def test_every_vector_wrapper_takes_a_walk(env_id: str, name: str, mode: str) -> None:
    env = gym.make_vec(env_id, num_envs=3, autoreset_mode=mode, max_episode_steps=LIMIT)
    env = VECTOR[name][0](env)
    env.action_space.seed(0)
    observations, infos = env.reset(seed=0)
    ended = np.zeros(3, dtype=int)
    for _ in range(4 * LIMIT):
        assert env.observation_space.contains(observations)
        observations, rewards, terminated, truncated, infos = env.step(
            sample_all(env, infos)
        )
        assert np.isfinite(rewards).all()
        done = terminated | truncated
        ended += done
        if mode == "Disabled" and done.any():
            observations, infos = env.reset(options={"reset_mask": done})
    assert (ended >= 2).all()
    env.close()


# --- specifications, copies and recordings -------------------------------------------


@EVERY_ID
def test_a_specification_makes_the_same_again(env_id: str) -> None:
    env = single(env_id)
    text = env.spec.to_json()
    for made in (gym.make(env.spec), gym.make(EnvSpec.from_json(text))):
        assert made.spec.id == env_id
        assert made.spec.max_episode_steps == LIMIT
        np.testing.assert_array_equal(made.reset(seed=1)[0], env.reset(seed=1)[0])
    assert env_id in env.spec.pprint(disable_print=True)
    vector = gym.make_vec(
        env_id, num_envs=2, autoreset_mode="Disabled", max_episode_steps=LIMIT
    )
    again = gym.make_vec(EnvSpec.from_json(vector.spec.to_json()), num_envs=2)
    assert again.metadata["autoreset_mode"] is vector.metadata["autoreset_mode"]
    np.testing.assert_array_equal(again.reset(seed=1)[0], vector.reset(seed=1)[0])


@EVERY_ID
@pytest.mark.parametrize(
    "duplicate", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))]
)
def test_a_copy_goes_on_as_the_original_and_apart_from_it(
    env_id: str, duplicate: Callable[[Any], Any]
) -> None:
    env: Any = gym.make_vec(env_id, num_envs=5, max_episode_steps=LIMIT)
    one: Any = single(env_id)
    for original, action in ((env, np.array([1, 0, 1, 0, 1])), (one.unwrapped, 1)):
        original.reset(seed=7)
        twin = duplicate(original)
        # The step, and the random numbers of the next episodes.
        for mine, other in zip(original.step(action), twin.step(action), strict=True):
            if not isinstance(mine, dict):
                np.testing.assert_array_equal(mine, other)
        for _ in range(3):
            np.testing.assert_array_equal(original.reset()[0], twin.reset()[0])
        twin.reset(seed=1)
        third = duplicate(twin)
        original.reset(seed=2)
        original.step(action)
        np.testing.assert_array_equal(twin.step(action)[0], third.step(action)[0])


class Collector(gym.Wrapper[Any, Any, Any, Any]):
    """Keeps what a data set of episodes keeps: the seed, actions and what came back."""

    def __init__(self, env: Any) -> None:
        super().__init__(env)
        self.made_by = env.spec.to_json()
        self.episodes: list[dict[str, Any]] = []

    def reset(self, *, seed: Any = None, options: Any = None) -> Any:
        observation, info = self.env.reset(seed=seed, options=options)
        self.episodes.append(
            {"seed": seed, "observations": [observation], "actions": [], "rewards": []}
        )
        return observation, info

    def step(self, action: Any) -> Any:
        result = self.env.step(action)
        episode = self.episodes[-1]
        episode["observations"].append(result[0])
        episode["actions"].append(action)
        episode["rewards"].append(result[1])
        return result


@EVERY_ID
def test_recorded_episodes_can_be_replayed_from_what_was_kept(env_id: str) -> None:
    env = Collector(single(env_id))
    env.action_space.seed(0)
    for seed in range(3):
        _, info = env.reset(seed=seed)
        done = False
        while not done:
            _, _, terminated, truncated, info = env.step(sample(env, info))
            done = terminated or truncated
    again = gym.make(EnvSpec.from_json(env.made_by))
    for episode in env.episodes:
        observation, _ = again.reset(seed=episode["seed"])
        seen, rewards = [observation], []
        for action in episode["actions"]:
            observation, reward, *_ = again.step(action)
            seen.append(observation)
            rewards.append(reward)
        # Observations that were kept have not changed since.
        np.testing.assert_array_equal(seen, episode["observations"])
        assert rewards == episode["rewards"]
