"""What `acl-gym train` does around trials: files it keeps, plain progress, a hint."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np

from acl_gym.callbacks import Agent, Callback, Row
from acl_gym.callbacks.best import row_of_saved_best
from acl_gym.cli.errors import report
from acl_gym.cli.interrupts import Interruption
from acl_gym.evaluation import reports_returns
from acl_gym.utils import files

CHECKPOINT_SECONDS = 60.0
"""Between checkpoints, where no number of trials is given."""

PROGRESS_SECONDS = 5.0
"""Between two lines of progress where there is no terminal."""

EQUAL_TRIALS = 5
"""So many first trials in which all ants cost the same are worth a hint."""


class Keeper(Callback):
    """Keeps the state of the last whole trial, writes checkpoints, stops at a signal.

    Place it last, so that checkpoints contain what other callbacks measure.

    Args:
        path: the file of the agent; each checkpoint replaces it.
        every: trials between checkpoints; None writes one each minute.
        interruption: where a signal is noted.
    """

    def __init__(
        self, path: Path, every: int | None, interruption: Interruption
    ) -> None:
        self._path, self._every = path, every
        self._interruption = interruption
        self._last_whole: Any = None
        self._written = 0.0

    def on_training_start(self, agent: Any) -> None:
        """Keep the state before the first trial."""
        self._last_whole = agent.snapshot()
        self._written = time.monotonic()

    def on_trial_end(self, agent: Any, row: Row) -> bool | None:
        """Keep the state; save it if a checkpoint is due."""
        self._last_whole = agent.snapshot()
        if self._is_due(agent.trials):
            agent.save(self._path)
            self._written = time.monotonic()
        return not self._interruption.wanted

    def undo_trial(self, agent: Any) -> None:
        """Bring the agent back to its last whole trial, if one was interrupted."""
        if agent.in_trial and self._last_whole is not None:
            agent.take_back(self._last_whole)

    def _is_due(self, trial: int) -> bool:
        if self._every is not None:
            return trial % self._every == 0
        return time.monotonic() - self._written >= CHECKPOINT_SECONDS


def take_over_best(learner: Any, resumed: Path, best: Path) -> None:
    """Go on with the best policy of the resumed run where the run gets another name.

    Args:
        learner: as it was loaded.
        resumed: from where.
        best: the file of the best policy from now on. What is there stays if it is of
            this run and better.
    """
    resumed = files.with_suffix(resumed)
    if not resumed.stem.endswith("-best"):
        resumed = resumed.with_name(f"{resumed.stem}-best.npz")
    if resumed.resolve() == best.resolve():
        return
    found, there = (row_of_saved_best(path, learner) for path in (resumed, best))
    if found is None or (there and there["policy_cost"] <= found["policy_cost"]):
        return
    if best.exists() and there is None:
        report(
            "acl-gym",
            f"note: {best} was of another run; the best policy so far, {resumed}, "
            "replaces it.",
        )
    files.write_atomically(best, resumed.read_bytes())


class PlainProgress(Callback):
    """Writes a line to stderr every few seconds, for logs and pipes.

    Args:
        last: the number of the last trial.
    """

    def __init__(self, last: int) -> None:
        self._last = last
        self._shown = 0.0
        self._what = "cost"

    def on_training_start(self, agent: Any) -> None:
        """Start the clock."""
        self._shown = time.monotonic()
        returns = reports_returns(agent.env, getattr(agent, "cost", None))
        self._what = "return" if returns else "cost"

    def on_trial_end(self, agent: Agent, row: Row) -> bool | None:
        """Write a line if it is time to."""
        if time.monotonic() - self._shown >= PROGRESS_SECONDS:
            self._shown = time.monotonic()
            parts = [
                f"trial {row['trial']} of {self._last}",
                f"{row['env_steps']:,} steps",
                f"{row['seconds']:.0f} s",
                f"ants' {self._what} {row[f'ants_{self._what}']:.4g}",
            ]
            name = f"policy_{self._what}"
            known = next((e[name] for e in agent.history[::-1] if name in e), None)
            if known is not None:
                parts.append(f"policy {self._what} {known:.4g}")
            report("acl-gym", ", ".join(parts))
        return True


class EqualCosts(Callback):
    """Says once what it means that all ants cost the same from the first trial on."""

    def __init__(self) -> None:
        self._trials = 0
        self._done = False

    def on_training_start(self, agent: Any) -> None:
        """An agent that has learned before has had ants of different costs, or a hint."""
        self._done = agent.trials > 0

    def on_trial_end(self, agent: Any, row: Row) -> bool | None:
        """Count trials until one differs."""
        if self._done:
            return True
        costs = _costs(agent)
        self._trials += 1
        if costs.size < 2 or np.ptp(costs) > 0.0:
            self._done = True
        elif self._trials == EQUAL_TRIALS:
            self._done = True
            report(
                "acl-gym",
                f"hint: in the first {EQUAL_TRIALS} trials all {costs.size} ants cost "
                f"the same, {costs[0]:g}: no path is better than another, so that the "
                "colony learns nothing. Perhaps no ant reaches the goal by chance: try "
                "longer episodes (--max-steps), more ants (--ants), fewer cells "
                "(--cells), more exploration (--param epsilon=0.5), a cost that tells "
                "better failures from worse ones (--param cost=...), or --agent "
                "q-learning.",
            )
        return True


def _costs(agent: Any) -> Any:
    """J of each ant in the trial that has just ended."""
    from acl_gym.colony.costs import solution_costs

    if agent.cost is None:
        return agent.rollout.outcome().costs
    return solution_costs(agent.cost, agent.rollout.episodes())
