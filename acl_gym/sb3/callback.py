"""Measuring the policy cost while an agent of Stable-Baselines3 learns."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper
from torch import Tensor

from acl_gym.evaluation import PolicyCost, evaluate_policy_cost, policy_measures
from acl_gym.sb3.adapter import VectorEnvAdapter
from acl_gym.utils import validation
from acl_gym.utils.typing import Row
from acl_gym.utils.vector_envs import require_vector_env


class PolicyCostCallback(BaseCallback):
    """Evaluates the policy at regular intervals and keeps the best parameters.

    It evaluates between updates, without exploration and in an environment of its own,
    and draws no random numbers, so that learning is the same with it as without it.
    Pass it to `learn(callback=...)` of any Stable-Baselines3 agent.

    Args:
        env: where to evaluate, with the observations that the model learns from: a
            `scaled_env` for a model of `make_dqn`. See `evaluate_policy_cost`. It must
            not be the environment that the model learns in, which an evaluation would
            reset in the middle of learning.
        states: initial states; None takes those of the environment.
        every: steps between evaluations, >= 1. The policy at the end of `learn` is
            always evaluated.
        max_steps: T of the evaluation; None takes that of the environment.
        seed: of the environment, as in `PolicyEvaluation`: every evaluation has the
            same initial states and the same random numbers.

    Attributes:
        history: one row per evaluation: `env_steps`, `seconds` (spent in `learn`,
            without the evaluations) and `policy_cost` (eq. (3.47)); `policy_return` in
            environments of other packages; `success_rate` where success is known, see
            `PolicyCost`.
        best: the evaluation with the lowest cost, which is the highest return, so far.
        best_parameters: the parameters of that policy, for `restore_best`.

    Raises:
        TypeError: `env` is not a vector environment, or a number is not an integer.
        ValueError: a number is too small.
    """

    def __init__(
        self,
        env: VectorEnv[Any, Any, Any],
        states: NDArray[np.float64] | None = None,
        *,
        every: int = 1_000,
        max_steps: int | None = None,
        seed: int | None = 0,
    ) -> None:
        super().__init__()
        require_vector_env(env)
        self.env = env
        self.states = states
        self.every = validation.integer("every", every, at_least=1)
        self.max_steps = max_steps
        self.seed = validation.seed(seed)
        self.history: list[Row] = []
        self.best: PolicyCost | None = None
        self.best_parameters: dict[str, Tensor] | None = None
        self._seconds = 0.0

    def restore_best(self) -> None:
        """Load the best parameters into the model.

        Raises:
            RuntimeError: no policy has been evaluated yet.
        """
        if self.best_parameters is None:
            raise RuntimeError("no policy has been evaluated yet; call learn() first.")
        self.model.policy.load_state_dict(self.best_parameters)

    def _init_callback(self) -> None:
        wanted, given = self.model.observation_space, self.env.single_observation_space
        if wanted != given:
            raise ValueError(
                f"env must have the observation space of the model, {wanted}, got "
                f"{given}; for a model of make_dqn make it with scaled_env(id)."
            )
        if _learns_in(self.model.get_env(), self.env):
            raise ValueError(
                "env must be another environment than the one the model learns in, "
                "which evaluations would reset in the middle of learning; make a second one."
            )

    def _on_training_start(self) -> None:
        self._due = self.num_timesteps + self.every
        self._clock = time.perf_counter()

    def _on_rollout_start(self) -> None:
        # Unlike in _on_step, the updates for the steps so far have been made here.
        if self.num_timesteps >= self._due:
            self._evaluate()
            self._due += self.every * (
                1 + (self.num_timesteps - self._due) // self.every
            )

    def _on_step(self) -> bool:
        return True

    def _on_training_end(self) -> None:
        self._evaluate()

    def _evaluate(self) -> None:
        self._seconds += time.perf_counter() - self._clock
        result = evaluate_policy_cost(
            self.model,
            self.env,
            self.states,
            max_steps=self.max_steps,
            seed=self.seed,
        )
        self.history.append(
            {
                "env_steps": self.num_timesteps,
                "seconds": self._seconds,
                **policy_measures(result, self.env),
            }
        )
        if self.best is None or result.cost < self.best.cost:
            self.best = result
            self.best_parameters = {
                name: value.detach().clone()
                for name, value in self.model.policy.state_dict().items()
            }
        self._clock = time.perf_counter()


def _learns_in(vec_env: VecEnv | None, env: VectorEnv[Any, Any, Any]) -> bool:
    """Whether a model with this `VecEnv` steps a vector environment."""
    while isinstance(vec_env, VecEnvWrapper):
        vec_env = vec_env.venv
    return (
        isinstance(vec_env, VectorEnvAdapter) and vec_env.env.unwrapped is env.unwrapped
    )
