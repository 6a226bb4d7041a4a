"""Plants that change while their controllers are learned or used (§7.3)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from gymnasium.vector import VectorEnv, VectorWrapper
from numpy.typing import ArrayLike

from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.control.system import ControlSystem
from acl_gym.envs.plant.system import Plant
from acl_gym.utils import validation

_MOST_STAGES = 2_000
"""How often the parameters may change in all; each time there is a system of its own."""


class Change(ABC):
    """How a parameter changes as steps are made."""

    @property
    @abstractmethod
    def times(self) -> tuple[int, ...]:
        """The numbers of steps from which on there is a new value, increasing."""

    @abstractmethod
    def value(self, steps: int, before: float) -> float:
        """The value after some steps.

        Args:
            steps: how many were made, at least the first of `times`.
            before: the value before this change.
        """


@dataclass(frozen=True)
class Jump(Change):
    """A parameter jumps.

    Attributes:
        at: after so many steps, >= 0.
        to: the value from then on.

    Raises:
        TypeError: a value has the wrong type.
        ValueError: `at` is negative, or `to` is not finite.
    """

    at: int
    to: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "at", validation.integer("at", self.at, at_least=0))
        object.__setattr__(self, "to", validation.number("to", self.to))

    @property
    def times(self) -> tuple[int, ...]:
        """See `Change`."""
        return (self.at,)

    def value(self, steps: int, before: float) -> float:
        """See `Change`."""
        return self.to


@dataclass(frozen=True)
class Drift(Change):
    """A parameter drifts at a constant rate, in many small stages.

    Attributes:
        start: after so many steps it begins to change, >= 0.
        end: after so many steps it has its last value, > `start`.
        to: the last value.
        stages: equal ones into which the drift is divided, 1 to 1,000; at most one a
            step.

    Raises:
        TypeError: a value has the wrong type.
        ValueError: a value is out of range.
    """

    start: int
    end: int
    to: float
    stages: int = 100

    def __post_init__(self) -> None:
        start = validation.integer("start", self.start, at_least=0)
        end = validation.integer("end", self.end, at_least=0)
        if end <= start:
            raise ValueError(
                f"end must be greater than start, got start={start} and end={end}; for "
                "a change at once use Jump."
            )
        stages = validation.integer("stages", self.stages, at_least=1, at_most=1000)
        object.__setattr__(self, "start", start)
        object.__setattr__(self, "end", end)
        object.__setattr__(self, "to", validation.number("to", self.to))
        object.__setattr__(self, "stages", min(stages, end - start))

    @property
    def times(self) -> tuple[int, ...]:
        """See `Change`; the j-th stage is over after this share of the steps."""
        return tuple(
            self.start + -(-(self.end - self.start) * j // self.stages)
            for j in range(1, self.stages + 1)
        )

    def value(self, steps: int, before: float) -> float:
        """See `Change`."""
        over = (steps - self.start) * self.stages // (self.end - self.start)
        if over >= self.stages:
            return self.to
        return before + (self.to - before) * over / self.stages


class ChangingVectorEnv(VectorWrapper[Any, Any, Any, Any]):
    """A vector environment whose parameters drift or jump while learning goes on.

    Time is the number of steps that all slots together have made since this was made;
    what resets a slot, or is asked of one that waits, is no step. It goes on across
    resets, also those with a seed, as agents give one for each trial. To repeat a run bit
    for bit, set `steps` to 0 and reset with the same seed. A change takes effect in all
    slots with the first step of the environment after so many steps; episodes under way
    go on from the states where they are.

    The environment inside is changed: it has the parameters of now. So a picture, or an
    evaluation in `env.unwrapped`, is of the plant as it is now; to keep one for later, or
    to look ahead, there are `now` and `at`.

    >>> import gymnasium as gym, acl_gym
    >>> from acl_gym.envs.wrappers import ChangingVectorEnv, Drift, Jump
    >>> env = ChangingVectorEnv(
    ...     gym.make_vec("acl_gym/Pendulum-v0", num_envs=5),
    ...     {
    ...         "mass": Jump(at=20_000, to=0.12),
    ...         "motor_gain": Drift(30_000, 40_000, 0.09),
    ...     },
    ... )
    >>> env.values
    {'mass': 0.1, 'motor_gain': 0.1}
    >>> env.at(35_000).system.motor_gain
    0.095

    Args:
        env: a vector environment of this package; wrappers may be around it.
        schedules: for each parameter that changes a `Jump` or a `Drift`, or several in
            the order of time. Parameters are those of the system that are real numbers;
            of a plant, those in its `parameters`. They begin with the values that `env`
            has. Observations, actions and their bounds must stay the same.
        steps: how many were made before, >= 0, for instance by an agent that was saved.

    Raises:
        TypeError: `env` is of another package, a schedule is not a `Jump` or a `Drift`, or
            there is no such parameter.
        ValueError: changes of one parameter overlap, a value is not valid, a change
            would change what can be observed or done, or `env` changes already.
    """

    def __init__(
        self,
        env: VectorEnv[Any, Any, Any],
        schedules: Mapping[str, Change | Sequence[Change]],
        *,
        steps: int = 0,
    ) -> None:
        base = getattr(env, "unwrapped", None)
        if not isinstance(base, ControlVectorEnv):
            raise TypeError(
                "env must be a vector environment of acl_gym, whose parameters are "
                f"known, got {validation.shown(env)}; make one with gym.make_vec or "
                "acl_gym.plant."
            )
        if any(isinstance(each, ChangingVectorEnv) for each in _wrappers(env)):
            raise ValueError(
                "env must not change already, got a ChangingVectorEnv inside; give all "
                "schedules to one."
            )
        super().__init__(env)
        self._base = base
        changes = _checked_schedules(schedules)
        self.schedules = schedules
        first = {name: _certain(base.system, name) for name in changes}
        times = sorted({t for each in changes.values() for c in each for t in c.times})
        if len(times) > _MOST_STAGES:
            raise ValueError(
                f"schedules must have at most {_MOST_STAGES:,} stages in all, got "
                f"{len(times):,}; give Drift fewer stages."
            )
        self._times = [-1, *times]
        self._values = [
            {name: _value(changes[name], t, first[name]) for name in changes}
            for t in self._times
        ]
        before = base.system, base.parameters
        try:
            self._stages = [
                self._checked_stage(*pair)
                for pair in zip(self._times, self._values, strict=True)
            ]
        finally:
            base.set_system(*before)
        self._stage = -1
        self.steps = steps

    @property
    def steps(self) -> int:
        """How many steps all slots together have made. Setting it sets the parameters."""
        return self._steps

    @steps.setter
    def steps(self, value: int) -> None:
        self._steps = validation.integer("steps", value, at_least=0)
        self._next: float = 0  # so that the stage is looked up
        self._enter_stage()

    @property
    def values(self) -> dict[str, float]:
        """What the parameters that change are now."""
        return dict(self._values[self._stage])

    def step(self, actions: ArrayLike) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Apply one action to each slot, with the parameters of now."""
        walking = self._base.num_walking
        given = self.env.step(actions)
        self._steps += walking
        if self._steps >= self._next:
            self._enter_stage()
        return given

    def now(self) -> ControlVectorEnv:
        """A new environment, without wrappers, that stays as the plant is now."""
        return self.at(self._steps)

    def at(self, steps: int) -> ControlVectorEnv:
        """A new environment, without wrappers, that is as the plant is after some steps.

        Args:
            steps: of all slots, >= 0.

        Raises:
            TypeError: `steps` is not an integer.
            ValueError: it is negative.
        """
        steps = validation.integer("steps", steps, at_least=0)
        values = self._values[self._stage_at(steps)]
        return self._base.with_parameters(**values)

    def _stage_at(self, steps: int) -> int:
        return bisect_right(self._times, steps) - 1

    def _enter_stage(self) -> None:
        stage = self._stage_at(self._steps)
        later = self._times[stage + 1 : stage + 2]
        self._next = later[0] if later else float("inf")
        if stage != self._stage:
            self._stage = stage
            self._base.set_system(*self._stages[stage])

    def _checked_stage(
        self, time: int, values: dict[str, float]
    ) -> tuple[ControlSystem, dict[str, Any]]:
        """The system with some values, which the environment is given, and its arguments.

        Raises:
            ValueError: they are not valid, or change what can be observed or done.
        """
        base = self._base
        try:
            stage = base.system_with(**values)
            base.set_system(*stage)
        except ValueError as error:
            raise ValueError(
                f"schedules must be valid at all times, got {values} after "
                f"{max(time, 0):,} steps: {error}"
            ) from error
        return stage


def _wrappers(env: Any) -> Iterator[VectorWrapper[Any, Any, Any, Any]]:
    """The wrappers around an environment, from the outside in."""
    while isinstance(env, VectorWrapper):
        yield env
        env = env.env


def _certain(system: ControlSystem, name: str) -> float:
    """The value of a parameter that is not uncertain.

    Raises:
        TypeError: there is no parameter of that name.
        ValueError: it is uncertain.
    """
    value = system.parameter(name)
    if isinstance(system, Plant) and name in system.parameters.uncertain:
        raise ValueError(
            f"schedules must be for parameters that are known, got {name!r}, which each "
            "episode draws anew; leave it out of uncertain."
        )
    return value


def _value(changes: Sequence[Change], steps: int, first: float) -> float:
    """The value of a parameter after some steps."""
    value = first
    for change in changes:
        if steps < change.times[0]:
            break
        value = change.value(steps, value)
    return value


def _checked_schedules(schedules: Any) -> dict[str, tuple[Change, ...]]:
    if not isinstance(schedules, Mapping) or not schedules:
        raise TypeError(
            "schedules must be a dict from parameters to changes, such as "
            f'{{"mass": Jump(at=20_000, to=0.15)}}, got {validation.shown(schedules)}.'
        )
    checked = {}
    for name, given in schedules.items():
        changes = (given,) if isinstance(given, Change) else validation.elements(given)
        if not changes or not all(isinstance(each, Change) for each in changes):
            raise TypeError(
                f"schedules[{name!r}] must be a Jump or a Drift, or a list of them, got "
                f"{validation.shown(given)}."
            )
        for one, other in pairwise(changes):
            begins = other.start if isinstance(other, Drift) else other.times[0]
            if begins < one.times[-1] or other.times[0] == one.times[-1]:
                raise ValueError(
                    f"the changes of {name!r} must follow each other, got {one} before "
                    f"{other}; sort them, and let each begin after the one before."
                )
        checked[name] = tuple(changes)
    return checked
