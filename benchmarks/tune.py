"""Search for the settings of every method, alike: what the comparison `versus` runs with.

On each task (a system as it is, or made harder) each method gets the same number of
evaluations by Optuna's TPE sampler, the first of them its defaults. An evaluation is one
run for each tuning seed; its value is the mean cost of the last policies, so that a policy
that fails counts as what it costs. The search is logged after every evaluation, in one
JSON file for each task and method: a search that was stopped goes on where it was, and
ends as if it had not been stopped. One process, one thread; needs Optuna (extra `dev`).

examples:
  python benchmarks/tune.py                        everything, an hour or so
  python benchmarks/tune.py --only pendulum-acl    one method on one task
  python benchmarks/tune.py --only grid            every method on one task
  python benchmarks/tune.py --table                what was found, as Markdown
  python benchmarks/tune.py --write                the comparison takes what was found
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from tqdm import tqdm

try:
    from acl_gym.experiments.comparison.tuning import (
        EVALUATIONS,
        PAIRS,
        best_of,
        found_in,
        open_log,
        path_of,
        search,
    )
except ModuleNotFoundError as error:
    sys.exit(
        f"tune.py needs a module that is not installed ({error.name}); "
        "pip install 'acl-gym[dev]'."
    )
from acl_gym.experiments.comparison.tasks import METHODS, SETTINGS_FILE, TASKS
from acl_gym.utils.files import write_atomically

FOLDER = Path(__file__).with_name("tuning")


def chosen(names: Sequence[str] | None) -> list[tuple[str, str]]:
    """The pairs of task and method that names stand for.

    Raises:
        ValueError: a name stands for none.
    """
    if names is None:
        return PAIRS
    known = {*TASKS, *(f"{name}-{method}" for name, method in PAIRS)}
    for each in names:
        if each not in known:
            raise ValueError(
                f"--only must be tasks or task-method, got {each!r}; tasks are "
                f"{', '.join(TASKS)}, methods {', '.join(METHODS)}."
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
        "| task | method | defaults | best | best settings | seconds |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for name, method in pairs:
        if not path_of(name, method, folder).is_file():
            continue
        log = open_log(name, method, folder)
        best, first = best_of(log), log["evaluations"][0]
        settings = ", ".join(
            f"{key} {value:.3g}" if isinstance(value, float) else f"{key} {value}"
            for key, value in best["parameters"].items()
        )
        seconds = sum(each["seconds_in_all"] for each in log["evaluations"])
        lines.append(
            f"| {TASKS[name].label} | {METHODS[method].label} | {first['value']:.4g} "
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
        help=f"tasks, or task-method; tasks: {', '.join(TASKS)}",
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
        help=f"where the logs are (default {FOLDER.name}, beside this script)",
    )
    parser.add_argument(
        "--table", action="store_true", help="print what was found, and search nothing"
    )
    parser.add_argument(
        "--write",
        action="store_true",
        help=f"write the best settings of all logs to {SETTINGS_FILE.name} of the package, "
        "from which the comparison reads them, and search nothing",
    )
    options = parser.parse_args(arguments)
    try:
        pairs = chosen(options.only)
    except ValueError as error:
        parser.error(str(error))
    if options.evaluations < 1:
        parser.error(f"--evaluations must be at least 1, got {options.evaluations}.")
    try:
        if options.write:
            text = json.dumps(found_in(options.out), indent=1)
            write_atomically(SETTINGS_FILE, f"{text}\n".encode())
            print(f"Written: {SETTINGS_FILE}")
            return 0
        if not options.table:
            total = len(pairs) * options.evaluations
            with tqdm(total=total, unit="evaluation", smoothing=0.05) as bar:
                for name, method in pairs:
                    bar.set_description(f"{name}-{method}")
                    search(
                        name,
                        method,
                        options.out,
                        evaluations=options.evaluations,
                        after_each=bar.update,
                    )
        print(table(pairs, options.out))
    except ValueError as error:
        print(f"tune.py: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
