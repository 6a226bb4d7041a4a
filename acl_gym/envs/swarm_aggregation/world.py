"""The one world that all agents share: those that learn, and those that follow a rule."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from acl_gym.envs.swarm_aggregation.boxes import look_in_boxes, tree_of_boxes
from acl_gym.envs.swarm_aggregation.kernels import look_around
from acl_gym.envs.swarm_aggregation.system import MOST_WITHOUT_RADIUS, SwarmAggregation
from acl_gym.swarm.aggregation import forces_within
from acl_gym.swarm.aggregation.particles import shortened
from acl_gym.swarm.cells import sort_into_cells
from acl_gym.swarm.rows import check_room
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray

TRAIL = 12
"""Steps of the past that a picture shows."""

_MOST_DRAWS = 10_000
_CROWD = 200  # agents in the cell of an agent, on average, from which boxes are faster
_BYTES_AN_AGENT = 500  # of states, cells and what is observed
_BYTES_A_NEIGHBOUR = 100  # of the two numbers observed of it, and of their bounds


class Look(NamedTuple):
    """What agents see of each other, see `look_around`.

    Attributes:
        heard: how many others each agent hears, `(n,)`.
        towards: the mean of their positions relative to it, `(n, 2)`; 0 if there is none.
        collisions: how many others it collides with, `(n,)`.
        nearest: the relative positions of the nearest ones, `(n, 2 k)`.
    """

    heard: IntArray
    towards: FloatArray
    collisions: IntArray
    nearest: FloatArray


class Outcome(NamedTuple):
    """What a step came to, for each learner.

    Attributes:
        rewards: minus the stage costs, `(learners,)`.
        distance: from the centre of all agents, `(learners,)`.
        collisions: with agents and obstacles, `(learners,)`.
    """

    rewards: FloatArray
    distance: FloatArray
    collisions: IntArray


class Scene(NamedTuple):
    """What a picture shows.

    Attributes:
        positions: of all agents, learners first, `(n, 2)`.
        speeds: how fast they moved in the last step, `(n,)`.
        learners: how many learn.
        trail: earlier positions, the oldest first, `(steps, n, 2)`.
    """

    positions: FloatArray
    speeds: FloatArray
    learners: int
    trail: FloatArray


class World:
    """The states of all agents, learners first, and how they change.

    Args:
        system: the parameters.
        learners: how many agents are moved by actions, >= 1.
        followers: how many follow the potential rule, where the system does not say.
        keep_trail: whether to keep positions for pictures.

    Attributes:
        states: `(n, state_size)`; None before the first `start`.

    Raises:
        ValueError: there is no memory for so many agents, or a step would take too long
            without a sensing radius.
    """

    def __init__(
        self,
        system: SwarmAggregation,
        learners: int,
        followers: int,
        keep_trail: bool = False,
    ) -> None:
        self.system = system
        self.learners = learners
        count = followers if system.followers is None else system.followers
        self.n = learners + count
        check_room(
            self.n * system.nearest,
            "use fewer agents, or a smaller nearest",
            n_agents=self.n,
            bytes_an_agent=_BYTES_AN_AGENT,
            bytes_a_link=_BYTES_A_NEIGHBOUR,
        )
        follows = self.n > learners or system.observe == "potential"
        if follows and system.sensing_radius is None and self.n > MOST_WITHOUT_RADIUS:
            raise ValueError(
                f"there must be at most {MOST_WITHOUT_RADIUS:,} agents where each follows "
                f"or observes what all others do to it, got {self.n:,}; set "
                "sensing_radius, then the time of a step grows linearly with the agents."
            )
        self.states: FloatArray | None = None
        self._space = system.observation_space
        self._moved = np.zeros((self.n, 2))
        self._trail: deque[FloatArray] = deque(maxlen=TRAIL if keep_trail else 0)
        self._look: Look | None = None  # of the present states
        self._rule: FloatArray | None = None

    @property
    def positions(self) -> FloatArray:
        """Where all agents are, `(n, 2)`, a view."""
        return self._known[:, :2]

    @property
    def _known(self) -> FloatArray:
        if self.states is None:
            raise RuntimeError("the world has no states before start().")
        return self.states

    def start(self, rng: np.random.Generator, given: FloatArray | None = None) -> None:
        """Put all agents into the world, at random and at rest where none are given.

        Args:
            rng: of the positions.
            given: states of the first agents, `(m, state_size)`.
        """
        known = 0 if given is None else len(given)
        self.states = np.zeros((self.n, self.system.state_size))
        if given is not None:
            self.states[:known] = given
        self.states[known:, :2] = self._free_places(rng, self.n - known)
        self._moved[:] = 0.0
        self._trail.clear()
        self._forget()

    def place(
        self,
        agents: IntArray,
        rng: np.random.Generator,
        given: FloatArray | None = None,
    ) -> None:
        """Put some agents elsewhere; the others stay as they are, to the last bit.

        Args:
            agents: their numbers, `(m,)`.
            rng: of the positions.
            given: their states, `(m, state_size)`; None draws them.
        """
        states = self._known
        states[agents] = 0.0
        if given is None:
            states[agents, :2] = self._free_places(rng, agents.size)
        else:
            states[agents] = given
        self._moved[agents] = 0.0
        for earlier in self._trail:  # no line leads from where they were
            earlier[agents] = states[agents, :2]
        self._forget()

    def step(self, inputs: FloatArray) -> Outcome:
        """Move all agents for a time step.

        Args:
            inputs: velocities or forces of the learners, `(learners, 2)`.
        """
        system, before = self.system, self._known
        u = inputs
        if self.n > self.learners:
            u = np.concatenate([inputs, self.rule_inputs()[self.learners :]])
        states = system.particles.advance(before, u, system.time_step)
        if system.point_mass:
            states[:, 2:] = shortened(states[:, 2:], system.max_speed)
            # Rounding may lead beyond a limit by the last bit.
            np.clip(
                states[:, 2:], -system.max_speed, system.max_speed, out=states[:, 2:]
            )
        stopped = self._stay_inside(states, before[:, :2])
        self._moved = (states[:, :2] - before[:, :2]) / system.time_step
        if self._trail.maxlen:
            self._trail.append(before[:, :2].copy())
        self.states = states
        self._forget()
        return self._outcome(stopped)

    def observe(self) -> FloatArray:
        """What each learner observes, a new array `(learners, size)`."""
        system, m = self.system, self.learners
        columns = [self._known[:m, 2:]] if system.point_mass else []
        if system.observe == "potential":
            columns.append(self.rule_inputs()[:m])
        else:
            look = self.look()
            if system.sensing_radius is not None:
                columns.append(look.heard[:m, None] / max(1, self.n - 1))
            columns = [self._known[:m, :2], *columns]
            columns += [look.towards[:m], look.nearest[:m]]
        seen = np.concatenate(columns, axis=1)
        # Rounding may lead beyond a bound by the last bit.
        return np.clip(seen, self._space.low, self._space.high, out=seen)

    def look(self) -> Look:
        """What agents see of each other in the present states."""
        if self._look is None:
            self._look = self._looked()
        return self._look

    def rule_inputs(self) -> FloatArray:
        """What the potential rule would have each agent do now, `(n, 2)`.

        The mean of g(x_i - x_j), (6.5), over the agents that it hears, minus the
        gradient of the profile and of the obstacles' potential. The mean in place of the
        sum makes one time step fit swarms of any size. What is too large is shortened.
        """
        if self._rule is None:
            system, x = self.system, self.positions
            force = forces_within(x, system.interaction, system.reach)
            force /= np.maximum(self.look().heard, 1)[:, None]
            for part in (system.profile, system.walls):
                if part is not None:
                    force -= part.gradient(x)
            self._rule = shortened(force, system.largest_input)
        return self._rule

    def scene(self) -> Scene:
        """What a picture of the present states shows."""
        trail = np.array(self._trail).reshape(-1, self.n, 2)
        speeds = np.hypot(self._moved[:, 0], self._moved[:, 1])
        return Scene(self.positions.copy(), speeds, self.learners, trail)

    def _forget(self) -> None:
        """The states have changed."""
        self._look = self._rule = None

    def _looked(self) -> Look:
        system, x, n = self.system, np.ascontiguousarray(self.positions), self.n
        if system.sensing_radius is None:
            # All others' positions relative to it: their sum minus n times its own.
            heard, towards = np.full(n, n - 1), x.sum(axis=0) - n * x
        else:
            heard, towards = np.empty(n, np.int64), np.empty((n, 2))
        collisions = np.empty(n, np.int64)
        nearest = np.empty((n, 2 * system.nearest))
        side = max(system.collision_distance, self._cell_side(x))
        cells = sort_into_cells(x, side)
        if system.sensing_radius is None and _crowd(cells[1]) > _CROWD:
            tree = tree_of_boxes(x)
            look_in_boxes(tree, system.collision_distance, collisions, nearest)
        else:
            look_around(
                cells,
                system.reach,
                system.collision_distance,
                heard,
                towards,
                collisions,
                nearest,
            )
        towards /= np.maximum(heard, 1)[:, None]
        return Look(heard, towards, collisions, nearest)

    def _cell_side(self, x: FloatArray) -> float:
        """A width of cells that lets agents look at few others in vain."""
        if self.system.sensing_radius is not None:
            return self.system.sensing_radius
        width, height = np.ptp(x, axis=0)
        # Three by three cells hold the nearest ones, if agents are spread evenly.
        side = math.sqrt(width * height * (self.system.nearest + 1) / (4.0 * self.n))
        return side if side > 0 else self.system.half_width

    def _stay_inside(self, states: FloatArray, before: FloatArray) -> BoolArray:
        """Stop agents at walls and obstacles, in place; which ones hit an obstacle.

        Args:
            states: where they would be, `(n, state_size)`.
            before: where they were, `(n, 2)`.
        """
        edge, places = self.system.half_width, states[:, :2]
        if self.system.point_mass:
            states[:, 2:][np.abs(places) > edge] = 0.0
        np.clip(places, -edge, edge, out=places)
        if self.system.walls is None:
            return np.zeros(self.n, np.bool_)
        stopped = self.system.walls.stop(places, before)
        # No room between an obstacle and a wall of the world.
        beyond = stopped & (np.abs(places) > edge).any(axis=1)
        places[beyond] = before[beyond]
        states[stopped, 2:] = 0.0
        return stopped

    def _outcome(self, stopped: BoolArray) -> Outcome:
        system, m, x = self.system, self.learners, self.positions
        away = x[:m] - x.mean(axis=0)
        distance = np.hypot(away[:, 0], away[:, 1])
        collisions = self.look().collisions[:m] + stopped[:m]
        cost = system.distance_weight * distance + system.collision_weight * collisions
        if system.profile is not None:
            height = system.profile.value(x[:m]) - system.profile.least
            cost += system.profile_weight * height
        return Outcome(0.0 - cost, distance, collisions)

    def _free_places(self, rng: np.random.Generator, count: int) -> FloatArray:
        """Positions in the world beside the obstacles, uniform, `(count, 2)`."""
        edge, walls = self.system.half_width, self.system.walls
        places = rng.uniform(-edge, edge, (count, 2))
        if walls is None or not count:
            return places
        for _ in range(_MOST_DRAWS):
            again = np.flatnonzero(walls.inside(places))
            if not again.size:
                return places
            places[again] = rng.uniform(-edge, edge, (again.size, 2))
        raise ValueError(
            f"obstacles must leave room for agents, got none in {_MOST_DRAWS:,} draws; "
            "make them smaller."
        )


def _crowd(first: IntArray) -> float:
    """How many agents are in the cell of an agent, on average over the agents.

    Args:
        first: where the agents of each cell begin, and where the last end.
    """
    counts = np.diff(first).astype(np.float64)
    return float(counts @ counts / first[-1])
