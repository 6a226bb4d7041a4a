"""Whether a call has anything left to do."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import Any

from acl_gym.experiments.fingerprint import ROOT
from acl_gym.experiments.runner import Task
from acl_gym.reproduction.catalogue import BY_NAME
from acl_gym.reproduction.page import (
    ANIMATED,
    ANIMATION,
    CLAIMS_TABLE,
    FIGURES,
    PAGE,
    RESULTS,
    read_outcome,
)
from acl_gym.reproduction.store import ParquetStore
from acl_gym.utils.files import write_atomically

FINISHED = "finished.json"


def stamp(tasks: Iterable[Task], figures: Iterable[str]) -> str:
    """A hash over all that a folder is made from: runs, figures, the package's files."""
    digest = hashlib.sha256(json.dumps(sorted(figures)).encode())
    for task in tasks:
        digest.update(task.key.encode())
    for path in sorted(ROOT.rglob("*")):
        if path.suffix in (".py", ".j2", ".txt"):
            digest.update(path.relative_to(ROOT).as_posix().encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()


def begin(directory: Path) -> None:
    """Results are about to be written.

    Pages and figures of before go, so that they do not stand beside other results, and so
    does what was half written. Runs stay, and pictures that are not of an experiment.
    """
    for name in (FINISHED, PAGE, CLAIMS_TABLE):
        (directory / name).unlink(missing_ok=True)
    for figure in _figures(directory, BY_NAME):
        figure.unlink(missing_ok=True)
    for folder in (directory, directory / FIGURES):
        for half in folder.glob(".*.tmp"):
            half.unlink()


def finish(directory: Path, made_from: str) -> None:
    """All of the folder has been made from this."""
    text = json.dumps({"stamp": made_from})
    write_atomically(directory / FINISHED, text.encode())


def finished(
    directory: Path, store: ParquetStore, tasks: Sequence[Task], figures: Sequence[str]
) -> dict[str, Any] | None:
    """The outcome in a folder if all of it is there, made from this; None otherwise.

    Args:
        directory: of the outcome.
        store: of the runs.
        tasks: all runs.
        figures: the names of the experiments that are drawn; none, and no page is
            looked for either.
    """
    try:
        said = json.loads((directory / FINISHED).read_text())["stamp"]
        outcome = read_outcome(directory)
    except (OSError, ValueError, KeyError, TypeError):
        return None
    files = [directory / RESULTS]
    if figures:
        files += [directory / PAGE, directory / CLAIMS_TABLE]
        files += _figures(directory, figures)
    if said != stamp(tasks, figures) or not all(path.is_file() for path in files):
        return None
    return outcome if all(store.has(task) for task in tasks) else None


def _figures(directory: Path, names: Collection[str]) -> list[Path]:
    """Where the figures of these experiments are."""
    files = [f"{name}.{kind}" for name in names for kind in ("png", "svg")]
    files += [ANIMATION] if ANIMATED in names else []
    return [directory / FIGURES / file for file in files]
