"""Learning on top of a controller: actions choose its parameters, not the inputs (§7.3)."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector import VectorEnv, VectorWrapper
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from acl_gym.envs import received
from acl_gym.envs.control.actuator import Actuator
from acl_gym.envs.control.bookkeeping import checked_actions
from acl_gym.envs.control.lookup import signals_of
from acl_gym.envs.control.signals import Signals
from acl_gym.envs.wrappers.holding import StepResult, held
from acl_gym.envs.wrappers.idle import IdleSlots
from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, FloatArray
from acl_gym.utils.vector_envs import require_vector_env

Controller = Callable[[NDArray[Any], FloatArray], ArrayLike]
_MASKS = ("action_mask", "_action_mask")


class InnerLoop(VectorWrapper[Any, Any, Any, Any]):
    """Lets a controller drive the plant, and the learner choose the controller's parameters.

    The thesis proposes it for learning on a real plant, where exploration with random
    inputs is dangerous (§7.3): "an inner control loop that at least gives a baseline
    performance". However the learner explores, the plant is always driven by one of the
    controllers among which it chooses. The rows of `choices` are the safety limits:
    nothing between them or beyond them is ever set.

    The reward of a choice is the sum of the rewards of its steps, undiscounted. Where a
    choice is held for k steps, an agent's discount applies to each choice: what it would
    be for a step, take to the power of k.

    Args:
        env: a vector environment with array observations, and `Discrete` or `Box`
            actions.
        controller: a function of the observations `(n, d)` and the parameters `(n, p)` of
            all slots, which it must not change. It returns the inputs of each: numbers of
            actions, physical inputs, which stand for the nearest action, or rows of a
            `Box`, see `acl_gym.envs.control.actuator.Actuator`. It is asked in each step
            of the plant, also for slots that are idle. `StateFeedback` is one. One that
            remembers something, such as an integral of the error for each slot, has a
            method `restart(slots)`, which is called with the `(num_envs,)` bools of the
            slots in which an episode begins; it is copied, so that each inner loop has its
            own memory. What it remembers is hidden from the learner, unless it is among
            the observations. `PID` is one of these.
        choices: the rows of parameters among which the learner chooses,
            `(n_choices, p)`, or `(n_choices,)` for a single parameter; finite.
        period: for how many steps of the plant a choice is held, >= 1. With more than 1,
            an episode may end within a choice, and `env` must be able to let the slots
            that have finished wait: an environment of this package, a `WaitingVectorEnv`
            or a `WorkersVectorEnv`. A time limit of T choices, as agents set it, is then
            one of T times `period` steps, but an episode lasts no longer than the
            `max_episode_steps` of the environment.

    Attributes:
        controller: the controller.
        choices: the rows of parameters, read-only.
        period: steps for which a choice is held.
        signals: what observations and choices mean, for policies that are taken home.

    Raises:
        TypeError: `env` is not a vector environment, or `controller` is not a function.
        ValueError: `choices` or `period` are not valid, the observations are not arrays,
            or `env` cannot hold a choice.

    Example:
        >>> import gymnasium as gym, acl_gym
        >>> from acl_gym.envs.wrappers import InnerLoop, StateFeedback
        >>> env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=5)
        >>> controller = StateFeedback(set_point=[3.14159, 0.0], circular=[0])
        >>> env = InnerLoop(env, controller, [[0.5, 0.1], [2.5, 0.3]])  # gains
        >>> env.single_action_space
        Discrete(2)

    Note:
        The action masks of `env` concern the inputs and are not passed on.
    """

    replaces_actions = True

    def __init__(
        self,
        env: VectorEnv[Any, Any, Any],
        controller: Controller,
        choices: ArrayLike,
        *,
        period: int = 1,
    ) -> None:
        require_vector_env(env)
        super().__init__(env)
        if not callable(controller):
            raise TypeError(
                "controller must be a function of (observations, parameters), got "
                f"{validation.shown(controller)}."
            )
        require_array_observations(env)
        rows = validation.real_array("choices", choices)
        rows = rows[:, None] if rows.ndim == 1 else rows
        if rows.ndim != 2:
            raise ValueError(
                "choices must hold a row of parameters for each choice, shape "
                f"(n_choices, p) or (n_choices,), got {np.shape(choices)}."
            )
        self.controller = controller
        if hasattr(controller, "restart"):
            self.controller = copy.deepcopy(controller)
        self.choices = validation.read_only(rows)
        self.period = validation.integer("period", period, at_least=1, at_most=10**9)
        self._idle = IdleSlots(env)
        if self.period > 1 and not self._idle.can_wait:
            raise ValueError(
                f"env must let finished slots wait where period={self.period}, because "
                f"episodes end within a choice, got {type(env.unwrapped).__name__}; make "
                "it with acl_gym.WaitingVectorEnv.make(id, num_envs), or use period=1."
            )
        self._actuator = Actuator(env)
        self._seen: NDArray[Any] = np.empty(0)  # before the first reset
        self.single_action_space = spaces.Discrete(len(rows))
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        plant = signals_of(env)
        self.signals = Signals(
            () if plant is None else plant.observations,
            tuple(f"parameter p[{i}]" for i in range(rows.shape[1])),
            tuple(map(tuple, rows.tolist())),
        )

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start episodes, see the environment below.

        Args:
            seed: of the environment.
            options: of the environment; `"max_steps"`, T, counts choices, see `period`.

        Returns:
            The observations of all slots, and the infos without action masks.

        Raises:
            ValueError: the environment does not return what it should.
        """
        passed = self._options_below(options)
        observations, infos = received.parts(
            "reset", self.env.reset(seed=seed, options=passed), 2
        )
        self._see(observations)
        self._restart(self._idle.begin(options))
        return observations, _without_masks(received.infos(infos, self.num_envs))

    def step(self, actions: ArrayLike) -> StepResult:
        """Let the controller drive each slot with the parameters that were chosen.

        Args:
            actions: numbers of rows of `choices`, `(num_envs,)`.

        Returns:
            `(observations, rewards, terminations, truncations, infos)`; the rewards are
            sums over the steps of the choice.

        Raises:
            ResetNeeded: there was no reset yet, or autoreset is disabled and a slot has
                finished.
            TypeError: the actions are not integers.
            ValueError: an action has the wrong shape or is out of range; or what the
                controller returns has the wrong shape, is not finite or out of range.
        """
        self._idle.require_begun()
        chosen = checked_actions(actions, self.num_envs, len(self.choices))
        parameters = validation.read_only(self.choices[chosen])
        result: StepResult
        if self.period == 1:
            result = self._advance(parameters)
            started = self._idle.finish(result[2] | result[3])
        else:
            *parts, started = held(
                lambda: self._advance(parameters),
                self.env,
                self._seen.copy(),
                self._idle,
                self.period,
            )
            result = tuple(parts)
            self._see(result[0])
        self._restart(started)
        return (*result[:4], _without_masks(result[4]))

    def _restart(self, slots: BoolArray) -> None:
        """Let a controller that remembers something forget it in slots that begin anew."""
        restart = getattr(self.controller, "restart", None)
        if restart is not None and slots.any():
            restart(slots.copy())

    def _advance(self, parameters: FloatArray) -> StepResult:
        """One step of the plant."""
        n = self.num_envs
        inputs = self.controller(validation.read_only(self._seen), parameters)
        given = self.env.step(self._actuator.of_controller("controller", inputs))
        observations, rewards, terminated, truncated, infos = received.parts(
            "step", given, 5
        )
        self._see(observations)
        return (
            observations,
            received.rewards(rewards, n),
            received.flags("terminated", terminated, n),
            received.flags("truncated", truncated, n),
            dict(received.infos(infos, n)),
        )

    def _see(self, observations: Any) -> None:
        """Keep a copy: callers may change what they get, and environments write to it."""
        self._seen = np.array(received.observations(observations, self.num_envs))

    def _options_below(self, options: Any) -> Any:
        """What the environment below is asked for in place of what this one was."""
        if options is not None and not isinstance(options, Mapping):
            return options  # the environment refuses it
        passed = None if options is None else dict(options)
        if self.period == 1 or not self._idle.can_be_asked:
            return passed
        passed = passed or {}
        if "finished" in passed:
            validation.one_of("options['finished']", passed["finished"], ("wait",))
        passed["finished"] = "wait"
        if "max_steps" in passed:
            choices = validation.integer(
                "options['max_steps']", passed["max_steps"], at_least=1, at_most=10**9
            )
            steps = choices * self.period
            limit = getattr(self.env.unwrapped, "max_episode_steps", None)
            passed["max_steps"] = steps if limit is None else min(steps, int(limit))
        return passed


def require_array_observations(env: VectorEnv[Any, Any, Any]) -> None:
    """Refuse observations that are dicts, tuples, graphs or texts.

    Raises:
        ValueError: the observations are not arrays.
    """
    space = env.single_observation_space
    arrays = (spaces.Box, spaces.Discrete, spaces.MultiDiscrete, spaces.MultiBinary)
    if not isinstance(space, arrays):
        raise ValueError(
            "observations must be arrays, which a function of (n, d) takes, got "
            f"{validation.shown(space)}; use gymnasium.wrappers.FlattenObservation on "
            "each single environment."
        )


def _without_masks(infos: Mapping[str, Any]) -> dict[str, Any]:
    """Infos without the action masks of the inputs, which do not concern the choices."""
    kept = {key: value for key, value in infos.items() if key not in _MASKS}
    final = kept.get("final_info")
    if isinstance(final, Mapping):
        kept["final_info"] = _without_masks(final)
    return kept
