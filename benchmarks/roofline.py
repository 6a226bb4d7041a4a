"""How close each kernel is to the limits of the processor, and how its cost grows.

Operations and bytes of an ant-step are counted from the equations. The limits, arithmetic
and cache bandwidth of one core, are measured in the same run as the kernels. Writes two
figures and prints the table in docs/speed.md.

    python benchmarks/roofline.py --out docs/figures
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, ScalarFormatter
from numba import njit
from rich.console import Console
from rich.table import Table
from walks import Remembered, Trial

from acl_gym.colony import greedy, selection
from acl_gym.colony.pheromone import Pheromone
from acl_gym.colony.update_rules import EachVisit
from acl_gym.envs import navigation, pendulum
from acl_gym.partitions import Fuzzy
from acl_gym.partitions.kernels import written_out
from acl_gym.plotting.style import WIDTH, in_style
from acl_gym.utils.text import replace_unprintable_letters

ANTS = 2_000


@dataclass(frozen=True)
class Kernel:
    """A kernel and the work of one ant-step.

    Attributes:
        name: of the kernel.
        operations: additions, multiplications, divisions, roundings, comparisons.
        nbytes: bytes read and written, each array counted once.
        run: makes one call of `ants` ant-steps.
        ants: the ant-steps of one call.
    """

    name: str
    operations: float
    nbytes: float
    run: Callable[[], Any]
    ants: int = ANTS


@njit(cache=True)
def _multiply_add(x: Any) -> None:
    """Six multiplications and additions per entry, vectorised, in the first cache."""
    for i in range(x.size):
        y = x[i] * 0.999 + 0.1
        y = y * 0.998 + 0.2
        y = y * 0.997 + 0.3
        y = y * 0.996 + 0.4
        y = y * 0.995 + 0.5
        x[i] = y * 0.994 + 0.6


@njit(cache=True)
def _copy(x: Any, y: Any) -> None:
    for i in range(x.size):
        y[i] = x[i] * 1.5


def seconds(*runs: Callable[[], Any], rounds: int = 15) -> list[float]:
    """Median seconds per call of each function, in batches of about two milliseconds.

    Each round goes through all functions, so that a slow period of the machine affects
    all of them alike.
    """
    batches = []
    for run in runs:
        run()
        start = time.perf_counter()
        run()
        batches.append(max(1, int(2e-3 / max(time.perf_counter() - start, 1e-7))))
    results: list[list[float]] = [[] for _ in runs]
    for _ in range(rounds):
        for run, batch, times in zip(runs, batches, results, strict=True):
            start = time.perf_counter()
            for _ in range(batch):
                run()
            times.append((time.perf_counter() - start) / batch)
    return [statistics.median(times) for times in results]


def roofs() -> tuple[float, float]:
    """Operations and bytes per second of one core: arithmetic, and copying in cache."""
    x = np.random.default_rng(0).random(2_048)
    a, b = np.ones((2, 12_000))  # 192 kB together: fits the second-level cache
    arithmetic, copying = seconds(lambda: _multiply_add(x), lambda: _copy(a, b))
    return 12 * x.size / arithmetic, 16 * a.size / copying


class Ants:
    """Ants spread over a grid of some dimensions, and a table of pheromone."""

    def __init__(
        self, dimensions: int, n_actions: int, ants: int = ANTS, cells: int = 0
    ) -> None:
        rng = np.random.default_rng(0)
        per_axis = cells or {1: 1_600, 2: 40, 3: 12, 4: 6}[dimensions]
        centres = [np.linspace(-1.0, 1.0, per_axis)] * dimensions
        self.grid = Fuzzy(centres)
        self.states = rng.uniform(-1.0, 1.0, (ants, dimensions))
        self.all = np.arange(ants)
        self.index, self.degree = self.grid(self.states)
        self.table = Pheromone(self.grid.n_cells, n_actions, 1e-4, 3.0)
        self.table.set_levels(1e-4 + rng.random(self.table.levels.shape))
        self.draws = rng.random((2, ants))
        self.actions = rng.integers(0, n_actions, ants)
        self.columns, self.corners = (
            written_out(n_actions),
            written_out(self.index.shape[1]),
        )

    def locate(self) -> None:
        self.grid.locate(self.states, self.all, self.index, self.degree)

    def repair(self) -> None:
        self.table.stale[:] = True
        self.table.repair(self.index)

    def draw(self) -> None:
        selection._boltzmann(
            self.table.levels,
            3.0,
            None,
            self.table.probabilities,
            self.table.stale,
            self.index,
            self.degree,
            self.draws,
            0.1,
            greedy.ALL,
            self.columns,
            self.corners,
            self.actions,
        )

    def select(self) -> None:
        self.repair()
        self.draw()

    def decay(self) -> None:
        EachVisit().local_update(
            self.table, self.index, self.degree, self.actions, 0.01
        )


def kernels() -> list[Kernel]:
    """The kernels of a fuzzy learning step, with the work counted from the equations."""
    two, four = Ants(2, 3), Ants(4, 9)
    moving = pendulum.Pendulum()
    rng = np.random.default_rng(2)
    swings = moving.sample_states(rng, ANTS)
    vehicle = navigation.Navigation()
    drives = vehicle.sample_states(rng, ANTS)
    few, many = rng.integers(0, 3, ANTS), rng.integers(0, 9, ANTS)
    rewards, reached = np.empty(ANTS), np.empty(ANTS, dtype=np.bool_)
    trial, remembered = Trial(40), Remembered(250)
    # Operations of a sine: 13 (reduction) + 17 (series) + 4 (end); of an exponential:
    # 9 + 28 + 3.
    sine, exponential = 34, 40
    swing = 4 * (sine + 4) + 24 + 24
    drive = 2 * (4 * (2 * (exponential + 8) + 4) + 60) + 45
    return [
        Kernel("pendulum: move", swing, 8 * 6 + 1,
               lambda: moving.advance(swings, few, None, rewards, reached)),
        Kernel("navigation: move, 2 substeps", drive, 8 * 10 + 1,
               lambda: vehicle.advance(drives, many, None, rewards, reached)),
        Kernel("locate, 4 cells per state", 2 * 10 + 8, 8 * 3 + 12 * 4, two.locate),
        Kernel("locate, 16 cells per state", 4 * 10 + 34, 8 * 5 + 12 * 16, four.locate),
        Kernel("probabilities, 3 actions", 15, 12 * 4 + 2 * 24, two.repair),
        Kernel("draw, 4 cells x 3 actions", 2 * (2 * 4 + 2) + 3,
               12 * 4 + 4 * 16 + 24, two.draw),
        Kernel("draw, 16 cells x 9 actions", 8 * (2 * 16 + 2) + 3,
               12 * 16 + 16 * 64 + 24, four.draw),
        Kernel("decay, 4 cells", 4 * 5, 4 * (12 + 17) + 8, two.decay),
        Kernel("decay, 16 cells", 16 * 5, 16 * (12 + 17) + 8, four.decay),
        Kernel("deposit, 4 cells", 28 + 4 * 6, 17 * 3 + 4 * (12 + 3 * 16),
               trial.deposit, trial.n_steps),
        # V: 3 sums of 4 products, and the largest; Q: another sum; G: 5.
        Kernel("walk back, 4 cells x 3 actions", 3 * 8 + 3 + 8 + 5 + 4 * 8,
               4 * 12 + 9 + 4 * 24 + 4 * 2 * 24, remembered.walk_back,
               remembered.n_steps),
        Kernel("random numbers, 2 per ant", 2 * 8, 16, lambda: rng.random((2, ANTS))),
    ]  # fmt: skip


@dataclass(frozen=True)
class Result:
    """A measured kernel: nanoseconds per ant-step, and the lower bound on them."""

    kernel: Kernel
    ns: float
    bound_ns: float


def measure(arithmetic: float, bandwidth: float) -> list[Result]:
    """Measure every kernel; its bound is the time of its operations or its bytes."""
    results, all_kernels = [], kernels()
    times = seconds(*(kernel.run for kernel in all_kernels))
    for kernel, time_of_call in zip(all_kernels, times, strict=True):
        ns = time_of_call / kernel.ants * 1e9
        bound = max(kernel.operations / arithmetic, kernel.nbytes / bandwidth) * 1e9
        results.append(Result(kernel, ns, bound))
    return results


@in_style()
def draw_roofline(
    results: list[Result], arithmetic: float, bandwidth: float, path: Path
) -> None:
    """Draw operations per second over operations per byte, under the two limits."""
    figure = Figure(figsize=(6.4, 3.6))
    ax = figure.subplots()
    x = np.geomspace(0.05, 20, 200)
    ax.loglog(x, np.minimum(arithmetic, x * bandwidth) / 1e9, color="0.2", linewidth=1)
    ax.annotate(
        f"arithmetic: {arithmetic / 1e9:.0f} billion operations per second",
        (19, arithmetic / 1e9 * 1.12), ha="right",
    )  # fmt: skip
    ax.annotate(
        f"cache: {bandwidth / 1e9:.0f} GB/s", (0.06, 0.06 * bandwidth / 1e9),
        xytext=(-4, 8), textcoords="offset points", rotation=45, va="bottom",
        rotation_mode="anchor", transform_rotates_text=True,
    )  # fmt: skip
    colors = ("#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
    for number, result in enumerate(results):
        kernel = result.kernel
        intensity = kernel.operations / kernel.nbytes
        rate = kernel.operations / result.ns
        color = colors[number % len(colors)]
        ax.plot(intensity, rate, marker="o", markersize=5, color=color)
        # On the side away from its nearest neighbour.
        others = [r for r in results if r is not result]
        nearest = min(others, key=lambda r: _apart(r, result))
        left = nearest.kernel.operations / nearest.kernel.nbytes > intensity
        ax.annotate(
            str(number + 1), (intensity, rate), xytext=(-5 if left else 5, -3),
            ha="right" if left else "left", textcoords="offset points", color=color,
        )  # fmt: skip
    ax.set_yticks([1, 2, 5, 10, 20, 50])
    ax.set_ylim(1.0, 1.6 * arithmetic / 1e9)
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_formatter(ScalarFormatter())
        axis.set_minor_formatter(NullFormatter())
    names = [f"{n + 1}  {r.kernel.name}" for n, r in enumerate(results)]
    figure.text(1.01, 0.5, "\n".join(names), va="center",
                linespacing=1.7)  # fmt: skip
    ax.set_xlabel("operations per byte")
    ax.set_ylabel("billion operations per second")
    figure.savefig(path, dpi=200, bbox_inches="tight")


def _apart(one: Result, other: Result) -> float:
    """Distance of two points of the figure on its logarithmic axes."""
    ratios = (
        one.kernel.operations / one.kernel.nbytes * other.kernel.nbytes
        / other.kernel.operations,
        one.kernel.operations / one.ns * other.ns / other.kernel.operations,
    )  # fmt: skip
    return float(np.hypot(*np.log(ratios)))


@in_style()
def draw_scaling(path: Path) -> None:
    """Draw the cost over ants, actions, cells per state, and cells of the table."""
    figure = Figure(figsize=(WIDTH, 4.6))
    axes = figure.subplots(2, 2)
    colors = {"locate": "#0072B2", "select": "#D55E00", "decay": "#009E73"}

    def panel(ax: Any, unit: str, label: str, xs: Any, make: Any, scale: float) -> None:
        made = [make(x) for x in xs]
        runs = [getattr(ants, name) for name in colors for ants in made]
        times = np.reshape(seconds(*runs), (len(colors), len(xs))) * scale
        for (name, color), ys in zip(colors.items(), times, strict=True):
            ax.plot(xs, ys, marker=".", color=color, linewidth=1.2, label=name)
        ax.set_ylabel(unit)
        ax.set_xlabel(label)
        ax.set_ylim(bottom=0)
        ax.set_xlim(left=0)

    panel(axes[0, 0], "microseconds per step of all ants", "ants",
          [250, 1_000, 2_000, 4_000, 8_000], lambda n: Ants(2, 3, n), 1e6)  # fmt: skip
    panel(axes[0, 1], "ns per ant-step", "actions",
          [2, 4, 6, 8, 12, 16], lambda u: Ants(2, u), 1e9 / ANTS)  # fmt: skip
    panel(axes[1, 0], "ns per ant-step", "cells per state, 2$^d$", [2, 4, 8, 16],
          lambda k: Ants(k.bit_length() - 1, 3), 1e9 / ANTS)  # fmt: skip
    ax = axes[1, 1]
    cells = [20, 40, 100, 200, 400, 800]
    trials = [Trial(n, walked=20) for n in cells] + [Trial(n) for n in cells]
    times = seconds(*(trial.deposit for trial in trials))
    for ys, label, style in (
        (times[: len(cells)], "over the same 400 cells", "-"),
        (times[len(cells) :], "over all cells", ":"),
    ):
        ax.semilogx(
            [n * n for n in cells], np.array(ys) / trials[0].n_steps * 1e9, style,
            marker=".", color="#882255", linewidth=1.2, label=label,
        )  # fmt: skip
    ax.legend(title="ants walk")
    ax.set_ylim(bottom=0)
    ax.set_ylabel("deposit: ns per ant-step")
    ax.set_xlabel("cells of the table")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3)
    figure.savefig(path, dpi=200)


def main(arguments: list[str] | None = None) -> int:
    """Measure, draw and print; returns the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--out",
        default="docs/figures",
        help="folder of the figures  [default: %(default)s]",
    )
    options = parser.parse_args(arguments)
    out = Path(options.out)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        parser.error(f"--out {out} cannot be made: {error.strerror}")
    arithmetic, bandwidth = roofs()
    results = measure(arithmetic, bandwidth)
    table = Table(
        title=f"{arithmetic / 1e9:.1f} billion operations/s, {bandwidth / 1e9:.0f} GB/s"
    )
    for heading in ("kernel", "operations", "bytes", "ns", "bound, ns", "of bound"):
        table.add_column(heading, justify="left" if heading == "kernel" else "right")
    for number, result in enumerate(results, start=1):
        kernel = result.kernel
        table.add_row(
            f"{number} {kernel.name}",
            f"{kernel.operations:.0f}",
            f"{kernel.nbytes:.0f}",
            f"{result.ns:.1f}",
            f"{result.bound_ns:.1f}",
            f"{result.bound_ns / result.ns:.0%}",
        )
    Console(width=100).print(table)
    draw_roofline(results, arithmetic, bandwidth, out / "speed-roofline.png")
    draw_scaling(out / "speed-scaling.png")
    return 0


if __name__ == "__main__":
    replace_unprintable_letters()
    raise SystemExit(main())
