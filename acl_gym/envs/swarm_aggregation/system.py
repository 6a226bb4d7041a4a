"""The parameters of the swarm that aggregates, and what follows from them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces

from acl_gym.swarm.aggregation import (
    BoundedRepulsion,
    Gaussians,
    Kinematic,
    Obstacles,
    Particles,
    PointMass,
)
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray

OBSERVATIONS = ("neighbours", "potential")
"""What agents may observe, see `SwarmAggregation.observe`."""

MOST_FOLLOWERS = 1_000_000

MOST_WITHOUT_RADIUS = 20_000
"""Agents of the potential rule that all hear each other: a step takes O(n^2) time."""

LEAST, MOST = 1e-9, 1e9
"""Limits of all numbers, so that costs and forces are finite."""

_POSITIVE = ("max_speed", "time_step", "half_width", "spread", "mass", "max_force")
_NOT_NEGATIVE = (
    *("damping", "attraction", "repulsion", "collision_distance"),
    *("distance_weight", "collision_weight", "profile_weight"),
)
_POSITIVE_RANGE = validation.Range(at_least=LEAST, at_most=MOST)


@dataclass(frozen=True, kw_only=True)
class SwarmAggregation:
    """A square world in which agents move, meet and avoid each other.

    Numbers are the same for all agents, at most 1e9 in size, and at least 1e-9 where they
    must be > 0.

    Attributes:
        followers: how many agents share the world that learn nothing and follow the
            potential rule, >= 0; None: 9 in the single environment, none in the vector
            environment. More than 20,000 agents need a `sensing_radius` where there are
            followers or `observe` is "potential", because all would hear each other.
        point_mass: whether agents have inertia and are moved by forces; otherwise they
            move at the velocity that they choose, (6.4).
        continuous: whether an action is a real velocity or force, in place of one of
            a few directions.
        directions: how many directions there are to choose from, >= 2, evenly spread
            and beginning with the one along the first axis.
        observe: "neighbours": the own position, the mean of those heard and the nearest
            ones; "potential": only the input that the potential rule (6.5) would take.
        nearest: how many nearest agents are observed, >= 0.
        sensing_radius: sigma, > 0: agents hear those that are closer; None: all.
        max_speed: > 0, lengths a second; larger velocities are shortened to it.
        max_force: > 0, of a point mass; larger forces are shortened to it.
        mass: > 0, of a point mass.
        damping: >= 0, the force of friction on a point mass at unit speed.
        time_step: > 0, seconds, how long an action is held.
        half_width: > 0: the world is the square [-half_width, half_width]^2, whose walls
            stop agents.
        attraction: a of the potential rule, >= 0.
        repulsion: b of the potential rule, >= 0.
        spread: c of the potential rule, > 0; two followers rest at the distance
            sqrt(c ln(b / a)), 0.774 by default.
        collision_distance: >= 0: two agents that are closer collide.
        distance_weight: >= 0, cost of a unit of distance from the centre of all agents.
        collision_weight: >= 0, cost of one collision, with an agent or an obstacle.
        valleys: rows (x, y, depth, width) of Gaussian valleys, or hills where the depth
            is < 0, which make up the profile of the world.
        profile_weight: >= 0, cost of a unit of height in the profile.
        obstacles: rows (x, y, radius) of round obstacles inside the world, which agents
            do not enter.
    """

    evaluation_steps: ClassVar[int] = 100
    """T, the longest episode."""

    followers: int | None = None
    point_mass: bool = False
    continuous: bool = False
    directions: int = 4
    observe: str = "neighbours"
    nearest: int = 1
    sensing_radius: float | None = None
    max_speed: float = 1.0
    max_force: float = 1.0
    mass: float = 1.0
    damping: float = 1.0
    time_step: float = 0.2
    half_width: float = 5.0
    attraction: float = 1.0
    repulsion: float = 20.0
    spread: float = 0.2
    collision_distance: float = 0.2
    distance_weight: float = 1.0
    collision_weight: float = 1.0
    valleys: tuple[tuple[float, float, float, float], ...] = ()
    profile_weight: float = 1.0
    obstacles: tuple[tuple[float, float, float], ...] = ()

    def __post_init__(self) -> None:
        values: dict[str, Any] = {
            "directions": validation.integer(
                "directions", self.directions, at_least=2, at_most=360
            ),
            "nearest": validation.integer(
                "nearest", self.nearest, at_least=0, at_most=1_000
            ),
            "observe": validation.one_of("observe", self.observe, OBSERVATIONS),
        }
        if self.followers is not None:
            values["followers"] = validation.integer(
                "followers", self.followers, at_least=0, at_most=MOST_FOLLOWERS
            )
        for name in ("point_mass", "continuous"):
            values[name] = validation.boolean(name, getattr(self, name))
        for name in _POSITIVE:
            values[name] = validation.number(name, getattr(self, name), _POSITIVE_RANGE)
        for name in _NOT_NEGATIVE:
            values[name] = validation.number(
                name, getattr(self, name), at_least=0, at_most=MOST
            )
        if self.sensing_radius is not None:
            values["sensing_radius"] = validation.number(
                "sensing_radius", self.sensing_radius, _POSITIVE_RANGE
            )
        values["valleys"] = _rows("valleys", self.valleys, "(x, y, depth, width)")
        values["obstacles"] = _rows("obstacles", self.obstacles, "(x, y, radius)")
        for name, value in values.items():
            object.__setattr__(self, name, value)
        self._check_places()

    @property
    def state_size(self) -> int:
        """Numbers in the state of an agent: position, and velocity of a point mass."""
        return 4 if self.point_mass else 2

    @property
    def reach(self) -> float:
        """The sensing radius, infinity if there is none."""
        return math.inf if self.sensing_radius is None else self.sensing_radius

    @property
    def largest_input(self) -> float:
        """The norm of the largest velocity or force."""
        return self.max_force if self.point_mass else self.max_speed

    @property
    def observation_space(self) -> spaces.Box:
        """See `SwarmAggregationEnv`; float64."""
        high = np.array(self._observation_bounds)
        low = -high
        if self.observe == "neighbours" and self.sensing_radius is not None:
            low[self.state_size] = 0.0  # the share of agents that are heard
        return spaces.Box(low, high, dtype=np.float64)

    @property
    def action_space(self) -> spaces.Discrete | spaces.Box:
        """0 to stay and one action for each direction, or the input itself, float64."""
        if self.continuous:
            most = self.largest_input
            return spaces.Box(-most, most, (2,), dtype=np.float64)
        return spaces.Discrete(1 + self.directions)

    @cached_property
    def inputs(self) -> FloatArray:
        """The velocity or force of each numbered action, `(1 + directions, 2)`."""
        angles = 2.0 * math.pi * np.arange(self.directions) / self.directions
        units = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        units[np.abs(units) < 1e-12] = 0.0  # which rounding has made of 0
        return np.concatenate([np.zeros((1, 2)), self.largest_input * units])

    @cached_property
    def interaction(self) -> BoundedRepulsion:
        """g of the potential rule, (6.5)."""
        return BoundedRepulsion(
            attraction=self.attraction, repulsion=self.repulsion, spread=self.spread
        )

    @cached_property
    def particles(self) -> Particles:
        """How bodies move."""
        if self.point_mass:
            return PointMass(
                mass=self.mass, damping=self.damping, max_force=self.max_force
            )
        return Kinematic(max_speed=self.max_speed)

    @cached_property
    def profile(self) -> Gaussians | None:
        """The valleys and hills, None if there are none."""
        if not self.valleys:
            return None
        rows = np.array(self.valleys)
        return Gaussians(rows[:, :2], rows[:, 2], rows[:, 3])

    @cached_property
    def walls(self) -> Obstacles | None:
        """The obstacles, None if there are none."""
        if not self.obstacles:
            return None
        rows = np.array(self.obstacles)
        # With this strength one step leads out of their reach, and not farther.
        return Obstacles(rows[:, :2], rows[:, 2], strength=1.0 / self.time_step)

    @property
    def _observation_bounds(self) -> list[float]:
        speed = [self.max_speed] * 2 if self.point_mass else []
        if self.observe == "potential":
            return [*speed, *[self.largest_input] * 2]
        share = [] if self.sensing_radius is None else [1.0]
        # Relative positions reach from one wall to the other.
        relative = [2.0 * self.half_width] * (2 + 2 * self.nearest)
        return [*[self.half_width] * 2, *speed, *share, *relative]

    def checked_states(self, states: Any) -> FloatArray:
        """Return states of agents as a new array `(n, state_size)`.

        Raises:
            ValueError: wrong shape, not finite, or outside the world.
        """
        array = validation.real_array("states", states, finite=False)
        names = "[x, y, v_x, v_y]" if self.point_mass else "[x, y]"
        if array.ndim != 2 or array.shape[1] != self.state_size:
            raise ValueError(
                f"states must be rows {names}, shape (n, {self.state_size}), got "
                f"{array.shape}."
            )
        limits = [self.half_width] * 2 + [self.max_speed] * (self.state_size - 2)
        outside = ~(np.abs(array) <= limits)
        if outside.any():
            row = int(np.flatnonzero(outside.any(axis=1))[0])
            raise ValueError(
                f"states {names} must lie within +-{limits}, got {array[row].tolist()} "
                f"in row {row}; half_width and max_speed set these limits."
            )
        if self.walls is not None and (inside := self.walls.inside(array[:, :2])).any():
            row = int(np.flatnonzero(inside)[0])
            raise ValueError(
                f"states must lie outside the obstacles, got {array[row].tolist()} in "
                f"row {row}."
            )
        return array

    def _check_places(self) -> None:
        for x, y, radius in self.obstacles:
            fits = max(abs(x), abs(y)) + radius <= self.half_width
            if not (radius >= LEAST and fits):
                raise ValueError(
                    f"obstacles must be rows (x, y, radius) with radius >= {LEAST:g} that "
                    f"lie in the world, whose half_width is {self.half_width:g}, got "
                    f"{(x, y, radius)}."
                )
        # A covered world would have no place to start.
        covered = sum(math.pi * radius**2 for *_, radius in self.obstacles)
        if covered > 0.9 * (2.0 * self.half_width) ** 2:
            raise ValueError(
                "obstacles must leave a tenth of the world free, got circles with the "
                f"area {covered:.3g} in a world with {4 * self.half_width**2:.3g}."
            )
        for valley in self.valleys:
            if valley[3] not in _POSITIVE_RANGE:
                raise ValueError(
                    f"widths of valleys must lie in {_POSITIVE_RANGE}, got "
                    f"{valley[3]:g}."
                )
            if max(map(abs, valley)) > MOST:
                raise ValueError(
                    "valleys must be rows (x, y, depth, width) of numbers of at most "
                    f"{MOST:g}, got {valley}."
                )


def _rows(name: str, given: Any, columns: str) -> tuple[tuple[float, ...], ...]:
    """Rows of numbers as plain tuples, which can be hashed and written as JSON."""
    if isinstance(given, tuple | list) and not given:
        return ()
    width = columns.count(",") + 1
    array = validation.real_array(name, given, ndim=2)
    if array.shape[1] != width:
        raise ValueError(
            f"{name} must be rows {columns}, got an array of shape {array.shape}."
        )
    return tuple(map(tuple, array.tolist()))
