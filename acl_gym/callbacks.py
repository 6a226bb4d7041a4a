"""What may happen between trials: your own function, or one of these objects."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray

from acl_gym import validation
from acl_gym.agents.policy import TablePolicy
from acl_gym.evaluation import PolicyCost, Predictor, evaluate_policy_cost

if TYPE_CHECKING:
    from acl_gym.agents.tabular import TabularAgent

Row = dict[str, float]
"""The measures of one trial, see `TabularAgent.history`."""


class Callback:
    """Base class: override what you need."""

    def on_training_start(self, agent: TabularAgent) -> None:
        """Called once before the first trial."""

    def on_trial_end(self, agent: TabularAgent, row: Row) -> bool | None:
        """Called after every trial; it may add measures to `row`.

        Returns:
            False to stop training; anything else goes on.
        """
        return True

    def on_training_end(self, agent: TabularAgent) -> None:
        """Called once after the last trial, also after an exception."""


Function = Callable[["TabularAgent", Row], Any]
Callbacks = None | Callback | Function | Iterable[Callback | Function]
"""What `learn` takes: nothing, one of these, or several."""


class _FunctionCallback(Callback):
    def __init__(self, function: Function) -> None:
        self._function = function

    def on_trial_end(self, agent: TabularAgent, row: Row) -> bool | None:
        return not is_stop(self._function(agent, row))


def is_stop(result: Any) -> bool:
    """Whether what a callback returned means to stop: False, Python's or NumPy's."""
    return isinstance(result, (bool, np.bool_)) and not result


def as_callbacks(callback: Callbacks) -> list[Callback]:
    """Bring every accepted form of `callback` into a list of objects.

    Raises:
        TypeError: something in it is neither a `Callback` nor callable.
    """
    if callback is None:
        return []
    if isinstance(callback, Callback):
        return [callback]
    if callable(callback) and not isinstance(callback, type):
        return [_FunctionCallback(callback)]
    if isinstance(callback, Iterable) and not isinstance(callback, str):
        return [one for each in callback for one in as_callbacks(each)]
    raise TypeError(
        "callback must be a Callback object, a function of (agent, row) or a list of "
        f"those, got {callback!r}."
    )


class PolicyEvaluation(Callback):
    """Evaluates the policy every few trials, and keeps the best one.

    Adds `policy_cost` (3.47) and `success_rate` to the trial's row; the cost is that
    which the agent learns to lower, `agent.cost` where it has one. Evaluation draws
    nothing from the agent's generator and its time is not counted: learning is the
    same with it and without it.

    Args:
        env: where to evaluate, see `evaluate_policy_cost`.
        states: initial states; None takes those of the environment.
        every: evaluate after each so many trials, and after the last, >= 1.
        max_steps: T of the evaluation; None takes that of the environment.
        seed: of an environment that is random: every evaluation is from the same
            initial states, with the same luck.
        policy: what to evaluate, a function of the agent, for instance
            `lambda colony: colony.soft_policy(seed=0)`; None takes the agent's own
            greedy policy.

    Attributes:
        best: the evaluation of the best policy so far: the lowest cost.
        best_policy: that policy, unchanged by what the agent learns afterwards.
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
    ) -> None:
        self.seed = seed
        self.policy = policy
        self.env = env
        self.states = states
        self.every = validation.integer("every", every, at_least=1)
        if max_steps is not None:
            max_steps = validation.integer("max_steps", max_steps, at_least=1)
        self.max_steps = max_steps
        self.best: PolicyCost | None = None
        self.best_policy: Predictor | None = None

    def on_trial_end(self, agent: TabularAgent, row: Row) -> bool | None:
        """Evaluate if it is time to."""
        if row["trial"] % self.every == 0:
            self._evaluate(agent, row)
        return True

    def on_training_end(self, agent: TabularAgent) -> None:
        """Evaluate the last policy if the last trial was not, and is whole."""
        if agent.in_trial:
            return
        if agent.history and "policy_cost" not in agent.history[-1]:
            self._evaluate(agent, agent.history[-1])

    def _evaluate(self, agent: TabularAgent, row: Row) -> None:
        policy = agent if self.policy is None else self.policy(agent)
        if policy is agent:
            policy = agent.policy
        result = evaluate_policy_cost(
            policy,
            self.env,
            self.states,
            max_steps=self.max_steps,
            seed=self.seed,
            cost=getattr(agent, "cost", None),
        )
        row["policy_cost"] = result.cost
        row["success_rate"] = result.success_rate
        if self.best is None or result.cost < self.best.cost:
            self.best = result
            self.best_policy = (
                policy.copy() if isinstance(policy, TablePolicy) else policy
            )
