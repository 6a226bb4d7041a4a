"""Running the plant with the present policy and some exploration."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from acl_gym.envs.learned.recorder import Recorder
from acl_gym.model_based.arguments import action_space_of
from acl_gym.model_based.journal import Journal
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray, Predictor


class PlantRunner:
    """Steps a plant and records what it does.

    A random action is held for some steps, since an input that changes in each step
    hardly moves a sluggish plant.

    Args:
        env: a single or a vector environment.
        inputs: what each action of the policy sets, `(n_actions, n_inputs)`; None where
            actions are numbered and nobody has said what they set.
        explore: the share of steps with random actions, in [0, 1].
        hold: for how many steps one is held.
        restart_after: steps after which the plant is reset; None: where episodes end.
        seed: of the environment and of exploration.

    Attributes:
        policy: what chooses actions; None: all are random. It may be replaced at any
            moment, also by another thread.
    """

    def __init__(
        self,
        env: Any,
        *,
        inputs: FloatArray | None,
        explore: float,
        hold: int,
        restart_after: int | None,
        seed: int | None,
    ) -> None:
        space = action_space_of(env)
        numbered = isinstance(space, spaces.Discrete)
        self._recorder = Recorder(env, inputs=inputs if numbered else None, seed=seed)
        self._inputs = None if numbered else inputs
        self._hold = hold
        self._restart_after = restart_after
        # So that the share of random steps is `explore`, though each draw is held.
        self._probability = explore / (hold - explore * (hold - 1))
        self._rng = np.random.default_rng(None if seed is None else [seed, 3])
        self._first = int(space.start) if numbered else 0
        self.n_actions = int(space.n) if numbered else len(inputs)  # type: ignore[arg-type]
        slots = self._recorder.num_envs
        self._held: IntArray = np.zeros(slots, np.int64)
        self._random: IntArray = np.zeros(slots, np.int64)
        self._since: IntArray = np.zeros(slots, np.int64)
        self._shape = space.shape
        self._dtype = space.dtype
        self.policy: Predictor | None = None

    @property
    def steps(self) -> int:
        """Interactions made so far, of all slots together."""
        return self._recorder.steps

    def step(self, journal: Journal | None) -> None:
        """Make a step in each slot, and write it down."""
        recorder = self._recorder
        ended = recorder.step(self._actions(self._chosen(recorder.observation)))
        if journal is not None:
            journal.append(recorder.newest(), recorder.newest_runs())
        self._since += 1
        if self._restart_after is not None:
            late = (self._since >= self._restart_after) & ~ended
            if late.any():
                recorder.restart(late)
            ended = ended | late
        self._since[ended] = 0
        self._held[ended] = 0

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Everything that was recorded, arguments of `Transitions`."""
        return self._recorder.arrays()

    def _chosen(self, observation: NDArray[Any]) -> IntArray:
        """The number of the action of each slot, `(num_envs,)`."""
        begins: BoolArray = self._held == 0
        policy = self.policy
        if policy is not None:
            begins &= self._rng.random(begins.size) < self._probability
        drawn = self._rng.integers(0, self.n_actions, begins.size)
        self._random = np.where(begins, drawn, self._random)
        self._held = np.where(begins, self._hold, self._held)
        chosen = self._random
        if policy is not None and (self._held == 0).any():
            found, _ = policy.predict(observation)
            # Where it has learned, in the model, actions are counted from 0.
            mine = np.asarray(found).reshape(begins.size)
            chosen = np.where(self._held > 0, self._random, mine)
        self._held = np.maximum(self._held - 1, 0)
        return chosen

    def _actions(self, chosen: IntArray) -> Any:
        """What the environment is given."""
        if self._inputs is None:
            return chosen + self._first
        rows = self._inputs[chosen].astype(self._dtype)
        return rows.reshape(chosen.size, *self._shape)
