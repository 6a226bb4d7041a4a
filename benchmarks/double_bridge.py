"""Make the figure of docs/double-bridge.md, and print its numbers.

Colonies of real ants cross a double bridge by the choice model of Deneubourg et al. (1990),
eq. (2.1): branches of equal length, of which either may win; of unequal length, where the
short one wins most often; and a short branch that is opened late, which nobody takes.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.ticker import NullFormatter

from acl_gym.plotting import (
    plot_branch_choice,
    plot_crossing_law,
    plot_crossings,
    style,
)
from acl_gym.theory import (
    crossing_law,
    linear_crossing_law,
    majority_probability,
    simulate_crossings,
)
from acl_gym.utils import validation

OUT = Path(__file__).parent.parent / "docs" / "figures"

ANTS = (200, 500, 1_000, 2_000, 5_000)
EXPONENTS = (1.0, 1.5, 2.0, 3.0)

RATIOS = (1.0, 1.4, 2.0)
SHORT = 20.0
"""Seconds to cross the short branch."""

FIRST, ALL = 1_000, 2_000
"""What a colony has chosen is judged by the ants between these."""

LATE = 300.0
"""Seconds after which the short branch is opened late: 300 ants have chosen by then."""

MOST = 0.8
"""A colony has chosen the branch that holds more of its ants."""


def equal_branches(n_colonies: int, seed: int) -> list[dict[str, Any]]:
    """How often one branch holds more than 80% of the crossings, exactly and not."""
    rows = []
    for alpha in EXPONENTS:
        for ants in ANTS:
            exact = majority_probability(crossing_law(ants, alpha))
            found = simulate_crossings(ants, n_colonies, alpha=alpha, seed=seed)
            share = float((np.maximum(found, ants - found) > MOST * ants).mean())
            rows.append(
                {"alpha": alpha, "ants": ants, "exact": exact, "simulated": share}
            )
    return rows


def late_shares(ratio: float, n_colonies: int, seed: int, **more: Any) -> Any:
    """The share of the later ants that take the short branch, for each colony."""
    opened = round(2 * 0.5 * more.get("opens_after", 0.0))  # ants before it opens
    record = [opened + FIRST, opened + ALL]
    times = (SHORT, SHORT * ratio)
    before, after = simulate_crossings(
        record[1], n_colonies, crossing_times=times, record=record, seed=seed, **more
    ).T
    return (after - before) / (ALL - FIRST)


def unequal_branches(n_colonies: int, seed: int) -> dict[str, Any]:
    """The shares of each experiment on branches of unequal length."""
    experiments: dict[str, Any] = {
        f"long / short = {ratio:g}": late_shares(ratio, n_colonies, seed)
        for ratio in RATIOS
    }
    late = late_shares(2.0, n_colonies, seed, opens_after=LATE)
    return {**experiments, "2, short branch late": late}


def draw(
    equal: list[dict[str, Any]],
    experiments: dict[str, Any],
    n_colonies: int,
    seed: int,
    path: Path,
) -> None:
    """Draw the four panels."""
    with style.in_style():
        figure = style.new_figure(5.6, 7.6)
        axes = figure.subplots(2, 2)
        record = np.unique(np.geomspace(10, 5_000, 200).astype(int))
        few = simulate_crossings(5_000, 24, record=record, seed=seed)
        plot_crossings(few, record, axes[0, 0])
        axes[0, 0].set_title("equal branches: 24 colonies, and one branch wins")

        ants = 1_000
        laws = {f"α = {alpha:g}": crossing_law(ants, alpha) for alpha in EXPONENTS}
        found = {
            f"α = {alpha:g}": simulate_crossings(
                ants, n_colonies, alpha=alpha, seed=seed
            )
            for alpha in EXPONENTS
        }
        plot_crossing_law(laws, axes[0, 1], simulated=found)
        axes[0, 1].set_ylim(0.0, 6.0)
        axes[0, 1].legend(loc="upper left", bbox_to_anchor=(0.06, 1.0))
        axes[0, 1].set_title("after 1,000 ants: exact law, dots simulated")

        plot_branch_choice(experiments, axes[1, 0])
        axes[1, 0].set_title("unequal branches: who finds the short one")

        ax = axes[1, 1]
        counts = np.unique(np.geomspace(100, 5_000, 20).astype(int))
        for alpha, line in zip(EXPONENTS, axes[0, 1].lines[::2], strict=True):
            law = linear_crossing_law if alpha == 1.0 else crossing_law
            more = () if alpha == 1.0 else (alpha,)
            exact = [majority_probability(law(int(n), *more)) for n in counts]
            colour = line.get_color()
            ax.plot(counts, exact, color=colour)
            dots = [row["simulated"] for row in equal if row["alpha"] == alpha]
            ax.plot(ANTS, dots, ".", color=colour, clip_on=False)
        ax.set_xscale("log")
        ax.set_xticks(ANTS)
        ax.xaxis.set_minor_formatter(NullFormatter())
        ax.xaxis.set_major_formatter(lambda value, _: f"{value:,.0f}")
        ax.set(xlabel="ants that have crossed", ylim=(0.0, 1.0))
        ax.yaxis.set_major_formatter(lambda value, _: f"{value:.0%}")
        ax.set_ylabel("probability")
        ax.set_title("equal branches: one holds more than 80%")
        ax.text(0.98, 0.06, "colours as above", ha="right", transform=ax.transAxes)
        figure.savefig(path, dpi=200)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--colonies", type=int, default=10_000, help="of each kind")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=OUT, help="a folder")
    parser.add_argument("--json", action="store_true", help="print JSON, draw nothing")
    options = parser.parse_args()
    try:
        validation.integer("--colonies", options.colonies, at_least=1)
        validation.seed(options.seed)
    except ValueError as error:
        parser.error(str(error))

    equal = equal_branches(options.colonies, options.seed)
    began = time.perf_counter()
    simulate_crossings(ANTS[-1], options.colonies, seed=options.seed)
    seconds = time.perf_counter() - began
    experiments = unequal_branches(options.colonies, options.seed)
    unequal = [
        {
            "experiment": name,
            "short": float((shares > MOST).mean()),
            "long": float((shares < 1 - MOST).mean()),
        }
        for name, shares in experiments.items()
    ]
    if options.json:
        found = {"equal": equal, "unequal": unequal, "seconds": seconds}
        print(json.dumps({"colonies": options.colonies, **found}))
        return
    print("equal branches: one holds more than 80%")
    for row in equal:
        print(
            f"  alpha {row['alpha']:g}, {row['ants']:5,} ants: exact {row['exact']:.4f}, "
            f"simulated {row['simulated']:.4f}"
        )
    print("unequal branches: more than 80% on the short one, or on the long one")
    for row in unequal:
        print(f"  {row['experiment']}: {row['short']:.3f}, {row['long']:.3f}")
    print(
        f"{options.colonies:,} colonies of {ANTS[-1]:,} ants: {seconds:.2f} s "
        f"({options.colonies * ANTS[-1] / seconds / 1e6:.0f} million ants a second)"
    )
    options.out.mkdir(parents=True, exist_ok=True)
    path = options.out / "double_bridge.png"
    draw(equal, experiments, options.colonies, options.seed, path)


if __name__ == "__main__":
    main()
