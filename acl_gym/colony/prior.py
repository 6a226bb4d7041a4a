"""Prior knowledge in one line: a controller, or a quantity that is to become less.

Both classes make what `heuristic=` and `initial=` of the colonies take (§7.3): functions
of an environment and a partition that give a number for each pair.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike, NDArray

from acl_gym.envs.control.actuator import nearest_actions
from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.control.lookup import signals_of
from acl_gym.partitions import Partition
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray, IntArray


@dataclass(frozen=True, kw_only=True)
class Prior(ABC):
    """A number for each pair of a cell and an action, from what is known beforehand.

    Attributes:
        preferred: what the best action of a cell receives.
        others: what the worst action receives; any number, above or below `preferred`.
    """

    preferred: float = 10.0
    others: float = 1.0

    def __post_init__(self) -> None:
        for name in ("preferred", "others"):
            number = validation.number(name, getattr(self, name))
            object.__setattr__(self, name, number)

    def __call__(self, env: Any, partition: Partition) -> FloatArray:
        """The numbers, `(n_cells, n_actions)`.

        Args:
            env: a vector environment with `Discrete` actions.
            partition: whose centres are asked about.

        Raises:
            TypeError: `env` is no such environment.
            ValueError: what is known does not fit the environment or the partition.
        """
        actions = getattr(env, "single_action_space", None)
        if not isinstance(actions, spaces.Discrete):
            raise TypeError(
                f"a {type(self).__name__} needs a vector environment with Discrete "
                f"actions, got {validation.shown(env)}; give the agent its env."
            )
        goodness = self._goodness(env, partition.cell_states(), actions)
        return self.others + (self.preferred - self.others) * goodness

    @abstractmethod
    def _goodness(
        self, env: Any, states: NDArray[Any], actions: spaces.Discrete
    ) -> FloatArray:
        """How good each action is in each state, in [0, 1], `(n, n_actions)`."""


@dataclass(frozen=True)
class PolicyPrior(Prior):
    """Prefers what a controller would do, in the centre of each cell.

    Args:
        rule: the controller: a function of the centres of all cells, `(n_cells, d)`. It
            returns the number of an action for each, integers `(n_cells,)`, or physical
            inputs, floats `(n_cells,)` or `(n_cells, n_inputs)`, which stand for the
            action whose inputs are nearest.
        preferred: what the action of the controller receives, 10.
        others: what all other actions receive, 1.

    Raises:
        TypeError: `rule` is not a function.

    Example:
        >>> import gymnasium as gym
        >>> from acl_gym import PolicyPrior, ReturningACL
        >>> def brake(states):  # angle and angular velocity -> torque, N m
        ...     return -0.5 * states[:, 1]
        >>> env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=5)
        >>> ReturningACL(env, heuristic=PolicyPrior(brake)).heuristic[0].tolist()
        [1.0, 10.0, 1.0]
    """

    rule: Callable[[NDArray[Any]], ArrayLike]

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_function("rule", self.rule)

    def _goodness(
        self, env: Any, states: NDArray[Any], actions: spaces.Discrete
    ) -> FloatArray:
        chosen = validation.as_array(self.rule(states))
        n, n_actions = len(states), int(actions.n)
        if chosen is None or chosen.shape[:1] != (n,) or chosen.dtype.kind not in "iuf":
            raise ValueError(
                f"rule must return the number of an action or physical inputs for each "
                f"of {n} states, got {validation.shown(chosen)}."
            )
        if chosen.dtype.kind == "f":
            columns = _nearest(chosen, env)
        else:
            columns = chosen.astype(np.int64) - int(actions.start)
        if columns.shape != (n,) or (columns < 0).any() or (columns >= n_actions).any():
            first = int(actions.start)
            raise ValueError(
                f"rule must return actions in {first}..{first + n_actions - 1}, one for "
                f"each of {n} states, got {validation.shown(chosen)}; physical inputs "
                "are to be floats."
            )
        goodness = np.zeros((n, n_actions))
        goodness[np.arange(n), columns] = 1.0
        return goodness


@dataclass(frozen=True)
class PotentialPrior(Prior):
    """Prefers the action that brings the next state nearest to the goal.

    Each action is tried for one step in the centre of each cell, on a copy of the
    environment. The action after which the potential is least is preferred, and the
    others the less, the more the potential exceeds that.

    Args:
        potential: a function of states, `(n, d)`, that returns a number for each,
            `(n,)`, of which less is better: a distance to the goal, an error of energy.
        preferred: what the best action of a cell receives, 10.
        others: what the worst one receives, 1, and what is forbidden. Those between are
            in proportion. All receive `preferred` where the action makes no difference.

    Raises:
        TypeError: `potential` is not a function.

    Example:
        >>> import gymnasium as gym
        >>> import numpy as np
        >>> from acl_gym import ACL, PotentialPrior
        >>> def speed(states):
        ...     return np.abs(states[:, 1])
        >>> env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=5)
        >>> ACL(env, heuristic=PotentialPrior(speed)).heuristic[0].round(1).tolist()
        [1.0, 5.5, 10.0]
    """

    potential: Callable[[NDArray[Any]], ArrayLike]

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_function("potential", self.potential)

    def _goodness(
        self, env: Any, states: NDArray[Any], actions: spaces.Discrete
    ) -> FloatArray:
        if env is not env.unwrapped or not isinstance(env, ControlVectorEnv):
            raise ValueError(
                "a PotentialPrior needs an environment of acl_gym without wrappers, "
                f"whose states can be set, got {validation.shown(env)}; give a function "
                "of (env, partition) that returns the numbers."
            )
        n, columns = len(states), []
        copy = env.with_slots(n)
        for action in range(int(actions.n)):
            allowed = copy.reset(options={"state": states})[1].get("action_mask")
            taken = np.full(n, action)
            forbidden = np.zeros(n, np.bool_)
            if allowed is not None:
                forbidden = np.asarray(allowed)[:, action] == 0
                taken[forbidden] = np.asarray(allowed)[forbidden].argmax(axis=1)
            following, *_, infos = copy.step(taken + int(actions.start))
            if "final_obs" in infos:  # where episodes begin anew in the same step
                ended = infos["_final_obs"]
                following = following.copy()
                following[ended] = np.stack(infos["final_obs"][ended])
            values = validation.real_array("potential", self.potential(following))
            if values.shape != (n,):
                raise ValueError(
                    f"potential must return a number for each of {n} states, got shape "
                    f"{values.shape}."
                )
            columns.append(np.where(forbidden, np.inf, values))
        excess = np.stack(columns, axis=1)
        excess -= excess.min(axis=1, keepdims=True)
        largest = excess.max(axis=1, keepdims=True, where=excess < np.inf, initial=0.0)
        # What is forbidden counts as the worst.
        excess = np.minimum(excess, np.maximum(largest, 1.0))
        largest = excess.max(axis=1, keepdims=True)
        share = np.divide(excess, largest, out=np.zeros_like(excess), where=largest > 0)
        return np.asarray(1.0 - share)


def _check_function(name: str, value: Any) -> None:
    if not callable(value):
        raise TypeError(
            f"{name} must be a function of states, got {validation.shown(value)}."
        )


def _nearest(inputs: NDArray[Any], env: Any) -> IntArray:
    """The columns of the actions whose inputs are nearest to those wanted, `(n,)`."""
    signals = signals_of(env)
    if signals is None:
        raise ValueError(
            "rule must return the numbers of actions, integers, because the inputs of "
            f"{validation.shown(env)} are not known, got floats."
        )
    available = np.array(signals.values)
    wanted = validation.real_array("what rule returns", inputs).reshape(len(inputs), -1)
    if wanted.shape[1] != available.shape[1]:
        raise ValueError(
            f"rule must return {available.shape[1]} inputs for each state, "
            f"{', '.join(signals.inputs)}, got {wanted.shape[1]}."
        )
    return nearest_actions(wanted, available)
