"""A policy on a plant that goes on after the goal, from many starts at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray, Predictor


@dataclass(frozen=True)
class Responses:
    """What a policy does from n starts in H steps, whether or not it has been at the goal.

    Attributes:
        states: the variables, without uncertain parameters, `(H + 1, n, variables)`.
        actions: indices, `(H, n)`.
        costs: of each step, `(H, n)`.
        inside: whether the state after each step lies in the goal, `(H, n)`.
        limit: T, the steps within which the goal is to be reached.
    """

    states: FloatArray
    actions: IntArray
    costs: FloatArray
    inside: BoolArray
    limit: int

    @property
    def count(self) -> int:
        """The number of starts."""
        return int(self.states.shape[1])

    def steps_to_goal(self) -> IntArray:
        """Steps until the goal is first reached, H + 1 where it never is, `(n,)`."""
        first = self.inside.argmax(axis=0) + 1
        return np.where(self.inside.any(axis=0), first, len(self.inside) + 1)

    def success(self) -> BoolArray:
        """Whether the goal is reached within T steps, `(n,)`."""
        return np.asarray(self.steps_to_goal() <= self.limit)

    def episode_costs(self) -> FloatArray:
        """The cost until the goal is reached, or of T steps, `(n,)`."""
        last = np.minimum(self.steps_to_goal(), self.limit)
        counted = np.arange(len(self.costs))[:, None] < last
        return np.asarray(np.sum(self.costs, axis=0, where=counted))

    def settled(self) -> BoolArray:
        """Whether the state is in the goal throughout the last quarter, `(n,)`."""
        return np.asarray(self.inside[-self.last_quarter :].all(axis=0))

    @property
    def last_quarter(self) -> int:
        """A quarter of the H steps, >= 1."""
        return max(1, len(self.inside) // 4)

    def one(self, start: int) -> Responses:
        """The response from one of the starts."""
        chosen = slice(start, start + 1)
        return Responses(
            self.states[:, chosen],
            self.actions[:, chosen],
            self.costs[:, chosen],
            self.inside[:, chosen],
            self.limit,
        )


def simulate(
    policy: Predictor,
    env: ControlVectorEnv,
    starts: FloatArray,
    steps: int,
    seed: int = 0,
) -> Responses:
    """Run a policy from each start for a number of steps, without stopping at the goal.

    Args:
        policy: whose actions are followed, without exploration.
        env: the plant; it is not stepped itself.
        starts: `(n, state_size)`.
        steps: H, >= 1.
        seed: of what is random in the plant.
    """
    system: Any = env.system
    size = system.low.size
    state = np.ascontiguousarray(system.checked_states(starts).T)
    count = state.shape[1]
    states = np.empty((steps + 1, count, size))
    actions = np.empty((steps, count), dtype=np.int64)
    costs, inside = np.empty((steps, count)), np.empty((steps, count), dtype=np.bool_)
    rng = np.random.default_rng(seed)
    states[0] = state[:size].T
    rewards, reached = np.empty(count), np.empty(count, dtype=np.bool_)
    space: Any = env.single_action_space
    for step in range(steps):
        chosen, _ = policy.predict(system.observe(state), deterministic=True)
        actions[step] = np.asarray(chosen) - int(space.start)
        uniforms = None
        if system.draws_per_step:
            uniforms = rng.random((system.draws_per_step, count))
        system.advance(state, actions[step].copy(), uniforms, rewards, reached)
        states[step + 1] = state[:size].T
        costs[step], inside[step] = -rewards, reached
    return Responses(states, actions, costs, inside, system.evaluation_steps)
