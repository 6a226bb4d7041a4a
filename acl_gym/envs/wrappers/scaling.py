"""Observations scaled for neural networks, in single and vector environments."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector import AutoresetMode, VectorEnv, VectorObservationWrapper
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from acl_gym.envs import received
from acl_gym.utils import validation
from acl_gym.utils.boxes import finite_bounds
from acl_gym.utils.typing import Float32Array
from acl_gym.utils.vector_envs import require_vector_env

TWO_PI = 2.0 * math.pi


class Scaling:
    """The map from observations in a bounded box to features in [-1, 1].

    A circular variable x becomes two features, (cos a, sin a) with
    a = 2 pi (x - low) / (high - low), so that its two ends meet. Any other variable
    becomes one, its position between its bounds, -1 at the low and 1 at the high one.
    Features come in the order of the variables.

    Args:
        space: a bounded `Box` of one axis.
        circular: the variables that wrap around, such as angles.

    Attributes:
        space: the `Box` of the features, float32.
        circular: the circular variables in order.

    Raises:
        TypeError: `circular` does not hold integers.
        ValueError: `space` is not such a box, or `circular` does not fit it.
    """

    def __init__(self, space: spaces.Space[Any], circular: Iterable[int] = ()) -> None:
        low, high = _bounds(space)
        axes = _checked_axes(circular, low.size)
        width = np.ones(low.size, dtype=np.int64)
        width[axes] = 2
        first = np.cumsum(width) - width
        self._low, self._range = low, high - low
        self.circular: tuple[int, ...] = tuple(axes.tolist())
        self._circular, self._linear = axes, np.flatnonzero(width == 1)
        self._cosine, self._ramp = first[self._circular], first[self._linear]
        self._size = int(width.sum())
        self.space = spaces.Box(-1.0, 1.0, (self._size,), np.float32)

    def __call__(self, observation: ArrayLike) -> Float32Array:
        """Return the features of one observation `(d,)` or of a batch `(n, d)`.

        Raises:
            ValueError: the last axis does not have the length d of the space, or an entry
                is not a finite number.
        """
        array = validation.as_array(observation)
        if array is None or array.dtype.kind not in "biuf":
            raise ValueError(
                f"observations must be real numbers, got {validation.shown(observation)}; "
                "check the environment."
            )
        values = array.astype(np.float64)
        if values.shape[-1:] != self._low.shape:
            raise ValueError(
                f"observations must have {self._low.size} variables on their last "
                f"axis, got shape {values.shape}."
            )
        if not np.isfinite(values).all():
            raise ValueError(
                f"observations must be finite, got {validation.shown(observation)}; check "
                "the environment."
            )
        place = (values - self._low) / self._range
        features = np.empty((*values.shape[:-1], self._size), dtype=np.float32)
        features[..., self._ramp] = 2.0 * place[..., self._linear] - 1.0
        angle = TWO_PI * place[..., self._circular]
        features[..., self._cosine] = np.cos(angle)
        features[..., self._cosine + 1] = np.sin(angle)
        return features


class ScaledObservation(
    gym.ObservationWrapper[Float32Array, Any, NDArray[Any]], RecordConstructorArgs
):
    """Scales the observations of one environment; see `Scaling` for how.

    Args:
        env: an environment whose observations are a bounded `Box` of one axis.
        circular: the variables that wrap around, such as angles.

    Raises:
        ValueError: the observation space is not such a box, or `circular` does not
            fit it.

    Example:
        >>> import gymnasium as gym, acl_gym
        >>> env = gym.make("acl_gym/Pendulum-v0")
        >>> env = acl_gym.ScaledObservation(env, circular=[0])
        >>> env.reset(options={"state": [0.0, 4.5]})[0].tolist()
        [1.0, 0.0, 0.5]
    """

    def __init__(
        self, env: gym.Env[NDArray[Any], Any], circular: Iterable[int] = ()
    ) -> None:
        super().__init__(env)
        self.scaling = Scaling(env.observation_space, circular)
        self.observation_space = self.scaling.space
        RecordConstructorArgs.__init__(self, circular=self.scaling.circular)

    def observation(self, observation: NDArray[Any]) -> Float32Array:
        """Return the features of an observation."""
        return self.scaling(observation)


class ScaledVectorObservation(
    VectorObservationWrapper[Float32Array, Any, NDArray[Any], Any]
):
    """Scales the observations of all slots; see `Scaling` for how.

    Args:
        env: a vector environment whose single observations are a bounded `Box` of
            one axis, and which does not reset slots in the step that ends them.
        circular: the variables that wrap around, such as angles.

    Raises:
        TypeError: `env` is not a vector environment.
        ValueError: the observation space is not such a box, `circular` does not fit
            it, or the autoreset mode is SAME_STEP.

    Example:
        >>> import gymnasium as gym, acl_gym
        >>> env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=2)
        >>> env = acl_gym.ScaledVectorObservation(env, circular=[0])
        >>> env.reset(options={"state": [[0.0, 4.5], [0.0, -9.0]]})[0].tolist()
        [[1.0, 0.0, 0.5], [1.0, 0.0, -1.0]]
    """

    def __init__(
        self, env: VectorEnv[NDArray[Any], Any, Any], circular: Iterable[int] = ()
    ) -> None:
        require_vector_env(env)
        # The base class refuses this mode too, since the last observations would
        # stay as they were in infos["final_obs"]; here the message has a remedy.
        if received.autoreset_mode_of(env) is AutoresetMode.SAME_STEP:
            raise ValueError(
                "env must have autoreset mode NEXT_STEP or DISABLED, got SAME_STEP, "
                "whose infos['final_obs'] an observation wrapper does not reach; "
                'make it with autoreset_mode="Disabled".'
            )
        super().__init__(env)
        self.scaling = Scaling(env.single_observation_space, circular)
        self.single_observation_space = self.scaling.space
        self.observation_space = batch_space(self.scaling.space, self.num_envs)

    def observations(self, observations: NDArray[Any]) -> Float32Array:
        """Return the features of a batch of observations."""
        return self.scaling(observations)


def _bounds(space: spaces.Space[Any]) -> tuple[NDArray[np.float64], ...]:
    if not isinstance(space, spaces.Box) or len(space.shape) != 1:
        raise ValueError(
            "observations must be a Box of one axis, got "
            f"{validation.shown(space)}; use "
            "gymnasium's FlattenObservation first."
        )
    return finite_bounds(space)


def _checked_axes(circular: Iterable[int], size: int) -> NDArray[np.int64]:
    try:
        axes = [operator.index(axis) for axis in circular]
    except TypeError:
        raise TypeError(
            "circular must be a sequence of indices of variables, got "
            f"{validation.shown(circular)}."
        ) from None
    if not set(axes) <= set(range(size)) or len(set(axes)) < len(axes):
        raise ValueError(
            f"circular must hold different variables of 0..{size - 1}, got {axes}."
        )
    return np.array(sorted(axes), dtype=np.int64)
