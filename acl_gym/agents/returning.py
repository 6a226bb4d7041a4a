"""The colony that remembers: ants walk back and lay what they know by then."""

from __future__ import annotations

from typing import Any, Self

import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import ArrayLike

from acl_gym.agents.base import TabularAgent
from acl_gym.agents.training import Training
from acl_gym.callbacks.base import Callbacks
from acl_gym.colony.greedy import epsilon_greedy_actions, epsilon_greedy_unchecked
from acl_gym.colony.memory import Memory, Walk
from acl_gym.colony.optimism import promised_levels
from acl_gym.colony.walking_back import WalkBack
from acl_gym.partitions import Discrete, Grid, Partition
from acl_gym.partitions.automatic import coarse_partition
from acl_gym.partitions.refinement import carried_over, refined
from acl_gym.policies import random_ranks
from acl_gym.utils import validation
from acl_gym.utils.parameters import Parameter
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray, IntArray

_SAMPLE = 20_000  # newest remembered states from which the initial level is taken


class ReturningACL(TabularAgent):
    """x"""

    slots_are = "ants"

    discount = Parameter(
        "Weight of what follows a step", "gamma_rl", at_least=0, at_most=1
    )
    learning_rate = Parameter(
        "Share of the way to the mean of what is laid", "rho", above=0, at_most=1
    )
    trust = Parameter(
        "Whether a level follows the latest paths, 0, or the mean of all, 1",
        at_least=0,
        at_most=1,
    )
    epsilon = Parameter(
        "Probability of a random action", "epsilon", at_least=0, at_most=1
    )
    optimism = Parameter("q", at_least=0, at_most=1)

    def __init__(
        self,
        env: VectorEnv[Any, Any, Any] | None,
        partition: Partition | None = None,
        *,
        discount: float = 0.99,
        mix: float | None = None,
        learning_rate: float = 0.9,
        trust: float = 1.0,
        epsilon: float = 0.1,
        optimism: float = 0.5,
        walks_back: int = 10,
        older_paths: int = 50,
        steps_per_walk: int = 300,
        memory: int = 100_000,
        visits_to_grow: float | None = 4.0,
        max_cells: int = 20_000,
        ranging: bool = True,
        varied: bool = True,
        turns: int = 1,
        sure: bool = True,
        widen: float | None = None,
        finest: float = 0.01,
        local: Any = None,
        max_steps: int | None = None,
        seed: int | None = None,
        n_actions: int | None = None,
    ) -> None:
        self.discount = discount
        self.learning_rate = learning_rate
        self.trust = trust
        self.epsilon = epsilon
        self.optimism = optimism
        self.walks_back, self.older_paths = walks_back, older_paths
        self.steps_per_walk = steps_per_walk
        self.visits_to_grow, self.max_cells = visits_to_grow, max_cells
        if partition is None and env is not None:
            partition = coarse_partition(env, ranging)
        super().__init__(
            env, partition, max_steps=max_steps, seed=seed, n_actions=n_actions
        )
        self.mix = (0.0 if isinstance(self.partition, Discrete) else 0.2) if mix is None else mix
        self._level = 0.0
        self.stretched = 0
        self.sure = sure
        self.widen, self.local, self.finest = widen, local, finest
        self.ranging, self.varied, self.turns = ranging, varied, turns
        if env is not None and ranging and isinstance(self.partition, Grid):
            from acl_gym.utils.boxes import declared_bounds
            self._declared = declared_bounds(env.single_observation_space)
        self._growths = 0
        self._walk_back = WalkBack(np.zeros((self.partition.n_cells, self.n_actions)))
        self.memory = Memory(memory, self.n_actions, self.partition)

    def learn(
        self,
        total_timesteps: int | None = None,
        trials: int | None = None,
        callback: Callbacks = None,
        log_interval: int | None = None,
        progress_bar: bool = False,
    ) -> Self:
        budget = (total_timesteps, trials, callback, log_interval, progress_bar)
        with Training(self, *budget) as training:
            while training.next_trial():
                rollout = self.rollout
                observation = rollout.start(seed=self._next_seed())
                while rollout._ants.size:
                    walk, observation = self._walk(observation)
                    newest = self.memory.add(walk, rollout.terminated)
                    self._stretch()
                    self._promise()
                    for _ in range(self.walks_back):
                        self._return(newest)
                    self._grow()
                training.end_trial()
        return self

    def _walk(self, observation: Any) -> tuple[Walk, Any]:
        """Let the ants walk until they have made enough steps together."""
        rollout, walk = self.rollout, Walk(self.num_envs)
        while rollout._ants.size and walk.steps < self.steps_per_walk:
            ants, allowed = rollout._ants, rollout.allowed()
            index, degree = self._locate(observation, ants)
            actions = epsilon_greedy_unchecked(
                self._table, index, degree, self.epsilon, self.rng, allowed
            )
            step = rollout._step(actions)
            walk.append(ants, observation, actions, -step.cost, allowed)
            observation = step.observation
            if step.finished.any():
                self._stop(walk, ants[step.finished], observation)
        if rollout._ants.size:
            self._stop(walk, rollout._ants, observation)
        return walk, observation

    def _stop(self, walk: Walk, ants: IntArray, observation: Any) -> None:
        mask = self.rollout.action_mask
        if mask is not None:
            mask = mask[ants]
            mask[~mask.any(axis=1)] = True
        walk.stop(ants, observation, mask)

    def _promise(self) -> None:
        """Set what pairs promise of which nothing is known yet."""
        self._level = promised_levels(
            self.memory, self._table, self.optimism, self.discount, _SAMPLE
        )
        self._table[~self._walk_back.known] = self._level

    def _return(self, newest: IntArray) -> None:
        older = self.memory.n_paths - newest.size
        paths = newest
        if older > self.older_paths:
            drawn = self.rng.integers(older, size=self.older_paths)
            paths = np.concatenate([np.unique(drawn), newest])
        elif older:
            paths = np.arange(self.memory.n_paths)
        self._walk_back.walk(
            self.memory,
            paths,
            discount=self.discount,
            mix=self.mix,
            rate=self.learning_rate,
            trust=self.trust,
        )

    def _grow(self) -> None:
        grid = self.partition
        if self.visits_to_grow is None or not isinstance(grid, Grid):
            return
        axes = [a for a, line in enumerate(grid.centres) if line.size > 1]
        if self.local:
            for a in np.roll(axes, -(self._growths % len(axes))):
                where = self._ready(a)
                if where.any():
                    finer = refined(grid, int(a), where)
                    if finer.n_cells <= self.max_cells:
                        self._growths += 1
                        self._become(finer)
                    return
            return
        tried = self.memory.evidence[self.memory.evidence > 0]
        visits = float(np.median(tried)) / 2**36 * grid.cells_per_state
        if visits <= self.visits_to_grow:
            return
        turn = len(axes) if self.varied else 10**9
        if self._growths < turn * self.turns:
            axis = axes[self._growths % len(axes)]
        else:
            axis = max(axes, key=self._variation)
        finer = refined(grid, axis)
        if finer.n_cells > self.max_cells:
            return
        self._growths += 1
        self._become(finer)

    def _ready(self, axis):
        grid = self.partition
        shape = tuple(line.size for line in grid.centres) + (self.n_actions,)
        e = self.memory.evidence.reshape(shape) / 2**36 * grid.cells_per_state
        e = np.moveaxis(e, axis, 0).reshape(shape[axis], -1)
        n = (e > 0).sum(axis=1)
        if self.local == "mean":
            v = e.sum(axis=1) / np.maximum(n, 1)
        else:
            v = np.array([np.median(row[row > 0]) if (row > 0).any() else 0.0 for row in e])
        if grid.periods[axis] is not None:
            v = np.append(v, v[0])
        width = np.diff(grid.centres[axis]) if grid.periods[axis] is None else np.diff(np.append(grid.centres[axis], grid.centres[axis][0] + grid.periods[axis]))
        span = width.sum()
        return (np.minimum(v[:-1], v[1:]) > self.visits_to_grow) & (width > self.finest * span)

    def _variation(self, axis: int) -> float:
        """How often the policy differs between neighbours along an axis, by evidence."""
        shape = tuple(line.size for line in self.partition.centres)
        best = self._table.argmax(axis=1).reshape(shape)
        tried = self.memory.evidence.reshape(-1, self.n_actions).sum(axis=1)
        tried = tried.reshape(shape).astype(float)
        n = shape[axis]
        a, b = (np.take(tried, r, axis) for r in (range(n - 1), range(1, n)))
        x, y = (np.take(best, r, axis) for r in (range(n - 1), range(1, n)))
        weight = np.minimum(a, b)
        return float((weight * (x != y)).sum() / max(weight.sum(), 1e-300))

    def _stretch(self) -> None:
        grid = self.partition
        if not self.ranging or not isinstance(grid, Grid):
            return
        m = self.memory
        seen = m._rows["seen"][int(m.first[0]) : m._used]
        low, high = seen.min(axis=0), seen.max(axis=0)
        axes, changed = list(grid.centres), False
        for a, line in enumerate(axes):
            if grid.periods[a] is not None:
                continue
            if low[a] < line[0] - 1e-9 or high[a] > line[-1] + 1e-9 or line.size == 1 and high[a] > low[a]:
                dl, dh = self._declared
                new = line
                if self.widen is None:
                    lo, hi = min(low[a], line[0]), max(high[a], line[-1])
                    margin = 0.1 * (hi - lo)
                    lo = max(lo - margin, dl[a]) if low[a] < line[0] else lo
                    hi = min(hi + margin, dh[a]) if high[a] > line[-1] else hi
                    if lo < line[0] or hi > line[-1]:
                        axes[a] = np.linspace(lo, hi, line.size)
                        changed = True
                    continue
                if line.size == 1:
                    continue
                if low[a] < line[0] - 1e-9:
                    gap = max(self.widen * (line[1] - line[0]), line[0] - low[a])
                    lo = max(line[0] - gap, dl[a])
                    if lo < line[0] - 1e-6: new = np.concatenate([[lo], new])
                if high[a] > line[-1] + 1e-9:
                    gap = max(self.widen * (line[-1] - line[-2]), high[a] - line[-1])
                    hi = min(line[-1] + gap, dh[a])
                    if hi > line[-1] + 1e-6: new = np.concatenate([new, [hi]])
                if new is not line:
                    axes[a] = new
                    changed = True
        if changed:
            self.stretched += 1
            self._become(type(grid)(axes, grid.periods))

    def _become(self, finer: Any) -> None:
        grid = self.partition
        known = carried_over(self._walk_back.known.astype(float), grid, finer) > 1 - 1e-9
        table = carried_over(self._table, grid, finer)
        self.__dict__["partition"] = finer
        self._walk_back = WalkBack(table)
        self._walk_back.known[:] = known
        self.memory.set_partition(finer)
        self._ranks = random_ranks(finer.n_cells, self.n_actions, np.random.default_rng(self._growths))

    @property
    def _table(self) -> FloatArray:
        return self._walk_back.levels

    def set_table(self, table: ArrayLike) -> None:
        self._table[:] = self._checked_table(table)

    def parameters(self) -> dict[str, Any]:
        return {}

    def _sure(self):
        """levels of what is known; of unknown pairs the worst known in the cell"""
        known, t = self._walk_back.known, self._table
        if known.all() or not self.sure: return t
        low = np.where(known, t, np.inf).min(axis=1)
        low = np.where(np.isfinite(low), low, t.min(axis=1))
        return np.where(known, t, np.minimum(low[:, None], t))

    @property
    def policy(self):
        from acl_gym.policies import TablePolicy
        return TablePolicy(self.partition, np.ascontiguousarray(self._sure()), self._ranks, self.first_action, self._signals)

    def _explore(
        self, index: CellArray, degree: FloatArray, allowed: BoolArray | None
    ) -> IntArray:
        return epsilon_greedy_actions(
            self._table, index, degree, self.epsilon, self._predict_rng, allowed
        )
