"""Make the figure of docs/particle-swarms.md, and print its numbers.

- The order of (6.1) as printed explodes, on Sphere in 30 variables without bounds.
- Which inertia and acceleration are stable: means, variances, and the printed order.
- The standard deviation of a particle whose bests stand still: exact, and simulated.
- Which topology, and which boundary, finds what: median values after some evaluations,
  on five functions.
"""

from __future__ import annotations

import argparse
import itertools
import json
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from tqdm import tqdm

from acl_gym.plotting import style
from acl_gym.swarm import Delayed, Everyone, Lossy, Radius, minimize
from acl_gym.swarm.channel import Channel
from acl_gym.swarm.pso import (
    constriction_coefficients,
    kernels,
    largest_acceleration,
    position_moments,
)
from acl_gym.swarm.pso.benchmark_functions import (
    BENCHMARK_FUNCTIONS,
    BenchmarkFunction,
)
from acl_gym.swarm.pso.bounds import BOUNDARIES
from acl_gym.utils import validation

OUT = Path(__file__).parent.parent / "docs" / "figures"
VARIABLES = 30
INERTIA, ACCELERATION = constriction_coefficients()

ORDERS = {
    "standard": {"order": "standard"},
    "as printed": {"order": "literal"},
    "as printed, c1 = c2 = 0.2": {"order": "literal", "cognitive": 0.2, "social": 0.2},
}
ITERATIONS = 1_000

FROZEN = {"personal_best": 1.0, "local_best": -1.0, "position": 3.0}
CASES = ((INERTIA, ACCELERATION), (0.9, ACCELERATION), (0.9, 0.8))
"""Inertia and c1 = c2: stable; only the means are; stable again."""
STEPS = 30
SIMULATED = 200_000
"""Particles, each for itself."""

MARKS = (12_000, 120_000)
"""Evaluations after which topologies are compared."""

COLOURS = {
    "global": style.ORANGE,
    "ring": style.BLUE,
    "von_neumann": style.GREEN,
    "radius": style.BLACK,
}


def topology(name: str, problem: BenchmarkFunction) -> str | Channel:
    """A topology by its name here; some depend on the range of the variables."""
    special = {
        "radius": Radius(2.0 * problem.largest),  # the width of the range
        "global, 30% lost": Lossy(Everyone(), 0.3),
        "global, 10 steps late": Delayed(Everyone(), 10),
    }
    return special.get(name, name)


TOPOLOGIES = (*COLOURS, "global, 30% lost", "global, 10 steps late")


def explosion(seeds: int) -> dict[str, Any]:
    """The spread of swarms, iteration by iteration, `(seeds, ITERATIONS + 1)` each.

    Infinite from where a search has ended because its swarm has exploded.
    """
    sphere = BENCHMARK_FUNCTIONS["sphere"]
    found = {}
    for name, settings in ORDERS.items():
        found[name] = np.full((seeds, ITERATIONS + 1), np.inf)
        for seed in range(seeds):
            spread = minimize(
                sphere.function,
                sphere.bounds(VARIABLES),
                max_iterations=ITERATIONS,
                seed=seed,
                topology="global",
                boundary="none",
                history=True,
                **settings,
            ).history["spread"]
            found[name][seed, : spread.size] = spread
    return found


def deviations(inertia: float, acceleration: float, seed: int) -> Any:
    """The standard deviation over simulated particles, `(STEPS + 1,)`."""
    rng = np.random.default_rng(seed)
    n = SIMULATED
    x = np.tile([FROZEN["position"], 0.0], (n, 1))
    personal = np.full((n, 1), FROZEN["personal_best"])
    local = np.full((1, 1), FROZEN["local_best"])
    first, c, free = np.zeros(n, np.int64), np.full(n, acceleration), np.array([np.inf])
    u = np.empty((n, 1))
    found = [0.0]
    for _ in range(STEPS):
        position = x[:, :1].copy()
        kernels.attract(
            position, personal, first, local, c, c, rng.random((n, 2, 1)), u
        )
        kernels.move(x, u, np.full(n, inertia), -free, free, kernels.NONE, free, False)
        found.append(float(x[:, 0].std()))
    return np.array(found)


def topologies(seeds: int) -> list[dict[str, Any]]:
    """Best values over the evaluations, for each function and topology."""
    rows = []
    cases = list(itertools.product(BENCHMARK_FUNCTIONS, TOPOLOGIES))
    for function, name in tqdm(cases, disable=None):
        problem = BENCHMARK_FUNCTIONS[function]
        runs = [
            minimize(
                problem.function,
                problem.bounds(VARIABLES),
                max_evaluations=MARKS[-1],
                seed=seed,
                topology=topology(name, problem),
                history=True,
            ).history
            for seed in range(seeds)
        ]
        values = np.array([run["fun"] for run in runs])
        at = [int(np.searchsorted(runs[0]["nfev"], mark)) for mark in MARKS]
        rows.append(
            {
                "function": function,
                "topology": name,
                "nfev": runs[0]["nfev"],
                "values": values,
                "stuck": float((values[:, -1] > 0.01).mean()),
                "medians": [float(np.median(values[:, each])) for each in at],
            }
        )
    return rows


def boundaries(seeds: int) -> list[dict[str, Any]]:
    """Best values of global swarms, for each function and kind of boundary."""
    rows = []
    cases = list(itertools.product(BENCHMARK_FUNCTIONS, BOUNDARIES))
    for function, boundary in tqdm(cases, disable=None):
        problem = BENCHMARK_FUNCTIONS[function]
        values = [
            minimize(
                problem.function,
                problem.bounds(VARIABLES),
                max_evaluations=60_000,
                seed=seed,
                topology="global",
                boundary=boundary,
            ).fun
            for seed in range(seeds)
        ]
        rows.append(
            {
                "function": function,
                "boundary": boundary,
                "median": float(np.median(values)),
                "worst": max(values),
            }
        )
    return rows


def table(title: str, key: str, rows: list[dict[str, Any]]) -> None:
    """Print values by function and one thing more, as Markdown."""
    names = list(dict.fromkeys(row[key] for row in rows))
    print(f"\n{title}\n\n| function | {' | '.join(names)} |")
    print(f"| --- |{' ---: |' * len(names)}")
    for function in BENCHMARK_FUNCTIONS:
        cells = [f"{r['value']:.2g}" for r in rows if r["function"] == function]
        print(f"| {function.capitalize()} | {' | '.join(cells)} |")


def draw(
    spreads: dict[str, Any], rows: list[dict[str, Any]], seed: int, path: Path
) -> None:
    """Draw the four panels."""
    with style.in_style():
        figure = style.new_figure(5.9, 7.6)
        axes = figure.subplots(2, 2)
        _draw_explosion(axes[0, 0], spreads)
        _draw_region(axes[0, 1])
        _draw_deviations(axes[1, 0], seed)
        _draw_topologies(axes[1, 1], rows)
        figure.savefig(path, dpi=200)


def _draw_explosion(ax: Axes, spreads: dict[str, Any]) -> None:
    colours = (style.BLUE, style.ORANGE, style.GREEN)
    for (name, each), colour in zip(spreads.items(), colours, strict=True):
        ax.plot(each.T, color=colour, alpha=0.25, linewidth=0.6)
        ax.plot(np.median(each, axis=0), color=colour)
        label = name.replace("c1 = c2", "$c_1 = c_2$")
        x, y = {"standard": (980, 1e10), "as printed": (640, 1e130)}.get(
            name, (980, 1e24)
        )
        ax.text(x, y, label, color=colour, ha="right")
    ax.set_yscale("log")
    ax.set(xlabel="iteration", ylabel="spread of the swarm", xlim=(0, ITERATIONS))
    ax.set(ylim=(1e-30, 1e200), yticks=[1e0, 1e50, 1e100, 1e150, 1e200])
    ax.set_title("Sphere: the order of (6.1) as printed explodes")


def _draw_region(ax: Axes) -> None:
    inertias = np.linspace(-0.999, 0.999, 301)
    for moment, order, colour, line, label in (
        (1, "standard", style.BLUE, "--", "means converge"),
        (2, "standard", style.BLUE, "-", "variances as well"),
        (1, "literal", style.ORANGE, "--", "as printed: means"),
        (2, "literal", style.ORANGE, "-", "as printed: variances"),
    ):
        bound = [largest_acceleration(w, moment=moment, order=order) for w in inertias]
        ax.plot(inertias, bound, line, color=colour, label=label)
        if moment == 2:
            ax.fill_between(inertias, bound, color=colour, alpha=0.15, linewidth=0)
    ax.plot(INERTIA, 2 * ACCELERATION, "o", color="black", zorder=3)
    ax.annotate(
        "usual coefficients",
        (INERTIA, 2 * ACCELERATION),
        (0.97, 4.6),
        ha="right",
        arrowprops={"arrowstyle": "-", "linewidth": 0.7},
    )
    ax.set(xlabel="inertia $w$", ylabel="$c_1 + c_2$", xlim=(-1, 1), ylim=(0, 8))
    ax.legend(loc="upper left")
    ax.set_title("stable below the line, for $c_1 = c_2$")


def _draw_deviations(ax: Axes, seed: int) -> None:
    looks = ((style.BLUE, 1.6), (style.ORANGE, 6.0), (style.GREEN, 2.8))
    for (w, c), (colour, place) in zip(CASES, looks, strict=True):
        exact = np.sqrt(position_moments(w, c, c, steps=STEPS, **FROZEN).variance)
        found = deviations(w, c, seed)
        steps = np.arange(STEPS + 1)
        ax.plot(steps[1:], exact[1:], color=colour)
        ax.plot(steps[1::2], found[1::2], ".", color=colour)
        label = f"$w$ = {w:.2f}, $c_1 = c_2$ = {c:.2f}"
        ax.text(STEPS, place, label, color=colour, ha="right")
    ax.set_yscale("log")
    ax.set(xlabel="iteration", xlim=(0, STEPS), ylim=(0.9, 20.0))
    ax.set(ylabel="standard deviation of the position")
    style.plain_log(ax.yaxis)
    ax.set_title("bests stand still: lines exact, dots simulated")


def _draw_topologies(ax: Axes, rows: list[dict[str, Any]]) -> None:
    for row in rows:
        if row["function"] == "ackley" and row["topology"] in COLOURS:
            colour = COLOURS[row["topology"]]
            low, middle, high = np.quantile(row["values"], (0.25, 0.5, 0.75), axis=0)
            ax.fill_between(
                row["nfev"], low, high, color=colour, alpha=0.15, linewidth=0
            )
            label = row["topology"].replace("_n", " N")
            ax.plot(row["nfev"], middle, color=colour, label=label)
    ax.set_yscale("log")
    ax.set(xlabel="evaluations", ylabel="best value", xlim=(0, MARKS[-1]))
    ax.xaxis.set_major_formatter(lambda value, _: f"{value:,.0f}")
    ax.legend(loc="lower left")
    ax.set_title("Ackley: who hears whom (medians, quartiles)")


def main() -> None:
    """Measure, print and draw."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=10, help="runs of each (10)")
    parser.add_argument("--out", type=Path, default=OUT, help="a folder")
    parser.add_argument("--json", action="store_true", help="print JSON, draw nothing")
    options = parser.parse_args()
    try:
        validation.integer("--seeds", options.seeds, at_least=1)
    except ValueError as error:
        parser.error(str(error))

    spreads = explosion(options.seeds)
    last = {name: float(np.median(each[:, -1])) for name, each in spreads.items()}
    bounds = [
        {
            "moment": moment,
            "order": order,
            "bound": largest_acceleration(INERTIA, moment=moment, order=order),
        }
        for moment, order in itertools.product((1, 2), ("standard", "literal"))
    ]
    rows = topologies(options.seeds)
    walls = boundaries(2 * options.seeds)
    if options.json:
        medians = [
            {key: row[key] for key in ("function", "topology", "medians", "stuck")}
            for row in rows
        ]
        found = {"spread": last, "largest_acceleration": bounds, "topologies": medians}
        print(json.dumps({**found, "boundaries": walls}))
        return
    print(f"spread after {ITERATIONS:,} iterations, median")
    for name, value in last.items():
        print(f"  {name}: {value:.2g}")
    print(f"largest c1 + c2 at w = {INERTIA:.4f}")
    for each in bounds:
        print(f"  moment {each['moment']}, {each['order']}: {each['bound']:.4f}")
    for place, mark in enumerate(MARKS):
        title = f"Median of the best value after {mark:,} evaluations"
        placed = [{**row, "value": row["medians"][place]} for row in rows]
        table(title, "topology", placed)
    for row in rows:
        if row["function"] == "ackley":
            print(f"Ackley, {row['topology']}: {row['stuck']:.0%} end above 0.01")
    for measure in ("median", "worst"):
        title = f"Boundaries: {measure} of {2 * options.seeds} runs"
        placed = [{**row, "value": row[measure]} for row in walls]
        table(title, "boundary", placed)
    options.out.mkdir(parents=True, exist_ok=True)
    draw(spreads, rows, 0, options.out / "particle_swarms.png")


if __name__ == "__main__":
    main()
