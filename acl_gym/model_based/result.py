"""What learning from a plant has found."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from acl_gym.envs.learned import LearnedVectorEnv, Transitions
from acl_gym.utils.typing import Predictor, Row


@dataclass
class PlantLearning:
    """What `learn_from_plant` has found.

    Attributes:
        policy: the best policy in the newest model, a copy that does not change when the
            agent goes on; `predict` gives numbers of actions, counted from 0. Of an agent
            of another package that cannot be copied it is the agent itself.
        agent: what learned it, as it is at the end.
        model: the newest model, in which it learned.
        transitions: everything that was recorded.
        history: for each round `interactions`, `seconds` of computing, `model_error`
            (mean over the variables, see `LearnedDynamics.errors`), `model_cost` (of the
            best policy in the model) and `model_steps`.
    """

    policy: Predictor
    agent: Any
    model: LearnedVectorEnv
    transitions: Transitions
    history: list[Row] = field(default_factory=list)

    def predict(self, observation: Any, **how: Any) -> Any:
        """The actions of the policy; see `TablePolicy.predict`."""
        return self.policy.predict(observation, **how)
