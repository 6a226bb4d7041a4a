"""The throughput of environments and colonies, with other software in the same run.

Every value is the median of several repetitions, on one thread unless its name says
otherwise. A repetition goes through all cases, with EnvPool and gymnax last, before the
next one begins, so that a slow period of the machine affects all cases alike. Only ratios
can be compared between days or machines.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import os
import platform
import re
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table
from speed_cases import COMPLETE_RUN, SYSTEMS, Plan, learn, plan
from speed_criteria import complete_run_row, criteria
from tqdm.auto import tqdm

import acl_gym
from acl_gym.utils.text import replace_unprintable_letters

SIZES = (1, 16, 250, 2_000, 20_000)
PEERS_PYTHON = Path(__file__).resolve().parents[1] / ".venv-peers" / "bin" / "python"
PEER_SLOTS = 2_048


@dataclass(frozen=True)
class Case:
    """A measured case.

    Attributes:
        name: what was measured.
        system: one of `SYSTEMS`, or "peers".
        n_ants: slots of the environment.
        steps_per_second: slot-steps per second, median.
        slowest: steps per second in the slowest repetition.
        fastest: steps per second in the fastest repetition.
        seconds: of one repetition, median.
        reference: the case to which the ratio is taken, by name; its own if none.
        ratio_to_reference: ratio of the steps per second to those of the reference;
            for a complete run, the time of the reference over that of the run.
        load: mean number of running tasks during the measurement, including the
            measurement itself, from `os.getloadavg`.
    """

    name: str
    system: str
    n_ants: int
    steps_per_second: float
    slowest: float
    fastest: float
    seconds: float
    reference: str
    ratio_to_reference: float
    load: float


Peers = dict[str, dict[str, Any]]
"""By case of another project: `n_ants`, and lists of `rates` and `loads`."""


def measure(
    plans: list[Plan], repetitions: int, progress: bool, with_peers: bool
) -> tuple[dict[str, list[tuple[int, float, float]]], Peers]:
    """Steps, seconds and load of each repetition of each case; and the peers' rates."""
    found: dict[str, list[tuple[int, float, float]]] = defaultdict(list)
    works, peers = {}, Peers()
    with tqdm(total=len(plans) * (repetitions + 1), disable=not progress) as bar:
        for one in plans:  # warm up: compile, fill caches
            works[one.name] = one.make()
            works[one.name]()
            bar.update()
        for _ in range(repetitions):
            for one in plans:
                bar.update()
                start = time.perf_counter()
                steps = works[one.name]()
                seconds = time.perf_counter() - start
                found[one.name].append((steps, seconds, os.getloadavg()[0]))
            for peer in measure_peers() if with_peers else []:
                known = peers.setdefault(
                    peer["name"], {"n_ants": peer["n_ants"], "rates": [], "loads": []}
                )
                known["rates"] += peer["rates"]
                known["loads"].append(os.getloadavg()[0])
    return found, peers


def measure_peers() -> list[dict[str, Any]]:
    """One repetition of peers.py, if `make bench-peers` has made its environment."""
    if not PEERS_PYTHON.exists():
        return []
    script = Path(__file__).with_name("peers.py")
    done = subprocess.run(
        [PEERS_PYTHON, script, str(PEER_SLOTS), "1"],
        capture_output=True,
        text=True,
        check=False,
    )
    sys.stderr.write("".join(re.findall(r".* is left out: .*\n", done.stderr)))
    if done.returncode != 0:
        print(f"peers.py failed:\n{done.stderr[-800:]}", file=sys.stderr)
        return []
    cases: list[dict[str, Any]] = json.loads(done.stdout)
    return cases


def as_cases(
    plans: list[Plan],
    found: dict[str, list[tuple[int, float, float]]],
    peers: Peers,
) -> list[Case]:
    """Compute medians, spreads and ratios."""
    rates = {
        name: [steps / seconds for steps, seconds, _ in results]
        for name, results in found.items()
    }
    seconds = {
        name: statistics.median(result[1] for result in results)
        for name, results in found.items()
    }
    middle = {name: statistics.median(values) for name, values in rates.items()}
    cases = []
    for one in plans:
        name, reference = one.name, one.reference or one.name
        if reference not in middle:
            reference = name
        ratio = middle[name] / middle[reference]
        if one.by_seconds:
            ratio = seconds[reference] / seconds[name]
        load = statistics.fmean(result[2] for result in found[name])
        cases.append(
            Case(
                name,
                one.system,
                one.n_ants,
                middle[name],
                min(rates[name]),
                max(rates[name]),
                seconds[name],
                reference,
                ratio,
                load,
            )
        )
    ours = next((c for c in cases if c.name.startswith("pendulum alone, 2,048")), None)
    for name, peer in peers.items():
        rate = statistics.median(peer["rates"])
        cases.append(
            Case(
                name,
                "peers",
                peer["n_ants"],
                rate,
                min(peer["rates"]),
                max(peer["rates"]),
                peer["n_ants"] / rate,
                ours.name if ours else name,
                rate / ours.steps_per_second if ours else 1.0,
                statistics.fmean(peer["loads"]),
            )
        )
    return cases


FIRST_TRIAL = (
    "import gymnasium as gym, time; from acl_gym import ACL; "
    "from acl_gym.partitions.automatic import thesis_partition; start = time.perf_counter(); "
    "env = gym.make_vec('acl_gym/Pendulum-v0', num_envs=2); "
    "ACL(env, thesis_partition(env), seed=0, max_steps=2).learn(trials=1); "
    "print(time.perf_counter() - start)"
)


def startup_seconds(repetitions: int) -> dict[str, float]:
    """Seconds of `import acl_gym`, and of a first trial without and with a cache."""
    imported = (
        "import time; start = time.perf_counter(); import acl_gym; "
        "print(time.perf_counter() - start)"
    )

    def seconds(code: str, cache: str) -> float:
        done = subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True,
            text=True,
            check=True,
            env={**os.environ, "NUMBA_CACHE_DIR": cache},
        )
        return float(done.stdout)

    with tempfile.TemporaryDirectory() as cache:
        first = seconds(FIRST_TRIAL, cache)
        again = [seconds(FIRST_TRIAL, cache) for _ in range(repetitions)]
        imports = [seconds(imported, cache) for _ in range(repetitions)]
    return {
        "import acl_gym": statistics.median(imports),
        "first trial on a machine, kernels compiled": first,
        "first trial in a process, kernels from the cache": statistics.median(again),
    }


def measure_memory(n_ants: int) -> dict[str, float]:
    """Peak memory of one trial of the fuzzy navigation, 300 steps, in this process."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    learn("navigation", "fuzzy", 100, trials=1)()
    compiled = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    steps = learn("navigation", "fuzzy", n_ants, trials=1)()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return {
        "n_ants": n_ants,
        "ant_steps": steps,
        "gib_before": before / 2**20,
        "gib_peak": peak / 2**20,
        "bytes_per_ant_step": (peak - compiled) * 1024 / (n_ants * 300),
    }


def as_table(cases: list[Case]) -> Table:
    """The cases as a table for the terminal, one section per system."""
    table = Table(
        title=f"acl-gym {acl_gym.__version__}: slot-steps per second, medians",
        caption="ratio: of steps per second; for a complete run, of the time of the "
        "reference to that of the run",
    )
    table.add_column("case", no_wrap=True)
    for heading in ("steps/s", "ns/step", "spread", "load", "ratio"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("to", no_wrap=True)
    for system in (*SYSTEMS, "peers"):
        for case in (case for case in cases if case.system == system):
            own = case.reference == case.name
            spread = (case.fastest - case.slowest) / case.steps_per_second
            table.add_row(
                case.name,
                f"{case.steps_per_second:,.0f}",
                f"{1e9 / case.steps_per_second:,.0f}",
                f"{spread:.0%}",
                f"{case.load:.1f}",
                "" if own else f"{case.ratio_to_reference:.2f}",
                "" if own else case.reference,
            )
        table.add_section()
    return table


def machine() -> dict[str, Any]:
    """The machine and the versions of the software."""
    names = ("numpy", "numba", "gymnasium", "stable-baselines3", "torch")
    cpu = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        found = re.search(r"model name\s*: (.*)", info.read_text())
        cpu = found.group(1) if found else cpu
    return {
        "processor": cpu,
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        **{name: importlib.metadata.version(name) for name in names},
    }


def parse(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    add = parser.add_argument
    add("--json", action="store_true", help="print JSON instead of a table")
    add(
        "--figure",
        metavar="FILE",
        help="draw steps per second over ants (.png, .svg, .pdf)",
    )
    add(
        "--quick",
        action="store_true",
        help="few repetitions and sizes, for a quick check",
    )
    add("--systems", nargs="+", choices=SYSTEMS, default=list(SYSTEMS))
    add("--ants", nargs="+", type=int, metavar="N", default=None)
    add("--repetitions", type=int, metavar="N", default=None, help="default: 5")
    add(
        "--only",
        metavar="PATTERN",
        help="only cases whose name matches, and their references",
    )
    add("--no-peers", action="store_true", help="do not measure EnvPool and gymnax")
    add(
        "--memory",
        type=int,
        metavar="ANTS",
        help="only measure the memory of one trial of the navigation",
    )
    options = parser.parse_args(arguments)
    if options.ants is not None and min(options.ants) < 1:
        parser.error("--ants must be 1 or more")
    for name in ("repetitions", "memory"):
        value = getattr(options, name)
        if value is not None and value < 1:
            parser.error(f"--{name} must be 1 or more, got {value}")
    if options.only:
        try:
            re.compile(options.only)
        except re.error as error:
            parser.error(f"--only must be a regular expression, got {error}")
    if options.figure:
        # Checked now, not after minutes of measuring.
        path = Path(options.figure)
        if path.suffix not in (".png", ".svg", ".pdf") or not path.parent.is_dir():
            parser.error(
                "--figure must be a .png, .svg or .pdf file in an existing folder, got "
                f"{options.figure}"
            )
    return options


def main(arguments: list[str] | None = None) -> int:
    """Measure and print; returns the exit code."""
    options = parse(arguments)
    if options.memory is not None:
        print(json.dumps(measure_memory(options.memory), indent=1))
        return 0
    repetitions = options.repetitions or (1 if options.quick else 5)
    sizes = options.ants or ((250,) if options.quick else SIZES)
    plans = list(plan(options.systems, sizes, 2_000 if options.quick else 5_000))
    if options.only:
        wanted = {p.name for p in plans if re.search(options.only, p.name)}
        wanted |= {p.reference for p in plans if p.name in wanted}
        plans = [p for p in plans if p.name in wanted]
        if not plans:
            print(
                f"throughput.py: error: --only {options.only}: no case matches",
                file=sys.stderr,
            )
            return 2
    with_peers = not (options.no_peers or options.quick)
    found, peers = measure(plans, repetitions, not options.json, with_peers)
    cases = as_cases(plans, found, peers)
    rows = criteria({case.name: case.steps_per_second for case in cases})
    rows += [
        complete_run_row(case.seconds) for case in cases if case.name == COMPLETE_RUN
    ]
    result = {
        "cases": [asdict(case) for case in cases],
        "criteria": rows,
        "startup": {} if options.only else startup_seconds(min(repetitions, 5)),
        "machine": machine(),
    }
    if options.json:
        print(json.dumps(result, indent=1))
    else:
        console = Console(width=150) if not sys.stdout.isatty() else Console()
        console.print(as_table(cases))
        for each in result["criteria"]:
            mark = "met" if each["met"] else "NOT met"
            console.print(
                f"{each['what']}: {each['measured']:.2f} "
                f"({each['asked']} {each['bound']:g}: {mark})"
            )
        for name, seconds in result["startup"].items():
            console.print(f"{name}: {seconds:.2f} s")
    if options.figure:
        from speed_figure import draw

        draw(result["cases"], options.figure)
    return 0


if __name__ == "__main__":
    replace_unprintable_letters()
    raise SystemExit(main())
