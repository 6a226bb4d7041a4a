"""Search for the settings of every method, alike: what the comparison `versus` runs with.

In each arena (a system as it is, or made harder) each method gets the same number of
evaluations by Optuna's TPE sampler, the first of them its defaults. An evaluation is one
run for each tuning seed; its value is the mean cost of the last policies, so that a policy
that fails counts as what it costs. The whole search is kept, one JSON file for each arena
and method, after every evaluation: a search that was stopped goes on where it was, and
ends as if it had not been stopped. One process, one thread; needs Optuna (extra `dev`).

examples:
  python benchmarks/tune.py                        everything, an hour or so
  python benchmarks/tune.py --only pendulum-acl    one method in one arena
  python benchmarks/tune.py --only grid            every method in one arena
  python benchmarks/tune.py --table                what was found, as Markdown
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from tqdm import tqdm

from acl_gym.reproduction.versus.arenas import ARENAS, LABELS
from acl_gym.reproduction.versus.spaces import METHODS
from acl_gym.reproduction.versus.tuned import (
    FOLDER,
    best_of,
    methods_in,
    path_of,
    read_search,
)
from acl_gym.reproduction.versus.tuning import EVALUATIONS, SEEDS, search

PAIRS = [(name, method) for name in ARENAS for method in methods_in(ARENAS[name])]


def chosen(names: Sequence[str] | None) -> list[tuple[str, str]]:
    """The pairs of arena and method that names stand for.

    Raises:
        ValueError: a name stands for none.
    """
    if names is None:
        return PAIRS
    known = {*ARENAS, *(f"{name}-{method}" for name, method in PAIRS)}
    for each in names:
        if each not in known:
            raise ValueError(
                f"--only must be arenas or arena-method, got {each!r}; arenas are "
                f"{', '.join(ARENAS)}, methods {', '.join(METHODS)}."
            )
    wanted = set(names)
    return [
        (name, method)
        for name, method in PAIRS
        if name in wanted or f"{name}-{method}" in wanted
    ]


def table(pairs: Sequence[tuple[str, str]], folder: Path) -> str:
    """What was found, as Markdown."""
    lines = [
        "| arena | method | defaults | best | best settings | seconds |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for name, method in pairs:
        if not path_of(name, method, folder).is_file():
            continue
        found = read_search(name, method, folder)
        best, first = best_of(found), found["evaluations"][0]
        settings = ", ".join(
            f"{key} {value:.3g}" if isinstance(value, float) else f"{key} {value}"
            for key, value in best["parameters"].items()
        )
        seconds = sum(each["seconds_in_all"] for each in found["evaluations"])
        lines.append(
            f"| {LABELS[name]} | {METHODS[method]} | {first['value']:.4g} "
            f"| {best['value']:.4g} | {settings} | {seconds:.0f} |"
        )
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--only",
        nargs="+",
        metavar="NAME",
        help=f"arenas, or arena-method; arenas: {', '.join(ARENAS)}",
    )
    parser.add_argument(
        "--evaluations",
        type=int,
        default=EVALUATIONS,
        metavar="N",
        help=f"settings tried for each, the defaults among them (default {EVALUATIONS})",
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=FOLDER,
        metavar="DIR",
        help="where the files are (default: those that the comparison reads)",
    )
    parser.add_argument(
        "--table", action="store_true", help="print what was found, and search nothing"
    )
    options = parser.parse_args(arguments)
    try:
        pairs = chosen(options.only)
    except ValueError as error:
        parser.error(str(error))
    if options.evaluations < 1:
        parser.error(f"--evaluations must be at least 1, got {options.evaluations}.")
    if not options.table:
        total = len(pairs) * options.evaluations
        with tqdm(total=total, unit="evaluation", smoothing=0.05) as bar:
            for name, method in pairs:
                bar.set_description(f"{name}-{method}")
                try:
                    search(
                        name,
                        method,
                        options.out,
                        evaluations=options.evaluations,
                        seeds=SEEDS,
                        tell=bar.update,
                    )
                except (ValueError, ModuleNotFoundError) as error:
                    print(f"tune.py: {error}", file=sys.stderr)
                    return 1
    print(table(pairs, options.out))
    return 0


if __name__ == "__main__":
    sys.exit(main())
