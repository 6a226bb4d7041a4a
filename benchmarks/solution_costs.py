"""The benefit of an episode cost on the pendulum, as suggested in §7.3.

Colonies learn from the quadratic stage cost, from the number of steps, and from the
settling time plus a weighted overshoot, which no reward per step expresses; Q-learning
learns from the first two. Every final policy is then evaluated by all measures.
"""

from __future__ import annotations

import argparse
import math
import sys

import gymnasium as gym
import numpy as np
from gymnasium.wrappers.vector import TransformReward
from tqdm.auto import tqdm

from acl_gym import ACL, QLearning, evaluate_policy_cost
from acl_gym.costs import Cost, Overshoot, RiseTime, SettlingTime, Steps
from acl_gym.partitions.automatic import thesis_partition
from acl_gym.utils.text import replace_unprintable_letters

TURN = 2 * math.pi
ANGLE = {"variable": 0, "target": math.pi, "period": TURN}
SETTLING = SettlingTime(**ANGLE, tolerance=0.3, sampling_time=0.1)
MEASURES: dict[str, Cost | None] = {
    "quadratic cost": None,
    "settling time, s": SETTLING,
    "overshoot, rad": Overshoot(**ANGLE),
    "rise time, s": RiseTime(**ANGLE, sampling_time=0.1),
}
LEARNERS = {
    "ACL, quadratic cost": {},
    "ACL, number of steps": {"cost": Steps(), "tau0": 1e-3},
    "ACL, settling time + 0.5 overshoot + 0.1": {
        "cost": SETTLING + 0.5 * Overshoot(**ANGLE) + 0.1,
        "tau0": 1e-3,
    },
}


def train(name: str, seed: int, trials: int) -> object:
    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=250)
    grid = thesis_partition(env, (40, 41))
    if name.startswith("ACL"):
        return ACL(env, grid, seed=seed, **LEARNERS[name]).learn(trials=trials)
    if name == "Q(lambda), number of steps":
        env = TransformReward(env, lambda reward: np.where(reward == 0.0, 0.0, -1.0))
    return QLearning(env, grid, trace_decay=0.7, seed=seed).learn(trials=trials)


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=5, help="runs of each method")
    parser.add_argument("--trials", type=int, default=100, help="trials per run")
    options = parser.parse_args(arguments)
    learners = [*LEARNERS, "Q(lambda), quadratic cost", "Q(lambda), number of steps"]
    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=100)
    head = " | ".join([*MEASURES, "success"])
    lines = [f"| learns from | {head} |", "| --- |" + " --- |" * (len(MEASURES) + 1)]
    bar = tqdm(total=len(learners) * options.seeds)
    for name in learners:
        found: dict[str, list[float]] = {key: [] for key in [*MEASURES, "success"]}
        for seed in range(options.seeds):
            agent = train(name, seed, options.trials)
            for measure, cost in MEASURES.items():
                result = evaluate_policy_cost(agent, env, cost=cost)
                found[measure].append(result.cost)
            found["success"].append(result.success_rate)
            bar.update()
        cells = (
            f"{np.median(values):.2f} [{min(values):.2f}, {max(values):.2f}]"
            for values in found.values()
        )
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    bar.close()
    print("\n".join(lines))
    return 0


if __name__ == "__main__":
    replace_unprintable_letters()
    sys.exit(main())
