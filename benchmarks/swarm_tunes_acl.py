"""A particle swarm tunes the parameters of `ACL` on the 2-D grid.

A point of the search is a colony: its exploration epsilon, the weight rho of its deposits,
the decay gamma of visited pairs (rho and gamma by their logarithms) and the exponent alpha.
Its value is the number of steps that an ant walks to the goal, on average over the first
trials, while the colony learns, or that of the policy learned in the end. Each point is
tried with a few seeds, the same for all points. What was found is then compared with the
defaults on seeds that the search has not seen, by both measures. Takes two minutes.
"""

from __future__ import annotations

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

from tables import add_json, at_least_one, parser_of, seed  # isort: skip

ENV_ID = "acl_gym/GridSearch2D-v0"
ANTS, TRIALS = 30, 20
SEEDS_OF_SEARCH = range(1_000, 1_010)
BOUNDS = [(0.0, 0.5), (-3.0, 0.0), (-4.0, -0.5), (1.0, 10.0)]
"""Of epsilon, log10 rho, log10 gamma and alpha."""
PARTICLES, ITERATIONS = 8, 14

MEASURES = {"learning": "while learning", "policy": "policy in the end"}
"""What may be minimized: steps of an ant, in the order in which `learned` returns them."""


def parameters(point: NDArray[np.float64]) -> dict[str, float]:
    """The parameters of the colony at a point of the search."""
    epsilon, log_rho, log_gamma, alpha = (float(each) for each in point)
    return {
        "epsilon": epsilon,
        "global_decay": 10.0**log_rho,
        "local_decay": 10.0**log_gamma,
        "alpha": alpha,
    }


def learned(seed: int, **settings: float) -> tuple[float, float]:
    """Steps of an ant while this colony learns, and of its policy in the end: means."""
    env = gym.make_vec(ENV_ID, num_envs=ANTS)
    colony = ACL(env, seed=seed, **settings)
    colony.learn(trials=TRIALS)
    walked = colony.num_timesteps / (ANTS * TRIALS)
    return walked, evaluate_policy_cost(colony, env).cost


def search(measure: str, iterations: int, particles: int, seed: int) -> Any:
    """Let the swarm search; the result of `minimize`."""
    column = list(MEASURES).index(measure)
    with tqdm(total=(iterations + 1) * particles, unit="point", disable=None) as bar:

        def value(point: NDArray[np.float64]) -> float:
            settings = parameters(point)
            costs = [learned(each, **settings)[column] for each in SEEDS_OF_SEARCH]
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
    parser = parser_of(__doc__)
    parser.add_argument("--measure", choices=list(MEASURES), default="learning")
    parser.add_argument("--iterations", type=at_least_one, default=ITERATIONS)
    parser.add_argument("--particles", type=at_least_one, default=PARTICLES)
    parser.add_argument("--seed", type=seed, default=0, help="of the swarm")
    parser.add_argument(
        "--fresh", type=at_least_one, default=60, help="seeds to compare on (60)"
    )
    add_json(parser)
    options = parser.parse_args()

    learned(0)  # compiles
    began = time.perf_counter()
    result = search(
        options.measure, options.iterations, options.particles, options.seed
    )
    seconds = time.perf_counter() - began
    tuned = parameters(result.x)
    rows = []
    both = {
        name: np.array([learned(seed, **settings) for seed in range(options.fresh)])
        for name, settings in (("default", {}), ("tuned", tuned))
    }
    for column, measure in enumerate(MEASURES.values()):
        default, changed = (each[:, column] for each in both.values())
        rows.append(
            {
                "measure": measure,
                "default": default.tolist(),
                "tuned": changed.tolist(),
                "p": float(mannwhitneyu(changed, default, alternative="less").pvalue),
            }
        )
    found = {"tuned": tuned, "value": result.fun, "points": result.nfev}
    if options.json:
        print(json.dumps({**found, "seconds": seconds, "fresh": rows}))
        return
    print(
        f"{result.nfev} points in {seconds:.0f} s; value of the best: {result.fun:.1f}"
    )
    for name, setting in tuned.items():
        print(f"  {name} = {setting:.3g}")
    print(f"on {options.fresh} fresh seeds, steps:")
    for row in rows:
        print(
            f"  {row['measure']}: default {np.mean(row['default']):.1f} (median "
            f"{np.median(row['default']):.1f}), tuned {np.mean(row['tuned']):.1f} "
            f"({np.median(row['tuned']):.1f}); p of the rank test {row['p']:.2g}"
        )


if __name__ == "__main__":
    main()
