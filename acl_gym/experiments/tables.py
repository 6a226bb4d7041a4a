"""The tables beside the figures."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from acl_gym.experiments.comparison.experiments import LABELS
from acl_gym.experiments.references import (
    MARKS,
    TIMES,
    Reference,
    measured,
    reference,
)
from acl_gym.experiments.results import Results
from acl_gym.experiments.rivals import compared
from acl_gym.experiments.statistics import estimate, iqm, median, ratio
from acl_gym.experiments.study import Experiment
from acl_gym.utils.typing import FloatArray

NEVER = "never"
_COSTS = {
    "final_policy_cost": "cost of the last policy",
    "best_policy_cost": "cost of the best policy",
}


@dataclass(frozen=True)
class Table:
    """A table as it is shown.

    Attributes:
        headings: of the columns.
        rows: a text for each column; after a line break, what belongs to it in small.
        comparisons: the colonies against their rivals, see `Comparison.as_json`.
        best: row and column of each cell to be emphasised.
    """

    headings: list[str]
    rows: list[list[str]]
    comparisons: list[dict[str, Any]] = field(default_factory=list)
    best: list[list[int]] = field(default_factory=list)


def system(experiment: Experiment, results: Results) -> Table:
    """One system: costs, and what learning takes in interactions and in time."""
    known, rows = reference(experiment, results), []
    studies = experiment.studies.items()
    found = {label: measured(each, results, known) for label, each in studies}
    for label, own in found.items():
        last, runs = own["final_policy_cost"], results.runs(experiment.studies[label])
        rows.append(
            [
                label,
                str(estimate(last)),
                f"{last.min():.4g} to {last.max():.4g}",
                str(estimate(own["best_policy_cost"])),
                f"{100 * own['final_success_rate'].mean():.0f}%",
                *(_time(own[key], key) for key in TIMES),
                f"{own['env_steps'][0]:,.0f}",
                f"{iqm(own['seconds']):.2g}",
                str(sum(bool(run.failure) for run in runs) or "none"),
            ]
        )
    name = "J*" if known.optimal else "the best known cost"
    comparisons = [
        each.as_json()
        for key, measure in (_COSTS | TIMES).items()
        for each in compared(
            "",
            f"{measure} of {name}" if key in TIMES else measure,
            {label: own[key] for label, own in found.items()},
        )
    ]
    headings = ["Method", "Cost of the last policy", "Range", "Cost of the best"]
    headings += ["Reach the goal"]
    headings += [each.replace("within ", "").capitalize() for each in TIMES.values()]
    headings += ["Interactions of a run", "Seconds of a run", "Broke down"]
    return Table(headings, rows, comparisons)


def _time(at: FloatArray, key: str) -> str:
    """The interquartile mean of times, and how many runs got there."""
    count, middle = int(np.isfinite(at).sum()), float(iqm(at))
    text = NEVER
    if math.isfinite(middle):
        steps = key.startswith("env_steps")
        text = f"{float(f'{middle:.3g}'):,.0f}" if steps else f"{middle:.2g}"
    return text if count == len(at) else f"{text} ({count} of {len(at)})"


def harder(experiment: Experiment, results: Results) -> Table:
    """Several tasks: the cost of the last policy, and each colony against it in small."""
    rows, comparisons, headings = [], [], [experiment.options["of"]]
    for where, row in experiment.options["rows"].items():
        last = {LABELS[name]: results.last(study) for name, study in row.items()}
        own = compared(where, _COSTS["final_policy_cost"], last)
        cells = {name: str(estimate(values)) for name, values in last.items()}
        for each in own:
            cells[each.rival] += f"\n{each.method} {each.verdict}, {each.ratio} times"
        rows.append([where, *cells.values()])
        comparisons += [each.as_json() for each in own]
    headings += last
    return Table(headings, rows, comparisons)


def overview(experiment: Experiment, results: Results) -> Table:
    """As `harder`, compared as well by the interactions and the time that learning takes."""
    table, found = harder(experiment, results), {}
    for where, row in experiment.options["rows"].items():
        cost = float(results.last(experiment.references[where])[0])
        known = Reference(experiment.references[where], cost, optimal=False)
        found[where] = {LABELS[n]: measured(row[n], results, known) for n in row}
    for key, text in TIMES.items():
        for where, row in found.items():
            values = {name: measures[key] for name, measures in row.items()}
            own = compared(where, f"{text} of the reference", values)
            table.comparisons.extend(each.as_json() for each in own)
    return table


def slots(experiment: Experiment, results: Results) -> Table:
    """As `harder`, and what the most slots cost beside the best number of them."""
    found = harder(experiment, results)
    table = experiment.options["rows"]
    most = list(table)[-1]
    line = [f"{most} over the best number"]
    for method in table[most]:
        costs = {label: results.last(row[method]) for label, row in table.items()}
        best = min(costs, key=lambda label: float(iqm(costs[label])))
        line.append(f"{ratio(costs[most], costs[best])} times that of {best}")
    line += [""] * (len(found.headings) - len(line))
    return replace(found, rows=[*found.rows, line])


def order(experiment: Experiment, results: Results) -> Table:
    """Each run with its slots in order and in reverse order."""
    rows = []
    for label, (forth, back) in experiment.options["pairs"].items():
        n_cells = forth.make_partition().n_cells
        actions = [
            np.stack([run.table.reshape(n_cells, -1) for run in results.runs(study)])
            for study in (forth, back)
        ]
        differ = (actions[0].argmax(axis=2) != actions[1].argmax(axis=2)).sum(axis=1)
        apart = np.abs(results.last(back) / results.last(forth) - 1)
        rows.append(
            [
                label,
                f"{int((differ == 0).sum())} of {len(differ)}",
                f"{100 * np.median(differ) / n_cells:.2g}%",
                f"{100 * np.median(apart):.2g}% (at most {100 * apart.max():.2g}%)",
            ]
        )
    return Table(
        ["Method", "Same policy", "Cells that differ", "Cost differs by"], rows
    )


def summarise(experiment: Experiment, results: Results) -> list[dict[str, Any]]:
    """The runs of each method in medians, JSON types.

    Args:
        experiment: with a reference, and the names of the methods in its options as
            `agents`, by their labels.
        results: its runs.

    Returns:
        One entry for each method: `agent`, `label`, `seeds` (how many), and estimates
        (`median`, `low`, `high`; None where infinite or not there) for each key of
        `_COLUMNS`, gaps being percent above the reference; of the times until policies
        are close to it also how many `reached` it.
    """
    known, summary = reference(experiment, results), []
    for label, study in experiment.studies.items():
        entry: dict[str, Any] = {
            "agent": experiment.options["agents"][label],
            "label": label,
            "seeds": len(results.runs(study)),
        }
        for key, values in measured(study, results, known).items():
            if np.isnan(values).any():
                entry[key] = dict.fromkeys(("median", "low", "high"))
            else:
                entry[key] = estimate(values, median).as_json("median")
            if key in TIMES:
                entry[key]["reached"] = int(np.isfinite(values).sum())
        summary.append(entry)
    return summary


_COLUMNS: dict[str, tuple[str, Callable[[Sequence[float]], float] | None]] = {
    **{
        f"{name}_{key}": (f"{word}\n{title}", best)
        for name, word in (("final", "last"), ("best", "best"))
        for title, key, best in (
            ("cost", "policy_cost", min),
            ("above", "gap_percent", min),
            ("goal", "success_rate", max),
        )
    },
    **{
        f"{x}_to_{mark}": (f"{mark}%\n{title}", min)
        for mark in MARKS
        for x, title in (("env_steps", "steps"), ("seconds", "time s"))
    },
    **{"env_steps": ("training\nsteps", None), "seconds": ("training\ntime s", None)},
}
"""Of the summary: key of an entry -> heading, and which of the medians is the best."""


def summary(experiment: Experiment, results: Results, *, brief: bool = False) -> Table:
    """Medians over seeds, their intervals, and how many runs reached the target.

    Args:
        experiment: see `summarise`.
        results: its runs.
        brief: whether it has to fit into a terminal, which has no room for the whole
            training, nor for intervals other than those of costs.
    """
    entries, headings, emphasised = summarise(experiment, results), [""], []
    rows = [[str(entry["label"])] for entry in entries]
    for key, (heading, best) in _COLUMNS.items():
        if brief and best is None:
            continue
        medians = [entry[key]["median"] for entry in entries]
        if key.endswith(("gap_percent", "success_rate")) and set(medians) == {None}:
            continue  # of which nothing is known
        known = [value for value in medians if value is not None]
        if best and known and len(set(medians)) > 1:
            found, place = best(known), len(headings)
            emphasised += [[i, place] for i, v in enumerate(medians) if v == found]
        headings.append(heading)
        for row, entry in zip(rows, entries, strict=True):
            row.append(_cell(key, entry, intervals=not brief or key.endswith("cost")))
    return Table(headings, rows, best=emphasised)


def _cell(key: str, entry: dict[str, Any], *, intervals: bool) -> str:
    """The median, and below it the interval and how many runs got there if not all."""
    found, seeds = entry[key], entry["seeds"]
    reached = found.get("reached", seeds)
    lines = [number(key, found["median"])]
    if found["median"] is None and reached:
        lines = ["–"]
    if intervals and found["low"] is not None:
        ends = (number(key, found[end]) for end in ("low", "high"))
        lines.append("–".join(end.strip("+%") for end in ends))
    if 0 < reached < seeds:
        lines.append(f"{reached} of {seeds}")
    return "\n".join(lines)


def number(key: str, value: float | None) -> str:
    """A figure of the summary: 1.91M steps, 4.8 s, a cost of 45.2, 99.6%, +3.1%."""
    if value is None:
        return NEVER
    if key.startswith("env_steps"):
        rounded = float(f"{value:.3g}")
        if rounded >= 1e6:
            return f"{rounded / 1e6:.3g}M"
        return f"{rounded / 1e3:.3g}k" if rounded >= 1e3 else f"{rounded:,.0f}"
    if key.startswith("seconds"):
        return f"{value:.0f}" if value >= 9.95 else f"{value:#.2g}"
    if key.endswith("cost"):
        return f"{value:.2f}" if abs(value) < 19.995 else f"{value:.1f}"
    if key.endswith("success_rate"):
        return f"{100 * value:.3g}%"  # 100% is all, 99.6% is not
    text = f"{value:+.0f}%" if abs(value) >= 99.5 else f"{value:+.1f}%"
    return text.replace("-", "−")


TABLES: dict[str, Callable[[Experiment, Results], Table]] = {
    "overview": overview,
    "system": system,
    "harder": harder,
    "slots": slots,
    "order": order,
    "summary": summary,
}
"""The tables by name."""
