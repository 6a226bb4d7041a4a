"""What `acl-gym design` shows: progress, and a table of figures."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from acl_gym.cli.common import console
from acl_gym.cli.errors import report
from acl_gym.cli.model_words import model_in_words

if TYPE_CHECKING:
    from acl_gym.design import Design
    from acl_gym.design.learning import Progress

PROGRESS_SECONDS = 5.0
"""Between two lines of progress where there is no terminal."""


@contextmanager
def progress(wanted: bool) -> Iterator[Callable[[Progress], None]]:
    """A function that shows progress on stderr: in place on a terminal, else in lines.

    Args:
        wanted: whether it shows anything.
    """
    if not wanted:
        yield lambda found: None
        return
    if sys.stderr.isatty():
        with console(stderr=True).status("learning") as status:
            yield lambda found: status.update(_in_words(found))
        return
    last = time.monotonic()

    def tell(found: Progress) -> None:
        nonlocal last
        if time.monotonic() - last >= PROGRESS_SECONDS:
            last = time.monotonic()
            report("acl-gym", _in_words(found))

    yield tell


def _in_words(found: Progress) -> str:
    now, best = found.now, found.best
    return (
        f"learning, {found.seconds:.0f} s, {found.interactions:,} interactions: "
        f"goal reached from {now.success_rate:.0%} of the starts, cost {now.cost:.4g}; "
        f"best {best.success_rate:.0%}, {best.cost:.4g}"
    )


def print_design(made: Design) -> None:
    """The figures as a table, and where the files are."""
    from rich.table import Table

    measures = made.measures
    table = Table(box=None, pad_edge=False, header_style="bold")
    for head in ("", "median", "mean", "95% below", "worst"):
        table.add_column(head, justify="right" if head else "left")
    named = {
        "cost": measures.cost,
        "time to the goal, s": measures.time_to_goal,
        "settling time, s": measures.settling_time,
        **{f"overshoot of {n}": each for n, each in measures.overshoot.items()},
    }
    for name, spread in named.items():
        if spread is not None:
            values = spread.median, spread.mean, spread.high, spread.worst
            table.add_row(name, *(f"{value:.4g}" for value in values))
    screen = console()
    lines = [
        f"The goal is reached from {measures.success_rate:.1%} of {measures.starts:,} "
        f"random starts; from {measures.settled_rate:.1%} the state then stays inside it.",
        f"{made.learned.ants} ants learned from {made.learned.interactions:,} interactions "
        f"in {made.learned.seconds:.1f} s; {made.summary['seconds']:.1f} s in all.",
    ]
    for line in lines:
        screen.print(line, markup=False, highlight=False, soft_wrap=True)
    screen.print(table)
    lines = []
    if made.limits.touched_rate > 0.0:
        lines.append(made.limits.in_words())
    if made.succeeded:  # otherwise the error says what to try
        lines += [f"What to try: {tip}" for tip in made.advice]
    model = made.summary["model"]
    if model is not None:
        spread = model["spread"]
        lines += model_in_words(
            model["regressor"],
            model["steps"],
            model["errors"],
            median=spread["median"],
            highest=spread["worst"],
            limit=spread["limit"],
            unsure=spread["unsure"],
        )
    lines.append(
        f"Wrote {made.folder / 'report.html'}, and the controller, "
        f"{made.folder / 'policy.h'}."
    )
    for line in lines:
        screen.print(line, markup=False, highlight=False, soft_wrap=True)
