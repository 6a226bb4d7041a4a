"""Perturbations between a system and its learners: noise, rounding, hidden variables.

These are vector wrappers; the environments behind them stay as they are. Their random
numbers come from the seed of `reset`, so that a run is a function of its seed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
from gymnasium import spaces
from gymnasium.vector import (
    VectorActionWrapper,
    VectorEnv,
    VectorObservationWrapper,
    VectorWrapper,
)
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from acl_gym.envs.control.bookkeeping import checked_actions
from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.utils import validation
from acl_gym.utils.boxes import finite_bounds
from acl_gym.utils.typing import FloatArray, IntArray
from acl_gym.utils.vector_envs import require_discrete_actions, require_vector_env

Element = TypeVar("Element", bound=np.generic)
AnyVectorEnv = VectorEnv[Any, Any, Any]


def perturbed(
    env: ControlVectorEnv, perturbations: Mapping[str, Any]
) -> VectorEnv[Any, Any, Any]:
    """Wrap an environment in perturbations, in the order of the keys below.

    Args:
        env: the unperturbed environment.
        perturbations: any of

            - `"slips"`: the probability of `ActionNoise`;
            - `"noise"`: the standard deviations of `ObservationNoise`;
            - `"rounded"`: the counts of `RoundedObservation`;
            - `"hidden"`: the variables of `HiddenVariables`.

    Returns:
        The wrapped environment; `env` itself if `perturbations` is empty.

    Raises:
        ValueError: a key is not one of these.
    """
    known = ("slips", "noise", "rounded", "hidden")
    unknown = sorted(set(perturbations) - set(known), key=str)
    if unknown:
        raise ValueError(
            f"perturbations must be among {list(known)}, got {unknown}; "
            "check the spelling."
        )
    wrapped: AnyVectorEnv = env
    if "slips" in perturbations:
        wrapped = ActionNoise(wrapped, perturbations["slips"])
    if "noise" in perturbations:
        wrapped = ObservationNoise(wrapped, perturbations["noise"], env.system.circular)
    if "rounded" in perturbations:
        wrapped = RoundedObservation(wrapped, perturbations["rounded"])
    if "hidden" in perturbations:
        wrapped = HiddenVariables(wrapped, perturbations["hidden"])
    return wrapped


def _generator(seed: int) -> np.random.Generator:
    """A generator independent of that of the environment, which gets the same seed."""
    return np.random.default_rng([seed, 1])


class ActionNoise(VectorActionWrapper[Any, Any, Any, Any]):
    """Replaces actions at random by actions drawn uniformly from all.

    Gymnasium has no such wrapper: its `StickyAction` repeats the previous action.

    Args:
        env: with discrete actions.
        probability: of a replacement, for each slot and step, in [0, 1]. The draw may
            give the chosen action again.

    Raises:
        TypeError: `env` is not a vector environment, or `probability` not a number.
        ValueError: actions are not discrete, or `probability` is out of range.
    """

    def __init__(self, env: AnyVectorEnv, probability: float) -> None:
        require_vector_env(env)
        space = require_discrete_actions(env)
        self._first, self._count = int(space.start), int(space.n)
        super().__init__(env)
        self.probability = validation.number(
            "probability", probability, at_least=0, at_most=1
        )
        self._rng = np.random.default_rng()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start episodes; a seed also restarts the random numbers of this wrapper."""
        seed = validation.seed(seed)
        if seed is not None:
            self._rng = _generator(seed)
        return super().reset(seed=seed, options=options)

    def actions(self, actions: ArrayLike) -> IntArray:
        """Return the actions that are carried out, `(num_envs,)`.

        Raises:
            TypeError: the actions are not integers.
            ValueError: there is not one for each slot, or one is out of range.
        """
        given = validation.as_array(actions)
        if given is not None and self._first and given.dtype.kind in "iu":
            given = given.astype(np.int64) - self._first
        wanted = actions if given is None else given
        chosen = checked_actions(wanted, self.num_envs, self._count)
        draws = self._rng.random((2, self.num_envs))
        others = (draws[1] * self._count).astype(np.int64)
        return np.where(draws[0] < self.probability, others, chosen) + self._first


class ObservationNoise(VectorObservationWrapper[FloatArray, Any, Any, Any]):
    """Adds normal noise to observations and keeps them within their space.

    Gymnasium's `AddWhiteNoise` replaces pixels of single environments instead.

    Args:
        env: whose observations are a bounded box of one axis.
        deviations: the standard deviation of each variable's noise, in its unit, >= 0.
        circular: variables that are wrapped at their bounds, such as angles; the others
            are clipped.

    Raises:
        TypeError: `env` is not a vector environment, or `circular` holds no integers.
        ValueError: the observations are not such a box, or an argument does not fit them.
    """

    def __init__(
        self,
        env: AnyVectorEnv,
        deviations: Sequence[float],
        circular: Sequence[int] = (),
    ) -> None:
        require_vector_env(env)
        super().__init__(env)
        space = _box(self.single_observation_space)
        self._low, self._high = space.low, space.high
        self._deviations = validation.real_array("deviations", deviations)
        if (
            self._deviations.shape not in ((), space.shape)
            or (self._deviations < 0).any()
        ):
            raise ValueError(
                f"deviations must be {space.shape[0]} numbers >= 0, one a variable, got "
                f"{validation.shown(deviations)}."
            )
        self._circular = _integers("circular", circular)
        if max(self._circular, default=0) >= space.shape[0]:
            raise ValueError(
                f"circular must hold variables of 0..{space.shape[0] - 1}, got "
                f"{validation.shown(circular)}."
            )
        finite_bounds(space)
        self._rng = np.random.default_rng()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[FloatArray, dict[str, Any]]:
        """Start episodes; a seed also restarts the random numbers of this wrapper."""
        seed = validation.seed(seed)
        if seed is not None:
            self._rng = _generator(seed)
        return super().reset(seed=seed, options=options)

    def observations(self, observations: FloatArray) -> FloatArray:
        """Return noisy observations, `(num_envs, d)`."""
        noise = self._rng.standard_normal(observations.shape)
        noisy = np.asarray(observations + self._deviations * noise)
        for axis in self._circular:
            low, span = self._low[axis], self._high[axis] - self._low[axis]
            noisy[:, axis] = low + np.mod(noisy[:, axis] - low, span)
        return np.asarray(np.clip(noisy, self._low, self._high))


class RoundedObservation(VectorObservationWrapper[FloatArray, Any, Any, Any]):
    """Rounds variables to the nearest of a few evenly spaced values.

    Gymnasium's `DiscretizeObservation` returns bin numbers and is for single
    environments; here variables keep their units and the space is unchanged.

    Args:
        env: whose observations are a bounded box of one axis.
        counts: for each variable how many values it has, its bounds included, >= 2;
            0 does not round it, and it needs no bounds then.

    Raises:
        TypeError: `env` is not a vector environment, or `counts` are no integers.
        ValueError: the observations are not such a box, or `counts` do not fit them.
    """

    def __init__(self, env: AnyVectorEnv, counts: Sequence[int]) -> None:
        require_vector_env(env)
        super().__init__(env)
        space = _box(self.single_observation_space)
        size = space.shape[0]
        self._counts = _integers("counts", counts)
        if len(self._counts) != size or not all(n == 0 or n >= 2 for n in self._counts):
            raise ValueError(
                f"counts must be {size} integers, one a variable, each 0 or >= 2, got "
                f"{validation.shown(counts)}."
            )
        finite_bounds(space, np.flatnonzero(self._counts))

    def observations(self, observations: FloatArray) -> FloatArray:
        """Return rounded observations, `(num_envs, d)`."""
        space: Any = self.single_observation_space
        rounded = np.array(observations)
        for axis, count in enumerate(self._counts):
            if count:
                low, high = space.low[axis], space.high[axis]
                steps = np.rint((rounded[:, axis] - low) / (high - low) * (count - 1))
                rounded[:, axis] = low + (high - low) * steps / (count - 1)
        return rounded


class HiddenVariables(VectorObservationWrapper[FloatArray, Any, Any, Any]):
    """Leaves variables out of the observations.

    A class instead of Gymnasium's `TransformObservation`, so that `thesis_partition`
    can see which variables are left.

    Args:
        env: whose observations are a box of one axis.
        variables: which ones are hidden.

    Attributes:
        shown: the variables that are left, in order.

    Raises:
        TypeError: `env` is not a vector environment, or `variables` are no integers.
        ValueError: the observations are not such a box, a variable is not among them, or
            none would be left.
    """

    def __init__(self, env: AnyVectorEnv, variables: Sequence[int]) -> None:
        require_vector_env(env)
        super().__init__(env)
        space = _box(env.single_observation_space)
        hidden = set(_integers("variables", variables))
        if not hidden < set(range(space.shape[0])):
            raise ValueError(
                f"variables must be among 0..{space.shape[0] - 1} and leave one or more, "
                f"got {validation.shown(variables)}."
            )
        self.shown = tuple(i for i in range(space.shape[0]) if i not in hidden)
        shown = list(self.shown)
        self.single_observation_space = spaces.Box(
            space.low[shown], space.high[shown], dtype=space.dtype.type
        )
        self.observation_space = batch_space(
            self.single_observation_space, self.num_envs
        )

    def observations(self, observations: FloatArray) -> FloatArray:
        """Return the variables that are shown, `(num_envs, len(shown))`."""
        return observations[:, list(self.shown)]


class ReversedSlots(VectorWrapper[Any, Any, Any, Any]):
    """The slots of an environment in reverse order.

    With `ReversedDraws` in the agent, each ant draws the same random numbers as in the
    original order: only the order changes in which the ants' experience is merged.

    Args:
        env: a native vector environment. Its infos are passed on in the original order.
    """

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start episodes; `"state"` and `"reset_mask"` of options are reversed too."""
        if isinstance(options, dict):
            by_slot = {"state", "reset_mask"} & set(options)
            reversed_too = {key: _reversed(np.asarray(options[key])) for key in by_slot}
            options = {**options, **reversed_too}
        observations, infos = self.env.reset(seed=seed, options=options)
        return _reversed(observations), infos

    def step(self, actions: ArrayLike) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Apply one action to each slot."""
        *results, infos = self.env.step(_reversed(np.asarray(actions)))
        observations, rewards, terminated, truncated = map(_reversed, results)
        return observations, rewards, terminated, truncated, infos


class ReversedDraws:
    """A generator whose random numbers are in reverse order along their last axis.

    It has the two methods of `numpy.random.Generator` that an agent uses.

    Args:
        rng: the generator.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng

    def random(self, size: int | tuple[int, ...]) -> FloatArray:
        """Uniform numbers from [0, 1) of the shape `size`."""
        return np.ascontiguousarray(self._rng.random(size)[..., ::-1])

    def integers(self, high: int) -> int:
        """One integer from [0, `high`), the same as that of the generator."""
        return int(self._rng.integers(high))


def _box(space: spaces.Space[Any]) -> spaces.Box:
    """The space if it is a Box of one axis."""
    if not isinstance(space, spaces.Box) or len(space.shape) != 1:
        raise ValueError(
            f"observations must be a Box of one axis, got {validation.shown(space)}."
        )
    return space


def _integers(name: str, values: Any) -> tuple[int, ...]:
    """Integers >= 0 from a sequence of them."""
    array = validation.as_array(values)
    if (
        array is None
        or array.ndim != 1
        or (array.size and array.dtype.kind not in "iu")
    ):
        raise TypeError(
            f"{name} must be a sequence of integers, got {validation.shown(values)}."
        )
    return tuple(
        validation.integer(f"{name}[{i}]", value, at_least=0)
        for i, value in enumerate(array)
    )


def _reversed(slots: NDArray[Element]) -> NDArray[Element]:
    return np.ascontiguousarray(slots[::-1])
