"""Letting a colony learn in a model until its policy no longer becomes better."""

from __future__ import annotations

import copy
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from acl_gym.agents.base import TabularAgent
from acl_gym.envs.learned import LearnedVectorEnv
from acl_gym.evaluation import evaluate_policy_cost
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray, Predictor

logger = logging.getLogger("acl_gym")

CHUNKS, LEAST_CHUNK = 15, 4_000
"""Evaluations of the policy in a round that does not end early, and the least steps
between two of them."""

PATIENCE = 0.4
"""The share of the steps of a round that may bring no better policy before it ends, where
the colony goes on with what it has learned before."""

ALIKE = 0.1
"""How much two models may differ, as a share of the standard deviation of a step's
change, for what ants remember of the older one to be still good enough."""

DOUBT, MOST_DOUBT = 3.0, 0.1
"""The share by which a later policy may cost more in the model and is preferred still: a
multiple of the model's largest error in cross-validation, and the most."""

BETTER = 0.005
"""The share by which a cost must fall to count as better."""


class Improving:
    """An agent that learns in one model after the other, and its best policy.

    Args:
        agent: what `learn_from_plant` was given, None excluded.
        best_file: where the agent is saved when its policy is the best; None: nowhere.

    Attributes:
        agent: what learns; None before the first model.
        best: the best policy in the newest model, a copy that no longer changes; None
            before the first. Of an agent that cannot be copied the agent itself, whose
            policy is the last one.
        cost: what it costs there.
    """

    def __init__(
        self, agent: TabularAgent | Callable[[Any], Any], best_file: Path | None
    ) -> None:
        self._make = None if isinstance(agent, TabularAgent) else agent
        if self._make is not None and not callable(self._make):
            raise TypeError(
                "agent must be an agent of this package or a function of the model that "
                f"makes one, got {validation.shown(agent)}."
            )
        self.agent: Any = agent if self._make is None else None
        self._best_file = best_file
        self._model: LearnedVectorEnv | None = None
        self._warned = False
        self.best: Predictor | None = None
        self.cost = np.inf

    def restore(
        self, agent_file: Path, best_file: Path, model: LearnedVectorEnv
    ) -> None:
        """Take over an agent and its best policy from files of a run that was killed.

        Args:
            agent_file: of the agent.
            best_file: of the agent when its policy was the best; it need not exist.
            model: what the agent has learned in.
        """
        self._model = model
        if self.agent is None:
            self.agent = self._made(model)
        kind = type(self.agent)
        self.agent = kind.load(agent_file, env=model)
        if best_file.exists():
            self.best = kind.load(best_file).policy

    def improve(
        self, model: LearnedVectorEnv, states: FloatArray, most_steps: int
    ) -> int:
        """Learn in a model.

        Args:
            model: it may be another one each time.
            states: from which policies are compared, `(n, n_variables)`.
            most_steps: after how many steps learning ends in any case.

        Returns:
            The steps of all ants.
        """
        begins = self._enter(model)
        self.cost = np.inf if self.best is None else self._cost(self.best, states)
        # The least cost of this round. Policies are not compared with the one taken last,
        # which may cost more by `doubt`: the cost could then rise without end.
        least = self.cost
        # A colony that begins needs time before it can surpass the best of those before.
        patience = most_steps if begins else PATIENCE * most_steps
        # Where the model errs, small differences between costs mean little. Then a later
        # policy is preferred, which has learned from more.
        doubt = min(DOUBT * max(model.dynamics.errors.values()), MOST_DOUBT)
        done, in_vain = 0, 0
        each = max(-(-most_steps // CHUNKS), LEAST_CHUNK)
        while done < most_steps and in_vain < patience:
            chunk = min(each, most_steps - done)
            self.agent.learn(total_timesteps=chunk)
            done += chunk
            own = isinstance(self.agent, TabularAgent)
            cost = self._cost(self.agent.policy if own else self.agent, states)
            in_vain = 0 if cost < (1.0 - BETTER) * least else in_vain + chunk
            # Where the agent itself stands for its policy, the older one is lost.
            if cost <= (1.0 + doubt) * least or self.best is self.agent:
                self.best, self.cost = self._snapshot(), cost
                if self._best_file is not None and hasattr(self.agent, "save"):
                    self.agent.save(self._best_file)
            least = min(least, cost)
        return done

    def _enter(self, model: LearnedVectorEnv) -> bool:
        """Let the agent walk in this model from now on, with what it has learned.

        Returns:
            Whether it begins anew.
        """
        begins = self.agent is None
        if begins:
            self.agent = self._made(model)
        elif isinstance(self.agent, TabularAgent):
            self.agent.set_env(model)
            believed = self._model is not None and _agree(self._model, model)
            if hasattr(self.agent, "forget") and not believed:
                # Paths in a model that is no longer believed. Their levels are no good
                # either: what promises too much has to be tried again pair by pair, and
                # a new colony is faster.
                if self._make is None:
                    self.agent.forget()
                else:
                    self.agent, begins = self._made(model), True
        elif self._model is not None:
            # An agent of another package keeps its environment, which changes.
            self._model.set_system(model.system, model.parameters)
            model = self._model
        self._model = model
        return begins

    def _snapshot(self) -> Predictor:
        """The policy of the agent as it is now, which no longer changes."""
        if isinstance(self.agent, TabularAgent):
            return self.agent.policy.copy()
        # What chooses the actions, without what learning needs, such as a large memory.
        policy: Any = getattr(self.agent, "policy", None)
        chooser: Any = (
            policy if callable(getattr(policy, "predict", None)) else self.agent
        )
        try:
            # Copies walk in no model, so they may share it.
            copied: Predictor = copy.deepcopy(chooser, {id(self._model): self._model})
        except Exception as error:  # whatever an agent of another package does
            if not self._warned:
                self._warned = True
                logger.warning(
                    "%s cannot be copied (%s), so its last policy is taken in place of "
                    "its best one.",
                    type(self.agent).__name__,
                    error,
                )
            return self.agent  # type: ignore[no-any-return]
        return copied

    def _made(self, model: LearnedVectorEnv) -> Any:
        made = self._make(model)  # type: ignore[misc]
        for name in ("learn", "predict"):
            if not callable(getattr(made, name, None)):
                raise TypeError(
                    f"the agent must have {name}, got {validation.shown(made)}."
                )
        return made

    def _cost(self, policy: Any, states: FloatArray) -> float:
        return evaluate_policy_cost(policy, self._model, states).cost  # type: ignore[arg-type]


def _agree(one: LearnedVectorEnv, other: LearnedVectorEnv) -> bool:
    """Whether two models predict about the same for what was recorded."""
    data = other.transitions
    x = np.ascontiguousarray(data.description.shown_angles.variables(data.states).T)
    u = np.ascontiguousarray(data.inputs.T)
    found = [env.dynamics.next_variables(x, u) for env in (one, other)]
    scale = other.dynamics.features.change_scale[:, None]
    missed = np.sqrt(np.mean(((found[0] - found[1]) / scale) ** 2, axis=1))
    return bool(missed.max() < ALIKE)
