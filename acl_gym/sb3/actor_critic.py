"""Stable-Baselines3's PPO and A2C on the environments of this package.

`make_ppo` and `make_a2c` return plain models of Stable-Baselines3, which learn in the same
`learning_env` as the DQN of `acl_gym.sb3.dqn` and are evaluated like it: the notes there
on scaled observations, threads and seeds hold here too. The defaults are those of
Stable-Baselines3, except that there are 8 slots, that episodes and the scale of rewards are
those of the DQN, and that PPO has larger batches and a higher learning rate. An interaction
then takes a fifth of the time that it takes with DQN.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from stable_baselines3 import A2C, PPO
from stable_baselines3.common.utils import LinearSchedule

from acl_gym.sb3.checks import checked_layers, checked_settings
from acl_gym.sb3.dqn import learning_env
from acl_gym.utils import validation


@dataclass(frozen=True, kw_only=True)
class A2CSettings:
    """Hyperparameters of `make_a2c`.

    Attributes:
        num_envs: slots, >= 1.
        n_steps: steps of each slot between two updates, >= 1.
        discount: gamma, in (0, 1].
        trace_decay: lambda of the generalised advantage estimate, in [0, 1].
        reward_scale: factor on the rewards that the network learns from, > 0.
        learning_rate: of the optimiser at the start, > 0.
        final_learning_rate: at the end of `learn`, > 0, approached linearly.
        entropy_weight: of the entropy in the loss, >= 0: how much the policy is kept from
            becoming certain.
        max_grad_norm: the gradient is clipped to this length, > 0.
        net_arch: units of each hidden layer of policy and value alike, >= 1 each.
        max_episode_steps: limit at which an episode is truncated, >= 1.
    """

    num_envs: int = 8
    n_steps: int = 5
    discount: float = 0.99
    trace_decay: float = 1.0
    reward_scale: float = 0.5
    learning_rate: float = 7e-4
    final_learning_rate: float = 7e-4
    entropy_weight: float = 0.0
    max_grad_norm: float = 0.5
    net_arch: tuple[int, ...] = (64, 64)
    max_episode_steps: int = 100

    def __post_init__(self) -> None:
        for name in ("num_envs", "n_steps", "max_episode_steps"):
            validation.integer(name, getattr(self, name), at_least=1)
        for name in (
            "reward_scale",
            "learning_rate",
            "final_learning_rate",
            "max_grad_norm",
        ):
            validation.number(name, getattr(self, name), above=0)
        validation.number("discount", self.discount, above=0, at_most=1)
        validation.number("trace_decay", self.trace_decay, at_least=0, at_most=1)
        validation.number("entropy_weight", self.entropy_weight, at_least=0)
        object.__setattr__(self, "net_arch", checked_layers(self.net_arch))


@dataclass(frozen=True, kw_only=True)
class PPOSettings(A2CSettings):
    """Hyperparameters of `make_ppo`; for those that are not here see `A2CSettings`.

    Attributes:
        batch_size: steps of a gradient step, in [2, num_envs * n_steps].
        epochs: passes over the steps of an update, >= 1.
        clip_range: how far the probability of an action may move in an update, > 0.
    """

    n_steps: int = 128
    trace_decay: float = 0.95
    learning_rate: float = 1e-3
    final_learning_rate: float = 1e-3
    batch_size: int = 256
    epochs: int = 10
    clip_range: float = 0.2

    def __post_init__(self) -> None:
        super().__post_init__()
        validation.integer("batch_size", self.batch_size, at_least=2)
        validation.integer("epochs", self.epochs, at_least=1)
        validation.number("clip_range", self.clip_range, above=0)
        if self.num_envs * self.n_steps < 2:
            raise ValueError(
                "num_envs * n_steps must be at least 2, because advantages are "
                f"normalised, got {self.num_envs} * {self.n_steps}; raise one of them."
            )


def make_a2c(
    env_id: str,
    settings: A2CSettings | None = None,
    seed: int | None = None,
    *,
    circular: Iterable[int] | None = None,
    device: str = "cpu",
    **env_kwargs: Any,
) -> A2C:
    """Make an A2C agent that is ready to `learn`; for the arguments see `make_dqn`."""
    settings = checked_settings(settings, A2CSettings)
    return A2C(**_common(env_id, settings, seed, circular, device, env_kwargs))


def make_ppo(
    env_id: str,
    settings: PPOSettings | None = None,
    seed: int | None = None,
    *,
    circular: Iterable[int] | None = None,
    device: str = "cpu",
    **env_kwargs: Any,
) -> PPO:
    """Make a PPO agent that is ready to `learn`; for the arguments see `make_dqn`."""
    settings = checked_settings(settings, PPOSettings)
    return PPO(
        **_common(env_id, settings, seed, circular, device, env_kwargs),
        # Stable-Baselines3 warns of a last batch that is smaller than the others.
        batch_size=_dividing(settings.batch_size, settings.num_envs * settings.n_steps),
        n_epochs=settings.epochs,
        clip_range=settings.clip_range,
    )


def _common(
    env_id: str,
    settings: A2CSettings,
    seed: int | None,
    circular: Iterable[int] | None,
    device: str,
    env_kwargs: dict[str, Any],
) -> dict[str, Any]:
    """What both models are made with."""
    env = learning_env(
        env_id,
        settings.num_envs,
        reward_scale=settings.reward_scale,
        circular=circular,
        max_episode_steps=settings.max_episode_steps,
        **env_kwargs,
    )
    return {
        "policy": "MlpPolicy",
        "env": env,
        "learning_rate": LinearSchedule(
            settings.learning_rate, settings.final_learning_rate, 1.0
        ),
        "n_steps": settings.n_steps,
        "gamma": settings.discount,
        "gae_lambda": settings.trace_decay,
        "ent_coef": settings.entropy_weight,
        "max_grad_norm": settings.max_grad_norm,
        "policy_kwargs": {"net_arch": list(settings.net_arch)},
        "seed": validation.seed(seed),
        "device": device,
    }


def _dividing(most: int, number: int) -> int:
    """The largest divisor of a number that is not larger than `most`."""
    return next(each for each in range(min(most, number), 0, -1) if number % each == 0)
