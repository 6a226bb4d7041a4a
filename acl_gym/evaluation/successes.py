"""Which episodes of a rollout were a success."""

from __future__ import annotations

from typing import Any

import numpy as np

from acl_gym.envs import received
from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.utils.typing import BoolArray, IntArray


class Successes:
    """What `infos["is_success"]` says of the episode in each slot.

    Args:
        n_slots: how many slots there are.
        base: the vector environment, without wrappers.

    Attributes:
        are_told: whether infos are looked at; else an episode that ends in a terminal
            state is a success, which is so in a system of this package that cannot fail.
        reported: whether the last word on each slot was success, `(n_slots,)`; None as
            long as nothing was said of any.
    """

    def __init__(self, n_slots: int, base: Any) -> None:
        self._n_slots, self._base = n_slots, base
        self.are_told = True
        self.reported: BoolArray | None = None

    def start(self) -> None:
        """Begin a trial; nothing has been said yet."""
        base, own = self._base, isinstance(self._base, ControlVectorEnv)
        # Asked each time: a system may be replaced.
        self.are_told = not own or base.system.may_fail
        # In an environment of this package nobody has succeeded who has not said so.
        self.reported = np.zeros(self._n_slots, dtype=np.bool_) if own else None

    def note(self, infos: Any, ants: IntArray) -> None:
        """Take over what the infos of a step say of the ants that took it.

        Args:
            infos: checked, see `acl_gym.envs.received`.
            ants: slots, `(m,)`.
        """
        # Where slots are reset in the same step, the infos of their ends come last.
        for part in (infos, received.infos(infos.get("final_info"), self._n_slots)):
            told = received.success(part, self._n_slots)
            if told is None:
                continue
            success, given = told
            if self.reported is None:
                self.reported = np.zeros(self._n_slots, dtype=np.bool_)
            noted = ants[given[ants]]
            self.reported[noted] = success[noted]

    def forget(self, slots: IntArray) -> None:
        """Forget what was said of some slots, whose next episodes begin."""
        if self.reported is not None:
            self.reported[slots] = False
