"""Q-learning and Q(lambda) over the same partition and slots as the colony."""

from __future__ import annotations

from typing import Any, Self

import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import ArrayLike

from acl_gym.agents.base import TabularAgent
from acl_gym.agents.training import Training
from acl_gym.callbacks.base import Callbacks
from acl_gym.colony.greedy import (
    ALL,
    LOOP,
    best_value,
    epsilon_greedy_actions,
    epsilon_greedy_unchecked,
    mark_greedy,
)
from acl_gym.partitions import Partition, locate_all
from acl_gym.utils import validation
from acl_gym.utils.compiling import njit
from acl_gym.utils.parameters import Parameter, fixed
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray, IntArray

TRACES = ("replacing", "accumulating")

FIRST_TRACES = 1_024
"""For how many traces of each slot there is memory at first."""

TRACE_CUTOFF = 1e-4
"""Traces that fade below it are dropped (a decision)."""


class QLearning(TabularAgent):
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

    Args:
        env: a vector environment with `Discrete` actions.
        partition: turns observations into cells and degrees; None takes
            `automatic_partition(env)`.
        learning_rate: alpha_rl, in (0, 1].
        discount: gamma_rl, in [0, 1].
        epsilon: probability of a random action, in [0, 1].
        trace_decay: lambda, in [0, 1]; 0 is plain Q-learning.
        traces: what a visit with degree beta makes of a trace e, after its fading. `"replacing"` makes it max(e, beta): at most 1, so that no
            error is corrected by more than the learning rate. `"accumulating"` makes
            it e + beta: a slot that stands still against a wall comes to
            1 / (1 - gamma_rl lambda), which times the learning rate can exceed 1, and
            then the value moves further than the error.
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
        max_steps: int | None = None,
        seed: int | None = None,
        n_actions: int | None = None,
    ) -> None:
        self.learning_rate = learning_rate
        self.discount = discount
        self.epsilon = epsilon
        self.trace_decay = trace_decay
        self._kind = validation.one_of("traces", traces, TRACES)
        self._traces: _Traces | None = None
        super().__init__(
            env, partition, max_steps=max_steps, seed=seed, n_actions=n_actions
        )
        self._values: FloatArray = np.zeros((self.partition.n_cells, self.n_actions))

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
                rollout, traces = self.rollout, self._empty_traces()
                observation = rollout.start(seed=self._next_seed())
                index, degree = locate_all(self.partition, observation, self._n_cells)
                allowed = rollout.allowed()
                while rollout._ants.size:
                    actions = epsilon_greedy_unchecked(
                        self._table, index, degree, self.epsilon, self.rng, allowed
                    )
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
                        _update(*transition)
                    else:
                        mark_greedy(
                            self._table,
                            index,
                            degree,
                            actions,
                            ALL if allowed is None else allowed,
                            traces.greedy,
                        )
                        _update_traced(
                            *transition,
                            self.discount * self.trace_decay,
                            self._kind == "accumulating",
                            TRACE_CUTOFF,
                            step.ants,
                            *traces.with_room(index.shape[1]),
                        )
                    allowed, stays = next_allowed, ~step.finished
                    index, degree = next_index[stays], next_degree[stays]
                self._check_values()
                training.end_trial()
        return self

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

    def set_table(self, table: ArrayLike) -> None:
        """Replace the action values.

        Raises:
            ValueError: the shape differs, or a value is not finite.
        """
        values = self._checked_table(table)
        self._values[:] = values

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
            "max_steps": self.max_steps,
            "seed": self.seed,
        }

    def _explore(
        self, index: CellArray, degree: FloatArray, allowed: BoolArray | None
    ) -> IntArray:
        return epsilon_greedy_actions(
            self._table, index, degree, self.epsilon, self._predict_rng, allowed
        )

    def _empty_traces(self) -> _Traces | None:
        """Memory for a trial, reused from trial to trial; None without traces."""
        if self.trace_decay == 0:
            return None
        kept = self._traces
        if kept is None or kept.greedy.size != self.num_envs:
            longest = self.max_steps * self.partition.cells_per_state
            kept = _Traces(self.num_envs, self._values.size, longest)
            self._traces = kept
        kept.clear()
        return kept


class _Traces:
    """The eligibility traces e of all slots, those that are not 0.

    Memory grows with what traces need: by doubling, up to the longest episode.

    Args:
        slots: how many slots there are.
        n_pairs: entries of the table.
        longest: how many visits to pairs an episode can hold.
    """

    def __init__(self, slots: int, n_pairs: int, longest: int) -> None:
        self._most = min(n_pairs, longest)
        first = min(self._most, FIRST_TRACES)
        self._greedy: BoolArray = np.empty(slots, dtype=np.bool_)
        self._pair: IntArray = np.empty((slots, first), dtype=np.int64)
        self._trace: FloatArray = np.empty((slots, first))
        self._count: IntArray = np.zeros(slots, dtype=np.int64)
        self._mark: FloatArray = np.zeros(n_pairs)
        self._at_most = 0  # no slot has more traces than this

    @property
    def greedy(self) -> BoolArray:
        """Whether the last action of each walking slot was greedy; to be written."""
        return self._greedy

    def clear(self) -> None:
        """Forget all traces."""
        self._count[:] = 0
        self._at_most = 0

    def with_room(self, more: int) -> tuple[Any, ...]:
        """The arrays that `_update_traced` changes, with room for `more` in each slot."""
        self._at_most += more
        if self._at_most > (room := self._pair.shape[1]):
            self._at_most = int(self._count.max()) + more
            if min(self._at_most, self._most) > room:
                self._widen(min(max(2 * room, self._at_most), self._most))
        return self._greedy, self._pair, self._trace, self._count, self._mark

    def _widen(self, width: int) -> None:
        """Make room for more traces of each slot; those that are there stay."""
        for name in ("_pair", "_trace"):
            array = getattr(self, name)
            wider = np.empty((len(array), width), dtype=array.dtype)
            wider[:, : array.shape[1]] = array
            setattr(self, name, wider)


@njit(inline="always")
def _error(
    values: FloatArray,
    index: CellArray,
    degree: FloatArray,
    u: int,
    cost: float,
    terminated: bool,
    next_index: CellArray,
    next_degree: FloatArray,
    next_allowed: BoolArray,
    discount: float,
    j: int,
) -> float:
    """The temporal-difference error of slot j: by how much the value of its pair is off."""
    best = 0.0
    if not terminated:
        best = best_value(values, next_index, next_degree, j, next_allowed, LOOP, LOOP)
    error = -cost + discount * best
    for c in range(index.shape[1]):
        error -= degree[j, c] * values[index[j, c], u]
    return error


@njit
def _update(
    values: FloatArray,
    index: CellArray,
    degree: FloatArray,
    actions: IntArray,
    costs: FloatArray,
    terminated: BoolArray,
    next_index: CellArray,
    next_degree: FloatArray,
    next_allowed: BoolArray,
    learning_rate: float,
    discount: float,
) -> None:
    """Q-learning update, eq. (3.44), slot by slot, each on the values as they then are.

    Adding up the slots' corrections instead would overshoot where many slots share a
    cell: with ten slots at a rate of 0.3 it would move by three times the error.
    """
    for j in range(actions.size):
        u = actions[j]
        error = _error(
            values,
            index,
            degree,
            u,
            costs[j],
            terminated[j],
            next_index,
            next_degree,
            next_allowed,
            discount,
            j,
        )
        for c in range(index.shape[1]):
            values[index[j, c], u] += learning_rate * degree[j, c] * error


@njit
def _update_traced(
    values: FloatArray,
    index: CellArray,
    degree: FloatArray,
    actions: IntArray,
    costs: FloatArray,
    terminated: BoolArray,
    next_index: CellArray,
    next_degree: FloatArray,
    next_allowed: BoolArray,
    learning_rate: float,
    discount: float,
    fading: float,
    accumulate: bool,
    cutoff: float,
    ants: IntArray,
    greedy: BoolArray,
    pair: IntArray,
    trace: FloatArray,
    count: IntArray,
    mark: FloatArray,
) -> None:
    """Q(lambda) update, eq. (3.45), slot by slot, each on the values as they then are.

    The degrees of the state are written to `mark`, so that one pass over the slot's
    traces can fade them, merge the state into them, drop the smallest and correct the
    values.

    Args:
        values: `(n_cells, n_actions)`, corrected in place.
        index: cells of the `m` walking slots, `(m, k)`; those of degree > 0 differ.
        degree: their degrees, `(m, k)`.
        actions: what they did, `(m,)`.
        costs: what it cost, `(m,)`.
        terminated: whether it led to a terminal state, `(m,)`.
        next_index: where it led, `(m, k)`.
        next_degree: `(m, k)`.
        next_allowed: U_q there, `(m, n_actions)`, or empty.
        learning_rate: alpha_rl.
        discount: gamma_rl.
        fading: gamma_rl lambda.
        accumulate: add a visit to a trace, instead of replacing it.
        cutoff: traces that are not above it are dropped.
        ants: which slots walk, `(m,)`.
        greedy: whether their actions were, `(>= m,)`.
        pair: of each trace of each slot, cell * n_actions + action.
        trace: e, of the shape of `pair`.
        count: how many traces each slot has.
        mark: zeros, `(values.size,)`; zero again afterwards.
    """
    n_actions = values.shape[1]
    flat = values.reshape(values.size)
    for j in range(actions.size):
        u = actions[j]
        error = _error(
            values,
            index,
            degree,
            u,
            costs[j],
            terminated[j],
            next_index,
            next_degree,
            next_allowed,
            discount,
            j,
        )
        for c in range(index.shape[1]):
            if degree[j, c] > 0.0:
                mark[index[j, c] * n_actions + u] = degree[j, c]
        slot = ants[j]
        kept = 0
        for i in range(count[slot] if greedy[j] else 0):
            p = pair[slot, i]
            e = fading * trace[slot, i]
            beta = mark[p]
            if beta > 0.0:
                e = e + beta if accumulate else max(e, beta)
                mark[p] = 0.0
            elif e <= cutoff:
                continue
            pair[slot, kept] = p
            trace[slot, kept] = e
            kept += 1
            flat[p] += learning_rate * e * error
        for c in range(index.shape[1]):
            p = index[j, c] * n_actions + u
            if mark[p] > 0.0:
                pair[slot, kept] = p
                trace[slot, kept] = mark[p]
                kept += 1
                flat[p] += learning_rate * mark[p] * error
                mark[p] = 0.0
        count[slot] = kept
