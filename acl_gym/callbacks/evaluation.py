"""Evaluation between trials, and early stopping."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray

from acl_gym.callbacks.base import Agent, Callback
from acl_gym.callbacks.best import row_of_saved_best
from acl_gym.evaluation import (
    PolicyCost,
    evaluate_policy_cost,
    policy_measures,
    with_slots_for,
)
from acl_gym.policies import TablePolicy
from acl_gym.utils import files, validation
from acl_gym.utils.typing import Predictor, Row
from acl_gym.utils.vector_envs import require_vector_env


class PolicyEvaluation(Callback):
    """Evaluates the policy every few trials and keeps the best one.

    Adds `policy_cost` (eq. (3.47)) to the trial's row, `policy_return` in environments
    of other packages, and `success_rate` where success is known. If the agent has an
    episode cost of its own (`agent.cost`), that is the cost evaluated.
    Evaluation draws no numbers from the agent's generator and its time is not counted,
    so that learning is the same with it as without it.

    Args:
        env: where to evaluate, see `evaluate_policy_cost`. An unwrapped environment of
            this package is copied at the first evaluation and left alone.
        states: initial states, `(n, state_size)`; None takes those of the environment.
        every: trials between evaluations, >= 1; the last trial is always evaluated.
        max_steps: T of the evaluation; None takes that of the environment.
        seed: of the environment, >= 0: every evaluation has the same initial states
            and the same random numbers. None continues the environment's stream.
        policy: a function of the agent that returns the policy to evaluate, for
            instance `lambda colony: colony.soft_policy(seed=0)`; None takes the
            agent's greedy policy.
        save_best: write the agent to this file whenever its policy is the best so
            far; None writes nothing. If the file exists, an agent that continues
            learning replaces it only by a better policy; but a file that is not of
            this run and environment is replaced in any case, with a warning.

    Attributes:
        best: the evaluation with the lowest cost so far; without `agent.cost` it is also
            the one with the highest return.
        best_policy: the policy of that evaluation; further learning does not change
            it.
        saved: the row of the trial after which the agent in the file `save_best` was
            written, with its `policy_cost`; None if none was.

    Raises:
        TypeError: `env` is not a vector environment, or `policy` not a function.
        FileNotFoundError: the folder of `save_best` does not exist.
    """

    def __init__(
        self,
        env: VectorEnv[Any, Any, Any],
        states: NDArray[np.float64] | None = None,
        *,
        every: int = 1,
        max_steps: int | None = None,
        seed: int | None = 0,
        policy: Callable[[Any], Predictor] | None = None,
        save_best: str | Path | None = None,
    ) -> None:
        require_vector_env(env)
        seed = validation.seed(seed)
        if policy is not None and not callable(policy):
            raise TypeError(
                "policy must be a function of the agent that returns what to evaluate, "
                f"got {validation.shown(policy)}."
            )
        self.save_best = None
        if save_best is not None:
            self.save_best = files.checked_target(files.with_suffix(save_best))
        self.saved: Row | None = None
        self.seed = seed
        self.policy = policy
        self.env = env
        self._env: VectorEnv[Any, Any, Any] | None = None  # with one slot per state
        self.states = states
        self.every = validation.integer("every", every, at_least=1)
        if max_steps is not None:
            max_steps = validation.integer("max_steps", max_steps, at_least=1)
        self.max_steps = max_steps
        self.best: PolicyCost | None = None
        self.best_policy: Predictor | None = None

    def on_training_start(self, agent: Agent) -> None:
        """Look up what is in the file, if the agent was there when it was written."""
        self.saved = None
        if self.save_best is None or not (self.save_best.exists() and agent.history):
            return
        self.saved = row_of_saved_best(self.save_best, agent)
        if self.saved is None:
            warnings.warn(
                f"{self.save_best} is not the best policy of this run so far, and is "
                "replaced at the next evaluation.",
                stacklevel=2,
            )

    def on_trial_end(self, agent: Agent, row: Row) -> bool | None:
        """Evaluate if an evaluation is due."""
        if row["trial"] % self.every == 0:
            self._evaluate(agent, row)
        return True

    def on_training_end(self, agent: Agent) -> None:
        """Evaluate the last policy, unless that was done or its trial is unfinished."""
        if agent.in_trial:
            return
        if agent.history and "policy_cost" not in agent.history[-1]:
            self._evaluate(agent, agent.history[-1])

    def _evaluate(self, agent: Agent, row: Row) -> None:
        policy = agent if self.policy is None else self.policy(agent)
        if policy is agent:
            policy = agent.policy
        if self._env is None:
            self._env = with_slots_for(self.env, self.states)
        result = evaluate_policy_cost(
            policy,
            self._env,
            self.states,
            max_steps=self.max_steps,
            seed=self.seed,
            cost=getattr(agent, "cost", None),
        )
        row.update(policy_measures(result, self._env))
        if self.best is None or result.cost < self.best.cost:
            self.best = result
            self.best_policy = (
                policy.copy() if isinstance(policy, TablePolicy) else policy
            )
        lowest = math.inf if self.saved is None else self.saved["policy_cost"]
        if self.save_best is not None and result.cost < lowest:
            agent.save(self.save_best)
            self.saved = dict(row)


_HIGHER_IS_BETTER = ("_return", "success_rate")
"""Ends of the names of measures that are good where they are high."""


class EarlyStop(Callback):
    """Stops when a measure has not improved for some time, or is good enough.

    Place it after the `PolicyEvaluation` that adds the measure. It starts afresh with
    every call of `learn`, and counts only trials whose row contains the measure.

    Args:
        patience: stop after this many such trials in a row without improvement, >= 1.
        measure: a key of the rows of `history`; lower is better, except for
            `policy_return`, `ants_return`, `success_rate` and `ants_success_rate`.
        min_improvement: a value counts as an improvement only if it is better than the
            best so far by more than this, >= 0.
        threshold: also stop once the measure is this good; None sets no threshold.

    Attributes:
        best: the best value so far, infinite before the first.
        waited: trials with the measure since the best one.

    Raises:
        TypeError: a parameter has the wrong type.
        ValueError: a parameter is out of range; or, while learning, no row contains
            the measure.
    """

    best: float
    waited: int

    def __init__(
        self,
        patience: int,
        measure: str = "policy_cost",
        min_improvement: float = 0.0,
        threshold: float | None = None,
    ) -> None:
        self.patience = validation.integer("patience", patience, at_least=1)
        if not isinstance(measure, str):
            raise TypeError(
                f"measure must be the name of a measure, got {validation.shown(measure)}."
            )
        self.measure = measure
        self._sign = -1.0 if measure.endswith(_HIGHER_IS_BETTER) else 1.0
        self.min_improvement = validation.number(
            "min_improvement", min_improvement, at_least=0
        )
        if threshold is not None:
            threshold = validation.number("threshold", threshold)
        self.threshold = threshold
        self._begin(0)

    def on_training_start(self, agent: Agent) -> None:
        """Start counting."""
        self._begin(len(agent.history))

    def on_trial_end(self, agent: Agent, row: Row) -> bool | None:
        """Read the measure if the row contains it."""
        value = row.get(self.measure)
        if value is None:
            # The rows before this one are complete.
            self._check_order(agent.history[self._first : -1])
            return True
        self._seen = True
        self.waited += 1
        sign = self._sign
        if sign * value < sign * self.best - self.min_improvement:
            self.best, self.waited = value, 0
        reached = self.threshold is not None and sign * value <= sign * self.threshold
        return not reached and self.waited < self.patience

    def on_training_end(self, agent: Agent) -> None:
        """Raise an error if no row contained the measure."""
        rows = agent.history[self._first :]
        if self._seen or agent.in_trial or not rows:
            return
        if not any(self.measure in row for row in rows):
            raise ValueError(
                f"EarlyStop needs rows with {self.measure!r}, got only "
                f"{', '.join(rows[-1])}; place a PolicyEvaluation before it in the "
                "list of callbacks."
            )

    def _begin(self, first: int) -> None:
        self._first = first
        self._seen = False
        self.best = self._sign * math.inf
        self.waited = 0

    def _check_order(self, rows: list[Row]) -> None:
        if not self._seen and rows and self.measure in rows[-1]:
            raise ValueError(
                f"EarlyStop must come after the callback that adds {self.measure!r}; "
                "move it behind that one in the list of callbacks."
            )
