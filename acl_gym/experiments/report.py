"""The report of experiments: an HTML page with its figures and curves in files beside it.

The page itself is small. A browser loads figures and curves when the reader comes near
them, also where the page is opened as a file: curves are scripts because a page from
`file://` may read no other data. Nothing comes from the network.
"""

from __future__ import annotations

import json
import os
import struct
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from jinja2 import Environment, PackageLoader, StrictUndefined

from acl_gym.experiments.claims import HOLDS, IN_PART, NOT, UNDECIDED
from acl_gym.experiments.outcome import Outcome
from acl_gym.utils.files import write_atomically
from acl_gym.utils.text import digits

_CLASSES = {HOLDS: "yes", IN_PART: "part", NOT: "no", UNDECIDED: "open"}
_CURVES = ("label", "every", "positions", "unit", "curves")

CURVES = "curves"
"""The folder beside the page that holds a script with the curves of each experiment."""


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
    """Write a report: the page, and in the folder `CURVES` beside it the curves.

    Args:
        path: of the page, which appears complete or not at all.
        title: of the page.
        experiments: what each found, see `outcome.summary`.
        figures: the folder of their PNG files, to which the page refers; those that
            are not there are left out.
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
    files = {file for file in files if _is_file_name(file)}
    explored = {e["name"]: e for e in experiments if _is_file_name(e["name"])}
    counts = Counter(claim["verdict"] for claim in claims)
    page = _rendered(
        "report.html.j2",
        title=title,
        facts=facts,
        notes=notes,
        claims=claims,
        counts=[(name, counts[name]) for name in _CLASSES if counts[name]],
        classes=_CLASSES,
        experiments=experiments,
        names={each["name"] for each in experiments},
        images={file: _image(figures / f"{file}.png", path) for file in files},
        animation=_image(figures / animation, path) if animation else None,
        curves={name: quote(f"{CURVES}/{name}.js") for name in explored},
        command=command,
        made=made,
    )
    (path.parent / CURVES).mkdir(exist_ok=True)
    for name, each in explored.items():
        studies = [{n: study[n] for n in _CURVES} for study in each["studies"]]
        values = (json.dumps(value, separators=(",", ":")) for value in (name, studies))
        script = f"showCurves({','.join(values)});\n"
        write_atomically(path.parent / CURVES / f"{name}.js", script.encode())
    write_atomically(path, page.encode())


def write_claims(
    path: Path,
    claims: Sequence[Outcome],
    experiments: Sequence[Outcome],
    figures: Path,
    facts: str,
) -> None:
    """Write the claims as a table in Markdown, with links to the figures.

    Args:
        path: where; the file appears complete or not at all.
        claims: see `write_report`.
        experiments: those that were run, see `write_report`. The name of one becomes a
            link to its first figure, if that is there.
        figures: see `write_report`.
        facts: how much was run.
    """
    shown = {each["name"]: _first_figure(each, figures, path) for each in experiments}
    page = _rendered("claims.md.j2", claims=claims, figures=shown, facts=facts)
    write_atomically(path, page.encode())


def _first_figure(experiment: Outcome, figures: Path, page: Path) -> str:
    """The address of the first figure of an experiment from a page; "" if none."""
    files = (figure["file"] for figure in experiment["figures"])
    images = (_image(figures / f"{f}.png", page) for f in files if _is_file_name(f))
    return next((str(image["source"]) for image in images if image), "")


def _rendered(template: str, **values: Any) -> str:
    environment = Environment(
        loader=PackageLoader("acl_gym.experiments"),
        autoescape=lambda name: name is not None and ".html" in name,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["digits"] = _digits
    return environment.get_template(template).render(values)


def _digits(value: float | None) -> str:
    return "\N{INFINITY}" if value is None else digits(value)


def _is_file_name(name: str) -> bool:
    return Path(name).name == name


def _image(picture: Path, page: Path) -> dict[str, Any] | None:
    """Address of a picture from a page, width and height; None if there is no picture."""
    if not picture.is_file():
        return None
    with picture.open("rb") as file:
        head = file.read(24)
    width = height = None
    if head[12:16] == b"IHDR":  # a PNG; the reader's page does not jump as it loads
        width, height = struct.unpack(">II", head[16:24])
    address = Path(os.path.relpath(picture, page.parent)).as_posix()
    return {"source": quote(address), "width": width, "height": height}
