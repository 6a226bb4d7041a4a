"""Attributes, methods and wrappers of slots, in this process and in workers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import gymnasium as gym
import pytest
from gymnasium import spaces
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv
from gymnasium.wrappers import TimeLimit
from gymnasium.wrappers.vector import RecordEpisodeStatistics
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecMonitor

import acl_gym
from acl_gym.sb3.adapter import VectorEnvAdapter
from tests.sb3.test_adapter_agents import Push
from tests.sb3.vector_envs import PENDULUM, Countdown, countdowns, pendulums


def test_attributes_of_a_native_vector_environment() -> None:
    env = VectorEnvAdapter(
        acl_gym.ScaledVectorObservation(pendulums(3, max_episode_steps=9), [0])
    )
    assert env.get_attr("max_episode_steps") == [9, 9, 9]
    assert env.get_attr("max_episode_steps", indices=1) == [9]
    assert env.get_attr("scaling", [0, 2])[1].circular == (0,)
    assert env.get_attr("observation_space") == [env.observation_space] * 3
    assert env.get_attr("action_space", 0) == [spaces.Discrete(3)]
    assert not env.has_attr("no_such_attribute")
    env.set_attr("max_episode_steps", 5)
    assert env.env.unwrapped.max_episode_steps == 5
    with pytest.raises(ValueError, match="by all 3 slots"):
        env.set_attr("max_episode_steps", 7, indices=[0])
    with pytest.raises(AttributeError, match="no_such_attribute"):
        env.set_attr("no_such_attribute", 1)


def test_methods_of_a_native_vector_environment() -> None:
    env = VectorEnvAdapter(pendulums(3))
    others = env.env_method("with_slots", 7)
    assert len(others) == 3
    assert others[0] is others[2]
    assert others[0].num_envs == 7
    with pytest.raises(ValueError, match="by all 3 slots"):
        env.env_method("with_slots", 7, indices=1)
    with pytest.raises(AttributeError, match="no_such_method"):
        env.env_method("no_such_method")


def test_attributes_and_methods_of_single_environments() -> None:
    env = VectorEnvAdapter(countdowns(2, 3, 5))
    assert env.get_attr("length") == [2, 3, 5]
    assert env.get_attr("length", [2, 0]) == [5, 2]
    env.set_attr("length", 4, indices=1)
    assert env.get_attr("length") == [2, 4, 5]
    assert env.env_method("double", 10) == [40, 80, 100]
    assert env.env_method("double", number=1, indices=[2]) == [10]


class Tall(Countdown):
    """Has what its neighbours have not."""

    height = 2.0


def test_what_only_some_slots_have() -> None:
    makers: list[Callable[[], Any]] = [Countdown, Tall]
    env = VectorEnvAdapter(SyncVectorEnv(makers, autoreset_mode="Disabled"))
    assert env.get_attr("height", indices=1) == [2.0]
    env.set_attr("height", 3.0, indices=[1])
    assert env.get_attr("height", indices=1) == [3.0]
    for indices in (None, [0, 1]):
        with pytest.raises(AttributeError, match=r"'height', but slots \[0\] do not"):
            env.get_attr("height", indices)
    with pytest.raises(AttributeError, match="height"):
        env.get_attr("height", 0)


def test_wrappers_are_found() -> None:
    native = VectorEnvAdapter(RecordEpisodeStatistics(pendulums(2)))
    assert native.env_is_wrapped(RecordEpisodeStatistics) == [True, True]  # type: ignore[arg-type]
    assert native.env_is_wrapped(Monitor) == [False, False]
    monitored = SyncVectorEnv(
        [lambda: Monitor(Countdown()), Countdown],
        autoreset_mode=AutoresetMode.DISABLED,
    )
    assert VectorEnvAdapter(monitored).env_is_wrapped(Monitor) == [True, False]
    waiting = acl_gym.WaitingVectorEnv([lambda: Monitor(Countdown()), Countdown])
    assert VectorEnvAdapter(waiting).env_is_wrapped(Monitor) == [True, False]


# --- workers ----------------------------------------------------------------------


class Louder(Monitor):
    """A `Monitor` by another name."""


def _adapter(makers: list[Callable[[], Any]]) -> VectorEnvAdapter:
    # "fork", so that functions of this module can be used in the workers.
    return VectorEnvAdapter(
        AsyncVectorEnv(makers, autoreset_mode="Disabled", context="fork")
    )


@pytest.fixture
def workers() -> Iterator[VectorEnvAdapter]:
    env = _adapter(
        [
            lambda: Monitor(Countdown(2)),
            lambda: TimeLimit(Countdown(3), 10),
            lambda: TimeLimit(Louder(Tall(4)), 10),
        ]
    )
    yield env
    env.close()


def test_wrappers_in_workers_are_found(workers: VectorEnvAdapter) -> None:
    assert workers.env_is_wrapped(Monitor) == [True, False, True]
    assert workers.env_is_wrapped(Louder) == [False, False, True]
    assert workers.env_is_wrapped(TimeLimit) == [False, True, True]
    assert workers.env_is_wrapped(TimeLimit, indices=[0, 2]) == [False, True]
    assert workers.env_is_wrapped(gym.Wrapper, indices=1) == [True]


def test_a_registered_environment_in_workers() -> None:
    env = _adapter([lambda: gym.make(PENDULUM, max_episode_steps=9)] * 2)
    assert env.env_is_wrapped(TimeLimit) == [True, True]
    assert env.env_is_wrapped(Monitor) == [False, False]
    assert env.get_attr("render_mode") == [None, None]
    env.close()


class Silent(TimeLimit):
    """Keeps to itself what it wraps."""

    def __str__(self) -> str:
        return "<Silent>"


class Poetic(Countdown):
    """Describes itself in its own words."""

    def __str__(self) -> str:
        return "counts <down>"


def _unknown_wrapper() -> Any:
    """Wrapped in a class that exists only where this is called."""
    hidden = type("Hidden", (TimeLimit,), {})
    return hidden(Countdown(), 10)


@pytest.mark.parametrize(
    "make", [lambda: Silent(Monitor(Countdown()), 10), Poetic, _unknown_wrapper]
)
def test_never_a_wrong_no(make: Callable[[], Any]) -> None:
    env = _adapter([Countdown, make])
    with pytest.raises(TypeError, match=r"recognised by their names.*SyncVectorEnv"):
        env.env_is_wrapped(Monitor)
    assert env.env_is_wrapped(Monitor, indices=0) == [False]
    env.close()


def test_attributes_of_workers(workers: VectorEnvAdapter) -> None:
    assert workers.get_attr("length") == [2, 3, 4]
    assert workers.get_attr("length", [2, 0]) == [4, 2]
    workers.set_attr("length", 7)
    assert workers.get_attr("length") == [7, 7, 7]
    with pytest.raises(ValueError, match=r"all 3 slots, got indices \[1\]"):
        workers.set_attr("length", 1, indices=1)
    assert workers.get_attr("length") == [7, 7, 7]
    # A worker would end if it were asked for an attribute that it does not have.
    with pytest.raises(AttributeError, match=r"'height', but slots \[0, 1\]"):
        workers.get_attr("height", 2)
    assert not workers.has_attr("no_such_attribute")
    assert workers.get_attr("num_envs") == [3, 3, 3]  # of the vector environment
    assert workers.reset().shape == (3, 2)


def test_methods_of_workers(workers: VectorEnvAdapter) -> None:
    assert workers.env_method("double", 10) == [40, 60, 80]
    assert workers.env_method("double", indices=[2, 0, 1], number=1) == [8, 4, 6]
    with pytest.raises(ValueError, match=r"all 3 slots, got indices \[0\]"):
        workers.env_method("double", 10, indices=0)
    with pytest.raises(ValueError, match=r"call reset\(\) of the adapter"):
        workers.env_method("reset")
    with pytest.raises(AttributeError, match="no_such_method"):
        workers.env_method("no_such_method")
    assert workers.reset().shape == (3, 2)


def test_monitors_in_workers_under_evaluate_policy() -> None:
    """It warns where no monitor is found; warnings are errors here."""
    env = _adapter([lambda: Monitor(Countdown(2))] * 2)
    mean, _ = evaluate_policy(Push(), env, n_eval_episodes=4)
    assert mean == pytest.approx(-0.1 - 0.2)
    env.close()
    plain = _adapter([lambda: Countdown(2)] * 2)
    mean, _ = evaluate_policy(Push(), VecMonitor(plain), n_eval_episodes=4)
    assert mean == pytest.approx(-0.1 - 0.2)
    plain.close()
