"""The report of experiments: one HTML page that holds everything and loads nothing."""

from __future__ import annotations

import base64
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from acl_gym.experiments.claims import HOLDS, IN_PART, NOT, UNDECIDED
from acl_gym.experiments.outcome import Outcome
from acl_gym.utils.files import write_atomically
from acl_gym.utils.text import digits

_CLASSES = {HOLDS: "yes", IN_PART: "part", NOT: "no", UNDECIDED: "open"}
_CURVES = ("label", "every", "positions", "unit", "curves")


def write_report(
    path: Path,
    *,
    title: str,
    experiments: Sequence[Outcome],
    figures: Path,
    command: str,
    made: Mapping[str, Any],
    facts: str = "",
    notes: Sequence[str] = (),
    claims: Sequence[Outcome] = (),
    animation: str = "",
) -> None:
    """Write a report.

    Args:
        path: where; the file appears complete or not at all.
        title: of the page.
        experiments: what each found, see `outcome.summary`.
        figures: the folder of their PNG files; those that are not there are left out.
        command: repeats all of it.
        made: where, when and with what; a value, or a list of them, by name.
        facts: how much was run.
        notes: paragraphs on how it was done.
        claims: judged ones, see `Claim.judge`, with the names of the `experiments`
            that decide them and of the `trials` beside these.
        animation: the file name of a GIF among the figures.
    """
    files = {figure["file"] for each in experiments for figure in each["figures"]}
    # Results may come from anywhere: no name in them leads out of the folder.
    files = {file for file in files if Path(file).name == file}
    counts = Counter(claim["verdict"] for claim in claims)
    _render(
        path,
        "report.html.j2",
        title=title,
        facts=facts,
        notes=notes,
        claims=claims,
        counts=[(name, counts[name]) for name in _CLASSES if counts[name]],
        classes=_CLASSES,
        experiments=experiments,
        names={each["name"] for each in experiments},
        images={file: _encoded(figures / f"{file}.png") for file in files},
        animation=_encoded(figures / animation) if animation else "",
        curves={
            each["name"]: [{n: study[n] for n in _CURVES} for study in each["studies"]]
            for each in experiments
        },
        command=command,
        made=made,
    )


def write_claims(
    path: Path, claims: Sequence[Outcome], names: set[str], facts: str
) -> None:
    """Write the claims as a table in Markdown.

    Args:
        path: where; the file appears complete or not at all.
        claims: see `write_report`.
        names: of the experiments that were run.
        facts: how much was run.
    """
    _render(path, "claims.md.j2", claims=claims, names=names, facts=facts)


def _render(path: Path, template: str, **values: Any) -> None:
    environment = Environment(
        loader=PackageLoader("acl_gym.experiments"),
        autoescape=lambda name: name is not None and ".html" in name,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["digits"] = _digits
    write_atomically(path, environment.get_template(template).render(values).encode())


def _digits(value: float | None) -> str:
    return "\N{INFINITY}" if value is None else digits(value)


def _encoded(path: Path) -> str:
    """A picture in base64; "" if there is none."""
    return base64.b64encode(path.read_bytes()).decode() if path.is_file() else ""
