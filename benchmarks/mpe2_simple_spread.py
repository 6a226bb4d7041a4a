"""The speed of mpe2's simple_spread, measured in a virtual environment of its own.

`make peers-mpe2` makes .venv-mpe2. swarm_aggregation.py runs this script there and reads
the JSON that it prints: for each number of agents the agent-steps a second of processor
time in the best of some repetitions. Arguments: seconds of a repetition, repetitions, numbers of agents.
"""

import importlib.metadata
import json
import sys
import time

import numpy as np
from mpe2 import simple_spread_v3


def agent_steps_per_second(count: int, seconds: float, repetitions: int) -> float:
    """The best of some repetitions; episodes do not end, so that none is reset."""
    env = simple_spread_v3.parallel_env(N=count, max_cycles=10**9)
    env.reset(seed=0)
    choices = np.random.default_rng(0).integers(0, 5, (200, count)).tolist()
    actions = [dict(zip(env.agents, row, strict=True)) for row in choices]
    best = 0.0
    env.step(actions[0])
    for _ in range(repetitions):
        steps, start = 0, time.process_time()
        while (passed := time.process_time() - start) < seconds:
            env.step(actions[steps % len(actions)])
            steps += 1
        best = max(best, steps * count / passed)
    return best


def main() -> None:
    """Measure; see the top of the file for the arguments."""
    seconds, repetitions = float(sys.argv[1]), int(sys.argv[2])
    rates = {
        count: agent_steps_per_second(count, seconds, repetitions)
        for count in map(int, sys.argv[3:])
    }
    print(json.dumps({"version": importlib.metadata.version("mpe2"), "rates": rates}))


if __name__ == "__main__":
    main()
