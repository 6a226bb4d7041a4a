"""Running an environment step by step, and keeping what it did."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from numpy.typing import NDArray

from acl_gym.envs import received
from acl_gym.envs.learned.description import described_by
from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, IntArray


class _Predicts(Protocol):
    def predict(self, observation: Any) -> Any: ...


Policy = _Predicts | Callable[[Any], Any] | None
"""What chooses actions; None draws them at random."""


class Recorder:
    """Steps an environment and keeps states, inputs, next states, rewards and ends.

    Args:
        env: see `Transitions.record`.
        policy: see there.
        hold: see there.
        inputs: see there.
        seed: see there.

    Attributes:
        steps: how many were made, of all slots together.
        observation: where the slots are now, `(num_envs, size)`.
        facts: what the environment tells of its numbers, arguments of `Transitions`.

    Raises:
        TypeError: `env` is no environment, `policy` chooses no actions, or observations
            or actions are of a kind that cannot be recorded.
        ValueError: `inputs` do not fit the actions.
    """

    def __init__(
        self,
        env: Any,
        policy: Policy = None,
        *,
        hold: int = 1,
        inputs: Any = None,
        seed: int | None = None,
    ) -> None:
        if not all(callable(getattr(env, name, None)) for name in ("reset", "step")):
            raise TypeError(
                "env must be an environment of Gymnasium, single or vector, got "
                f"{validation.shown(env)}; make it with gym.make or gym.make_vec."
            )
        if policy is not None and not callable(getattr(policy, "predict", policy)):
            raise TypeError(
                "policy must have predict(observations), be a function of observations, "
                f"or be None, got {validation.shown(policy)}."
            )
        self.facts = described_by(env, inputs)
        self._size = self.facts.pop("size")
        del self.facts["n_inputs"]
        self.env, self.policy = env, policy
        self.hold = validation.integer("hold", hold, at_least=1)
        self._vector = isinstance(env, VectorEnv)
        self.num_envs = env.num_envs if self._vector else 1
        self._space: Any = env.single_action_space if self._vector else env.action_space
        # What numbered actions set, where that is known.
        self._values: NDArray[np.float64] | None = None
        if isinstance(self._space, spaces.Discrete) and not self.facts.get("numbered"):
            self._values = np.array(self.facts["values"], dtype=np.float64)
        seed = validation.seed(seed)
        # Another stream than that of the environment, which gets the same seed.
        self._rng = np.random.default_rng(None if seed is None else [seed, 2])
        self._drawn: Any = None
        self._held = 0
        self.steps = 0
        # One append a step, so that another thread may read meanwhile.
        self._kept: list[dict[str, NDArray[Any]]] = []
        self._runs = np.arange(self.num_envs)  # the number of each slot's run
        self._starting = np.zeros(self.num_envs, np.bool_)
        self.observation = self._reset(seed=seed)

    def step(self, actions: Any = None) -> BoolArray:
        """Make a step in each slot.

        Args:
            actions: of the slots, `(num_envs, ...)`; None asks the policy.

        Returns:
            Which slots' episodes have ended, `(num_envs,)`.

        Raises:
            ValueError: actions are not one for each slot from the action space, or the
                environment returns what cannot be recorded.
        """
        actions = self._checked(self._chosen() if actions is None else actions)
        if self._vector:
            found, *results, infos = self.env.step(actions)
        else:
            found, *results, infos = self.env.step(self._single(actions))
            found = np.asarray(found)[None]
        rewards = self._of_slots("rewards", results[0], "biuf").astype(np.float64)
        terminated, truncated = (
            self._of_slots(name, each, "biu").astype(np.bool_)
            for name, each in zip(("terminated", "truncated"), results[1:], strict=True)
        )
        found = self._numbers(found)
        ended = terminated | truncated
        reached = found
        mode = self._mode()
        if ended.any() and mode is AutoresetMode.SAME_STEP:
            reached = found.copy()
            last = received.infos(infos, self.num_envs).get("final_obs")
            for slot in np.flatnonzero(ended):
                reached[slot] = self._last(last, int(slot))
        self._check(reached, rewards)
        made = ~self._starting  # a slot that restarts makes no step
        rows = np.flatnonzero(made)
        new = {
            "states": self.observation[rows],
            "inputs": self._inputs(actions)[rows],
            "next_states": reached[rows],
            "rewards": rewards[rows],
            "terminated": terminated[rows],
            "runs": self._runs[rows],
        }
        self._kept.append(new)
        self.steps += rows.size
        ended &= made
        self._starting = np.zeros(self.num_envs, np.bool_)
        self.observation = found
        if ended.any():
            self._number_runs(ended)
            if mode is AutoresetMode.NEXT_STEP:
                self._starting = ended
            elif mode is not AutoresetMode.SAME_STEP:
                self._begin(ended)
        return ended

    def _checked(self, actions: Any) -> NDArray[Any]:
        """Actions, one for each slot, from the action space.

        Raises:
            ValueError: they are something else.
        """
        array = validation.as_array(actions)
        discrete = isinstance(self._space, spaces.Discrete)
        shape = (self.num_envs, *(() if discrete else self._space.shape))
        kinds = "iu" if discrete else "biuf"
        if array is None or array.shape != shape or array.dtype.kind not in kinds:
            raise ValueError(
                f"actions must be {'integers' if discrete else 'numbers'} of shape {shape}, "
                f"a row for each slot, got {validation.shown(actions)}; check the policy."
            )
        if discrete:
            first, last = (
                int(self._space.start),
                int(self._space.start + self._space.n) - 1,
            )
            wrong = (array < first) | (array > last)
            expected = f"in {first}..{last}"
        else:
            wrong = ~np.isfinite(array).reshape(self.num_envs, -1).all(axis=1)
            expected = "finite"
        if wrong.any():
            slot = int(np.argmax(wrong))
            raise ValueError(
                f"actions must be {expected}, got {validation.shown(array[slot].tolist())} "
                f"in slot {slot}; check the policy."
            )
        return array

    def _last(self, observations: Any, slot: int) -> NDArray[np.float64]:
        """The last observation of an episode, which SAME_STEP hands out in infos.

        Raises:
            ValueError: infos do not hold it.
        """
        found = validation.as_array(
            None if observations is None else observations[slot]
        )
        if (
            found is None
            or found.shape != (self._size,)
            or found.dtype.kind not in "biuf"
        ):
            raise ValueError(
                "infos['final_obs'] must hold the last observation of each slot that has "
                f"finished, {self._size} numbers, got {validation.shown(observations)} "
                f"for slot {slot}; check the environment and its wrappers. Nothing of that "
                "step was kept."
            )
        return found.astype(np.float64)

    def _numbers(self, found: Any) -> NDArray[np.float64]:
        """Observations `(num_envs, size)` as numbers.

        Raises:
            ValueError: they have another shape than they are to have.
        """
        array = validation.as_array(found)
        shape = self.num_envs, self._size
        if array is None or array.shape != shape or array.dtype.kind not in "biuf":
            raise ValueError(
                f"the plant must return observations of shape {shape} after step "
                f"{self.steps}, got {validation.shown(found)}; nothing of that step was "
                "kept."
            )
        return array.astype(np.float64)

    def _of_slots(self, name: str, values: Any, kinds: str) -> NDArray[Any]:
        """One value for each slot, `(num_envs,)`; arrays that hold one are values too.

        Args:
            name: of what the plant returned.
            values: what that is.
            kinds: letters of the NumPy types that it may have.

        Raises:
            ValueError: it is of another type, or not one for each slot.
        """
        array = validation.as_array(values)
        if (
            array is None
            or array.dtype.kind not in kinds
            or array.size != self.num_envs
            or any(size not in (1, self.num_envs) for size in array.shape)
        ):
            one = "one number" if name == "rewards" else "True or False"
            raise ValueError(
                f"the plant must return {name} with {one} for each of "
                f"{self.num_envs} slots after step {self.steps}, got "
                f"{validation.shown(values)}; nothing of that step was kept."
            )
        return array.reshape(self.num_envs)

    def _check(self, reached: NDArray[np.float64], rewards: Any) -> None:
        """Refuse what is not finite before it is kept: a model cannot learn from it."""
        good = np.isfinite(reached).all(axis=1) & np.isfinite(rewards)
        if not good.all():
            slot = int(np.argmin(good))
            raise ValueError(
                f"the plant must return finite numbers, got {reached[slot].tolist()} "
                f"with reward {np.asarray(rewards)[slot]} after step {self.steps}; check "
                "its sensors. Nothing of that step was kept."
            )

    def restart(self, slots: BoolArray) -> None:
        """Reset some slots in the middle of their episodes.

        Args:
            slots: which, `(num_envs,)`.
        """
        self._number_runs(slots)
        self._begin(slots)

    def newest(self) -> dict[str, NDArray[Any]]:
        """What the last step of each slot did, arguments of `Transitions`."""
        return {n: array for n, array in self._kept[-1].items() if n != "runs"}

    def newest_runs(self) -> IntArray:
        """The number of the run that each of the newest steps belongs to."""
        return self._kept[-1]["runs"]

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Everything that was recorded, run after run, arguments of `Transitions`."""
        kept = list(self._kept)
        joined = {
            name: np.concatenate([each[name] for each in kept]) for name in kept[0]
        }
        runs = joined.pop("runs")
        order = np.argsort(runs, kind="stable")
        _, numbers = np.unique(runs[order], return_inverse=True)
        return {
            **{name: array[order] for name, array in joined.items()},
            "episodes": numbers.astype(np.int64),
        }

    def random_actions(self) -> Any:
        """Actions drawn from the action space, `(num_envs, ...)`."""
        space = self._space
        if isinstance(space, spaces.Discrete):
            first = int(space.start)
            return self._rng.integers(first, first + int(space.n), self.num_envs)
        bounded = space.bounded_below & space.bounded_above
        if not bounded.all():
            raise ValueError(
                "random actions need a Box with finite bounds, got "
                f"{validation.shown(space)}; give a policy."
            )
        shape = self.num_envs, *space.shape
        return self._rng.uniform(space.low, space.high, shape).astype(space.dtype)

    def _number_runs(self, slots: BoolArray) -> None:
        """Let these slots begin runs with numbers of their own."""
        self._runs[slots] = self._runs.max() + 1 + np.arange(np.count_nonzero(slots))

    def _begin(self, slots: BoolArray) -> None:
        """Reset these slots now."""
        if self._vector and not slots.all():
            self.observation = self._reset(options={"reset_mask": slots})
        else:
            self.observation = self._reset()

    def _chosen(self) -> Any:
        if self.policy is None:
            if self._held == 0:
                self._drawn, self._held = self.random_actions(), self.hold
            self._held -= 1
            return self._drawn
        predict: Any = getattr(self.policy, "predict", self.policy)
        found: Any = predict(self.observation)
        return found[0] if isinstance(found, tuple) and found else found

    def _inputs(self, actions: NDArray[Any]) -> NDArray[np.float64]:
        """What the actions set, `(num_envs, n_inputs)`."""
        if self._values is not None:
            return np.asarray(self._values[actions - int(self._space.start)])
        return np.asarray(actions.reshape(self.num_envs, -1).astype(np.float64))

    def _single(self, actions: NDArray[Any]) -> Any:
        action = actions[0]
        return int(action) if isinstance(self._space, spaces.Discrete) else action

    def _mode(self) -> Any:
        """What a vector environment does with slots that have finished."""
        return received.autoreset_mode_of(self.env) if self._vector else None

    def _reset(self, **how: Any) -> NDArray[np.float64]:
        found, _ = self.env.reset(**how)
        array = self._numbers(found if self._vector else np.asarray(found)[None])
        self._check(array, np.zeros(self.num_envs))
        return array
