"""Ant System, Ant Colony System and Max-Min Ant System, chapter 2 of the thesis."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from gymnasium.vector import VectorEnv

from acl_gym.agents.ant_optimizer import AntOptimizer, NoSolutionWarning
from acl_gym.agents.of_rule import OfRule
from acl_gym.colony.ant_rules import (
    AntColonySystemUpdate,
    AntSystemUpdate,
    MaxMinUpdate,
)
from acl_gym.colony.deposits import Deposit
from acl_gym.colony.heuristic import Heuristic
from acl_gym.colony.schedules import Setting
from acl_gym.partitions import Partition
from acl_gym.utils.parameters import Parameter
from acl_gym.utils.typing import FloatArray

__all__ = ["AntColonySystem", "AntSystem", "MaxMinAntSystem", "NoSolutionWarning"]


def _evaporation() -> Parameter:
    return Parameter("Evaporation rate (2.3)", "rho", above=0, at_most=1)


def _exponent_of_levels() -> Parameter:
    return Parameter("Exponent of the levels (2.2)", "alpha", scheduled=True, above=0)


def _exponent_of_heuristic() -> Parameter:
    return Parameter(
        "Exponent of the heuristic variables (2.2)", "beta", scheduled=True, at_least=0
    )


class AntSystem(AntOptimizer):
    """Ant System (Dorigo, Maniezzo and Colorni, 1996; §2.5.1): all ants deposit.

    Each slot of the environment is an ant. In each trial every ant constructs a
    candidate solution, choosing among what is allowed by (2.2), in proportion to
    tau^alpha eta^beta. Then all levels evaporate, and every solution of the update set
    adds its fitness F = 1 / J to each of its components, (2.3)-(2.4). Elitist and
    rank-based Ant System are options.

    On the travelling salesman problem, `acl_gym/TravellingSalesman-v0`, whole tours are
    built in one call, without stepping the environment; with the same random numbers the
    tours are those of ants that walk. On any other vector environment with `Discrete`
    actions and states that are cells the ants walk. There a solution is what an ant has
    done when it reaches a terminal state; ants that are stopped before deposit nothing.

    Args:
        env: a vector environment; its slots are the m ants. The literature takes as many
            as there are cities, see `usual_ants`.
        partition: turns observations into cells, one for each state; None takes
            `automatic_partition(env)`, which makes each element of a finite space a cell.
        update_set: which solutions deposit: `"trial"`, all of the trial, `"trial-best"`
            or `"best-so-far"`.
        elitists: e, >= 0: the best solution so far deposits e times its fitness in
            addition (elitist Ant System); as many as there are ants is usual.
        ranks: w, >= 0, in place of both: only the w - 1 best solutions of the trial
            deposit, the best of them w - 1 times its fitness, the next w - 2 times, and
            so on, and the best solution so far w times (rank-based Ant System). 6 with
            `global_decay=0.1` is usual; 0: no ranks.
        global_decay: rho, in (0, 1], the evaporation rate. Levels do not evaporate below
            1e-200.
        alpha: exponent of the levels, > 0; a number or a schedule.
        beta: exponent of the heuristic variables, >= 0; a number or a schedule.
        heuristic: eta: `"distance"`, 1 / d of the travelling salesman problem; an array
            `(n_cells, n_actions)`, finite, >= 0 and positive somewhere in each row; or a
            function of the environment and the partition that returns one. None:
            "distance" on the travelling salesman problem, else 1 everywhere.
        candidates: how many actions of each cell ants look at first, >= 1, those of the
            largest eta: the nearest neighbours. An ant that has used up all of them takes
            the best of the other actions. Where actions are not used up, because there
            are neither masks nor `tabu`, ants never take others. None: all actions, as
            is the case without a heuristic. "usual": 20 on the travelling salesman
            problem, else None.
        tau0: the initial level, > 0. None takes that of the literature, m / L_nn, or
            (e + m) / (rho L_nn) with elitists and w (w - 1) / (2 rho L_nn) with ranks,
            L_nn being the length of the nearest-neighbour tour. On other environments
            the best cost of the first trial stands in for it.
        local_search: improves each tour before it is evaluated: `"2-opt"`, `"or-opt"`
            or `"3-opt"`; None: none. On the travelling salesman problem only.
        deposit: F, see `ACL`; `"inverse_cost"` is that of the thesis.
        symmetric: a component and its reverse share their level, for which there must be
            an action for each cell, which leads there. None: if the environment is a
            symmetric travelling salesman problem.
        tabu: forbid an ant to choose an action twice in the same cell in one trial, where
            the environment has no masks.
        walk: let ants walk step by step on the travelling salesman problem too, so that
            the environment, or what is wrapped around it, sees every step.
        max_steps: T, the most steps of an ant, >= 1. None takes the time limit of the
            environment, or 300 if it has none.
        seed: the same seed gives the same run; None draws one from the system.
        n_actions: only needed without an environment.

    Attributes:
        best_tour: the cells of the best solution so far in the order of the steps, the
            cities of the shortest tour; None before the first.
        best_solution: its components, pairs of cell and action; None before.
        best_cost: its cost, the length of the tour; infinite before.

    Raises:
        TypeError: `env` or `partition` is of the wrong kind.
        ValueError: a parameter is out of range.

    Example:
        >>> import gymnasium as gym
        >>> from acl_gym import AntSystem
        >>> env = gym.make_vec("acl_gym/TravellingSalesman-v0", num_envs=48)
        >>> colony = AntSystem(env, seed=0).learn(trials=20)
        >>> colony.best_tour.size, colony.best_cost < 12_000
        (48, True)
    """

    update_set = OfRule("Which solutions deposit")
    elitists = OfRule("How many times the best solution so far deposits in addition")
    ranks = OfRule(
        "One more than how many solutions of a trial deposit, by their ranks"
    )
    global_decay = _evaporation()
    alpha = _exponent_of_levels()
    beta = _exponent_of_heuristic()

    def __init__(
        self,
        env: VectorEnv[Any, Any, Any] | None,
        partition: Partition | None = None,
        *,
        update_set: str = "trial",
        elitists: float = 0.0,
        ranks: int = 0,
        global_decay: float = 0.5,
        alpha: Setting = 1.0,
        beta: Setting = 2.0,
        heuristic: Heuristic | str | None = None,
        candidates: int | str | None = "usual",
        tau0: float | None = None,
        local_search: str | None = None,
        deposit: str | Deposit | Callable[[FloatArray], FloatArray] = "inverse_cost",
        symmetric: bool | None = None,
        tabu: bool = False,
        walk: bool = False,
        max_steps: int | None = None,
        seed: int | None = None,
        n_actions: int | None = None,
    ) -> None:
        super().__init__(
            env,
            partition,
            rule=AntSystemUpdate(update_set, elitists, ranks),
            tau0=tau0,
            global_decay=global_decay,
            alpha=alpha,
            beta=beta,
            heuristic=heuristic,
            candidates=candidates,
            local_search=local_search,
            deposit=deposit,
            symmetric=symmetric,
            tabu=tabu,
            walk=walk,
            max_steps=max_steps,
            seed=seed,
            n_actions=n_actions,
        )


class AntColonySystem(AntOptimizer):
    """Ant Colony System (Dorigo and Gambardella, 1997; §2.5.2): ants avoid each other.

    It differs from `AntSystem` in three ways. With probability q0 an ant takes the action
    of the largest tau^alpha eta^beta, and only else draws one by (2.2). After each step
    the component that an ant has just added decays towards tau0, (2.6), before the next
    ant chooses, so that ants of a trial go different ways. After the trial the components
    of the best solution so far, and only these, come closer to its fitness, (2.5).

    Args:
        env: see `AntSystem`. 10 ants are usual.
        partition: see `AntSystem`.
        q0: the probability to EXPLOIT, in [0, 1]. §2.5.2 of the thesis calls it epsilon:
            the opposite of epsilon everywhere else in the thesis and in this package,
            the probability to explore.
        update_set: `"best-so-far"`, as (2.5) has it, or `"trial-best"`.
        local_decay: gamma of (2.6), in [0, 1), elsewhere called xi.
        global_decay: rho of (2.5), in (0, 1].
        alpha: exponent of the levels, > 0; a number or a schedule.
        beta: exponent of the heuristic variables, >= 0; a number or a schedule.
        heuristic: see `AntSystem`.
        candidates: see `AntSystem`.
        tau0: see `AntSystem`; None takes 1 / (n L_nn), n being the steps of that
            solution.
        local_search: see `AntSystem`.
        deposit: see `AntSystem`.
        symmetric: see `AntSystem`.
        tabu: see `AntSystem`.
        walk: see `AntSystem`.
        max_steps: see `AntSystem`.
        seed: the same seed gives the same run; None draws one from the system.
        n_actions: only needed without an environment.

    Attributes:
        best_tour: see `AntSystem`.
        best_solution: see `AntSystem`.
        best_cost: see `AntSystem`.

    Raises:
        TypeError: `env` or `partition` is of the wrong kind.
        ValueError: a parameter is out of range.
    """

    _usual_ants = 10

    q0 = OfRule("Probability to exploit, 1 minus that to explore")
    update_set = OfRule("Which solution deposits")
    local_decay = Parameter(
        "Decay of each component on the way (2.6)", "gamma", at_least=0, below=1
    )
    global_decay = Parameter(
        "Weight of the best solution (2.5)", "rho", above=0, at_most=1
    )
    alpha = _exponent_of_levels()
    beta = _exponent_of_heuristic()

    def __init__(
        self,
        env: VectorEnv[Any, Any, Any] | None,
        partition: Partition | None = None,
        *,
        q0: float = 0.9,
        update_set: str = "best-so-far",
        local_decay: float = 0.1,
        global_decay: float = 0.1,
        alpha: Setting = 1.0,
        beta: Setting = 2.0,
        heuristic: Heuristic | str | None = None,
        candidates: int | str | None = "usual",
        tau0: float | None = None,
        local_search: str | None = None,
        deposit: str | Deposit | Callable[[FloatArray], FloatArray] = "inverse_cost",
        symmetric: bool | None = None,
        tabu: bool = False,
        walk: bool = False,
        max_steps: int | None = None,
        seed: int | None = None,
        n_actions: int | None = None,
    ) -> None:
        self.local_decay = local_decay
        super().__init__(
            env,
            partition,
            rule=AntColonySystemUpdate(q0, update_set),
            tau0=tau0,
            global_decay=global_decay,
            alpha=alpha,
            beta=beta,
            heuristic=heuristic,
            candidates=candidates,
            local_search=local_search,
            deposit=deposit,
            symmetric=symmetric,
            tabu=tabu,
            walk=walk,
            max_steps=max_steps,
            seed=seed,
            n_actions=n_actions,
        )

    def parameters(self) -> dict[str, Any]:
        """The keyword arguments of the constructor, except `heuristic`, an array."""
        return {**super().parameters(), "local_decay": self.local_decay}


class MaxMinAntSystem(AntOptimizer):
    """Max-Min Ant System (Stützle and Hoos, 2000): one ant deposits, within limits.

    It differs from `AntSystem` in four ways. Only the best solution of the trial, or one
    of the best so far, deposits. Levels stay within [tau_min, tau_max], tau_max =
    F / rho being the limit of Proposition 2.2 for the best solution so far. They start at
    tau_max, so that ants explore. Where all ants have come to follow one solution,
    levels are moved towards tau_max again.

    Args:
        env: see `AntSystem`. As many ants as cities are usual, with local search 25.
        partition: see `AntSystem`.
        update_set: which solution deposits: `"trial-best"`, `"best-so-far"`,
            `"mostly-trial-best"`, in every 25th trial the best since the last restart, or
            `"mixed"`, that ever more often, see `MaxMinUpdate`. None:
            "mostly-trial-best", with local search "mixed", which is what ACOTSP does.
        p_best: in (0, 1), the probability with which ants that have converged construct
            the best tour; it gives tau_min. None, and where solutions are no tours:
            tau_min = tau_max / (2 n). "usual": 0.05, with local search None.
        smoothing: delta, in [0, 1]: where the lambda-branching factor tells that ants
            have converged, each level moves by this share of its distance to tau_max.
            1 is a restart, 0 does nothing.
        patience: how many trials without a better solution since the last restart there
            must be before the next, >= 0.
        global_decay: rho, in (0, 1], the evaporation rate. None: 0.02, with local search
            0.2.
        alpha: exponent of the levels, > 0; a number or a schedule.
        beta: exponent of the heuristic variables, >= 0; a number or a schedule.
        heuristic: see `AntSystem`.
        candidates: see `AntSystem`.
        tau0: see `AntSystem`; None takes tau_max = 1 / (rho L_nn).
        local_search: see `AntSystem`.
        deposit: see `AntSystem`.
        symmetric: see `AntSystem`.
        tabu: see `AntSystem`.
        walk: see `AntSystem`.
        max_steps: see `AntSystem`.
        seed: the same seed gives the same run; None draws one from the system.
        n_actions: only needed without an environment.

    Attributes:
        best_tour: see `AntSystem`.
        best_solution: see `AntSystem`.
        best_cost: see `AntSystem`.

    Raises:
        TypeError: `env` or `partition` is of the wrong kind.
        ValueError: a parameter is out of range.
    """

    update_set = OfRule("Which solution deposits")
    p_best = OfRule("Probability of the best tour where ants have converged, or None")
    smoothing = OfRule("How far levels move to tau_max where ants have converged")
    patience = OfRule("Trials without a better solution before levels move")
    global_decay = _evaporation()
    alpha = _exponent_of_levels()
    beta = _exponent_of_heuristic()

    def __init__(
        self,
        env: VectorEnv[Any, Any, Any] | None,
        partition: Partition | None = None,
        *,
        update_set: str | None = None,
        p_best: float | str | None = "usual",
        smoothing: float = 1.0,
        patience: int = 250,
        global_decay: float | None = None,
        alpha: Setting = 1.0,
        beta: Setting = 2.0,
        heuristic: Heuristic | str | None = None,
        candidates: int | str | None = "usual",
        tau0: float | None = None,
        local_search: str | None = None,
        deposit: str | Deposit | Callable[[FloatArray], FloatArray] = "inverse_cost",
        symmetric: bool | None = None,
        tabu: bool = False,
        walk: bool = False,
        max_steps: int | None = None,
        seed: int | None = None,
        n_actions: int | None = None,
    ) -> None:
        self._local_search = local_search
        if global_decay is None:
            global_decay = 0.02 if local_search is None else 0.2
        rule = MaxMinUpdate(
            self._chosen_for("update_set", update_set),
            self._chosen_for("p_best", p_best),
            smoothing,
            patience,
        )
        super().__init__(
            env,
            partition,
            rule=rule,
            tau0=tau0,
            global_decay=global_decay,
            alpha=alpha,
            beta=beta,
            heuristic=heuristic,
            candidates=candidates,
            local_search=local_search,
            deposit=deposit,
            symmetric=symmetric,
            tabu=tabu,
            walk=walk,
            max_steps=max_steps,
            seed=seed,
            n_actions=n_actions,
        )

    def _chosen_for(self, name: str, value: Any) -> Any:
        alone = self._local_search is None
        if name == "update_set" and value is None:
            return "mostly-trial-best" if alone else "mixed"
        if name == "p_best" and isinstance(value, str) and value == "usual":
            return 0.05 if alone else None
        return value
