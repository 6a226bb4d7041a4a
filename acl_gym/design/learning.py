"""Learn until the policy is good and stops improving, and keep the best one."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from acl_gym.callbacks.base import Agent, Callback
from acl_gym.design.colonies import colony_for
from acl_gym.design.simulation import simulate
from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.policies import TablePolicy
from acl_gym.utils.typing import FloatArray, Row

GOOD = 0.95
"""The share of starts from which the goal must be reached."""

CHOOSING = 500
"""Random starts from which the policies of one run are compared."""

FIRST, GROWTH = 1_500, 1.1
"""The least interactions between two evaluations, and the least factor by which they grow."""

BETTER = 0.01
"""Relative improvement of the cost that counts as one."""

PATIENCE = 0.5
"""Learning ends when the cost has not improved for this share of the interactions before."""

LEAST = 10_000
"""Interactions before it may end for that reason; twice as many if any start fails."""

_NO_LIMIT = 10**12  # interactions; the callback ends learning

CLOSE = 0.01
"""Success rates that differ by no more than this count as equal, and the cost decides."""

LEAVING = 1.0
"""By which share a cost counts more if the state stays in the goal from no start at all."""


@dataclass(frozen=True)
class Quality:
    """How good a policy is, from the starts for choosing.

    Attributes:
        cost: the mean.
        success_rate: the share of starts from which it reaches the goal.
        settled_rate: the share from which it stays there.
    """

    cost: float
    success_rate: float
    settled_rate: float

    @property
    def score(self) -> float:
        """The cost, more by up to `LEAVING` of it where the state leaves the goal again.

        Episodes end at the goal, so that ants do not learn to stay: of policies that cost
        much the same some do and some do not.
        """
        return self.cost * (1.0 + LEAVING * (1.0 - self.settled_rate))


@dataclass(frozen=True)
class Progress:
    """What is known while a colony learns.

    Attributes:
        interactions: steps of all ants together.
        seconds: since learning began.
        now: the policy as it is.
        best: the best policy so far.
    """

    interactions: int
    seconds: float
    now: Quality
    best: Quality


@dataclass(frozen=True)
class Learned:
    """What learning came to.

    Attributes:
        policy: the best one.
        interactions: steps of all ants together until learning ended.
        interactions_of_best: until the best policy.
        seconds: of learning and choosing.
        ended: why it ended: `"converged"`, `"time"`, `"steps"` or `"interrupted"`.
        rows: of each evaluation, `Progress`.
        ants: how many ants there were.
    """

    policy: TablePolicy
    interactions: int
    interactions_of_best: int
    seconds: float
    ended: str
    rows: tuple[Progress, ...]
    ants: int


class Choice:
    """The best policy of those seen.

    The success rate comes first, unless it differs by no more than `CLOSE`; then the score.

    Attributes:
        best: how good it is; None before the first.
        policy: it.
        interactions: when it was seen.
    """

    def __init__(self) -> None:
        self.best: Quality | None = None
        self.policy: TablePolicy | None = None
        self.interactions = 0
        self._highest = 0.0

    def look_at(self, policy: TablePolicy, found: Quality, steps: int) -> bool:
        """Take a policy if it is better; returns whether it is clearly better.

        Args:
            policy: copied if it is taken.
            found: how good it is.
            steps: interactions so far.
        """
        before = self.best
        self._highest = max(self._highest, found.success_rate)
        # Against the highest ever, so that many small steps do not lead far down.
        least = self._highest - CLOSE
        lost = before is None or before.success_rate < least
        if found.success_rate < least:
            return False
        if not lost and before is not None and found.score >= before.score:
            return False
        self.best, self.policy, self.interactions = found, policy.copy(), steps
        return before is None or lost or found.score < (1.0 - BETTER) * before.score


class _Watch(Callback):
    """Evaluates now and then, keeps the best policy, and ends learning."""

    def __init__(
        self,
        env: ControlVectorEnv,
        states: FloatArray,
        seconds: float | None,
        steps: int | None,
        stop: Callable[[], bool],
        tell: Callable[[Progress], None],
    ) -> None:
        self._env, self._states = env, states
        self._seconds, self._steps = seconds, steps
        self._stop, self._tell = stop, tell
        self._begun = time.monotonic()
        self._next = FIRST
        self._improved = 0
        self.choice = Choice()
        self.rows: list[Progress] = []
        self.ended = "interrupted"

    def elapsed(self) -> float:
        """Seconds since learning began."""
        return time.monotonic() - self._begun

    def on_trial_end(self, agent: Agent, row: Row) -> bool | None:
        """Look at the policy if it is time to, and decide whether to go on."""
        done = agent.num_timesteps
        why = None
        if self._stop():
            why = "interrupted"
        elif self._steps is not None and done >= self._steps:
            why = "steps"
        elif self._seconds is not None and self.elapsed() >= self._seconds:
            why = "time"
        if done >= self._next or why is not None:
            self._look(agent, done)
            self._next = max(done + FIRST, int(GROWTH * done))
            if why is None and self._steps is None and self._has_converged(done):
                why = "converged"
        if why is not None:
            self.ended = why
        return why is None

    def _look(self, agent: Any, done: int) -> None:
        policy = agent.policy
        now = quality(policy, self._env, self._states)
        if self.choice.look_at(policy, now, done):
            self._improved = done
        best = self.choice.best or now
        found = Progress(done, self.elapsed(), now, best)
        self.rows.append(found)
        self._tell(found)

    def _has_converged(self, done: int) -> bool:
        best = self.choice.best
        if best is None or best.success_rate < GOOD:
            return False
        least = LEAST if best.success_rate == 1.0 else 2 * LEAST
        return done >= max(least, (1.0 + PATIENCE) * self._improved)


def quality(policy: TablePolicy, env: ControlVectorEnv, states: FloatArray) -> Quality:
    """Simulate a policy from some starts, for twice the time limit."""
    limit = env.system.evaluation_steps
    found = simulate(policy, env, states, 2 * limit)
    return Quality(
        float(found.episode_costs().mean()),
        float(found.success().mean()),
        float(found.settled().mean()),
    )


def learn(
    env: ControlVectorEnv,
    states: FloatArray,
    *,
    seed: int,
    seconds: float | None,
    steps: int | None,
    stop: Callable[[], bool],
    tell: Callable[[Progress], None],
) -> Learned:
    """Let a colony learn a plant.

    Learning ends when the goal is reached from 95% of the starts and the cost has
    stopped improving, or at a limit. When it looks at the policy depends on the
    interactions only, so that the same seed and number of interactions give the same
    policy.

    Args:
        env: the plant.
        states: starts from which policies are compared, `(n, state_size)`.
        seed: of the colony.
        seconds: the most seconds; None sets no limit.
        steps: end after so many interactions, and not before; None decides as above.
        stop: asked after each trial; True ends learning.
        tell: called after each evaluation.

    Raises:
        KeyboardInterrupt: it was interrupted before any policy was evaluated.
    """
    _compile(env, states)
    watch = _Watch(env, states, seconds, steps, stop, tell)
    colony = colony_for(env, seed)
    try:
        with _without_hints():
            colony.learn(total_timesteps=_NO_LIMIT, callback=watch)
    except KeyboardInterrupt:
        if watch.choice.policy is None:
            raise
    policy = watch.choice.policy
    if policy is None:
        raise RuntimeError("learning ended before a policy was evaluated.")
    return Learned(
        policy,
        colony.num_timesteps,
        watch.choice.interactions,
        watch.elapsed(),
        watch.ended,
        tuple(watch.rows),
        colony.num_envs,
    )


def _compile(env: ControlVectorEnv, states: FloatArray) -> None:
    """Compile what is compiled at its first use, half a minute that are no learning."""
    colony = colony_for(env, 0).learn(trials=1)
    simulate(colony.policy, env, states[:2], 1)


@contextmanager
def _without_hints() -> Iterator[None]:
    """The log advises on parameters of the colony, which are not the user's here."""
    logger = logging.getLogger("acl_gym")
    before = logger.level
    logger.setLevel(logging.ERROR)
    try:
        yield
    finally:
        logger.setLevel(before)
