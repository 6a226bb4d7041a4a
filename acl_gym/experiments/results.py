"""Access to stored results, for figures, tables and claims."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from acl_gym.experiments.study import AnyStudy
from acl_gym.utils.steps import hold_last_value
from acl_gym.utils.typing import FloatArray


@dataclass(frozen=True)
class Run:
    """The result of one run of a study with one seed.

    Attributes:
        rows: a row for each evaluation of the policy: `env_steps`, `seconds` (of
            learning, without evaluations), `policy_cost`, `success_rate`, and what
            the agent adds.
        table: what was learned, flat: pheromone levels, action values, or the weights
            of a network. `methods.restore_policy` makes a policy of it.
        seconds: of learning, without evaluations.
        failure: why the run broke down; "" if it did not.
        seed: its seed.
        made: where, when and with which versions it was made.
        partition: what `partition_from_settings` makes the partition of; None where the
            study says it.
    """

    rows: pd.DataFrame
    table: FloatArray
    seconds: float
    failure: str = ""
    seed: int = 0
    made: dict[str, Any] = field(default_factory=dict)
    partition: dict[str, Any] | None = None


class MissingRunsError(LookupError):
    """A study was not run."""


class Results:
    """The runs of each study, in the order of their seeds.

    Args:
        runs: by the key of a study.
    """

    def __init__(self, runs: Mapping[str, list[Run]]) -> None:
        self._runs = runs

    def runs(self, study: AnyStudy) -> list[Run]:
        """All runs of a study.

        Raises:
            MissingRunsError: there are none.
        """
        found = self._runs.get(study.key)
        if not found:
            raise MissingRunsError(f"{study} was not run.")
        return found

    def values(self, study: AnyStudy, measure: str = "policy_cost") -> FloatArray:
        """A measure as learning goes on, `(runs, points)`, at `Study.curve_points`.

        Where evaluations are not after each trial, a policy counts from its evaluation
        to the next, and the first one from the beginning.
        """
        runs, points = self.runs(study), study.curve_points()
        if points is None:
            return np.stack([run.rows[measure].to_numpy() for run in runs])
        rows = [run.rows for run in runs]
        return np.stack(
            [hold_last_value(r["env_steps"], r[measure], points) for r in rows]
        )

    def knows(self, study: AnyStudy, measure: str) -> bool:
        """Whether the runs of a study have a measure."""
        return all(measure in run.rows for run in self.runs(study))

    def last(self, study: AnyStudy, measure: str = "policy_cost") -> FloatArray:
        """A measure at the end of each run, `(runs,)`."""
        return np.array([run.rows[measure].iloc[-1] for run in self.runs(study)])

    def best(self, study: AnyStudy, measure: str = "policy_cost") -> FloatArray:
        """The measure of the cheapest policy of each run, `(runs,)`."""
        rows = [run.rows for run in self.runs(study)]
        return np.array(
            [each[measure].iloc[int(each["policy_cost"].argmin())] for each in rows]
        )

    def best_run(self, study: AnyStudy) -> int:
        """The number of the run whose last policy is the cheapest."""
        return int(np.argmin(self.last(study)))

    def median_run(self, study: AnyStudy) -> int:
        """The run with the median last policy cost; of an even number, the cheaper."""
        order = np.argsort(self.last(study), kind="stable")
        return int(order[(len(order) - 1) // 2])

    def first_within(self, study: AnyStudy, cost: float, measure: str) -> FloatArray:
        """When a policy first cost no more than `cost`, `(runs,)`; infinity if never.

        Args:
            study: which.
            cost: the bound.
            measure: "env_steps" or "seconds".
        """
        found = []
        for run in self.runs(study):
            at = run.rows[measure][run.rows["policy_cost"] <= cost]
            found.append(float(at.iloc[0]) if len(at) else math.inf)
        return np.array(found)

    def frame(self, studies: Mapping[str, AnyStudy]) -> pd.DataFrame:
        """All rows of some studies as one long table.

        Args:
            studies: by the label of the column `study`.
        """
        parts = [
            run.rows.assign(study=label, method=study.method, seed=run.seed)
            for label, study in studies.items()
            for run in self.runs(study)
        ]
        table = pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()
        first = ["study", "method", "seed"]
        return table[first + [name for name in table.columns if name not in first]]

    def made(self, studies: Iterable[AnyStudy]) -> dict[str, list[str]]:
        """By which commits, when, and on which processors the runs were made."""
        facts = [run.made for study in studies for run in self.runs(study)]
        return {
            name: sorted({str(each.get(name) or "unknown") for each in facts})
            for name in sorted({name for each in facts for name in each})
        }
