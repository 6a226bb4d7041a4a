"""The 2-D navigation with variable damping of §4.5: parameters and dynamics."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike

from acl_gym.envs.control import parameters, sampling
from acl_gym.envs.control.families import BlockSystem
from acl_gym.envs.control.signals import Signals
from acl_gym.envs.navigation import kernels
from acl_gym.envs.navigation.kernels import Peak, Row
from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, FloatArray

_VELOCITY = (-2.0, 0.0, 2.0)
_REGULAR = (-5.0, -2.0, -0.3, -0.1, 0.0, 0.1, 0.3, 2.0, 5.0)
_DAMPING_1 = (-5.0, -3.75, -2.0, -0.3, 0.0, 0.3, 2.0, 2.45, 3.5, 3.75, 4.7, 5.0)
_DAMPING_2 = (
    *(-5.0, -4.55, -3.5, -2.3, -2.0, -1.1, -0.6, -0.3),
    *(0.0, 0.3, 1.0, 2.6, 4.0, 5.0),
)
THESIS_CENTRES = {
    "regular": (_REGULAR, _VELOCITY, _REGULAR, _VELOCITY),
    "damping": (_DAMPING_1, _VELOCITY, _DAMPING_2, _VELOCITY),
}
"""Name -> centres of (c1, v1, c2, v2), in m and m/s (§4.5.2 and §4.5.3)."""


@dataclass(frozen=True, kw_only=True)
class Navigation(BlockSystem):
    """Parameters and dynamics of the vehicle of §4.5.1.

    The state is x = [c1 v1 c2 v2]: position and velocity along two axes. In each,
    mass v' = u - b(c1, c2) v, with the damping

        b = base_damping + sum_i h_i exp(-sum_j (c_j - m_ji)^2 / sigma_ji^2).

    Attributes:
        mass: kg, > 0. The thesis has 1; it also divides the damping, a decision.
        base_damping: b_0, kg / s, >= 0.
        peaks: the Gaussians of the damping, none or more, each as (h, m_1, m_2,
            sigma_1, sigma_2): height, kg / s, >= 0; centre, m; widths, m, > 0.
        forces: U, N, the force (u1, u2) of each action, one or more.
        sampling_time: T_s, s, > 0; the force is constant over it.
        substeps: Runge-Kutta steps in one sampling time, 1 to 10,000. Measured
            against DOP853 over the whole state space, one step of the default 0.2 s
            is off by at most 3e-2 m and 0.2 m/s with 1 substep, 8e-4 and 6e-3 with 2,
            4e-5 and 3e-4 with 4; most where the damping is strongest. 2 is as exact
            as the pendulum with 1 (a decision).
        position_max: m, > 0. Both positions are clipped to it after each step.
        velocity_max: m / s, > 0. Both velocities are clipped to it after each step.
            At a wall only the position stops; the velocity changes only by the force
            and the damping (a decision).
        cost: "quadratic", (3.2) with the error taken after the step, or "time", 1 per
            step (§4.5.3).
        goal_rule: "bounds", each variable within `goal_bounds` (§4.5.1), or
            "membership", degree of the goal's membership function > 0.5 (§4.4).
        goal_bounds: half-widths (m, m / s), > 0, of the goal region of "bounds".
        goal_spacing: distances (m, m / s), > 0, from the goal to the neighbouring
            centres of the partition, for "membership". The default is that of
            §4.5.2; the denser partition of §4.5.3 has (0.3, 2.0).
        state_weight: Q of (3.2), symmetric and positive semi-definite, shape (4, 4),
            or its diagonal, shape (4,). Used by the quadratic cost only.
        force_weight: R of (3.2) is this number times the unit matrix, >= 0. Used by
            the quadratic cost only.
    """

    evaluation_steps: ClassVar[int] = 150  # T of Table 4.1
    block_kernels = (kernels.advance, kernels.advance_in_parallel)

    mass: float = 1.0
    base_damping: float = 0.5
    peaks: tuple[Peak, ...] = (
        (8.0, 0.0, -2.3, 2.5, 1.5),
        (8.0, 4.7, 1.0, 1.5, 2.0),
    )
    forces: tuple[tuple[float, float], ...] = tuple(
        itertools.product((-1.0, 0.0, 1.0), (-1.0, 0.0, 1.0))
    )
    sampling_time: float = 0.2
    substeps: int = 2
    position_max: float = 5.0
    velocity_max: float = 2.0
    cost: str = "quadratic"
    goal_rule: str = "bounds"
    goal_bounds: tuple[float, float] = (0.25, 0.05)
    goal_spacing: tuple[float, float] = (0.1, 2.0)
    state_weight: tuple[Row, Row, Row, Row] | Row = (0.2, 0.1, 0.2, 0.1)
    force_weight: float = 0.0

    def __post_init__(self) -> None:
        for name in ("mass", "sampling_time", "position_max", "velocity_max"):
            validation.number(name, getattr(self, name), above=0)
        for name in ("base_damping", "force_weight"):
            validation.number(name, getattr(self, name), at_least=0)
        validation.integer(
            "substeps", self.substeps, at_least=1, at_most=parameters.MOST_SUBSTEPS
        )
        validation.one_of("cost", self.cost, ("quadratic", "time"))
        validation.one_of("goal_rule", self.goal_rule, ("bounds", "membership"))
        canonical: dict[str, Any] = {
            "peaks": _checked_peaks(self.peaks),
            "forces": _checked_forces(self.forces),
            "substeps": int(self.substeps),
            "cost": self.cost,
            "goal_rule": self.goal_rule,
            "goal_bounds": _checked_pair("goal_bounds", self.goal_bounds),
            "goal_spacing": _checked_pair("goal_spacing", self.goal_spacing),
            "state_weight": _checked_weight(self.state_weight),
        }
        parameters.set_canonical(self, canonical)
        with np.errstate(over="ignore", invalid="ignore"):  # the checks look for it
            self._check_step()
            self._check_cost()
        self._check_goal()

    @cached_property
    def _acceleration(self) -> FloatArray:
        """u / mass of each action, m / s^2, shape (2, actions)."""
        return np.ascontiguousarray(np.array(self.forces).T / self.mass)

    @cached_property
    def _kernel_peaks(self) -> tuple[float, ...]:
        """The peaks as one flat tuple; a peak of height 0 stands for none."""
        peaks = self.peaks or ((0.0, 0.0, 0.0, 1.0, 1.0),)
        scaled = (
            (height / self.mass, mean_1, mean_2, 1.0 / sigma_1, 1.0 / sigma_2)
            for height, mean_1, mean_2, sigma_1, sigma_2 in peaks
        )
        return tuple(map(float, itertools.chain(*scaled)))

    @cached_property
    def _dynamics(self) -> tuple[Any, ...]:
        """Arguments of `kernels.integrate`."""
        return (
            self._acceleration,
            self.base_damping / self.mass,
            self._kernel_peaks,
            self.sampling_time / self.substeps,
            int(self.substeps),
        )

    @cached_property
    def _goal_and_cost(self) -> tuple[Any, ...]:
        """Arguments of `kernels.settle`."""
        return (
            float(self.position_max),
            float(self.velocity_max),
            tuple(map(float, np.ravel(self._stage_weight))),
            self._action_cost,
            self.goal_rule == "membership",
            *map(float, self._goal),
        )

    @cached_property
    def _stage_weight(self) -> tuple[Any, ...]:
        """Q of the stage cost: zero for cost="time", which does not depend on the state."""
        if self.cost == "time":
            return ((0.0,) * 4,) * 4
        return self.state_weight

    @cached_property
    def _action_cost(self) -> FloatArray:
        """What each action adds to the stage cost: u' R u, or 1 for cost="time"."""
        if self.cost == "time":
            return np.ones(len(self.forces))
        squares = np.square(np.array(self.forces)).sum(axis=1)
        return np.asarray(self.force_weight * squares, dtype=np.float64)

    @property
    def _limits(self) -> FloatArray:
        """The largest value of each state variable, shape (4, 1)."""
        return np.array([[self.position_max], [self.velocity_max]] * 2)

    @property
    def _goal(self) -> tuple[float, float]:
        """The sizes of the goal region that `goal_rule` uses."""
        return self.goal_bounds if self.goal_rule == "bounds" else self.goal_spacing

    @property
    def observation_space(self) -> spaces.Box:
        """c1, v1, c2, v2, each within plus and minus its largest value; float64."""
        limits = self._limits[:, 0]
        return spaces.Box(low=-limits, high=limits, dtype=np.float64)

    @property
    def action_space(self) -> spaces.Discrete:
        """One action for each force."""
        return spaces.Discrete(len(self.forces))

    @property
    def signals(self) -> Signals:
        """Positions and velocities are observed, two forces are set."""
        return Signals(
            (
                "position c1, m",
                "velocity v1, m/s",
                "position c2, m",
                "velocity v2, m/s",
            ),
            ("force u1, N", "force u2, N"),
            self.forces,
        )

    @property
    def task(self) -> dict[str, Any]:
        """Goal and cost, see `ControlSystem.task`."""
        goal: dict[str, Any] = {"goal": np.zeros(4), "tolerance": self.goal_bounds * 2}
        if self.goal_rule == "membership":
            goal = {"goal": self._in_goal, "tolerance": None}
        cost = _one if self.cost == "time" else (self.state_weight, self.force_weight)
        return {**goal, "cost": cost}

    @property
    def max_stage_cost(self) -> float:
        """The largest stage cost over the corners of X and the forces."""
        corners = np.array(list(itertools.product((-1.0, 1.0), repeat=4)))
        corners *= self._limits[:, 0]
        weight = np.array(self._stage_weight)
        largest = np.einsum("ni,ij,nj->n", corners, weight, corners).max()
        return float(largest + self._action_cost.max())

    def damping(self, c1: ArrayLike, c2: ArrayLike) -> FloatArray:
        """The damping b(c1, c2), kg / s, of §4.5.1, for positions that broadcast."""
        c1, c2 = np.asarray(c1, dtype=np.float64), np.asarray(c2, dtype=np.float64)
        total = np.full(np.broadcast_shapes(c1.shape, c2.shape), self.base_damping)
        for height, mean_1, mean_2, sigma_1, sigma_2 in self.peaks:
            distance = ((c1 - mean_1) / sigma_1) ** 2 + ((c2 - mean_2) / sigma_2) ** 2
            total += height * np.exp(-distance)
        return total

    def sample_states(self, rng: np.random.Generator, count: int) -> FloatArray:
        """Draw states uniformly over X without the goal, shape `(4, count)`."""
        limits = self._limits
        return sampling.sample_outside(
            lambda n: limits * (2.0 * rng.random((4, n)) - 1.0), self._in_goal, count
        )

    def checked_states(self, states: Any) -> FloatArray:
        """Return states `(n, 4)`, rows [c1, v1, c2, v2].

        Raises:
            ValueError: wrong shape, not finite, or outside X.
        """
        variables = ("c1", "v1", "c2", "v2")
        array = parameters.real_states(states, variables)
        beyond = np.argwhere(np.abs(array) > self._limits[:, 0])
        if beyond.size:
            row, column = beyond[0]
            limit = self._limits[column, 0]
            setting = ("position_max", "velocity_max")[column % 2]
            raise ValueError(
                f"states must have {variables[column]} in "
                f"[-{limit:g}, {limit:g}], got {array[row, column]:g} in row {row}; "
                f"set {setting} to allow more."
            )
        return array

    def evaluation_states(self) -> FloatArray:
        """Return the Halton points 1 to 100 in bases 2, 3, 5 and 7, scaled to X.

        A decision: the thesis says "100 predefined initial states, uniformly
        distributed over the state space" and does not list them.
        """
        return (2.0 * sampling.halton_points(100) - 1.0) * self._limits[:, 0]

    def thesis_centres(self, cells: Any = None) -> tuple[FloatArray, ...]:
        """The centres of c1, v1, c2 and v2 by name.

        With the 9 actions, "regular" (§4.5.2) has 729 cells and 6,561 pairs of cell and
        action; "damping" (§4.5.3), finer around the two regions of stronger damping,
        has 1,512 cells and 13,608 pairs.

        Args:
            cells: "regular" or "damping"; None takes "regular".

        Returns:
            Centres of the four variables, m and m/s. They span the default
            `position_max` and `velocity_max`, whatever those of this system are.

        Raises:
            ValueError: there are no centres of that name.
        """
        name = "regular" if cells is None else cells
        validation.one_of("cells", name, tuple(THESIS_CENTRES))
        return tuple(np.array(centres) for centres in THESIS_CENTRES[name])

    def _check_step(self) -> None:
        """Refuse parameters for which Runge-Kutta would diverge (limit: 2.78)."""
        step = self.sampling_time / self.substeps
        push = np.abs(self._acceleration).max()
        # How far a vehicle can get within one step, before it is clipped.
        reach = self.position_max + step * (self.velocity_max + step * push)
        if not (np.isfinite(push) and reach < 1e100):
            raise ValueError(
                "sampling_time, forces / mass, position_max and velocity_max must "
                "keep the vehicle within 1e100 m in one step, got "
                f"{step:g} s, {push:g} m/s^2, {self.position_max:g} m and "
                f"{self.velocity_max:g} m/s; use smaller ones."
            )
        # The largest damping on a grid and at each peak: 2.5 leaves room between.
        reach = min(reach, 2.0 * self.position_max)
        grid = np.linspace(-reach, reach, 65)
        centres = np.clip([peak[1:3] for peak in self.peaks] or [(0, 0)], -reach, reach)
        highest = max(
            self.damping(grid[:, None], grid).max(), self.damping(*centres.T).max()
        )
        if not step * highest / self.mass < 2.5:
            raise ValueError(
                "sampling_time / substeps must be well below the shortest time "
                f"constant mass / damping, {self.mass / highest:.3g} s, got {step:g} s;"
                " use more substeps or check mass, base_damping and peaks."
            )

    def _check_cost(self) -> None:
        if not math.isfinite(self.max_stage_cost):
            raise ValueError(
                "state_weight and force_weight must give a finite stage cost, got "
                f"{self.max_stage_cost}; use smaller ones."
            )

    def _check_goal(self) -> None:
        name = "goal_bounds" if self.goal_rule == "bounds" else "goal_spacing"
        points = (2.0 * sampling.halton_points(1000).T - 1.0) * self._limits
        share = float(self._in_goal(points).mean())
        if share > 0.99:
            raise ValueError(
                f"{name} must leave 1% or more of the state space to start from, got "
                f"{self._goal!r}, which leave about {1 - share:.1%}."
            )

    def _in_goal(self, states: FloatArray) -> BoolArray:
        size = np.array([[value] for value in self._goal] * 2)
        if self.goal_rule == "bounds":
            return np.asarray((np.abs(states) <= size).all(axis=0), dtype=np.bool_)
        degree = np.maximum(1.0 - np.abs(states) / size, 0.0).prod(axis=0)
        return np.asarray(degree > 0.5, dtype=np.bool_)


def _checked_peaks(values: Any) -> tuple[Peak, ...]:
    if isinstance(values, (tuple, list, np.ndarray)) and len(values) == 0:
        return ()
    peaks = validation.real_array("peaks", values, ndim=2)
    if peaks.shape[1] != 5 or (peaks[:, 0] < 0).any() or (peaks[:, 3:] <= 0).any():
        raise ValueError(
            "peaks must be rows (height >= 0, mean_1, mean_2, sigma_1 > 0, "
            f"sigma_2 > 0), got {validation.shown(values)}."
        )
    if (peaks[:, 3:] < 1e-50).any() or (np.abs(peaks) > 1e100).any():
        raise ValueError(
            "peaks must have widths of at least 1e-50 m and no number beyond 1e100, "
            f"got {validation.shown(values)}."
        )
    return tuple(map(tuple, peaks.tolist()))


def _checked_forces(values: Any) -> tuple[tuple[float, float], ...]:
    forces = validation.real_array("forces", values, ndim=2)
    if forces.shape[1] != 2:
        raise ValueError(
            f"forces must be rows (u1, u2), shape (n, 2), got shape {forces.shape}."
        )
    return tuple(map(tuple, forces.tolist()))


def _checked_pair(name: str, values: Any) -> tuple[float, float]:
    pair = validation.real_array(name, values, ndim=1)
    if pair.size != 2 or (pair <= 0).any():
        raise ValueError(
            f"{name} must be two numbers > 0 (m, m/s), got {validation.shown(values)}."
        )
    position, velocity = pair.tolist()
    return position, velocity


def _checked_weight(values: Any) -> tuple[Any, ...]:
    weight = validation.real_array("state_weight", values)
    if weight.shape == (4,):
        weight = np.diag(weight)
    if not parameters.is_weight(weight, 4):
        raise ValueError(
            "state_weight must be a symmetric positive semi-definite (4, 4) matrix or "
            f"the 4 numbers >= 0 of its diagonal, got {validation.shown(values)}."
        )
    return tuple(map(tuple, weight.tolist()))


def _one(x: FloatArray, u: FloatArray) -> FloatArray:
    """The cost of a step of cost="time", for states `(4, n)`."""
    return np.ones(x.shape[1])
