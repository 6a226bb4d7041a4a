"""What lies between a system and those who learn it: noise, hidden and rounded states.

The environments stay as they are; these are ordinary vector wrappers around them. Their
luck comes from the seed of `reset`, so that a run is a function of its seed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector import VectorEnv, VectorWrapper
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from acl_gym.envs.control.environments import ControlVectorEnv


def perturbed(
    env: ControlVectorEnv, perturbation: dict[str, Any]
) -> VectorEnv[Any, Any, Any]:
    """Put wrappers around an environment.

    Args:
        env: the system as it is.
        perturbation: by name what there is of it: "slips", the probability that another
            action than the chosen one is taken, drawn evenly from all; "noise", the
            standard deviation of each variable's; "rounded", for each variable on how
            many even values it is seen, 0: as it is; "hidden", variables that are not
            seen.

    Raises:
        ValueError: there is no perturbation of a name.
    """
    unknown = set(perturbation) - {"slips", "noise", "rounded", "hidden"}
    if unknown:
        raise ValueError(
            "a perturbation must be made of slips, noise, rounded and hidden, got "
            f"{sorted(unknown)[0]!r}."
        )
    found: VectorEnv[Any, Any, Any] = env
    if "slips" in perturbation:
        found = Slips(found, perturbation["slips"])
    if "noise" in perturbation:
        found = Noise(found, perturbation["noise"], env.system.circular)
    if "rounded" in perturbation:
        found = Rounded(found, perturbation["rounded"])
    if "hidden" in perturbation:
        found = Hidden(found, perturbation["hidden"])
    return found


class _Lucky(VectorWrapper[Any, Any, Any, Any]):
    """A wrapper that draws random numbers, begun anew whenever a seed comes."""

    def __init__(self, env: VectorEnv[Any, Any, Any]) -> None:
        super().__init__(env)
        self._luck = np.random.default_rng()

    def reset(
        self,
        *,
        seed: int | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Any, dict[str, Any]]:
        """Begin episodes."""
        if seed is not None:
            # Apart from the stream of the environment, which has the same seed.
            self._luck = np.random.default_rng([seed, 1])
        observation, infos = self.env.reset(seed=seed, options=options)
        return self._seen(observation), infos

    def step(self, actions: Any) -> Any:
        """Take a step."""
        observation, *rest = self.env.step(self._done(actions))
        return self._seen(observation), *rest

    def _seen(self, observation: Any) -> Any:
        return observation

    def _done(self, actions: Any) -> Any:
        return actions


class Slips(_Lucky):
    """Now and then an action is replaced by one drawn evenly from all.

    Args:
        env: with discrete actions.
        probability: of a draw, in each slot and step.
    """

    def __init__(self, env: VectorEnv[Any, Any, Any], probability: float) -> None:
        super().__init__(env)
        self.probability = probability

    def _done(self, actions: Any) -> Any:
        draws = self._luck.random((2, self.num_envs))
        count = int(self.single_action_space.n)  # type: ignore[attr-defined]
        others = (draws[1] * count).astype(np.int64)
        return np.where(draws[0] < self.probability, others, actions)


class Noise(_Lucky):
    """Normal noise on what is seen, kept within the bounds of the space.

    Args:
        env: whose observations are a bounded box of one axis.
        deviations: the standard deviation for each variable.
        circular: variables that go round instead of ending at their bounds.
    """

    def __init__(
        self,
        env: VectorEnv[Any, Any, Any],
        deviations: Sequence[float],
        circular: Sequence[int] = (),
    ) -> None:
        super().__init__(env)
        self._deviations = np.asarray(deviations, dtype=np.float64)
        space: Any = self.single_observation_space
        self._low, self._high = space.low, space.high
        self._circular = list(circular)

    def _seen(self, observation: Any) -> NDArray[np.float64]:
        drawn = self._luck.standard_normal(observation.shape)
        seen = np.asarray(observation + self._deviations * drawn)
        for axis in self._circular:
            low, span = self._low[axis], self._high[axis] - self._low[axis]
            seen[:, axis] = low + np.mod(seen[:, axis] - low, span)
        return np.asarray(np.clip(seen, self._low, self._high))


class Rounded(VectorWrapper[Any, Any, Any, Any]):
    """Variables are seen as the nearest of a few even values over their range.

    Args:
        env: whose observations are a bounded box of one axis.
        counts: how many values for each variable, 2 or more; 0: as it is.
    """

    def __init__(self, env: VectorEnv[Any, Any, Any], counts: Sequence[int]) -> None:
        super().__init__(env)
        self._counts = tuple(counts)

    def reset(self, **options: Any) -> tuple[Any, dict[str, Any]]:
        """Begin episodes."""
        observation, infos = self.env.reset(**options)
        return self._seen(observation), infos

    def step(self, actions: Any) -> Any:
        """Take a step."""
        observation, *rest = self.env.step(actions)
        return self._seen(observation), *rest

    def _seen(self, observation: Any) -> NDArray[np.float64]:
        seen, space = np.array(observation), self.single_observation_space
        for axis, count in enumerate(self._counts):
            if count:
                low, high = space.low[axis], space.high[axis]  # type: ignore[attr-defined]
                place = np.rint((seen[:, axis] - low) / (high - low) * (count - 1))
                seen[:, axis] = low + (high - low) * place / (count - 1)
        return seen


class Hidden(VectorWrapper[Any, Any, Any, Any]):
    """Some variables are not seen.

    Args:
        env: whose observations are a box of one axis.
        variables: those that are not seen.
    """

    def __init__(self, env: VectorEnv[Any, Any, Any], variables: Sequence[int]) -> None:
        super().__init__(env)
        space: Any = env.single_observation_space
        self._shown = [i for i in range(space.shape[0]) if i not in variables]
        self.single_observation_space = spaces.Box(
            space.low[self._shown], space.high[self._shown], dtype=space.dtype
        )
        self.observation_space = batch_space(
            self.single_observation_space, self.num_envs
        )

    def reset(self, **options: Any) -> tuple[Any, dict[str, Any]]:
        """Begin episodes."""
        observation, infos = self.env.reset(**options)
        return observation[:, self._shown], infos

    def step(self, actions: Any) -> Any:
        """Take a step."""
        observation, *rest = self.env.step(actions)
        return observation[:, self._shown], *rest


class ReversedSlots(VectorWrapper[Any, Any, Any, Any]):
    """The slots of an environment in reverse order.

    With `ReversedLuck` in the agent, each ant meets the same luck as in the order as it
    is: only the order changes in which what they learn is merged.

    Args:
        env: with native slots, whose infos nobody reads.
    """

    def reset(self, **options: Any) -> tuple[Any, dict[str, Any]]:
        """Begin episodes; states, where given, are in reverse order too."""
        given = options.get("options") or {}
        if "state" in given:
            options["options"] = {**given, "state": np.asarray(given["state"])[::-1]}
        observation, infos = self.env.reset(**options)
        return _flipped(observation), infos

    def step(self, actions: Any) -> Any:
        """Take a step."""
        observation, reward, terminated, truncated, infos = self.env.step(
            _flipped(actions)
        )
        return (
            _flipped(observation),
            _flipped(reward),
            _flipped(terminated),
            _flipped(truncated),
            infos,
        )


class ReversedLuck:
    """A generator whose random numbers come in reverse order along their last axis.

    Args:
        rng: the generator.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng

    def random(self, size: Any) -> NDArray[np.float64]:
        """Uniform numbers."""
        return np.ascontiguousarray(self._rng.random(size)[..., ::-1])

    def integers(self, high: int) -> int:
        """One integer, as it is."""
        return int(self._rng.integers(high))


def _flipped(slots: Any) -> Any:
    """Slots, the first axis, in reverse order."""
    return np.ascontiguousarray(np.asarray(slots)[::-1])
