"""The tables beside the figures, and how ACL is held against another method.

ACL is compared with each rival by the ratio of interquartile means with its bootstrap
interval. It wins or loses where the whole interval lies on one side of 1; otherwise these
runs show no difference.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from acl_gym.experiments.comparison.experiments import LABELS, LONG
from acl_gym.experiments.results import Results
from acl_gym.experiments.statistics import Estimate, estimate, iqm, median, ratio
from acl_gym.experiments.study import Experiment, Study
from acl_gym.utils.typing import FloatArray

MARKS = (25, 10)
"""Percent above the reference that count as close, the wider first."""

FEW = 5
"""With fewer runs no method is said to win."""

SLACK = 1e-3
"""Ratios that are no farther from 1 are taken for 1."""

WINS, LOSES, EVEN, OPEN = "wins", "loses", "no difference", "undecided"
NEITHER = "neither"
"""Of times: neither gets there in more than half of its runs."""

NEVER = "never"
_LAST = "cost of the last policy"
_UNITS = {"env_steps": "interactions", "seconds": "seconds"}


@dataclass(frozen=True)
class Table:
    """A table as it is shown.

    Attributes:
        headings: of the columns.
        rows: a text for each column; after a line break, what belongs to it in small.
        comparisons: ACL against its rivals, see `Comparison.as_json`.
        best: row and column of each cell to be emphasised.
    """

    headings: list[str]
    rows: list[list[str]]
    comparisons: list[dict[str, Any]] = field(default_factory=list)
    best: list[tuple[int, int]] = field(default_factory=list)


class Reference(NamedTuple):
    """What policies are measured against: a study, its cost, and whether that is J*."""

    study: Study
    cost: float
    optimal: bool

    @property
    def symbol(self) -> str:
        """What the cost is called."""
        return "J*" if self.optimal else "best known"


def reference(experiment: Experiment, results: Results) -> Reference:
    """The first reference; an option says whether it is the optimum."""
    for study in experiment.references.values():
        cost = float(results.last(study)[0])
        return Reference(study, cost, experiment.options["optimum"])
    raise LookupError(f"{experiment.name} must have a reference, got none.")


class Comparison(NamedTuple):
    """A method against a rival by one measure; less is better.

    Attributes:
        where: the task; "" where there is one.
        measure: what is compared.
        method: the name of the method.
        rival: the name of the other one.
        verdict: WINS, LOSES, EVEN, NEITHER or OPEN, of the method.
        ratio: how many times the rival's figure that of the method is.
    """

    where: str
    measure: str
    method: str
    rival: str
    verdict: str
    ratio: Estimate

    def as_json(self) -> dict[str, Any]:
        """JSON types: `ratio`, with its interval from `low` to `high`."""
        return {**self._asdict(), **self.ratio.as_json("ratio")}


def compare(
    where: str, measure: str, names: tuple[str, str], values: Sequence[FloatArray]
) -> Comparison:
    """Hold a method against a rival.

    Args:
        where: see `Comparison`.
        measure: what the values are.
        names: of the method and of the rival.
        values: of both, one a run, > 0 or infinite.
    """
    found = ratio(values[0], values[1])
    if min(map(len, values)) < FEW:
        verdict = OPEN
    elif all(math.isinf(np.median(each)) for each in values):
        verdict = NEITHER
    elif found.low > 1 + SLACK:
        verdict = LOSES
    else:
        verdict = WINS if found.high < 1 - SLACK else EVEN
    return Comparison(where, measure, *names, verdict, found)


def system(experiment: Experiment, results: Results) -> Table:
    """One system: costs, and what learning takes in interactions and in time."""
    known, rows, values = reference(experiment, results), [], {}
    name = "J*" if known.optimal else "the best known cost"
    for label, study in experiment.studies.items():
        runs, last, best = results.runs(study), results.last(study), results.best(study)
        success, seconds = (
            results.last(study, "success_rate"),
            [r.seconds for r in runs],
        )
        own = {_LAST: last, "cost of the best policy": best}
        times = []
        for mark, x, at in _times(study, results, known.cost):
            own[f"{_UNITS[x]} to within {mark}% of {name}"] = at
            times.append(_time(at, x))
        rows.append(
            [
                label,
                str(estimate(last)),
                f"{last.min():.4g} to {last.max():.4g}",
                str(estimate(best)),
                f"{100 * success.mean():.0f}%",
                *times,
                f"{runs[0].rows['env_steps'].iloc[-1]:,.0f}",
                f"{iqm(seconds):.2g}",
                str(sum(bool(run.failure) for run in runs) or "none"),
            ]
        )
        values[label] = own
    acl = LABELS["acl"]
    comparisons = [
        compare("", measure, (acl, label), (values[acl][measure], each)).as_json()
        for label, own in values.items()
        if label != acl
        for measure, each in own.items()
    ]
    headings = ["Method", "Cost of the last policy", "Range", "Cost of the best"]
    headings += ["Reach the goal"]
    headings += [f"{u.capitalize()} to {m}%" for m in MARKS for u in _UNITS.values()]
    headings += ["Interactions of a run", "Seconds of a run", "Broke down"]
    return Table(headings, rows, comparisons)


def _times(
    study: Study, results: Results, cost: float
) -> Iterator[tuple[int, str, FloatArray]]:
    """Mark, measure, and when each run first came so close to a cost."""
    for mark in MARKS:
        for x in _UNITS:
            yield mark, x, results.first_within(study, cost * (1 + mark / 100), x)


def _time(at: FloatArray, x: str) -> str:
    """The interquartile mean of times, and how many runs got there."""
    count, middle = int(np.isfinite(at).sum()), float(iqm(at))
    text = NEVER
    if math.isfinite(middle):
        text = f"{float(f'{middle:.3g}'):,.0f}" if x == "env_steps" else f"{middle:.2g}"
    return text if count == len(at) else f"{text} ({count} of {len(at)})"


def harder(experiment: Experiment, results: Results) -> Table:
    """Several tasks: the cost of the last policy, ACL against each rival."""
    table = experiment.options["rows"]
    names = list(next(iter(table.values())))
    colonies = [name for name in names if name in ("acl", LONG)]
    pairs = [
        (one, rival) for one in colonies for rival in names if rival not in colonies
    ]
    rows, comparisons = [], []
    for where, row in table.items():
        last = {name: results.last(study) for name, study in row.items()}
        own = [
            compare(where, _LAST, (LABELS[one], LABELS[m]), (last[one], last[m]))
            for one, m in pairs
        ]
        verdicts = [f"{each.verdict}, {each.ratio} times" for each in own]
        rows.append(
            [where, *(str(estimate(each)) for each in last.values()), *verdicts]
        )
        comparisons += [each.as_json() for each in own]
    headings = [experiment.options["of"], *(LABELS[name] for name in names)]
    headings += [f"{LABELS[one]} against {LABELS[m]}" for one, m in pairs]
    return Table(headings, rows, comparisons)


def overview(experiment: Experiment, results: Results) -> Table:
    """As `harder`, compared as well by the interactions and the time that learning takes."""
    found = harder(experiment, results)
    comparisons: dict[str, list[dict[str, Any]]] = {}
    for where, row in experiment.options["rows"].items():
        cost = float(results.last(experiment.references[where])[0])
        times = {name: _times(study, results, cost) for name, study in row.items()}
        for acl, *rivals in zip(*times.values(), strict=True):
            measure = f"{_UNITS[acl[1]]} to within {acl[0]}% of the reference"
            comparisons.setdefault(measure, []).extend(
                compare(
                    where, measure, (LABELS["acl"], LABELS[m]), (acl[2], at)
                ).as_json()
                for m, (_, _, at) in zip(list(row)[1:], rivals, strict=True)
            )
    return replace(found, comparisons=sum(comparisons.values(), found.comparisons))


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
        (`median`, `low`, `high`; None where infinite or not there) `final_policy_cost`,
        `best_policy_cost`, `final_gap_percent` and `best_gap_percent` (above the
        reference), `final_success_rate`, `best_success_rate`, `env_steps` and `seconds`
        (of all training), and for each mark `env_steps_to_25`, `seconds_to_25`,
        `env_steps_to_10`, `seconds_to_10`, with how many `reached` it.
    """
    cost, summary = reference(experiment, results).cost, []
    for label, study in experiment.studies.items():
        last, best = results.last, results.best
        values = {
            "final_policy_cost": last(study),
            "final_gap_percent": 100 * (last(study) / cost - 1),
            "final_success_rate": last(study, "success_rate"),
            "best_policy_cost": best(study),
            "best_gap_percent": 100 * (best(study) / cost - 1),
            "best_success_rate": best(study, "success_rate"),
            "env_steps": last(study, "env_steps"),
            "seconds": last(study, "seconds"),
        }
        entry: dict[str, Any] = {
            "agent": experiment.options["agents"][label],
            "label": label,
            "seeds": len(results.runs(study)),
        }
        for name, each in values.items():
            entry[name] = estimate(each, median).as_json("median")
        for mark, x, at in _times(study, results, cost):
            entry[f"{x}_to_{mark}"] = {
                **estimate(at, median).as_json("median"),
                "reached": int(np.isfinite(at).sum()),
            }
        summary.append(entry)
    return summary


_COLUMNS: tuple[tuple[str, str, Callable[[Sequence[float]], float]], ...] = (
    *(
        (f"{word}\n{title}", f"{name}_{key}", best)
        for name, word in (("final", "last"), ("best", "best"))
        for title, key, best in (
            ("cost", "policy_cost", min),
            ("above", "gap_percent", min),
            ("goal", "success_rate", max),
        )
    ),
    *(
        (f"{mark}%\n{title}", f"{x}_to_{mark}", min)
        for mark in MARKS
        for x, title in (("env_steps", "steps"), ("seconds", "time s"))
    ),
)
"""Of the summary: heading, key of an entry, and which of the medians is the best."""


def summary(experiment: Experiment, results: Results) -> Table:
    """What `acl-gym compare` prints: medians over seeds, costs with their intervals."""
    entries, emphasised = summarise(experiment, results), []
    for place, (_, key, best) in enumerate(_COLUMNS, start=1):
        medians = [entry[key]["median"] for entry in entries]
        known = [value for value in medians if value is not None]
        if known and len(set(medians)) > 1:
            found = best(known)
            emphasised += [(i, place) for i, v in enumerate(medians) if v == found]
    rows = [
        [entry["label"], *(_cell(key, entry) for _, key, _ in _COLUMNS)]
        for entry in entries
    ]
    headings = ["", *(heading for heading, _, _ in _COLUMNS)]
    return Table(headings, rows, best=emphasised)


def _cell(key: str, entry: dict[str, Any]) -> str:
    """The median, and below it the interval of a cost or how many runs got there."""
    found, seeds = entry[key], entry["seeds"]
    reached = found.get("reached", seeds)
    text = number(key, found["median"])
    if found["median"] is None and reached:
        text = "–"
    if key.endswith("cost") and found["low"] is not None:
        text += f"\n{number(key, found['low'])}–{number(key, found['high'])}"
    return f"{text}\n{reached} of {seeds}" if 0 < reached < seeds else text


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
