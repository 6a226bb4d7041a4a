"""Stable-Baselines3's DQN on the environments of this package.

`make_dqn` returns a plain `stable_baselines3.DQN`. Its hyperparameters are
`DQNSettings`; docs/dqn-tuning.md describes how the defaults were chosen.

The network sees continuous observations scaled (`Scaling`). Observations from a finite
space are one-hot, as Stable-Baselines3 encodes them, so the network knows as much about
the states as a table does.

The networks are small, so that one thread is fastest: `torch.set_num_threads(1)`. Train
one agent at a time in a process: Stable-Baselines3 seeds the global generators of
Python, NumPy and torch when it makes an agent with a seed.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.vector import VectorEnv
from numpy.typing import ArrayLike, NDArray
from stable_baselines3 import DQN
from stable_baselines3.common.type_aliases import PolicyPredictor
from stable_baselines3.common.utils import LinearSchedule
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper, VecMonitor
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn

from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.wrappers.scaling import ScaledVectorObservation, Scaling
from acl_gym.partitions.discrete import FINITE_SPACES
from acl_gym.sb3.adapter import VectorEnvAdapter
from acl_gym.sb3.checks import checked_layers, checked_settings
from acl_gym.utils import validation


@dataclass(frozen=True, kw_only=True)
class DQNSettings:
    """Hyperparameters of `make_dqn`.

    The defaults are for the pendulum with its quadratic cost and 20,000 steps;
    `LONG_RUN` is for ten times as many. docs/dqn-tuning.md lists the other settings
    that were tried. Steps are counted per slot: n slots make n steps at a time.

    Attributes:
        num_envs: slots, >= 1. Four share the cost of choosing actions and still let the
            policy change every few steps of an episode. 8 were as good, 16 worse.
        updates_per_step: gradient steps for each step, > 0, a multiple of
            `1 / num_envs`. With half as many, learning took more steps; twice as many
            took twice the time and were no better.
        discount: gamma, in (0, 1]. The policy cost is undiscounted. With 0.98,
            hovering beside the goal costs almost nothing, and more policies hovered.
        reward_scale: factor on the rewards that the network learns from, > 0. It
            determines which errors fall into the quadratic part of the loss, below 1.
            With 0.1 learning began early, but small costs near the goal were lost in
            the noise; with 1 it began late.
        learning_rate: of Adam at the start, > 0. Twice the rate failed with one seed
            of two, half the rate was slower.
        final_learning_rate: at the end of `learn`, > 0, approached linearly. Over
            20,000 steps a falling rate brought no gain.
        batch_size: transitions for each gradient step, >= 1. 128 brought no gain.
        buffer_size: transitions remembered, >= 1; enough for all of 200,000 steps.
        learning_starts: steps with random actions before the first update, >= 0.
        target_update_interval: steps between copies to the target network, >= 1. Half
            the interval and twice the interval were both worse.
        target_update_rate: weight of the new parameters in each copy, in (0, 1]; 1
            replaces the target network. Small, frequent updates were no better.
        n_steps: rewards summed before bootstrapping from the value of a state, >= 1.
            3 was much worse: some of those rewards follow random actions.
        exploration_fraction: part of `learn` over which the probability of random
            actions falls linearly, in (0, 1]. 0.2 of 20,000 steps is 4,000.
        exploration_initial: that probability at the start, in [0, 1].
        exploration_final: that probability afterwards, in [0, 1]. Stable-Baselines3
            draws once for all slots together.
        max_grad_norm: the gradient is clipped to this length, > 0; the default of
            Stable-Baselines3.
        net_arch: units of each hidden layer, >= 1 each. Twice as many brought no gain.
        max_episode_steps: limit at which an episode is truncated, >= 1; the value of
            its last state is bootstrapped. With 100 instead of the 300 of the
            evaluation the slots see more initial states, and none of five seeds
            failed.
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
        object.__setattr__(self, "net_arch", checked_layers(self.net_arch))
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
"""Settings for 200,000 steps: exploration lasts no longer than in a short run, and the
learning rate falls. With the defaults, a run of this length keeps alternating between
policies that reach the goal and policies that hover beside it.
"""


class ScaledReward(VecEnvWrapper):
    """Scales the rewards that an agent sees; a monitor inside sees the original ones.

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
    """Make a vector environment with observations scaled for a network.

    Autoreset is disabled. Wrap an environment that does not support this in
    `ScaledVectorObservation` and `VectorEnvAdapter` yourself.

    Args:
        env_id: a registered id whose vector environment takes `autoreset_mode`, as
            all environments of this package do. Observations from a bounded
            one-dimensional box are scaled, those from a finite space are unchanged.
        num_envs: slots, >= 1. None makes one for each evaluation state of an
            environment of this package.
        circular: the circular variables, see `Scaling`. None takes those of the
            system in this package; other environments have none by default.
        env_kwargs: keyword arguments of the environment.

    Raises:
        ValueError: `num_envs` is None and the environment is not of this package, or
            `circular` variables are given for a finite space.
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
            f"num_envs is needed for {env_id}: only environments of acl_gym have "
            "evaluation states, one slot each."
        )
    circular = () if circular is None else tuple(circular)
    if isinstance(env.single_observation_space, FINITE_SPACES):
        if circular:
            raise ValueError(
                "circular must be empty if observations are from a finite space, got "
                f"{circular} for {env.single_observation_space}; leave it out."
            )
        return env
    return ScaledVectorObservation(env, circular)


def learning_env(
    env_id: str,
    num_envs: int,
    *,
    reward_scale: float,
    circular: Iterable[int] | None = None,
    **env_kwargs: Any,
) -> VecEnv:
    """Make what a model of Stable-Baselines3 learns in.

    From the inside out: the native vector environment with autoreset disabled,
    `ScaledVectorObservation` (except for a finite observation space),
    `VectorEnvAdapter`, `VecMonitor` (unscaled returns), `ScaledReward`.

    Args:
        env_id: see `scaled_env`.
        num_envs: slots, >= 1.
        reward_scale: factor on the rewards that the model learns from, > 0.
        circular: the circular variables, see `scaled_env`.
        env_kwargs: keyword arguments of the environment.
    """
    env = scaled_env(env_id, num_envs, circular=circular, **env_kwargs)
    return ScaledReward(VecMonitor(VectorEnvAdapter(env)), reward_scale)


def make_dqn(
    env_id: str,
    settings: DQNSettings | None = None,
    seed: int | None = None,
    *,
    circular: Iterable[int] | None = None,
    device: str = "cpu",
    **env_kwargs: Any,
) -> DQN:
    """Make a DQN agent that is ready to `learn`, in a `learning_env`.

    Args:
        env_id: a registered id with discrete actions, see `scaled_env`.
        settings: the hyperparameters; None takes the defaults.
        seed: determines the run, on one machine and one thread; None draws a seed.
        circular: the circular variables, see `scaled_env`.
        device: where torch computes. Networks this small gain nothing from a GPU.
        env_kwargs: keyword arguments of the environment, such as parameters of its
            system.

    Returns:
        The agent. It expects scaled observations: evaluate it in a `scaled_env`, or as
        a `ScaledPolicy` in the original environment. An agent for a finite space is
        evaluated in the original environment.

    Example:
        >>> from acl_gym.sb3.callback import PolicyCostCallback
        >>> from acl_gym.sb3.dqn import make_dqn, scaled_env
        >>> model = make_dqn("acl_gym/Pendulum-v0", seed=0)
        >>> costs = PolicyCostCallback(scaled_env("acl_gym/Pendulum-v0"), every=64)
        >>> model = model.learn(128, callback=costs)
        >>> [row["env_steps"] for row in costs.history]
        [64, 128]
    """
    settings = checked_settings(settings, DQNSettings)
    seed = validation.seed(seed)
    env = learning_env(
        env_id,
        settings.num_envs,
        reward_scale=settings.reward_scale,
        circular=circular,
        max_episode_steps=settings.max_episode_steps,
        **env_kwargs,
    )
    return DQN(
        "MlpPolicy",
        env,
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
        # Fused Adam passes over each array once: the same arithmetic in less time.
        policy_kwargs={
            "net_arch": list(settings.net_arch),
            "optimizer_kwargs": {"fused": True},
        },
        seed=seed,
        device=device,
    )


class ScaledPolicy:
    """Lets a model that learned from scaled observations take the original ones.

    Use it to run the model in the original environment, as in
    `evaluate_policy_cost(ScaledPolicy(model, space, [0]), env)`.

    Args:
        model: anything with `predict`, such as a DQN of `make_dqn`.
        space: the original observation space, a bounded one-dimensional `Box`.
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
