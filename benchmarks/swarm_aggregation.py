"""How fast swarms aggregate: agent-steps a second, and how the time grows with agents.

Agents stand a rest distance apart and hear all within a radius, about 20 others each, so
that the density is the same for any number of agents. Measured are

  forces      the sum of the interactions alone, `forces_within`
  run         agents in a field with a `Radius` channel, under `acl_gym.swarm.run`
  environment acl_gym/SwarmAggregation-v0 with a sensing radius, `step` of all slots
  pettingzoo  the same through its view as a `ParallelEnv`

and beside them mpe2's simple_spread, in the same run, if `make peers-mpe2` has made its
environment. All use one core, and seconds are those of the processor, so that other work
on the machine counts less. The growth is the exponent p of the line that fits the
logarithms best: the time of a step is proportional to n^p.

examples:
  .venv/bin/python benchmarks/swarm_aggregation.py
  .venv/bin/python benchmarks/swarm_aggregation.py --agents 250,1000 --seconds 0.2 --json
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from acl_gym.envs.swarm_aggregation import SwarmAggregationVectorEnv
from acl_gym.swarm import Radius, run
from acl_gym.swarm.aggregation import (
    AggregatingAgents,
    BoundedRepulsion,
    Field,
    forces_within,
)

FOLDER = Path(__file__).resolve().parent
PEER_PYTHON = FOLDER.parent / ".venv-mpe2" / "bin" / "python"
PEER_AGENTS = (3, 10, 30)  # 3 is its default

AGENTS = (250, 500, 1_000, 2_000, 4_000, 8_000, 16_000)
MAIN = 1_000
RADIUS = 2.0
FLOOR = 100.0
"""Times the rate of simple_spread that a swarm of `MAIN` agents must reach."""

TINY = 1e-6  # s, a time step in which nobody changes its neighbours
STEPS_A_RUN = 10

Work = Callable[[], int]
"""Makes some steps of all agents, and returns how many."""


def places(count: int) -> np.ndarray:
    """Positions a rest distance apart, on a grid that is a little out of order."""
    delta = float(BoundedRepulsion().rest_distance)
    side = math.ceil(math.sqrt(count))
    grid = np.stack(np.divmod(np.arange(count), side), axis=1) - 0.5 * (side - 1)
    return delta * (grid + np.random.default_rng(0).uniform(-0.2, 0.2, grid.shape))


def forces(count: int) -> Work:
    x, law = places(count), BoundedRepulsion()

    def work() -> int:
        forces_within(x, law, RADIUS)
        return 1

    return work


def framework(count: int) -> Work:
    field = Field(places(count), time_step=TINY)
    agents, channel = AggregatingAgents(), Radius(RADIUS)
    return lambda: run(agents, field, STEPS_A_RUN, channel=channel).steps


def parameters(x: np.ndarray) -> dict[str, Any]:
    """Of an environment in which agents can be at these places."""
    return {
        "half_width": float(np.abs(x).max()),
        "sensing_radius": RADIUS,
        "time_step": TINY,
    }


def environment(count: int) -> Work:
    x = places(count)
    env = SwarmAggregationVectorEnv(count, **parameters(x))
    env.reset(options={"state": x})
    choices = np.random.default_rng(0).integers(0, 5, count)

    def work() -> int:
        env.step(choices)
        return 1

    return work


def pettingzoo(count: int) -> Work:
    from acl_gym.envs.swarm_aggregation.parallel import parallel_env

    x = places(count)
    env = parallel_env(count, max_cycles=10**9, **parameters(x))
    env.reset(options={"state": x})
    choices = np.random.default_rng(0).integers(0, 5, count).tolist()
    actions = dict(zip(env.agents, choices, strict=True))

    def work() -> int:
        env.step(actions)
        return 1

    return work


CASES: dict[str, Callable[[int], Work]] = {
    "forces": forces,
    "run": framework,
    "environment": environment,
    "pettingzoo": pettingzoo,
}


def seconds_a_step(work: Work, seconds: float, repetitions: int) -> float:
    """The best of some repetitions, each of so many seconds."""
    work()  # compiles
    best = math.inf
    for _ in range(repetitions):
        steps, start = 0, time.process_time()
        while (passed := time.process_time() - start) < seconds or steps == 0:
            steps += work()
        best = min(best, passed / steps)
    return best


def measure_peer(seconds: float, repetitions: int) -> dict[str, Any] | None:
    """simple_spread in its own environment; None if that was not made or fails."""
    if not PEER_PYTHON.exists():
        print("mpe2 is left out: run `make peers-mpe2` first", file=sys.stderr)
        return None
    command = [PEER_PYTHON, FOLDER / "mpe2_simple_spread.py", seconds, repetitions]
    done = subprocess.run(
        [*map(str, command), *map(str, PEER_AGENTS)],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        print(f"mpe2 failed:\n{done.stderr[-800:]}", file=sys.stderr)
        return None
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def neighbours(count: int) -> float:
    """How many others an agent hears, in the mean."""
    return Radius(RADIUS, include_self=False).links(places(count)).n_links / count


def growth(rows: list[dict[str, Any]], case: str) -> float:
    """The exponent p of time ~ n^p."""
    points = [(row["agents"], row["seconds"]) for row in rows if row["case"] == case]
    agents, seconds = np.log(np.array(points)).T
    return float(np.polyfit(agents, seconds, 1)[0])


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """All cases, and the peer, in one run."""
    rows = []
    for case, make in CASES.items():
        for count in options.agents:
            if case == "pettingzoo" and count > MAIN:
                continue  # dicts of thousands of names are no use to anyone
            best = seconds_a_step(make(count), options.seconds, options.repetitions)
            rows.append(
                {
                    "case": case,
                    "agents": count,
                    "seconds": best,
                    "agent_steps_per_second": count / best,
                }
            )
    peer = None
    if not options.no_peer:
        peer = measure_peer(options.seconds, options.repetitions)
    found: dict[str, Any] = {
        "machine": {"cores": os.cpu_count(), "python": platform.python_version()},
        "radius": RADIUS,
        "neighbours": {count: neighbours(count) for count in options.agents},
        "rows": rows,
        "growth": {
            case: growth(rows, case)
            for case in CASES
            if sum(row["case"] == case for row in rows) > 1
        },
        "simple_spread": peer,
    }
    if peer is not None:
        best = max(peer["rates"].values())
        found["times_simple_spread"] = {
            row["case"]: row["agent_steps_per_second"] / best
            for row in rows
            if row["agents"] == MAIN
        }
    return found


def show(found: dict[str, Any]) -> None:
    """Print what was measured as a table."""
    around = np.mean(list(found["neighbours"].values()))
    print(f"agent-steps a second, radius {RADIUS:g}, about {around:.0f} neighbours")
    counts = sorted({row["agents"] for row in found["rows"]})
    print("| case | " + " | ".join(f"{n:,}" for n in counts) + " | growth |")
    print("| --- |" + " ---: |" * (len(counts) + 1))
    for case in CASES:
        rates = {
            row["agents"]: f"{row['agent_steps_per_second']:,.0f}"
            for row in found["rows"]
            if row["case"] == case
        }
        cells = " | ".join(rates.get(n, "") for n in counts)
        power = found["growth"].get(case)
        print(f"| {case} | {cells} | {'' if power is None else f'n^{power:.2f}'} |")
    peer = found["simple_spread"]
    if peer is not None:
        rates = ", ".join(f"{rate:,.0f} of {n}" for n, rate in peer["rates"].items())
        print(f"simple_spread of mpe2 {peer['version']}: {rates} agents")
        for case, times in found["times_simple_spread"].items():
            verdict = "" if times >= FLOOR else f", less than {FLOOR:g}"
            print(f"  {case}: {times:,.0f} times its best{verdict}")


def agents_of(text: str) -> tuple[int, ...]:
    """Numbers of agents with commas between them."""
    try:
        found = tuple(int(part) for part in text.split(","))
    except ValueError:
        found = ()
    if not found or min(found) < 2:
        raise argparse.ArgumentTypeError(f"must be numbers >= 2 as in 250,1000: {text}")
    return found


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("--agents", type=agents_of, default=AGENTS, help="numbers, with commas")
    add("--seconds", type=float, default=0.5, help="of a repetition (default: 0.5)")
    add("--repetitions", type=int, default=5, help="of which the best counts")
    add("--no-peer", action="store_true", help="do not measure simple_spread")
    add("--json", action="store_true", help="print JSON")
    options = parser.parse_args()
    if not (options.seconds > 0 and options.repetitions > 0):
        parser.error("--seconds and --repetitions must be > 0")
    found = measured(options)
    if options.json:
        print(json.dumps(found))
    else:
        show(found)


if __name__ == "__main__":
    main()
