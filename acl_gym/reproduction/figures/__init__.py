"""The figures of the experiments, as the thesis describes them."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from matplotlib.figure import Figure

from acl_gym.reproduction.evidence import Evidence
from acl_gym.reproduction.figures import (
    animation,
    bands,
    policies,
    swings,
    theory,
    versus,
)
from acl_gym.reproduction.settings import Experiment
from acl_gym.utils.files import write_atomically

__all__ = ["DRAWINGS", "Files", "animation", "save"]

DPI = 150

DRAWINGS: dict[str, Callable[[Experiment, Evidence], Figure]] = {
    "bands": bands.bands,
    "measures": bands.measures,
    "policies": policies.policies,
    "baseline": policies.baseline_policy,
    "bands_and_policies": policies.bands_and_policies,
    "swing": swings.swing,
    "level_band": theory.level_band,
    "policy_gap": theory.policy_gap,
    "race": versus.race,
    "harder": versus.harder,
    "sweep": versus.sweep,
    "order": versus.order,
}


class Files(NamedTuple):
    """A figure as a picture and as vectors."""

    png: Path
    svg: Path


def save(experiment: Experiment, evidence: Evidence, directory: Path) -> Files:
    """Draw the figure of an experiment and write it, each file whole or not at all.

    Args:
        experiment: which.
        evidence: its runs.
        directory: exists.
    """
    figure = DRAWINGS[experiment.drawing](experiment, evidence)
    figure.suptitle(bands.in_greek(experiment.title), fontsize=9, x=0.01, ha="left")
    files = Files(*(directory / f"{experiment.name}.{kind}" for kind in Files._fields))
    for file in files:
        buffer = io.BytesIO()
        figure.savefig(buffer, format=file.suffix[1:], dpi=DPI)
        write_atomically(file, buffer.getvalue())
    return files
