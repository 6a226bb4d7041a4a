"""Ant Colony Learning: Algorithms 4.1 and 4.2 in one loop."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Self

import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray

from acl_gym.agents.bounds import PheromoneBoundWarning, warn_if_tau0_is_high
from acl_gym.agents.colony import ColonyAgent
from acl_gym.agents.pheromone_agent import PheromoneAgent
from acl_gym.agents.saving import with_prefix
from acl_gym.agents.training import Training
from acl_gym.callbacks.base import Callbacks
from acl_gym.colony.batches import Batches
from acl_gym.colony.cost import Cost
from acl_gym.colony.costs import as_cost, cost_from_settings, solution_costs
from acl_gym.colony.deposits import (
    Deposit,
    as_deposit,
    checked_deposits,
    deposit_from_settings,
)
from acl_gym.colony.episodes import Episode
from acl_gym.colony.heuristic import Heuristic, as_heuristic, as_initial
from acl_gym.colony.pheromone import Pheromone, mean_sensitivity
from acl_gym.colony.schedules import Setting, schedule_from_settings
from acl_gym.colony.selection import RULES, choose_actions
from acl_gym.colony.solutions import Solutions
from acl_gym.colony.update_rule import MissingRule, TrialResult, UpdateRule
from acl_gym.colony.update_rules import (
    as_update,
    update_from_settings,
    watched,
)
from acl_gym.evaluation.rollout import Rollout
from acl_gym.partitions import Partition
from acl_gym.policies import SoftPolicy
from acl_gym.utils import validation
from acl_gym.utils.parameters import Parameter, fixed
from acl_gym.utils.serialization import to_settings
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray, IntArray, Row

__all__ = ["ACL", "PheromoneBoundWarning"]


class ACL(PheromoneAgent, ColonyAgent):
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
            larger, a `PheromoneBoundWarning` is given (a decision).
        local_decay: gamma, in [0, 1), the decay of each visited pair (4.12).
        global_decay: rho, in [0, 1], weight of the deposits of a trial (4.15). The
            thesis requires rho > 0, but its experiments include 0, where nothing is
            learned.
        alpha: exponent of the levels in the selection rule (4.11), > 0; a number, or
            a schedule such as `Linear(1, 3, trials=50)` that gives one for each trial.
        heuristic: eta, what is known of each action beforehand, weighed as
            tau^alpha eta^beta in selection: an array `(n_cells, n_actions)`, finite,
            >= 0 and positive somewhere in each row, or a function of the environment
            and the partition that returns one. None: 1 everywhere. The greedy policy
            (4.16), its sensitivity and `soft_policy` go by the pheromone alone.
        beta: exponent of the heuristic, >= 0; a number or a schedule.
        initial: the levels to begin with, in place of tau0 everywhere: an array
            `(n_cells, n_actions)`, finite and >= tau0, or a function of the environment
            and the partition that returns one. Like all levels they decay towards tau0
            where ants pass and are covered by deposits, so that what was wrong is
            forgotten; a deposit is of the size of 1 / J.
        epsilon: exploration probability, in [0, 1]; a number or a schedule, see
            `selection`.
        selection: `"max_boltzmann"`, eq. (3.6); `"boltzmann"`, eq. (3.4), which has no
            epsilon; or `"epsilon_greedy"`, eq. (3.5).
        cost: J of a solution. None takes the sum of the environment's stage costs,
            -(rewards), eq. (3.2). A `Cost` such as `Steps()`, or a function of one
            `Episode`, looks at the solution as a whole.
        deposit: what an ant deposits for a solution of cost J: `"inverse_cost"`, 1 / J
            (3.8); `"return"`, for environments whose returns are never negative;
            `"rank"`, for any; a `Deposit`, or a function of the costs of a trial.
        update: the local and the global update of the pheromone. `"each_visit"`: all
            ants choose, then each visited pair decays, eq. (4.12), and after the trial
            the ants deposit, eq. (4.15). `"in_turn"`: each ant chooses and decays
            before the next one chooses. `"once_per_ant"`: a pair decays after the
            trial, once for each ant that visited it, eq. (3.13). `"once_per_trial"`:
            once, however many ants visited it. Or an `UpdateRule`, of which the colony
            takes a copy.
        schedule: `"synchronous"`: all ants of a trial wait for the last one, then deposit,
            as in Algorithm 4.2. `"asynchronous"` (§7.3): an ant deposits as soon as it is
            back, and sets out again as long as an ant is on its first way of the trial;
            those on their way then walk to their end, and the trial is over. A trial is
            then M episodes or more. Ants that come back in the same step deposit
            together. Evaporation per M ants is that of a synchronous trial, see
            `acl_gym.colony.update_rules.Reinforcement`; a `deposit` sees the costs of the
            last M ants that came back. Not every environment can do it, see
            `acl_gym.evaluation.stream.Stream`.
        tabu: forbid an ant to choose an action twice in the same cell in one trial
            (§3.4.2). For partitions with one cell per state.
        max_steps: T, the most steps an ant may make, >= 1. None takes the time limit of
            the environment, or 300 if it has none.
        seed: the same seed gives the same run; None draws one from the system.
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

    _completes = True  # only complete solutions have a cost

    tau0 = Parameter("Initial pheromone level", "tau_0", fixed=True, above=0)
    local_decay = Parameter(
        "Decay of each visited pair (4.12)", "gamma", at_least=0, below=1
    )
    global_decay = Parameter(
        "Weight of the deposits of a trial (4.15)", "rho", at_least=0, at_most=1
    )
    alpha = Parameter(
        "Exponent of the levels in selection (4.11)", "alpha", scheduled=True, above=0
    )
    beta = Parameter(
        "Exponent of the heuristic in selection", "beta", scheduled=True, at_least=0
    )
    epsilon = Parameter(
        "Exploration probability", "epsilon", scheduled=True, at_least=0, at_most=1
    )

    def __init__(
        self,
        env: VectorEnv[Any, Any, Any] | None,
        partition: Partition | None = None,
        *,
        tau0: float = 1e-4,
        local_decay: float = 0.01,
        global_decay: float = 0.1,
        alpha: Setting = 3.0,
        heuristic: Heuristic | None = None,
        beta: Setting = 1.0,
        initial: Heuristic | None = None,
        epsilon: Setting = 0.1,
        selection: str = "max_boltzmann",
        cost: Cost | Callable[[Episode], float] | None = None,
        deposit: str | Deposit | Callable[[FloatArray], FloatArray] = "inverse_cost",
        update: str | UpdateRule = "each_visit",
        schedule: str = "synchronous",
        tabu: bool = False,
        max_steps: int | None = None,
        seed: int | None = None,
        n_actions: int | None = None,
    ) -> None:
        self.tau0 = tau0
        self.alpha, self.beta = alpha, beta
        self.local_decay = local_decay
        self.global_decay = global_decay
        self.epsilon = epsilon
        self._selection = validation.one_of("selection", selection, RULES)
        self.cost = cost
        self.deposit = deposit
        self._update = as_update(update)
        super().__init__(
            env,
            partition,
            schedule=schedule,
            max_steps=max_steps,
            seed=seed,
            n_actions=n_actions,
        )
        tabu = validation.boolean("tabu", tabu)
        if tabu and self.partition.cells_per_state > 1:
            raise ValueError(
                "tabu needs a partition with one cell per state, such as Crisp or "
                f"Discrete, got {validation.shown(self.partition)}; leave tabu out."
            )
        self.tabu = tabu
        shape = self.partition.n_cells, self.n_actions
        self.pheromone = Pheromone(
            *shape,
            self.tau0,
            self._at_first("alpha"),
            as_heuristic(heuristic, env, self.partition, shape),
            self._at_first("beta"),
        )
        levels = as_initial(initial, env, self.partition, shape, self.tau0)
        if levels is not None:
            self.pheromone.set_levels(levels)
        self._rule = self._update  # of the trial under way; see `watched`
        self._check_tau0()

    def learn(
        self,
        total_timesteps: int | None = None,
        trials: int | None = None,
        callback: Callbacks = None,
        log_interval: int | None = None,
        progress_bar: bool = False,
    ) -> Self:
        """Let the colony make trials; the step numbers are those of Algorithm 4.2.

        Called again, it continues from the pheromone as it is.

        Args:
            total_timesteps: stop after the trial that reaches this many steps of all
                ants together; None sets no such limit.
            trials: K, how many trials to make; None sets no such limit. Without
                either limit, 100.
            callback: a `Callback`, a function of `(agent, row)`, or a list of those.
                In place of Stable-Baselines3's `EvalCallback` take
                `PolicyEvaluation(env)`, which evaluates between trials and keeps the
                best policy (`save_best="best"` writes it to a file); of
                `StopTrainingOnRewardThreshold`, `EarlyStop` after it; of
                `CheckpointCallback`, `Checkpoint("checkpoints")`; of
                `tensorboard_log="log"`, `TensorBoardLog("log")`, or `CSVLog("log.csv")`
                for a table.
            log_interval: print a line every `log_interval` trials; None prints nothing.
            progress_bar: show a bar (of tqdm).

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
                rule = self._rule = watched(self.update, self.n_actions)
                record = self._needs_episodes()
                self._set_exponents()
                epsilon = self._now("epsilon")
                observation = rollout.start(seed=self._next_seed(), record=record)
                rule.start_trial(pheromone, self.trials)
                costs: list[FloatArray] = []
                self._batches.start_trial()
                while rollout._ants.size:  # 7, 17: repeat until t = T or C is empty
                    ants = rollout._ants
                    # 8: fuzzify the states
                    index, degree = self._locate(observation, ants)
                    # 9: select actions, by default all on the same pheromone
                    allowed = self._allowed(solutions, index)
                    actions = self._choose(index, degree, epsilon, allowed)
                    # 10: add the pairs to the partial solutions
                    solutions.append(ants, observation, index, actions)
                    # 11, 13-16: apply the actions; who is at the goal leaves C
                    observation = rollout.move(actions)
                    # 12: local pheromone update, by default (4.12)
                    rule.local_update(
                        pheromone, index, degree, actions, self.local_decay
                    )
                    # 18-20: global pheromone update, in general (4.15): with all
                    # solutions once the last ant is back, or with each at once
                    ants_back = rollout.returned
                    if ants_back is not None:
                        result = self._result(rollout, ants_back, solutions)
                        rule.global_update(
                            pheromone, result, self.local_decay, self.global_decay
                        )
                        costs.append(result.costs)
                        solutions.clear(ants_back)
                        observation = rollout.set_out(observation)
                pheromone.check_levels()
                training.end_trial(np.concatenate(costs))  # 21: k <- k + 1
        return self

    @property
    def cost(self) -> Cost | None:
        """The cost of a solution; None: the sum of its stage costs."""
        return self._cost

    @cost.setter
    def cost(self, value: Cost | Callable[[Episode], float] | None) -> None:
        self._cost = as_cost(value)
        self._batches = Batches()  # those of another cost are not to be compared with

    @property
    def deposit(self) -> Deposit:
        """What an ant deposits for a solution of a given cost."""
        return self._deposit

    @deposit.setter
    def deposit(
        self, value: str | Deposit | Callable[[FloatArray], FloatArray]
    ) -> None:
        self._deposit = as_deposit(value)

    @property
    def update(self) -> UpdateRule:
        """The local and the global update; the colony's own copy of what was set.

        Of a user's own rule a file holds the name and what it remembered. Give it again
        with `load(path, env, update=...)` or set it after `load`: a rule of the same
        class takes over what the saved one remembered.
        """
        return self._update

    @update.setter
    def update(self, value: str | UpdateRule) -> None:
        rule = as_update(value)
        if isinstance(self._update, MissingRule):
            self._update.hand_over(rule)
        self._update = rule

    @property
    def selection(self) -> str:
        """The selection rule; fixed once the colony is made."""
        return self._selection

    @selection.setter
    def selection(self, value: str) -> None:
        raise fixed("selection", value)

    def set_env(self, env: VectorEnv[Any, Any, Any]) -> None:
        """See `TabularAgent.set_env`; warns if tau0 is too high for `env`."""
        super().set_env(env)
        self._check_tau0()

    def _check_tau0(self) -> None:
        # J_max is known for the environment's own cost only, and without deposits
        # no level falls.
        if self.cost is None and self.global_decay > 0.0:
            warn_if_tau0_is_high(
                self.tau0, self.env, self.max_steps, self.deposit, stacklevel=4
            )

    def soft_policy(
        self, exponent: float = 10.0, seed: int | None = None
    ) -> SoftPolicy:
        """A policy that draws its actions, for where the greedy policy hovers.

        Args:
            exponent: replaces alpha in eq. (4.11), > 0.
            seed: of the draws, >= 0; None draws one from the system.

        Returns:
            A policy over a copy of the pheromone as it is now.
        """
        return SoftPolicy(
            self.partition, self._table, exponent, seed, self.first_action
        )

    def parameters(self) -> dict[str, Any]:
        """The keyword arguments of the constructor, except `heuristic`, an array."""
        return {
            "tau0": self.tau0,
            "local_decay": self.local_decay,
            "global_decay": self.global_decay,
            "alpha": to_settings(self.alpha),
            "beta": to_settings(self.beta),
            "epsilon": to_settings(self.epsilon),
            "selection": self.selection,
            "cost": to_settings(self.cost),
            "deposit": to_settings(self.deposit),
            "update": to_settings(self.update),
            "schedule": self.schedule,
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
        }
        later: dict[str, Callable[[Any], Any]] = {
            "beta": partial(schedule_from_settings, "beta"),
            "cost": cost_from_settings,
            "deposit": deposit_from_settings,
            "update": update_from_settings,
        }
        # Files of version 0.1 lack some of these and mean the defaults.
        for name in later.keys() & saved.keys():
            restored[name] = later[name](saved[name])
        return restored

    def _arrays(self) -> dict[str, NDArray[Any]]:
        arrays = {f"update_{name}": a for name, a in self.update.memory().items()}
        if self.heuristic is not None:
            arrays["heuristic"] = self.heuristic
        if self.is_asynchronous:
            arrays["latest_costs"] = self._batches.costs
        return arrays

    def _restore(
        self, header: dict[str, Any], arrays: Mapping[str, NDArray[Any]]
    ) -> None:
        super()._restore(header, arrays)
        if self.is_asynchronous and "latest_costs" in arrays:
            self._batches.costs = validation.real_array(
                "latest_costs", arrays["latest_costs"], ndim=1
            )
        memory = with_prefix("update_", arrays)
        if memory:
            saved = update_from_settings(header["parameters"]["update"])
            if type(saved) is type(self.update):
                self.update.restore(memory)
            elif isinstance(saved, MissingRule):  # the rule was given again
                saved.restore(memory)
                saved.hand_over(self.update)
        self.pheromone.heuristic = as_heuristic(
            arrays.get("heuristic"), None, self.partition, self._table.shape
        )

    def _set_arrays(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        memory = with_prefix("update_", arrays)
        if memory:
            self.update.restore(memory)
        if self.is_asynchronous:
            self._batches.costs = arrays["latest_costs"]

    def measures(self, policy: IntArray) -> Row:
        """The mean sensitivity of the policy (3.48) over the cells, in [0, 1]."""
        alpha = self.pheromone.alpha
        return {"sensitivity": mean_sensitivity(self._table, policy, alpha)}

    def _needs_episodes(self) -> bool:
        """Whether the cost or the update rule looks at every step of a solution."""
        return self.cost is not None or self.update.needs_episodes

    def _result(
        self, rollout: Rollout, ants: IntArray, solutions: Solutions
    ) -> TrialResult:
        """The solutions of the ants that are back, what they cost, and what they deposit.

        Args:
            rollout: where they walked.
            ants: who is back, `(m,)`.
            solutions: of all ants.
        """
        episodes = rollout.returned_episodes() if self._needs_episodes() else None
        costs = rollout.cost[ants]
        if self.cost is not None and episodes is not None:
            costs = solution_costs(self.cost, episodes)
        compared, begins = costs, None
        if self.is_asynchronous:
            begins = self._batches.add(costs, self.num_envs)
            compared = self._batches.costs
        deposits = checked_deposits(self._deposit(compared, self.tau0), compared.size)
        return TrialResult(
            solutions.of(ants),
            costs,
            deposits[-ants.size :],
            rollout.terminated[ants],
            episodes,
            begins,
        )

    def _choose(
        self,
        index: CellArray,
        degree: FloatArray,
        epsilon: float,
        allowed: BoolArray | None,
    ) -> IntArray:
        """Choose the actions of the walking ants, as the update rule says."""
        return self._rule.choose(
            self.selection,
            self.pheromone,
            index,
            degree,
            epsilon,
            self.rng,
            allowed,
            self.local_decay,
        )

    def _explore(
        self, index: CellArray, degree: FloatArray, allowed: BoolArray | None
    ) -> IntArray:
        self._set_exponents()
        # Never by the update rule, which may change the pheromone.
        return choose_actions(
            self.selection,
            self.pheromone,
            index,
            degree,
            self._now("epsilon"),
            self._predict_rng,
            allowed,
        )
