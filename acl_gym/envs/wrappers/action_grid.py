"""Real inputs as an ordered grid of numbered actions, in any vector environment."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector import VectorActionWrapper, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from acl_gym.envs.control.bookkeeping import checked_actions
from acl_gym.utils import validation
from acl_gym.utils.boxes import MOST_ACTIONS, input_bounds
from acl_gym.utils.typing import FloatArray
from acl_gym.utils.vector_envs import require_vector_env


class ActionGrid(VectorActionWrapper[Any, Any, Any, Any]):
    """Numbers the points of a grid over real inputs, so that tables can choose them.

    Each input takes evenly spaced values, both bounds included, and the last input varies
    fastest. Agents then learn in it as in any environment with discrete actions, and
    `agent.interpolated_policy()` chooses between neighbouring points afterwards: real
    inputs for the environment without this wrapper.

    `gymnasium.wrappers.DiscretizeAction` does so for single environments; its values lie
    in the middle of equal parts of the range, so that none is a bound.

    Args:
        env: a vector environment whose actions are a bounded Box of one axis.
        counts: how many values each input has, >= 2, one number for all or one for each;
            at most 10,000 actions in all.

    Attributes:
        counts: of each input.
        values: the inputs of each action, `(n_actions, n_inputs)`, in the type that the
            environment takes, read-only.

    Raises:
        TypeError: `env` is not a vector environment, or a count not an integer.
        ValueError: the actions are no such Box, a count is less than 2, or there are too
            many actions.

    Example:
        >>> import gymnasium as gym, acl_gym
        >>> box_env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=5, continuous=True)
        >>> env = acl_gym.ActionGrid(box_env, 5)
        >>> env.values.ravel().tolist()
        [-0.8, -0.4, 0.0, 0.4, 0.8]
        >>> colony = acl_gym.ReturningACL(env, seed=0).learn(total_timesteps=2_000)
        >>> colony.interpolated_policy().predict([3.1, 0.0])[0].shape
        (1,)
    """

    def __init__(
        self, env: VectorEnv[Any, Any, Any], counts: int | Sequence[int] = 5
    ) -> None:
        require_vector_env(env)
        self.counts, self.values = grid_over(env.single_action_space, counts)
        super().__init__(env)
        self.single_action_space = spaces.Discrete(len(self.values))
        self.action_space = batch_space(self.single_action_space, self.num_envs)

    def actions(self, actions: ArrayLike) -> NDArray[Any]:
        """The inputs of numbered actions, `(num_envs, n_inputs)`.

        Raises:
            TypeError: they are not integers.
            ValueError: there is not one for each slot, or one is out of range.
        """
        chosen = checked_actions(actions, self.num_envs, len(self.values))
        return self.values[chosen]


def grid_over(
    space: spaces.Space[Any], counts: int | Sequence[int]
) -> tuple[tuple[int, ...], NDArray[Any]]:
    """The points of a grid over a Box of inputs, both bounds included.

    Args:
        space: a bounded Box of one axis.
        counts: see `ActionGrid`.

    Returns:
        How many values each input has; and the points, the last input varying fastest,
        `(n_points, n_inputs)`, in the type of the Box, read-only.

    Raises:
        TypeError: a count is not an integer.
        ValueError: see `ActionGrid`.
    """
    low, high = input_bounds("the actions of env", space)
    checked = _checked_counts(counts, low.size)
    rows = np.array(list(itertools.product(*map(_spread, low, high, checked))))
    # Rounding to a narrower type cannot lead beyond bounds, which are of that type.
    return checked, validation.read_only(rows.astype(space.dtype))


def _spread(low: float, high: float, count: int) -> FloatArray:
    """Evenly spaced values; `numpy.linspace` would round 0 and symmetry away."""
    steps = 2.0 * np.arange(count) - (count - 1)
    values: FloatArray = (low + high) / 2 + (high - low) / 2 * steps / (count - 1)
    values[[0, -1]] = low, high
    return values


def _checked_counts(counts: Any, n_inputs: int) -> tuple[int, ...]:
    """One count for each input."""
    each = validation.elements(counts)
    if each is None:
        each = [counts] * n_inputs
    if len(each) != n_inputs:
        raise ValueError(
            f"counts must be one integer, or one for each of the {n_inputs} inputs, got "
            f"{validation.shown(counts)}."
        )
    checked = tuple(
        validation.integer("counts", value, at_least=2, at_most=MOST_ACTIONS)
        for value in each
    )
    if math.prod(checked) > MOST_ACTIONS:
        raise ValueError(
            f"counts must make at most {MOST_ACTIONS:,} actions, got "
            f"{math.prod(checked):,} of {n_inputs} inputs; take fewer values of each."
        )
    return checked
