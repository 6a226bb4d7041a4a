"""Who learns to keep together on acl_gym/SwarmAggregation-v0: agents beside plain rules.

Ten agents share a world and a policy: each slot is one of them. Tabular agents observe two
numbers (`observe="potential"`), PPO the six of "neighbours". A policy is judged by ten
episodes from other seeds: minus the return of an agent, in the mean, its distance from the
centre summed over the 100 steps, and its collisions.

examples:
  .venv/bin/python benchmarks/swarm_aggregation_learning.py
  .venv/bin/python benchmarks/swarm_aggregation_learning.py --methods rule,stay --json
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
from tqdm.auto import tqdm

from acl_gym import ACL, Fuzzy, QLearning, ReturningACL, VectorEnvAdapter

ENV = "acl_gym/SwarmAggregation-v0"
AGENTS, STEPS, EPISODES = 10, 100, 10
CELLS = (9, 9)
TRIALS, PPO_STEPS = 200, 300_000
"""A trial of ten agents is 1,000 interactions."""

Policy = Callable[[np.ndarray], Any]


def make(**parameters: Any) -> Any:
    return gym.make_vec(ENV, num_envs=AGENTS, **parameters)


def judged(policy: Policy, **parameters: Any) -> dict[str, float]:
    """The cost of an episode, and what it consists of, for each agent in the mean."""
    env = make(max_episode_steps=-1, **parameters)
    totals = np.zeros(3)
    for episode in range(EPISODES):
        seen, _ = env.reset(seed=1_000 + episode)
        for _ in range(STEPS):
            seen, rewards, _, _, infos = env.step(policy(seen))
            parts = (-rewards, infos["distance"], infos["collisions"])
            totals += [part.mean() for part in parts]
    names = ("cost", "distance", "collisions")
    return dict(zip(names, (totals / EPISODES).tolist(), strict=True))


def of_rule(name: str, seed: int) -> tuple[dict[str, float], int]:
    """Policies that nobody had to learn."""
    rng = np.random.default_rng(seed)
    if name == "rule":  # the potential rule (6.5), as a velocity
        return judged(lambda seen: seen, observe="potential", continuous=True), 0
    if name == "mean":  # towards the mean of the others, whatever is in the way
        return judged(lambda seen: seen[:, 2:4], continuous=True), 0
    if name == "stay":
        return judged(lambda seen: np.zeros(AGENTS, np.int64)), 0
    return judged(lambda seen: rng.integers(0, 5, AGENTS)), 0


def of_table(kind: Any, seed: int) -> tuple[dict[str, float], int]:
    """A tabular agent that observes what the rule would do."""
    env = make(observe="potential")
    grid = Fuzzy.from_box(env.single_observation_space, CELLS)
    agent = kind(env, grid, seed=seed, max_steps=STEPS)
    agent.learn(trials=TRIALS)
    found = judged(lambda seen: agent.predict(seen)[0], observe="potential")
    return found, TRIALS * AGENTS * STEPS


def of_ppo(seed: int) -> tuple[dict[str, float], int]:
    """Stable-Baselines3's PPO, one network for all agents."""
    import torch
    from stable_baselines3 import PPO

    torch.set_num_threads(1)  # networks are small
    model = PPO(
        "MlpPolicy",
        VectorEnvAdapter(make()),
        n_steps=200,
        batch_size=500,
        gamma=0.95,
        learning_rate=1e-3,
        seed=seed,
        device="cpu",
    )
    model.learn(PPO_STEPS)
    found = judged(lambda seen: model.predict(seen, deterministic=True)[0])
    return found, int(model.num_timesteps)


METHODS: dict[str, Callable[[int], tuple[dict[str, float], int]]] = {
    **{
        name: lambda seed, name=name: of_rule(name, seed)  # type: ignore[misc]
        for name in ("rule", "mean", "stay", "random")
    },
    "returning": lambda seed: of_table(ReturningACL, seed),
    "q-learning": lambda seed: of_table(QLearning, seed),
    "acl": lambda seed: of_table(ACL, seed),
    "ppo": of_ppo,
}
LEARNING = ("returning", "q-learning", "acl", "ppo")


def names_of(text: str) -> tuple[str, ...]:
    """Some of `METHODS`, with commas between them."""
    names = tuple(text.split(","))
    if unknown := [name for name in names if name not in METHODS]:
        raise argparse.ArgumentTypeError(
            f"must be some of {','.join(METHODS)}: {unknown[0]}"
        )
    return names


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("--methods", type=names_of, default=tuple(METHODS), help="with commas")
    add("--seeds", type=int, default=5, help="runs of what learns (default: 5)")
    add("--json", action="store_true", help="print JSON")
    options = parser.parse_args()
    if options.seeds < 1:
        parser.error("--seeds must be at least 1")
    jobs = [
        (name, seed)
        for name in options.methods
        for seed in range(options.seeds if name in LEARNING else 1)
    ]
    runs = []
    for name, seed in tqdm(jobs, disable=options.json):
        start = time.perf_counter()
        found, interactions = METHODS[name](seed)
        seconds = time.perf_counter() - start
        extra = {"interactions": interactions, "seconds": seconds}
        runs.append({"method": name, "seed": seed, **found, **extra})
    if options.json:
        print(json.dumps({"runs": runs}))
        return
    print(
        "| method | interactions | cost (all runs) | distance | collisions | seconds |"
    )
    print("| --- | ---: | --- | ---: | ---: | ---: |")
    for name in options.methods:
        own = [run for run in runs if run["method"] == name]
        costs = ", ".join(f"{cost:.0f}" for cost in sorted(run["cost"] for run in own))
        middle = {
            key: statistics.median(run[key] for run in own)
            for key in ("distance", "collisions", "seconds")
        }
        print(
            f"| {name} | {own[0]['interactions']:,} | {costs} | {middle['distance']:.0f} "
            f"| {middle['collisions']:.1f} | {middle['seconds']:.0f} |"
        )


if __name__ == "__main__":
    main()
