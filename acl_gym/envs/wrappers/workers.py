"""Slots whose environments are stepped by workers: processes, or actors of a cluster."""

from __future__ import annotations

import copy
import warnings
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from multiprocessing.util import Finalize
from typing import Any, Self

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper
from gymnasium.vector.utils import batch_space, iterate

from acl_gym.envs.wrappers.crew import Crew, Question, WorkerDiedError
from acl_gym.envs.wrappers.executors import EXECUTORS, hiring
from acl_gym.envs.wrappers.hosting import Description, Repeat, spaces_differ
from acl_gym.envs.wrappers.rows import row_of
from acl_gym.envs.wrappers.waiting import WaitingSlots, made_by_id
from acl_gym.utils import validation
from acl_gym.utils.vector_envs import require_vector_env

__all__ = ["WorkerDiedError", "WorkersVectorEnv", "spread_over_workers"]


@dataclass
class _Episode:
    """What an episode is a function of."""

    seed: int | None
    options: dict[str, Any] | None
    actions: list[Any] = field(default_factory=list)


class WorkersVectorEnv(WaitingSlots):
    """Slots whose environments are stepped by workers, for those that are slow to step.

    Like a `WaitingVectorEnv` it steps only the slots that have not finished. What an
    agent learns is the same, to the bit, for any number of workers and every executor:
    each episode of a slot starts from a seed that is drawn here, see `reset`. Where each
    trial is seeded and each slot makes one episode in it, as in the synchronous trials of
    this package's agents, it is also the same as with a `WaitingVectorEnv`. It pays where
    the slots of a worker take longer for a step together than a message to it, a few
    tenths of a millisecond for a process and a few milliseconds for a cluster.

    When a worker dies (killed, out of memory, or by a fault of a simulator), a new one
    resets its slots with the same seeds and repeats the actions of the episodes under
    way, and the run goes on with the same bits; the logger `acl_gym` says so. That
    needs environments that draw all random numbers from the generator which
    `reset(seed=...)` seeds. Where the repetition leads elsewhere, a `RuntimeWarning` says so, and the
    episode ends there, truncated. An exception that an environment raises is raised here;
    after it everything is as before the call.

    Args:
        env_fns: functions that make the environments, one for each slot; they are sent to
            the workers by cloudpickle. Observations are arrays or numbers, or dicts or
            tuples of those.
        workers: how many, >= 0; slots are dealt to them in blocks. More than slots are
            not started. With 0 the environments are in this process.
        executor: "processes" of this machine; "ray" for actors on the cluster that
            `ray.init` was called for, or else on the one that runs on this machine, each
            node with the same version of this package; or "serial", in this process
            whatever `workers` is.
        timeout: seconds that the slots of a worker may take for a step together, > 0;
            then the worker is stopped, and counts as dead. None waits for ever. It has no
            effect in this process.

    Raises:
        TypeError: `workers` is not an integer, or a function cannot be sent.
        ValueError: there is no slot, another argument is out of range, or the spaces of
            the slots differ.
        ModuleNotFoundError: Ray is not installed.
        ConnectionError: there is no Ray cluster.
        WorkerDiedError: a worker died three times in a row when it was started.

    Note:
        `close` ends the workers; they end as well with the environment, and with the
        process that made it.

    Example:
        >>> from acl_gym import ReturningACL
        >>> env = WorkersVectorEnv.make("FrozenLake-v1", 20, workers=0)
        >>> colony = ReturningACL(env, seed=0).learn(trials=2)
        >>> colony.trials
        2
        >>> env.close()
    """

    def __init__(
        self,
        env_fns: Sequence[Callable[[], gym.Env[Any, Any]]],
        workers: int = 2,
        executor: str = "processes",
        *,
        timeout: float | None = None,
    ) -> None:
        self.env_fns = tuple(env_fns)
        if not self.env_fns:
            raise ValueError("env_fns must make at least one environment, got none.")
        for each in self.env_fns:
            if not callable(each):
                raise TypeError(
                    "env_fns must be functions that make environments, got "
                    f"{validation.shown(each)}; pass [make_env] * 20, say."
                )
        workers = validation.integer("workers", workers, at_least=0)
        executor = validation.one_of("executor", executor, EXECUTORS)
        if timeout is not None:
            timeout = validation.number("timeout", timeout, above=0)
        if workers == 0:
            executor = "serial"
        if executor == "serial":
            workers = 1
        self.num_envs = len(self.env_fns)
        self._blocks = _dealt(self.num_envs, min(workers, self.num_envs))
        self._crew = Crew(
            hiring(executor, self.env_fns, self._blocks), self._blocks, timeout
        )
        # At the end of the program this comes before processes are waited for; it does
        # nothing in a copy of the process.
        self._end = Finalize(self, self._crew.dismiss, exitpriority=10)
        self._finished = np.ones(self.num_envs, dtype=np.bool_)
        self._episodes = [_Episode(None, None) for _ in self.env_fns]
        self._chance: int | None = None  # where there was no seed
        self._roots: list[int | None] = [None] * self.num_envs
        self._count = [0] * self.num_envs
        try:
            self._adopt(self._described())
        except BaseException:
            self._end()
            raise

    @classmethod
    def make(
        cls,
        env_id: str,
        num_envs: int,
        workers: int = 2,
        executor: str = "processes",
        *,
        timeout: float | None = None,
        **kwargs: Any,
    ) -> Self:
        """Make the slots by `gym.make(env_id, **kwargs)`.

        Args:
            env_id: a registered id.
            num_envs: slots, >= 1.
            workers: see the class.
            executor: see the class.
            timeout: see the class.
            kwargs: of `gym.make`, such as `max_episode_steps`.
        """
        made = made_by_id(env_id, num_envs, kwargs)
        return cls(made, workers, executor, timeout=timeout)

    def _described(self) -> Description:
        """What all slots have in common."""
        everyone: dict[int, Question] = dict.fromkeys(
            range(len(self._blocks)), ("describe", ())
        )
        answers = self._crew.ask(everyone, self._repeats)
        first: Description = answers[0]
        for number, block in enumerate(self._blocks):
            for name in ("observation_space", "action_space"):
                own, common = getattr(answers[number], name), getattr(first, name)
                if own != common:
                    raise spaces_differ(name, block.start, own, common)
        return first

    def _adopt(self, found: Description) -> None:
        n = self.num_envs
        self.single_observation_space = found.observation_space
        self.single_action_space = found.action_space
        self.observation_space = batch_space(found.observation_space, n)
        self.action_space = batch_space(found.action_space, n)
        self.metadata = {**found.metadata, "autoreset_mode": AutoresetMode.DISABLED}
        self.render_mode = found.render_mode
        self.max_episode_steps = found.max_episode_steps
        self.system = found.system

    def reset(
        self,
        *,
        seed: int | list[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Any, dict[str, Any]]:
        """Start episodes in all slots, or in those of `options["reset_mask"]`.

        With a seed, slot i starts from seed + i, as in Gymnasium's vector environments.
        Without one it starts from a seed drawn from the last one that it was given, its
        number, and how many episodes it has begun since.

        Args:
            seed: as above; a list has a seed or None for each slot.
            options: `"reset_mask"`, bool array `(num_envs,)`; the others are passed on
                to each slot.

        Returns:
            As `WaitingVectorEnv.reset`.

        Raises:
            TypeError: as there.
            ValueError: as there.
            ResetNeeded: as there.
            WorkerDiedError: a worker has died three times in a row.
        """
        return super().reset(seed=seed, options=options)

    def _begin(
        self, slots: list[int], seeds: list[int | None], options: dict[str, Any] | None
    ) -> Iterable[tuple[int, Any]]:
        counts = {
            slot: self._count[slot] + 1 if seed is None else 0
            for slot, seed in zip(slots, seeds, strict=True)
        }
        starts = {
            slot: self._drawn(slot, counts[slot]) if seed is None else seed
            for slot, seed in zip(slots, seeds, strict=True)
        }
        questions: dict[int, Question] = {}
        for number, own in self._by_worker(slots):
            pairs = [(slot, starts[slot]) for slot in own]
            questions[number] = "reset", (pairs, options)
        answers = self._crew.ask(questions, partial(self._repeats, but=set(slots)))
        for slot, seed in zip(slots, seeds, strict=True):
            self._episodes[slot] = _Episode(starts[slot], copy.copy(options))
            self._count[slot] = counts[slot]
            if seed is not None:
                self._roots[slot] = seed
        return _in_order(answers)

    def _drawn(self, slot: int, count: int) -> int:
        """The seed of an episode that was given none.

        Args:
            slot: whose it is.
            count: how many there were since the last seed that was given.
        """
        root = self._roots[slot]
        if root is None:
            if self._chance is None:
                self._chance = int(np.random.SeedSequence().generate_state(1)[0])
            root = self._chance
        drawn = np.random.SeedSequence((root, slot), spawn_key=(count,))
        return int(drawn.generate_state(1)[0] >> 1)  # some take 31 bits only

    def _advance(self, slots: list[int], actions: Any) -> Iterable[tuple[int, Any]]:
        actions = copy.deepcopy(actions)
        taken = list(iterate(self.action_space, actions))
        if len(taken) != self.num_envs:
            raise ValueError(
                f"actions must be {self.num_envs}, one for each slot, got {len(taken)}."
            )
        questions: dict[int, Question] = {}
        for number, own in self._by_worker(slots):
            rows: Any = [taken[slot] for slot in own]
            if isinstance(actions, np.ndarray):
                rows = actions[own]  # it is sent faster than its elements
            questions[number] = "step", (own, rows)
        answers = self._crew.ask(questions, self._repeats)
        for slot in slots:
            self._episodes[slot].actions.append(taken[slot])
        return [
            (slot, self._ended_here(slot) if given is None else given)
            for slot, given in _in_order(answers)
        ]

    def _ended_here(self, slot: int) -> tuple[Any, ...]:
        """The step of an episode that could not be repeated."""
        warnings.warn(
            f"the episode of slot {slot} was repeated in a new worker and led to another "
            "observation, so it ends where it was, truncated; an environment should draw "
            "its random numbers from the generator that reset(seed=...) seeds.",
            RuntimeWarning,
            stacklevel=4,
        )
        return row_of(self._shown, slot), 0.0, False, True, {}

    def _repeats(self, block: range, but: Collection[int] = ()) -> list[Repeat]:
        """The episodes of a block that are under way, except those of some slots."""
        return [
            Repeat(
                slot,
                self._episodes[slot].seed,
                self._episodes[slot].options,
                self._episodes[slot].actions,
                row_of(self._shown, slot),
            )
            for slot in block
            if not self._finished[slot] and slot not in but
        ]

    def _by_worker(self, slots: list[int]) -> Iterable[tuple[int, list[int]]]:
        """Slots, in ascending order, by the worker that has them."""
        for number, block in enumerate(self._blocks):
            own = [slot for slot in slots if slot in block]
            if own:
                yield number, own

    def render(self) -> tuple[Any, ...] | None:
        """A frame of each slot; None without a `render_mode`."""
        if self.render_mode is None:
            return None
        everyone: dict[int, Question] = dict.fromkeys(
            range(len(self._blocks)), ("render", ())
        )
        answers = self._crew.ask(everyone, self._repeats)
        return tuple(frame for number in sorted(answers) for frame in answers[number])

    def close_extras(self, **kwargs: Any) -> None:
        """End the workers."""
        self._end()


def spread_over_workers(
    env: VectorEnv[Any, Any, Any] | None, workers: int, executor: str = "processes"
) -> WorkersVectorEnv:
    """The same single environments in a `WorkersVectorEnv`.

    Args:
        env: a `SyncVectorEnv`, `AsyncVectorEnv` or `WaitingVectorEnv`, or what
            `gym.make_vec` returns for an id that has a single environment as well.
            It stays as it is, and open.
        workers: see `WorkersVectorEnv`.
        executor: see `WorkersVectorEnv`.

    Raises:
        TypeError: `env` is not a vector environment, or `workers` not an integer.
        ValueError: it is not known how to make its single environments, or another
            argument is out of range.
    """
    require_vector_env(env)
    env_fns = getattr(env, "env_fns", None) or _env_fns_by_spec(env)
    return WorkersVectorEnv(env_fns, workers, executor)


def _env_fns_by_spec(env: Any) -> list[Any]:
    """Functions that make single environments of the kind that a native one has."""
    spec = None if isinstance(env, VectorWrapper) else env.spec
    if spec is None or spec.entry_point is None:
        raise ValueError(
            "env must be a SyncVectorEnv or WaitingVectorEnv, or made by gym.make_vec, "
            f"without vector wrappers, to be spread over workers, got "
            f"{validation.shown(env)}; make acl_gym.WorkersVectorEnv([make_env] * 20, "
            "workers=2), wrap it as you like, and leave workers= out here."
        )
    if getattr(env, "slots_share_a_world", False):
        raise ValueError(
            "env must have slots that do not meet, so that workers can have some each, "
            f"got {type(env).__name__}, all agents of which are in one world; run it in "
            "one process."
        )
    spec = copy.deepcopy(spec)
    kwargs, spec.kwargs = spec.kwargs, {}
    for name in ("num_envs", "vectorization_mode", "autoreset_mode"):
        kwargs.pop(name, None)  # of the vector environment only
    return [partial(gym.make, spec, **kwargs)] * env.num_envs


def _dealt(n_slots: int, n_workers: int) -> list[range]:
    """Blocks of slots whose sizes differ by one at most."""
    ends = [n_slots * number // n_workers for number in range(n_workers + 1)]
    return [range(first, last) for first, last in pairwise(ends)]


def _in_order(answers: dict[int, Any]) -> list[tuple[int, Any]]:
    """Outcomes of all workers, by slot."""
    return [each for number in sorted(answers) for each in answers[number]]
