"""The main job: ACL against reinforcement learning, from runs to report."""

from __future__ import annotations

import hashlib
import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
)

import acl_gym
from acl_gym.experiments import contestants, figures, report, statistics, wording
from acl_gym.experiments.contestants import PRESETS
from acl_gym.experiments.courses import COURSES, Course
from acl_gym.experiments.pictures import PICTURES
from acl_gym.experiments.runner import Task, run_tasks
from acl_gym.utils.files import write_atomically

Comparison = dict[str, Any]
"""All that a report needs, JSON types only; see `_collect`."""

ENVIRONMENTS = tuple(COURSES)


def compare(
    env_id: str,
    preset: str,
    agents: Sequence[str] | None,
    seeds: int | None,
    directory: Path,
    *,
    first_seed: int = 0,
    fresh: bool = False,
    workers: int | None = None,
    console: Console | None = None,
) -> Comparison:
    """Run the comparison, write its files into `directory`, and print its table.

    Args:
        env_id: one of `ENVIRONMENTS`.
        preset: a key of `PRESETS`.
        agents: some of the methods of the environment's course; None takes them all.
        seeds: runs of each agent; None takes the preset's number.
        directory: receives results.json, results.parquet, report.html, figures, and
            in runs/, for each environment apart, the result of each run.
        first_seed: the seeds are this one and those that follow it.
        fresh: make every run anew, also those that are there.
        workers: processes; None takes one for each core.
        console: where to print.

    Raises:
        TaskFailedError: a run failed; the others are kept.
    """
    console = console or Console()
    course, count = COURSES[env_id], PRESETS[preset] if seeds is None else seeds
    methods = list(course.methods) if agents is None else list(agents)
    workers = workers or os.cpu_count() or 1
    tasks = list_tasks(course, preset, methods, range(first_seed, first_seed + count))
    runs_directory = directory / "runs" / short_name(env_id)
    if fresh:
        for task in tasks:
            (runs_directory / f"{task.name}.json").unlink(missing_ok=True)
    # Here once, not in every process: Numba's cache is no place for a race.
    with console.status("Compiling the kernels (some 30 seconds, the first time)"):
        contestants.compile_all(course, course.budgets[preset])
    with _Bar(console, [task.name for task in tasks]) as bar:
        reference, *runs = run_tasks(
            tasks, runs_directory, workers=workers, progress=bar.tell
        )
    comparison = _collect(course, preset, reference, runs)
    write_results(comparison, directory, console)
    return comparison


def short_name(env_id: str) -> str:
    """The name of an environment in files: Pendulum of acl_gym/Pendulum-v0."""
    return env_id.rpartition("/")[2].rpartition("-")[0]


def list_tasks(
    course: Course, preset: str, methods: Sequence[str], seeds: Sequence[int]
) -> list[Task]:
    """The reference, then every run; the longest first, so that no core idles late."""
    order = sorted(methods, key=lambda name: name != "dqn")
    reference = Task(
        "reference",
        _reference,
        (course.env_id, preset),
        _reference_settings(course, preset),
    )
    return [
        reference,
        *(
            Task(
                f"{method}-{seed}",
                _run,
                (method, course.env_id, seed, preset),
                {
                    "env": course.env_id,
                    "agent": method,
                    "seed": seed,
                    **_budget_of(course, preset, method),
                },
            )
            for method in order
            for seed in seeds
        ),
    ]


def _reference_settings(course: Course, preset: str) -> dict[str, Any]:
    """All that the reference depends on."""
    settings: dict[str, Any] = {"env": course.env_id, "optimum": course.optimum}
    if make := course.budgets[preset].reference:
        grids = [make().settings(), course.partitions["fuzzy"]().settings()]
        # Centres are many: what tells them apart is enough.
        settings["grids"] = hashlib.sha256(json.dumps(grids).encode()).hexdigest()
    return settings


def _budget_of(course: Course, preset: str, method: str) -> dict[str, Any]:
    """All that a run of a method depends on beside its seed."""
    budget = course.budgets[preset]
    settings = dict(course.settings(method, long_run=budget.long_run))
    if method == "dqn":
        return {
            "steps": budget.dqn_steps,
            "every": budget.dqn_every,
            "settings": settings,
        }
    return {
        "trials": budget.trials,
        "slots": course.slots,
        "max_steps": course.max_steps,
        "partition": course.partition(method).settings(),
        "settings": settings,
    }


# A course holds functions, which do not travel to other processes; its id does.
def _reference(
    env_id: str, preset: str, report_fraction: contestants.Report
) -> dict[str, Any]:
    course = COURSES[env_id]
    return contestants.find_reference(course, course.budgets[preset])


def _run(
    method: str, env_id: str, seed: int, preset: str, report_fraction: Any
) -> dict[str, Any]:
    course = COURSES[env_id]
    budget = course.budgets[preset]
    return contestants.run(method, course, seed, budget, report_fraction)


def _collect(
    course: Course,
    preset: str,
    reference: dict[str, Any],
    runs: list[dict[str, Any]],
) -> Comparison:
    env = contestants.make_env(course.env_id, 1)
    order = list(course.methods)
    runs = sorted(runs, key=lambda run: (order.index(run["agent"]), run["seed"]))
    made = [run.pop("made") for run in (reference, *runs)]
    states = env.system.evaluation_states()
    return {
        "env": course.env_id,
        "preset": preset,
        "version": acl_gym.__version__,
        "command": _command(),
        "made": _merged(made),
        "evaluation": {
            "states": len(states),
            "max_steps": env.system.evaluation_steps,
            "text": (
                f"mean undiscounted cost from {len(states)} fixed initial states over "
                f"at most {env.system.evaluation_steps} steps, an episode ending at "
                "the goal (3.47); table-based methods are evaluated after every trial, "
                f"DQN every {course.budgets[preset].dqn_every:,} steps, which favours "
                "the former a little in best policies and times"
            ),
        },
        "reference": reference,
        "pictures": course.pictures,
        "scene": PICTURES[course.pictures].scene(env),
        "runs": runs,
    }


def _merged(made: list[dict[str, Any]]) -> dict[str, str]:
    """Where and when the runs were made: each different value, in order."""
    names = dict.fromkeys(name for facts in made for name in facts)
    return {
        name: ", ".join(sorted({str(facts[name]) for facts in made if name in facts}))
        for name in names
    }


def write_results(
    comparison: Comparison, directory: Path, console: Console
) -> dict[str, Any]:
    """Write results, figures and report; print the table. Returns results.json."""
    reference = comparison["reference"]
    cost = wording.reference_cost(reference)
    summary = statistics.summarise(comparison["runs"], cost)
    found = statistics.findings(summary, reference, comparison["preset"])
    rows = [
        {"agent": run["agent"], "seed": run["seed"], **row}
        for run in comparison["runs"]
        for row in run["rows"]
    ]
    results = {
        "env": comparison["env"],
        "preset": comparison["preset"],
        "reference": {k: v for k, v in reference.items() if k != "picture"},
        "rows": rows,
        "summary": summary,
        "findings": found,
    }
    write_atomically(directory / "results.json", json.dumps(results, indent=1).encode())
    sink = pa.BufferOutputStream()
    pq.write_table(pa.Table.from_pylist(rows), sink)
    write_atomically(directory / "results.parquet", sink.getvalue().to_pybytes())
    drawn = figures.save_figures(comparison, directory)
    path = directory / "report.html"
    report.write_report(comparison, summary, found, drawn, path)
    report.print_summary(summary, reference, console)
    for sentence in found:
        console.print(f"- {sentence}", markup=False, highlight=False)
    console.print(f"\nReport: {path}\nResults: {directory / 'results.json'}")
    return results


class _Bar:
    """One line of progress for all runs together, and what is under way."""

    def __init__(self, console: Console, names: list[str]) -> None:
        self._fractions = dict.fromkeys(names, 0.0)
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            console=console,
        )
        self._bar = self._progress.add_task("runs", total=len(names))

    def __enter__(self) -> _Bar:
        self._progress.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._progress.stop()

    def tell(self, name: str, fraction: float) -> None:
        self._fractions[name] = max(fraction, self._fractions[name])
        done = sum(value >= 1.0 for value in self._fractions.values())
        under_way = ", ".join(
            f"{each} {value:.0%}"
            for each, value in self._fractions.items()
            if 0.0 < value < 1.0
        )
        self._progress.update(
            self._bar, completed=done, description=f"runs  {under_way}"
        )


def _command() -> str:
    """The command that runs, without the folders it is installed in."""
    program, *arguments = sys.argv
    known = {"acl-gym": "acl-gym", "__main__.py": "python -m acl_gym"}
    return " ".join([known.get(Path(program).name, f"python {program}"), *arguments])
