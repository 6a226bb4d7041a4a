"""A shield: where the plant is not safe, a baseline controller takes over (§7.3)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv, VectorWrapper
from numpy.typing import ArrayLike, NDArray

from acl_gym.envs import received
from acl_gym.envs.control.actuator import Actuator
from acl_gym.envs.wrappers.foresight import FunctionModel, Model, OwnModel, stays_safe
from acl_gym.envs.wrappers.idle import IdleSlots
from acl_gym.envs.wrappers.inner_loop import require_array_observations
from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, IntArray
from acl_gym.utils.vector_envs import require_vector_env

StepResult = tuple[Any, Any, Any, Any, dict[str, Any]]


class Shield(VectorWrapper[Any, Any, Any, Any]):
    """Replaces what the learner does by what a baseline does wherever that is not safe.

    Without a model the baseline acts in every state outside the safe set. That comes too
    late for a plant that cannot stop at once: choose a safe set that leaves it room. With
    a model (`predict`) the learner's action is carried out only if the state after it,
    and those to which the baseline would then lead, are safe, for `look_ahead` steps in
    all; otherwise the baseline acts at once.

    What the learner learns of an action that was replaced: agents of this package record
    what they chose, and so learn what it is worth to hand over to the baseline. This is
    the right value as long as the shield stays. Their policy is one for the plant with its
    shield; use both together. An action that is never carried
    out tells nothing of the plant itself. With `mask_actions=True` the actions that would
    be replaced are forbidden beforehand, in `infos["action_mask"]`, which agents of this
    package heed: then what is chosen is what is carried out.

    The infos of each step have, all of shape `(num_envs,)` and with a mask of the slots
    that made a step:

    - `"shielded"`: whether the action was replaced by another one;
    - `"executed_action"`: the action that was carried out;
    - `"violation"`: whether the next state is outside the safe set.

    Where slots are reset in the step that ends their episode, these stand beside the
    first observations of the next one, and still tell of the last step. Around a shield, an
    `InnerLoop` that holds its choices passes on what the last step of each told; the
    counters count all steps.

    Args:
        env: a vector environment with array observations, and `Discrete` or `Box`
            actions.
        baseline: a function of observations `(n, ...)`, which it must not change, that
            returns the inputs of each, as a controller of `InnerLoop` does. It is a
            function of these alone and is asked about slots in any number and order, so
            that it must not remember anything. None: nothing is replaced, and violations
            are only counted.
        safe: a function of observations `(n, ...)` that returns `(n,)` bools: whether
            each is in the safe set.
        predict: the model: True, the system of `env` itself, which must be a
            deterministic environment of this package without wrappers; or a function of
            observations `(n, ...)` and actions `(n, ...)` that returns the next
            observations, such as a regression; None: there is none.
        look_ahead: how many steps are predicted, >= 1; the first with the learner's
            action and the others with the baseline's. Take about as many as the plant
            needs to stop.
        mask_actions: whether the actions that would be replaced are forbidden beforehand,
            where actions are `Discrete`. With a model each action is then predicted in
            each step.

    Attributes:
        violations: steps after which each slot was outside the safe set, `(num_envs,)`.
        interventions: steps in which the action of each slot was replaced by another.

    Raises:
        TypeError: `env` is not a vector environment, or `baseline`, `safe` or `predict` is
            not a function.
        ValueError: an argument does not fit the environment or the others.

    Example:
        >>> import gymnasium as gym, numpy as np, acl_gym
        >>> from acl_gym.envs.wrappers import Shield, StateFeedback
        >>> env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=2)
        >>> hold = StateFeedback([2.5, 0.3], [np.pi, 0.0], circular=[0])
        >>> env = Shield(env, hold, lambda x: np.abs(x[:, 0] - np.pi) < 0.5)
        >>> _ = env.reset(options={"state": [[np.pi + 0.7, 0.0], [np.pi + 0.2, 0.0]]})
        >>> infos = env.step([2, 2])[-1]
        >>> infos["shielded"].tolist(), infos["executed_action"].tolist()
        ([True, False], [0, 2])
    """

    replaces_actions = True

    def __init__(
        self,
        env: VectorEnv[Any, Any, Any],
        baseline: Callable[[NDArray[Any]], ArrayLike] | None,
        safe: Callable[[NDArray[Any]], ArrayLike],
        *,
        predict: bool | Callable[[NDArray[Any], NDArray[Any]], ArrayLike] | None = None,
        look_ahead: int = 1,
        mask_actions: bool = False,
    ) -> None:
        require_vector_env(env)
        super().__init__(env)
        require_array_observations(env)
        for name, function in (("baseline", baseline), ("safe", safe)):
            if not callable(function) and (name == "safe" or function is not None):
                raise TypeError(
                    f"{name} must be a function of observations, got "
                    f"{validation.shown(function)}."
                )
        self.baseline, self.safe, self.predict = baseline, safe, predict
        self.look_ahead = validation.integer("look_ahead", look_ahead, at_least=1)
        self.mask_actions = validation.boolean("mask_actions", mask_actions)
        self._actuator = Actuator(env)
        self._model = self._checked_model()
        if self.mask_actions and self._actuator.n_actions is None:
            raise ValueError(
                "mask_actions=True needs Discrete actions, got "
                f"{validation.shown(env.single_action_space)}; leave it out."
            )
        self._idle = IdleSlots(env)
        n = self.num_envs
        self._seen: NDArray[Any] = np.empty(0)  # before the first reset
        self._is_safe: BoolArray = np.ones(n, np.bool_)
        self._allowed: BoolArray | None = None
        self._violations: IntArray = np.zeros(n, np.int64)
        self._interventions: IntArray = np.zeros(n, np.int64)

    def _checked_model(self) -> Model | None:
        predict, baseline = self.predict, self.baseline
        if baseline is None and (predict or self.mask_actions or self.look_ahead > 1):
            raise ValueError(
                "baseline must be given where actions are to be predicted or forbidden, "
                "got None; leave predict, look_ahead and mask_actions out to count "
                "violations only."
            )
        if self.look_ahead > 1 and not predict:
            raise ValueError(
                f"look_ahead={self.look_ahead} needs a model; pass predict=True or a "
                "function."
            )
        if predict is None or predict is False:
            return None
        if predict is True:
            return OwnModel(self.env)
        if not callable(predict):
            raise TypeError(
                "predict must be True, None or a function of (observations, actions), "
                f"got {validation.shown(predict)}."
            )
        return FunctionModel(predict)

    @property
    def violations(self) -> IntArray:
        """Steps after which each slot was outside the safe set, `(num_envs,)`, a copy.

        Their sum is that of all slots. They count from the making of the shield, through
        all resets, evaluations in the same environment included.
        """
        return self._violations.copy()

    @property
    def interventions(self) -> IntArray:
        """Steps in which the action of each slot was replaced, `(num_envs,)`, a copy."""
        return self._interventions.copy()

    def reset_counters(self) -> None:
        """Count violations and interventions from zero again."""
        self._violations[:] = 0
        self._interventions[:] = 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start episodes, see the environment below; the counters go on.

        Raises:
            ValueError: the environment or `safe` does not return what it should.
        """
        passed = dict(options) if isinstance(options, Mapping) else options
        observations, infos = received.parts(
            "reset", self.env.reset(seed=seed, options=passed), 2
        )
        self._idle.begin(options)
        infos = self._see(observations, received.infos(infos, self.num_envs))
        return observations, infos

    def step(self, actions: ArrayLike) -> StepResult:
        """Carry out the actions of the learner, or those of the baseline.

        Args:
            actions: of all slots, as `env` takes them.

        Returns:
            What `env` returns, with infos about the shield.

        Raises:
            ResetNeeded: there was no reset yet.
            TypeError: numbers of actions are not integers.
            ValueError: an action has the wrong shape or is out of range; or `baseline`,
                `safe`, `predict` or the environment do not return what they should.
        """
        self._idle.require_begun()
        n, watched = self.num_envs, ~self._idle.mask
        chosen = self._actuator.of_learner(actions)
        executed = self._shielded(chosen, watched)
        shielded = _differ(executed, chosen)
        observations, rewards, terminated, truncated, infos = received.parts(
            "step", self.env.step(executed.copy()), 5
        )
        terminated = received.flags("terminated", terminated, n)
        truncated = received.flags("truncated", truncated, n)
        told = received.infos(infos, n)
        self._idle.finish(terminated | truncated)
        told = self._see(observations, told)
        violation = watched & ~self._safe_after(observations, told)
        self._violations += violation
        self._interventions += shielded
        found = {
            "shielded": shielded,
            "executed_action": executed,
            "violation": violation,
        }
        masks = {f"_{name}": watched.copy() for name in found}
        return (
            observations,
            received.rewards(rewards, n),
            terminated,
            truncated,
            {**told, **found, **masks},
        )

    def _shielded(self, chosen: NDArray[Any], watched: BoolArray) -> NDArray[Any]:
        """The actions that are carried out."""
        if self.baseline is None:
            return chosen
        if self._allowed is not None:
            columns = chosen - self._actuator.first_action
            good = self._allowed[np.arange(self.num_envs), columns] | ~watched
        else:
            good = self._is_safe | ~watched
            slots = np.flatnonzero(good & watched)
            if self._model is not None and slots.size:
                good[slots] = self._foresee(self._model, slots, chosen[slots])
        if good.all():
            return chosen
        replaced = chosen.copy()
        replaced[~good] = self._of_baseline(self._seen[~good])
        return replaced

    def _foresee(
        self, model: Model, slots: IntArray, actions: NDArray[Any]
    ) -> BoolArray:
        return stays_safe(
            model,
            slots,
            self._seen[slots],
            actions,
            safe=self._safe,
            baseline=self._of_baseline,
            look_ahead=self.look_ahead,
        )

    def _of_baseline(self, observations: NDArray[Any]) -> NDArray[Any]:
        """What the baseline does, as actions of the environment."""
        baseline: Any = self.baseline
        given = baseline(validation.read_only(observations))
        return self._actuator.of_controller("baseline", given, len(observations))

    def _safe(self, observations: NDArray[Any]) -> BoolArray:
        """Which observations are safe, a new array."""
        given = self.safe(validation.read_only(observations))
        array = validation.as_array(given)
        if (
            array is None
            or array.shape != observations.shape[:1]
            or array.dtype != np.bool_
        ):
            raise ValueError(
                f"safe must return a bool for each of {len(observations)} observations, "
                f"got {validation.shown(given)}."
            )
        return array.copy()

    def _see(self, observations: Any, infos: Mapping[str, Any]) -> dict[str, Any]:
        """Note where the slots stand; return the infos, with masks if they are wanted."""
        seen = received.observations(observations, self.num_envs)
        self._seen = np.array(seen)  # callers may change theirs
        self._is_safe = self._safe(self._seen)
        if not self.mask_actions:
            return dict(infos)
        self._allowed = self._permitted(infos)
        present = np.ones(self.num_envs, dtype=np.bool_)
        return {
            **infos,
            "action_mask": self._allowed.copy(),
            "_action_mask": present,
        }

    def _permitted(self, infos: Mapping[str, Any]) -> BoolArray:
        """Which actions are not replaced, `(num_envs, n_actions)`; the baseline's is one."""
        n, n_actions = self.num_envs, self._actuator.n_actions or 0
        first = self._actuator.first_action
        allowed = np.repeat(self._is_safe[:, None], n_actions, axis=1)
        slots = np.flatnonzero(self._is_safe & ~self._idle.mask)
        if self._model is not None and slots.size:
            actions = np.tile(np.arange(n_actions) + first, slots.size)
            good = self._foresee(self._model, np.repeat(slots, n_actions), actions)
            allowed[slots] = good.reshape(slots.size, n_actions)
        own = received.action_mask(infos, n, n_actions)
        if own is not None:
            allowed &= own
        allowed[np.arange(n), self._of_baseline(self._seen) - first] = True
        return allowed

    def _safe_after(self, observations: Any, infos: Mapping[str, Any]) -> BoolArray:
        """Which slots were safe after the step, before they may have been reset in it."""
        final, ended = infos.get("final_obs"), infos.get("_final_obs")
        if final is None or ended is None or not np.any(ended):
            return self._is_safe
        safe = self._is_safe.copy()
        slots = np.flatnonzero(ended)
        safe[slots] = self._safe(np.stack([final[slot] for slot in slots]))
        return safe


def _differ(executed: NDArray[Any], chosen: NDArray[Any]) -> BoolArray:
    """In which slots the actions are not the same."""
    differs = executed != chosen
    return np.asarray(differs.reshape(len(chosen), -1).any(axis=1))
