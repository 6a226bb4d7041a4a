"""What the adapter takes: autoreset modes, spaces of observations and of actions."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv
from gymnasium.vector.utils import batch_space
from gymnasium.wrappers.vector import RecordEpisodeStatistics

import acl_gym
from acl_gym.sb3.adapter import VectorEnvAdapter
from acl_gym.sb3.checks import check_observations
from tests.sb3.vector_envs import (
    DICT_SPACE,
    PENDULUM,
    Countdown,
    countdowns,
    pendulums,
    step,
)

# --- autoreset modes --------------------------------------------------------------


@pytest.mark.parametrize("begun", [False, True], ids=["new", "begun"])
def test_an_environment_of_this_package_gets_the_mode_that_fits(begun: bool) -> None:
    """As `gym.make_vec` makes it: the episodes are those of DISABLED."""
    env = gym.make_vec(PENDULUM, num_envs=3, max_episode_steps=4)
    if begun:
        env.reset(seed=0)
        env.step([1, 1, 1])
    adapter = VectorEnvAdapter(env)
    assert adapter.env is env
    assert env.metadata["autoreset_mode"] is AutoresetMode.DISABLED
    twin = VectorEnvAdapter(pendulums(3, "Disabled", max_episode_steps=4))
    for each in (adapter, twin):
        each.seed(5)
        each.reset()
    for _ in range(9):
        for mine, other in zip(step(adapter, 2)[:3], step(twin, 2)[:3], strict=True):
            np.testing.assert_array_equal(mine, other)
    # Environments of the same class keep the default.
    assert pendulums(1, "NextStep").metadata["autoreset_mode"] is (
        AutoresetMode.NEXT_STEP
    )


def test_a_mode_that_is_not_stated_counts_as_next_step() -> None:
    env = countdowns(2, 2)
    env.metadata = {}
    with pytest.raises(ValueError, match="NEXT_STEP"):
        VectorEnvAdapter(env)


REMEDIES: list[Callable[[], Any]] = [
    lambda: RecordEpisodeStatistics(pendulums(2, "NextStep")),
    lambda: gym.make_vec("CartPole-v1", num_envs=2),
    lambda: gym.make_vec("CartPole-v1", num_envs=2, vectorization_mode="sync"),
    lambda: gym.make_vec("CartPole-v1", num_envs=2, vectorization_mode="async"),
    lambda: SyncVectorEnv([Countdown] * 2),
    lambda: AsyncVectorEnv([Countdown] * 2),
]


@pytest.mark.parametrize("make", REMEDIES)
def test_next_step_is_refused_with_a_line_that_works(make: Callable[[], Any]) -> None:
    env = make()
    with pytest.raises(ValueError, match="NEXT_STEP") as caught:
        VectorEnvAdapter(env)
    env.close()
    line = str(caught.value).partition("make it with ")[2].removesuffix(".")
    wrapped = line.endswith(", then wrap")
    assert wrapped == (env.unwrapped is not env)
    names = {"gym": gym, "env_fns": [Countdown] * 2, "SyncVectorEnv": SyncVectorEnv}
    names["AsyncVectorEnv"] = AsyncVectorEnv
    made = eval(line.removesuffix(", then wrap"), names)
    assert type(made) in (type(env.unwrapped), SyncVectorEnv)
    adapter = VectorEnvAdapter(RecordEpisodeStatistics(made) if wrapped else made)
    adapter.reset()
    step(adapter)
    adapter.close()


@pytest.mark.parametrize("make", [lambda: gym.make(PENDULUM), lambda: None, lambda: 3])
def test_only_vector_environments(make: Callable[[], Any]) -> None:
    with pytest.raises(TypeError, match=r"gymnasium\.vector\.VectorEnv"):
        VectorEnvAdapter(make())


# --- spaces -----------------------------------------------------------------------


def _with_spaces(observation: spaces.Space[Any], action: spaces.Space[Any]) -> Any:
    env = pendulums(2)
    env.single_observation_space = observation
    env.single_action_space = action
    env.observation_space = batch_space(observation, 2)
    env.action_space = batch_space(action, 2)
    return env


@pytest.mark.parametrize(
    ("observation", "action", "message"),
    [
        (DICT_SPACE, spaces.Discrete(3, start=1), "actions must start from 0"),
        (
            spaces.Discrete(3, start=-1),
            spaces.Discrete(3),
            "observations must start from 0",
        ),
        (
            spaces.Box(0, 1, (2,)),
            spaces.MultiDiscrete([2, 2], start=[0, 1]),
            "actions must start from 0",
        ),
        (spaces.Tuple([spaces.Discrete(2)]), spaces.Discrete(2), "FlattenObservation"),
        (
            spaces.Dict({"a": spaces.Dict({"b": spaces.Discrete(2)})}),
            spaces.Discrete(2),
            "FlattenObservation",
        ),
    ],
)
def test_spaces_that_sb3_would_misread_are_refused(
    observation: spaces.Space[Any], action: spaces.Space[Any], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        VectorEnvAdapter(_with_spaces(observation, action))


TWO = spaces.Discrete(2)


@pytest.mark.parametrize(
    "action",
    [
        spaces.Tuple([TWO, TWO]),
        spaces.Dict({"a": TWO, "b": TWO}),
        spaces.Sequence(TWO),
        spaces.Text(3),
        spaces.OneOf([TWO, TWO]),
        spaces.Graph(spaces.Box(0, 1, (2,)), None),
    ],
    ids=lambda space: type(space).__name__,
)
def test_actions_that_are_no_array_are_refused(action: spaces.Space[Any]) -> None:
    """They would be torn apart: each slot received a column in place of its own."""

    class Takes(Countdown):
        def __init__(self) -> None:
            super().__init__()
            self.action_space = action

    env = SyncVectorEnv([Takes] * 2, autoreset_mode="Disabled")
    with pytest.raises(ValueError, match=r"^actions must be a Box.*TransformAction"):
        VectorEnvAdapter(env)


@pytest.mark.parametrize(
    ("action", "sent"),
    [
        (spaces.Discrete(5), np.array([4, 0, 3])),
        (spaces.MultiDiscrete([3, 4]), np.array([[0, 1], [2, 3], [1, 0]])),
        (spaces.MultiBinary(2), np.array([[0, 1], [1, 1], [1, 0]], dtype=np.int8)),
        (
            spaces.Box(-1, 1, (2,), np.float32),
            np.array([[0.5, -1.0], [0.25, 1.0], [0.0, 0.125]], dtype=np.float32),
        ),
        (
            spaces.Box(-1, 1, (2, 2), np.float32),
            np.arange(12, dtype=np.float32).reshape(3, 2, 2) / 16,
        ),
    ],
    ids=lambda value: type(value).__name__,
)
@pytest.mark.parametrize("kind", [SyncVectorEnv, AsyncVectorEnv])
def test_every_slot_receives_its_own_action(
    kind: type[Any], action: spaces.Space[Any], sent: np.ndarray
) -> None:
    class Listens(Countdown):
        def __init__(self) -> None:
            super().__init__()
            self.action_space = action
            self.heard: Any = None

        def step(self, action: Any) -> Any:
            self.heard = np.array(action)
            return super().step(action)

    # "fork", so that a class of this function can be sent to the workers.
    keywords = {"context": "fork"} if kind is AsyncVectorEnv else {}
    env = VectorEnvAdapter(kind([Listens] * 3, autoreset_mode="Disabled", **keywords))
    env.reset()
    env.step(sent)
    for heard, row in zip(env.get_attr("heard"), sent, strict=True):
        np.testing.assert_array_equal(heard, row)
        assert action.contains(heard[()] if heard.ndim == 0 else heard)
    env.close()


def test_actions_that_start_elsewhere_work_with_the_remedy() -> None:
    class FromOne(Countdown):
        def __init__(self) -> None:
            super().__init__()
            self.action_space = spaces.Discrete(3, start=1)
            self.heard = 0

        def step(self, action: Any) -> Any:
            self.heard = int(action)
            return super().step(action)

    def shifted() -> Any:
        return gym.wrappers.TransformAction(
            FromOne(), lambda action: action + 1, spaces.Discrete(3)
        )

    env = VectorEnvAdapter(SyncVectorEnv([shifted] * 3, autoreset_mode="Disabled"))
    env.reset()
    env.step(np.array([0, 2, 1]))
    assert env.get_attr("heard") == [1, 3, 2]


def test_spaces_are_those_of_one_slot() -> None:
    env = pendulums(3)
    adapter = VectorEnvAdapter(env)
    assert adapter.num_envs == 3
    assert adapter.observation_space == env.single_observation_space
    assert adapter.action_space == spaces.Discrete(3)
    assert adapter.spec is env.spec
    assert adapter.env is env
    assert acl_gym.VectorEnvAdapter is VectorEnvAdapter


# --- what an environment returns --------------------------------------------------


class Returning(gym.vector.VectorWrapper):
    """Changes what `reset`, or what `step`, returns."""

    def __init__(self, name: str, change: Callable[[Any], Any]) -> None:
        super().__init__(countdowns(3, 3))
        self._name, self._change = name, change

    def reset(self, **kwargs: Any) -> Any:
        result = self.env.reset(**kwargs)
        return self._change(result) if self._name == "reset" else result

    def step(self, actions: Any) -> Any:
        result = self.env.step(actions)
        return self._change(result) if self._name == "step" else result


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("reset", lambda result: None, r"env\.reset must return 2 parts.* got None"),
        ("reset", lambda result: result[0], r"env\.reset must return 2 parts"),
        (
            "reset",
            lambda result: (result[0][:1], {}),
            "one row for each of the 2 slots",
        ),
        (
            "reset",
            lambda result: (result[0][:, :1], {}),
            r"shape \(2, 2\).* got \(2, 1",
        ),
        ("step", lambda result: result[:4], r"env\.step must return 5 parts"),
        (
            "step",
            lambda result: (np.zeros((2, 3)), *result[1:]),
            r"got \(2, 3\); check",
        ),
        (
            "step",
            lambda result: (result[0], [0.0, np.nan], *result[2:]),
            "rewards must be finite, got nan in slot 1; check",
        ),
    ],
)
def test_what_is_returned_is_checked(
    name: str, change: Callable[[Any], Any], words: str
) -> None:
    adapter = VectorEnvAdapter(Returning(name, change))
    if name == "step":
        adapter.reset()
    act: Any = adapter.reset if name == "reset" else functools.partial(step, adapter)
    with pytest.raises(ValueError, match=words):
        act()


@pytest.mark.parametrize(
    ("observations", "words"),
    [
        (np.zeros((2, 2)), "a dict with the keys"),
        ({"place": np.zeros((2, 2))}, "a dict with the keys"),
        (
            {"place": np.zeros((2, 3)), "flag": np.zeros(2)},
            r"\['place'\] must have shape",
        ),
    ],
)
def test_parts_of_observations_are_checked(observations: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        check_observations(observations, DICT_SPACE, 2)


def test_keys_of_infos_that_are_no_text() -> None:
    adapter = VectorEnvAdapter(
        Returning("step", lambda result: (*result[:4], {1: np.array([5, 6])}))
    )
    adapter.reset()
    assert [info[1] for info in step(adapter)[3]] == [5, 6]


@pytest.mark.parametrize("slots", [0, "2", None])
def test_the_number_of_slots(slots: Any) -> None:
    env = countdowns(3, 3)
    env.num_envs = slots
    with pytest.raises((TypeError, ValueError), match=r"env\.num_envs must be"):
        VectorEnvAdapter(env)
