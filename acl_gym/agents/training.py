"""The frame around a learning loop: budget, clock, measures, callbacks, progress."""

from __future__ import annotations

import time
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from acl_gym.agents.base import TabularAgent
from acl_gym.callbacks.base import Callbacks, as_callbacks, is_stop
from acl_gym.evaluation import reports_returns
from acl_gym.evaluation.steps import Outcome
from acl_gym.partitions import locate_all
from acl_gym.utils import validation
from acl_gym.utils.serialization import check_row
from acl_gym.utils.typing import IntArray, Row

DEFAULT_TRIALS = 100
"""K of Table 5.2."""


class Training:
    """The frame of one call of `learn`; use it as a context manager.

    Args:
        agent: the agent that learns.
        total_timesteps: stop after the trial that reaches this many steps of all slots
            together; None sets no such limit.
        trials: K, stop after this many trials; None sets no such limit. With neither
            limit, 100 trials.
        callback: see `acl_gym.callbacks`.
        log_interval: print a line every `log_interval` trials; None prints nothing.
        progress_bar: show a progress bar.
    """

    def __init__(
        self,
        agent: TabularAgent,
        total_timesteps: int | None,
        trials: int | None,
        callback: Callbacks,
        log_interval: int | None,
        progress_bar: bool,
    ) -> None:
        if total_timesteps is not None:
            total_timesteps = validation.integer(
                "total_timesteps", total_timesteps, at_least=1
            )
        if trials is not None:
            trials = validation.integer("trials", trials, at_least=1)
        if log_interval is not None:
            log_interval = validation.integer("log_interval", log_interval, at_least=1)
        progress_bar = validation.boolean("progress_bar", progress_bar)
        if total_timesteps is None and trials is None:
            trials = DEFAULT_TRIALS
        if agent.busy:
            raise RuntimeError(
                "learn must not be called while a trial is under way; call it after the "
                "first call has returned."
            )
        # Before any work is done that could not be saved.
        agent.require_all_given()
        agent.checked_metadata()
        self._agent = agent
        cost = getattr(agent, "cost", None)
        self._reported = (
            "return" if reports_returns(agent.rollout.env, cost) else "cost"
        )
        self._last_step = _end(agent.num_timesteps, total_timesteps)
        self._last_trial = _end(agent.trials, trials)
        self._callbacks = as_callbacks(callback)
        self._log_interval = log_interval
        self._stopped = False
        self._policy: IntArray = np.empty(0, np.int64)
        if agent.measures_policy:
            self._policy = agent.policy.best_actions()
        self._partition = agent.partition
        in_trials = trials is not None
        self._bar: Any = tqdm(
            total=trials if in_trials else total_timesteps,
            unit="trial" if in_trials else "step",
            unit_scale=not in_trials,
            disable=not progress_bar,
            desc=type(agent).__name__,
        )
        self._bar_counts_trials = in_trials

    def __enter__(self) -> Self:
        for callback in self._callbacks:
            callback.on_training_start(self._agent)
        self._clock = time.perf_counter()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._agent.busy = False
        try:
            for callback in self._callbacks:
                callback.on_training_end(self._agent)
                if self._agent.history:
                    check_row(self._agent.history[-1])
        finally:
            self._bar.close()

    def next_trial(self) -> bool:
        """Whether there is another trial to make; if so, it has begun."""
        self._agent.in_trial = (
            not self._stopped
            and self._agent.num_timesteps < self._last_step
            and self._agent.trials < self._last_trial
        )
        self._agent.busy = self._agent.in_trial
        return self._agent.in_trial

    def end_trial(self, costs: NDArray[np.float64] | None = None) -> None:
        """Count the trial, measure it (§3.6.1) and call the callbacks.

        Args:
            costs: J of each finished episode; None takes the sums of the stage costs.
        """
        agent, outcome = self._agent, self._agent.outcome()
        agent.busy = False
        steps = outcome.n_steps
        agent.num_timesteps += steps
        agent.trials += 1
        agent.seconds += time.perf_counter() - self._clock
        row: Row = {
            "trial": agent.trials,
            "env_steps": agent.num_timesteps,
            "seconds": agent.seconds,
            "ants_cost": float((outcome.costs if costs is None else costs).mean()),
            **self._outcomes(outcome),
            **self._variation(),
            **agent.measures(self._policy),
        }
        agent.in_trial = False
        agent.history.append(row)
        for callback in self._callbacks:
            if is_stop(callback.on_trial_end(agent, row)):
                self._stopped = True
            check_row(row)
        self._report(row, 1 if self._bar_counts_trials else steps)
        self._clock = time.perf_counter()

    def _variation(self) -> Row:
        """How much of the policy has changed in the trial (§3.6.1)."""
        agent = self._agent
        if not agent.measures_policy:
            return {}
        policy = agent.policy.best_actions()
        variation = float(np.mean(policy != self._before()))
        self._policy, self._partition = policy, agent.partition
        return {"policy_variation": variation}

    def _before(self) -> IntArray:
        """The policy of the last trial, in the cells of the present partition."""
        old, new = self._partition, self._agent.partition
        if old is new:
            return self._policy
        index, degree = locate_all(old, new.cell_states(), old.n_cells)
        foremost = degree.argmax(axis=1)
        cells = index[np.arange(len(index)), foremost]
        return np.asarray(self._policy[cells])

    def _outcomes(self, outcome: Outcome) -> Row:
        """The measures of the ants that not every environment has."""
        found: Row = {}
        if reports_returns(self._agent.rollout.env):
            found["ants_return"] = float(-outcome.costs.mean())
        if outcome.success is not None:
            found["ants_success_rate"] = float(outcome.success.mean())
        return found

    def _report(self, row: Row, progress: int) -> None:
        self._bar.update(progress)
        every = self._log_interval
        is_due = bool(every and row["trial"] % every == 0)
        if self._bar.disable and not is_due:
            return  # a trial of a small colony takes less time than these words
        what = self._reported
        shown = {f"ants' {what}": f"{row[f'ants_{what}']:.1f}"}
        for each in (what, "cost"):  # the cost too if a user's callback added only that
            if f"policy_{each}" in row:
                shown[f"policy {each}"] = f"{row[f'policy_{each}']:.1f}"
                break
        self._bar.set_postfix(shown, refresh=False)
        if is_due:
            words = "  ".join(f"{name} {value}" for name, value in shown.items())
            self._bar.write(
                f"trial {row['trial']:>4}  steps {row['env_steps']:>9,}  "
                f"{row['seconds']:6.2f} s  {words}"
            )


def _end(done: int, more: int | None) -> float:
    return float("inf") if more is None else done + more
