"""The worker's side of `WorkersVectorEnv`: single environments that answer requests.

Only what a new process can import quickly is imported here.
"""

from __future__ import annotations

import contextlib
import pickle
import sys
import traceback
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import cloudpickle
import gymnasium as gym
from gymnasium import spaces

from acl_gym.envs.limits import time_limit
from acl_gym.envs.wrappers.rows import same_row

Outcomes = list[tuple[int, Any]]
"""Slots, each with what its environment returned."""


class Repeat(NamedTuple):
    """An episode that is to be brought again to where it stands."""

    slot: int
    seed: int | None
    options: dict[str, Any] | None
    actions: list[Any]
    """Those taken since the reset."""
    shown: Any
    """The observation that they must lead to, see `rows`."""


class Request(NamedTuple):
    """What a worker is asked."""

    repeats: list[Repeat]
    """What it is to do first."""
    command: str
    """The name of a method of `Host`."""
    arguments: tuple[Any, ...]


class Failure(NamedTuple):
    """The answer if an environment has raised an exception."""

    slot: int
    error: Exception
    trace: str
    """The worker's traceback; empty if it is this process."""

    def raised(self) -> Exception:
        """The exception, with what is known of where it comes from."""
        if self.trace:
            self.error.__cause__ = _InWorker(self.trace)
        self.error.add_note(f"It comes from the environment of slot {self.slot}.")
        return self.error


class Description(NamedTuple):
    """What all slots have in common, see `gymnasium.Env`."""

    observation_space: spaces.Space[Any]
    action_space: spaces.Space[Any]
    metadata: dict[str, Any]
    render_mode: str | None
    max_episode_steps: int | None
    system: Any
    """The system of an environment of this package, None of any other."""


class Host:
    """The environments of some slots.

    Args:
        first: the number of the first slot.
        make: returns the functions that make the environments, one for each slot.
    """

    def __init__(
        self, first: int, make: Callable[[], Iterable[Callable[[], gym.Env[Any, Any]]]]
    ) -> None:
        self._first = first
        self._make = make
        self._envs: list[gym.Env[Any, Any]] = []
        self._lost: set[int] = set()  # slots whose episode could not be repeated
        self._slot = first  # whose environment is at work

    def answer(self, request: Request) -> Any:
        """Do what is asked; return what the command returns, or a `Failure`."""
        try:
            if not self._envs:
                self._envs = self._made()
            for each in request.repeats:
                self._repeat(each)
            return getattr(self, request.command)(*request.arguments)
        except (Exception, SystemExit) as error:
            if isinstance(error, SystemExit):
                error = RuntimeError(f"it called sys.exit({error.code!r})")
            return Failure(self._slot, error, "")

    def close(self) -> None:
        """Close the environments."""
        envs, self._envs = self._envs, []
        for env in envs:
            env.close()

    def ready(self) -> None:
        """Do nothing; the answer comes once the environments are made."""

    def describe(self) -> Description:
        """What the slots have in common.

        Raises:
            ValueError: their spaces differ.
        """
        first = self._envs[0]
        for slot, env in self._numbered():
            for name in ("observation_space", "action_space"):
                if getattr(env, name) != getattr(first, name):
                    raise spaces_differ(
                        name, slot, getattr(env, name), getattr(first, name)
                    )
        return Description(
            first.observation_space,
            first.action_space,
            dict(first.metadata),
            first.render_mode,
            time_limit(first),
            _system_of(first),
        )

    def reset(
        self, starts: list[tuple[int, int | None]], options: dict[str, Any] | None
    ) -> Outcomes:
        """Start episodes.

        Args:
            starts: slots and seeds.
            options: passed to each environment.
        """
        outcomes = []
        for self._slot, seed in starts:
            self._lost.discard(self._slot)
            outcomes.append((self._slot, self._env.reset(seed=seed, options=options)))
        return outcomes

    def step(self, slots: list[int], actions: Iterable[Any]) -> Outcomes:
        """Take an action in each of some slots; None comes of an episode that is lost.

        Args:
            slots: which.
            actions: one for each of them.
        """
        outcomes: Outcomes = []
        for self._slot, action in zip(slots, actions, strict=True):
            lost = self._slot in self._lost
            outcomes.append((self._slot, None if lost else self._env.step(action)))
        return outcomes

    def render(self) -> list[Any]:
        """A frame of each slot."""
        return [env.render() for self._slot, env in self._numbered()]

    @property
    def _env(self) -> gym.Env[Any, Any]:
        return self._envs[self._slot - self._first]

    def _numbered(self) -> Iterable[tuple[int, gym.Env[Any, Any]]]:
        return enumerate(self._envs, self._first)

    def _made(self) -> list[gym.Env[Any, Any]]:
        envs = []
        for slot, make in enumerate(self._make(), self._first):
            self._slot = slot
            envs.append(make())
        return envs

    def _repeat(self, episode: Repeat) -> None:
        """Bring an episode to where it stood, or remember that it cannot be done."""
        self._slot = episode.slot
        seen, *_ = self._env.reset(seed=episode.seed, options=episode.options)
        ended = False
        for action in episode.actions:
            seen, _, terminated, truncated, _ = self._env.step(action)
            ended = bool(terminated or truncated)
            if ended:
                break
        if ended or not same_row(episode.shown, seen):
            self._lost.add(self._slot)
        else:
            self._lost.discard(self._slot)


def spaces_differ(name: str, slot: int, own: Any, first: Any) -> ValueError:
    """The error for slots that are not alike."""
    what = name.replace("_", " ")
    return ValueError(
        f"all slots must have the same {what}, got {own} in slot {slot} and {first} "
        "before; check env_fns."
    )


def packed_env_fns(env_fns: Any, first: int) -> bytes:
    """The bytes of functions that make environments, and of the ids that they may use.

    Args:
        env_fns: the functions.
        first: the slot of the first of them.

    Raises:
        TypeError: one cannot be sent to another process.
    """
    try:
        functions = cloudpickle.dumps(list(env_fns))
    except Exception as error:
        raise TypeError(
            "env_fns must be functions that can be sent to another process, got one "
            f"from slot {first} on that cannot: {error}; make what it uses inside of it."
        ) from error
    ids = {}
    for name, spec in gym.registry.items():
        if not str(spec.entry_point).startswith(("gymnasium.", "acl_gym.")):
            with contextlib.suppress(Exception):  # perhaps it is not needed
                ids[name] = cloudpickle.dumps(spec)
    return pickle.dumps((ids, functions))


def unpacked_env_fns(packed: bytes) -> Any:
    """The functions from `packed_env_fns`; ids that are not here yet are registered."""
    ids, functions = pickle.loads(packed)
    for name, spec in ids.items():
        with contextlib.suppress(Exception):
            gym.registry.setdefault(name, pickle.loads(spec))
    return pickle.loads(functions)


def packed_answer(answer: Any, slot: int) -> bytes:
    """The bytes of what `Host.answer` returned, a `Failure` with its traceback.

    Args:
        answer: what it returned.
        slot: the first of the worker, for messages.
    """
    if isinstance(answer, Failure):
        trace = "".join(traceback.format_exception(answer.error))
        answer = answer._replace(trace=trace)
    try:
        packed = packed_message(answer)
        if isinstance(answer, Failure):
            pickle.loads(packed)  # some exceptions can be packed but not unpacked
        return packed
    except Exception as error:
        if isinstance(answer, Failure):
            kind = type(answer.error).__name__
            plain = RuntimeError(f"{kind}: {answer.error}")
            return pickle.dumps(answer._replace(error=plain))
        refused = TypeError(
            "what environments return must be such that it can be sent to another "
            f"process, got an object that cannot: {error}; leave it out of the infos."
        )
        return pickle.dumps(Failure(slot, refused, f"{type(error).__name__}: {error}"))


def packed_message(message: Any) -> bytes:
    """The bytes of a message, which `pickle.loads` takes."""
    try:
        return pickle.dumps(message, protocol=pickle.HIGHEST_PROTOCOL)
    except Exception:  # of classes of a script, say, which only cloudpickle can send
        return bytes(cloudpickle.dumps(message))


class _InWorker(Exception):  # noqa: N818 - it is shown as the cause of another one
    """The traceback of an exception in a worker."""

    def __init__(self, trace: str) -> None:
        super().__init__(trace)
        self.trace = trace

    def __str__(self) -> str:
        return f'\n"""\n{self.trace}"""'


def _system_of(env: gym.Env[Any, Any]) -> Any:
    """The system of an environment of this package, if it can be sent."""
    module = sys.modules.get("acl_gym.envs.control.system")
    system = getattr(env.unwrapped, "system", None)
    # Where that module was not imported, there is no such system.
    if module is None or not isinstance(system, module.ControlSystem):
        return None
    try:
        packed_message(system)
    except Exception:
        return None
    return system
