"""A particle swarm tunes the colony's own parameters: epsilon, rho and gamma on the 2-D grid.

A point of the search is a colony: its exploration epsilon, the weight rho of its deposits
and the decay gamma of visited pairs, the last two by their logarithms. Its value is the
mean cost of the policies that it has after some trials, over a few seeds, the same for
all points. What was found is then compared with the defaults on seeds that the search has
not seen. Takes a minute or two.
"""

from __future__ import annotations

import argparse
import json
import time
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray
from scipy.stats import mannwhitneyu
from tqdm import tqdm

from acl_gym import ACL, evaluate_policy_cost
from acl_gym.swarm import minimize
from acl_gym.utils import validation

ENV_ID = "acl_gym/GridSearch2D-v0"
ANTS, TRIALS = 10, 20
SEEDS_OF_SEARCH = range(1_000, 1_008)
BOUNDS = [(0.0, 0.5), (-3.0, 0.0), (-4.0, -0.5)]
"""Of epsilon, log10 rho and log10 gamma."""
PARTICLES, ITERATIONS = 8, 14


def parameters(point: NDArray[np.float64]) -> dict[str, float]:
    """The parameters of the colony at a point of the search."""
    epsilon, log_rho, log_gamma = (float(each) for each in point)
    return {
        "epsilon": epsilon,
        "global_decay": 10.0**log_rho,
        "local_decay": 10.0**log_gamma,
    }


def policy_cost(seed: int, **settings: float) -> float:
    """The mean number of steps from all cells to the goal, by a policy of this colony."""
    env = gym.make_vec(ENV_ID, num_envs=ANTS)
    colony = ACL(env, seed=seed, **settings)
    colony.learn(trials=TRIALS)
    return evaluate_policy_cost(colony, env).cost


def search(iterations: int, particles: int, seed: int) -> Any:
    """Let the swarm search; the result of `minimize`."""
    with tqdm(total=(iterations + 1) * particles, unit="point", disable=None) as bar:

        def value(point: NDArray[np.float64]) -> float:
            settings = parameters(point)
            costs = [policy_cost(each, **settings) for each in SEEDS_OF_SEARCH]
            bar.update()
            return float(np.mean(costs))

        return minimize(
            value,
            BOUNDS,
            n_particles=particles,
            max_iterations=iterations,
            seed=seed,
            topology="global",
            vectorized=False,
        )


def main() -> None:
    """Search, compare and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--iterations", type=int, default=ITERATIONS)
    parser.add_argument("--particles", type=int, default=PARTICLES)
    parser.add_argument("--seed", type=int, default=0, help="of the swarm")
    parser.add_argument(
        "--fresh", type=int, default=30, help="seeds to compare on (30)"
    )
    parser.add_argument("--json", action="store_true", help="print JSON")
    options = parser.parse_args()
    try:
        validation.integer("--iterations", options.iterations, at_least=0)
        validation.integer("--particles", options.particles, at_least=1)
        validation.integer("--fresh", options.fresh, at_least=2)
        validation.seed(options.seed)
    except ValueError as error:
        parser.error(str(error))

    policy_cost(0)  # compiles
    began = time.perf_counter()
    result = search(options.iterations, options.particles, options.seed)
    seconds = time.perf_counter() - began
    tuned = parameters(result.x)
    compared = {
        "default": {},
        "middle of the range": parameters(np.mean(BOUNDS, axis=1)),
        "tuned": tuned,
    }
    costs = {
        name: [policy_cost(seed, **settings) for seed in range(options.fresh)]
        for name, settings in compared.items()
    }
    tests = {
        name: float(mannwhitneyu(costs["tuned"], each, alternative="less").pvalue)
        for name, each in costs.items()
        if name != "tuned"
    }
    if options.json:
        found = {"tuned": tuned, "value": result.fun, "points": result.nfev}
        print(json.dumps({**found, "seconds": seconds, "costs": costs, "p": tests}))
        return
    print(
        f"{result.nfev} points in {seconds:.0f} s; the best has a cost of {result.fun:.1f}"
    )
    for name, setting in tuned.items():
        print(f"  {name} = {setting:.3g}")
    print(f"{options.fresh} fresh seeds, cost of the policy after {TRIALS} trials:")
    for name, each in costs.items():
        low, middle, high = np.quantile(each, (0.25, 0.5, 0.75))
        print(
            f"  {name}: mean {np.mean(each):.1f}, median {middle:.1f}, quartiles {low:.1f} "
            f"to {high:.1f}"
        )
    for name, p in tests.items():
        print(f"rank test that the tuned colony is better than the {name}: p = {p:.2g}")


if __name__ == "__main__":
    main()
