"""Ant Colony Learning as a swarm of moving agents, §6.3.1.

The same colony as `ACL`, cut along the framework of chapter 6: what an ant knows and
decides is one part, what is outside of it another, and between them are observations,
inputs and messages only. `acl_gym.swarm.run` then learns the same pheromone, to the bit.

| §6.3.1 | here |
| --- | --- |
| moving agent M_c | row c of `Ants` and of `StigmergyEnvironment` |
| particle P_c, its state x_c | row c of `StigmergyEnvironment.x` |
| process, its transition x_c <- f(x_c, u_c) | the vector environment, in `StigmergyEnvironment.step` |
| process state psi: the pheromone levels | `StigmergyEnvironment.pheromone` |
| observation y_c = [x_c, tau_u(x_c), ...] | row c of `Observations` |
| U(x_c) | `Observations.allowed` |
| binary signal that the goal is reached | `Observations.walking`, the ants without it |
| dynamic agent A_c, decision rule pi_c | `Ants`, `Ants.decide`: §3.3.1 over cells of the partition |
| internal state z_c with the partial solution s_p,c | `Ants.solutions`, and a clock |
| message v_c: this ant is done | `Ants.send`: how many trials it has finished |
| message w_c: all ants are done | `Ants.hear` |
| input u_c | row c of `Inputs` |
| local pheromone update (4.12) by the process | `StigmergyEnvironment.step`, after a move |
| cost of the final solution, from the process | `StigmergyEnvironment.costs` |
| global pheromone update (4.15) by the process | `StigmergyEnvironment.step`, once all ants ask for it |

One thing passes between the two by another way. The probabilities that follow from levels,
alpha and beta are kept with the levels, computed once for all ants, so that `Ants.decide`
sets the exponents alpha and beta of the pheromone that it has observed. It changes no
level, and the process reads neither exponent.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from acl_gym.agents.acl import ACL
from acl_gym.colony.costs import solution_costs
from acl_gym.colony.deposits import checked_deposits
from acl_gym.colony.pheromone import Pheromone
from acl_gym.colony.selection import choose_actions
from acl_gym.colony.solutions import Solutions
from acl_gym.colony.update_rule import TrialResult, UpdateRule
from acl_gym.colony.update_rules import as_update, watched
from acl_gym.evaluation.rollout import Rollout
from acl_gym.partitions import Partition, locate_checked
from acl_gym.swarm import DynamicAgents, Environment, Inbox
from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray, IntArray

__all__ = ["Ants", "Inputs", "Observations", "StigmergyEnvironment"]


class Observations(NamedTuple):
    """What the ants observe, y_c of all of them.

    Attributes:
        state: x_c, as the vector environment shows it, `(n, ...)`.
        walking: the m ants whose walk is not over, `(m,)`; the others have reached the
            goal, or the environment has ended their walk.
        allowed: U(x_c) of those, `(m, n_actions)`; None: all actions.
        pheromone: tau_u(x_c) for all u. Ants share the table, and each of them reads the
            levels of the cells that it is in, so that nothing is copied. Ants change
            nothing of it but the exponents alpha and beta, which are theirs.
        trial: k, how many trials have ended.
        partition: to whose cells the levels belong.
    """

    state: NDArray[Any]
    walking: IntArray
    allowed: BoolArray | None
    pheromone: Pheromone
    trial: int
    partition: Partition


class Inputs(NamedTuple):
    """What the ants do, u_c of all of them.

    Attributes:
        ants: those that act, `(m,)`.
        actions: what they do, `(m,)`.
        cells: those for which they chose it, `(m, k)`, where the process decays the
            pheromone.
        degrees: of these cells, `(m, k)`.
        asks: which ants ask for the global update, `(n,)`.
        solutions: the trajectories of all ants, along which they then walk back.
    """

    ants: IntArray
    actions: IntArray
    cells: CellArray
    degrees: FloatArray
    asks: BoolArray
    solutions: Solutions


class Ants(DynamicAgents):
    """The dynamic agents A_c of a colony, §6.3.1.

    An ant asks for the global update as soon as it hears from all ants that they are
    done, or when its clock shows T. It counts on hearing all of them: in a channel that
    loses messages or carries them to a few only it waits for its clock. What it sends is
    the number of trials that it has finished, not a flag, so that a message that arrives
    late is not taken for one of the next trial.

    Args:
        colony: whose partition, selection rule, alpha, beta, epsilon, tabu list and T to
            take; it is not changed.

    Attributes:
        solutions: the partial solutions s_p,c, a part of z_c.

    Raises:
        TypeError: `colony` is not an `ACL`.
        ValueError: it has no environment.
    """

    solutions: Solutions

    def __init__(self, colony: ACL) -> None:
        _check_colony(colony)
        self.partition = colony.partition
        self.selection = colony.selection
        self.alpha, self.beta, self.epsilon = colony.alpha, colony.beta, colony.epsilon
        self.tabu = colony.tabu
        self.max_steps = colony.max_steps
        self.n_actions = colony.n_actions

    def reset(self, n: int, rng: np.random.Generator) -> None:
        """Begin with empty solutions; nothing is drawn."""
        self.solutions = Solutions(n, self.max_steps, self.n_actions, self.partition)
        self._trial = -1  # not one of the environment's
        self._all_done = np.zeros(n, np.bool_)

    def observe(self, y: Observations) -> None:
        """Take in what the ants observe; a new trial begins with an empty solution.

        Raises:
            TypeError: it is not what a `StigmergyEnvironment` shows.
            ValueError: the environment has other cells or actions than these ants.
        """
        if self._trial < 0:
            self._check_environment(y)
        if y.trial != self._trial:
            self._trial, self._clock = y.trial, 0
            self.solutions.clear()
        self._seen = y
        self._finished = np.full(self.solutions.n_ants, y.trial + 1)
        self._finished[y.walking] = y.trial

    def _check_environment(self, y: Any) -> None:
        """Kernels take the ants' cells and actions for those of the pheromone."""
        if not isinstance(y, Observations):
            raise TypeError(
                "ants must observe the Observations of a StigmergyEnvironment, got "
                f"{validation.shown(y)}; run them in one."
            )
        own, there = self.partition, y.partition
        if y.pheromone.n_actions != self.n_actions:
            ours, theirs = f"{self.n_actions}", f"{y.pheromone.n_actions} actions"
        elif len(y.pheromone.levels) != own.n_cells or not _same_cells(own, there):
            ours, theirs = f"{own!r}", f"{there!r} with other cells"
        else:
            return
        raise ValueError(
            "ants and environment must have the same cells and actions, got "
            f"{ours} and {theirs}; make both from the same colony."
        )

    def send(self) -> dict[str, NDArray[Any]]:
        """How many trials each ant has finished."""
        return {"finished": self._finished}

    def hear(self, inbox: Inbox) -> None:
        """Note which ants know of all ants that they are done.

        Of itself an ant knows it where the channel does not deliver its own message.
        """
        done = inbox.message("finished") > self._trial
        own = (self._finished > self._trial) & ~inbox.links.hears_itself
        self._all_done = inbox.sum(done) + own == self.solutions.n_ants

    def decide(self, rng: np.random.Generator) -> Inputs:
        """Choose actions by the selection rule, or ask for the global update.

        The chosen pairs become part of the solutions. Two numbers are drawn for each ant
        that chooses.
        """
        y = self._seen
        in_time = self._clock < self.max_steps
        self._clock += 1
        ants = y.walking if in_time else y.walking[:0]
        index = np.empty((ants.size, self.partition.cells_per_state), np.int32)
        degree = np.empty(index.shape)
        actions = np.empty(0, np.int64)
        if ants.size:
            levels = y.pheromone.levels
            locate_checked(self.partition, y.state, ants, index, degree, len(levels))
            # The table keeps the probabilities that follow from levels and exponents.
            y.pheromone.alpha = ACL.alpha.at(self, self._trial)
            y.pheromone.beta = ACL.beta.at(self, self._trial)
            allowed = y.allowed
            if self.tabu:
                allowed = self.solutions.untried(ants, index, allowed)
            epsilon = ACL.epsilon.at(self, self._trial)
            actions = choose_actions(
                self.selection, y.pheromone, index, degree, epsilon, rng, allowed
            )
            self.solutions.append(ants, y.state, index, actions)
        asks = self._all_done | (not in_time)
        return Inputs(ants, actions, index, degree, asks, self.solutions)


class StigmergyEnvironment(Environment):
    """The environment of a colony: particles, and a process that bears pheromone.

    A run is a number of trials. In a trial the particles begin where the vector
    environment puts them; once all ants ask for it, the process reinforces the pheromone
    along their solutions, and the next trial begins. A trial takes a step for each move
    of the ant that walks longest, and one for the global update.

    Args:
        colony: whose vector environment, initial pheromone, gamma, rho, cost, deposit
            and update rule to take. It is not changed; where it has learned already, its
            pheromone and its count of trials are what this begins with.
        trials: K, how many trials to make, >= 1.

    Attributes:
        x: x_c of all ants, `(n, d)`, as far as they are observed.
        pheromone: psi, the levels.
        costs: J of each ant, an array `(n,)` for each trial that has ended.

    Raises:
        TypeError: `colony` is not an `ACL`, or `trials` not an integer.
        ValueError: it has no environment, `trials` is < 1, or the colony is none of the
            framework: in which ants deposit one by one (`schedule="asynchronous"`), or
            choose one after the other on what the last one has changed
            (`update="in_turn"`).

    Example:
        >>> import gymnasium as gym
        >>> from acl_gym import ACL
        >>> from acl_gym.swarm import run
        >>> env = gym.make_vec("acl_gym/GridSearch2D-v0", num_envs=20)
        >>> colony = ACL(env, seed=0)
        >>> ants, environment = Ants(colony), StigmergyEnvironment(colony, trials=3)
        >>> history = run(ants, environment, 10_000, colony.rng)
        >>> history.done, len(environment.costs)
        (True, 3)
        >>> colony.set_table(environment.pheromone.levels)
    """

    def __init__(self, colony: ACL, trials: int) -> None:
        _check_colony(colony)
        if colony.is_asynchronous:
            raise ValueError(
                "colony must be synchronous: all ants ask for the global update "
                'together, got schedule="asynchronous"; let it learn by itself.'
            )
        if type(colony.update).choose is not UpdateRule.choose:
            raise ValueError(
                "colony must let all ants choose on the same observation, got the "
                f"update rule {validation.shown(colony.update)}; let it learn by itself."
            )
        self.trials = validation.integer("trials", trials, at_least=1)
        self._rollout = Rollout(colony.rollout.env, colony.max_steps)
        self._levels = colony.table.copy()
        self._partition = colony.partition
        self._tau0, self._heuristic = colony.tau0, colony.heuristic
        self._first_trial = colony.trials
        self._update = as_update(colony.update)
        self._local_decay = colony.local_decay
        self._global_decay = colony.global_decay
        self._cost, self._deposit = colony.cost, colony.deposit

    def reset(self, rng: np.random.Generator) -> None:
        """Begin the first trial with the initial pheromone."""
        n_cells, n_actions = self._levels.shape
        # The ants set the exponents, which are a part of their selection rule.
        self.pheromone = Pheromone(
            n_cells, n_actions, self._tau0, alpha=1.0, heuristic=self._heuristic
        )
        self.pheromone.set_levels(self._levels)
        self._rule = watched(as_update(self._update), n_actions)
        self.costs: list[FloatArray] = []
        self._begin_trial(rng)

    @property
    def done(self) -> bool:
        """Whether all trials have been made."""
        return len(self.costs) == self.trials

    def observe(self) -> Observations:
        """Return y_c of all ants."""
        return Observations(
            self._observation,
            self._rollout.ants.copy(),
            self._rollout.allowed(),
            self.pheromone,
            self._trial,
            self._partition,
        )

    def step(self, u: Inputs, rng: np.random.Generator) -> None:
        """Move the particles and decay the pheromone, or end the trial.

        Raises:
            TypeError: `u` are not the inputs of ants.
            ValueError: they are inputs for other ants, cells or actions; or a solution's
                cost is not positive and finite.
        """
        if not isinstance(u, Inputs):
            raise TypeError(
                f"u must be the Inputs of Ants, got {validation.shown(u)}; run Ants in "
                "this environment."
            )
        self._check_inputs(u)
        if u.asks.all():
            self._end_trial(u.solutions)
            if not self.done:
                self._begin_trial(rng)
        elif u.ants.size:
            self._take_in(self._rollout.move(u.actions))
            self._rule.local_update(
                self.pheromone, u.cells, u.degrees, u.actions, self._local_decay
            )

    def _check_inputs(self, u: Inputs) -> None:
        """Kernels look up cells and actions without a look at their number."""
        n, m = len(self.x), self._rollout.ants.size
        n_cells, n_actions = self._levels.shape
        acting = np.size(u.ants)
        fits = (
            acting in (0, m)
            and np.array_equal(u.ants, self._rollout.ants[:acting])
            and _within(u.actions, (acting,), n_actions)
            and _within(u.cells, (acting, *np.shape(u.cells)[1:2]), n_cells)
            and np.shape(u.degrees) == np.shape(u.cells)
            and np.asarray(u.degrees).dtype == np.float64
            and np.shape(u.asks) == (n,)
            and np.asarray(u.asks).dtype == np.bool_
            and isinstance(u.solutions, Solutions)
            and u.solutions.n_ants == n
        )
        if not fits:
            raise ValueError(
                f"u must hold actions from 0 to {n_actions - 1} and cells from 0 to "
                f"{n_cells - 1} with their degrees for all of the {m} ants that walk, or "
                f"for none, and flags and solutions of all {n} ants, got "
                f"{validation.shown(u)}; let Ants decide."
            )

    @property
    def _trial(self) -> int:
        return self._first_trial + len(self.costs)

    @property
    def _needs_episodes(self) -> bool:
        return self._cost is not None or self._update.needs_episodes

    def _begin_trial(self, rng: np.random.Generator) -> None:
        seed = int(rng.integers(2**31))
        self._take_in(self._rollout.start(seed=seed, record=self._needs_episodes))
        self._rule.start_trial(self.pheromone, self._trial)

    def _end_trial(self, solutions: Solutions) -> None:
        rollout = self._rollout
        episodes = rollout.episodes() if self._needs_episodes else None
        costs = rollout.cost
        if self._cost is not None and episodes is not None:
            costs = solution_costs(self._cost, episodes)
        deposits = self._deposit(costs, self.pheromone.tau0)
        result = TrialResult(
            solutions,
            costs,
            checked_deposits(deposits, costs.size),
            rollout.terminated,
            episodes,
        )
        self._rule.global_update(
            self.pheromone, result, self._local_decay, self._global_decay
        )
        self.pheromone.check_levels()
        self.costs.append(costs)

    def _take_in(self, observation: NDArray[Any]) -> None:
        self._observation = observation
        self.x = observation.reshape(len(observation), -1).astype(np.float64)


def _within(numbers: Any, shape: tuple[int, ...], count: int) -> bool:
    """Whether these are integers from 0 to count - 1 in an array of this shape."""
    return (
        isinstance(numbers, np.ndarray)
        and numbers.shape == shape
        and numbers.dtype.kind in "iu"
        and (numbers.size == 0 or bool(0 <= numbers.min() <= numbers.max() < count))
    )


def _same_cells(one: Partition, other: Partition) -> bool:
    return one is other or (
        type(one) is type(other)
        and one.n_cells == other.n_cells
        and np.array_equal(one.cell_states(), other.cell_states())
    )


def _check_colony(colony: Any) -> None:
    if not isinstance(colony, ACL):
        raise TypeError(f"colony must be an ACL, got {validation.shown(colony)}.")
    colony.rollout.num_envs  # noqa: B018 - says so if there is no environment
