"""Ant Colony Learning: Algorithms 4.1 and 4.2 in one loop."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from typing import Any, Self

import numpy as np
from gymnasium.vector import VectorEnv
from numba import njit
from numpy.typing import ArrayLike

from acl_gym.agents.base import TabularAgent
from acl_gym.agents.training import Training
from acl_gym.callbacks.base import Callbacks
from acl_gym.colony.costs import Cost, as_cost, cost_from_settings, solution_costs
from acl_gym.colony.deposits import (
    Deposit,
    InverseCost,
    as_deposit,
    deposit_from_settings,
)
from acl_gym.colony.episodes import Episode
from acl_gym.colony.pheromone import Pheromone
from acl_gym.colony.schedules import Scheduled, Setting, schedule_from_settings
from acl_gym.colony.selection import RULES, choose_actions
from acl_gym.colony.solutions import Solutions
from acl_gym.colony.update_rule import TrialResult, UpdateRule
from acl_gym.colony.update_rules import (
    as_update,
    update_from_settings,
    update_to_settings,
)
from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.evaluation.rollout import Rollout
from acl_gym.partitions import Partition
from acl_gym.policies import SoftPolicy
from acl_gym.utils import validation
from acl_gym.utils.serialization import to_settings
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray, IntArray, Row


class PheromoneBoundWarning(UserWarning):
    """tau0 exceeds 1 / J_max, so levels may fall below it (Proposition 4.3)."""


class ACL(TabularAgent):
    """A colony of ants that learns a control policy (van Ast, 2010).

    Each slot of the environment is an ant. Through a `Crisp` partition the agent is
    Algorithm 4.1, through a `Fuzzy` one Algorithm 4.2: both are the same equations
    over `(index, degree)`. The defaults are those of Table 5.2 and of the base case
    of §5.3.

    Args:
        env: a vector environment with `Discrete` actions; its slots are the M ants.
        partition: turns observations into cells and degrees; None takes
            `automatic_partition(env)`.
        tau0: initial pheromone level tau_0, > 0. Levels never fall below it if it is
            at most 1 / J_max (the proof of Proposition 4.3; its text asks for
            rho / J_max, which Table 5.2 exceeds). Where J_max is known and tau0 is
            more, a `PheromoneBoundWarning` says so (a decision).
        local_decay: gamma, in [0, 1), the decay of each visited pair (4.12).
        global_decay: rho, in [0, 1], weight of the deposits of a trial (4.15). The
            thesis requires rho > 0; 0, where nothing is learned, is among its
            experiments.
        alpha: exponent of the selection rule (4.11), > 0; a number, or a schedule such
            as `Linear(1, 3, trials=50)` that gives one for each trial.
        epsilon: exploration probability, in [0, 1], a number or a schedule; see
            `selection`.
        selection: `"max_boltzmann"` (3.6), `"boltzmann"` (3.4), which has no
            epsilon, or `"epsilon_greedy"` (3.5).
        cost: J of a solution. None takes the sum of the environment's stage costs,
            -(rewards), (3.2); a `Cost` such as `Steps()`, or a function of one
            `Episode`, looks at the solution as a whole.
        deposit: what an ant lays for a solution of cost J: `"inverse_cost"`, 1 / J
            (3.8); `"return"`, for environments whose returns are never negative;
            `"rank"`, for any; a `Deposit`, or a function of the costs of a trial.
        tabu: forbid an ant to choose an action twice in the same cell in one trial
            (§3.4.2). For partitions with one cell a state.
        max_steps: T, the longest an ant may walk, >= 1. None takes the limit that the
            environment is registered with, and 300 where it has none.
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
        >>> colony = ACL(env, grid, seed=0).learn(trials=3)
        >>> colony.trials
        3
    """

    local_decay = validation.Number(at_least=0, below=1)
    global_decay = validation.Number(at_least=0, at_most=1)
    alpha = Scheduled(above=0)
    epsilon = Scheduled(at_least=0, at_most=1)

    def __init__(
        self,
        env: VectorEnv[Any, Any, Any] | None,
        partition: Partition | None = None,
        *,
        tau0: float = 1e-4,
        local_decay: float = 0.01,
        global_decay: float = 0.1,
        alpha: Setting = 3.0,
        epsilon: Setting = 0.1,
        selection: str = "max_boltzmann",
        cost: Cost | Callable[[Episode], float] | None = None,
        deposit: str | Deposit | Callable[[FloatArray], FloatArray] = "inverse_cost",
        update: str | UpdateRule = "each_visit",
        tabu: bool = False,
        max_steps: int | None = None,
        seed: int | None = None,
        n_actions: int | None = None,
    ) -> None:
        tau0 = validation.number("tau0", tau0, above=0)
        self.alpha = alpha
        self.local_decay = local_decay
        self.global_decay = global_decay
        self.epsilon = epsilon
        self._selection = validation.one_of("selection", selection, RULES)
        self.cost = cost
        self.deposit = deposit
        self.update = update
        super().__init__(
            env, partition, max_steps=max_steps, seed=seed, n_actions=n_actions
        )
        if not isinstance(tabu, bool):
            raise TypeError(f"tabu must be True or False, got {tabu!r}.")
        if tabu and self.partition.cells_per_state > 1:
            raise ValueError(
                "tabu needs a partition with one cell a state, such as Crisp or "
                f"Discrete, got {self.partition!r}; leave tabu out."
            )
        self.tabu = tabu
        self.pheromone = Pheromone(
            self.partition.n_cells, self.n_actions, tau0, self._now("alpha")
        )
        self._solutions: Solutions | None = None
        self._warn_if_tau0_is_high()

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
        pheromone = self.pheromone
        budget = (total_timesteps, trials, callback, log_interval, progress_bar)
        with Training(self, *budget) as training:
            while training.next_trial():  # 2, 22: repeat until k = K
                # 3-6: every ant begins in a random state with an empty solution
                rollout, solutions = self.rollout, self._empty_solutions()
                rule, record = self.update, self._needs_episodes()
                pheromone.alpha, epsilon = self._now("alpha"), self._now("epsilon")
                observation = rollout.start(seed=self._next_seed(), record=record)
                rule.start_trial(pheromone, self.trials)
                while rollout.ants.size:  # 7, 17: repeat until t = T or C is empty
                    ants = rollout.ants
                    # 8: fuzzify the states
                    index, degree = self._locate(observation, ants)
                    # 9: select actions, by default all on the same pheromone
                    allowed = self._allowed(rollout, solutions, index)
                    actions = rule.choose(
                        self.selection,
                        pheromone,
                        index,
                        degree,
                        epsilon,
                        self.rng,
                        allowed,
                        self.local_decay,
                    )
                    # 10: add the pairs to the partial solutions
                    solutions.append(ants, observation, index, actions)
                    # 11, 13-16: apply the actions; who is at the goal leaves C
                    observation = rollout.step(actions).observation
                    # 12: local pheromone update, by default (4.12)
                    rule.local_update(
                        pheromone, index, degree, actions, self.local_decay
                    )
                # 18-20: global pheromone update with all solutions, in general (4.15)
                result = self._result(rollout, solutions)
                rule.global_update(
                    pheromone, result, self.local_decay, self.global_decay
                )
                training.end_trial(result.costs)  # 21: k <- k + 1
        return self

    @property
    def tau0(self) -> float:
        """Initial pheromone level tau_0; fixed once the colony is made."""
        return self.pheromone.tau0

    @property
    def cost(self) -> Cost | None:
        """What a solution costs; None: the sum of its stage costs."""
        return self._cost

    @cost.setter
    def cost(self, value: Cost | Callable[[Episode], float] | None) -> None:
        self._cost = as_cost(value)

    @property
    def deposit(self) -> Deposit:
        """What an ant lays for a solution of a given cost."""
        return self._deposit

    @deposit.setter
    def deposit(
        self, value: str | Deposit | Callable[[FloatArray], FloatArray]
    ) -> None:
        self._deposit = as_deposit(value)

    @property
    def update(self) -> UpdateRule:
        """The local and the global update; the colony's own copy of what was set."""
        return self._update

    @update.setter
    def update(self, value: str | UpdateRule) -> None:
        self._update = as_update(value)

    @property
    def selection(self) -> str:
        """The selection rule; fixed once the colony is made."""
        return self._selection

    @property
    def _table(self) -> FloatArray:
        return self.pheromone.levels

    def set_table(self, table: ArrayLike) -> None:
        """Replace the pheromone levels.

        Raises:
            ValueError: the shape differs, or a level is not positive and finite.
        """
        levels = self._checked_table(table)
        if not (levels > 0.0).all():
            raise ValueError(
                f"table must hold positive levels only, got {levels.min():g}."
            )
        self.pheromone.set_levels(levels)

    def set_env(self, env: VectorEnv[Any, Any, Any]) -> None:
        """See `TabularAgent.set_env`; warns if tau0 is too high for `env`."""
        super().set_env(env)
        self._warn_if_tau0_is_high()

    def _warn_if_tau0_is_high(self) -> None:
        """Hold tau0 against Proposition 4.3 where the environment tells J_max.

        The proposition asks for tau0 <= rho / J_max, but its proof needs no more than
        tau0 <= 1 / J_max: the level after a deposit is at least
        (1 - rho I) tau0 + rho I / J_max. Table 5.2 keeps the latter, not the former,
        so the latter is what is checked.
        """
        base = None if self.env is None else self.env.unwrapped
        if not isinstance(base, ControlVectorEnv) or self.global_decay == 0.0:
            return
        if not isinstance(self.deposit, InverseCost) or self.cost is not None:
            return  # J_max is known for the environment's own cost only
        highest_cost = self.max_steps * base.system.max_stage_cost
        highest_cost += self.deposit.offset
        bound = 1.0 / highest_cost
        if self.tau0 > bound:
            digit = 10.0 ** math.floor(math.log10(bound))
            warnings.warn(
                f"tau0 = {self.tau0:g} exceeds 1 / J_max = {bound:.3g} (J_max <= "
                f"{highest_cost:.4g} on this environment), so pheromone levels may "
                "fall below tau0 (Proposition 4.3); a tau0 of at most "
                f"{math.floor(bound / digit) * digit:.0e} rules that out.",
                PheromoneBoundWarning,
                stacklevel=3,
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
        return SoftPolicy(
            self.partition, self._table, exponent, seed, self.first_action
        )

    def parameters(self) -> dict[str, Any]:
        """The keyword arguments of the constructor."""
        return {
            "tau0": self.tau0,
            "local_decay": self.local_decay,
            "global_decay": self.global_decay,
            "alpha": to_settings(self.alpha),
            "epsilon": to_settings(self.epsilon),
            "selection": self.selection,
            "cost": to_settings(self.cost),
            "deposit": to_settings(self.deposit),
            "update": update_to_settings(self.update),
            "tabu": self.tabu,
            "max_steps": self.max_steps,
            "seed": self.seed,
        }

    @classmethod
    def _restored_parameters(cls, saved: dict[str, Any]) -> dict[str, Any]:
        restored = {
            **saved,
            "alpha": schedule_from_settings("alpha", saved["alpha"]),
            "epsilon": schedule_from_settings("epsilon", saved["epsilon"]),
            "cost": cost_from_settings(saved["cost"]),
            "deposit": deposit_from_settings(saved["deposit"]),
        }
        if "update" in saved:  # older files have none and mean the default
            restored["update"] = update_from_settings(saved["update"])
        return restored

    def measures(self, policy: IntArray) -> Row:
        """The sensitivity of the policy (3.48), averaged over the cells, in [0, 1]."""
        return {
            "sensitivity": float(
                _mean_sensitivity(self._table, policy, self.pheromone.alpha)
            )
        }

    def _now(self, name: str) -> float:
        """The value that a number or schedule has in the trial to come."""
        setting: Scheduled = getattr(type(self), name)
        return setting.at(self, self.trials)

    def _needs_episodes(self) -> bool:
        """Whether the cost or the update rule looks at every step of a solution."""
        return self.cost is not None or self.update.needs_episodes

    def _result(self, rollout: Rollout, solutions: Solutions) -> TrialResult:
        """The solutions of a trial, what they cost, and what is deposited for them."""
        episodes = rollout.episodes() if self._needs_episodes() else None
        costs = rollout.cost
        if self.cost is not None and episodes is not None:
            costs = solution_costs(self.cost, episodes)
        deposits = self._deposit(costs, self.tau0)
        return TrialResult(solutions, costs, deposits, rollout.success, episodes)

    def _allowed(
        self, rollout: Rollout, solutions: Solutions, index: CellArray
    ) -> BoolArray | None:
        """U_q of each walking ant, less what is tabu; None: all actions."""
        allowed = rollout.allowed()
        if not self.tabu:
            return allowed
        if allowed is None:
            allowed = np.ones((rollout.ants.size, self.n_actions), dtype=np.bool_)
        return solutions.untried(rollout.ants, index, allowed)

    def _explore(
        self, index: CellArray, degree: FloatArray, allowed: BoolArray | None
    ) -> IntArray:
        self.pheromone.alpha, epsilon = self._now("alpha"), self._now("epsilon")
        # Never by the update rule, which may change the pheromone.
        return choose_actions(
            self.selection,
            self.pheromone,
            index,
            degree,
            epsilon,
            self._predict_rng,
            allowed,
        )

    def _empty_solutions(self) -> Solutions:
        """Memory for a trial, the same for one after the other."""
        kept, shape = self._solutions, (self.num_envs, self.max_steps)
        if kept is None or (kept.n_ants, kept.max_steps) != shape:
            kept = Solutions(*shape, self.n_actions, self.partition)
            self._solutions = kept
        kept.clear()
        return kept


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
