"""One episode in each slot of any vector environment.

In Algorithms 4.1 and 4.2 every ant walks until it reaches the goal or has made T steps,
and then waits for the others. Vector environments differ in what they do with a slot
that has finished. `Rollout` hides the difference: an agent sees only the ants that are
still walking.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv

from acl_gym.colony.episodes import Episodes
from acl_gym.envs import received
from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.control.native import is_native
from acl_gym.envs.wrappers.partial_reset import reset_slots
from acl_gym.envs.wrappers.waiting import WaitingSlots
from acl_gym.evaluation.rows import fixed, require_array, with_final_rows
from acl_gym.evaluation.steps import Outcome, Record, Step, account, spread_actions
from acl_gym.evaluation.successes import Successes
from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray
from acl_gym.utils.vector_envs import require_discrete_actions, require_vector_env

_INT = np.dtype(np.int64)


class Rollout:
    """Steps each slot through one episode of at most `max_steps` steps.

    - In environments of this package finished slots wait, at no cost
      (`reset(options={"finished": "wait"})`), as they do in a `WaitingVectorEnv` and a
      `WorkersVectorEnv`.
    - Where autoreset is disabled, finished slots are reset by mask and stepped along
      with the others; their outcomes are ignored.
    - Where the environment resets slots itself, the outcomes of finished slots are
      ignored; the last observation is recovered from `infos["final_obs"]`.

    What the environment returns is held against the number of slots, see
    `acl_gym.envs.received`, and copied where it is kept.

    Args:
        env: any vector environment with `Discrete` actions.
        max_steps: T, >= 1.

    Attributes:
        num_envs: the number of slots, which must not change.
        ants: the slots that are still walking, read-only.
        cost: J of each slot so far, the sum of its stage costs.
        length: steps of each slot so far.
        terminated: whether the episode of each slot has ended in a terminal state.
        returned: the ants that are back, all of them once the last has finished; None as
            long as one of them walks.
        action_mask: which actions each slot may take now, `(num_envs, n_actions)`, the
            set U_q of the selection rule (3.4). None if the environment gives no
            `infos["action_mask"]`.

    Raises:
        TypeError: `env` is not a vector environment.
        ValueError: its action space is not `Discrete`.
    """

    def __init__(self, env: VectorEnv[Any, Any, Any], max_steps: int) -> None:
        require_vector_env(env)
        space = require_discrete_actions(env)
        self.env = env
        self.max_steps = validation.integer("max_steps", max_steps, at_least=1)
        self.n_actions = int(space.n)
        self._asks_to_wait = isinstance(env.unwrapped, ControlVectorEnv)
        self._waits = isinstance(env.unwrapped, (ControlVectorEnv, WaitingSlots))
        # Wrappers may reuse arrays, our own environments do not.
        self._fresh = isinstance(env, ControlVectorEnv)
        self._mode = received.autoreset_mode_of(env)
        self._n_slots = validation.integer("env.num_envs", env.num_envs, at_least=1)
        self._actions = np.full(self._n_slots, space.start, dtype=np.int64)
        self.first_action = int(space.start)
        self._all = np.arange(self._n_slots)
        n = self._n_slots
        self._scratch = np.empty(n), np.empty(n, np.bool_), np.empty(n, np.bool_)
        self._stale: BoolArray | None = None  # slots to reset before the next step
        self._mask: BoolArray | None = None
        self._ants = self._all
        self._shown_of: IntArray | None = None  # what `_shown_ants` shows
        self._successes = Successes(self._n_slots, env.unwrapped)
        self._stepping = False
        # The environment, in trials in which what it returns need not be checked.
        self._native: ControlVectorEnv | None = None

    @property
    def num_envs(self) -> int:
        """The number of slots."""
        return self._n_slots

    @property
    def ants(self) -> IntArray:
        """The slots that are still walking, `(m,)`, read-only."""
        # Kernels take `_ants`: the call of one with a read-only array is slower.
        if self._shown_of is not self._ants:
            self._shown_of = self._ants
            self._shown_ants = validation.read_only(self._ants)
        return self._shown_ants

    @property
    def action_mask(self) -> BoolArray | None:
        """Which actions each slot may take now, `(num_envs, n_actions)`; None: all."""
        return self._mask

    def start(
        self,
        seed: int | None = None,
        states: FloatArray | None = None,
        record: bool = False,
    ) -> Any:
        """Begin an episode in every slot.

        Args:
            seed: seeds the environment, >= 0; None continues its stream.
            states: initial states `(num_envs, ...)`, for environments that take
                `options["state"]`; None draws them.
            record: keep every step for `episodes`.

        Returns:
            The first observations, `(num_envs, ...)`; of a Dict or Tuple space a dict
            or tuple of such arrays.

        Raises:
            TypeError: `seed` is not an integer.
            ValueError: it is negative, or the environment does not return what it
                should.
        """
        self._check_idle("start")
        self._native = self.env if is_native(self.env) else None
        seed, n = validation.seed(seed), self.num_envs
        options: dict[str, Any] = {}
        if self._asks_to_wait:
            options |= {"finished": "wait", "max_steps": self.max_steps}
        if states is not None:
            options["state"] = states
        observation, infos = received.parts(
            "reset", self.env.reset(seed=seed, options=options or None), 2
        )
        observation = received.observations(observation, n)
        self._read_mask(received.infos(infos, n))
        self._ants = self._all
        self.cost = np.zeros(n)
        self.length = np.zeros(n, dtype=np.int64)
        self.terminated = np.zeros(n, dtype=np.bool_)
        self._successes.start()
        # Those that kernels change.
        self._totals = self.cost, self.length, self.terminated
        self.steps = 0
        self._stale = None
        self.returned: IntArray | None = None
        self._due = self.max_steps
        if record:
            require_array(observation)
        self._record = Record(observation, self._fresh) if record else None
        return observation

    def step(self, actions: IntArray) -> Step:
        """Take one action with every walking ant.

        Args:
            actions: index of an action for each of `ants`, shape `(m,)`.

        Returns:
            The outcome of the step. Ants that have finished are removed from `ants`.

        Raises:
            ValueError: the actions are not one for each of `ants`; a reward is NaN or
                infinite; or the environment does not return what it should.
        """
        ants = self.ants
        return self._step(actions)._replace(ants=ants)

    def _step(self, actions: IntArray) -> Step:
        """`step` for kernels: with `_ants`, which are not to be changed."""
        ants = self._ants
        m = ants.size
        cost, reached, stopped = (
            np.empty(m),
            np.empty(m, np.bool_),
            np.empty(m, np.bool_),
        )
        observation = self._take(actions, cost, reached, stopped)
        return Step(ants, observation, cost, reached, stopped)

    def move(self, actions: IntArray) -> Any:
        """Do what `step` does, but return only the observations, which is faster."""
        return self._take(actions, *self._scratch)

    def _take(
        self,
        actions: IntArray,
        cost: FloatArray,
        reached: BoolArray,
        stopped: BoolArray,
    ) -> Any:
        """Take the actions of a step; return the observations of all slots.

        Args:
            actions: see `step`.
            cost: `(>= m,)`, receives the stage costs of the ants that took the step.
            reached: `(>= m,)`, receives whether they are in a terminal state.
            stopped: `(>= m,)`, receives whether their episodes are over.
        """
        if self._stepping:
            self._check_idle("step")
        ants, native = self._ants, self._native
        m = ants.size
        passed: Any = actions
        if type(actions) is not np.ndarray:
            actions = validation.as_array(passed)  # type: ignore[assignment]
        if (
            actions is None
            or actions.shape != ants.shape
            or actions.dtype.kind not in "iu"
        ):
            raise ValueError(
                f"actions must be integers of shape ({m},), one for each ant that "
                f"walks, got {validation.shown(passed)}."
            )
        if actions.dtype is not _INT:
            actions = actions.astype(np.int64, copy=False)
        if self._stale is not None:
            reset_slots(self.env, self._stale)
            self._stale = None
        bad = spread_actions(
            ants, actions, self.first_action, self.n_actions, self._actions
        )
        if bad >= 0:
            raise ValueError(
                f"actions must lie in 0..{self.n_actions - 1}, got {actions[bad]} in "
                f"slot {ants[bad]}."
            )
        # A copy, because an environment or a wrapper may keep its actions.
        self._stepping = True
        try:
            if native is None:
                given = self.env.step(self._actions.copy())
            else:
                given = native._step(self._actions.copy())
        finally:
            self._stepping = False
        if native is None:
            given = received.step_result(given, self._n_slots)
            self._read_mask(given[4])
        else:
            mask = given[4].get("action_mask")
            # Some give the int8 that Gymnasium's spaces sample with; kernels take bool.
            self._mask = None if mask is None else mask.view(np.bool_)
        observation, reward, terminated, truncated, infos = given
        self.steps += 1

        left = np.empty(m, np.int64)
        n_left, bad = account(
            ants,
            reward,
            terminated,
            truncated,
            *self._totals,
            cost,
            reached,
            stopped,
            left,
        )
        if bad >= 0:
            raise received.not_finite(reward, bad)
        if infos and self._successes.are_told:
            self._successes.note(infos, ants)
        if self._mode is AutoresetMode.DISABLED and not self._waits:
            # Idle slots that finish another episode are reset with the others.
            done = np.logical_or(terminated, truncated)
            self._stale = done if done.any() else None
        if n_left < m or self.steps >= self._due:
            observation = self._settle(given, stopped[:m], left[:n_left])
        if self._record is not None:
            self._record.append(observation, self._actions - self.first_action, reward)
        return observation

    def _settle(self, given: Any, stopped: BoolArray, left: IntArray) -> Any:
        """Do what is due when episodes have ended, or `_due` steps were made.

        Args:
            given: by the environment in this step.
            stopped: whether it has ended the episode of each ant, `(m,)`; receives also
                whether T has.
            left: the others.

        Returns:
            The observations of all slots after the step.
        """
        ants, (observation, _, _, _, infos) = self._ants, given
        if left.size < ants.size:
            self._ants = left
            if self._mode is AutoresetMode.SAME_STEP and not self._waits:
                observation = self._last_seen(ants[stopped], observation, infos)
        if self.steps >= self.max_steps:
            self._ants = ants[:0]
            stopped.fill(True)
        if not self._ants.size:
            self.returned = self._all
        return observation

    def set_out(self, observation: Any) -> Any:
        """Let the ants that are `returned` set out again, where they do not wait.

        Here they wait for the next `start`; see `Stream`.

        Args:
            observation: of all slots after the step.

        Returns:
            Those from which the next step is made, `(num_envs, ...)`.
        """
        return observation

    def outcome(self) -> Outcome:
        """What the episodes since `start` came to."""
        return Outcome(self.cost, self.success, int(self.length.sum()))

    def returned_episodes(self) -> Episodes:
        """The steps of the ants that are `returned`; see `episodes`."""
        return self.episodes()

    def episodes(self) -> Episodes:
        """The steps of every slot since `start(record=True)`.

        Raises:
            ValueError: nothing was recorded.
        """
        record = self._recorded()
        # Read-only, because a cost or an update rule of a user's own sees them.
        return Episodes(
            fixed(np.stack(record.observations)),
            fixed(np.stack(record.actions)),
            fixed(np.stack(record.costs)),
            validation.read_only(self.length),
            validation.read_only(self.terminated),
        )

    def _recorded(self) -> Record:
        """What was recorded, checked."""
        record = self._record
        if record is None or not record.actions:
            raise ValueError(
                "no steps were recorded; call start(record=True), then step."
            )
        if len({(seen.shape, seen.dtype.kind) for seen in record.observations}) > 1:
            shapes = sorted({str(seen.shape) for seen in record.observations})
            raise ValueError(
                "observations must have the same shape and type in every step, got "
                f"shapes {', '.join(shapes)}; check the environment's step and reset."
            )
        return record

    @property
    def success(self) -> BoolArray | None:
        """Whether each slot's episode has been a success so far, `(num_envs,)`.

        In environments of this package: whether it has reached the goal. In others: what
        `infos["is_success"]` said last; None if it was never there, as then nothing is
        known of success.
        """
        return self._successes.reported if self._successes.are_told else self.terminated

    def release(self) -> None:
        """Leave the environment as after a reset.

        Without this, slots that have finished would stand still for ever, or could not
        be stepped. Environments that reset their slots themselves are left as they are.
        """
        if self._waits or self._mode is AutoresetMode.DISABLED:
            self.env.reset()

    def allowed(self) -> BoolArray | None:
        """The actions that each walking ant may take, `(m, n_actions)`; None: all.

        Raises:
            ValueError: an ant may take no action at all.
        """
        if self._mask is None:
            return None
        allowed = self._mask[self._ants]
        if not allowed.any(axis=1).all():
            slot = self._ants[int(np.argmin(allowed.any(axis=1)))]
            raise ValueError(
                f"every slot must have an allowed action, got none in slot {slot}; "
                "check the environment's action_mask."
            )
        return allowed

    def allowed_after(self, ants: IntArray) -> BoolArray | None:
        """U_q where ants stand after a step, `(m, n_actions)`; None: all actions.

        `allowed` is for those that walk on. These may have finished: where an episode
        ends, an environment may allow nothing any more, and then all is allowed.

        Args:
            ants: slots, `(m,)`.
        """
        if self._mask is None:
            return None
        allowed = self._mask[ants]
        allowed[~allowed.any(axis=1)] = True
        return allowed

    def _check_idle(self, what: str) -> None:
        """Refuse calls from within `env.step`, which would disturb the step."""
        if self._stepping:
            raise RuntimeError(
                f"{what} must not be called while the environment makes a step; let "
                "env.step return first."
            )

    def _read_mask(self, infos: Any) -> None:
        """Take the action masks from checked infos."""
        self._mask = received.action_mask(infos, self.num_envs, self.n_actions)

    def _last_seen(self, stopped: IntArray, observation: Any, infos: Any) -> Any:
        """Observations; where an episode has just ended, its final observation."""
        shown = with_final_rows(observation, infos, stopped, self.num_envs)
        if self.action_mask is not None:
            # The mask already belongs to the next episode.
            last = received.infos(infos.get("final_info"), self.num_envs)
            allowed = received.action_mask(last, self.num_envs, self.n_actions)
            self.action_mask[stopped] = True if allowed is None else allowed[stopped]
        return shown
