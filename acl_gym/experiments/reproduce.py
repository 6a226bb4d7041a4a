"""From names of experiments to results, verdicts, figures and a report."""

from __future__ import annotations

import json
import logging
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from acl_gym.experiments import comparison, outcome, plots, thesis
from acl_gym.experiments.names import EXECUTORS, GROUPS
from acl_gym.experiments.outcome import Outcome, without_curves
from acl_gym.experiments.provenance import ROOT, circumstances
from acl_gym.experiments.report import CURVES, write_claims, write_report
from acl_gym.experiments.results import Results
from acl_gym.experiments.runner import exclusive_lock, list_jobs, run_studies
from acl_gym.experiments.store import Job, Store
from acl_gym.experiments.study import Experiment
from acl_gym.experiments.thesis import CLAIMS, RUNS
from acl_gym.experiments.thesis.common import FEWER
from acl_gym.utils.files import remove_stale, write_atomically
from acl_gym.utils.hashing import (
    checksum_fits,
    digest,
    hashed,
    with_checksum,
    without_checksum,
)
from acl_gym.utils.validation import one_of

logger = logging.getLogger("acl_gym")

__all__ = ["EXECUTORS", "RUNS", "without_curves"]

EXPERIMENTS: tuple[Experiment[Any], ...] = (
    *thesis.EXPERIMENTS,
    *comparison.EXPERIMENTS,
)

PAGE, CLAIMS_TABLE = "report.html", "claims.md"
RESULTS, ROWS = "results.json", "results.parquet"
_KEPT_RUNS, _FIGURES, _FINISHED = "runs", "figures", "finished.json"

ANIMATION, ANIMATED = "learning.gif", "fig5.6"
"""With this experiment the animation of its policy is drawn."""

_AGAINST = "Against reinforcement learning"


def chosen(names: Sequence[str]) -> list[Experiment[Any]]:
    """The experiments of these names, in the order of the thesis.

    Args:
        names: of experiments; "all" are all of them, "claims" those that decide a
            claim or were tried to understand one, "comparison" those that hold methods
            against each other.

    Raises:
        ValueError: there is no experiment of a name.
    """
    known = [experiment.name for experiment in EXPERIMENTS]
    for name in names:
        one_of("experiment", name, (*GROUPS, *known))
    return [
        each
        for each in EXPERIMENTS
        if "all" in names
        or each.name in names
        or ("claims" in names and (each.claims or each.explains))
        or ("comparison" in names and each in comparison.EXPERIMENTS)
    ]


def reproduce(
    names: Sequence[str],
    runs: int = RUNS,
    directory: Path = Path("results/reproduce"),
    *,
    first_seed: int = 0,
    workers: int | None = None,
    executor: str = "local",
    figures: bool = True,
    console: Console | None = None,
) -> tuple[Outcome, bool]:
    """Run experiments, or read what is there, judge the claims, and write the report.

    Args:
        names: see `chosen`.
        runs: of each study, >= 1; the thesis has 30.
        directory: receives results.json, results.parquet, report.html, claims.md, in
            figures/ and curves/ what the report loads, and in runs/ a file for each
            run.
        first_seed: the seeds are this one and those that follow it.
        workers: processes, >= 1; None takes one for each core.
        executor: see `runner.run_studies`.
        figures: whether figures and reports are made.
        console: where progress is shown; None shows nothing.

    Returns:
        What was found, and whether all of it was there already.

    Raises:
        ValueError: there is no experiment of a name.
        RunFailedError: a run failed; the others are kept.
        FigureFailedError: a figure failed; results and report are written without it.
        FolderInUseError: another run works on `directory`.
    """
    experiments = chosen(names)
    studies = [study for each in experiments for study in each.everything]
    seeds = range(first_seed, first_seed + runs)
    jobs = list_jobs(studies, seeds)
    stamp = _stamp(jobs)
    found = _finished(directory, stamp, jobs, figures)
    if found is not None:
        return found, True
    console = console or Console(quiet=True)
    workers = workers or os.cpu_count() or 1
    # Held until the report is written, so that it is that of these runs.
    with exclusive_lock(directory / _KEPT_RUNS):
        results = run_studies(
            *(studies, seeds, directory / _KEPT_RUNS),
            workers=workers,
            executor=executor,
            console=console,
        )
        made = {
            "runs": runs,
            "first_seed": first_seed,
            **_outcome(experiments, results, runs),
            "runs_made": results.made(studies),
            "made": circumstances(workers),
        }
        _clear(directory)
        write_atomically(directory / RESULTS, json.dumps(with_checksum(made)).encode())
        _write_rows(directory / ROWS, experiments, results)
        if figures:
            (directory / _FIGURES).mkdir(exist_ok=True)
            with plots.drawing(directory) as draw:
                for each in experiments:
                    with console.status(f"Drawing {each.name}"):
                        draw(plots.save, each, results, directory / _FIGURES)
                if any(each.name == ANIMATED for each in experiments):
                    with console.status("Drawing the animation"):
                        draw(plots.write_animation, directory / _FIGURES / ANIMATION)
                write_pages(directory)
        finished = {"stamp": stamp, "files": _digests(directory, jobs)}
        write_atomically(directory / _FINISHED, json.dumps(finished).encode())
    return made, False


def _outcome(
    experiments: Sequence[Experiment[Any]], results: Results, runs: int
) -> Outcome:
    """Each experiment summed up, and each claim judged."""
    summaries = [
        outcome.summary(
            *(each, results),
            "Experiments" if each in thesis.EXPERIMENTS else _AGAINST,
        )
        for each in experiments
    ]
    claims = [
        {
            **claim.judge(results, runs),
            "experiments": [e.name for e in EXPERIMENTS if claim.name in e.claims],
            "trials": [e.name for e in EXPERIMENTS if claim.name in e.explains],
        }
        for claim in CLAIMS
    ]
    return {"experiments": summaries, "claims": claims}


def _write_rows(
    path: Path, experiments: Sequence[Experiment[Any]], results: Results
) -> None:
    """The rows of all runs as one table; those of a study stand where it comes first."""
    shown = {
        study.key: (f"{each.name}: {label}", study)
        for each in reversed(experiments)
        for label, study in {**each.studies, **each.references}.items()
    }
    frame = results.frame(dict(shown.values()))
    content: bytes = frame.to_parquet(index=False, compression="zstd")
    write_atomically(path, content)


def read_outcome(directory: Path) -> Outcome:
    """What `reproduce` has written.

    Raises:
        FileNotFoundError: there is nothing of it in `directory`.
        ValueError: the file is not what `reproduce` writes.
    """
    path = directory / RESULTS
    if not path.is_file():
        raise FileNotFoundError(
            f"there is no {RESULTS} in {directory}; `acl-gym reproduce --out "
            f"{directory}` makes one."
        )
    try:
        found = dict(json.loads(path.read_text(encoding="utf-8")))
        if not {"claims", "experiments", "runs", "made", "runs_made"} <= found.keys():
            raise KeyError
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise ValueError(
            f"{path} is not the result of a reproduction by this version; make it again "
            "with `acl-gym reproduce`, which takes the runs that are there."
        ) from error
    if not checksum_fits(found):
        raise ValueError(
            f"{path} must be as it was written, but was damaged or edited since; make it "
            "again with `acl-gym reproduce`, which takes the runs that are there."
        )
    return without_checksum(found)


def write_pages(directory: Path) -> Path:
    """Write report.html and claims.md from the results and figures of a folder.

    Returns:
        The path of the report.

    Raises:
        FileNotFoundError: there are no results.
        ValueError: the results cannot be read.
    """
    found = read_outcome(directory)
    facts = (
        f"{found['runs']} run{'s' * (found['runs'] != 1)} of each setting ({FEWER} at "
        "most of what takes long and is not an experiment of the thesis), seeds "
        f"from {found['first_seed']}. In brackets: 95% bootstrap intervals of the "
        "interquartile mean over the runs; in a ratio the runs of each setting are drawn "
        "separately."
    )
    names = [each["name"] for each in found["experiments"]]
    claims = [
        each
        for each in found["claims"]
        if not set(names).isdisjoint(each["experiments"] + each["trials"])
    ]
    write_claims(
        directory / CLAIMS_TABLE,
        claims,
        found["experiments"],
        directory / _FIGURES,
        facts,
    )
    asked_for = "all" if len(names) == len(EXPERIMENTS) else " ".join(names)
    runs_made = {f"runs, {name}": each for name, each in found["runs_made"].items()}
    write_report(
        directory / PAGE,
        title="Ant Colony Learning put to the test",
        facts=facts,
        experiments=found["experiments"],
        figures=directory / _FIGURES,
        claims=claims,
        animation=ANIMATION,
        command=f"acl-gym reproduce {asked_for} --runs {found['runs']} "
        f"--seed {found['first_seed']}",
        made={**found["made"], **runs_made},
    )
    return directory / PAGE


def _finished(
    directory: Path, stamp: str, jobs: Sequence[Job], figures: bool
) -> Outcome | None:
    """The outcome in a folder if all of it is there, made from this; None otherwise."""
    try:
        known = json.loads((directory / _FINISHED).read_text(encoding="utf-8"))
        if known["stamp"] != stamp or (figures and PAGE not in known["files"]):
            return None
        now = _digests(directory, jobs)
        changed = [
            name for name in known["files"] if known["files"][name] != now.get(name)
        ]
        if not changed:
            return read_outcome(directory)
    except (AttributeError, OSError, ValueError, KeyError, TypeError, RecursionError):
        return None
    logger.warning(
        "%d of %d files in %s, %s among them, are missing, damaged or edited since they "
        "were written; they are made again.",
        *(len(changed), len(known["files"]), directory, changed[0]),
    )
    return None


def _digests(directory: Path, jobs: Sequence[Job]) -> dict[str, str]:
    """A checksum for each file that a folder consists of when all is done."""
    store = Store(directory / _KEPT_RUNS)
    files = [directory / RESULTS, *_generated_files(directory), *map(store.path, jobs)]
    return {
        path.relative_to(directory).as_posix(): digest(path)
        for path in files
        if path.is_file()
    }


def _stamp(jobs: Sequence[Job]) -> str:
    """A hash over all that a folder is made from: runs, and the package's files."""
    files = {
        path.relative_to(ROOT).as_posix(): path.read_bytes().hex()
        for path in ROOT.rglob("*")
        if path.is_file() and path.parent.name != "__pycache__"
    }
    return hashed([[job.key for job in jobs], files])


def _clear(directory: Path) -> None:
    """Remove figures and reports, so that stale ones are not mixed with new results.

    Runs stay, and pictures that are not of an experiment.
    """
    old = [
        directory / _FINISHED,
        *_generated_files(directory),
    ]
    for path in old:
        path.unlink(missing_ok=True)
    for folder in (directory, directory / _FIGURES):
        remove_stale(folder)


def _generated_files(directory: Path) -> list[Path]:
    """The files of a folder generated from results: rows, reports, and figures."""
    names = {Path(ANIMATION).stem, *(experiment.name for experiment in EXPERIMENTS)}
    files = [directory / name for name in (ROWS, PAGE, CLAIMS_TABLE)]
    for folder in (_FIGURES, CURVES):
        files += [p for p in (directory / folder).glob("*.*") if p.stem in names]
    return [path for path in files if path.is_file()]
