"""The speed of environments that are slow to step, in this process and in workers.

Each step of the environment computes for a millisecond: it runs a loop whose number of
passes is measured at the start. It does not wait by the clock, since a process that waits
while another one has its processor would seem to be at work, so that two cores would look
like many; `--sleep` shows that case, of an environment that waits for a device or another
machine. The cases are Gymnasium's SyncVectorEnv, the reference, and AsyncVectorEnv, which
has a process for each slot; acl-gym's WaitingVectorEnv; and WorkersVectorEnv with workers
in processes and, where Ray is installed, on a cluster that is started on this machine.
Every value is the median of several repetitions, which go through all cases in turn. Only
ratios can be compared between machines.

    python benchmarks/workers.py
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import logging
import statistics
import time
from collections import defaultdict
from collections.abc import Callable
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv, VectorEnv
from rich.console import Console
from rich.table import Table

from acl_gym import WaitingVectorEnv, WorkersVectorEnv

REFERENCE = "SyncVectorEnv"


def compute(passes: int) -> float:
    x = 0.0
    for _ in range(passes):
        x = x * 0.5 + 1.0
    return x


def passes_in(seconds: float) -> int:
    """How many passes of `compute` take so long on one core that has nothing else."""
    tried = 200_000
    times = []
    for _ in range(9):
        start = time.process_time()
        compute(tried)
        times.append(time.process_time() - start)
    return max(1, round(tried * seconds / min(times)))


class Slow(gym.Env[Any, Any]):
    """Computes, or sleeps, in every step; its episodes do not end."""

    observation_space = gym.spaces.Box(-1.0, 1.0, (4,), np.float64)
    action_space = gym.spaces.Discrete(2)

    def __init__(self, passes: int, sleep: float) -> None:
        self.passes, self.sleep = passes, sleep

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        return self.np_random.uniform(-1.0, 1.0, 4), {}

    def step(self, action: Any) -> Any:
        if self.sleep:
            time.sleep(self.sleep)
        else:
            compute(self.passes)
        return self.np_random.uniform(-1.0, 1.0, 4), -1.0, False, False, {}


def cases(
    make: Callable[[], gym.Env[Any, Any]], slots: int, workers: list[int], ray: bool
) -> dict[str, VectorEnv[Any, Any, Any]]:
    """Name -> environment."""
    made = [make] * slots
    found: dict[str, VectorEnv[Any, Any, Any]] = {
        REFERENCE: SyncVectorEnv(made),
        "AsyncVectorEnv": AsyncVectorEnv(made),
        "WaitingVectorEnv": WaitingVectorEnv(made),
        "WorkersVectorEnv, serial": WorkersVectorEnv(made, workers=0),
    }
    for executor in ("processes", "ray") if ray else ("processes",):
        for count in workers:
            found[f"WorkersVectorEnv, {executor}, {count}"] = WorkersVectorEnv(
                made, count, executor
            )
    return found


def start_ray(processors: int) -> bool:
    """Start a cluster of this machine; False if Ray is not installed."""
    if importlib.util.find_spec("ray") is None:
        return False
    import ray

    ray.init(
        num_cpus=processors,
        include_dashboard=False,
        log_to_driver=False,
        logging_level=logging.ERROR,
    )
    return True


def seconds_of(env: VectorEnv[Any, Any, Any], steps: int) -> float:
    actions = np.zeros(env.num_envs, dtype=np.int64)
    start = time.perf_counter()
    for _ in range(steps):
        env.step(actions)
    return time.perf_counter() - start


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--slots", type=int, default=20)
    parser.add_argument("--steps", type=int, default=25, help="of each slot")
    parser.add_argument("--milliseconds", type=float, default=1.0, help="of one step")
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--repetitions", type=int, default=7)
    parser.add_argument("--sleep", action="store_true", help="sleep, do not compute")
    parser.add_argument("--without-ray", action="store_true")
    parser.add_argument("--json", action="store_true", help="print JSON")
    arguments = parser.parse_args()

    seconds = arguments.milliseconds / 1e3
    make = partial(Slow, passes_in(seconds), seconds if arguments.sleep else 0.0)
    ray = not arguments.without_ray and start_ray(max(arguments.workers))
    envs = cases(make, arguments.slots, arguments.workers, ray)
    times = defaultdict(list)
    for env in envs.values():
        env.reset(seed=0)
        seconds_of(env, 2)
    for _ in range(arguments.repetitions):
        for name, env in envs.items():
            times[name].append(seconds_of(env, arguments.steps))
    for env in envs.values():
        env.close()

    total = arguments.slots * arguments.steps
    base = statistics.median(times[REFERENCE])
    rows = [
        {
            "name": name,
            "slots": arguments.slots,
            "steps_per_second": total / statistics.median(measured),
            "slowest": total / max(measured),
            "fastest": total / min(measured),
            "ratio_to_reference": base / statistics.median(measured),
        }
        for name, measured in times.items()
    ]
    if arguments.json:
        print(json.dumps({"reference": REFERENCE, "cases": rows}, indent=2))
        return
    table = Table("case", "steps per second", f"times {REFERENCE}")
    for row in rows:
        rate, ratio = row["steps_per_second"], row["ratio_to_reference"]
        table.add_row(row["name"], f"{rate:,.0f}", f"{ratio:.2f}")
    Console().print(table)


if __name__ == "__main__":
    main()
