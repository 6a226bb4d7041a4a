"""Episodes one after the other in each slot of any vector environment.

In an asynchronous colony (§7.3) an ant that has finished does not wait for the others: it
sets out again. `Stream` is the `Rollout` for that.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv, VectorEnv

from acl_gym.colony.episodes import Episodes
from acl_gym.envs import received
from acl_gym.envs.wrappers.partial_reset import reset_slots
from acl_gym.evaluation.rollout import Rollout
from acl_gym.evaluation.rows import fixed, with_rows
from acl_gym.evaluation.steps import Outcome
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray

_NEVER = 2**62
"""A number of steps that is never made."""


class _Back(NamedTuple):
    """Ants that have come back in the same step, `(m,)` each."""

    ants: IntArray
    costs: FloatArray
    terminated: BoolArray
    success: BoolArray | None
    begun: IntArray
    """The step, counted from 0, with which the episode began."""
    ended: int
    """How many steps there were when it was over."""


class _Anew(NamedTuple):
    """The slots that the environment has reset in the last step, and where they stand."""

    slots: BoolArray
    observation: Any
    action_mask: BoolArray | None


class Stream(Rollout):
    """Steps slots through episodes of at most `max_steps` steps, without waiting.

    A trial begins with an episode in every slot. As long as one of these is under way,
    every ant that comes back sets out again. So a trial takes as many steps of the
    environment as a synchronous one, in each of which nearly all slots do something.
    Each trial begins anew in all slots, so that whatever happens to the environment or
    the agent between two trials, such as an evaluation or a file, changes nothing.

    How a slot starts anew depends on the environment:

    - Environments of this package, `WaitingVectorEnv`, `SyncVectorEnv`, `AsyncVectorEnv`
      and all whose autoreset is disabled are reset by mask, between two steps. What an
      ant does is then the same in every autoreset mode.
    - Others reset a slot themselves: in the same step, or in the next one. That next step
      is none of the ant's. They cannot be stopped after T steps, so that T must be at
      least their time limit.

    Args:
        env: any vector environment with `Discrete` actions.
        max_steps: T, >= 1.
        limit: the time limit of the environment, None if it has none.
        completes: what becomes of the episodes that are under way when every slot has
            finished its first. True: they go on to their end, and the slots that have
            finished wait. False: they end there.

    Attributes:
        cost: J so far of the episode under way in each slot.
        length: its steps so far.
        terminated: whether it has ended in a terminal state.
        returned: the ants that have finished in the last step, and have not set out
            again; None if there are none.

    Raises:
        TypeError: `env` is not a vector environment.
        ValueError: its action space is not `Discrete`, or its episodes cannot be ended
            after T steps.
    """

    def __init__(
        self,
        env: VectorEnv[Any, Any, Any],
        max_steps: int,
        limit: int | None = None,
        *,
        completes: bool,
    ) -> None:
        super().__init__(env, max_steps)
        self._completes = completes
        base = env.unwrapped
        self._by_mask = (
            self._waits
            or self._mode is AutoresetMode.DISABLED
            or isinstance(base, (SyncVectorEnv, AsyncVectorEnv))
        )
        if not self._by_mask and (limit is None or limit > self.max_steps):
            has = "no time limit" if limit is None else f"a time limit of {limit} steps"
            remedy = "" if limit is None else f"pass max_steps={limit}, or "
            raise ValueError(
                "an asynchronous colony must be able to end each episode after "
                f"max_steps={self.max_steps} steps, got {type(base).__name__}, which has "
                f'{has} and cannot reset one slot; {remedy}make it with autoreset_mode="'
                'Disabled" or as WaitingVectorEnv.make(id, num_envs).'
            )

    def start(
        self,
        seed: int | None = None,
        states: FloatArray | None = None,
        record: bool = False,
    ) -> Any:
        """Begin a trial, with an episode in every slot; see `Rollout.start`."""
        observation = super().start(seed, states, record)
        n = self.num_envs
        self._on_first = np.ones(n, dtype=np.bool_)
        self._begun = np.zeros(n, dtype=np.int64)
        self._back: list[_Back] = []
        self._resting = self._all[:0]  # slots that the next step will reset
        self._anew: _Anew | None = None
        # Where steps were made from, by their number, other than where the last one led.
        self._set_out_from: dict[int, Any] = {}
        self._look_ahead()
        return observation

    def _settle(self, given: Any, stopped: BoolArray, left: IntArray) -> Any:
        """See `Rollout._settle`."""
        ants, (observation, _, terminated, truncated, infos) = self._ants, given
        if not self._asks_to_wait:
            late = self.length[ants] >= self.max_steps
            if not self._by_mask and (late & ~stopped).any():
                raise ValueError(
                    f"episodes must end after max_steps={self.max_steps} steps, the time "
                    "limit of the environment, got a longer one in slot "
                    f"{ants[np.argmax(late & ~stopped)]}; check the environment."
                )
            stopped |= late
            left = ants[~stopped]
        if left.size < ants.size:
            back = ants[stopped]
            if self._mode is AutoresetMode.SAME_STEP and not self._waits:
                reset = np.logical_or(terminated, truncated)
                if reset[back].any():  # the others are timed out
                    mask = None if self._mask is None else self._mask.copy()
                    self._anew = _Anew(reset, observation, mask)
                    observation = self._last_seen(back[reset[back]], observation, infos)
            self._come_back(back)
            self._ants = left
        if self._resting.size:
            self._begun[self._resting] = self.steps
            self._ants = _joined(self._ants, self._resting)
            self._resting = self._all[:0]
        self._look_ahead()
        return observation

    def _look_ahead(self) -> None:
        """Find out after which step there is something to settle for sure."""
        if self._resting.size:
            self._due = self.steps + 1
        elif self._asks_to_wait or not self._ants.size:
            self._due = _NEVER  # but when episodes end
        else:
            longest = int(self.length[self._ants].max())
            self._due = self.steps + self.max_steps - longest

    def _come_back(self, ants: IntArray) -> None:
        """Note the episodes that have ended."""
        success = self.success
        self._on_first[ants] = False
        self.returned = ants
        self._back.append(
            _Back(
                ants,
                self.cost[ants],
                self.terminated[ants],
                None if success is None else success[ants],
                self._begun[ants],
                self.steps,
            )
        )
        self.length[ants] = 0

    def set_out(self, observation: Any) -> Any:
        """Let the ants that are `returned` set out again, unless the trial ends.

        Args:
            observation: of all slots after the step.

        Returns:
            Those from which the next step is made, `(num_envs, ...)`.

        Raises:
            ValueError: the environment does not return what it should.
        """
        back, self.returned = self.returned, None
        if back is None:
            return observation
        anew, self._anew = self._anew, None
        if not self._on_first.any():
            if not self._completes:
                self._ants = self._all[:0]
            return observation
        self.cost[back] = 0.0
        self.terminated[back] = False
        self._successes.forget(back)
        self._begun[back] = self.steps
        if self._by_mask or anew is not None:
            observation = self._reset(back, observation, anew)
            self._ants = _joined(self._ants, back)
        else:
            self._resting = back
            self._look_ahead()
            if not self._ants.size:  # nobody walks meanwhile
                observation = self._take(self._ants, *self._scratch)
        if self._record is not None:
            kept = observation if self._fresh else observation.copy()
            self._set_out_from[self.steps] = kept
        self._look_ahead()
        return observation

    def _reset(self, slots: IntArray, observation: Any, anew: _Anew | None) -> Any:
        """Start episodes in some slots; return the observations of all."""
        mask = np.zeros(self.num_envs, dtype=np.bool_)
        mask[slots] = True
        if anew is not None:
            done = mask & anew.slots
            observation = with_rows(observation, anew.observation, done)
            self._set_mask(anew.action_mask, done)
            mask &= ~done
        if not mask.any():
            return observation
        begun, infos = received.parts("reset", reset_slots(self.env, mask), 2)
        n = self.num_envs
        if self._stale is not None:
            stale = self._stale & ~mask
            self._stale = stale if stale.any() else None
        self._set_mask(
            received.action_mask(received.infos(infos, n), n, self.n_actions), mask
        )
        return with_rows(observation, received.observations(begun, n), mask)

    def _set_mask(self, allowed: BoolArray | None, slots: BoolArray) -> None:
        """Take over what some slots may do now; None: everything."""
        if allowed is None and self._mask is None:
            return
        if self._mask is None:
            self._mask = np.ones((self.num_envs, self.n_actions), dtype=np.bool_)
        self._mask[slots] = True if allowed is None else allowed[slots]

    def outcome(self) -> Outcome:
        """What the episodes that were finished since `start` came to.

        Where a trial ends before some ants have ever come back, also what theirs have
        come to by then, as in a `Rollout`.
        """
        away, success = np.flatnonzero(self._on_first), self.success
        told = [
            np.zeros(each.ants.size, np.bool_) if each.success is None else each.success
            for each in self._back
        ]
        return Outcome(
            np.concatenate([*(each.costs for each in self._back), self.cost[away]]),
            None if success is None else np.concatenate([*told, success[away]]),
            int(sum((b.ended - b.begun).sum() for b in self._back) + self.length.sum()),
        )

    def returned_episodes(self) -> Episodes:
        """The steps of the ants that are `returned`; see `episodes`."""
        return self._episodes(self._back[-1:])

    def episodes(self) -> Episodes:
        """The episodes that were finished since `start(record=True)`.

        Raises:
            ValueError: nothing was recorded.
        """
        return self._episodes(self._back)

    def _episodes(self, back: list[_Back]) -> Episodes:
        record = self._recorded()
        ants = np.concatenate([each.ants for each in back])
        begun = np.concatenate([each.begun for each in back])
        ended = np.concatenate([np.full(b.ants.size, b.ended) for b in back])
        lengths = ended - begun
        during = slice(begun.min(), ended.max())
        seen = np.stack(
            [
                self._set_out_from.get(step, record.observations[step])
                for step in range(during.start, during.stop)
            ]
        )
        after = np.stack(record.observations[1:][during])
        # Rows beyond the end of an episode repeat its last one.
        times = begun + np.arange(lengths.max())[:, None]
        times = np.minimum(times, ended - 1) - during.start
        observations = np.concatenate([seen[times, ants], after[None, -1, ants]])
        last = after[ended - 1 - during.start, ants]
        observations[lengths, np.arange(ants.size)] = last
        return Episodes(
            fixed(observations),
            fixed(np.stack(record.actions[during])[times, ants]),
            fixed(np.stack(record.costs[during])[times, ants]),
            fixed(lengths),
            fixed(np.concatenate([each.terminated for each in back])),
        )


def _joined(some: IntArray, others: IntArray) -> IntArray:
    """Slots of both, in ascending order."""
    return np.sort(np.concatenate([some, others]))
