"""The main job: ACL against reinforcement learning, from runs to report."""

from __future__ import annotations

import datetime
import json
import os
import platform
import sys
from collections.abc import Sequence
from importlib.metadata import version
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
from acl_gym.experiments import contestants, figures, report, statistics
from acl_gym.experiments.contestants import CONTESTANTS, PRESETS, Preset
from acl_gym.experiments.runner import Task, run_tasks
from acl_gym.storage import write_atomically

Comparison = dict[str, Any]
"""All that a report needs, JSON types only; see `_collect`."""

ENVIRONMENTS = (contestants.ENVIRONMENT,)


def compare(
    env_id: str,
    preset_name: str,
    agents: Sequence[str],
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
        preset_name: a key of `PRESETS`.
        agents: keys of `CONTESTANTS`.
        seeds: runs of each agent; None takes the preset's number.
        directory: receives results.json, results.parquet, report.html, figures, and
            in runs/ the result of each run.
        first_seed: the seeds are this one and those that follow it.
        fresh: make every run anew, also those that are there.
        workers: processes; None takes one for each core.
        console: where to print.

    Raises:
        TaskFailedError: a run failed; the others are kept.
    """
    console = console or Console()
    preset = PRESETS[preset_name]
    count = preset.seeds if seeds is None else seeds
    workers = workers or os.cpu_count() or 1
    tasks = list_tasks(env_id, preset, agents, range(first_seed, first_seed + count))
    runs_directory = directory / "runs"
    if fresh:
        for task in tasks:
            (runs_directory / f"{task.name}.json").unlink(missing_ok=True)
    # Here once, not in every process: Numba's cache is no place for a race.
    with console.status("Compiling the kernels (some 30 seconds, the first time)"):
        contestants.compile_all(env_id)
    with _Bar(console, [task.name for task in tasks]) as bar:
        reference, *runs = run_tasks(
            tasks, runs_directory, workers=workers, progress=bar.tell
        )
    comparison = _collect(env_id, preset_name, reference, runs, workers)
    write_results(comparison, directory, console)
    return comparison


def list_tasks(
    env_id: str, preset: Preset, agents: Sequence[str], seeds: Sequence[int]
) -> list[Task]:
    """The reference, then every run; the longest first, so that no core idles late."""
    order = sorted(agents, key=lambda name: name != "dqn")
    reference = Task(
        "reference",
        _reference,
        (env_id, preset),
        {"env": env_id, "cells": list(preset.optimum_cells)},
    )
    return [
        reference,
        *(
            Task(
                f"{agent}-{seed}",
                contestants.run,
                (agent, env_id, seed, preset),
                {
                    "env": env_id,
                    "agent": agent,
                    "seed": seed,
                    "trials": preset.trials,
                    "dqn_steps": preset.dqn_steps,
                    "dqn_every": preset.dqn_every,
                    "long_run": preset.long_run,
                },
            )
            for agent in order
            for seed in seeds
        ),
    ]


def _reference(
    env_id: str, preset: Preset, report_fraction: contestants.Report
) -> dict[str, Any]:
    return contestants.find_reference(env_id, preset)


def _collect(
    env_id: str,
    preset_name: str,
    reference: dict[str, Any],
    runs: list[dict[str, Any]],
    workers: int,
) -> Comparison:
    env = contestants.make_env(env_id, 1)
    theta, omega = contestants.map_axes(env)
    order = list(CONTESTANTS)
    runs = sorted(runs, key=lambda run: (order.index(run["agent"]), run["seed"]))
    states = env.system.evaluation_states()
    return {
        "env": env_id,
        "preset": preset_name,
        "version": acl_gym.__version__,
        "date": datetime.date.today().isoformat(),
        "command": _command(),
        "machine": {
            "python": platform.python_version(),
            "cpu": _cpu_name(),
            "cores": os.cpu_count(),
            "workers": workers,
            **{
                name: version(name)
                for name in (
                    "numpy",
                    "numba",
                    "gymnasium",
                    "stable-baselines3",
                    "torch",
                )
            },
        },
        "evaluation": {
            "states": len(states),
            "max_steps": env.system.evaluation_steps,
            "text": (
                f"mean undiscounted cost from {len(states)} fixed initial states over "
                f"at most {env.system.evaluation_steps} steps, an episode ending at "
                "the goal (3.47); table-based methods are evaluated after every trial, "
                f"DQN every {PRESETS[preset_name].dqn_every:,} steps, which favours the "
                "former a little in best policies and times"
            ),
        },
        "reference": reference,
        "map_axes": {"theta": theta.tolist(), "omega": omega.tolist()},
        "torques": list(contestants.torques(env)),
        "runs": runs,
    }


def write_results(
    comparison: Comparison, directory: Path, console: Console
) -> dict[str, Any]:
    """Write results, figures and report; print the table. Returns results.json."""
    reference = comparison["reference"]
    summary = statistics.summarise(comparison["runs"], reference["optimal_cost"])
    found = statistics.findings(summary, reference, comparison["preset"])
    rows = [
        {"agent": run["agent"], "seed": run["seed"], **row}
        for run in comparison["runs"]
        for row in run["rows"]
    ]
    results = {
        "env": comparison["env"],
        "preset": comparison["preset"],
        "reference": {
            key: value
            for key, value in reference.items()
            if key not in ("policy_map", "trajectory")
        },
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


def _cpu_name() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or "unknown"
    names = (line.split(":", 1)[1].strip() for line in lines if "model name" in line)
    return next(names, platform.processor() or "unknown")
