"""The report of a design: one HTML page that holds everything and loads nothing."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from acl_gym.design.advice import advice_on_limits, state_in_words
from acl_gym.design.learning import CHOOSING, GOOD, Learned
from acl_gym.design.limits import Limits
from acl_gym.design.measures import Measures, Spread, distances
from acl_gym.envs.plant import Plant
from acl_gym.utils.files import write_atomically
from acl_gym.utils.text import digits, percent

_ENDED = {
    "converged": "because the policy no longer improved",
    "time": "because the time was up",
    "steps": "after the number of interactions that was asked for",
    "interrupted": "because it was interrupted",
}


def write_page(
    folder: Path,
    summary: dict[str, Any],
    learned: Learned,
    measures: Measures,
    limits: Limits,
    plant: Plant,
    figures: Sequence[str],
) -> None:
    """Write `report.html` into the folder of a design.

    Args:
        folder: where the pictures are.
        summary: what `summary.json` holds.
        learned: how the controller was learned.
        measures: what it does.
        limits: how often its paths touch the ends of the range.
        plant: the system.
        figures: the pictures, without `.png`.
    """
    environment = Environment(
        loader=PackageLoader("acl_gym.design"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["digits"] = digits
    environment.filters["percent"] = percent
    page = environment.get_template("report.html.j2").render(
        title=_title(summary),
        summary=summary,
        good=GOOD,
        choosing=CHOOSING,
        measures=measures,
        limits=limits,
        owed_to_limits=bool(advice_on_limits(limits, measures, plant)),
        learned=learned,
        ended=_ENDED[learned.ended],
        rows=_rows(measures),
        variables=_variables(plant),
        inputs=_inputs(plant),
        overshoots=_by_variable(measures.overshoot),
        remaining=_by_variable(measures.remaining),
        stays=_stays(measures, plant),
        worst_start=state_in_words(measures.worst_start, plant),
        typical_start=state_in_words(measures.typical_start, plant),
        episode_seconds=plant.evaluation_steps * plant.sampling_time,
        sampling_time=plant.sampling_time,
        images={name: _encoded(folder / f"{name}.png") for name in figures},
    )
    write_atomically(folder / "report.html", page.encode())


def _title(summary: dict[str, Any]) -> str:
    name = Path(summary["plant"]).stem.replace("_", " ")
    return f"Controller for {'a plant' if '(' in name else name}"


def _rows(measures: Measures) -> list[tuple[str, list[str]]]:
    """The spreads over the starts: a name and median, mean, 95% and worst of each."""
    named = {
        "cost until the goal": measures.cost,
        "time to the goal, s": measures.time_to_goal,
        "settling time, s": measures.settling_time,
    }
    return [
        (name, _cells(spread)) for name, spread in named.items() if spread is not None
    ]


def _cells(spread: Spread) -> list[str]:
    values = spread.median, spread.mean, spread.high, spread.worst
    return [digits(value) for value in values]


def _by_variable(spreads: dict[str, Spread]) -> list[tuple[str, list[str]]]:
    return [(name, _cells(spread)) for name, spread in spreads.items()]


def _variables(plant: Plant) -> list[tuple[str, str, str]]:
    """Name, range and goal of each variable."""
    box = plant.goal_box
    rows = []
    for axis, name in enumerate(plant.variable_names):
        goal = "see the file"
        if box is not None:
            goal = f"{digits(box[0, axis])} to {digits(box[1, axis])}"
        ends = f"{digits(plant.low[axis])} to {digits(plant.high[axis])}"
        if axis in plant.circular:
            ends += ", round"
        rows.append((name, ends, goal))
    return rows


def _inputs(plant: Plant) -> list[tuple[str, str]]:
    """Name and values of each input."""
    return [
        (name, ", ".join(digits(value) for value in values))
        for name, values in zip(plant.signals.inputs, plant.inputs.T, strict=True)
    ]


def _stays(measures: Measures, plant: Plant) -> str:
    """What happens after the goal, in words: "stays", "near" or "leaves"."""
    box = plant.goal_box
    if measures.settled_rate >= GOOD:
        return "stays"
    if box is None or not measures.remaining or distances(box, plant) is None:
        return "leaves"
    half = (box[1] - box[0]) / 2
    most = [spread.high for spread in measures.remaining.values()]
    tenth = 0.1 * (plant.high - plant.low)
    near = all(
        high <= max(3.0 * width, share)
        for high, width, share in zip(most, half, tenth, strict=True)
    )
    return "near" if near else "leaves"


def _encoded(path: Path) -> str:
    return base64.b64encode(path.read_bytes()).decode()
