"""Ant System, Ant Colony System and Max-Min Ant System on the travelling salesman problem.

What is compared: how short the shortest tour is after a number of tours, and how long
that takes. `as`, `acs` and `mmas` are the ants of this package, with the settings of
the literature. Beside them, on the same instance and with the same number of tours:

- `q-learning`, the tabular one of this package, and `dqn`, that of Stable-Baselines3.
  Both walk in the same environment and are told which cities are left.
- `colonyx`, a package of its own (`pip install colonyx`), and `acotsp`, the program of
  Stuetzle, for which `--acotsp` names the executable. Each runs the ant algorithms
  that are asked for as well, with the same parameters.

examples:
  python benchmarks/aco_tsp.py                          att48, all three, a table
  python benchmarks/aco_tsp.py --instance kroA100 --tours 100000 --seeds 25 --json
  python benchmarks/aco_tsp.py --algorithms as q-learning dqn --tours 2000
  python benchmarks/aco_tsp.py --algorithms as mmas acotsp --acotsp ../acotsp/acotsp
  python benchmarks/aco_tsp.py --instance lin318 --algorithms mmas --local-search 3-opt \\
      --seconds 10 --stop-at-optimum
  python benchmarks/aco_tsp.py --tsplib my_cities.tsp --algorithms mmas

A trial of m ants makes m tours: runs end with the trial that reaches `--tours`, the
limit of `--seconds`, or the optimum if that is asked for. Seconds are those of the
processor, without compilation and reading of files. JSON has `instance`, `optimum`
(null where it is not known) and `rows`, one for each run: `algorithm`, `seed`, `tours`,
`seconds`, `best`.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib import resources, util
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.wrappers.vector import RecordEpisodeStatistics
from tqdm.auto import tqdm

from acl_gym import AntColonySystem, AntSystem, MaxMinAntSystem, QLearning
from acl_gym.envs.graph.instances import (
    OPTIMA,
    TravellingSalesmanInstance,
    load_instance,
)
from acl_gym.envs.graph.tsplib import read_tsplib
from acl_gym.utils.text import replace_unprintable_letters

Row = dict[str, Any]

ENVIRONMENT = "acl_gym/TravellingSalesman-v0"
ANTS: dict[str, type[AntSystem | AntColonySystem | MaxMinAntSystem]] = {
    "as": AntSystem,
    "acs": AntColonySystem,
    "mmas": MaxMinAntSystem,
}
LEARNERS = ("q-learning", "dqn")
RIVALS = ("colonyx", "acotsp")
LOCAL_SEARCHES = ("2-opt", "or-opt", "3-opt")


@dataclass(frozen=True, kw_only=True)
class Task:
    """What all methods do.

    Attributes:
        instance: the cities.
        file: where it stands in TSPLIB's format.
        tours: how many tours a run makes, >= 1.
        seconds: limit on the processor's seconds of a run.
        stop_at_optimum: whether a run ends with an optimal tour.
        ants: ants of a colony, >= 1; None takes those of the literature.
        local_search: improves each tour of an ant; None: none.
        acotsp: the executable.
    """

    instance: TravellingSalesmanInstance
    file: Path
    tours: int
    seconds: float = math.inf
    stop_at_optimum: bool = False
    ants: int | None = None
    local_search: str | None = None
    acotsp: Path | None = None

    @property
    def target(self) -> float:
        """The length at which a run ends."""
        optimum = self.instance.optimum
        return optimum if self.stop_at_optimum and optimum is not None else -math.inf

    def ants_of(self, algorithm: str) -> int:
        """How many ants the colony of an algorithm has."""
        usual = ANTS[algorithm].usual_ants
        return self.ants or usual(self.instance.n_cities, self.local_search)

    def environment(self, slots: int) -> Any:
        return gym.make_vec(ENVIRONMENT, num_envs=slots, instance=self.instance)


def run_ants(algorithm: str, task: Task, seed: int) -> Row:
    """One run of a colony of this package."""
    ants = task.ants_of(algorithm)
    env = task.environment(ants)
    options: dict[str, Any] = {"local_search": task.local_search, "seed": seed}
    make = ANTS[algorithm]
    make(env, **options).learn(trials=2)  # Numba compiles
    start = time.process_time()
    agent = make(env, **options)

    def goes_on(agent: Any, row: Any) -> bool:
        late = time.process_time() - start >= task.seconds
        return not late and agent.best_cost > task.target

    agent.learn(trials=-(-task.tours // ants), callback=goes_on)
    seconds = time.process_time() - start
    tours = agent.trials * ants
    return result(algorithm, seed, tours, seconds, agent.best_cost)


def run_q_learning(task: Task, seed: int, slots: int = 10) -> Row:
    """One run of tabular Q-learning, whose states are the cities."""

    def make() -> tuple[Any, QLearning]:
        env = RecordEpisodeStatistics(task.environment(slots), buffer_length=slots)
        agent = QLearning(env, learning_rate=0.1, discount=1.0, epsilon=0.1, seed=seed)
        return env, agent

    make()[1].learn(trials=2)  # Numba compiles
    start = time.process_time()
    env, agent = make()
    best = math.inf

    def goes_on(agent: Any, row: Any) -> bool:
        nonlocal best
        best = min(best, -max(map(float, env.return_queue)))
        return time.process_time() - start < task.seconds and best > task.target

    agent.learn(trials=-(-task.tours // slots), callback=goes_on)
    seconds = time.process_time() - start
    return result("q-learning", seed, agent.trials * slots, seconds, best)


def run_dqn(task: Task, seed: int) -> Row:
    """One run of DQN, which knows the city and which others are left."""
    from masked_dqn import shortest_tour

    n = task.instance.n_cities
    # An arc of a good tour costs about 1.
    scale = 1.0 / float(np.median(np.sort(task.instance.distances, axis=1)[:, 1:4]))

    def make() -> Any:
        return gym.make(ENVIRONMENT, instance=task.instance)

    start = time.process_time()
    tours, best = shortest_tour(
        make, n, scale, task.tours, seed, task.seconds, task.target
    )
    return result("dqn", seed, tours, time.process_time() - start, best)


def run_colonyx(algorithm: str, task: Task, seed: int) -> Row:
    """One run of colonyx, which has no limit on time and knows no optimum."""
    import colonyx

    ants = task.ants_of(algorithm)
    trials = -(-task.tours // ants)
    agent = colonyx.AntColony(
        n_ants=ants,
        n_iterations=trials,
        rho=_evaporation(algorithm, task),
        use_two_opt=task.local_search is not None,
        variant={"as": "basic"}.get(algorithm, algorithm),
        random_state=seed,
    )
    start = time.process_time()
    agent.fit(task.instance.distances)
    seconds = time.process_time() - start
    return result(f"colonyx {algorithm}", seed, trials * ants, seconds, agent.score())


def run_acotsp(algorithm: str, task: Task, seed: int) -> Row:
    """One run of ACOTSP.

    Raises:
        ValueError: the program has failed.
    """
    ants = task.ants_of(algorithm)
    limited = task.seconds < math.inf
    command: list[Any] = [task.acotsp, "--tsplibfile", task.file, f"--{algorithm}"]
    command += ["--tries", 1, "--seed", seed + 1, "--ants", ants, "--quiet"]
    command += ["--rho", _evaporation(algorithm, task)]
    command += ["--localsearch", (None, *LOCAL_SEARCHES).index(task.local_search)]
    # It goes on until both limits are reached: one of them must be none.
    command += ["--time", task.seconds if limited else 0.001]
    command += ["--tours", 1 if limited else task.tours]
    if task.stop_at_optimum:
        command += ["--optimum", f"{task.instance.optimum:.0f}"]
    with tempfile.TemporaryDirectory() as folder:  # it writes files
        done = subprocess.run(
            list(map(str, command)),
            cwd=folder,
            capture_output=True,
            text=True,
            errors="replace",
            check=False,
        )
    found = {
        name: re.search(pattern, done.stdout)
        for name, pattern in {
            "best": r"Best (\d+), found",
            "seconds": r"t_avgtotal = ([\d.]+)",
        }.items()
    }
    best, seconds = found["best"], found["seconds"]
    if done.returncode or best is None or seconds is None:
        said = (done.stderr or done.stdout).strip().splitlines()[-1:] or ["nothing"]
        raise ValueError(
            f"--acotsp must be the program ACOTSP 1.03, {task.acotsp} ended with "
            f"{done.returncode} and said: {said[0]}"
        )
    # How many tours it made in a limited time, it does not say.
    tours = None if limited or task.stop_at_optimum else -(-task.tours // ants) * ants
    return result(f"acotsp {algorithm}", seed, tours, float(seconds[1]), float(best[1]))


def _evaporation(algorithm: str, task: Task) -> float:
    """rho of the ants of this package."""
    agent = ANTS[algorithm](task.environment(1), local_search=task.local_search)
    return float(agent.global_decay)


def result(
    algorithm: str, seed: int, tours: int | None, seconds: float, best: float
) -> Row:
    return {
        "algorithm": algorithm,
        "seed": seed,
        "tours": tours,
        "seconds": seconds,
        "best": float(best),
    }


def runs_of(names: Sequence[str], task: Task) -> list[Callable[[int], Row]]:
    """What is run with each seed; rivals run the ant algorithms among the names."""
    ants = [name for name in names if name in ANTS] or list(ANTS)
    found: list[Callable[[int], Row]] = []
    for name in dict.fromkeys(names):
        if name in ANTS:
            found.append(lambda seed, name=name: run_ants(name, task, seed))
        elif name == "q-learning":
            found.append(lambda seed: run_q_learning(task, seed))
        elif name == "dqn":
            found.append(lambda seed: run_dqn(task, seed))
        else:
            run = run_colonyx if name == "colonyx" else run_acotsp
            found += [
                lambda seed, run=run, each=each: run(each, task, seed) for each in ants
            ]
    return found


def table(rows: Sequence[Row], optimum: float | None) -> str:
    """A line for each algorithm, in Markdown."""
    lines = [
        "| algorithm | runs | mean best | sd | shortest | over the optimum | tours/s "
        "| seconds of a run |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for name in dict.fromkeys(row["algorithm"] for row in rows):
        mine = [row for row in rows if row["algorithm"] == name]
        best = [row["best"] for row in mine]
        seconds = statistics.median(row["seconds"] for row in mine)
        mean = statistics.fmean(best)
        speeds = [
            row["tours"] / row["seconds"]
            for row in mine
            if row["tours"] is not None and row["seconds"] > 0
        ]
        cells = [
            name,
            str(len(mine)),
            f"{mean:,.1f}",
            f"{statistics.stdev(best):,.1f}" if len(best) > 1 else "",
            f"{min(best):,.6g}",
            "" if not optimum else f"{mean / optimum - 1:.2%}",
            f"{statistics.median(speeds):,.0f}" if speeds else "",
            f"{seconds:.3g}",
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run and print; returns the exit code: 2 for what cannot be run as asked."""
    options = _parser().parse_args(arguments)
    try:
        with resources.as_file(_data(options.instance)) as shipped:
            task = _task(options, shipped)
            rows = _rows(options, task)
    except (ValueError, OSError) as error:
        print(f"aco_tsp.py: {error}", file=sys.stderr)
        return 2
    optimum = task.instance.optimum
    if options.json:
        found = {"instance": task.instance.name, "optimum": optimum, "rows": rows}
        print(json.dumps(found))
        return 0
    known = "not known" if optimum is None else f"{optimum:,.6g}"
    print(f"{task.instance.name}: {task.instance.n_cities} cities, optimum {known}\n")
    print(table(rows, optimum))
    return 0


def _rows(options: argparse.Namespace, task: Task) -> list[Row]:
    seeds = range(options.seed, options.seed + options.seeds)
    jobs = [(run, seed) for run in runs_of(options.algorithms, task) for seed in seeds]
    return [run(seed) for run, seed in tqdm(jobs, unit="run", disable=None)]


def _data(name: str) -> Any:
    return resources.files("acl_gym.envs.graph").joinpath("data", f"{name}.tsp")


def _task(options: argparse.Namespace, shipped: Path) -> Task:
    """What the options ask for.

    Raises:
        ValueError: they cannot be had, or not together.
    """
    file = shipped if options.tsplib is None else options.tsplib.absolute()
    instance = load_instance(options.instance)
    if options.tsplib is not None:
        instance = read_tsplib(file)
        known = OPTIMA.get(instance.name)
        if instance.optimum is None and options.optimum is None and known:
            options.optimum = known
    if options.optimum is not None:
        instance = replace(instance, optimum=options.optimum)
    if options.stop_at_optimum and instance.optimum is None:
        raise ValueError(
            f"--stop-at-optimum needs the optimum, which is not known of {instance.name}"
            "; give it by --optimum."
        )
    if "colonyx" in options.algorithms and util.find_spec("colonyx") is None:
        raise ValueError("colonyx is not installed; pip install colonyx.")
    if "acotsp" in options.algorithms:
        if options.acotsp is None or not os.access(options.acotsp, os.X_OK):
            raise ValueError(
                "acotsp needs --acotsp PATH, the executable of ACOTSP 1.03, got "
                f"{str(options.acotsp)!r}; it can be had from "
                "http://www.aco-metaheuristic.org/aco-code."
            )
        if not instance.symmetric:
            raise ValueError(f"acotsp knows no asymmetric instance: {instance.name}.")
    return Task(
        instance=instance,
        file=file,
        tours=options.tours or 100 * instance.n_cities,
        seconds=options.seconds,
        stop_at_optimum=options.stop_at_optimum,
        ants=options.ants,
        local_search=options.local_search,
        acotsp=None if options.acotsp is None else options.acotsp.absolute(),
    )


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add(
        "--instance",
        choices=tuple(OPTIMA),
        default="att48",
        help="of those that come with the package (default: %(default)s)",
    )
    add("--tsplib", type=Path, metavar="PATH", help="a file of TSPLIB in its place")
    add(
        "--optimum",
        type=_positive,
        metavar="LENGTH",
        help="the length of a shortest tour of --tsplib, where it is known",
    )
    add(
        "--algorithms",
        nargs="+",
        choices=(*ANTS, *LEARNERS, *RIVALS),
        default=list(ANTS),
        help="what is run (default: as acs mmas)",
    )
    add(
        "--tours",
        type=_at_least(1),
        metavar="N",
        help="tours of each run (default: 100 for each city)",
    )
    add("--seconds", type=_positive, default=math.inf, help="the most of each run")
    add(
        "--stop-at-optimum",
        action="store_true",
        help="end a run with a tour that is as short as the optimum",
    )
    add(
        "--ants",
        type=_at_least(1),
        metavar="M",
        help="ants of a colony (default: as many as cities, 10 of acs; 25 of as and mmas"
        " with local search)",
    )
    add(
        "--local-search",
        choices=LOCAL_SEARCHES,
        help="improves each tour of an ant (default: none)",
    )
    add(
        "--seeds",
        type=_at_least(1),
        default=5,
        metavar="N",
        help="runs of each algorithm (default: %(default)s)",
    )
    add("--seed", type=_at_least(0), default=0, metavar="N", help="the first seed")
    add("--acotsp", type=Path, metavar="PATH", help="the executable of ACOTSP")
    add("--json", action="store_true", help="print JSON, no table")
    return parser


def _at_least(least: int) -> Callable[[str], int]:
    def whole(text: str) -> int:
        if not (text.isdecimal() and int(text) >= least):
            raise argparse.ArgumentTypeError(
                f"must be an integer >= {least}, got {text!r}"
            )
        return int(text)

    return whole


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"must be a number > 0, got {text!r}")
    return value


if __name__ == "__main__":
    replace_unprintable_letters()
    raise SystemExit(main())
