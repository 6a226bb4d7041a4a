"""The colony that remembers: ants walk back and lay what they then know."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import ArrayLike, NDArray

from acl_gym.agents.colony import ColonyAgent
from acl_gym.agents.informed import InformedAgent
from acl_gym.agents.saving import with_prefix
from acl_gym.agents.training import Training
from acl_gym.callbacks.base import Callbacks
from acl_gym.colony.greedy import epsilon_greedy_actions, epsilon_greedy_unchecked
from acl_gym.colony.guided import guided_actions, guided_unchecked
from acl_gym.colony.heuristic import Heuristic
from acl_gym.colony.optimism import possible_levels
from acl_gym.colony.schedules import Setting
from acl_gym.colony.starts import Starts
from acl_gym.colony.walk import Walk
from acl_gym.colony.walking_back import WalkBack
from acl_gym.envs.wrappers.workers import spread_over_workers
from acl_gym.partitions import Discrete, Partition
from acl_gym.utils import validation
from acl_gym.utils.parameters import Parameter
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray, IntArray


class ReturningACL(InformedAgent, ColonyAgent):
    """A colony whose ants walk back from where they end, and which remembers.

    Each slot of the environment is an ant, as in `ACL`, and all share one table of
    levels over (cell, action) pairs. Three things differ, each of which the thesis names
    (§2.3, §7.3):

    - After a while the ants walk their paths back. At each pair an ant lays what it then
      expects: the reward of the step and what follows, see
      `acl_gym.colony.walking_back`. A pair is judged by itself, not by the cost of the
      whole solution, and levels become means, not sums, so that what is popular does not
      beat what is good.
    - The colony remembers its paths and walks them back again many times.
    - The partition grows where it was chosen for you: wider when something is seen
      beyond its range, finer when its pairs have been tried often enough.

    A level is the discounted return that a pair promises: the reward or, where rewards
    are negative stage costs, minus the cost to go. The policy takes the pair that
    promises most. No `deposit` is to be chosen, and rewards may have any sign.

    Args:
        env: a vector environment with `Discrete` actions; its slots are the M ants.
        partition: turns observations into cells and degrees. None: it is chosen.
        discount: gamma_rl, in [0, 1], weight of what follows a step.
        mix: in [0, 1], how much an ant trusts its own continuation; the rest is the best
            that the levels promise. None takes 0.2, or 0 where states are cells already:
            there, continuations only bring in the accidents of exploration.
        learning_rate: rho, in (0, 1], the share of the way to the mean of what was laid.
        trust: in [0, 1]. With 1, a level moves by the share of its remembered evidence
            that the ants have just walked back, and so comes to the mean over all that
            is remembered; with 0 it follows the paths that were walked back last.
        epsilon: probability of a random action, in [0, 1], on the average of the ants:
            the first ant never explores, the last one twice as often, and those between
            in even steps. So there are always long walks without accidents, which show
            where the present policy fails, and ants that look elsewhere.
        optimism: in [0, 1], what pairs promise that were never tried: with 0 the value
            of a good state, with 1 the most that could be had.
        heuristic: eta, what is known of each action beforehand: an array
            `(n_cells, n_actions)`, finite, >= 0 and positive somewhere in each row, or a
            function of the environment and the partition that returns one, such as a
            `PolicyPrior`. An ant that explores, or to which several actions promise the
            same, draws one in proportion to eta^beta (the mean over the cells of its
            state, each scaled to sum 1, weighted with their degrees); one with eta = 0 is
            not drawn unless nothing else is allowed. None: all are equally likely. A
            function is asked again when the partition has grown; an array is
            interpolated.
        beta: exponent of the heuristic, >= 0; a number, or a schedule such as
            `Exponential(1.0, 0.9)` that gives one for each trial.
        initial: what pairs promise that were never tried, in place of what `optimism`
            says: an array `(n_cells, n_actions)` of discounted returns, finite, or a
            function, as for `heuristic`. What is laid replaces it.
        walks_back: how often the ants walk back after each walk, >= 1.
        older_steps: how many steps of older paths they walk back beside the newest paths
            each time, >= 0.
        steps_per_walk: after how many steps of all ants together they walk back, >= 1.
            Ants that have not finished go on from where they are.
        memory_size: how many states are remembered, >= 1.
        visits_to_grow: how many steps must be remembered for each pair and state variable
            on the average before all cells are halved along one variable, > 0.
        max_cells: the partition does not become finer than this, >= 1.
        grows: whether the partition becomes wider and finer. None: if it was chosen for
            you.
        grows_where: where cells are halved first, along one variable, each in turn.
            `"tried"`: between centres where pairs have been tried twice as often as
            `visits_to_grow` asks for. `"varied"`: of those that have been tried often
            enough, where the policy varies most (§7.3). `"everywhere"`: not before the
            pairs have been tried often enough on the average; then all cells are halved,
            whatever this says.
        restart_after: after how many steps all ants set out anew, though they have not
            finished, >= 1. None takes 60 until 20 starts have been seen. Where these are
            spread widely it stays so; where all start in the same place, ants walk to the
            end of their episodes from then on, see `acl_gym.colony.starts`.
        schedule: `"synchronous"`: an ant that has finished waits until all have.
            `"asynchronous"` (§7.3): it sets out again at once, until the last ant is back
            from its first way of the trial; the trial then ends for all, and paths that
            end there are remembered as far as they go. No ant ever waits. A trial is then
            M episodes or more. Not every environment can do it, see
            `acl_gym.evaluation.stream.Stream`.
        max_steps: T, the most steps an ant may make, >= 1. None takes the time limit of
            the environment, or 300 if it has none.
        seed: the same seed gives the same run; None draws one from the system.
        n_actions: only needed without an environment.
        workers: lets the ants walk in so many workers, >= 0, for environments that are
            slow to step: the single environments of `env` are made anew in a
            `WorkersVectorEnv`, the agent's `env`. The bits are the same for any number.
            None leaves `env` as it is.
        executor: where workers are, "processes" or "ray", see `WorkersVectorEnv`; only
            with `workers`.

    Raises:
        TypeError: `env` or `partition` is of the wrong kind.
        ValueError: a parameter is out of range.

    Example:
        >>> import gymnasium as gym
        >>> from acl_gym import ReturningACL
        >>> env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=5)
        >>> colony = ReturningACL(env, seed=0).learn(total_timesteps=1_000)
        >>> colony.num_timesteps >= 1_000
        True
    """

    always_remembers = True
    _completes = False  # what an ant has done until then is remembered in any case

    discount = Parameter(
        "Weight of what follows a step", "gamma_rl", at_least=0, at_most=1
    )
    learning_rate = Parameter(
        "Share of the way to the mean of what is laid", "rho", above=0, at_most=1
    )
    trust = Parameter(
        "Follow the latest paths, 0, or the mean of all, 1", at_least=0, at_most=1
    )
    epsilon = Parameter(
        "Probability of a random action", "epsilon", at_least=0, at_most=1
    )
    optimism = Parameter(
        "What untried pairs promise: a good state, 0, or the most, 1",
        at_least=0,
        at_most=1,
    )
    beta = Parameter("Exponent of the heuristic", "beta", scheduled=True, at_least=0)
    mix = Parameter("Trust of an ant in its own continuation", at_least=0, at_most=1)
    walks_back = Parameter(
        "Walks back after each walk", whole=True, at_least=1, at_most=10_000
    )
    older_steps = Parameter(
        "Steps of older paths in each walk back",
        whole=True,
        at_least=0,
        at_most=1_000_000_000,
    )
    steps_per_walk = Parameter(
        "Steps of all ants before they walk back",
        whole=True,
        at_least=1,
        at_most=1_000_000_000,
    )
    max_cells = Parameter(
        "The most cells of a partition that grows",
        whole=True,
        at_least=1,
        at_most=2_000_000_000,
    )
    visits_to_grow = Parameter(
        "Steps for each pair and state variable before cells are split", above=0
    )

    def __init__(
        self,
        env: VectorEnv[Any, Any, Any] | None,
        partition: Partition | None = None,
        *,
        discount: float = 0.99,
        mix: float | None = None,
        learning_rate: float = 0.9,
        trust: float = 1.0,
        epsilon: float = 0.2,
        optimism: float = 1.0,
        heuristic: Heuristic | None = None,
        beta: Setting = 1.0,
        initial: Heuristic | None = None,
        walks_back: int = 30,
        older_steps: int = 10_000,
        steps_per_walk: int = 300,
        memory_size: int = 300_000,
        visits_to_grow: float = 5.0,
        max_cells: int = 20_000,
        grows: bool | None = None,
        grows_where: str = "tried",
        restart_after: int | None = None,
        schedule: str = "synchronous",
        max_steps: int | None = None,
        seed: int | None = None,
        n_actions: int | None = None,
        workers: int | None = None,
        executor: str = "processes",
    ) -> None:
        if workers is not None:
            env = spread_over_workers(env, workers, executor)
        elif executor != "processes":
            raise ValueError(
                f"executor says where workers are, got {executor!r} without workers; "
                'pass a number of them as well, such as workers=2, or executor="processes".'
            )
        self.discount = discount
        self.learning_rate = learning_rate
        self.trust = trust
        self.epsilon = epsilon
        self.optimism, self.beta = optimism, beta
        self.visits_to_grow = visits_to_grow
        self.walks_back, self.older_steps = walks_back, older_steps
        self.steps_per_walk = steps_per_walk
        self.max_cells = max_cells
        self.restart_after = restart_after
        super().__init__(
            env,
            partition,
            heuristic=heuristic,
            initial=initial,
            grows=partition is None if grows is None else grows,
            grows_where=grows_where,
            memory_size=memory_size,
            schedule=schedule,
            max_steps=max_steps,
            seed=seed,
            n_actions=n_actions,
        )
        if mix is None:
            mix = 0.0 if isinstance(self.partition, Discrete) else 0.2
        self.mix = mix
        shape = self.partition.n_cells, self.n_actions
        first = np.zeros(shape) if self.initial is None else self.initial.copy()
        self._walk_back = WalkBack(first)
        self._starts = Starts()

    def learn(
        self,
        total_timesteps: int | None = None,
        trials: int | None = None,
        callback: Callbacks = None,
        log_interval: int | None = None,
        progress_bar: bool = False,
    ) -> Self:
        """Let the ants walk, remember, walk back and, where it may, the partition grow.

        In a trial every ant sets out, walks until its episode ends, and waits for the
        others. Two arguments change this: after `restart_after` steps, at first 60, all
        set out anew, so that a trial may be shorter than an episode; and with an
        asynchronous `schedule` ants do not wait. Called again, it continues from the
        levels and the memory as they are.

        Args:
            total_timesteps: stop after the trial that reaches this many steps of all
                ants together; None sets no such limit.
            trials: how many trials to make; None sets no such limit. Without either
                limit, 100.
            callback: as in `ACL.learn`.
            log_interval: print a line every `log_interval` trials; None prints nothing.
            progress_bar: show a bar (of tqdm).

        Returns:
            The agent itself.

        Raises:
            ValueError: the environment does not return what it should.
        """
        budget = (total_timesteps, trials, callback, log_interval, progress_bar)
        with Training(self, *budget) as training:
            while training.next_trial():
                observation = self.rollout.start(seed=self._next_seed())
                limit = self._steps_of_trial(observation)
                while self.rollout._ants.size and self.rollout.steps < limit:
                    walk, observation = self._walk(observation, limit)
                    newest = self._remember(walk)
                    self._promise(self.optimism)
                    bounds = possible_levels(
                        self._memory, self.discount, self.max_steps
                    )
                    for _ in range(self.walks_back):
                        self._return(newest, bounds)
                    self._split()
                training.end_trial()
        return self

    def _steps_of_trial(self, observation: NDArray[Any]) -> int:
        """After how many steps all ants set out anew."""
        self._starts.add(observation, self._memory)
        if self.restart_after is not None:
            return min(self.restart_after, self.max_steps)
        return self._starts.steps(self.max_steps)

    def _walk(self, observation: Any, limit: int) -> tuple[Walk, Any]:
        """Let the ants that still walk make some steps; return these and where they are.

        Args:
            observation: where they are, of all slots.
            limit: after how many steps of the trial they stop in any case.
        """
        rollout, walk = self.rollout, Walk(self.num_envs)
        curiosity, proposals = self._curiosity(), self._proposals()
        going = rollout._ants
        while (
            rollout._ants.size
            and walk.steps < self.steps_per_walk
            and rollout.steps < limit
        ):
            ants, allowed = rollout._ants, rollout.allowed()
            seen = observation[ants]
            index, degree = self._locate(observation, ants)
            choice = self._table, index, degree, curiosity[ants], self.rng, allowed
            if proposals is None:
                actions = epsilon_greedy_unchecked(*choice)
            else:
                actions = guided_unchecked(proposals, *choice)
            step = rollout._step(actions)
            walk.append(ants, seen, actions, -step.cost, allowed)
            observation, going = step.observation, ants
            if step.finished.any():
                going = ants[~step.finished]
                done, goal = ants[step.finished], step.terminated[step.finished]
                walk.stop(done, observation, goal, rollout.allowed_after(done))
                observation = rollout.set_out(observation)
        if going.size:  # others may have set out, but made no step yet
            on_the_way = np.zeros(going.size, np.bool_)
            walk.stop(going, observation, on_the_way, rollout.allowed_after(going))
        return walk, observation

    def _curiosity(self) -> FloatArray:
        """How often each ant explores, `(num_envs,)`."""
        if self.num_envs == 1:
            return np.array([self.epsilon])
        return np.minimum(np.linspace(0.0, 2.0 * self.epsilon, self.num_envs), 1.0)

    def _return(self, newest: IntArray, bounds: tuple[float, float]) -> None:
        """Let the ants walk the newest paths back, and some older ones."""
        self._walk_back.walk(
            self._memory,
            self._memory.with_older(newest, self.older_steps, self.rng),
            discount=self.discount,
            mix=self.mix,
            rate=self.learning_rate,
            trust=self.trust,
            bounds=bounds,
        )

    def _set_partition(
        self, partition: Partition, table: FloatArray, known: BoolArray
    ) -> None:
        super()._set_partition(partition, table, known)
        self._walk_back = WalkBack(table)
        self._walk_back.known[:] = known

    @property
    def _table(self) -> FloatArray:
        return self._walk_back.levels

    @property
    def _known(self) -> BoolArray:
        return self._walk_back.known

    @property
    def restart_after(self) -> int | None:
        """After how many steps all ants set out anew; None: 60, or it depends on the starts."""
        return self._restart_after

    @restart_after.setter
    def restart_after(self, value: int | None) -> None:
        if value is not None:
            value = validation.integer("restart_after", value, at_least=1)
        self._restart_after = value

    def set_table(self, table: ArrayLike) -> None:
        """Replace all levels; all pairs then count as known.

        Raises:
            ValueError: the shape differs, or a level is not finite.
        """
        self._table[:] = self._checked_table(table)
        self._walk_back.known[:] = True

    def parameters(self) -> dict[str, Any]:
        """The keyword arguments of the constructor."""
        return {
            "discount": self.discount,
            "mix": self.mix,
            "learning_rate": self.learning_rate,
            "trust": self.trust,
            "epsilon": self.epsilon,
            "optimism": self.optimism,
            **super().parameters(),
            "walks_back": self.walks_back,
            "older_steps": self.older_steps,
            "steps_per_walk": self.steps_per_walk,
            "memory_size": self.memory_size,
            "visits_to_grow": self.visits_to_grow,
            "max_cells": self.max_cells,
            "grows": self.grows,
            "grows_where": self.grows_where,
            "restart_after": self.restart_after,
            "schedule": self.schedule,
            "max_steps": self.max_steps,
            "seed": self.seed,
        }

    def _arrays(self) -> dict[str, NDArray[Any]]:
        starts = {f"starts_{name}": a for name, a in self._starts.arrays().items()}
        return {**super()._arrays(), **starts}

    def _restore(
        self, header: dict[str, Any], arrays: Mapping[str, NDArray[Any]]
    ) -> None:
        super()._restore(header, arrays)
        self._starts.restore(with_prefix("starts_", arrays), self._memory)

    def _state(self) -> Any:
        return super()._state(), self._starts.copy()

    def _take_over(self, table: FloatArray, state: Any) -> None:
        remembered, starts = state
        super()._take_over(table, remembered)
        self._starts = starts.copy()

    def _explore(
        self, index: CellArray, degree: FloatArray, allowed: BoolArray | None
    ) -> IntArray:
        proposals, rng = self._proposals(), self._predict_rng
        choice = self._table, index, degree, self.epsilon, rng, allowed
        if proposals is None:
            return epsilon_greedy_actions(*choice)
        return guided_actions(proposals, *choice)
