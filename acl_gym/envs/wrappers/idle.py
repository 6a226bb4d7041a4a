"""Which slots have finished and take no part in the next step, in every autoreset mode."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv

from acl_gym.envs import received
from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.wrappers.waiting import WaitingSlots
from acl_gym.utils.typing import BoolArray


class IdleSlots:
    """Keeps an account of the slots that do not make the next step.

    These are slots that wait after their end, and, where a slot is reset in the step
    after its last one, those of which the next step ignores the action.

    Args:
        env: the vector environment below.

    Attributes:
        mode: what the environment does with a slot that has finished.
        can_be_asked: whether it lets slots wait if `reset` is asked to.
        waits: whether its finished slots wait now.
        mask: the idle slots, `(num_envs,)`.
    """

    def __init__(self, env: VectorEnv[Any, Any, Any]) -> None:
        self.mode = received.autoreset_mode_of(env)
        self.can_be_asked = isinstance(env.unwrapped, ControlVectorEnv)
        self._always = isinstance(env.unwrapped, WaitingSlots)
        self.waits = self._always
        self.mask: BoolArray = np.zeros(int(env.num_envs), dtype=np.bool_)
        self._begun = False

    @property
    def can_wait(self) -> bool:
        """Whether finished slots can be made to wait."""
        return self.can_be_asked or self._always

    def begin(self, options: Any) -> BoolArray:
        """Note a reset that was made with these options; return the slots it started."""
        options = options or {}
        asked = self.can_be_asked and "finished" in options
        started = options.get("reset_mask")
        if started is None:
            self.waits = self._always or asked
            started = np.ones_like(self.mask)
        else:
            self.waits |= asked
        self.mask = self.mask & ~started
        self._begun = True
        return np.asarray(started)

    def finish(self, done: BoolArray) -> BoolArray:
        """Note a step in which these slots have finished; return those it started anew."""
        if self.waits or self.mode is AutoresetMode.DISABLED:
            self.mask = self.mask | done
            return np.zeros_like(done)
        if self.mode is AutoresetMode.SAME_STEP:
            return done
        started, self.mask = self.mask, done.copy()
        return started

    def require_begun(self) -> None:
        """Refuse a step before the first reset.

        Raises:
            ResetNeeded: there was none.
        """
        if not self._begun:
            raise ResetNeeded("call reset before the first step.")

    def require_reset(self) -> None:
        """Refuse a step of slots that nobody has reset since they have finished.

        Raises:
            ResetNeeded: there are such slots.
        """
        if self.mode is AutoresetMode.DISABLED and not self.waits and self.mask.any():
            slots = np.flatnonzero(self.mask)
            raise ResetNeeded(
                f"slots {slots[:10].tolist()} have finished and autoreset is disabled; "
                'call reset(options={"reset_mask": finished}) before the next step.'
            )
