"""Small vector environments for the tests of the adapter."""

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv
from stable_baselines3.common.vec_env import VecEnv

PENDULUM = "acl_gym/Pendulum-v0"
MODES = ("Disabled", "SameStep")
# Too fast for the goal region; without torque it has slowed enough one step later.
COASTING = [np.pi + 0.03, -0.166]


class Countdown(gym.Env[Any, Any]):
    """Ends by itself after `length` steps; everything it says can be foretold."""

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"]}  # noqa: RUF012

    def __init__(
        self,
        length: int = 3,
        space: spaces.Space[Any] | None = None,
        render_mode: str | None = "rgb_array",
    ) -> None:
        self.length = length
        self.render_mode = render_mode
        self.observation_space = space or spaces.Box(0, 100, (2,), np.float32)
        self.action_space: spaces.Space[Any] = spaces.Discrete(2)
        self.given: dict[str, Any] = {}

    def _look(self) -> Any:
        now = np.array([self.t, self.t], dtype=np.float32)
        if isinstance(self.observation_space, spaces.Dict):
            return {"place": now, "flag": self.t % 2}
        return now

    def reset(self, *, seed: Any = None, options: Any = None) -> tuple[Any, Any]:
        super().reset(seed=seed)
        self.t = 0
        self.given = {"seed": seed, "options": dict(options or {})}
        return self._look(), {"begun": self.np_random.integers(2**31)}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.t += 1
        info = {"t": self.t} if self.t % 2 else {}
        return self._look(), -0.1 * self.t, self.t == self.length, False, info

    def double(self, number: int) -> int:
        return 2 * number * self.length

    def render(self) -> Any:
        return np.full((4, 6, 3), self.length, dtype=np.uint8)


DICT_SPACE = spaces.Dict(
    {"place": spaces.Box(0, 100, (2,), np.float32), "flag": spaces.Discrete(2)}
)


def countdowns(
    *lengths: int,
    mode: str = "Disabled",
    space: spaces.Space[Any] | None = None,
    **kwargs: Any,
) -> SyncVectorEnv:
    makers: list[Callable[[], gym.Env[Any, Any]]] = [
        lambda length=length: Countdown(length, space)  # type: ignore[misc]
        for length in lengths
    ]
    return SyncVectorEnv(makers, autoreset_mode=AutoresetMode(mode), **kwargs)


def pendulums(num_envs: int, mode: str = "Disabled", **kwargs: Any) -> VectorEnv:
    return gym.make_vec(PENDULUM, num_envs=num_envs, autoreset_mode=mode, **kwargs)


def step(env: VecEnv, action: int = 0) -> Any:
    return env.step(np.full(env.num_envs, action))
