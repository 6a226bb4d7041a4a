"""Q-learning and Q(lambda) over the same partition and slots as the colony."""

from __future__ import annotations

from typing import Any, Self

import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import ArrayLike

from acl_gym.agents.remembering import RememberingAgent
from acl_gym.agents.training import Training
from acl_gym.callbacks.base import Callbacks
from acl_gym.colony.greedy import (
    ALL,
    epsilon_greedy_actions,
    epsilon_greedy_unchecked,
    mark_greedy,
)
from acl_gym.colony.replay import replay
from acl_gym.colony.temporal_difference import update_values
from acl_gym.colony.traces import TRACES, Traces
from acl_gym.colony.walk import Walk
from acl_gym.partitions import Partition
from acl_gym.utils import validation
from acl_gym.utils.parameters import Parameter, fixed
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray, IntArray


class QLearning(RememberingAgent):
    """Watkins's Q-learning (3.44) and Q(lambda) (3.45), all slots learning one table.

    Through a `Crisp` partition it is tabular Q-learning; through a `Fuzzy` one the
    action value is linear in the degrees, Q(x, u) = sum of beta_i Q_iu, and each cell
    learns in proportion to its degree. Values start at 0, which is optimistic where
    rewards are negative costs, so the slots explore. If the environment gives
    `infos["action_mask"]`, those are the actions U_q of each state.

    With `trace_decay` > 0 it is Watkins's Q(lambda), as in
    `QLearning(env, grid, trace_decay=0.7)`. Each slot has its own traces, which are
    empty at the start of each episode. In each step they fade by gamma_rl lambda, the cells
    of the state and the action taken are added, and every pair learns from the error
    (3.46) in proportion to its trace. An action that is not greedy on the values
    it was chosen on first clears the slot's traces; tied actions are greedy. Traces
    below 1e-4 are dropped.

    With `replay` > 0 the slots remember what they did, as the ants of `ReturningACL` do.
    After every `steps_per_replay` steps the newest paths and some older ones are learned
    from again, `replay` times: backwards along each path, one step after the other,
    each on the values as they then are. With `trace_decay` > 0 these steps learn from
    the lambda-return of Watkins's Q(lambda), see `acl_gym.colony.replay`. With
    `grows=True` the partition becomes wider and finer with what is seen, as that of
    `ReturningACL`; traces then begin anew.

    Args:
        env: a vector environment with `Discrete` actions.
        partition: turns observations into cells and degrees; None takes
            `automatic_partition(env)`, or a coarse one to begin with if it grows.
        learning_rate: alpha_rl, in (0, 1].
        discount: gamma_rl, in [0, 1].
        epsilon: probability of a random action, in [0, 1].
        trace_decay: lambda, in [0, 1]; 0 is plain Q-learning.
        traces: what a visit with degree beta makes of a trace e, after its fading.
            `"replacing"` makes it max(e, beta): at most 1, so that no error is
            corrected by more than the learning rate. `"accumulating"` makes
            it e + beta: a slot that stands still against a wall comes to
            1 / (1 - gamma_rl lambda), which times the learning rate can exceed 1, and
            then the value moves further than the error.
        replay: how often paths are learned from again after `steps_per_replay` steps,
            in [0, 10000]; 0: never.
        older_steps: how many steps of older paths are replayed beside the newest paths
            each time, in [0, 1e9].
        steps_per_replay: after how many steps of all slots together, in [1, 1e9], or at
            the end of the trial, paths are replayed and the partition may grow.
        memory_size: how many states are remembered, >= 1, where `replay`, `grows` or
            `optimism` needs it.
        optimism: in [0, 1], what pairs promise that were never tried: with 0 the value
            of a good state, with 1 the most that could be had. None: they stay at 0.
        grows: whether the partition becomes wider and finer.
        grows_where: where cells are halved first, see `ReturningACL`.
        visits_to_grow: how many steps must be remembered for each pair and state variable
            on the average before all cells are halved along one variable, > 0.
        max_cells: the partition does not become finer than this, in [1, 2e9].
        max_steps: the longest an episode may last, >= 1. None takes the time limit of
            the environment, or 300 if it has none.
        seed: the same seed gives the same run; None draws one from the system.
        n_actions: only needed without an environment.

    Raises:
        TypeError: `env` or `partition` is of the wrong kind.
        ValueError: a parameter is out of range.
    """

    learning_rate = Parameter(
        "Share of the error by which a value is corrected",
        "alpha_rl",
        above=0,
        at_most=1,
    )
    discount = Parameter(
        "Weight of the next state's value", "gamma_rl", at_least=0, at_most=1
    )
    epsilon = Parameter(
        "Probability of a random action", "epsilon", at_least=0, at_most=1
    )
    trace_decay = Parameter(
        "Fading of traces beside the discount; 0 is plain Q-learning",
        "lambda",
        at_least=0,
        at_most=1,
    )
    replay = Parameter(
        "Replays of remembered paths after some steps; 0: none",
        whole=True,
        at_least=0,
        at_most=10_000,
    )
    older_steps = Parameter(
        "Steps of older paths in each replay",
        whole=True,
        at_least=0,
        at_most=1_000_000_000,
    )
    steps_per_replay = Parameter(
        "Steps of all slots before paths are replayed",
        whole=True,
        at_least=1,
        at_most=1_000_000_000,
    )
    visits_to_grow = Parameter(
        "Steps for each pair and state variable before cells are split", above=0
    )
    max_cells = Parameter(
        "The most cells of a partition that grows",
        whole=True,
        at_least=1,
        at_most=2_000_000_000,
    )

    def __init__(
        self,
        env: VectorEnv[Any, Any, Any] | None,
        partition: Partition | None = None,
        *,
        learning_rate: float = 0.3,
        discount: float = 0.98,
        epsilon: float = 0.1,
        trace_decay: float = 0.0,
        traces: str = "replacing",
        replay: int = 0,
        older_steps: int = 10_000,
        steps_per_replay: int = 300,
        memory_size: int = 300_000,
        optimism: float | None = None,
        grows: bool = False,
        grows_where: str = "tried",
        visits_to_grow: float = 5.0,
        max_cells: int = 20_000,
        max_steps: int | None = None,
        seed: int | None = None,
        n_actions: int | None = None,
    ) -> None:
        self.learning_rate = learning_rate
        self.discount = discount
        self.epsilon = epsilon
        self.trace_decay = trace_decay
        self._kind = validation.one_of("traces", traces, TRACES)
        self._traces: Traces | None = None
        self.replay, self.older_steps = replay, older_steps
        self.steps_per_replay = steps_per_replay
        self.optimism = optimism
        self.visits_to_grow, self.max_cells = visits_to_grow, max_cells
        super().__init__(
            env,
            partition,
            grows=grows,
            grows_where=grows_where,
            memory_size=memory_size,
            max_steps=max_steps,
            seed=seed,
            n_actions=n_actions,
        )
        self._values: FloatArray = np.zeros((self.partition.n_cells, self.n_actions))
        self._tried: BoolArray = np.zeros(self._values.shape, np.bool_)

    def learn(
        self,
        total_timesteps: int | None = None,
        trials: int | None = None,
        callback: Callbacks = None,
        log_interval: int | None = None,
        progress_bar: bool = False,
    ) -> Self:
        """Learn; a trial is one episode in every slot.

        Called again, it continues from the values as they are.

        Args:
            total_timesteps: stop after the trial that reaches this many steps of all
                slots together; None sets no such limit.
            trials: how many trials to make; None sets no such limit. Without either
                limit, 100.
            callback: as in `ACL.learn`, which names the equivalents of
                Stable-Baselines3's callbacks: `PolicyEvaluation` for `EvalCallback`,
                `Checkpoint` for `CheckpointCallback`, `TensorBoardLog` for
                `tensorboard_log`.
            log_interval: print a line every `log_interval` trials; None prints nothing.
            progress_bar: show a bar (of tqdm).

        Returns:
            The agent itself.

        Raises:
            ValueError: the action values have overflowed.
        """
        budget = (total_timesteps, trials, callback, log_interval, progress_bar)
        with Training(self, *budget) as training:
            while training.next_trial():
                observation = self.rollout.start(seed=self._next_seed())
                if self._traces is not None:
                    self._traces.clear()
                while self.rollout._ants.size:
                    walk, observation = self._walk(observation)
                    if walk is not None:
                        self._learn_again(walk)
                self._check_values()
                training.end_trial()
        return self

    def _walk(self, observation: Any) -> tuple[Walk | None, Any]:
        """Let the slots that still walk make some steps, and learn from each.

        Returns:
            What they did, to be remembered, None where that is not wanted; and all
            observations after it.
        """
        rollout, traces = self.rollout, self._present_traces()
        walk = Walk(self.num_envs) if self._remembers else None
        cells, shares = self._locate(observation, rollout._ants)
        index, degree = cells.copy(), shares.copy()
        allowed = rollout.allowed()
        while rollout._ants.size:
            actions = epsilon_greedy_unchecked(
                self._table, index, degree, self.epsilon, self.rng, allowed
            )
            seen = observation if walk is None else observation[rollout._ants]
            step = rollout._step(actions)
            next_index, next_degree = self._locate(step.observation, step.ants)
            next_allowed = rollout.allowed()
            after = rollout.allowed_after(step.ants)
            transition = (
                self._table,
                index,
                degree,
                actions,
                step.cost,
                step.terminated,
                next_index,
                next_degree,
                ALL if after is None else after,
                self.learning_rate,
                self.discount,
            )
            if traces is None:
                update_values(*transition)
            else:
                mask = ALL if allowed is None else allowed
                mark_greedy(self._table, index, degree, actions, mask, traces.greedy)
                fading = self.discount * self.trace_decay
                accumulate = self._kind == "accumulating"
                traces.update(transition, step.ants, fading, accumulate)
            if walk is not None:
                walk.append(step.ants, seen, actions, -step.cost, allowed)
                observation = step.observation
                done = step.ants[step.finished]
                if done.size:
                    goal = step.terminated[step.finished]
                    walk.stop(done, observation, goal, rollout.allowed_after(done))
                if walk.steps >= self.steps_per_replay:
                    break
            allowed, stays = next_allowed, ~step.finished
            index, degree = next_index[stays], next_degree[stays]
        if walk is not None and rollout._ants.size:
            ants, on_the_way = rollout._ants, np.zeros(rollout._ants.size, np.bool_)
            walk.stop(ants, observation, on_the_way, rollout.allowed_after(ants))
        return walk, observation

    def _learn_again(self, walk: Walk) -> None:
        """Remember what was done, learn from memory, and let the partition grow."""
        newest, memory = self._remember(walk), self._memory
        self._tried |= memory.evidence.reshape(self._tried.shape) > 0
        if self.optimism is not None:
            self._promise(self.optimism)
        elif self.grows:  # what was learned in coarse cells says nothing of new ones
            self._values[~self._tried] = 0.0
        for _ in range(self.replay):
            replay(
                memory,
                memory.with_older(newest, self.older_steps, self.rng),
                self._values,
                rate=self.learning_rate,
                discount=self.discount,
                trace_decay=self.trace_decay,
            )
        self._split()

    @property
    def optimism(self) -> float | None:
        """What untried pairs promise: a good state, 0, or the most, 1; None: 0 reward."""
        return self._optimism

    @optimism.setter
    def optimism(self, value: float | None) -> None:
        if value is not None:
            value = validation.number("optimism", value, at_least=0, at_most=1)
        self._optimism = value

    @property
    def traces(self) -> str:
        """The kind of traces; fixed once the agent is made."""
        return self._kind

    @traces.setter
    def traces(self, value: str) -> None:
        raise fixed("traces", value)

    @property
    def _table(self) -> FloatArray:
        return self._values

    @property
    def _known(self) -> BoolArray:
        return self._tried

    @property
    def _remembers(self) -> bool:
        return self.replay > 0 or self.grows or self.optimism is not None

    def _set_partition(
        self, partition: Partition, table: FloatArray, known: BoolArray
    ) -> None:
        super()._set_partition(partition, table, known)
        self._values, self._tried = table, known
        self._traces = None  # those of other cells

    def set_table(self, table: ArrayLike) -> None:
        """Replace the action values; all pairs then count as tried.

        Raises:
            ValueError: the shape differs, or a value is not finite.
        """
        self._values[:] = self._checked_table(table)
        self._tried[:] = True

    def _check_values(self) -> None:
        if not np.isfinite(self._values).all():
            raise ValueError(
                "action values must stay finite, but have overflowed in trial "
                f"{self.trials + 1}; scale the rewards down, or lower discount or "
                "learning_rate."
            )

    def parameters(self) -> dict[str, Any]:
        """The keyword arguments of the constructor."""
        return {
            "learning_rate": self.learning_rate,
            "discount": self.discount,
            "epsilon": self.epsilon,
            "trace_decay": self.trace_decay,
            "traces": self.traces,
            "replay": self.replay,
            "older_steps": self.older_steps,
            "steps_per_replay": self.steps_per_replay,
            "memory_size": self.memory_size,
            "optimism": self.optimism,
            "grows": self.grows,
            "grows_where": self.grows_where,
            "visits_to_grow": self.visits_to_grow,
            "max_cells": self.max_cells,
            "max_steps": self.max_steps,
            "seed": self.seed,
        }

    def _explore(
        self, index: CellArray, degree: FloatArray, allowed: BoolArray | None
    ) -> IntArray:
        return epsilon_greedy_actions(
            self._table, index, degree, self.epsilon, self._predict_rng, allowed
        )

    def _present_traces(self) -> Traces | None:
        """The traces of the trial under way; None without traces."""
        if self.trace_decay == 0:
            return None
        if self._traces is None or self._traces.greedy.size != self.num_envs:
            longest = self.max_steps * self.partition.cells_per_state
            self._traces = Traces(self.num_envs, self._values.size, longest)
        return self._traces
