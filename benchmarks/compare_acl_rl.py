"""ACL against reinforcement learning on the thesis's pendulum, from one command.

Trains crisp and fuzzy ACL, Q-learning and Stable-Baselines3's DQN over several seeds,
evaluates them alike, and writes a report. A run that was killed goes on where it
stopped when the same command is given again.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from rich.console import Console

from acl_gym.experiments.comparison import ENVIRONMENTS, compare
from acl_gym.experiments.contestants import CONTESTANTS, PRESETS
from acl_gym.experiments.runner import TaskFailedError


def build_parser() -> argparse.ArgumentParser:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--preset",
        choices=list(PRESETS),
        default="quick",
        help="how much to run: "
        + "; ".join(
            f"{name}: {preset.seeds} seeds, {preset.trials} trials, "
            f"DQN {preset.dqn_steps:,} steps"
            for name, preset in PRESETS.items()
        )
        + " (default: %(default)s)",
    )
    parser.add_argument(
        "--env",
        choices=ENVIRONMENTS,
        default=ENVIRONMENTS[0],
        help="environment (default: %(default)s)",
    )
    parser.add_argument(
        "--agents",
        type=_agents,
        default=list(CONTESTANTS),
        metavar="A,B,...",
        help=f"methods, of {', '.join(CONTESTANTS)} (default: all)",
    )
    parser.add_argument(
        "--seeds",
        type=_at_least_one,
        default=None,
        metavar="N",
        help="runs of each method, seeds 0 .. N-1 (default: the preset's)",
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("results/compare"),
        metavar="DIR",
        help="where the files go (default: %(default)s)",
    )
    parser.add_argument(
        "--workers",
        type=_at_least_one,
        default=None,
        metavar="N",
        help="processes (default: one for each core)",
    )
    parser.add_argument(
        "--fresh",
        action="store_true",
        help="make every run anew, also those that DIR holds already",
    )
    return parser


def _agents(text: str) -> list[str]:
    names = [name.strip() for name in text.split(",") if name.strip()]
    unknown = [name for name in names if name not in CONTESTANTS]
    if unknown or not names:
        raise argparse.ArgumentTypeError(
            f"must be among {', '.join(CONTESTANTS)}, got {text!r}"
        )
    return list(dict.fromkeys(names))


def _at_least_one(text: str) -> int:
    try:
        number = int(text)
    except ValueError:
        number = 0
    if number < 1:
        raise argparse.ArgumentTypeError(f"must be a whole number >= 1, got {text!r}")
    return number


def main(arguments: list[str] | None = None) -> int:
    """Run the comparison; returns the exit code."""
    options = build_parser().parse_args(arguments)
    try:
        compare(
            options.env,
            options.preset,
            options.agents,
            options.seeds,
            options.out,
            fresh=options.fresh,
            workers=options.workers,
            # A terminal knows its width; a file or a log is given one for the table.
            console=Console(width=None if sys.stdout.isatty() else 100),
        )
    except (TaskFailedError, OSError) as error:
        print(f"compare_acl_rl: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print(
            "compare_acl_rl: interrupted; finished runs are kept, give the same "
            "command to go on.",
            file=sys.stderr,
        )
        return 1
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
