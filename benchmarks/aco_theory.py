"""Make the figure of docs/aco-theory.md, and print its numbers.

Colonies of the algorithm that §2.6 proves its theorems for search for the shortest tour
through six cities. What is proven stands beside what they do: the bound on the levels, the
limit of those of the optimum, how soon the optimum is found, and how soon after that its
levels exceed all others, in both readings of what happens to the other arcs.
"""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from acl_gym.plotting import style
from acl_gym.theory import (
    LimitedAnts,
    aco_level_limit,
    least_probability,
    probability_found,
    simulate_limited_ants,
    trials_to_dominate,
)
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray

OUT = Path(__file__).parent.parent / "docs" / "figures"

N_CITIES = 6
CITIES = np.random.default_rng(3).integers(1, 100, (N_CITIES, N_CITIES)).astype(float)
"""Distances of a problem with one shortest tour, 155, and none longer than 500."""

TAU_MIN = 1.0 / 600.0
"""Below the fitness of every tour, as Assumption 2.1 wants it."""

DECAYS = (0.02, 0.1, 0.5, 0.8)
SHOWN = 0.1
"""The rho of the figure."""

N_TRIALS = 600
WATCHED = 60
"""Trials after the optimum was found for which the figure follows the levels."""

READINGS = {"all": "all arcs evaporate", "tour": "other arcs remain the same"}


def watched(found: LimitedAnts, trials: int) -> tuple[FloatArray, FloatArray]:
    """Levels on the optimum, and the highest elsewhere, from the trial that found it.

    Of the colonies that had so many trials left, `(n_colonies, trials + 1)` each.
    """
    first = found.first_optimum
    some = np.flatnonzero((first > 0) & (first + trials < len(found.highest)))
    rows = first[some][:, None] + np.arange(trials + 1)
    return found.on_optimum[rows, some[:, None]], found.elsewhere[rows, some[:, None]]


def trials_until(on_optimum: FloatArray, elsewhere: FloatArray) -> FloatArray:
    """Trials until levels on the optimum exceed the others for good; infinite if never."""
    behind = on_optimum <= elsewhere
    steps = np.arange(behind.shape[1])
    last = np.where(behind, steps, -1).max(axis=1)
    return np.where(behind[:, -1], math.inf, last + 1.0)


def measure(n_colonies: int, seed: int) -> list[dict[str, Any]]:
    """What Propositions 2.2 and 2.3 and Theorem 2.5 say, and what colonies do."""
    rows = []
    for rho in DECAYS:
        allowed = int(trials_to_dominate(rho))
        bound = float(aco_level_limit(1.0, rho))
        for evaporation in READINGS:
            for start in ("tau_min", "tau_max"):
                tau_max = bound / shortest()
                found = simulate_limited_ants(
                    CITIES, n_colonies, N_TRIALS,
                    global_decay=rho, tau_min=TAU_MIN, evaporation=evaporation,
                    tau0=None if start == "tau_min" else tau_max, seed=seed,
                )  # fmt: skip
                levels = watched(found, 4 * allowed + 20)
                until = trials_until(*levels)
                rows.append(
                    {
                        "rho": rho,
                        "evaporation": evaporation,
                        "tau0": start,
                        "highest_level": float(found.highest.max() / tau_max),
                        "optimum_at_the_end": float(levels[0][:, -1].mean() / tau_max),
                        "k0": allowed,
                        "colonies": len(until),
                        "trials_median": float(np.median(until)),
                        "trials_most": float(until.max()),
                        "later_than_k0": float((until > allowed).mean()),
                    }
                )
    return rows


def shortest() -> float:
    """The length of the shortest tour."""
    return 1.0 / simulate_limited_ants(CITIES, 1, 1, tau_min=TAU_MIN, seed=0).fitness


def draw_levels(ax: Axes, found: LimitedAnts, reading: str) -> None:
    """Levels after the optimum has been found, and when they should have crossed."""
    tau_max = float(aco_level_limit(found.fitness, SHOWN))
    trials = np.arange(WATCHED + 1)
    names = ("on the optimum, lowest", "elsewhere, highest")
    colours = (style.ORANGE, style.BLUE)
    for levels, name, colour in zip(
        watched(found, WATCHED), names, colours, strict=True
    ):
        line = {"color": colour, "label": name}
        style.draw_band(ax, trials, levels / tau_max, line)
    ax.axhline(1.0, **style.BOUND)
    ax.text(WATCHED, 1.02, r"$\tau_{\max}$", ha="right", va="bottom", fontsize=7.5)
    allowed = float(trials_to_dominate(SHOWN))
    ax.axvline(allowed, **{**style.BOUND, "linestyle": ":"})
    ax.text(allowed + 1, 0.03, f"k₀ = {allowed:.0f}", fontsize=7.5)
    ax.set(xlim=(0, WATCHED), ylim=(0.0, 1.12))
    ax.set_xlabel("trials since the optimum was found")
    ax.set_title(READINGS[reading])


def draw_found(ax: Axes, n_colonies: int, seed: int) -> None:
    """The share of colonies that have found the optimum, and its bound."""
    n_trials = 2_000
    trials = np.unique(np.geomspace(1, 1e16, 400).round())
    for cities, colour in ((CITIES, style.ORANGE), (CITIES[:4, :4], style.BLUE)):
        n = len(cities)
        found = simulate_limited_ants(
            cities, n_colonies, n_trials,
            global_decay=0.5, tau_min=TAU_MIN, seed=seed,
        )  # fmt: skip
        first = np.where(found.first_optimum > 0, found.first_optimum, math.inf)
        after = trials[trials <= n_trials]
        share = (first[:, None] <= after).mean(axis=0)
        ax.plot(after, share, color=colour, label=f"{n} cities")
        tau_max = float(aco_level_limit(found.fitness, 0.5))
        least = float(least_probability(TAU_MIN, tau_max, n - 1, 1.0))
        bound = probability_found(least, n, trials)
        ax.plot(trials, bound, color=colour, linestyle="--", label="its bound")
    ax.set_xscale("log")
    ax.set(xlim=(1, 1e16), ylim=(0.0, 1.05), xlabel="trials")
    ax.set_ylabel("share that has found the optimum")
    ax.set_title("how soon the optimum is found")
    ax.legend(loc="center right", handlelength=1.6)


def draw(n_colonies: int, seed: int, path: Path) -> None:
    """Draw the three panels."""
    with style.in_style():
        figure = style.new_figure(2.9, 9.0)
        axes = figure.subplots(1, 3)
        for ax, reading in zip(axes, READINGS, strict=False):
            found = simulate_limited_ants(
                CITIES, n_colonies, N_TRIALS,
                global_decay=SHOWN, tau_min=TAU_MIN, evaporation=reading, seed=seed,
            )  # fmt: skip
            draw_levels(ax, found, reading)
        axes[0].set_ylabel(r"level / $\tau_{\max}$")
        axes[0].legend(loc="center right")
        draw_found(axes[2], n_colonies, seed)
        figure.savefig(path, dpi=200)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--colonies", type=int, default=2_000, help="of each kind")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=OUT, help="a folder")
    parser.add_argument("--json", action="store_true", help="print JSON, draw nothing")
    options = parser.parse_args()
    try:
        validation.integer("--colonies", options.colonies, at_least=1)
        validation.seed(options.seed)
    except ValueError as error:
        parser.error(str(error))
    rows = measure(options.colonies, options.seed)
    if options.json:
        # JSON has no infinity: trials of colonies in which it never happens are null.
        finite = [
            {name: None if value == math.inf else value for name, value in row.items()}
            for row in rows
        ]
        print(json.dumps({"colonies": options.colonies, "rows": finite}))
        return
    for row in rows:
        print(", ".join(f"{name} {value}" for name, value in row.items()))
    options.out.mkdir(parents=True, exist_ok=True)
    draw(options.colonies, options.seed, options.out / "aco_theory.png")


if __name__ == "__main__":
    main()
