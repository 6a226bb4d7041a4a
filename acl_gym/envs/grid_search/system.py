"""The grid searches of §3.6.2 and §3.6.6: cells, moves and the exact model."""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from acl_gym.envs.control.families import NumberedSystem
from acl_gym.envs.control.signals import Signals
from acl_gym.envs.grid_search import kernels
from acl_gym.envs.grid_search.maps import FREE, GOAL, MAPS, WALL, checked_map, load_map
from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray

LEAST_PROBABILITY = 1e-9
"""The smallest probability that a move succeeds. T grows by one over it, and with a smaller
one no evaluation would come to its end."""

NORTH, SOUTH, EAST, WEST = (-1, 0), (1, 0), (0, 1), (0, -1)  # row, column


class Outcomes(NamedTuple):
    """The exact transition model: what may follow each state and action.

    Each array has shape `(n_states, n_actions, k)`, with k outcomes: 1 if moves never
    fail, else 2, the move carried out and the move failed.

    Attributes:
        probability: float64, > 0, sums to 1 over the outcomes.
        next_state: int64.
        reward: float64.
        terminated: bool.
    """

    probability: FloatArray
    next_state: IntArray
    reward: FloatArray
    terminated: BoolArray


class GridSearch(NumberedSystem):
    """What the grids share: cells, moves and their outcomes.

    A state is the index of a cell that is no obstacle, counted from 0 row by row from
    the north-west corner, goals included. A step costs 1. A move against an obstacle
    or the border, and a move that fails, leave the ant where it is and cost a step.
    """

    state_hint: ClassVar[str] = "`cells` lists the cell of each state"
    directions: ClassVar[tuple[tuple[int, int], ...]]
    """Of each action: how many rows and columns it moves by."""

    transition_probability: float
    mask_blocked: bool

    @property
    @abstractmethod
    def rows(self) -> tuple[str, ...]:
        """The map, from north to south: `#` obstacle, `.` free, `G` goal."""

    def _check_moves(self) -> None:
        p = validation.number(
            "transition_probability",
            self.transition_probability,
            at_least=LEAST_PROBABILITY,
            at_most=1,
        )
        object.__setattr__(self, "transition_probability", p)
        mask = validation.boolean("mask_blocked", self.mask_blocked)
        object.__setattr__(self, "mask_blocked", mask)

    @cached_property
    def _map(self) -> NDArray[np.str_]:
        return np.array([list(row) for row in self.rows])

    @cached_property
    def _goal(self) -> BoolArray:
        """Whether each state is a goal."""
        return np.asarray(self._map[self._map != WALL] == GOAL, dtype=np.bool_)

    @cached_property
    def _next_state(self) -> IntArray:
        """Where each action leads if it is carried out, `(n_states, n_actions)`."""
        # A ring of obstacles around the world makes its border one of them.
        index = np.full(np.add(self._map.shape, 2), -1)
        row, column = (self.cells + 1).T
        index[row, column] = np.arange(row.size)
        ahead = [index[row + down, column + right] for down, right in self.directions]
        stay = index[row, column][:, None]
        moved = np.stack(ahead, axis=1)
        return np.where(moved < 0, stay, moved)

    @cached_property
    def _offered(self) -> BoolArray:
        """Whether each action leads to another state, `(n_states, n_actions)`."""
        return np.asarray(self._next_state != np.arange(self.n_states)[:, None])

    @property
    def n_states(self) -> int:
        """The number of cells that are not obstacles, goals included."""
        return int(self._goal.size)

    @property
    def cells(self) -> IntArray:
        """The row and column of each state, `(n_states, 2)`, a new array."""
        return np.argwhere(self._map != WALL)

    @property
    def goal_states(self) -> IntArray:
        """The states that are goals, in order, a new array."""
        return np.flatnonzero(self._goal)

    # The base has class attributes here; in the grids they follow from parameters.
    @property
    def draws_per_step(self) -> int:  # type: ignore[override]
        """1 number decides whether a move succeeds; 0 if moves never fail."""
        return int(self.transition_probability < 1.0)

    @property
    def evaluation_steps(self) -> int:  # type: ignore[override]
        """T = 5 n_states / p, rounded up.

        A decision: the thesis gives no T. A random walk of this length from a random
        state finds the goal with a probability of 0.50 on 11x11, 0.29 on 21x21,
        0.45 on 31x31 and 0.57 on the row of 10 states, where T is 50; the expected
        steps of any walk grow by 1 / p.
        """
        return math.ceil(5 * self.n_states / self.transition_probability)

    @property
    def observation_space(self) -> spaces.Discrete:
        """One number for each state."""
        return spaces.Discrete(self.n_states)

    @property
    def action_space(self) -> spaces.Discrete:
        """One action for each direction."""
        return spaces.Discrete(len(self.directions))

    @property
    def signals(self) -> Signals:
        """The number of the cell is observed, a move is made."""
        moves = tuple((float(south), float(east)) for south, east in self.directions)
        return Signals(
            ("number of the cell",),
            ("rows to the south", "columns to the east"),
            moves,
        )

    @property
    def max_stage_cost(self) -> float:
        """1, the cost of every step."""
        return 1.0

    def sample_states(self, rng: np.random.Generator, count: int) -> FloatArray:
        """Draw states uniformly over those that are not goals, shape `(1, count)`."""
        starts = np.flatnonzero(~self._goal)
        drawn = starts[rng.integers(starts.size, size=(1, count))]
        return drawn.astype(np.float64)

    def advance(
        self,
        states: FloatArray,
        actions: IntArray,
        uniforms: FloatArray | None,
        rewards: FloatArray,
        reached: BoolArray,
    ) -> None:
        """One move of each ant; see `ControlSystem.advance`.

        Moves from a goal state behave like any other move.
        """
        if uniforms is None:
            kernels.move(
                states[0], actions, self._next_state, self._goal, rewards, reached
            )
        else:
            kernels.move_or_fail(
                states[0],
                actions,
                uniforms[0],
                self.transition_probability,
                self._next_state,
                self._goal,
                rewards,
                reached,
            )

    def outcomes(self) -> Outcomes:
        """Return the exact transition model, new arrays.

        Goals absorb here: they lead to themselves with reward 0 and `terminated`.
        """
        shape = self._next_state.shape
        stay = np.broadcast_to(np.arange(self.n_states)[:, None], shape)
        follow, chance = [self._next_state], [self.transition_probability]
        if self.draws_per_step:
            follow, chance = [*follow, stay], [*chance, 1.0 - chance[0]]
        absorbed = self._goal[:, None, None]
        next_state = np.where(absorbed, stay[..., None], np.stack(follow, axis=-1))
        return Outcomes(
            probability=np.broadcast_to(chance, next_state.shape).copy(),
            next_state=next_state,
            reward=np.where(absorbed, 0.0, -np.ones(next_state.shape)),
            terminated=self._goal[next_state],
        )

    def action_mask(self, states: FloatArray) -> BoolArray | None:
        """Return which moves of each state are not blocked, if `mask_blocked`."""
        if not self.mask_blocked:
            return None
        return np.asarray(self._offered[states[0].astype(np.int64)], dtype=np.bool_)

    def evaluation_states(self) -> FloatArray:
        """Return every state that is not a goal, `(n, 1)`."""
        return np.flatnonzero(~self._goal).astype(np.float64)[:, None]


MOST_STATES = 1_000_000
"""Of a row: tables of what each move leads to are made for all of them."""


@dataclass(frozen=True, kw_only=True)
class GridSearch1D(GridSearch):
    """A row of states (§3.6.2); actions 0 west, 1 east; the goal is the last state.

    Attributes:
        n_states: the length of the row, goal included, 2 to 1,000,000.
        transition_probability: p, in [1e-9, 1]: a move fails with probability 1 - p.
        mask_blocked: whether infos carry `"action_mask"`, U_q of (3.4), which leaves
            out the blocked move of the first state.
    """

    directions: ClassVar[tuple[tuple[int, int], ...]] = (WEST, EAST)

    n_states: int = 10
    transition_probability: float = 1.0
    mask_blocked: bool = False

    def __post_init__(self) -> None:
        n_states = validation.integer(
            "n_states", self.n_states, at_least=2, at_most=MOST_STATES
        )
        object.__setattr__(self, "n_states", n_states)
        self._check_moves()

    @property
    def rows(self) -> tuple[str, ...]:
        """One row with the goal at its east end."""
        return (FREE * (self.n_states - 1) + GOAL,)


@dataclass(frozen=True, kw_only=True)
class GridSearch2D(GridSearch):
    """A world of walls (§3.6.6); actions 0 north, 1 south, 2 east, 3 west.

    Attributes:
        map_name: "11x11", "21x21" or "31x31", with 86, 278 and 640 free cells and the
            goal in the centre. A decision: the maps of the thesis are not available;
            `maps` made these. The mean shortest path has 9.99, 19.85 and 19.97 steps.
        desc: a map of your own, as text or as a sequence of rows, instead of
            `map_name`: `#` obstacle, `.` free, `G` goal, one or more.
        transition_probability: p, in [1e-9, 1]: a move fails with probability 1 - p.
        mask_blocked: whether infos carry `"action_mask"`, U_q of (3.4), which leaves
            out the moves against obstacles and the border. The environment still
            takes such a move: the ant stays where it is.
    """

    directions: ClassVar[tuple[tuple[int, int], ...]] = (NORTH, SOUTH, EAST, WEST)

    map_name: str = "11x11"
    desc: str | tuple[str, ...] | None = None
    transition_probability: float = 1.0
    mask_blocked: bool = False

    def __post_init__(self) -> None:
        validation.one_of("map_name", self.map_name, tuple(MAPS))
        if self.desc is not None:
            object.__setattr__(self, "desc", checked_map(self.desc))
        self._check_moves()

    @property
    def rows(self) -> tuple[str, ...]:
        """The rows of `desc`, or of the map of that name."""
        return load_map(self.map_name) if self.desc is None else tuple(self.desc)
