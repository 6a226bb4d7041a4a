"""The colony on the fuzzy pendulum in vectorised NumPy, for comparison of speed.

Algorithm 4.2 written for speed without a compiler: every line works on all walking ants
at once. It shares only the parameters and initial states with the package. With the same
seed it draws the same random numbers and gives the same pheromone, except for rounding.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acl_gym.envs.pendulum import Pendulum

Array = NDArray[np.float64]
TWO_PI = 2.0 * np.pi


class NumpyColony:
    """Algorithm 4.2 with the parameters of Tables 5.1 and 5.2.

    Args:
        n_ants: M.
        cells: centres of theta and of omega.
        max_steps: T.
        seed: see `ACL`.

    Attributes:
        levels: tau, `(n_cells, n_actions)`.
        steps: ant-steps so far.
    """

    tau0, local_decay, global_decay, alpha, epsilon = 1e-4, 0.01, 0.1, 3, 0.1

    def __init__(
        self,
        n_ants: int,
        cells: tuple[int, int] = (40, 41),
        max_steps: int = 300,
        seed: int = 0,
    ) -> None:
        self.n_ants, self.cells, self.max_steps = n_ants, cells, max_steps
        self.system = Pendulum()
        self.n_actions = len(self.system.torques)
        self.levels = np.full((cells[0] * cells[1], self.n_actions), self.tau0)
        self.rng = np.random.default_rng(np.random.SeedSequence(seed).spawn(3)[0])
        self.steps = 0
        # The union of the cells that each ant has visited, eq. (4.13), as a dense table:
        # the pairs of an ant within a step differ, so that plain indexing can replace
        # the slower `np.maximum.at`.
        self._own = np.zeros((n_ants, self.levels.size))

    def trial(self) -> None:
        """Run one episode with every ant, then deposit."""
        seed = int(self.rng.integers(2**31))
        states = self.system.sample_states(np.random.default_rng(seed), self.n_ants)
        theta, omega = states
        ants = np.arange(self.n_ants)
        cost = np.zeros(self.n_ants)
        own = self._own
        own[:] = 0.0
        for _ in range(self.max_steps):
            index, degree = self.fuzzify(theta, omega)
            action = self.choose(index, degree)
            pairs = index * self.n_actions + action
            seen = own[ants, pairs]
            own[ants, pairs] = np.maximum(seen, degree, out=seen)
            theta, omega = self.advance(theta, omega, action)
            stage, reached = self.price(theta, omega, action)
            cost[ants] += stage
            self.decay(pairs, degree)
            self.steps += ants.size
            if reached.any():
                left = ~reached
                ants, theta, omega = ants[left], theta[left], omega[left]
                if not ants.size:
                    break
        self.deposit(own, cost)

    def fuzzify(self, theta: Array, omega: Array) -> tuple[NDArray[np.int64], Array]:
        """Cells and degrees of membership, eqs. (4.7) and (4.8), each `(4, m)`."""
        n_theta, n_omega = self.cells
        x = theta * (n_theta / TWO_PI)
        y = (omega + self.system.omega_max) * (
            (n_omega - 1) / (2.0 * self.system.omega_max)
        )
        i = np.minimum(x.astype(np.int64), n_theta - 1)
        j = np.minimum(y.astype(np.int64), n_omega - 2)
        x -= i
        y -= j
        below = i * n_omega + j
        above = np.where(i + 1 < n_theta, i + 1, 0) * n_omega + j
        index = np.stack((below, below + 1, above, above + 1))
        rest_x, rest_y = 1.0 - x, 1.0 - y
        degree = np.stack((rest_x * rest_y, rest_x * y, x * rest_y, x * y))
        return index, degree

    def choose(self, index: NDArray[np.int64], degree: Array) -> NDArray[np.int64]:
        """Max-Boltzmann selection on fuzzy cells, eqs. (3.6) and (4.11)."""
        coin, choice = self.rng.random((2, index.shape[1]))
        ratio = self.levels / self.levels.max(axis=1, keepdims=True)
        weight = ratio * ratio * ratio  # alpha = 3
        weight /= weight.sum(axis=1, keepdims=True)
        cumulated = np.cumsum(weight, axis=1)
        action = np.zeros(index.shape[1], dtype=np.int64)
        for u in range(self.n_actions - 1):
            action += choice >= (degree * cumulated[:, u].take(index)).sum(axis=0)
        explores = coin < self.epsilon
        action[explores] = choice[explores] * self.n_actions
        return action

    def advance(
        self, theta: Array, omega: Array, action: NDArray[np.int64]
    ) -> tuple[Array, Array]:
        """One fourth-order Runge-Kutta step of the dynamics, eq. (5.1)."""
        system = self.system
        torque = np.array(system.torques) * (system.motor_gain / system.inertia)
        push = torque[action]
        stiffness = system.mass * system.gravity * system.length / system.inertia
        friction = system.damping / system.inertia
        step = system.sampling_time

        def rate(angle: Array, speed: Array) -> Array:
            result = np.sin(angle)
            result *= -stiffness
            result += push
            result -= friction * speed
            return result

        rate1 = rate(theta, omega)
        speed2 = omega + 0.5 * step * rate1
        rate2 = rate(theta + 0.5 * step * omega, speed2)
        speed3 = omega + 0.5 * step * rate2
        rate3 = rate(theta + 0.5 * step * speed2, speed3)
        speed4 = omega + step * rate3
        rate4 = rate(theta + step * speed3, speed4)
        theta = theta + step / 6.0 * (omega + 2.0 * (speed2 + speed3) + speed4)
        omega = omega + step / 6.0 * (rate1 + 2.0 * (rate2 + rate3) + rate4)
        theta -= TWO_PI * np.floor(theta * (1.0 / TWO_PI))
        np.clip(omega, -system.omega_max, system.omega_max, out=omega)
        return theta, omega

    def price(
        self, theta: Array, omega: Array, action: NDArray[np.int64]
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Stage cost, eq. (5.4), and which ants have reached the goal."""
        system = self.system
        (q_theta, _), (_, q_omega) = system.state_weight
        error = theta - np.pi
        torque_cost = system.torque_weight * np.square(system.torques)
        cost = q_theta * error * error + q_omega * omega * omega + torque_cost[action]
        bound_theta, bound_omega = system.goal_bounds
        reached = (np.abs(error) <= bound_theta) & (np.abs(omega) <= bound_omega)
        return cost, reached

    def decay(self, pairs: NDArray[np.int64], degree: Array) -> None:
        """Local update, eqs. (4.12) and (4.18): the factors of all ants multiply."""
        flat = self.levels.reshape(-1)
        flat -= self.tau0
        np.multiply.at(flat, pairs.ravel(), (1.0 - self.local_decay * degree).ravel())
        flat += self.tau0

    def deposit(self, own: Array, cost: Array) -> None:
        """Global update, eqs. (4.14) and (4.15)."""
        flat = self.levels.reshape(-1)
        flat *= 1.0 - self.global_decay * own.max(axis=0)
        flat += self.global_decay * ((1.0 / cost) @ own)
