"""Ant Colony Learning: Algorithms 4.1 and 4.2 in one loop."""

from __future__ import annotations

import math
import warnings
from typing import Any, Self

import numpy as np
from gymnasium.vector import VectorEnv
from numba import njit
from numpy.typing import ArrayLike

from acl_gym import validation
from acl_gym.agents.pheromone import Pheromone, Solutions
from acl_gym.agents.policy import SoftPolicy
from acl_gym.agents.selection import RULES, choose_actions
from acl_gym.agents.tabular import TabularAgent
from acl_gym.agents.training import Training
from acl_gym.callbacks import Callbacks, Row
from acl_gym.envs.control_env import ControlVectorEnv
from acl_gym.partition import CellArray, FloatArray, IntArray, Partition


class PheromoneBoundWarning(UserWarning):
    """tau0 exceeds rho / J_max, so levels may fall below it (Proposition 4.3)."""


class ACL(TabularAgent):
    """A colony of ants that learns a control policy (van Ast, 2010).

    Each slot of the environment is an ant. Through a `Crisp` partition the agent is
    Algorithm 4.1, through a `Fuzzy` one Algorithm 4.2: both are the same equations
    over `(index, degree)`. The defaults are those of Table 5.2 and of the base case
    of §5.3.

    Args:
        env: a vector environment with `Discrete` actions; its slots are the M ants.
        partition: turns observations into cells and degrees.
        tau0: initial pheromone level tau_0, > 0. Levels stay above it if it is at
            most rho / J_max (Proposition 4.3). Where J_max is known and it is more,
            a `PheromoneBoundWarning` says so (a decision; Table 5.2 exceeds it).
        local_decay: gamma, in [0, 1), the decay of each visited pair (4.12).
        global_decay: rho, in [0, 1], weight of the deposits of a trial (4.15). The
            thesis requires rho > 0; 0, where nothing is learned, is among its
            experiments.
        alpha: exponent of the selection rule (4.11), > 0.
        epsilon: exploration probability, in [0, 1]; see `selection`.
        selection: `"max_boltzmann"` (3.6), `"boltzmann"` (3.4), which has no
            epsilon, or `"epsilon_greedy"` (3.5).
        max_steps: T, the longest an ant may walk, >= 1.
        seed: a run is a function of it; None draws one from the system.
        n_actions: only needed without an environment.

    Raises:
        TypeError: `env` or `partition` is of the wrong kind.
        ValueError: a parameter is out of range.

    Example:
        >>> import gymnasium as gym
        >>> from acl_gym import ACL, Fuzzy
        >>> env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=250)
        >>> grid = Fuzzy.from_box(env.single_observation_space, (40, 41), circular=[0])
        >>> colony = ACL(env, grid, tau0=1e-5, seed=0).learn(trials=3)
        >>> colony.trials
        3
    """

    def __init__(
        self,
        env: VectorEnv[Any, Any, Any] | None,
        partition: Partition,
        *,
        tau0: float = 1e-4,
        local_decay: float = 0.01,
        global_decay: float = 0.1,
        alpha: float = 3.0,
        epsilon: float = 0.1,
        selection: str = "max_boltzmann",
        max_steps: int = 300,
        seed: int | None = None,
        n_actions: int | None = None,
    ) -> None:
        self.tau0 = validation.number("tau0", tau0, above=0)
        self.local_decay = validation.number(
            "local_decay", local_decay, at_least=0, below=1
        )
        self.global_decay = validation.number(
            "global_decay", global_decay, at_least=0, at_most=1
        )
        self.alpha = validation.number("alpha", alpha, above=0)
        self.epsilon = validation.number("epsilon", epsilon, at_least=0, at_most=1)
        self.selection = validation.one_of("selection", selection, RULES)
        super().__init__(
            env, partition, max_steps=max_steps, seed=seed, n_actions=n_actions
        )
        self.pheromone = Pheromone(
            partition.n_cells, self.n_actions, self.tau0, self.alpha
        )
        self._solutions: Solutions | None = None

    def learn(
        self,
        total_timesteps: int | None = None,
        trials: int | None = None,
        callback: Callbacks = None,
        log_interval: int | None = None,
        progress_bar: bool = False,
    ) -> Self:
        """Let the colony make trials; the step numbers are those of Algorithm 4.2.

        Called again, it goes on from the pheromone as it is.

        Args:
            total_timesteps: stop after the trial that reaches so many steps of all
                ants together; None sets no such limit.
            trials: K, how many trials to make; None sets no such limit. Without
                either limit, 100.
            callback: a `Callback`, a function of `(agent, row)`, or a list of those.
            log_interval: print a line every so many trials; None prints nothing.
            progress_bar: show a bar.

        Returns:
            The agent itself.

        Raises:
            ValueError: a solution's cost is not positive and finite.
        """
        walk, pheromone = self.walk, self.pheromone
        solutions = self._solutions = self._fresh_solutions()
        budget = (total_timesteps, trials, callback, log_interval, progress_bar)
        with Training(self, *budget) as training:
            while training.goes_on:  # 2, 22: repeat until k = K
                # 3-6: every ant begins in a random state with an empty solution
                observation = walk.start(seed=self._next_seed())
                solutions.clear()
                while walk.ants.size:  # 7, 17: repeat until t = T or C is empty
                    ants = walk.ants
                    # 8: fuzzify the states
                    index, degree = self._locate(observation, ants)
                    # 9: select actions, all on the same pheromone
                    actions = self._choose(index, degree, self.rng)
                    # 10: add the pairs to the partial solutions
                    solutions.append(ants, index, degree, actions)
                    # 11, 13-16: apply the actions; who is at the goal leaves C
                    observation = walk.step(actions).observation
                    # 12: local pheromone update (4.12)
                    pheromone.local_update(index, degree, actions, self.local_decay)
                # 18-20: global pheromone update with all solutions (4.15)
                pheromone.global_update(solutions, walk.cost, self.global_decay)
                training.end_trial()  # 21: k <- k + 1
        return self

    @property
    def table(self) -> FloatArray:
        """The pheromone levels tau, `(n_cells, n_actions)`, a live array."""
        return self.pheromone.levels

    def set_table(self, table: ArrayLike) -> None:
        """Replace the pheromone levels.

        Raises:
            ValueError: the shape differs, or a level is not positive and finite.
        """
        levels = np.asarray(table, dtype=np.float64)
        if levels.shape != self.table.shape:
            raise ValueError(
                f"table must have shape {self.table.shape}, got {levels.shape}."
            )
        if not (np.isfinite(levels) & (levels > 0.0)).all():
            raise ValueError("table must hold positive finite levels only.")
        self.pheromone.set_levels(levels)

    def set_env(self, env: VectorEnv[Any, Any, Any]) -> None:
        """See `TabularAgent.set_env`; checks tau0 against Proposition 4.3."""
        super().set_env(env)
        base = env.unwrapped
        if isinstance(base, ControlVectorEnv) and self.global_decay > 0.0:
            highest_cost = self.max_steps * base.system.max_stage_cost
            bound = self.global_decay / highest_cost
            if self.tau0 > bound:
                digit = 10.0 ** math.floor(math.log10(bound))
                warnings.warn(
                    f"tau0 = {self.tau0:g} exceeds global_decay / J_max = {bound:.3g} "
                    f"(J_max <= {highest_cost:.4g} on this environment), so pheromone "
                    "levels may fall below tau0 (Proposition 4.3); a tau0 of at most "
                    f"{math.floor(bound / digit) * digit:.0e} rules that out.",
                    PheromoneBoundWarning,
                    stacklevel=4,
                )

    def soft_policy(
        self, exponent: float = 10.0, seed: int | None = None
    ) -> SoftPolicy:
        """A policy that draws its actions, for where the greedy one hovers.

        Args:
            exponent: takes the place of alpha in (4.11), > 0.
            seed: of the draws; None draws one from the system.

        Returns:
            A policy over a copy of the pheromone as it is now.
        """
        first_action = self.policy.first_action
        return SoftPolicy(self.partition, self.table, exponent, seed, first_action)

    def parameters(self) -> dict[str, Any]:
        """The keyword arguments of the constructor."""
        return {
            "tau0": self.tau0,
            "local_decay": self.local_decay,
            "global_decay": self.global_decay,
            "alpha": self.alpha,
            "epsilon": self.epsilon,
            "selection": self.selection,
            "max_steps": self.max_steps,
            "seed": self.seed,
        }

    def measures(self, policy: IntArray) -> Row:
        """The sensitivity of the policy (3.48), averaged over the cells, in [0, 1]."""
        return {"sensitivity": float(_mean_sensitivity(self.table, policy, self.alpha))}

    def _explore(self, index: CellArray, degree: FloatArray) -> IntArray:
        return self._choose(index, degree, self._predict_rng)

    def _choose(
        self, index: CellArray, degree: FloatArray, rng: np.random.Generator
    ) -> IntArray:
        return choose_actions(
            self.selection, self.pheromone, index, degree, self.epsilon, rng
        )

    def _fresh_solutions(self) -> Solutions:
        """Memory for a trial, kept from one call of `learn` to the next."""
        kept = self._solutions
        if kept is not None and kept.action.shape == (self.num_envs, self.max_steps):
            return kept
        return Solutions(self.num_envs, self.max_steps, self.partition.cells_per_state)


@njit(cache=True)
def _mean_sensitivity(levels: FloatArray, policy: IntArray, alpha: float) -> float:
    total = 0.0
    for cell in range(levels.shape[0]):
        second = 0.0
        for u in range(levels.shape[1]):
            if u != policy[cell]:
                second = max(second, levels[cell, u])
        total += (second / levels[cell, policy[cell]]) ** alpha
    return float(total / levels.shape[0])
