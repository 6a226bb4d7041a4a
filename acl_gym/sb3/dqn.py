"""Stable-Baselines3's DQN on the environments of this package.

`make_dqn` puts the pieces together. What it returns is a plain `stable_baselines3.DQN`;
its hyperparameters are `DQNSettings`, chosen by measuring (docs/dqn-tuning.md).

A network sees continuous observations scaled (`Scaling`), and those of a finite space as
Stable-Baselines3 encodes them: one input for each value, 1 for that of the state and 0
for the others. It is then told as much about the states as a table is, and no more.

The networks are small: one thread is the fastest, `torch.set_num_threads(1)`. And
Stable-Baselines3 seeds the global generators of Python, NumPy and torch when an agent
with a seed is made, so train one such agent at a time in a process.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.vector import VectorEnv
from numpy.typing import ArrayLike, NDArray
from stable_baselines3 import DQN
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.type_aliases import PolicyPredictor
from stable_baselines3.common.utils import LinearSchedule
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper, VecMonitor
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn
from torch import Tensor

from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.wrappers.scaling import ScaledVectorObservation, Scaling
from acl_gym.evaluation import PolicyCost, evaluate_policy_cost
from acl_gym.partitions.discrete import FINITE_SPACES
from acl_gym.sb3.adapter import VectorEnvAdapter
from acl_gym.utils import validation
from acl_gym.utils.typing import Row


@dataclass(frozen=True, kw_only=True)
class DQNSettings:
    """Hyperparameters of `make_dqn`.

    The defaults are for the pendulum with its quadratic cost and 20,000 steps;
    `LONG_RUN` is for ten times as many. What was tried beside them, and how it went, is
    in docs/dqn-tuning.md. A step is one of one slot: n slots make n at a time.

    Attributes:
        num_envs: slots, >= 1. Four share the cost of choosing actions, and are few
            enough for the policy to change every few steps of an episode; 8 were as
            good, 16 worse.
        updates_per_step: gradient steps for each step, > 0 and a whole number times
            `1 / num_envs`. With half as many, learning took more steps; twice as many
            took twice the time and were no better.
        discount: gamma, in (0, 1]. The cost counts undiscounted; with 0.98 the
            cost of hovering just beside the goal nearly vanishes, and more policies
            hovered.
        reward_scale: factor on the rewards that the network learns from, > 0. It
            sets where the loss, quadratic below an error of 1, turns linear: with
            0.1 learning began early, but the small costs near the goal drown; with 1
            it began late.
        learning_rate: of Adam at the start, > 0. Twice as much failed with one seed of
            two, half as much was slower.
        final_learning_rate: at the end of `learn`, > 0, approached linearly. Over
            20,000 steps a falling rate gained nothing.
        batch_size: transitions for each gradient step, >= 1. 128 gained nothing.
        buffer_size: transitions remembered, >= 1; none is forgotten in 200,000 steps.
        learning_starts: steps with random actions before the first update, >= 0.
        target_update_interval: steps between copies to the target network, >= 1. Half
            the interval and twice as much were both worse.
        target_update_rate: how far each goes, in (0, 1]; 1 is a plain copy. Small and
            frequent ones were no better.
        n_steps: rewards summed before the value of a state is asked for, >= 1. 3 was
            much worse: some of those rewards are of actions taken at random.
        exploration_fraction: part of `learn` over which the probability of random
            actions falls linearly, in (0, 1]. 0.2 of 20,000 steps is 4,000.
        exploration_initial: that probability at the start, in [0, 1].
        exploration_final: and from then on, in [0, 1]. Stable-Baselines3 draws once
            for all slots together.
        max_grad_norm: the gradient is clipped to this length, > 0; the default of
            Stable-Baselines3.
        net_arch: units of each hidden layer, >= 1 each. Twice as many gained nothing.
        max_episode_steps: an episode is truncated then, and the value of its last
            state asked for as it should be, >= 1. With 100 instead of the 300 that
            policies are evaluated with, the slots see more initial states, and none of
            five seeds failed.
    """

    num_envs: int = 4
    updates_per_step: float = 1.0
    discount: float = 0.99
    reward_scale: float = 0.5
    learning_rate: float = 1e-3
    final_learning_rate: float = 1e-3
    batch_size: int = 64
    buffer_size: int = 200_000
    learning_starts: int = 1_000
    target_update_interval: int = 200
    target_update_rate: float = 1.0
    n_steps: int = 1
    exploration_fraction: float = 0.2
    exploration_initial: float = 1.0
    exploration_final: float = 0.05
    max_grad_norm: float = 10.0
    net_arch: tuple[int, ...] = (64, 64)
    max_episode_steps: int = 100

    def __post_init__(self) -> None:
        for name in (
            "num_envs",
            "batch_size",
            "buffer_size",
            "target_update_interval",
            "n_steps",
            "max_episode_steps",
        ):
            validation.integer(name, getattr(self, name), at_least=1)
        validation.integer("learning_starts", self.learning_starts, at_least=0)
        for name in (
            "updates_per_step",
            "reward_scale",
            "learning_rate",
            "final_learning_rate",
            "max_grad_norm",
        ):
            validation.number(name, getattr(self, name), above=0)
        for name in ("discount", "target_update_rate", "exploration_fraction"):
            validation.number(name, getattr(self, name), above=0, at_most=1)
        for name in ("exploration_initial", "exploration_final"):
            validation.number(name, getattr(self, name), at_least=0, at_most=1)
        object.__setattr__(self, "net_arch", tuple(self.net_arch))
        for units in self.net_arch:
            validation.integer("net_arch", units, at_least=1)
        if self.buffer_size < self.num_envs:
            raise ValueError(
                "buffer_size must be at least num_envs, got "
                f"{self.buffer_size} and {self.num_envs}."
            )
        updates = self.updates_per_step * self.num_envs
        if round(updates) < 1 or abs(updates - round(updates)) > 1e-9:
            raise ValueError(
                "updates_per_step * num_envs must be a whole number >= 1, got "
                f"{self.updates_per_step} * {self.num_envs} = {updates:g}."
            )

    @property
    def gradient_steps(self) -> int:
        """Gradient steps after each step of all slots."""
        return round(self.updates_per_step * self.num_envs)


LONG_RUN = DQNSettings(exploration_fraction=0.02, final_learning_rate=1e-5)
"""For 200,000 steps: explore for no more steps than in a short run, and let the step
size fall. With the defaults so long a run keeps swinging between policies that arrive
at the goal and policies that hover beside it.
"""


class ScaledReward(VecEnvWrapper):
    """Multiplies what an agent sees as reward; a monitor inside sees the true one.

    Args:
        venv: the environment.
        scale: the factor, > 0.
    """

    def __init__(self, venv: VecEnv, scale: float) -> None:
        self.scale = validation.number("scale", scale, above=0)
        super().__init__(venv)

    def reset(self) -> VecEnvObs:
        """Start an episode in every slot."""
        return self.venv.reset()

    def step_wait(self) -> VecEnvStepReturn:
        """Finish the step and scale its rewards."""
        observations, rewards, dones, infos = self.venv.step_wait()
        return observations, rewards * np.float32(self.scale), dones, infos


def scaled_env(
    env_id: str,
    num_envs: int | None = None,
    *,
    circular: Iterable[int] | None = None,
    **env_kwargs: Any,
) -> VectorEnv[Any, Any, Any]:
    """Make a vector environment that shows a network what it likes to see.

    Autoreset is disabled. For an environment that cannot be made so, put
    `ScaledVectorObservation` and `VectorEnvAdapter` around it yourself.

    Args:
        env_id: a registered id whose vector environment takes `autoreset_mode`, as
            all of this package do; its observations are a bounded box of one axis,
            which are scaled, or of a finite space, which stay as they are.
        num_envs: slots. None makes one for each state that an environment of this
            package evaluates policies from.
        circular: the circular variables, see `Scaling`. None takes those that the
            system of this package names, and none of any other environment.
        env_kwargs: keywords of the environment.

    Raises:
        ValueError: `num_envs` is None and the environment is not of this package; or
            there are `circular` variables in a finite space.
    """
    env = gym.make_vec(
        env_id,
        num_envs=1 if num_envs is None else num_envs,
        autoreset_mode="Disabled",
        **env_kwargs,
    )
    base = env.unwrapped
    if isinstance(base, ControlVectorEnv):
        if num_envs is None:
            env = base.with_slots(len(base.system.evaluation_states()))
        if circular is None:
            circular = base.system.circular
    elif num_envs is None:
        raise ValueError(
            f"num_envs is needed for {env_id}, which has no evaluation states; only "
            "environments of acl_gym have."
        )
    circular = () if circular is None else tuple(circular)
    if isinstance(env.single_observation_space, FINITE_SPACES):
        if circular:
            raise ValueError(
                "circular must be empty where observations are of a finite space, got "
                f"{circular} for {env.single_observation_space}; leave it out."
            )
        return env
    return ScaledVectorObservation(env, circular)


def make_dqn(
    env_id: str,
    settings: DQNSettings | None = None,
    seed: int | None = None,
    *,
    circular: Iterable[int] | None = None,
    device: str = "cpu",
    **env_kwargs: Any,
) -> DQN:
    """Make a DQN agent that is ready to `learn`.

    Its environment is, from the inside out: the native vector environment with
    autoreset disabled, `ScaledVectorObservation` (not around a finite space of
    observations), `VectorEnvAdapter`, `VecMonitor` (returns of episodes as they are),
    `ScaledReward`.

    Args:
        env_id: a registered id whose actions are discrete, otherwise as `scaled_env`
            wants it.
        settings: the hyperparameters; None takes the defaults.
        seed: a run is a function of it, on one machine and one thread; None draws one.
        circular: the circular variables, see `scaled_env`.
        device: where torch computes. Networks this small gain nothing from a GPU.
        env_kwargs: keywords of the environment, such as parameters of its system.

    Returns:
        The agent. Its observations are the scaled ones: evaluate it in a `scaled_env`,
        or as a `ScaledPolicy` in the environment as it is. One that learned from a
        finite space is evaluated in the environment as it is.

    Example:
        >>> from acl_gym.sb3.dqn import PolicyCostCallback, make_dqn, scaled_env
        >>> model = make_dqn("acl_gym/Pendulum-v0", seed=0)
        >>> costs = PolicyCostCallback(scaled_env("acl_gym/Pendulum-v0"), every=64)
        >>> model = model.learn(128, callback=costs)
        >>> [row["env_steps"] for row in costs.history]
        [64, 128]
    """
    settings = DQNSettings() if settings is None else settings
    env = scaled_env(
        env_id,
        settings.num_envs,
        circular=circular,
        max_episode_steps=settings.max_episode_steps,
        **env_kwargs,
    )
    return DQN(
        "MlpPolicy",
        ScaledReward(VecMonitor(VectorEnvAdapter(env)), settings.reward_scale),
        learning_rate=LinearSchedule(
            settings.learning_rate, settings.final_learning_rate, 1.0
        ),
        buffer_size=settings.buffer_size,
        learning_starts=settings.learning_starts,
        batch_size=settings.batch_size,
        tau=settings.target_update_rate,
        gamma=settings.discount,
        train_freq=1,
        gradient_steps=settings.gradient_steps,
        n_steps=settings.n_steps,
        target_update_interval=settings.target_update_interval,
        exploration_fraction=settings.exploration_fraction,
        exploration_initial_eps=settings.exploration_initial,
        exploration_final_eps=settings.exploration_final,
        max_grad_norm=settings.max_grad_norm,
        # Adam in one pass over each array: the same arithmetic in less time.
        policy_kwargs={
            "net_arch": list(settings.net_arch),
            "optimizer_kwargs": {"fused": True},
        },
        seed=seed,
        device=device,
    )


class ScaledPolicy:
    """A model that learned from scaled observations, given those as they are.

    So it can be followed in any environment, `evaluate_policy_cost(ScaledPolicy(model,
    space, [0]), env)`, or asked for its actions in a grid of states.

    Args:
        model: anything with `predict`, such as a DQN of `make_dqn`.
        space: the observation space as it is, a bounded `Box` of one axis.
        circular: the circular variables, such as `env.unwrapped.system.circular`.
    """

    def __init__(
        self,
        model: PolicyPredictor,
        space: spaces.Space[Any],
        circular: Iterable[int] = (),
    ) -> None:
        self.model = model
        self.scaling = Scaling(space, circular)

    def predict(
        self,
        observation: ArrayLike,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.int64], Any]:
        """Choose actions for an observation `(d,)` or a batch `(n, d)`."""
        features = self.scaling(observation)
        actions, state = self.model.predict(
            features,
            state=state,
            episode_start=episode_start,
            deterministic=deterministic,
        )
        return actions, state


class PolicyCostCallback(BaseCallback):
    """Evaluates the policy every so many steps, and keeps the best parameters.

    It evaluates between updates, without exploring and in an environment of its own,
    and draws no random number: learning is the same with it and without it. It goes
    into `learn(callback=...)` of any agent of Stable-Baselines3.

    Args:
        env: where to evaluate, with the observations that the model learns from: a
            `scaled_env` for a model of `make_dqn`. See `evaluate_policy_cost`.
        states: initial states; None takes those of the environment.
        every: steps between evaluations, >= 1. The policy at the end of `learn` is
            always evaluated.
        max_steps: T of the evaluation; None takes that of the environment.
        seed: of an environment that is random, as in `PolicyEvaluation`: every
            evaluation is from the same initial states, with the same luck.

    Attributes:
        history: one row an evaluation: `env_steps`, `seconds` (spent in `learn`, less
            the evaluations), `policy_cost` (3.47) and `success_rate`.
        best: the evaluation with the lowest cost so far.
        best_parameters: the parameters of the policy then; `restore_best` puts them
            back.
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
        self.env = env
        self.states = states
        self.every = validation.integer("every", every, at_least=1)
        self.max_steps = max_steps
        if seed is not None:
            seed = validation.integer("seed", seed, at_least=0)
        self.seed = seed
        self.history: list[Row] = []
        self.best: PolicyCost | None = None
        self.best_parameters: dict[str, Tensor] | None = None
        self._seconds = 0.0

    def restore_best(self) -> None:
        """Put the best parameters into the model.

        Raises:
            RuntimeError: nothing has been evaluated yet.
        """
        if self.best_parameters is None:
            raise RuntimeError("no policy was evaluated yet; call learn() first.")
        self.model.policy.load_state_dict(self.best_parameters)

    def _init_callback(self) -> None:
        wanted, given = self.model.observation_space, self.env.single_observation_space
        if wanted != given:
            raise ValueError(
                f"env must have the observations that the model learns from, {wanted}, "
                f"got {given}; make it with scaled_env(id) for a model of make_dqn."
            )

    def _on_training_start(self) -> None:
        self._due = self.num_timesteps + self.every
        self._clock = time.perf_counter()

    def _on_rollout_start(self) -> None:
        # Here, unlike in _on_step, the updates for the steps so far have been made.
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
                "policy_cost": result.cost,
                "success_rate": result.success_rate,
            }
        )
        if self.best is None or result.cost < self.best.cost:
            self.best = result
            self.best_parameters = {
                name: value.detach().clone()
                for name, value in self.model.policy.state_dict().items()
            }
        self._clock = time.perf_counter()
