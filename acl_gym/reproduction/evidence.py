"""The results of runs, as claims and figures ask for them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import cache
from typing import Any

import numpy as np

from acl_gym.evaluation import PolicyCost, evaluate_policy_cost
from acl_gym.partitions import Discrete
from acl_gym.planning.q_iteration import fuzzy_q_iteration
from acl_gym.policies import TablePolicy
from acl_gym.reproduction.settings import Runnable, Setting
from acl_gym.utils.typing import FloatArray


class MissingRunsError(LookupError):
    """A setting was not run."""


class Evidence:
    """The results of each setting, seed by seed.

    Args:
        results: by the key of a setting, its results in the order of their seeds.
    """

    def __init__(self, results: Mapping[str, list[dict[str, Any]]]) -> None:
        self._results = results

    def of(self, keys: Collection[str]) -> Evidence:
        """The same of the settings with these keys alone."""
        return Evidence({k: v for k, v in self._results.items() if k in keys})

    def runs(self, setting: Runnable) -> list[dict[str, Any]]:
        """All results of a setting.

        Raises:
            MissingRunsError: it was not run.
        """
        found = self._results.get(setting.key)
        if not found:
            raise MissingRunsError(setting.key)
        return found

    def rows(self, setting: Runnable, measure: str = "policy_cost") -> FloatArray:
        """A measure after each trial of each run, `(runs, trials)`."""
        return setting.along(self.runs(setting), measure)

    def last(self, setting: Runnable, measure: str = "policy_cost") -> FloatArray:
        """A measure at the end of each run, `(runs,)`."""
        return np.array([run["rows"][measure][-1] for run in self.runs(setting)])

    def policy(self, setting: Setting, run: int) -> TablePolicy:
        """The last policy of a run."""
        partition = setting.make_partition()
        if partition is None:
            space = setting.make_env(1).single_observation_space
            partition = Discrete(int(space.n))
        levels = np.asarray(self.runs(setting)[run]["levels"])
        return TablePolicy(partition, levels.reshape(partition.n_cells, -1).copy())

    def policies(self, setting: Setting) -> list[TablePolicy]:
        """The last policies of all runs."""
        return [self.policy(setting, run) for run in range(len(self.runs(setting)))]

    def best_run(self, setting: Setting) -> int:
        """The run whose last policy is the cheapest."""
        return int(np.argmin(self.last(setting)))


def baseline(setting: Setting) -> tuple[TablePolicy, PolicyCost, float]:
    """Fuzzy Q-iteration on the cells of a setting: policy, its cost, the discount.

    The cheapest of discounts 1, 0.98 and 0.95, by the cost of the policy.
    """
    return _baseline(_Hashable(setting))


class _Hashable:
    """A setting by its key, for the cache."""

    def __init__(self, setting: Setting) -> None:
        self.setting = setting

    def __hash__(self) -> int:
        return hash(self.setting.key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Hashable) and self.setting.key == other.setting.key


@cache
def _baseline(wrapped: _Hashable) -> tuple[TablePolicy, PolicyCost, float]:
    setting = wrapped.setting
    env, partition, found = setting.make_env(), setting.make_partition(), []
    if partition is None:
        raise ValueError(f"{setting.env_id} has no cells to iterate over.")
    steps = setting.colony["max_steps"]
    for discount in (1.0, 0.98, 0.95):
        result = fuzzy_q_iteration(
            env, partition, discount=discount, max_iterations=500
        )
        cost = evaluate_policy_cost(result.policy, env, max_steps=steps)
        found.append((result.policy, cost, discount))
    return min(found, key=lambda each: each[1].cost)
