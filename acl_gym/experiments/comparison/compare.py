"""`acl-gym compare`: ACL against reinforcement learning on one system, to the report."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from rich import box
from rich.console import Console
from rich.table import Table as RichTable
from rich.text import Text

from acl_gym.experiments import outcome, plots, report, tables
from acl_gym.experiments.comparison.tasks import BY_ENV_ID, PRESETS, System
from acl_gym.experiments.results import Results
from acl_gym.experiments.runner import list_jobs, run_studies
from acl_gym.experiments.store import Store
from acl_gym.experiments.study import Experiment, Study
from acl_gym.utils.files import write_atomically

_ROW = ("env_steps", "seconds", "policy_cost", "success_rate")


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
) -> dict[str, Any]:
    """Run the comparison, write its files into `directory`, and print its table.

    Args:
        env_id: a key of `tasks.BY_ENV_ID`.
        preset: a key of `tasks.PRESETS`.
        agents: some of those of the system; None takes them all.
        seeds: runs of each agent; None takes the preset's number.
        directory: receives results.json, results.parquet, report.html and figures, and
            in runs/ the result of each run.
        first_seed: the seeds are this one and those that follow it.
        fresh: make every run anew, also those that are there.
        workers: processes; None takes one for each core.
        console: where to print.

    Returns:
        The content of results.json.

    Raises:
        RunFailedError: a run failed; the others are kept.
    """
    console = console or Console()
    system, count = BY_ENV_ID[env_id], PRESETS[preset] if seeds is None else seeds
    experiment = experiment_of(system, preset, agents)
    everything = [*experiment.everything, *_on_coarse_cells(system)]
    numbers, runs = range(first_seed, first_seed + count), directory / "runs"
    if fresh:
        for job in list_jobs(everything, numbers):
            Store(runs).path(job).unlink(missing_ok=True)
    results = run_studies(everything, numbers, runs, workers=workers, console=console)
    return write_results(system, preset, experiment, results, directory, console)


def experiment_of(
    system: System, preset: str, agents: Sequence[str] | None = None
) -> Experiment:
    """The comparison on a system as an experiment.

    Args:
        system: which.
        preset: a key of `tasks.PRESETS`.
        agents: see `compare`.
    """
    names = [name for name in system.agents if agents is None or name in agents]
    moving = () if system.finite else ("trajectories",)
    return Experiment(
        name="comparison",
        title=f"ACL against reinforcement learning: {system.label}",
        section="",
        studies={system.agents[n].label: system.study(n, preset) for n in names},
        references={"dynamic programming": system.reference(preset)},
        plots=("summary", "learning_curves", "policy_maps", *moving),
        table="summary",
        text="Medians over seeds; below a cost its 95% interval.",
        options={
            "agents": {system.agents[name].label: name for name in names},
            "optimum": system.optimum,
        },
    )


def _on_coarse_cells(system: System) -> list[Study]:
    """Dynamic programming on the cells that the methods have."""
    return [] if system.finite else [system.planned(system.colony.cells)]


def write_results(
    system: System,
    preset: str,
    experiment: Experiment,
    results: Results,
    directory: Path,
    console: Console,
) -> dict[str, Any]:
    """Write results, figures and report; print the table. Returns results.json."""
    reference = _reference(system, experiment, results)
    frame = results.frame(experiment.studies).assign(
        agent=lambda rows: rows["study"].map(experiment.options["agents"])
    )
    rows = frame[["agent", "seed", *_ROW]].astype({"env_steps": np.int64})
    found = {
        "env": system.env_id,
        "preset": preset,
        "reference": reference,
        "rows": rows.to_dict("records"),
        "summary": tables.summarise(experiment, results),
    }
    path = directory / "results.json"
    write_atomically(path, json.dumps(found, indent=1).encode())
    write_atomically(directory / "results.parquet", rows.to_parquet(index=False))
    plots.save(experiment, results, directory)
    report.write_report(
        directory / "report.html",
        title=experiment.title,
        experiments=[outcome.summary(experiment, results)],
        figures=directory,
        command=_command(),
        made=results.made(experiment.everything),
        intro=_intro(system, reference),
        facts=f"{system.env_id}, preset {preset}",
        notes=[_EVALUATION],
    )
    _print(experiment, results, reference, console)
    console.print(f"\nReport: {directory / 'report.html'}\nResults: {path}")
    return found


def _reference(
    system: System, experiment: Experiment, results: Results
) -> dict[str, Any]:
    """What the policies are held against, and what their own cells allow."""
    (study,) = experiment.references.values()
    found: dict[str, Any] = {
        "optimal_cost" if system.optimum else "best_known_cost": (
            tables.reference_cost(experiment, results)
        ),
        "success_rate": float(results.last(study, "success_rate")[0]),
        "method": "value iteration" if system.finite else "fuzzy Q-iteration",
    }
    for coarse in _on_coarse_cells(system):
        found["cells"] = _cells(study)
        found["coarse"] = {
            "cells": _cells(coarse),
            "policy_cost": float(results.last(coarse)[0]),
            "success_rate": float(results.last(coarse, "success_rate")[0]),
        }
    return found


def _cells(study: Study) -> list[int]:
    """How many centres each variable has."""
    return [len(line) for line in study.make_partition().centres]  # type: ignore[attr-defined]


_EVALUATION = (
    "The policy cost is the mean undiscounted cost from fixed initial states, an episode "
    "ending at the goal (3.47). Methods with a table are evaluated after every trial, DQN "
    "every so many steps, which favours the former a little in best policies and times."
)


def _intro(system: System, reference: dict[str, Any]) -> list[str]:
    """What the policies are held against, in sentences."""
    cost = reference.get("optimal_cost", reference.get("best_known_cost"))
    if system.finite:
        return [
            f"The optimum J* = {cost:.4g} is exact, by value iteration on the model."
        ]
    fine, own = (
        " × ".join(map(str, each["cells"])) for each in (reference, reference["coarse"])
    )
    name = (
        "The optimum is taken to be J*" if system.optimum else "The best known cost is"
    )
    return [
        f"{name} = {cost:.4g}, found by fuzzy Q-iteration, which knows the model, on "
        f"{fine} cells. On {own} cells, as many as the methods with a table have, it "
        f"reaches a cost of {reference['coarse']['policy_cost']:.4g}, which is no bound on "
        "what these cells allow."
    ]


def _print(
    experiment: Experiment,
    results: Results,
    reference: dict[str, Any],
    console: Console,
) -> None:
    """Print the summary as a table of at most 100 columns."""
    name, cost = next(iter(reference.items()))
    symbol = "J*" if name == "optimal_cost" else "best known"
    shown = tables.summary(experiment, results)
    table = RichTable(
        title=f"Medians over seeds; {symbol} = {tables.number(name, cost)}",
        box=box.SIMPLE_HEAD,
        show_edge=False,
        padding=0,
    )
    for place, heading in enumerate(shown.headings):
        table.add_column(heading, justify="right" if place else "left", no_wrap=True)
    for line, row in enumerate(shown.rows):
        cells = []
        for place, cell in enumerate(row):
            first, _, second = cell.partition("\n")
            text = Text(first, style="bold" if (line, place) in shown.best else "")
            cells.append(text.append(f"\n{second}", style="dim") if second else text)
        table.add_row(*cells)
    console.print(table)
    console.print(
        "last, best: cost of the policy with its 95% interval, percent above "
        f"{symbol}, and share of the starts from which it reaches the goal. 25%, 10%: "
        "training until within so much of it; under it, in how many of the seeds.",
        style="dim",
        highlight=False,
    )


def _command() -> str:
    """The command that runs, without the folders it is installed in."""
    program, *arguments = sys.argv
    known = {"acl-gym": "acl-gym", "__main__.py": "python -m acl_gym"}
    return " ".join([known.get(Path(program).name, f"python {program}"), *arguments])
