"""Particle swarms of acl-gym beside those of pyswarms and pygmo: quality and speed.

Every method minimizes the same NumPy functions with as many evaluations, particles, the
same ranges, coefficients and limit of velocity, with everyone or with the two beside them
on a ring as neighbours. Packages differ in what bounds do, and in whether a particle on a
ring counts among its own neighbours; acl-gym does either, so that each peer is compared
with the same algorithm (`as pyswarms`, `as pygmo`), and with acl-gym's own defaults.
Speed is measured in searches of 100,000 evaluations.

Peers have an environment of their own, `make peers-swarms`; without it they are left out.

examples:
  python benchmarks/particle_swarms.py                             all, a quarter of an hour
  python benchmarks/particle_swarms.py --functions sphere --seeds 5 --evaluations 60000
  python benchmarks/particle_swarms.py --methods acl-gym pygmo --json
  python benchmarks/particle_swarms.py --only speed
"""

from __future__ import annotations

import contextlib
import importlib.metadata
import importlib.util
import json
import logging
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import mannwhitneyu
from tqdm import tqdm

from acl_gym.swarm import Ring, minimize
from acl_gym.swarm.pso import constriction_coefficients
from acl_gym.swarm.pso.benchmark_functions import (
    BENCHMARK_FUNCTIONS,
    BenchmarkFunction,
)
from acl_gym.utils.compiling import njit

from tables import (  # isort: skip  # the script beside this one
    Row,
    add_json,
    add_seeds,
    at_least_one,
    markdown,
    number,
    parser_of,
    seed,
)

INERTIA, ACCELERATION = constriction_coefficients()
PARTICLES, VARIABLES = 40, 30

ROUNDING = {"rastrigin": 1e-12, "ackley": 1e-12, "griewank": 1e-12}
"""Values that count as 0 in rank tests: these functions subtract numbers of the size of 1
to 300 from each other, so that what is left near their minimum is rounding."""

LIMIT = 0.5
"""Largest velocity, as a share of the range of each variable: pygmo's default."""

TOPOLOGIES = ("global", "ring")


@dataclass(frozen=True)
class Task:
    """What is minimized, by how many evaluations, and who hears whom."""

    problem: BenchmarkFunction
    topology: str
    evaluations: int

    @property
    def limit(self) -> float:
        """The largest velocity."""
        return 2.0 * self.problem.largest * LIMIT


def with_acl_gym(task: Task, seed: int, **changes: Any) -> float:
    """`minimize`; by default particles are reflected, and hear themselves."""
    return minimize(
        task.problem.function,
        task.problem.bounds(VARIABLES),
        **{
            "n_particles": PARTICLES,
            "max_evaluations": task.evaluations,
            "seed": seed,
            "topology": task.topology,
            "velocity_limit": task.limit,
            **changes,
        },
    ).fun


def as_pyswarms(task: Task, seed: int) -> float:
    """Positions are clipped, and velocities are not."""
    return with_acl_gym(task, seed, boundary="clip")


def as_pygmo(task: Task, seed: int) -> float:
    """Particles stop at bounds; on a ring they hear the others only."""
    ring = {"topology": Ring(include_self=False)} if task.topology == "ring" else {}
    return with_acl_gym(task, seed, boundary="absorb", **ring)


def with_pyswarms(task: Task, seed: int) -> float:
    """Its own ring links each particle with those that begin nearest to it in space.

    Here it is given the same ring as the others.
    """
    logging.disable(logging.CRITICAL)  # it logs every run
    np.random.seed(seed)  # noqa: NPY002 - it draws from NumPy's global state
    largest = np.full(VARIABLES, task.problem.largest)
    options = {"w": INERTIA, "c1": ACCELERATION, "c2": ACCELERATION}
    settings: dict[str, Any] = {
        "n_particles": PARTICLES,
        "dimensions": VARIABLES,
        "bounds": (-largest, largest),
        "bh_strategy": "nearest",
        "velocity_clamp": (-task.limit, task.limit),
    }
    # It writes report.log into the folder where it is imported and used.
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        from pyswarms.backend.topology import Ring as RingOfPyswarms
        from pyswarms.single import GeneralOptimizerPSO, GlobalBestPSO

        if task.topology == "ring":
            ring = RingOfPyswarms(static=True)
            beside = np.arange(PARTICLES)[:, None] + np.array([-1, 0, 1])
            ring.neighbor_idx = beside % PARTICLES
            options = {**options, "k": 3, "p": 2}
            swarm = GeneralOptimizerPSO(topology=ring, options=options, **settings)
        else:
            swarm = GlobalBestPSO(options=options, **settings)
        found, _ = swarm.optimize(
            task.problem.function, task.evaluations // PARTICLES, verbose=False
        )
        for handler in logging.getLogger().handlers[:]:
            if isinstance(handler, logging.FileHandler):
                handler.close()
    return float(found)


class PygmoProblem:
    """A function as pygmo calls it, one point or many at a time."""

    def __init__(self, problem: BenchmarkFunction) -> None:
        self.problem = problem

    def fitness(self, point: NDArray[np.float64]) -> NDArray[np.float64]:
        """The value at a point."""
        return self.problem.function(point[None])

    def batch_fitness(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """The values at many points."""
        return self.problem.function(points.reshape(-1, VARIABLES))

    def get_bounds(self) -> tuple[list[float], list[float]]:
        """The range of each variable."""
        largest = [self.problem.largest] * VARIABLES
        return [-each for each in largest], largest


def pygmo_settings(task: Task, seed: int) -> dict[str, Any]:
    """With constriction coefficients; a ring of the two beside each particle."""
    return {
        "gen": task.evaluations // PARTICLES - 1,  # after the first positions
        "omega": INERTIA,
        "eta1": ACCELERATION / INERTIA,
        "eta2": ACCELERATION / INERTIA,
        "max_vel": LIMIT,
        "variant": 5,
        "neighb_type": 2 if task.topology == "ring" else 1,
        "neighb_param": 2,
        "seed": seed,
    }


def with_pygmo(task: Task, seed: int) -> float:
    """Its synchronous swarm, `pso_gen`, which evaluates all particles at once."""
    import pygmo

    algorithm = pygmo.pso_gen(**pygmo_settings(task, seed))
    algorithm.set_bfe(pygmo.bfe(pygmo.member_bfe()))
    population = pygmo.population(
        pygmo.problem(PygmoProblem(task.problem)), PARTICLES, seed=seed
    )
    return float(pygmo.algorithm(algorithm).evolve(population).champion_f[0])


METHODS: dict[str, Callable[[Task, int], float]] = {
    "acl-gym": with_acl_gym,
    "as pyswarms": as_pyswarms,
    "pyswarms": with_pyswarms,
    "as pygmo": as_pygmo,
    "pygmo": with_pygmo,
}
PEERS = {"pyswarms": "as pyswarms", "pygmo": "as pygmo"}
"""Peer -> what makes acl-gym the same algorithm."""


def quality(
    functions: list[str],
    topologies: list[str],
    methods: list[str],
    seeds: range,
    evaluations: int,
) -> list[Row]:
    """Values of all runs: a row for each function, topology and method."""
    rows = []
    cases = [(name, topology) for name in functions for topology in topologies]
    with tqdm(
        total=len(cases) * len(seeds) * len(methods), unit="run", disable=None
    ) as bar:
        for name, topology in cases:
            task = Task(BENCHMARK_FUNCTIONS[name], topology, evaluations)
            found: dict[str, Row] = {
                method: {
                    "function": name,
                    "topology": topology,
                    "method": method,
                    "values": [],
                }
                for method in methods
            }
            for seed in seeds:
                for method in methods:
                    bar.set_description(f"{name}, {topology}, {method}")
                    found[method]["values"].append(METHODS[method](task, seed))
                    bar.update()
            for row in found.values():
                row["median"] = statistics.median(row["values"])
                rows.append(row)
    return rows


def rank_tests(rows: list[Row]) -> list[Row]:
    """Whether acl-gym's values are larger than those of a peer.

    Returns:
        For each function and topology, and for each peer: `p` of the one-sided rank
        test (Mann-Whitney) for the same algorithm in acl-gym, and `p_defaults` for its
        own defaults; both small where acl-gym is worse.
    """
    found = {}
    for row in rows:
        values = np.array(row["values"])
        values[values < ROUNDING.get(row["function"], 0.0)] = 0.0
        found[row["function"], row["topology"], row["method"]] = values
    tests = []
    for function, topology, peer in found:
        if peer not in PEERS:
            continue
        test = {"function": function, "topology": topology, "peer": peer}
        for key, method in (("p", PEERS[peer]), ("p_defaults", "acl-gym")):
            own, theirs = (
                found.get((function, topology, each)) for each in (method, peer)
            )
            if own is not None:
                test[key] = float(
                    mannwhitneyu(own, theirs, alternative="greater").pvalue
                )
        tests.append(test)
    return tests


@njit(error_model="numpy")
def compiled_sphere(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sphere without an array for the squares."""
    values = np.empty(points.shape[0])
    for i in range(points.shape[0]):
        total = 0.0
        for k in range(points.shape[1]):
            total += points[i, k] * points[i, k]
        values[i] = total
    return values


def numpy_swarm(task: Task, seed: int) -> float:
    """The swarm as a few lines of NumPy, without bounds: what one writes by hand."""
    rng = np.random.default_rng(seed)
    function, largest = task.problem.function, task.problem.largest
    shape = PARTICLES, VARIABLES
    theta, nu = rng.uniform(-largest, largest, shape), np.zeros(shape)
    best, values = theta.copy(), function(theta)
    for _ in range(task.evaluations // PARTICLES - 1):
        r1, r2 = rng.random(shape), rng.random(shape)
        everyones = best[values.argmin()]
        nu = INERTIA * nu + ACCELERATION * (
            r1 * (best - theta) + r2 * (everyones - theta)
        )
        theta = theta + nu
        found = function(theta)
        better = found < values
        best[better], values[better] = theta[better], found[better]
    return float(values.min())


def pygmo_compiled(task: Task, seed: int, name: str) -> float:
    """One of pygmo's swarms on its own Rastrigin, both in C++."""
    import pygmo

    problem = pygmo.problem(pygmo.rastrigin(VARIABLES))
    population = pygmo.population(problem, PARTICLES, seed=seed)
    algorithm = getattr(pygmo, name)(**pygmo_settings(task, seed))
    return float(pygmo.algorithm(algorithm).evolve(population).champion_f[0])


def speed(
    functions: list[str], methods: list[str], repetitions: int, evaluations: int
) -> list[Row]:
    """Evaluations a second with global neighbours, the methods taking turns.

    Seconds are those of the processor, so that other programs count as little as
    possible; every method uses one thread.
    """
    cases: dict[str, tuple[str, Callable[[Task, int], float]]] = {}
    for name in functions:
        for method in methods:
            if method not in PEERS.values():
                cases[f"{name}, {method}"] = name, METHODS[method]
        cases[f"{name}, NumPy by hand, without bounds"] = name, numpy_swarm
    if "acl-gym" in methods and "sphere" in functions:
        compiled = BenchmarkFunction(compiled_sphere, 100.0, 0.0)
        cases["sphere, acl-gym, function compiled by Numba"] = (
            "sphere",
            lambda task, seed: with_acl_gym(
                Task(compiled, task.topology, task.evaluations), seed
            ),
        )
    if "pygmo" in methods and "rastrigin" in functions:
        for name in ("pso", "pso_gen"):
            cases[f"rastrigin, pygmo.{name}, function in C++"] = (
                "rastrigin",
                lambda task, seed, name=name: pygmo_compiled(task, seed, name),
            )
    rates: dict[str, list[float]] = {title: [] for title in cases}
    for repetition in range(repetitions + 1):
        for title, (name, method) in cases.items():
            task = Task(BENCHMARK_FUNCTIONS[name], "global", evaluations)
            began = time.process_time()
            method(task, repetition)
            rates[title].append(evaluations / (time.process_time() - began))
    # The first repetition, which compiles and imports, does not count.
    return [
        {"case": title, "rates": each[1:], "median": statistics.median(each[1:])}
        for title, each in rates.items()
    ]


def printed(rows: list[Row], tests: list[Row]) -> Iterator[str]:
    """The tables, as Markdown."""
    methods = list(dict.fromkeys(row["method"] for row in rows))
    cases: dict[tuple[str, str], dict[str, Row]] = {}
    for row in rows:
        cases.setdefault((row["function"], row["topology"]), {})[row["method"]] = row
    yield "Median of the values found\n"
    yield markdown(
        ["function", "neighbours", *methods],
        [
            [*case, *(f"{found[each]['median']:.3g}" for each in methods)]
            for case, found in cases.items()
        ],
        names=(0, 1),
    )
    yield ""
    if tests:
        yield "p of the one-sided rank test: small where acl-gym is worse\n"
        names = ("function", "topology", "peer")
        yield markdown(
            ["function", "neighbours", "peer", "same algorithm", "acl-gym's defaults"],
            [
                [*(test[name] for name in names)]
                + [number(test.get(key), ".3g") for key in ("p", "p_defaults")]
                for test in tests
            ],
            names=(0, 1, 2),
        )
        yield ""


def available(methods: list[str]) -> list[str]:
    """The methods whose package is installed; the others are named on stderr."""
    found = []
    for method in methods:
        if method in PEERS and importlib.util.find_spec(method) is None:
            print(
                f"{method} is left out: it is not installed here; `make peers-swarms` "
                "makes an environment with it.",
                file=sys.stderr,
            )
        else:
            found.append(method)
    return found


def main() -> None:
    """Measure and print."""
    parser = parser_of(__doc__)
    names = list(BENCHMARK_FUNCTIONS)
    parser.add_argument("--functions", nargs="+", choices=names, default=names)
    parser.add_argument(
        "--methods", nargs="+", choices=list(METHODS), default=list(METHODS)
    )
    parser.add_argument(
        "--topologies", nargs="+", choices=TOPOLOGIES, default=list(TOPOLOGIES)
    )
    add_seeds(parser, 30)
    parser.add_argument("--first-seed", type=seed, default=0, help="of those runs (0)")
    parser.add_argument(
        "--evaluations",
        type=at_least_one,
        default=300_000,
        help="of each run (300,000)",
    )
    parser.add_argument("--only", choices=("quality", "speed"))
    parser.add_argument(
        "--repetitions",
        type=at_least_one,
        default=7,
        help="of each measurement of speed (7)",
    )
    add_json(parser)
    options = parser.parse_args()
    if options.evaluations < 3 * PARTICLES:
        parser.error(
            f"--evaluations must be at least {3 * PARTICLES}, got {options.evaluations}."
        )
    methods = available(options.methods)
    if not methods:
        parser.error("none of the methods is installed.")

    found: dict[str, Any] = {
        "particles": PARTICLES,
        "variables": VARIABLES,
        "evaluations": options.evaluations,
        "versions": {
            peer: importlib.metadata.version(peer) for peer in PEERS if peer in methods
        },
    }
    if options.only != "speed":
        found["quality"] = quality(
            options.functions,
            options.topologies,
            methods,
            range(options.first_seed, options.first_seed + options.seeds),
            options.evaluations,
        )
        found["rank_tests"] = rank_tests(found["quality"])
    if options.only != "quality":
        found["speed"] = speed(
            options.functions,
            methods,
            options.repetitions,
            min(options.evaluations, 100_000),
        )
    if options.json:
        print(json.dumps(found))
        return
    if "quality" in found:
        print("\n".join(printed(found["quality"], found["rank_tests"])))
    for row in found.get("speed", []):
        print(f"{row['median'] / 1e6:6.2f} million evaluations a second: {row['case']}")


if __name__ == "__main__":
    main()
