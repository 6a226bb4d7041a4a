"""The native vector environment over a control system.

A system (`ControlSystem`) defines how states change. This module determines when a slot
starts, how long its episode may last, what happens when it has finished, and which
arrays are returned. Every array that `reset` or `step` returns is a new one. The single
environment over the same systems is in `single`; how a vector environment is made of a
system is in `system_env`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode
from numpy.typing import ArrayLike, NDArray

from acl_gym.envs.control.bookkeeping import (
    check_new_states,
    checked_actions,
    checked_inputs,
    checked_options,
    checked_trial_steps,
    count_step,
    draw_uniforms,
    drawn_action,
    final_infos,
    finish,
    n_actions_of,
    real_input_bounds,
    states_of_slots,
    warn_of_no_render_mode,
)
from acl_gym.envs.control.rendering import Frame
from acl_gym.envs.control.stepping import PartialStep
from acl_gym.envs.control.system import ControlSystem
from acl_gym.envs.control.system_env import Observation, SystemVectorEnv
from acl_gym.envs.limits import checked_limit, trial_limit
from acl_gym.envs.reset_mask import checked_reset_mask
from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray

StepResult = tuple[Observation, FloatArray, BoolArray, BoolArray, dict[str, Any]]


class ControlVectorEnv(SystemVectorEnv):
    """Native vector environment over a control system: one kernel call per step.

    Args:
        num_envs: number of slots, >= 1.
        max_episode_steps: an episode is truncated after this many steps; None or -1
            sets no limit. `gym.make_vec` passes the limit of the id if it is left out.
        autoreset_mode: what happens to a slot that has finished: "NextStep" (reset
            on the next step, whose action is ignored), "SameStep" (reset at once,
            last observation in `infos["final_obs"]`) or "Disabled" (the caller
            resets, `reset(options={"reset_mask": finished})`).
        render_mode: "rgb_array" lets `render` return a frame of each slot, None
            draws nothing. For a window use `gymnasium.wrappers.vector.HumanRendering`,
            which needs OpenCV as well (`pip install opencv-python`).
        parameters: the parameters of the system, see its class.

    Note:
        One generator serves all slots in slot order. With the same seed, another
        number of slots gives other initial states.
    """

    _trial_steps: int | None = None  # T of the trial under way

    def __init__(
        self,
        num_envs: int = 1,
        *,
        max_episode_steps: int | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        **parameters: Any,
    ) -> None:
        super().__init__(
            num_envs,
            max_episode_steps=max_episode_steps,
            autoreset_mode=autoreset_mode,
            render_mode=render_mode,
            **parameters,
        )
        self._input_bounds = real_input_bounds(self.system)
        self._n_actions = n_actions_of(self.system)
        self._actions: NDArray[Any] | None = None  # the last ones, to be drawn

        self._state: FloatArray | None = None  # (state_size, num_envs)
        self._steps = np.zeros(self.num_envs, dtype=np.int64)
        self._finished = np.zeros(self.num_envs, dtype=np.bool_)
        self._wait_when_finished = False
        self._walking: IntArray | None = None  # slots still walking; None means all
        self._all_slots = np.arange(self.num_envs)
        self._step_some = PartialStep(self.system, self.num_envs)

    @property
    def max_episode_steps(self) -> int | None:
        """The steps after which an episode is truncated; None: there is no limit."""
        return self._max_episode_steps

    @max_episode_steps.setter
    def max_episode_steps(self, value: int | None) -> None:
        self._max_episode_steps = checked_limit(value)
        self._limit = trial_limit(self._max_episode_steps, self._trial_steps)

    def set_system(self, system: ControlSystem, arguments: dict[str, Any]) -> None:
        """Go on with another system, from the states where the slots are.

        Args:
            system: of `system_with`.
            arguments: its arguments.

        Raises:
            ValueError: what can be observed or done there differs.
        """
        super().set_system(system, arguments)
        self._step_some = PartialStep(system, self.num_envs)

    @property
    def num_walking(self) -> int:
        """How many slots the next step moves; it resets the others, or they wait."""
        return self._num_envs if self._walking is None else self._walking.size

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode in all slots, or in some.

        Args:
            seed: seeds the generator of initial states; None continues its stream.
            options: any of

                - `"state"`: array `(num_envs, state_size)`, sets the states instead
                  of drawing them (rows outside the mask are ignored); states
                  of one variable may have shape `(num_envs,)`, goals are allowed;
                - `"reset_mask"`: bool array `(num_envs,)`, the slots to reset, the
                  others are left as they are;
                - `"finished"`: `"wait"`, in any autoreset mode: from now to the next
                  full reset a slot that has finished is not stepped. Its finish is
                  reported once; after that its action is ignored, its observation
                  stays, its reward is 0 and its flags are False. This is a
                  synchronous trial of a colony; idle slots cost nothing;
                - `"max_steps"`: T, an integer >= 1: to the next full reset an episode
                  is truncated after T steps, or after `max_episode_steps` if that is
                  less and was not just registered with the id.

        Returns:
            The observations of all slots, `(num_envs, ...)`, and the infos: empty,
            or, if not all actions are always available, `"action_mask"`, a bool array
            `(num_envs, n_actions)` for the states that the slots are in now.

        Raises:
            ValueError: the seed, a state, the mask or a key of `options` is not valid.
            TypeError: the seed is not an integer, or the mask is not a bool array.
            ResetNeeded: a mask was given before the first full reset.
        """
        seed = validation.seed(seed)
        options = checked_options(
            options, ("state", "reset_mask", "finished", "max_steps")
        )
        mask = checked_reset_mask(
            options.get("reset_mask"), self.num_envs, begun=self._state is not None
        )
        slots = np.arange(self.num_envs) if mask is None else np.flatnonzero(mask)
        given = options.get("state")
        states = None if given is None else self._checked_states(given, slots)
        if "finished" in options:
            validation.one_of("options['finished']", options["finished"], ("wait",))
        trial_steps = checked_trial_steps(options, mask)

        super().reset(seed=seed)
        if mask is None:
            self._wait_when_finished = False
            self._trial_steps = trial_steps
            self._limit = trial_limit(self._max_episode_steps, trial_steps)
        self._wait_when_finished |= "finished" in options
        self._start(slots, states)
        return self._observe(), self._infos()

    def step(self, actions: ArrayLike) -> StepResult:
        """Apply one action to each slot.

        Args:
            actions: integers of shape `(num_envs,)`; where the actions are a Box, real
                inputs `(num_envs, n_inputs)`, set to its bounds where they are beyond.

        Returns:
            `(observations, rewards, terminations, truncations, infos)`, new arrays.
            The infos are those of `reset` and, when an episode ends, `"is_success"`,
            whether that of each slot has reached the goal, under the mask
            `"_is_success"` of the slots whose episodes have ended; with "SameStep"
            they are in `infos["final_info"]`.

        Raises:
            ResetNeeded: there was no reset yet, or autoreset is disabled and a slot
                has finished.
            ValueError: an action has the wrong shape, is out of range or not finite.
            TypeError: the actions are not integers, or inputs no real numbers.
        """
        if self._state is None:
            raise ResetNeeded("step() needs states; call reset() first.")
        if self._input_bounds is not None:
            return self._step(
                checked_inputs(actions, self._num_envs, *self._input_bounds)
            )
        return self._step(checked_actions(actions, self._num_envs, self._n_actions))

    def _step(self, actions: NDArray[Any]) -> StepResult:
        """`step` after a reset, with actions that are known to be valid.

        Args:
            actions: a new int64 array `(num_envs,)`, which the environment keeps, or a
                float64 array `(num_envs, n_inputs)`.
        """
        self._actions = actions
        system, n_slots, state = self._system, self._num_envs, self._states
        walking = self._walking
        restarting = None if walking is None else self._slots_to_restart()
        rewards = np.zeros(n_slots)
        terminated = np.zeros(n_slots, np.bool_)
        truncated = np.zeros(n_slots, np.bool_)
        n_finished, failed = 0, None
        slots = self._all_slots if walking is None else walking
        uniforms = draw_uniforms(system, self, slots.size)
        if walking is None:
            failed = system.advance(state, actions, uniforms, rewards, terminated)
            if failed is not None:
                terminated |= failed
            n_finished = count_step(self._limit, self._steps, terminated, truncated)
        elif slots.size:
            n_finished, failed = self._step_some(
                self._limit,
                slots,
                self._finished,
                state,
                self._steps,
                actions,
                uniforms,
                rewards,
                terminated,
                truncated,
            )
        if restarting is not None:
            self._start(restarting, None)

        last: dict[str, Any] = {}
        if n_finished:
            walking = np.empty(n_slots, np.int64)
            ended = np.empty(n_slots, np.bool_)
            success = np.empty(n_slots, np.bool_)
            n_left = finish(
                terminated, truncated, self._finished, walking, ended, success
            )
            if failed is not None:
                success &= ~failed
                self._charge(failed, rewards)
            self._walking = walking[:n_left]
            last = {"is_success": success, "_is_success": ended}
            if (
                self.autoreset_mode is AutoresetMode.SAME_STEP
                and not self._wait_when_finished
            ):
                last = {**self._infos(), **last}
                last = final_infos(self._observe(), ended, last)
                self._start(np.flatnonzero(ended), None)
        infos = self._infos()
        if last:
            infos = {**last, **infos}
        return self._observe(), rewards, terminated, truncated, infos

    def _charge(self, failed: BoolArray, rewards: FloatArray) -> None:
        """Let slots pay that have failed in the step that was just counted.

        Here they do not.

        Args:
            failed: which, `(num_envs,)`.
            rewards: of the step, `(num_envs,)`, changed in place.
        """

    def render(self) -> tuple[Frame, ...] | None:
        """A frame `(480, 480, 3)` of each slot.

        Raises:
            ResetNeeded: there was no `reset` yet.
            DependencyNotInstalled: pygame is missing.
        """
        if self.render_mode is None:
            warn_of_no_render_mode(self.metadata)
            return None
        started = self._steps == 0
        idle = self._finished & self._wait_when_finished
        return tuple(
            self._renderer.frame(
                self._states[:, slot],
                None
                if self._actions is None or started[slot] or idle[slot]
                else drawn_action(self._actions[slot]),
            )
            for slot in range(self.num_envs)
        )

    def _slots_to_restart(self) -> IntArray | None:
        """The finished slots that this step must reset, None if there are none."""
        if self._walking is None or self._wait_when_finished:
            return None
        if self.autoreset_mode is AutoresetMode.DISABLED:
            slots = np.flatnonzero(self._finished)
            raise ResetNeeded(
                f"slots {slots[:10].tolist()} have finished and autoreset is disabled; "
                'call reset(options={"reset_mask": finished}) before the next step.'
            )
        return np.flatnonzero(self._finished)

    def _start(self, slots: IntArray, states: FloatArray | None) -> None:
        """Start `slots` in the given `(state_size, n)` states, or in random ones."""
        if states is None:
            states = self.system.sample_states(self.np_random, slots.size)
        size = None if self._state is None else len(self._state)
        check_new_states(self.system, states, slots.size, size)
        if slots.size == self.num_envs:
            self._state = states
        else:
            self._states[:, slots] = states
        self._steps[slots] = 0
        self._finished[slots] = False
        walking = np.flatnonzero(~self._finished)
        self._walking = None if walking.size == self.num_envs else walking

    def _infos(self) -> dict[str, Any]:
        mask = self._system.action_mask(self._states)
        if mask is None:
            return {}
        present = np.ones(self.num_envs, dtype=np.bool_)
        return {"action_mask": mask, "_action_mask": present}

    @property
    def states(self) -> FloatArray:
        """The states of all slots, `(num_envs, state_size)`, a copy.

        Raises:
            ResetNeeded: there was no reset yet.
        """
        return self._states.T.copy()

    @property
    def _states(self) -> FloatArray:
        if self._state is None:
            raise ResetNeeded("the slots have no states yet; call reset() first.")
        return self._state

    def _observe(self) -> Observation:
        return self._system.observe(self._states)

    def _checked_states(self, given: Any, slots: IntArray) -> FloatArray:
        current = None if self._state is None else self._state.T
        rows = states_of_slots(given, slots, self.num_envs, current)
        return self.system.checked_states(rows)[slots].T.copy()
