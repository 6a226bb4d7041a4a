"""`acl-gym compare`: ACL against reinforcement learning on one system, to the report."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from acl_gym.experiments import outcome, plots, report, tables
from acl_gym.experiments.comparison.tasks import System
from acl_gym.experiments.names import PRESETS
from acl_gym.experiments.references import reference
from acl_gym.experiments.results import Results
from acl_gym.experiments.runner import list_jobs, run_studies
from acl_gym.experiments.store import Store
from acl_gym.experiments.study import Experiment, Study
from acl_gym.utils.files import write_atomically

_PLOTS = ("summary", "learning_curves", "policy_maps", "trajectories")
_FOREIGN_NOTES = (
    "The policy cost is the mean undiscounted -(return) over 100 random episodes, the same "
    "in each evaluation; nothing is known of success. Methods with a table are evaluated "
    "after every trial, DQN at fixed intervals of steps.",
    "All methods have general settings, which were not tuned for this environment. Without "
    "a model there is no optimum: percents are above the best policy of these runs.",
)
_FOREIGN_PLOTS = ("returns",)
"""Where costs may be below 0, and nothing is known but the return."""

_COLUMNS = ["agent", "seed", "env_steps", "seconds", "policy_cost", "success_rate"]
_NOTES = (
    "The policy cost is the mean undiscounted cost from fixed initial states, an episode "
    "ending at the goal (3.47). Methods with a table are evaluated after every trial, DQN "
    "at fixed intervals of steps, which favours the former a little in best policies and "
    "times.",
    "Dynamic programming knows the model: value iteration where a state is a cell, which "
    "is exact, else fuzzy Q-iteration. What it reaches on the cells that the methods have "
    "is no bound on what these cells allow.",
)


def compare(
    system: System,
    preset: str,
    agents: Sequence[str] | None,
    seeds: int | None,
    directory: Path,
    *,
    first_seed: int = 0,
    fresh: bool = False,
    workers: int | None = None,
    console: Console | None = None,
) -> tuple[Experiment, Results]:
    """Run the comparison on a system, and write its files.

    Args:
        system: one of `tasks.SYSTEMS`.
        preset: a key of `names.PRESETS`.
        agents: some of those of the system; None takes them all.
        seeds: runs of each agent; None takes the preset's number.
        directory: receives results.json, results.parquet, report.html and figures, in
            curves/ the curves of the report, and in runs/ the result of each run.
        first_seed: the seeds are this one and those that follow it.
        fresh: make every run anew, also those that are there.
        workers: processes; None takes one for each core.
        console: where progress is shown.

    Raises:
        RunFailedError: a run failed; the others are kept.
        FigureFailedError: a figure failed; results and report are written without it.
    """
    count = PRESETS[preset] if seeds is None else seeds
    experiment = experiment_of(system, preset, agents)
    numbers, runs = range(first_seed, first_seed + count), directory / "runs"
    if fresh:
        for job in list_jobs(experiment.everything, numbers):
            Store(runs).path(job).unlink(missing_ok=True)
    results = run_studies(
        experiment.everything, numbers, runs, workers=workers, console=console
    )
    _write(system, preset, experiment, results, directory)
    names = ",".join(experiment.options["agents"].values())
    for old in (*_PLOTS, *_FOREIGN_PLOTS):  # of other runs, or of a system before
        (directory / f"{old}.png").unlink(missing_ok=True)
    with plots.drawing(directory) as draw:
        draw(plots.save, experiment, results, directory, ("png",))
        report.write_report(
            directory / "report.html",
            title=experiment.title,
            experiments=[outcome.summary(experiment, results)],
            figures=directory,
            command=f"acl-gym compare --env {system.env_id} --preset {preset} --agents "
            f"{names} --seeds {count} --seed {first_seed}",
            made=results.made(experiment.everything),
            facts=f"{system.env_id}, preset {preset}, {count} runs of each method",
            notes=_NOTES if system.has_model else _FOREIGN_NOTES,
        )
    return experiment, results


def experiment_of(
    system: System, preset: str, agents: Sequence[str] | None = None
) -> Experiment:
    """The comparison on a system as an experiment; for the arguments see `compare`."""
    names = [name for name in system.agents if agents is None or name in agents]
    references = {}
    if system.has_model:
        references["dynamic programming"] = system.reference(preset)
    if system.has_model and not system.finite:
        on_same = system.planned(system.colony.cells)
        references["dynamic programming, the same cells"] = on_same
    held_against = "J*" if system.optimum else "the best known cost"
    shown = _PLOTS[:-1] if system.finite else _PLOTS
    cost, goal = "its cost, which is -(return),", ""
    if system.has_model:
        cost = "its cost"
        goal = ", and the share of the starts from which it reaches the goal"
    return Experiment(
        name="comparison",
        title=f"ACL against reinforcement learning: {system.label}",
        section="",
        studies={system.agents[n].label: system.study(n, preset) for n in names},
        references=references,
        plots=shown if system.has_model else _FOREIGN_PLOTS,
        table="summary",
        text=(
            f"Medians over the runs. Of the last and of the best policy: {cost} with a "
            f"95% bootstrap interval, percent above {held_against}{goal}. Then the "
            f"training until the first policy within 25% and within 10% of {held_against}."
        ),
        options={
            "agents": {system.agents[name].label: name for name in names},
            "optimum": system.optimum,
        },
    )


def _write(
    system: System,
    preset: str,
    experiment: Experiment,
    results: Results,
    directory: Path,
) -> None:
    """Write results.json and results.parquet."""
    frame = results.frame(experiment.studies)
    frame["agent"] = frame["study"].map(experiment.options["agents"])
    if "success_rate" not in frame:
        frame["success_rate"] = None  # not known in environments of other packages
    rows = frame[_COLUMNS].astype({"env_steps": np.int64})
    # Before what is computed from them.
    write_atomically(directory / "results.parquet", rows.to_parquet(index=False))
    found = {
        "env": system.env_id,
        "preset": preset,
        "reference": _reference(system, experiment, results),
        "rows": rows.to_dict("records"),
        "summary": tables.summarise(experiment, results),
    }
    text = json.dumps(found, indent=1)
    write_atomically(directory / "results.json", text.encode())


def _reference(
    system: System, experiment: Experiment, results: Results
) -> dict[str, Any]:
    """What the methods are held against, JSON types."""
    if not system.has_model:
        return {
            "best_known_cost": reference(experiment, results).cost,
            "success_rate": None,
            "method": "the best policy of these runs",
        }
    fine, *coarse = experiment.references.values()
    facts: dict[str, Any] = {
        "optimal_cost" if system.optimum else "best_known_cost": results.last(fine)[0],
        "success_rate": results.last(fine, "success_rate")[0],
        "method": "value iteration" if system.finite else "fuzzy Q-iteration",
    }
    for study in coarse:
        facts["cells"] = _cells(fine)
        facts["coarse"] = {
            "cells": _cells(study),
            "policy_cost": results.last(study)[0],
            "success_rate": results.last(study, "success_rate")[0],
        }
    return facts


def _cells(study: Study) -> list[int]:
    """How many centres each variable has."""
    return [len(line) for line in study.make_partition().centres]  # type: ignore[attr-defined]
