"""The single environments in the slots of a vector environment, wherever they run.

What `VecEnv` asks of one slot (an attribute, a method, whether it is wrapped) is asked
of these: in a `SyncVectorEnv` directly, in an `AsyncVectorEnv` through its workers. A
native vector environment has none.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from typing import Any

import gymnasium as gym
from gymnasium.vector import AsyncVectorEnv, VectorEnv
from stable_baselines3.common.env_util import is_wrapped

from acl_gym.utils import validation

WrapperClass = type[gym.Wrapper[Any, Any, Any, Any]]

_OWN_COMMANDS = ("reset", "step", "close")


class SlotEnvs(ABC):
    """One single environment, possibly wrapped, in each slot."""

    @abstractmethod
    def has(self, name: str) -> Sequence[bool]:
        """Whether the environment of each slot, or one of its wrappers, has `name`."""

    @abstractmethod
    def reached(self, slots: Sequence[int]) -> Sequence[int]:
        """The slots that a question to `slots` reaches."""

    @abstractmethod
    def get(self, name: str, slots: Sequence[int]) -> list[Any]:
        """The attribute in each of `slots`."""

    @abstractmethod
    def set(self, name: str, value: Any, slots: Sequence[int]) -> None:
        """Set the attribute in each of `slots`."""

    @abstractmethod
    def call(
        self, name: str, args: Any, kwargs: Any, slots: Sequence[int]
    ) -> list[Any]:
        """The result of the method in each of `slots`; others are not called."""

    @abstractmethod
    def wrapped_in(self, wrapper: WrapperClass, slots: Sequence[int]) -> list[bool]:
        """Whether each of `slots` has this wrapper, or one derived from it."""


class LocalEnvs(SlotEnvs):
    """Single environments in this process.

    Args:
        envs: one for each slot.
    """

    def __init__(self, envs: Sequence[gym.Env[Any, Any]]) -> None:
        self._envs = envs

    def has(self, name: str) -> Sequence[bool]:
        """See `SlotEnvs.has`."""
        return [env.has_wrapper_attr(name) for env in self._envs]

    def reached(self, slots: Sequence[int]) -> Sequence[int]:
        """See `SlotEnvs.reached`: only those that are asked."""
        return slots

    def get(self, name: str, slots: Sequence[int]) -> list[Any]:
        """See `SlotEnvs.get`."""
        return [self._envs[slot].get_wrapper_attr(name) for slot in slots]

    def set(self, name: str, value: Any, slots: Sequence[int]) -> None:
        """See `SlotEnvs.set`."""
        for slot in slots:
            self._envs[slot].set_wrapper_attr(name, value)

    def call(
        self, name: str, args: Any, kwargs: Any, slots: Sequence[int]
    ) -> list[Any]:
        """See `SlotEnvs.call`."""
        return [method(*args, **kwargs) for method in self.get(name, slots)]

    def wrapped_in(self, wrapper: WrapperClass, slots: Sequence[int]) -> list[bool]:
        """See `SlotEnvs.wrapped_in`."""
        return [is_wrapped(self._envs[slot], wrapper) for slot in slots]


class WorkerEnvs(SlotEnvs):
    """Single environments in worker processes, which all receive the same command.

    So a change can be made in all slots only, and what is sent back must be picklable, as
    in a `SubprocVecEnv`: a worker that cannot send its answer ends.

    Args:
        env: the vector environment whose workers they are.
    """

    def __init__(self, env: AsyncVectorEnv) -> None:
        self._env = env

    def has(self, name: str) -> Sequence[bool]:
        """See `SlotEnvs.has`."""
        return self._env.call("has_wrapper_attr", name)

    def reached(self, slots: Sequence[int]) -> Sequence[int]:
        """See `SlotEnvs.reached`: all.

        A worker ends if it is asked for an attribute that it does not have.
        """
        return range(self._env.num_envs)

    def get(self, name: str, slots: Sequence[int]) -> list[Any]:
        """See `SlotEnvs.get`."""
        # Not `get_attr`, which would call a method instead of returning it.
        values = self._env.call("get_wrapper_attr", name)
        return [values[slot] for slot in slots]

    def set(self, name: str, value: Any, slots: Sequence[int]) -> None:
        """See `SlotEnvs.set`.

        Raises:
            ValueError: `slots` are not all.
        """
        self._check_all(name, slots)
        self._env.set_attr(name, [value] * self._env.num_envs)

    def call(
        self, name: str, args: Any, kwargs: Any, slots: Sequence[int]
    ) -> list[Any]:
        """See `SlotEnvs.call`.

        Raises:
            ValueError: `slots` are not all, or workers do not take this method.
        """
        if name in _OWN_COMMANDS:
            raise ValueError(
                f"method_name must be none of {', '.join(_OWN_COMMANDS)}, which all "
                f"workers take together, got {validation.shown(name)}; call {name}() of the adapter."
            )
        self._check_all(name, slots)
        values = self._env.call(name, *args, **kwargs)
        return [values[slot] for slot in slots]

    def wrapped_in(self, wrapper: WrapperClass, slots: Sequence[int]) -> list[bool]:
        """See `SlotEnvs.wrapped_in`.

        An environment cannot be sent, but describes itself by the names of the classes
        of its wrappers, which are compared with those of `wrapper` and the classes
        derived from it.

        Raises:
            TypeError: there is a name of which this process does not know the class, so
                that the answer could be a wrong no.
        """
        wanted = {each.__name__ for each in _with_subclasses(wrapper)}
        wrappers = {each.__name__ for each in _with_subclasses(gym.Wrapper)}
        ends = {each.__name__ for each in _with_subclasses(gym.Env)} - wrappers
        descriptions = self._env.call("__str__")
        return [_is_among(wanted, descriptions[slot], wrappers, ends) for slot in slots]

    def _check_all(self, name: str, slots: Sequence[int]) -> None:
        if set(slots) != set(range(self._env.num_envs)):
            raise ValueError(
                f"{name!r} reaches the workers of all {self._env.num_envs} slots, got "
                f"indices {list(slots)}; leave indices out, or use a SyncVectorEnv."
            )


def slot_envs(env: VectorEnv[Any, Any, Any]) -> SlotEnvs | None:
    """The single environments in the slots of `env`; None if there are none."""
    base = env.unwrapped
    if isinstance(base, AsyncVectorEnv):
        return WorkerEnvs(base)
    envs = getattr(base, "envs", None)
    if isinstance(envs, Sequence) and len(envs) == env.num_envs:
        single = all(isinstance(each, gym.Env) for each in envs)
        return LocalEnvs(envs) if single else None
    return None


def _is_among(
    wanted: set[str], description: str, wrappers: set[str], ends: set[str]
) -> bool:
    """Whether a description such as "<Monitor<CartPoleEnv<CartPole-v1>>>" names one.

    Args:
        wanted: the names looked for.
        description: what an environment and its wrappers call themselves.
        wrappers: the names of all known wrappers.
        ends: the names of all other known environments, where a description ends.
    """
    for name in re.findall(r"<([^<>\s]+)", description):
        if name in wanted:
            return True
        if name in ends:
            return False
        if name not in wrappers:
            break
    raise TypeError(
        "wrappers in the workers of an AsyncVectorEnv are recognised by their names, "
        f"but {description!r} has one that this process does not know; import the class "
        "here too, or use a SyncVectorEnv."
    )


def _with_subclasses(base: type[Any]) -> Iterator[type[Any]]:
    """The class and all derived from it that this process has seen."""
    yield base
    for derived in base.__subclasses__():
        yield from _with_subclasses(derived)
