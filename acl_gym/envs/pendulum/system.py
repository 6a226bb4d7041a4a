"""The pendulum swing-up of §5.2: parameters and dynamics."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from acl_gym.envs.control import parameters, sampling
from acl_gym.envs.control.families import BlockSystem
from acl_gym.envs.control.signals import Signals
from acl_gym.envs.pendulum import kernels
from acl_gym.envs.pendulum.kernels import TWO_PI
from acl_gym.utils import threads, validation
from acl_gym.utils.typing import BoolArray, FloatArray

_LARGEST_ANGLE = 1e5
"""rad; beyond it `fast_math.sine` is not valid."""


@dataclass(frozen=True, kw_only=True)
class Pendulum(BlockSystem):
    """Parameters (Table 5.1) and dynamics (5.1) of the pendulum.

    The state is x = [theta omega]: theta = 0 hangs down, theta = pi stands upright.

    Attributes:
        inertia: J, kg m^2, > 0.
        motor_gain: K_m, > 0.
        damping: D, kg m^2 / s, >= 0.
        mass: m, kg, > 0.
        length: L, m, > 0.
        gravity: g, m / s^2, >= 0.
        torques: U, N m, the torque u of each action, one or more.
        continuous: whether the torque is a real number, from the least to the largest
            of `torques`, in place of an action for each of them.
        sampling_time: T_s, s, > 0; the torque is constant over it.
        substeps: Runge-Kutta steps in one sampling time, 1 to 10,000. Measured against
            DOP853 over the whole state space, one step of the default 0.1 s is off
            by at most 5e-4 rad and 6e-3 rad/s with 1 substep, 3e-5 and 4e-4 with
            2, 2e-6 and 2e-5 with 4.
        omega_max: rad / s, > 0. Not given in the thesis; a decision: falling freely
            from upright reaches 8.86. omega is clipped to it after each step.
        goal_bounds: half-widths (rad, rad / s), > 0, of the goal region around
            x_g = [pi 0].
        state_weight: Q of (5.4), symmetric and positive semi-definite, shape (2, 2).
        torque_weight: R of (5.4), >= 0.
    """

    circular: ClassVar[tuple[int, ...]] = (0,)
    block_kernels = (kernels.advance, kernels.advance_in_parallel)

    inertia: float = 0.005
    motor_gain: float = 0.1
    damping: float = 0.01
    mass: float = 0.1
    length: float = 0.1
    gravity: float = 9.81
    torques: tuple[float, ...] = (-0.8, 0.0, 0.8)
    continuous: bool = False
    sampling_time: float = 0.1
    substeps: int = 1
    omega_max: float = 9.0
    goal_bounds: tuple[float, float] = (0.1, 0.1)
    state_weight: tuple[tuple[float, float], tuple[float, float]] = (
        (1.0, 0.0),
        (0.0, 0.1),
    )
    torque_weight: float = 0.05

    def __post_init__(self) -> None:
        for name in ("inertia", "motor_gain", "mass", "length", "sampling_time"):
            validation.number(name, getattr(self, name), above=0)
        for name in ("damping", "gravity", "torque_weight"):
            validation.number(name, getattr(self, name), at_least=0)
        validation.number("omega_max", self.omega_max, above=0)
        validation.integer(
            "substeps", self.substeps, at_least=1, at_most=parameters.MOST_SUBSTEPS
        )
        torques = validation.real_array("torques", self.torques, ndim=1)
        continuous = validation.boolean("continuous", self.continuous)
        if continuous and torques.min() == torques.max():
            raise ValueError(
                "torques must hold two different ones, the ends of the range, where the "
                f"torque is continuous, got {validation.shown(self.torques)}."
            )
        bounds = self._checked_bounds()
        weight = _weight_matrix(self.state_weight)
        canonical: dict[str, Any] = {
            "torques": tuple(torques.tolist()),
            "continuous": continuous,
            "goal_bounds": tuple(bounds.tolist()),
            "state_weight": tuple(map(tuple, weight.tolist())),
            "substeps": int(self.substeps),
        }
        parameters.set_canonical(self, canonical)
        with np.errstate(over="ignore", invalid="ignore"):  # the checks look for it
            self._check_step()
            self._check_cost()

    @cached_property
    def _dynamics(self) -> tuple[Any, ...]:
        """Arguments of `kernels.integrate`; first K_m u / J of each torque, rad / s^2."""
        return (
            self.motor_gain / self.inertia * np.array(self.torques),
            self.mass * self.gravity * self.length / self.inertia,
            self.damping / self.inertia,
            self.sampling_time / self.substeps,
            int(self.substeps),
        )

    @cached_property
    def _goal_and_cost(self) -> tuple[Any, ...]:
        """Arguments of `kernels.settle`: bounds, Q, R u^2 of each action, the goal."""
        (cost_theta, cost_cross), (_, cost_omega) = self.state_weight
        return (
            float(self.omega_max),
            float(cost_theta),
            float(cost_cross),
            float(cost_omega),
            self.torque_weight * np.square(self.torques),
            *map(float, self.goal_bounds),
        )

    @property
    def observation_space(self) -> spaces.Box:
        """theta in [0, 2 pi), omega in [-omega_max, omega_max]; float64."""
        return spaces.Box(
            low=np.array([0.0, -self.omega_max]),
            high=np.array([TWO_PI, self.omega_max]),
            dtype=np.float64,
        )

    @property
    def action_space(self) -> spaces.Discrete | spaces.Box:
        """One action for each torque, or all torques between the ends; float64."""
        if self.continuous:
            ends = np.array([[min(self.torques)], [max(self.torques)]])
            return spaces.Box(*ends, dtype=np.float64)
        return spaces.Discrete(len(self.torques))

    def advance(
        self,
        states: FloatArray,
        actions: NDArray[Any],
        uniforms: FloatArray | None,
        rewards: FloatArray,
        reached: BoolArray,
    ) -> None:
        """One sampling time; see `ControlSystem.advance`."""
        dynamics, goal_and_cost = self._dynamics, self._goal_and_cost
        if self.continuous:
            # Kernels look up what each action does: here each slot has one of its own.
            torques = np.ascontiguousarray(actions[:, 0])
            actions = np.arange(torques.size)
            *cost, _, bound_theta, bound_omega = goal_and_cost
            dynamics = (self.motor_gain / self.inertia * torques, *dynamics[1:])
            of_torques = self.torque_weight * torques**2
            goal_and_cost = (*cost, of_torques, bound_theta, bound_omega)
        move = self.block_kernels[threads.worth_it(actions.size)]
        move(states, actions, dynamics, goal_and_cost, rewards, reached)

    @property
    def signals(self) -> Signals:
        """Angle and angular velocity are observed, the torque is set.

        Where it is continuous, `values` are those of `torques` all the same.
        """
        return Signals(
            ("angle theta, rad, 0 hangs down", "angular velocity omega, rad/s"),
            ("torque u, N m",),
            tuple((torque,) for torque in self.torques),
        )

    @property
    def task(self) -> dict[str, Any]:
        """Goal and cost, see `ControlSystem.task`."""
        return {
            "goal": (math.pi, 0.0),
            "tolerance": self.goal_bounds,
            "cost": (self.state_weight, self.torque_weight),
        }

    @property
    def max_stage_cost(self) -> float:
        """The largest stage cost (5.4) over the corners of X and the torques."""
        weight = np.array(self.state_weight)
        corners = [
            np.array([math.pi, speed]) for speed in (-self.omega_max, self.omega_max)
        ]
        largest = max(float(e @ weight @ e) for e in corners)
        return largest + self.torque_weight * max(u * u for u in self.torques)

    def sample_states(self, rng: np.random.Generator, count: int) -> FloatArray:
        """Draw states uniformly over X without the goal, shape `(2, count)`."""
        low = np.array([[0.0], [-self.omega_max]])
        span = np.array([[TWO_PI], [2.0 * self.omega_max]])
        return sampling.sample_outside(
            lambda n: low + span * rng.random((2, n)), self._in_goal, count
        )

    def checked_states(self, states: Any) -> FloatArray:
        """Return states `(n, 2)` with theta brought into [0, 2 pi).

        Raises:
            ValueError: wrong shape, not finite, or omega beyond omega_max.
        """
        array = parameters.real_states(states, ("theta", "omega"))
        if (beyond := np.flatnonzero(np.abs(array[:, 1]) > self.omega_max)).size:
            raise ValueError(
                f"omega must lie in [-{self.omega_max:g}, {self.omega_max:g}] rad/s, "
                f"got {array[beyond[0], 1]:g} in row {beyond[0]}; "
                "set omega_max to allow more."
            )
        array[:, 0] = np.mod(array[:, 0], TWO_PI)
        array[array[:, 0] >= TWO_PI, 0] = 0.0
        return array

    def evaluation_states(self) -> FloatArray:
        """Return 100 states: theta_i = 2 pi i / 10 + 0.01, 10 even values of omega.

        A decision: the thesis names no initial states for (3.47). The 0.01 keeps
        the set off the unstable symmetry axis.
        """
        theta = TWO_PI * np.arange(10) / 10 + 0.01
        omega = -self.omega_max + 2.0 * self.omega_max * np.arange(10) / 9
        return np.stack(np.meshgrid(theta, omega, indexing="ij"), axis=-1).reshape(
            -1, 2
        )

    def thesis_centres(self, cells: Any = None) -> tuple[FloatArray, FloatArray]:
        """The evenly spaced centres of theta, (5.2), and of omega, (5.3).

        For a crisp partition choose an even number for theta and an odd one for omega.
        Both equilibria are then centres. Otherwise they lie on the border between two
        bins, and the cell of a resting pendulum would chatter (§5.2.2).

        Args:
            cells: `(n_theta, n_omega)`, the numbers of centres, each >= 3; None takes
                (40, 41). Those of theta start at 0 and exclude 2 pi, which is the same
                angle; those of omega include both ends, -omega_max and omega_max.

        Returns:
            Centres of theta, rad, and of omega, rad/s.

        Raises:
            ValueError: `cells` are not two numbers, or one is too small.
            TypeError: a number is not an integer.
        """
        pair = (40, 41) if cells is None else cells
        if not isinstance(pair, Sequence | np.ndarray) or len(pair) != 2:
            raise ValueError(
                "cells of the pendulum must be two integers (n_theta, n_omega), such "
                f"as (40, 41), got {validation.shown(cells)}."
            )
        n_theta = validation.integer("n_theta", pair[0], at_least=3)
        n_omega = validation.integer("n_omega", pair[1], at_least=3)
        return (
            np.linspace(0.0, TWO_PI, n_theta, endpoint=False),
            np.linspace(-self.omega_max, self.omega_max, n_omega),
        )

    def _checked_bounds(self) -> FloatArray:
        bounds = validation.real_array("goal_bounds", self.goal_bounds, ndim=1)
        if bounds.size != 2 or (bounds <= 0).any():
            raise ValueError(
                "goal_bounds must be two half-widths > 0 (rad, rad/s), got "
                f"{validation.shown(self.goal_bounds)}."
            )
        share = np.minimum(bounds / (math.pi, self.omega_max), 1.0).prod()
        if share > 0.99:
            raise ValueError(
                "goal_bounds must leave 1% or more of the state space to start from, "
                f"got {validation.shown(self.goal_bounds)}, which leave {1 - share:.2%}."
            )
        return bounds

    def _check_step(self) -> None:
        """Refuse parameters for which Runge-Kutta would diverge (limit: 2.78)."""
        step = self.sampling_time / self.substeps
        stiffness = self.mass * self.gravity * self.length / self.inertia
        fastest = max(math.sqrt(stiffness), self.damping / self.inertia)
        pushes = np.array(self.torques) * self.motor_gain / self.inertia
        if not (step * fastest < 2.5 and np.isfinite(pushes).all()):
            raise ValueError(
                "sampling_time / substeps must be well below the fastest time constant "
                f"of the pendulum, {1 / fastest:.3g} s, got {step:g} s; use more "
                "substeps or check inertia, mass, length, gravity and damping."
            )
        # How far the pendulum can turn in a sampling time, before omega is clipped.
        fastest_turn = self.omega_max + self.sampling_time * (
            np.abs(pushes).max() + stiffness
        )
        turned = TWO_PI + self.sampling_time * fastest_turn
        if not turned < _LARGEST_ANGLE:
            raise ValueError(
                "sampling_time, omega_max and torques * motor_gain / inertia must keep the "
                f"angle below {_LARGEST_ANGLE:g} rad in one step, got up to {turned:.3g} "
                "rad; use smaller ones."
            )

    def _check_cost(self) -> None:
        if not math.isfinite(self.max_stage_cost):
            raise ValueError(
                "state_weight and torque_weight must give a finite stage cost, got "
                f"{self.max_stage_cost}; use smaller ones."
            )

    def _in_goal(self, states: FloatArray) -> BoolArray:
        bound_theta, bound_omega = self.goal_bounds
        theta, omega = states
        inside = (np.abs(theta - math.pi) <= bound_theta) & (
            np.abs(omega) <= bound_omega
        )
        return np.asarray(inside, dtype=np.bool_)


def _weight_matrix(values: Any) -> FloatArray:
    weight = validation.real_array("state_weight", values, ndim=2)
    if not parameters.is_weight(weight, 2):
        raise ValueError(
            "state_weight must be a symmetric positive semi-definite (2, 2) matrix, "
            f"got {validation.shown(values)}."
        )
    return weight
