"""What it is worth to learn on all plants of an uncertain range (§7.3), not on one.

The plant is the pendulum of the thesis, of which mass, damping or the gain of the motor,
or all three, are only known to within some per cent. `ReturningACL` with its defaults and
five ants learns three controllers for each case:

- `nominal`: in the plant in the middle of the range, as one does who trusts the model;
- `range`: in plants drawn anew for each episode, `plant(..., uncertain={...})`;
- `hardest`: in the one corner of the range whose optimal cost is highest.

Each is evaluated in the nominal plant, in all corners of the range and in plants drawn from
it, from 100 states each (`acl_gym.evaluate_over_range`). Beside it stands the optimal cost
of the nominal plant and of the hardest corner, by fuzzy Q-iteration that knows them.

Prints medians over the seeds; the rate of success is that of the plant where it is lowest.
With --figure it draws the costs.
"""

from __future__ import annotations

import functools
import itertools
import json
import math
import statistics
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.lines import Line2D
from numba import njit
from tqdm.auto import tqdm

from acl_gym import (
    Fuzzy,
    ReturningACL,
    evaluate_over_range,
    evaluate_policy_cost,
    fuzzy_q_iteration,
    plant,
)
from acl_gym.plotting.style import BLUE, GREEN, ORANGE, in_style, new_figure
from acl_gym.utils.text import replace_unprintable_letters

# The script beside this one.
from tables import (  # isort: skip
    add_results,
    at_least_one,
    markdown,
    parser_of,
    rows_of,
    some_of,
)

Row = dict[str, Any]

NOMINAL = {"mass": 0.1, "damping": 0.01, "gain": 0.1}
SETTINGS: Row = {
    "low": [0.0, -9.0],
    "high": [2 * np.pi, 9.0],
    "circular": [0],
    "inputs": [-0.8, 0.0, 0.8],
    "sampling_time": 0.1,
    "goal": [np.pi, 0.0],
    "tolerance": 0.1,
    "cost": ([1.0, 0.1], 0.05),
    "max_episode_steps": 300,
    "parameters": NOMINAL,
}
CASES = {
    "mass": ("mass",),
    "damping": ("damping",),
    "gain": ("gain",),
    "all": ("mass", "damping", "gain"),
}
WIDTHS = (10, 20, 40)  # per cent
LEARNED_ON = ("nominal", "range", "hardest")
CELLS = (100, 101)  # of Q-iteration


@njit
def pendulum(x, u, p):  # type: ignore[no-untyped-def]
    """The pendulum of §5.2; J = 0.005 kg m^2, g L = 0.981 m^2/s^2."""
    torque = p.gain * u[0] - 0.981 * p.mass * math.sin(x[0]) - p.damping * x[1]
    return x[1], torque / 0.005


def ranges(case: str, width: int) -> dict[str, tuple[float, float]]:
    """The uncertain range of each parameter of a case."""
    share = width / 100
    return {
        name: (NOMINAL[name] * (1 - share), NOMINAL[name] * (1 + share))
        for name in CASES[case]
    }


def optimal_cost(env: Any) -> float:
    """The cost of the policy of fuzzy Q-iteration in a plant that is known."""
    grid = Fuzzy.from_box(env.single_observation_space, CELLS, circular=[0])
    policy = fuzzy_q_iteration(env, grid, tolerance=1e-3).policy
    return evaluate_policy_cost(policy, env).cost


def hardest_corner(env: Any) -> tuple[dict[str, float], float]:
    """The parameters of the corner whose optimal cost is highest, and that cost."""
    uncertain = env.system.parameters.uncertain
    corners = [
        dict(zip(uncertain, values, strict=True))
        for values in itertools.product(*uncertain.values())
    ]
    costs = [optimal_cost(env.with_parameters(**corner)) for corner in corners]
    at = int(np.argmax(costs))
    return corners[at], costs[at]


def run(case: str, width: int, learned: Row, seed: int, draws: int) -> list[Row]:
    """A row for each controller in `learned`, a dict from names to functions of a seed."""
    judge = plant(pendulum, num_envs=1, uncertain=ranges(case, width), **SETTINGS)
    rows = []
    for name, learn in learned.items():
        colony, seconds = learn(seed)
        found = evaluate_over_range(colony, judge, draws=draws)
        rows.append(
            {
                "case": case,
                "width": width,
                "learned_on": name,
                "seed": seed,
                "interactions": colony.num_timesteps,
                "nominal": found.nominal.cost,
                "mean": float(found.costs.mean()),
                "worst": found.worst.cost,
                "worst_parameters": found.worst_parameters,
                "success": float(found.success_rates.min()),
                "seconds": seconds,
            }
        )
    return rows


def learner(env: Any, steps: int) -> Any:
    """A function of a seed that returns a colony that has learned, and its seconds."""

    @functools.cache
    def learn(seed: int) -> tuple[ReturningACL, float]:
        began = time.process_time()
        colony = ReturningACL(env, seed=seed).learn(total_timesteps=steps)
        return colony, time.process_time() - began

    return learn


def study(
    cases: Sequence[str], widths: Sequence[int], seeds: range, steps: int, draws: int
) -> tuple[list[Row], list[Row]]:
    """All rows, and the optimal costs."""
    rows: list[Row] = []
    best: list[Row] = []
    nominal = plant(pendulum, num_envs=5, **SETTINGS)
    at_nominal = optimal_cost(nominal)
    on_nominal = learner(nominal, steps)  # once for all cases
    for case, width in tqdm(list(itertools.product(cases, widths)), desc="cases"):
        whole = plant(pendulum, num_envs=5, uncertain=ranges(case, width), **SETTINGS)
        corner, cost = hardest_corner(whole)
        best.append(
            {
                "case": case,
                "width": width,
                "nominal": at_nominal,
                "hardest": cost,
                "corner": corner,
            }
        )
        learned = {
            "nominal": on_nominal,
            "range": learner(whole, steps),
            "hardest": learner(whole.with_parameters(**corner), steps),
        }
        for seed in seeds:
            rows += run(case, width, learned, seed, draws)
    return rows, best


def median(
    rows: Sequence[Row], case: str, width: int, learned: str, name: str
) -> float:
    """Of a column over the seeds."""
    return statistics.median(
        row[name]
        for row in rows
        if (row["case"], row["width"], row["learned_on"]) == (case, width, learned)
    )


def as_markdown(rows: Sequence[Row], best: Sequence[Row]) -> str:
    """The table."""
    heads = ["uncertain", "learned on", "nominal cost", "mean cost", "worst cost"]
    heads += ["lowest success", "optimum, nominal", "optimum, hardest corner"]
    lines = []
    for each in best:
        case, width = each["case"], each["width"]
        for learned in LEARNED_ON:
            cost = {
                name: median(rows, case, width, learned, name)
                for name in ("nominal", "mean", "worst", "success")
            }
            costs = [f"{cost[name]:.1f}" for name in ("nominal", "mean", "worst")]
            optima = [f"{each[name]:.1f}" for name in ("nominal", "hardest")]
            names = [f"{case} ±{width}%", learned]
            lines.append([*names, *costs, f"{cost['success']:.0%}", *optima])
    return markdown(heads, lines, names=(0, 1))


COLOURS = dict(zip(LEARNED_ON, (BLUE, ORANGE, GREEN), strict=True))
LABELS = {
    "nominal": "learned on the nominal plant",
    "range": "learned on the whole range",
    "hardest": "learned on the hardest corner",
}


@in_style()
def draw(rows: Sequence[Row], best: Sequence[Row], path: Path) -> None:
    """Draw the worst cost and, hollow, the nominal cost over the width of the range."""
    cases = list(dict.fromkeys(each["case"] for each in best))
    figure = new_figure(2.9, dpi=150)
    panels = figure.subplots(1, len(cases), sharey=True, squeeze=False)[0]
    for ax, case in zip(panels, cases, strict=True):
        known = [each for each in best if each["case"] == case]
        widths = [each["width"] for each in known]
        places = np.arange(len(widths))
        for shift, learned in zip((-0.2, 0.0, 0.2), LEARNED_ON, strict=True):
            for column, fill in (("nominal", "none"), ("worst", COLOURS[learned])):
                for place, width in zip(places, widths, strict=True):
                    values = [
                        row[column]
                        for row in rows
                        if (row["case"], row["width"], row["learned_on"])
                        == (case, width, learned)
                    ]
                    at = place + shift
                    ax.plot(
                        [at] * 2, [min(values), max(values)], color=COLOURS[learned]
                    )
                    ax.plot(
                        at,
                        statistics.median(values),
                        "o",
                        markersize=4,
                        color=COLOURS[learned],
                        markerfacecolor="white" if fill == "none" else fill,
                    )
        for place, each in zip(places, known, strict=True):
            for level in (each["nominal"], each["hardest"]):
                ax.plot([place - 0.35, place + 0.35], [level] * 2, color="0.2", lw=0.8)
        ax.set(
            yscale="log",
            xticks=places,
            xticklabels=[f"±{width}%" for width in widths],
            xlim=(-0.5, len(widths) - 0.5),
            title="all three" if case == "all" else case,
        )
    panels[0].set_ylabel("policy cost")
    handles = [
        Line2D([], [], marker="o", markersize=4, color=COLOURS[name])
        for name in LEARNED_ON
    ]
    handles += [
        Line2D([], [], marker="o", markersize=4, color="0.4", markerfacecolor="white"),
        Line2D([], [], color="0.2", lw=0.8),
    ]
    labels = [*LABELS.values(), "hollow: in the nominal plant", "optimum, plant known"]
    figure.legend(handles, labels, ncols=3, loc="outside upper center")
    figure.savefig(path)


def main(arguments: list[str] | None = None) -> int:
    """Run and print; returns the exit code."""
    parser = parser_of(__doc__)
    for option, allowed in (("--cases", list(CASES)), ("--widths", list(WIDTHS))):
        parser.add_argument(
            option,
            type=some_of(allowed),
            default=allowed,
            help=f"some of {', '.join(map(str, allowed))} (default: all)",
        )
    for option, default, text in (
        ("--seeds", 5, "runs of each, with successive seeds"),
        ("--interactions", 20_000, "of each run"),
        ("--draws", 40, "plants in which each controller is evaluated"),
    ):
        parser.add_argument(
            option, type=at_least_one, default=default, help=f"{text} ({default:,})"
        )
    add_results(parser, "the costs")
    options = parser.parse_args(arguments)
    if options.from_json is None:
        rows, best = study(
            options.cases,
            options.widths,
            range(options.seeds),
            options.interactions,
            options.draws,
        )
    else:
        rows = rows_of(options.from_json)
        best = rows_of(options.from_json, "best")
    if options.figure is not None:
        draw(rows, best, options.figure)
    if options.json:
        print(json.dumps({"rows": rows, "best": best}))
    else:
        print(as_markdown(rows, best))
    return 0


if __name__ == "__main__":
    replace_unprintable_letters()
    raise SystemExit(main())
