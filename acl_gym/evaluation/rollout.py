"""One episode in each slot of any vector environment.

In Algorithms 4.1 and 4.2 every ant walks until it reaches the goal or has made T steps,
and then waits for the others. Vector environments differ in what they do with a slot
that has finished. `Rollout` hides the difference: an agent sees only the ants that are
still walking.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from numba import njit
from numpy.typing import NDArray

from acl_gym.colony.episodes import Episodes
from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.wrappers.partial_reset import reset_slots
from acl_gym.envs.wrappers.waiting import WaitingVectorEnv
from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray
from acl_gym.utils.vector_envs import require_vector_env


class Step(NamedTuple):
    """The outcome of one step for the ants that took it, arrays of shape `(m,)`."""

    ants: IntArray
    """The slots that took the step."""
    observation: NDArray[Any]
    """Observations of all slots after the step, `(num_envs, ...)`."""
    cost: FloatArray
    """Stage costs, -reward."""
    terminated: BoolArray
    """Whether the episode ended in a terminal state."""
    finished: BoolArray
    """Whether the episode is over: a terminal state, the environment's limit or T."""


class _Record:
    """Observations, actions and stage costs of all slots, step by step."""

    def __init__(self, observation: NDArray[Any]) -> None:
        self.observations = [observation]
        self.actions: list[IntArray] = []
        self.costs: list[FloatArray] = []

    def append(self, observation: NDArray[Any], actions: IntArray, reward: Any) -> None:
        self.observations.append(observation)
        self.actions.append(actions)
        self.costs.append(-np.asarray(reward, dtype=np.float64))


class Rollout:
    """Steps each slot through one episode of at most `max_steps` steps.

    - In environments of this package finished slots wait, at no cost
      (`reset(options={"finished": "wait"})`), as they do in a `WaitingVectorEnv`.
    - Where autoreset is disabled, finished slots are reset by mask and stepped along
      with the others; their outcomes are ignored.
    - Where the environment resets slots itself, the outcomes of finished slots are
      ignored; the last observation is recovered from `infos["final_obs"]`.

    Args:
        env: any vector environment with `Discrete` actions.
        max_steps: T, >= 1.

    Attributes:
        ants: the slots that are still walking.
        cost: J of each slot so far, the sum of its stage costs.
        length: steps of each slot so far.
        terminated: whether the episode of each slot has ended in a terminal state.
        action_mask: which actions each slot may take now, `(num_envs, n_actions)`, the
            set U_q of the selection rule (3.4). None if the environment gives no
            `infos["action_mask"]`.

    Raises:
        TypeError: `env` is not a vector environment.
        ValueError: its action space is not `Discrete`.
    """

    def __init__(self, env: VectorEnv[Any, Any, Any], max_steps: int) -> None:
        require_vector_env(env)
        space = env.single_action_space
        if not isinstance(space, spaces.Discrete):
            raise ValueError(
                f"env must have Discrete actions, got {space}; discretise them, for "
                "instance with gymnasium.wrappers.TransformAction."
            )
        self.env = env
        self.max_steps = validation.integer("max_steps", max_steps, at_least=1)
        self.n_actions = int(space.n)
        self._asks_to_wait = isinstance(env.unwrapped, ControlVectorEnv)
        self._waits = isinstance(env.unwrapped, (ControlVectorEnv, WaitingVectorEnv))
        self._mode = AutoresetMode(
            env.metadata.get("autoreset_mode", AutoresetMode.NEXT_STEP)
        )
        self._actions = np.full(env.num_envs, space.start, dtype=np.int64)
        self.first_action = int(space.start)
        self._all = np.arange(env.num_envs)
        self._stale: BoolArray | None = None  # slots to reset before the next step
        self.action_mask: BoolArray | None = None
        self._reported_success: BoolArray | None = None

    def start(
        self,
        seed: int | None = None,
        states: FloatArray | None = None,
        record: bool = False,
    ) -> NDArray[Any]:
        """Begin an episode in every slot.

        Args:
            seed: seeds the environment, >= 0; None continues its stream.
            states: initial states `(num_envs, ...)`, for environments that take
                `options["state"]`; None draws them.
            record: keep every step for `episodes`.

        Returns:
            The first observations, `(num_envs, ...)`.
        """
        options: dict[str, Any] = {}
        if self._asks_to_wait:
            options |= {"finished": "wait", "max_steps": self.max_steps}
        if states is not None:
            options["state"] = states
        observation, infos = self.env.reset(
            seed=validation.seed(seed), options=options or None
        )
        n = self.env.num_envs
        self._read_mask(infos)
        self.ants = self._all
        self.cost = np.zeros(n)
        self.length = np.zeros(n, dtype=np.int64)
        self.terminated = np.zeros(n, dtype=np.bool_)
        self._reported_success = None
        self.steps = 0
        self._stale = None
        observation = np.asarray(observation)
        self._record: _Record | None = _Record(observation) if record else None
        return observation

    def step(self, actions: IntArray) -> Step:
        """Take one action with every walking ant.

        Args:
            actions: index of an action for each of `ants`, shape `(m,)`.

        Returns:
            The outcome of the step. Ants that have finished are removed from `ants`.

        Raises:
            ValueError: a reward is NaN or infinite.
        """
        ants = self.ants
        if self._stale is not None:
            reset_slots(self.env, self._stale)
            self._stale = None
        _spread(ants, actions, self.first_action, self._actions)
        # A copy, because an environment or a wrapper may keep its actions.
        observation, reward, terminated, truncated, infos = self.env.step(
            self._actions.copy()
        )
        observation = np.asarray(observation)
        self._read_mask(infos)
        self.steps += 1

        m = ants.size
        cost, left = np.empty(m), np.empty(m, np.int64)
        reached, stopped = np.empty(m, np.bool_), np.empty(m, np.bool_)
        n_left, bad = _account(
            ants,
            np.asarray(reward, dtype=np.float64),
            np.asarray(terminated, dtype=np.bool_),
            np.asarray(truncated, dtype=np.bool_),
            self.cost,
            self.length,
            self.terminated,
            cost,
            reached,
            stopped,
            left,
        )
        if bad >= 0:
            raise ValueError(
                f"rewards must be finite, got {reward[bad]} in slot {bad}; check the "
                "environment's reward function."
            )
        if not self._asks_to_wait:
            self._note_success(infos, ants)
        if self._mode is AutoresetMode.DISABLED and not self._waits:
            # Idle slots that finish another episode are reset with the others.
            done = np.logical_or(terminated, truncated)
            self._stale = done if done.any() else None
        if n_left < m:
            self.ants = left[:n_left]
            if self._mode is AutoresetMode.SAME_STEP and not self._waits:
                observation = self._last_seen(ants[stopped], observation, infos)
        if self.steps >= self.max_steps:
            self.ants = ants[:0]
            stopped = np.ones_like(stopped)
        if self._record is not None:
            self._record.append(observation, self._actions - self.first_action, reward)
        return Step(ants, observation, cost, reached, stopped)

    def episodes(self) -> Episodes:
        """The steps of every slot since `start(record=True)`.

        Raises:
            ValueError: nothing was recorded.
        """
        record = self._record
        if record is None or not record.actions:
            raise ValueError(
                "no steps were recorded; call start(record=True), then step."
            )
        return Episodes(
            np.stack(record.observations),
            np.stack(record.actions),
            np.stack(record.costs),
            self.length,
            self.terminated,
        )

    @property
    def success(self) -> BoolArray | None:
        """Whether each slot's episode has been a success so far, `(num_envs,)`.

        In environments of this package: whether it has reached the goal. In others: what
        `infos["is_success"]` said last; None if it was never there, as then nothing is
        known of success.
        """
        return self.terminated if self._asks_to_wait else self._reported_success

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
        if self.action_mask is None:
            return None
        allowed = self.action_mask[self.ants]
        if not allowed.any(axis=1).all():
            slot = self.ants[int(np.argmin(allowed.any(axis=1)))]
            raise ValueError(
                f"every slot must have an allowed action, got none in slot {slot}; "
                "check the environment's action_mask."
            )
        return allowed

    def _note_success(self, infos: dict[str, Any], ants: IntArray) -> None:
        """Take over what the infos of a step say of the ants that took it."""
        # Where slots are reset in the same step, the infos of their ends come last.
        for part in (infos, infos.get("final_info")) if infos else ():
            told = None if part is None else part.get("is_success")
            if part is None or told is None:
                continue
            if self._reported_success is None:
                self._reported_success = np.zeros(self.env.num_envs, dtype=np.bool_)
            given = np.asarray(part.get("_is_success", True), dtype=np.bool_)
            noted = ants[np.broadcast_to(given, self._reported_success.shape)[ants]]
            self._reported_success[noted] = np.asarray(told)[noted] != 0

    def _read_mask(self, infos: dict[str, Any]) -> None:
        mask = infos.get("action_mask") if infos else None
        if mask is None:
            self.action_mask = None
            return
        mask = np.array(mask)
        shape = (self.env.num_envs, self.n_actions)
        if mask.shape != shape or mask.dtype.kind not in "biuf":
            raise ValueError(
                f"infos['action_mask'] must have shape {shape}, one row per slot, got "
                f"{mask.shape} of {mask.dtype}."
            )
        self.action_mask = mask != 0
        # A slot without a mask may take any action.
        given = infos.get("_action_mask")
        if given is not None:
            self.action_mask |= ~np.asarray(given, dtype=np.bool_)[:, None]

    def _last_seen(
        self, stopped: IntArray, observation: NDArray[Any], infos: dict[str, Any]
    ) -> NDArray[Any]:
        """Observations; where an episode has just ended, its final observation."""
        observation = observation.copy()
        for slot in stopped:
            observation[slot] = infos["final_obs"][slot]
        if self.action_mask is not None:
            # The mask already belongs to the next episode.
            final = infos.get("final_info", {}).get("action_mask")
            self.action_mask[stopped] = True if final is None else final[stopped] != 0
        return observation


@njit(cache=True)
def _spread(
    ants: IntArray, actions: IntArray, first_action: int, all_actions: IntArray
) -> None:
    """Write the actions of the walking ants into the array of all slots."""
    for j in range(ants.size):
        all_actions[np.uint64(ants[j])] = actions[j] + first_action


@njit(cache=True)
def _account(
    ants: IntArray,
    reward: FloatArray,
    terminated: BoolArray,
    truncated: BoolArray,
    total_cost: FloatArray,
    length: IntArray,
    ended: BoolArray,
    cost: FloatArray,
    reached: BoolArray,
    stopped: BoolArray,
    left: IntArray,
) -> tuple[int, int]:
    """Add a step of the walking ants to their totals.

    Args:
        ants: the walking slots, `(m,)`.
        reward: of all slots.
        terminated: of all slots.
        truncated: of all slots.
        total_cost: J so far of all slots, updated.
        length: steps so far of all slots, updated.
        ended: whether each slot has ended in a terminal state, updated.
        cost: receives the stage cost of each walking ant, `(m,)`.
        reached: receives whether it is in a terminal state, `(m,)`.
        stopped: receives whether its episode has ended in any way, `(m,)`.
        left: receives the ants that are still walking, `(m,)`.

    Returns:
        The number of ants still walking, and a slot whose reward is not finite, or -1.
    """
    n_left = 0
    for j in range(ants.size):
        ant = np.uint64(ants[j])
        if not np.isfinite(reward[ant]):
            return n_left, int(ants[j])
        cost[j] = -reward[ant]
        total_cost[ant] += cost[j]
        length[ant] += 1
        ended[ant] |= terminated[ant]
        reached[j] = terminated[ant]
        stopped[j] = terminated[ant] | truncated[ant]
        left[n_left] = ants[j]
        n_left += not stopped[j]
    return n_left, -1
