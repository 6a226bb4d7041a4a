"""The report of a comparison: one HTML file, and a table for the terminal."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

from jinja2 import Environment, PackageLoader, StrictUndefined
from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from acl_gym.experiments import captions, intervals, statistics, wording
from acl_gym.utils.files import write_atomically

Comparison = dict[str, Any]


class Column(NamedTuple):
    """A column of the summary table.

    Attributes:
        group: heading over several columns.
        title: heading of this one.
        key: of the estimate in an entry of the summary.
        best: which of the medians is emphasised.
    """

    group: str
    title: str
    key: str
    best: Literal["lowest", "highest", "none"] = "lowest"


class Cell(NamedTuple):
    """A cell of the summary table.

    Attributes:
        text: the median.
        interval: from .. to, or nothing.
        note: how many seeds, where not all of them have a value.
        is_best: whether the median is the best of its column.
    """

    text: str
    interval: str
    note: str
    is_best: bool


COLUMNS = (
    *(
        column
        for name in ("final", "best")
        for group in ("Last policy" if name == "final" else "Best policy",)
        for column in (
            Column(group, "cost", f"{name}_policy_cost"),
            Column(group, "above J*", f"{name}_gap_percent"),
            Column(group, "goal", f"{name}_success_rate", "highest"),
        )
    ),
    *(
        Column(f"Within {mark}% of J*", title, f"{x}_to_{mark}")
        for mark in statistics.MARKS
        for x, title in (("env_steps", "steps"), ("seconds", "time, s"))
    ),
    Column("Whole training", "steps", "env_steps", "none"),
    Column("Whole training", "time, s", "seconds", "none"),
)


def write_report(
    comparison: Comparison,
    summary: Sequence[statistics.Entry],
    findings: Sequence[str],
    figures: Mapping[str, Path],
    path: Path,
) -> None:
    """Write one HTML file that holds everything and loads nothing.

    Args:
        comparison: what was run.
        summary: of `statistics.summarise`.
        findings: of `statistics.findings`.
        figures: the PNG of each figure, in the order in which to show them.
        path: where the report goes; it appears whole or not at all.
    """
    environment = Environment(
        loader=PackageLoader("acl_gym.experiments"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    symbol = wording.symbol(comparison["reference"])
    columns = [
        column._replace(
            group=_without_symbol(column.group, symbol),
            title=_without_symbol(column.title, symbol),
        )
        for column in COLUMNS
    ]
    groups = [column.group for column in columns]
    text = environment.get_template("report.html.j2").render(
        comparison=comparison,
        reference=comparison["reference"],
        symbol=symbol,
        explanation=captions.reference(comparison["reference"]),
        findings=findings,
        groups={group: groups.count(group) for group in groups},
        columns=columns,
        starts=[i for i in range(len(groups)) if groups[i - 1] != groups[i]],
        rows=table_rows(summary),
        seeds=_seeds(summary),
        marks=statistics.MARKS,
        few_seeds=intervals.FEW_VALUES,
        figures=[
            {
                "name": name,
                "data": base64.b64encode(file.read_bytes()).decode("ascii"),
                "alt": captions.alternative(name, comparison, summary),
                "caption": captions.caption(name, comparison),
            }
            for name, file in figures.items()
        ],
        settings=_settings(comparison["runs"]),
    )
    write_atomically(path, text.encode())


def _without_symbol(heading: str, symbol: str) -> str:
    """A heading as it is where J* is known; else without what has only a long name."""
    if symbol == "J*":
        return heading
    return heading.removesuffix(" J*").removesuffix(" of")


def print_summary(
    summary: Sequence[statistics.Entry], reference: dict[str, Any], console: Console
) -> None:
    """Print the summary as a table of at most 100 columns.

    Args:
        summary: of `statistics.summarise`.
        reference: with `optimal_cost` or `best_known_cost`.
        console: where to print.
    """
    symbol = wording.symbol(reference)
    cost = wording.cost(wording.reference_cost(reference))
    table = Table(
        title=f"Medians over seeds; {symbol} = {cost}",
        box=box.SIMPLE_HEAD,
        show_edge=False,
        padding=0,
    )
    table.add_column("", no_wrap=True)
    shown = [i for i, column in enumerate(COLUMNS) if column.best != "none"]
    for column in (COLUMNS[i] for i in shown):
        which = column.group.removeprefix("Within ").split()[0].lower()
        title = column.title.replace(", ", " ").removesuffix(" J*")
        table.add_column(f"{which}\n{title}", justify="right", no_wrap=True)
    for label, cells in table_rows(summary):
        texts = []
        for i in shown:
            text = Text(cells[i].text, style="bold" if cells[i].is_best else "")
            # Only a cost has room for its interval.
            second = cells[i].note
            if COLUMNS[i].title == "cost":
                second = cells[i].interval
            texts.append(text.append(f"\n{second}", style="dim") if second else text)
        table.add_row(Text(label), *texts)
    console.print(table)
    console.print(
        "last, best: cost of the policy with its 95% interval, percent above "
        f"{wording.the_reference(reference)}, and share of the starts from which it "
        "reaches the goal. 25%, 10%: training until within so much of it; under it, "
        "in how many of the seeds.",
        style="dim",
        highlight=False,
    )


def table_rows(
    summary: Sequence[statistics.Entry],
) -> list[tuple[str, list[Cell]]]:
    """Label and cells, one for each of `COLUMNS`, of every agent."""
    columns = [_cells(summary, column) for column in COLUMNS]
    cells = zip(*columns, strict=True)
    return [
        (str(entry["label"]), list(row))
        for entry, row in zip(summary, cells, strict=True)
    ]


def _cells(summary: Sequence[statistics.Entry], column: Column) -> list[Cell]:
    estimates = [entry[column.key] for entry in summary]
    medians = [each["median"] for each in estimates if each["median"] is not None]
    # Where all are alike, none is emphasised.
    differ = len({each["median"] for each in estimates}) > 1
    best = None
    if medians and differ and column.best != "none":
        best = min(medians) if column.best == "lowest" else max(medians)
    cells = []
    for entry, each in zip(summary, estimates, strict=True):
        reached = each.get("reached", entry["seeds"])
        text = _number(column, each["median"])
        if each["median"] is None and reached:
            text = "–"
        interval = ""
        if each["low"] is not None:
            ends = (_number(column, each[end]) for end in ("low", "high"))
            interval = "–".join(end.strip("+%") for end in ends)
        note = f"{reached} of {entry['seeds']}" if 0 < reached < entry["seeds"] else ""
        is_best = best is not None and each["median"] == best
        cells.append(Cell(text, interval, note, is_best))
    return cells


def _number(column: Column, value: float | None) -> str:
    if column.key.startswith("env_steps"):
        return wording.steps(value, short=True)
    if column.key.startswith("seconds"):
        return wording.seconds(value)
    if value is None or column.title == "cost":
        return wording.cost(value)
    if column.title == "goal":
        return wording.share(value)
    text = f"{value:+.0f}%" if abs(value) >= 99.5 else f"{value:+.1f}%"
    return text.replace("-", "−")


def _seeds(summary: Sequence[statistics.Entry]) -> str:
    counts = sorted({int(entry["seeds"]) for entry in summary})
    if counts in ([], [1]):
        return "1 seed"
    return f"{' to '.join(map(str, {counts[0]: 0, counts[-1]: 0}))} seeds"


def _settings(runs: Sequence[statistics.Run]) -> list[dict[str, Any]]:
    """Tables of parameters, agents that have the same ones side by side."""
    tables: dict[tuple[str, ...], dict[str, Any]] = {}
    for own in statistics.by_agent(runs).values():
        names = tuple(own[0]["parameters"])
        table = tables.setdefault(
            names, {"labels": [], "rows": {name: [] for name in names}}
        )
        table["labels"].append(own[0]["label"])
        for name in names:
            values = (_setting(run["parameters"].get(name)) for run in own)
            table["rows"][name].append(", ".join(dict.fromkeys(values)))
    return list(tables.values())


def _setting(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, int) and not isinstance(value, bool):
        return f"{value:,}"
    if isinstance(value, list | tuple):
        return " × ".join(map(_setting, value))
    return str(value)
