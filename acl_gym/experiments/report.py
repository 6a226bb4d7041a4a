"""The report of experiments: one HTML page that holds everything and loads nothing."""

from __future__ import annotations

import base64
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from acl_gym.experiments.claims import HOLDS, IN_PART, NOT, UNDECIDED
from acl_gym.experiments.outcome import Outcome
from acl_gym.experiments.statistics import Estimate, digits
from acl_gym.utils.files import write_atomically

_CLASSES = {HOLDS: "yes", IN_PART: "part", NOT: "no", UNDECIDED: "open"}


def write_report(
    path: Path,
    *,
    title: str,
    experiments: Sequence[Outcome],
    figures: Path,
    command: str,
    made: Mapping[str, Any],
    intro: Sequence[str] = (),
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
        made: where, when and with what; a value, or a list of
            them, by name.
        intro: paragraphs.
        facts: how much was run.
        notes: paragraphs on how it was done.
        claims: judged ones, see `Claim.judge`, with the names of the `experiments`
            that decide them and of the `trials` beside these.
        animation: the file name of a GIF among the figures.
    """
    environment = Environment(
        loader=PackageLoader("acl_gym.experiments"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"setting": _setting, "comparison": _comparison}
    counts = Counter(claim["verdict"] for claim in claims)
    images = {
        figure["file"]: _encoded(figures / f"{figure['file']}.png")
        for each in experiments
        for figure in each["figures"]
    }
    text = environment.get_template("report.html.j2").render(
        title=title,
        intro=intro,
        facts=facts,
        notes=notes,
        claims=claims,
        counts=[(name, counts[name]) for name in _CLASSES if counts[name]],
        classes=_CLASSES,
        experiments=experiments,
        names={each["name"] for each in experiments},
        images=images,
        animation=_encoded(figures / animation) if animation else "",
        curves=_explorable(experiments),
        command=command,
        made={
            name: ", ".join(map(str, value)) if isinstance(value, list) else value
            for name, value in made.items()
        },
        settings_headings=_SETTINGS,
    )
    write_atomically(path, text.encode())


_SETTINGS = (
    "Setting",
    "Runs",
    "Cost of the last policy",
    "Lowest to highest",
    "Reach the goal",
    "Learning, s",
    "Parameters",
)


def _setting(study: Outcome) -> list[str]:
    """A row under `_SETTINGS`."""
    cost = study["policy_cost"]
    return [
        study["label"],
        str(study["runs"]),
        _with_interval(cost, "interquartile_mean"),
        f"{digits(cost['min'])} to {digits(cost['max'])}",
        f"{study['success_rate']:.0%}",
        f"{study['seconds']:.2g}",
        study["parameters"],
    ]


def _comparison(found: Outcome) -> list[str]:
    """A row: where, measure, method, rival, verdict, ratio."""
    names = ("where", "measure", "method", "rival", "verdict")
    return [*(found.get(name, "") for name in names), _with_interval(found, "ratio")]


def _with_interval(found: Outcome, name: str) -> str:
    """An estimate with its interval, where None stands for infinity.

    No lower end of a finite value means that there is no interval.
    """
    value, low, high = (
        math.inf if found[key] is None else found[key] for key in (name, "low", "high")
    )
    low = math.nan if math.isinf(low) and math.isfinite(value) else low
    return str(Estimate(value, low, high)).replace("inf", "\N{INFINITY}")


def _encoded(path: Path) -> str:
    """A picture in base64; "" if there is none."""
    return base64.b64encode(path.read_bytes()).decode() if path.is_file() else ""


def _explorable(experiments: Sequence[Outcome]) -> Outcome:
    """The curves of a page, each once, and which of them experiments have."""
    names = ("label", "key")
    return {
        "experiments": {
            each["name"]: [{n: study[n] for n in names} for study in each["studies"]]
            for each in experiments
        },
        "curves": {
            study["key"]: {
                "every": study["every"],
                "positions": study["positions"],
                **study["curves"],
            }
            for each in experiments
            for study in each["studies"]
        },
    }


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
    rows = [("claim", "verdict", "statement", "measured", ""), ("---",) * 5]
    for claim in claims:
        shown = [n for n in (*claim["experiments"], *claim["trials"]) if n in names]
        source = "; ".join(filter(None, [claim["section"], ", ".join(shown)]))
        text = f"**{claim['text']}** {source}"
        rows.append((claim["claim"], claim["verdict"], text, "", ""))
        for part in claim["parts"]:
            mark = "yes" if part["holds"] else "no"
            rows.append(("", "", part["statement"], part["measured"], mark))
        for each in claim["tried"]:
            rows.append(("", "", f"tried: {each['what']}", each["found"], ""))
        if claim["understanding"]:
            rows.append(("", "", claim["understanding"], "", ""))
    table = "\n".join(f"| {' | '.join(row)} |" for row in rows)
    text = f"# The claims of the thesis\n\n{facts}\n\n{table}\n"
    write_atomically(path, text.encode())
