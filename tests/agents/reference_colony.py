"""The equations again, in dense vectors and plain loops, and a colony made of them.

Nothing here comes from the package: degrees are vectors over all cells, tables are
walked pair by pair, environments are stepped one after the other.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.vector import SyncVectorEnv

Array = np.ndarray
Solution = list[tuple[Array, int]]
"""The pairs of one ant: the degrees of the state over all cells, and the action."""


def dense(index: Array, degree: Array, n_cells: int) -> Array:
    """The vector beta of a state whose cells are `index`, all different."""
    beta = np.zeros(n_cells)
    for cell, weight in zip(index, degree, strict=True):
        beta[cell] += weight
    return beta


def boltzmann(tau: Array, beta: Array, alpha: float) -> Array:
    """The probability of each action (4.11), by logarithms."""
    probability = np.zeros(tau.shape[1])
    for i, degree in enumerate(beta):
        if degree > 0:
            exponent = alpha * (np.log(tau[i]) - np.log(tau[i].max()))
            probability += degree * np.exp(exponent) / np.exp(exponent).sum()
    return probability


def maximisers(tau: Array, beta: Array) -> list[int]:
    """The actions that (4.16) ties between."""
    values = [
        sum(degree * tau[i, u] for i, degree in enumerate(beta) if degree > 0)
        for u in range(tau.shape[1])
    ]
    return [u for u, value in enumerate(values) if value == max(values)]


def rule_probabilities(
    rule: str, tau: Array, beta: Array, alpha: float, epsilon: float
) -> Array:
    """The probability of each action under (3.4), (3.5) or (3.6)."""
    if rule == "boltzmann":
        return boltzmann(tau, beta, alpha)
    n_actions = tau.shape[1]
    if rule == "max_boltzmann":
        exploiting = boltzmann(tau, beta, alpha)
    else:
        best = maximisers(tau, beta)
        exploiting = np.array([(u in best) / len(best) for u in range(n_actions)])
    return (1 - epsilon) * exploiting + epsilon / n_actions


def chosen(
    rule: str,
    tau: Array,
    beta: Array,
    alpha: float,
    epsilon: float,
    coin: float,
    choice: float,
) -> int:
    """The action that two uniform numbers bring about."""
    n_actions = tau.shape[1]
    if rule != "boltzmann" and coin < epsilon:
        return int(choice * n_actions)
    if rule == "epsilon_greedy":
        best = maximisers(tau, beta)
        return best[int(choice * len(best))]
    sums = itertools.accumulate(boltzmann(tau, beta, alpha)[:-1])
    return next((u for u, total in enumerate(sums) if choice < total), n_actions - 1)


def local_update(
    tau: Array, beta: Array, action: int, gamma: float, tau0: float
) -> None:
    """The decay by one ant (4.12), in place."""
    for i, degree in enumerate(beta):
        kept = (1 - gamma * degree) * tau[i, action]
        tau[i, action] = kept + gamma * degree * tau0


def local_update_about_tau0(
    tau: Array, beta: Array, action: int, gamma: float, tau0: float
) -> None:
    """The same as in the proof of Theorem 4.1, where equal levels stay equal."""
    for i, degree in enumerate(beta):
        if degree > 0:
            excess = tau[i, action] - tau0
            tau[i, action] = (1 - gamma * degree) * excess + tau0


def local_product(tau: Array, visits: Solution, gamma: float, tau0: float) -> Array:
    """The decay by many ants at once (4.18)."""
    factor = np.ones_like(tau)
    for beta, action in visits:
        factor[:, action] *= 1 - gamma * beta
    return factor * (tau - tau0) + tau0


def indicator(solution: Solution, shape: tuple[int, int]) -> Array:
    """The union of the pairs of one solution (4.13)."""
    union = np.zeros(shape)
    for beta, action in solution:
        union[:, action] = np.maximum(union[:, action], beta)
    return union


def global_update(
    tau: Array, solutions: Sequence[Solution], costs: Array, rho: float
) -> Array:
    """The deposit of all ants (4.14), (4.15)."""
    union = np.zeros_like(tau)
    deposit = np.zeros_like(tau)
    for solution, cost in zip(solutions, costs, strict=True):
        own = indicator(solution, tau.shape)
        union = np.maximum(union, own)
        deposit += own / cost
    return (1 - rho * union) * tau + rho * deposit


def total_update(
    tau: Array,
    solutions: Sequence[Solution],
    costs: Array,
    gamma: float,
    rho: float,
    tau0: float,
) -> Array:
    """A whole trial in one formula (4.21)."""
    own = [indicator(solution, tau.shape) for solution in solutions]
    union = np.max(own, axis=0)
    factor = np.prod([1 - gamma * each for each in own], axis=0)
    deposit = sum(each / cost for each, cost in zip(own, costs, strict=True))
    return (1 - rho * union) * (factor * (tau - tau0) + tau0) + rho * deposit


def sensitivity(tau: Array, alpha: float) -> float:
    """The mean over the cells of (second / first)^alpha (3.48)."""
    ratios = []
    for row in tau:
        ordered = sorted(row)
        ratios.append((ordered[-2] / ordered[-1]) ** alpha)
    return sum(ratios) / len(ratios)


def q_update(
    values: Array,
    beta: Array,
    action: int,
    reward: float,
    next_beta: Array | None,
    learning_rate: float,
    discount: float,
    allowed: Array | None = None,
) -> None:
    """One transition of (3.44), in place; `next_beta` is None in a terminal state."""
    error = q_error(values, beta, action, reward, next_beta, discount, allowed)
    values[:, action] += learning_rate * error * beta


def q_error(
    values: Array,
    beta: Array,
    action: int,
    reward: float,
    next_beta: Array | None,
    discount: float,
    allowed: Array | None = None,
) -> float:
    """The temporal-difference error (3.46); `allowed` is U_q of the next state."""
    target = reward
    if next_beta is not None:
        target += discount * max(
            next_beta @ values[:, u]
            for u in range(values.shape[1])
            if allowed is None or allowed[u]
        )
    return float(target - beta @ values[:, action])


def q_lambda_update(
    values: Array,
    trace: Array,
    beta: Array,
    action: int,
    reward: float,
    next_beta: Array | None,
    greedy: bool,
    learning_rate: float,
    discount: float,
    trace_decay: float,
    accumulate: bool,
    allowed: Array | None = None,
) -> None:
    """One transition of (3.45) over all pairs, in place; `trace` is that of one slot."""
    error = q_error(values, beta, action, reward, next_beta, discount, allowed)
    trace *= discount * trace_decay if greedy else 0.0
    if accumulate:
        trace[:, action] += beta
    else:
        trace[:, action] = np.maximum(trace[:, action], beta)
    values += learning_rate * error * trace


def memberships(x: float, centres: Array, period: float | None) -> Array:
    """The triangles (4.7) around regular centres, saturated at the ends or circular."""
    spacing = centres[1] - centres[0]
    distance = np.abs(x - centres)
    if period is not None:
        distance = np.abs((x - centres + period / 2) % period - period / 2)
    elif x <= centres[0] or x >= centres[-1]:
        return (distance == distance.min()).astype(float)
    return np.maximum(0.0, 1.0 - distance / spacing)


def fuzzify(
    state: Array, axes: Sequence[tuple[Array, float | None]], crisp: bool
) -> Array:
    """The degrees of a state over all cells (4.8); all on the nearest if `crisp`."""
    beta = np.ones(1)
    for x, (centres, period) in zip(state, axes, strict=True):
        degrees = memberships(x, centres, period)
        if crisp:
            degrees = (degrees == degrees.max()).astype(float)
        beta = np.outer(beta, degrees).ravel()
    return beta


class Colony:
    """Algorithm 4.2 without haste: one environment an ant, one trial a call.

    It owns the pheromone `tau` and nothing that the package made but the single
    environments, which it drives through `reset` and `step`.
    """

    def __init__(
        self,
        envs: Sequence[gym.Env],
        fuzzify: Callable[[Array], Array],
        n_cells: int,
        rng: np.random.Generator,
        *,
        tau0: float,
        gamma: float,
        rho: float,
        alpha: float,
        epsilon: float,
        rule: str,
        max_steps: int,
    ) -> None:
        self.envs, self.fuzzify, self.rng = envs, fuzzify, rng
        self.tau0, self.gamma, self.rho = tau0, gamma, rho
        self.alpha, self.epsilon, self.rule = alpha, epsilon, rule
        self.max_steps = max_steps
        self.tau = np.full((n_cells, int(envs[0].action_space.n)), tau0)

    def trial(self, observations: list[Array]) -> tuple[Array, Array]:
        """Let the ants walk from their first observations; return costs, successes."""
        n = len(self.envs)
        solutions: list[Solution] = [[] for _ in range(n)]
        costs, success = np.zeros(n), np.zeros(n, dtype=bool)
        walking = list(range(n))
        for _ in range(self.max_steps):
            if not walking:
                break
            coins, choices = self.rng.random((2, len(walking)))
            for j, ant in enumerate(walking):
                beta = self.fuzzify(observations[ant])
                action = chosen(
                    self.rule,
                    self.tau,
                    beta,
                    self.alpha,
                    self.epsilon,
                    coins[j],
                    choices[j],
                )
                solutions[ant].append((beta, action))
            still = []
            for ant in walking:
                action = solutions[ant][-1][1]
                observation, reward, reached, stopped, _ = self.envs[ant].step(action)
                observations[ant] = observation
                costs[ant] -= reward
                success[ant] = reached
                if not (reached or stopped):
                    still.append(ant)
            for ant in walking:
                pair = solutions[ant][-1]
                local_update_about_tau0(self.tau, *pair, self.gamma, self.tau0)
            walking = still
        self.tau = global_update(self.tau, solutions, costs, self.rho)
        return costs, success


class Chain(gym.Env):
    """Cells 0 .. length - 1 in a row, the goal in the last; action 1 leads to it.

    A move costs 1, so that J of the best policy from cell q is length - 1 - q. With
    probability `slip` a move fails, drawn anew in each step.
    """

    def __init__(
        self,
        length: int = 6,
        *,
        slip: float = 0.0,
        first_action: int = 0,
        limit: float = math.inf,
        reward: float = -1.0,
    ) -> None:
        self.observation_space = spaces.Box(0.0, length - 1.0, (1,), np.float64)
        self.action_space = spaces.Discrete(2, start=first_action)
        self.length, self.slip, self.limit, self.reward = length, slip, limit, reward

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        super().reset(seed=seed)
        self.cell = int(self.np_random.integers(self.length - 1))
        self.steps = 0
        return np.array([float(self.cell)]), {}

    def step(self, action: int) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        assert self.action_space.contains(action), action
        if self.np_random.random() >= self.slip:
            move = 1 if action == self.action_space.start + 1 else -1
            self.cell = max(0, self.cell + move)
        self.steps += 1
        reached = self.cell == self.length - 1
        observation = np.array([float(self.cell)])
        return observation, self.reward, reached, self.steps >= self.limit, {}


def chains(num_envs: int, mode: str = "NextStep", **parameters: Any) -> SyncVectorEnv:
    """Many chains, one a slot."""
    return SyncVectorEnv([lambda: Chain(**parameters)] * num_envs, autoreset_mode=mode)
