"""Travelling salesmen that take any action, for tests that choose actions at random."""

from typing import Any

import numpy as np

from acl_gym.envs.graph.travelling_salesman import (
    TravellingSalesmanEnv,
    TravellingSalesmanVectorEnv,
)


def legal(actions: Any, mask: np.ndarray) -> Any:
    """Of the actions that are allowed in each slot the u-th, counted around.

    Args:
        actions: the numbers u; what are no actions of an environment comes back as it is.
        mask: which actions are allowed, `(n, n_actions)`.
    """
    given = np.asarray(actions)
    good = given.shape == (len(mask),) and given.dtype.kind in "iu"
    if not good or (given < 0).any() or (given >= mask.shape[1]).any():
        return actions
    allowed = [np.flatnonzero(row) for row in mask]
    return np.array([a[u % a.size] for a, u in zip(allowed, given, strict=True)])


class ObedientSalesmanEnv(TravellingSalesmanEnv):
    """Takes any action for one that is allowed."""

    def step(self, action: Any) -> Any:
        if self._state is not None and not self._finished:
            action = legal([action], self.system.action_mask(self._state))[0]
        return super().step(action)


class ObedientSalesmanVectorEnv(TravellingSalesmanVectorEnv):
    """Takes any action for one that is allowed."""

    def step(self, actions: Any) -> Any:
        if self._state is not None:
            actions = legal(actions, self.system.action_mask(self._state))
        return super().step(actions)
