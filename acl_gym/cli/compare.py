"""`acl-gym compare`, and the whole of benchmarks/compare_acl_rl.py."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from acl_gym.cli.common import (
    BadArgumentError,
    Command,
    DebugOption,
    InterruptedRunError,
    JsonOption,
    console,
)

HELP = """Compare ACL with reinforcement learning on one task.

Trains ACL, Q-learning, Q(lambda) and Stable-Baselines3's DQN over several seeds,
evaluates them alike, and writes results.json, results.parquet, figures and report.html.
A run that was killed goes on where it stopped when the same command is given again.

\b
Examples:
  acl-gym compare
  acl-gym compare --agents acl-fuzzy,q-fuzzy --seeds 5 --out results/tables
  acl-gym compare --env acl_gym/GridSearch2D-v0 --out results/grid
  acl-gym compare --preset full --out results/full
"""


class CompareCommand(Command):
    """Its help lists presets and methods, which are looked up only then."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help."""
        from acl_gym.experiments.contestants import CONTESTANTS, PRESETS
        from acl_gym.experiments.courses import CONTINUOUS, COURSES

        presets = "\n".join(
            f"  {name:8} runs of each method: {seeds}"
            for name, seeds in PRESETS.items()
        )
        methods = "\n".join(f"  {name:15} {CONTINUOUS[name]}" for name in CONTESTANTS)
        environments = "\n".join(
            f"  {env_id}\n    trials: {budget.trials}, steps of DQN: "
            f"{budget.dqn_steps:,} (quick)\n    {', '.join(course.methods)}"
            for env_id, course in COURSES.items()
            for budget in (course.budgets["quick"],)
        )
        self.epilog = (
            f"\b\nPresets:\n{presets}\n\n\b\nMethods:\n{methods}\n\n"
            f"\b\nEnvironments, and the methods that they have:\n{environments}"
        )
        super().format_help(ctx, formatter)


def _at_least_one(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise typer.BadParameter(f"must be a whole number >= 1, got {text!r}.")
    return int(text)


def compare(
    preset: Annotated[
        str, typer.Option(metavar="NAME", help="How much to run, see below.")
    ] = "quick",
    env: Annotated[
        str | None,
        typer.Option(
            metavar="ID",
            help="Environment, see below.  [default: the first]",
            show_default=False,
        ),
    ] = None,
    agents: Annotated[
        str | None,
        typer.Option(
            metavar="A,B,...",
            help="Methods, see below.  [default: all it has]",
            show_default=False,
        ),
    ] = None,
    seeds: Annotated[
        int | None,
        typer.Option(
            parser=_at_least_one,
            metavar="N",
            help="Runs of each method.  [default: the preset's]",
            show_default=False,
        ),
    ] = None,
    seed: Annotated[
        int,
        typer.Option(min=0, metavar="N", help="The first seed; the others follow it."),
    ] = 0,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Where the files go.  [default: results/compare, or beside it a folder "
            "named after the environment if that is not the first]",
            show_default=False,
        ),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            parser=_at_least_one,
            metavar="N",
            help="Processes.  [default: one for each core]",
            show_default=False,
        ),
    ] = None,
    fresh: Annotated[
        bool,
        typer.Option(
            "--fresh", help="Make every run anew, also those that DIR holds already."
        ),
    ] = False,
    as_json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Compare; see `HELP`."""
    from acl_gym.experiments import comparison
    from acl_gym.experiments.contestants import PRESETS
    from acl_gym.experiments.courses import COURSES

    _check_choice("--preset", preset, list(PRESETS))
    env = env or comparison.ENVIRONMENTS[0]
    _check_choice("--env", env, list(comparison.ENVIRONMENTS))
    if out is None:
        first = env == comparison.ENVIRONMENTS[0]
        name = "" if first else f"-{comparison.short_name(env)}"
        out = Path(f"results/compare{name}")
    names = list(COURSES[env].methods)
    if agents is not None:
        wanted = [name.strip() for name in agents.split(",") if name.strip()]
        if not wanted or not set(wanted) <= set(names):
            raise BadArgumentError(
                f"--agents must be among {', '.join(names)} for {env}, got {agents!r}."
            )
        names = list(dict.fromkeys(wanted))
    try:
        comparison.compare(
            env,
            preset,
            names,
            seeds,
            out,
            first_seed=seed,
            fresh=fresh,
            workers=workers,
            console=console(stderr=as_json),
        )
    except KeyboardInterrupt as error:
        raise InterruptedRunError(
            "interrupted; finished runs are kept, give the same command to go on."
        ) from error
    if as_json:
        typer.echo((out / "results.json").read_text())


def _check_choice(option: str, value: str, choices: list[str]) -> None:
    if value not in choices:
        raise BadArgumentError(
            f"{option}: invalid choice {value!r}, must be one of {', '.join(choices)}."
        )
