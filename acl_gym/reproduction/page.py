"""The report of a reproduction: one HTML page that holds everything and loads nothing."""

from __future__ import annotations

import base64
import json
from collections import Counter
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from acl_gym.reproduction.catalogue.common import FEWER
from acl_gym.reproduction.outcome import Outcome
from acl_gym.reproduction.verdicts import HOLDS, IN_PART, NOT, UNDECIDED
from acl_gym.utils.files import write_atomically

FIGURES = "figures"
RESULTS = "results.json"
PAGE = "report.html"
CLAIMS_TABLE = "claims.md"
ANIMATION = "learning.gif"
ANIMATED = "fig5.6"
"""With this experiment the animation of its policy is drawn."""
POINTS = 250
"""So many points of a line are explored at most."""

_CLASSES = {HOLDS: "yes", IN_PART: "part", NOT: "no", UNDECIDED: "open"}


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
        outcome = json.loads(path.read_text())
        whole = (
            {"claims", "experiments", "runs", "made"} <= outcome.keys()
            and all({"tried", "trials"} <= each.keys() for each in outcome["claims"])
            and all("explains" in each for each in outcome["experiments"])
        )
        if not whole:
            raise KeyError
    except (ValueError, AttributeError, KeyError) as error:
        raise ValueError(
            f"{path} is not the result of a reproduction by this version; make it again "
            "with `acl-gym reproduce`, which takes the runs that are there."
        ) from error
    return dict(outcome)


def write_page(directory: Path) -> Path:
    """Write report.html from the results and figures of a folder.

    Args:
        directory: with what `reproduce` has written, and the folder figures/.

    Returns:
        The path of the page, which appears whole or not at all.

    Raises:
        FileNotFoundError: there are no results.
        ValueError: the results cannot be read.
    """
    outcome = read_outcome(directory)
    environment = Environment(
        loader=PackageLoader("acl_gym.reproduction"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    counts = Counter(claim["verdict"] for claim in outcome["claims"])
    there = {each["name"] for each in outcome["experiments"]}
    text = environment.get_template("page.html.j2").render(
        outcome=outcome,
        counts=[(name, counts[name]) for name in _CLASSES if counts[name]],
        classes=_CLASSES,
        there=there,
        images={
            each["name"]: _image(directory / FIGURES / f"{each['name']}.png")
            for each in outcome["experiments"]
        },
        animation=_image(directory / FIGURES / ANIMATION),
        curves=_curves(outcome),
        fewer=FEWER,
    )
    path = directory / PAGE
    write_atomically(path, text.encode())
    return path


def write_claims(directory: Path) -> Path:
    """Write claims.md, the table of claims as text; see `write_page`."""
    outcome = read_outcome(directory)
    there = {each["name"] for each in outcome["experiments"]}
    lines = [
        "# The claims of the thesis",
        "",
        f"{outcome['runs']} runs of each setting ({FEWER} at most of what was tried "
        "beside the thesis's experiments and takes long). In brackets: 95% bootstrap intervals "
        "of the interquartile mean. The page report.html has the figures.",
        "",
        "| claim | verdict | statement | measured | |",
        "| --- | --- | --- | --- | --- |",
    ]
    for claim in outcome["claims"]:
        names = [*claim["experiments"], *claim["trials"]]
        figures = ", ".join(name for name in names if name in there)
        source = f"{claim['section']}; {figures}" if figures else claim["section"]
        text = f"**{claim['text']}** {source}"
        lines.append(f"| {claim['claim']} | {claim['verdict']} | {text} | | |")
        lines += [
            f"| | | {part['statement']} | {part['measured']} | "
            f"{'yes' if part['holds'] else 'no'} |"
            for part in claim["parts"]
        ]
        lines += [
            f"| | | tried: {each['what']} | {each['found']} | |"
            for each in claim["tried"]
        ]
        if claim["understanding"]:
            lines.append(f"| | | {claim['understanding']} | | |")
    path = directory / CLAIMS_TABLE
    write_atomically(path, ("\n".join(lines) + "\n").encode())
    return path


def _curves(outcome: Outcome) -> dict[str, Any]:
    """What can be explored: curves by setting, and which of them experiments show."""
    curves: dict[str, Any] = {}
    experiments: dict[str, list[dict[str, str]]] = {}
    for each in outcome["experiments"]:
        shown = experiments.setdefault(each["name"], [])
        for study in each["studies"]:
            key = json.dumps(study["setting"], sort_keys=True)
            shown.append({"label": study["label"], "key": key})
            if key not in curves:
                curves[key] = _thinned(study["curves"], study["positions"])
    # Keys are long and repeated: numbers will do.
    numbers = {key: str(number) for number, key in enumerate(curves)}
    for shown in experiments.values():
        for entry in shown:
            entry["key"] = numbers[entry["key"]]
    return {
        "experiments": experiments,
        "curves": {numbers[key]: curve for key, curve in curves.items()},
    }


def _thinned(curves: dict[str, Any], positions: list[int] | None) -> dict[str, Any]:
    """At most `POINTS` points a line, four digits each; `every` so many trials one.

    Args:
        curves: lines by measure, see `outcome.curves`.
        positions: the interactions at their points; None where these are trials.
    """
    trials = max(len(curve["mean"]) for curve in curves.values())
    every = -(-trials // POINTS)
    return {
        "every": every,
        "positions": positions and positions[::every],
        **{
            measure: {
                name: [float(f"{value:.4g}") for value in line[::every]]
                for name, line in curve.items()
            }
            for measure, curve in curves.items()
        },
    }


def _image(path: Path) -> str:
    """A picture as text, nothing if it is not there."""
    if not path.is_file():
        return ""
    return base64.b64encode(path.read_bytes()).decode("ascii")
