"""The plants of `safe_learning`, and what is known of them: controllers and safe sets."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces

from acl_gym import plant
from acl_gym.envs.navigation import NavigationVectorEnv
from acl_gym.envs.navigation.system import Navigation
from acl_gym.envs.wrappers import StateFeedback

Array = np.ndarray
START = np.array([0.2, 0.4])  # rad, rad/s
STARTS = 100


# --- a pendulum that is held upright --------------------------------------------------


def upright(x: Array, u: Array) -> Any:
    """The pendulum of §5.2; angle from upright, rad, and angular velocity, rad/s."""
    return [x[1], 19.62 * np.sin(x[0]) - 2.0 * x[1] + 20.0 * u[0]]


def upright_cost(x: Array, u: Array) -> Array:
    """The stage cost (5.4)."""
    return x[0] ** 2 + 0.1 * x[1] ** 2 + 0.05 * u[0] ** 2


def held_states() -> Array:
    """Starts on a regular grid."""
    grid = np.meshgrid(*(np.linspace(-most, most, 10) for most in START))
    return np.stack(grid, axis=-1).reshape(-1, 2)


def held_pendulums(slots: int) -> Any:
    """Pendulums that start near upright, and are watched for 5 s."""
    return plant(
        upright,
        low=[-np.pi, -9.0],
        high=[np.pi, 9.0],
        circular=[0],
        inputs=np.linspace(-0.8, 0.8, 9),
        sampling_time=0.05,
        goal=None,
        cost=upright_cost,
        max_episode_steps=100,
        num_envs=slots,
        initial=spaces.Box(-START, START, dtype=np.float64),
        evaluation_states=held_states(),
    )


def is_upright(x: Array) -> Array:
    """Whether pendulums are within 0.5 rad."""
    return np.abs(x[:, 0]) <= 0.5


def nearly_upright(x: Array) -> Array:
    """Whether they are, and will be in 0.2 s as fast as they are now."""
    return np.abs(x[:, 0] + 0.2 * x[:, 1]) <= 0.25


POOR = StateFeedback([1.3, 0.05], [0.0, 0.0], low=-0.8, high=0.8)


# --- the vehicle of §4.5, kept away from the damped regions ---------------------------

MOST_DAMPING = 3.0  # kg/s
VEHICLE = Navigation()


def undamped(x: Array) -> Array:
    """Whether vehicles are outside the damped regions."""
    return VEHICLE.damping(x[:, 0], x[:, 2]) <= MOST_DAMPING


def will_be_undamped(x: Array) -> Array:
    """Whether they are, and would still be where they can stop, and half way to it."""
    place, speed = x[:, [0, 2]], x[:, [1, 3]]
    way = 0.5 * speed * np.abs(speed)  # at 1 m/s^2
    good = undamped(x)
    for share in (0.5, 1.0):
        reached = place + share * way
        good &= VEHICLE.damping(*reached.T) <= MOST_DAMPING
    return good


class Way:
    """Which way to go from each place: down a field of distances around the regions.

    Args:
        margin: how much less damping than allowed counts as a region, kg/s.
    """

    def __init__(self, margin: float = 1.0) -> None:
        self.places = np.linspace(-5.0, 5.0, 101)
        c1, c2 = np.meshgrid(self.places, self.places, indexing="ij")
        blocked = VEHICLE.damping(c1, c2) > MOST_DAMPING - margin
        distance = np.where(c1**2 + c2**2 < 0.01, 0.0, np.inf)
        moves = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]
        for _ in range(400):
            padded = np.pad(distance, 1, constant_values=np.inf)
            nearer = [
                padded[1 + i : 102 + i, 1 + j : 102 + j] + 0.1 * np.hypot(i, j)
                for i, j in moves
            ]
            # Ways out of a region are long, so that none leads through it.
            further = np.min(nearer, axis=0) + 10.0 * blocked
            distance = np.minimum(distance, further)
        self.slope = np.stack(np.gradient(distance, 0.1), axis=-1)
        self.distance = distance

    def __call__(self, x: Array, speed: Any) -> Array:
        """Forces, N, that hold a speed along the way; slower near the goal."""
        place, velocity = x[:, [0, 2]], x[:, [1, 3]]
        nearest = np.rint((place + 5.0) * 10.0).astype(int)
        slope = self.slope[nearest[:, 0], nearest[:, 1]]
        length = np.linalg.norm(slope, axis=1, keepdims=True)
        direction = -slope / np.maximum(length, 1e-9)
        near = np.linalg.norm(place, axis=1, keepdims=True)
        straight = -place / np.maximum(near, 1e-9)
        direction = np.where(near < 1.0, straight, direction)
        wanted = np.minimum(speed, 0.6 * near) * direction
        return 4.0 * (wanted - velocity)


WAY = Way()


def slowly(x: Array) -> Array:
    """The baseline: along the way at 0.5 m/s."""
    return WAY(x, 0.5)


class Undamped(Navigation):
    """Vehicles that begin where the slow controller stays out of the damped regions."""

    def sample_states(self, rng: np.random.Generator, count: int) -> Array:
        found = np.empty((4, 0))
        while found.shape[1] < count:
            drawn = super().sample_states(rng, 2 * count + 20)
            found = np.concatenate([found, drawn[:, self.can_start(drawn)]], axis=1)
        return found[:, :count].copy()

    def can_start(self, states: Array) -> Array:
        """Whether the slow controller stays out from here for 4 s, `(n,)`."""
        states, forces = states.copy(), np.array(self.forces)
        good = undamped(states.T)
        rewards, reached = np.empty(good.size), np.empty(good.size, dtype=bool)
        for _ in range(20):
            wanted = slowly(states.T)
            actions = np.square(wanted[:, None] - forces).sum(axis=2).argmin(axis=1)
            super().advance(states, actions, None, rewards, reached)
            good &= undamped(states.T)
        return good

    def evaluation_states(self) -> Array:
        return self.sample_states(np.random.default_rng(7), STARTS).T.copy()


class UndampedVectorEnv(NavigationVectorEnv):
    """Many of them."""

    system_type = Undamped


def vehicles(slots: int) -> Any:
    """Vehicles that have 150 steps of 0.2 s."""
    return UndampedVectorEnv(slots, max_episode_steps=150)


# --- tasks ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Task:
    """A plant, what is known of it, and how long the colony learns.

    Attributes:
        make: makes plants.
        baseline: the controller that is known.
        safe: the safe set.
        margin: a smaller one, for a shield without a model.
        look_ahead: steps that a model predicts.
        controller: the inner loop.
        cautious: parameters for it that are all safe enough.
        daring: more of them.
        steps: interactions of a run.
    """

    make: Callable[[int], Any]
    baseline: Callable[[Array], Array]
    safe: Callable[[Array], Array]
    margin: Callable[[Array], Array]
    look_ahead: int
    controller: Callable[[Array, Array], Array]
    cautious: Any
    daring: Any
    steps: int


def _gains(stiffness: Sequence[float], damping: Sequence[float]) -> list[list[float]]:
    return [[k, d] for k in stiffness for d in damping]


TASKS = {
    "hold": Task(
        make=held_pendulums,
        baseline=POOR,
        safe=is_upright,
        margin=nearly_upright,
        look_ahead=10,
        controller=StateFeedback(set_point=[0.0, 0.0], low=-0.8, high=0.8),
        cautious=_gains((1.3, 2.0, 3.0), (0.05, 0.2, 0.4)),
        daring=_gains((0.0, 1.3, 3.0), (-0.1, 0.05, 0.4)),
        steps=20_000,
    ),
    "navigation": Task(
        make=vehicles,
        baseline=slowly,
        safe=undamped,
        margin=will_be_undamped,
        look_ahead=12,
        controller=WAY,
        cautious=[0.5, 0.75, 1.0],
        daring=[0.5, 1.0, 1.5, 2.0],
        steps=40_000,
    ),
}
