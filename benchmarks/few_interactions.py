"""How good a policy is after a few hundred interactions with a plant.

Every step of a real plant costs time and wear. This benchmark gives each method a number
of interactions, stops it there, and judges its policy from 100 starts, without exploration.
Methods:

- `model`: `acl_gym.learn_from_plant`: what the plant did is recorded, a model is fitted to
  it, and the returning colony walks in the model; then the plant runs with its policy.
- `model-acl`, `model-q`: the same with the colony of the thesis, or with Q(lambda), in the
  model.
- `returning`, `q-learning` (Q(lambda)), `q-replay` (with what it remembers) and `dqn`:
  without a model, with the settings that were tuned for the environment where there are
  such. They need far more interactions; give them some: --interactions 2000 20000.
- `pets`: PETS of mbrl-lib, which plans anew in each step with an ensemble of networks; it
  needs a Python environment of its own, which `make peers-pets` makes, and minutes a run.

Two of the conditions change what can be done with a plant. With `--starts anywhere` a
reset puts it into a random state, and learn_from_plant resets the pendulum every 10 steps.
With `--starts rest` every run begins at rest, as that of one real pendulum does, and
lasts 40 steps. Goal and cost are given, as an engineer knows them; with `--learned-task`
learn_from_plant has to learn them from rewards and terminations. In environments of other
packages that is always so, continuous actions have five values each, and the column of
costs holds minus the mean return of 100 episodes.

examples:
  python benchmarks/few_interactions.py --interactions 50 100 200 --seeds 5
  python benchmarks/few_interactions.py --starts rest --methods model --seeds 20 --json
  python benchmarks/few_interactions.py --methods dqn q-learning --interactions 1000 20000
  python benchmarks/few_interactions.py --env Pendulum-v1 --methods model --interactions 1000
  python benchmarks/few_interactions.py --read model.json dqn.json --figure cost.png

A row of the JSON is the policy of one run after `interactions` steps of the plant:
`method`, `seed`, `interactions`, `seconds` (of the processor, without evaluation),
`policy_cost`, `success_rate`, and `made`: a method that stops only at the end of a trial
may have made more than it was given, and is judged in its favour. The table has the median, the range, and in how many runs the
policy is within 25% and 10% of the best one known. `--out FILE` writes the rows after each
run, so that nothing is lost with the process; `--read` shows rows of earlier runs.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from few_methods import METHODS, Row, run  # isort: skip  # the scripts beside this one
from few_plants import BEST, PENDULUM, PlantTask  # isort: skip
from tables import markdown  # isort: skip

from tqdm.auto import tqdm

from acl_gym.envs.learned.regression import LEAST_STEPS
from acl_gym.utils.files import write_atomically
from acl_gym.utils.text import replace_unprintable_letters

NEAR = (0.25, 0.10)
"""How much more than the best policy one may cost to be near it."""

WARM = 40
"""The most interactions of a run whose only purpose is that kernels are compiled."""

LOOKS: dict[str, dict[str, Any]] = {
    "model": {
        "label": "returning colony in a model",
        "color": "#D55E00",
        "marker": "o",
        "markersize": 3,
    },
    "model-acl": {
        "label": "ACL in a model",
        "color": "black",
        "marker": "^",
        "markersize": 3,
    },
    "model-q": {
        "label": "Q(λ) in a model",
        "color": "#009E73",
        "marker": "s",
        "markersize": 3,
    },
    "returning": {"label": "returning colony", "color": "#D55E00", "linestyle": "--"},
    "q-learning": {"label": "Q(λ)", "color": "#009E73", "linestyle": "--"},
    "q-replay": {
        "label": "Q-learning with replay",
        "color": "#CC79A7",
        "linestyle": "--",
    },
    "dqn": {"label": "DQN", "color": "#0072B2", "linestyle": "--"},
    "pets": {"label": "PETS", "color": "#56B4E9", "linestyle": "-."},
}
"""Of the methods in a figure; those without a model are dashed."""

DEFAULTS = [name for name in METHODS if name != "pets"]


def measure(
    task: PlantTask,
    methods: Sequence[str],
    seeds: Sequence[int],
    marks: Sequence[int],
    keep: Callable[[list[Row]], Any],
) -> list[Row]:
    """Run all methods with all seeds.

    Args:
        task: the plant.
        methods: keys of `METHODS`.
        seeds: of the runs.
        marks: the numbers of interactions, rising.
        keep: called with all rows after each run.
    """
    rows: list[Row] = []
    jobs = [(method, seed) for method in methods for seed in seeds]
    warm: set[str] = set()
    with tqdm(jobs, unit="run", file=sys.stderr) as bar:
        for method, seed in bar:
            bar.set_postfix_str(f"{method}, seed {seed}")
            if method not in warm and method != "pets":
                run(method, task, 0, [min(marks[0], WARM)])  # Numba compiles
                warm.add(method)
            rows += run(method, task, seed, marks)
            keep(rows)
    return rows


def summary(rows: Sequence[Row], best: float | None) -> list[dict[str, Any]]:
    """One entry for each method and number of interactions."""
    entries = []
    for method in dict.fromkeys(row["method"] for row in rows):
        mine = [row for row in rows if row["method"] == method]
        for mark in sorted({row["interactions"] for row in mine}):
            some = [row for row in mine if row["interactions"] == mark]
            costs = [row["policy_cost"] for row in some]
            success = [
                row["success_rate"] for row in some if row["success_rate"] is not None
            ]
            entries.append(
                {
                    "method": method,
                    "interactions": mark,
                    "made": statistics.median(
                        row.get("made", row["interactions"]) for row in some
                    ),
                    "runs": len(some),
                    "median": statistics.median(costs),
                    "lowest": min(costs),
                    "highest": max(costs),
                    "near": [
                        None
                        if best is None
                        else sum(cost <= (1 + more) * best for cost in costs)
                        for more in NEAR
                    ],
                    "success": statistics.median(success) if success else None,
                    "seconds": statistics.median(row["seconds"] for row in some),
                }
            )
    return entries


def table(rows: Sequence[Row], best: float | None) -> str:
    """A line for each method and number of interactions, in Markdown."""
    near = [] if best is None else [f"within {more:.0%}" for more in NEAR]
    heads = ["method", "interactions", "made", "runs", "cost, median", "range", *near]
    heads += ["success", "seconds"]
    lines = []
    for each in summary(rows, best):
        known = each["success"]
        cells = [
            each["method"],
            f"{each['interactions']:,}",
            f"{each['made']:,.0f}",
            f"{each['runs']}",
            f"{each['median']:.1f}",
            f"{each['lowest']:.1f} to {each['highest']:.1f}",
            *(f"{count}" for count in each["near"] if count is not None),
            "-" if known is None else f"{known:.0%}",
            f"{each['seconds']:.1f}",
        ]
        lines.append(cells)
    return markdown(heads, lines)


def figure(rows: Sequence[Row], best: float | None, path: Path) -> None:
    """Cost over interactions made: median of each method, and the range of its runs."""
    from matplotlib.ticker import FuncFormatter

    from acl_gym.plotting import style

    entries = summary(rows, best)
    with style.in_style():
        drawing = style.new_figure(4.6)
        ax = drawing.add_subplot()
        for method in dict.fromkeys(each["method"] for each in entries):
            # Of numbers that are passed in one trial the last.
            mine = list(
                {
                    each["made"]: each for each in entries if each["method"] == method
                }.values()
            )
            made = [each["made"] for each in mine]
            look = dict(LOOKS[method])
            label = look.pop("label")
            ends = [[each[end] for each in mine] for end in ("lowest", "highest")]
            ax.fill_between(made, *ends, color=look["color"], alpha=0.15, linewidth=0)
            runs = max(each["runs"] for each in mine)
            ax.plot(
                made,
                [each["median"] for each in mine],
                label=f"{label}, {runs} {'run' if runs == 1 else 'runs'}",
                **look,
            )
        ax.set_xscale("log")
        ax.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:,.0f}"))
        if all(each["lowest"] > 0 for each in entries):
            ax.set_yscale("log")
            style.plain_log(ax.yaxis)
        if best is not None:
            ax.axhline(best, **style.BOUND)
            for more in NEAR:
                bound = (1 + more) * best
                ax.axhline(bound, **{**style.BOUND, "linestyle": ":"})
                ax.annotate(
                    f" +{more:.0%}",
                    (1.0, bound),
                    xycoords=ax.get_yaxis_transform(),
                    va="center",
                    fontsize="small",
                )
        ax.set(xlabel="interactions with the plant", ylabel="cost of the policy")
        ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=2)
        drawing.savefig(path, dpi=150)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run and print; returns the exit code: 2 for what cannot be run as asked."""
    options = _parser().parse_args(arguments)
    marks = sorted(set(options.interactions))
    try:
        rows = _read(options.read) if options.read else _measured(options, marks)
        best = BEST.get(options.env)
        if options.figure is not None:
            figure(rows, best, options.figure)
    except (ValueError, OSError, ImportError) as error:
        print(f"few_interactions.py: {error}", file=sys.stderr)
        return 2
    if options.json:
        print(json.dumps({"rows": rows}))
    else:
        print(table(rows, best))
    return 0


def _measured(options: argparse.Namespace, marks: Sequence[int]) -> list[Row]:
    task = PlantTask(
        options.env, options.starts, options.learned_task, options.restart_after
    )

    def keep(rows: list[Row]) -> None:
        if options.out is not None:
            write_atomically(options.out, json.dumps({"rows": rows}).encode())

    keep([])  # fails now if it cannot be written
    seeds = range(options.seed, options.seed + options.seeds)
    return measure(task, list(dict.fromkeys(options.methods)), seeds, marks, keep)


def _read(paths: Sequence[Path]) -> list[Row]:
    rows: list[Row] = []
    for path in paths:
        try:
            found = json.loads(path.read_text())["rows"]
            rows += [
                {
                    **row,
                    "method": _method(row["method"]),
                    "interactions": int(row["interactions"]),
                    "policy_cost": float(row["policy_cost"]),
                    "seconds": float(row["seconds"]),
                    "success_rate": row["success_rate"],
                }
                for row in found
            ]
        except (ValueError, KeyError, TypeError) as error:
            raise ValueError(
                f"{path} must hold rows of this benchmark, written by --out or --json, "
                f"but cannot be read: {error!r}."
            ) from error
    if not rows:
        raise ValueError("--read must name files with rows, got none.")
    return rows


def _method(name: Any) -> str:
    if name not in METHODS:
        raise ValueError(f"there is no method {name!r}")
    return str(name)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add(
        "--env",
        default=PENDULUM,
        metavar="ID",
        help="the plant, a registered environment (default: %(default)s)",
    )
    add(
        "--interactions",
        type=_at_least(LEAST_STEPS),
        nargs="+",
        default=[100, 200, 400],
        metavar="N",
        help="after how many steps of the plant policies are judged (default: 100 200 "
        "400)",
    )
    add(
        "--methods",
        nargs="+",
        choices=tuple(METHODS),
        default=DEFAULTS,
        help="what is run (default: all but pets)",
    )
    add(
        "--starts",
        choices=("anywhere", "rest"),
        default="anywhere",
        help="where runs begin (default: %(default)s)",
    )
    add(
        "--learned-task",
        action="store_true",
        help="learn goal and cost as well, from rewards and terminations",
    )
    add(
        "--restart-after",
        type=_at_least(1),
        metavar="N",
        help="steps after which learn_from_plant resets the plant (default: 10 or 40 on "
        "the pendulum, 40 on the navigation, elsewhere the limit of its episodes)",
    )
    add(
        "--seeds",
        type=_at_least(1),
        default=3,
        metavar="S",
        help="runs of each method (default: %(default)s)",
    )
    add("--seed", type=_at_least(0), default=0, metavar="N", help="the first seed")
    add("--json", action="store_true", help="print JSON, no table")
    add("--out", type=Path, metavar="FILE", help="write the rows after each run")
    add(
        "--read",
        type=Path,
        nargs="+",
        metavar="FILE",
        help="show rows of earlier runs instead of running",
    )
    add("--figure", type=Path, metavar="PATH", help="draw cost over interactions")
    return parser


def _at_least(least: int) -> Callable[[str], int]:
    def whole(text: str) -> int:
        if not (text.isdecimal() and int(text) >= least):
            raise argparse.ArgumentTypeError(
                f"must be an integer >= {least}, got {text!r}"
            )
        return int(text)

    return whole


if __name__ == "__main__":
    replace_unprintable_letters()
    raise SystemExit(main())
