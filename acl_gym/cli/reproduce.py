"""`acl-gym reproduce` and `acl-gym report`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from acl_gym.cli.common import DebugOption, JsonOption, console
from acl_gym.cli.errors import (
    BadArgumentError,
    Command,
    InterruptedRunError,
    bad_arguments,
)

HELP = """Repeat experiments of the thesis and judge its claims.

Runs the figures that are named, 30 runs of each setting, and writes figures,
results.json, results.parquet and report.html. A run that is there already, made by the
same code, is not made again: after an interruption the same command continues.

\b
Examples:
  acl-gym reproduce --list                 the figures, and what they need
  acl-gym reproduce fig5.4 --runs 3        one figure, in a minute
  acl-gym reproduce claims --out results   all that decides a claim
  acl-gym reproduce comparison --runs 3    against Q-learning, DQN, PPO and A2C
  acl-gym reproduce fig6.centre --runs 3   swarms that lose messages
  acl-gym reproduce all                    everything, over an hour
  acl-gym reproduce all --executor ray     needs pip install acl-gym[cluster]
"""

REPORT_HELP = """Write the report of a reproduction again.

It is made from results.json and the figures; no runs are needed or made.

\b
Examples:
  acl-gym report results/reproduce
"""


class ReproduceCommand(Command):
    """Its help lists the experiments, which are looked up only then."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help."""
        from acl_gym.experiments.reproduce import EXPERIMENTS

        names = "\n".join(f"  {each.name:20} {each.title}" for each in EXPERIMENTS)
        self.epilog = f"\b\nExperiments:\n{names}"
        super().format_help(ctx, formatter)


def reproduce(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[NAME]...",
            help="Figures, see below; `claims`, `comparison` or `all`.  [default: all]",
            show_default=False,
        ),
    ] = None,
    runs: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="N",
            help="Runs of each setting.  [default: 30]",
            show_default=False,
        ),
    ] = None,
    seed: Annotated[
        int, typer.Option(min=0, metavar="N", help="The first seed; others follow it.")
    ] = 0,
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Where the files go.")
    ] = Path("results/reproduce"),
    workers: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="N",
            help="Processes.  [default: one for each core]",
            show_default=False,
        ),
    ] = None,
    executor: Annotated[
        str, typer.Option(metavar="local|ray", help="Who makes the runs.")
    ] = "local",
    figures: Annotated[
        bool, typer.Option(help="Draw figures and write the report.")
    ] = True,
    only_list: Annotated[
        bool, typer.Option("--list", help="List the experiments, and run nothing.")
    ] = False,
    as_json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Reproduce; see `HELP`."""
    from acl_gym.experiments.names import EXECUTORS, EXPERIMENTS, GROUPS
    from acl_gym.utils.validation import one_of

    # Names first: a wrong one is answered before anything slow is imported.
    wanted = names or ["all"]
    with bad_arguments():
        for name in wanted:
            one_of("experiment", name, (*GROUPS, *EXPERIMENTS))
        one_of("--executor", executor, EXECUTORS)
    from acl_gym.experiments import reproduce as engine

    experiments = engine.chosen(wanted)
    if only_list:
        _list(experiments, as_json)
        return
    screen = console(stderr=as_json)
    try:
        outcome, was_there = engine.reproduce(
            *(wanted, runs or engine.RUNS, out),
            first_seed=seed,
            workers=workers,
            executor=executor,
            figures=figures,
            console=screen,
        )
    except KeyboardInterrupt as error:
        raise InterruptedRunError(
            "interrupted; finished runs are kept, give the same command to go on."
        ) from error
    except OSError as error:
        raise _cannot_write(out, error) from error
    if was_there:
        screen.print(f"Nothing to do: all of it is in {out}, made by the same code.")
    if as_json:
        typer.echo(json.dumps(engine.without_curves(outcome), indent=1))
        return
    _show_verdicts(outcome, screen)
    if figures:
        screen.print(f"Report: {out / engine.PAGE}")


def report(
    directory: Annotated[
        Path, typer.Argument(metavar="DIR", help="What `reproduce` has written.")
    ] = Path("results/reproduce"),
    as_json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Write the report; see `REPORT_HELP`."""
    if not directory.is_dir():  # before the import, which takes seconds
        raise BadArgumentError(
            f"there is no folder {directory}; `acl-gym reproduce --out {directory}` "
            "makes one."
        )
    from acl_gym.experiments import reproduce as engine

    try:
        path = engine.write_pages(directory)
    except (FileNotFoundError, ValueError) as error:
        raise BadArgumentError(str(error)) from error
    except OSError as error:
        raise _cannot_write(directory, error) from error
    if as_json:
        claims = engine.read_outcome(directory)["claims"]
        verdicts = {claim["claim"]: claim["verdict"] for claim in claims}
        typer.echo(json.dumps({"report": str(path), "claims": verdicts}, indent=1))
        return
    typer.echo(f"Report: {path}")


def _list(experiments: Any, as_json: bool) -> None:
    if as_json:
        rows = [
            {
                "name": each.name,
                "title": each.title,
                "section": each.section,
                "claims": list(each.claims),
                "explains": list(each.explains),
                "settings": [*each.studies, *each.references],
            }
            for each in experiments
        ]
        typer.echo(json.dumps(rows, indent=1))
        return
    for each in experiments:
        words = [", ".join(each.claims)] if each.claims else []
        words += [f"to understand {', '.join(each.explains)}"] if each.explains else []
        claims = f" ({'; '.join(words)})" if words else ""
        typer.echo(f"{each.name:20} {each.title}{claims}")


def _cannot_write(directory: Path, error: OSError) -> RuntimeError:
    """What to report, for instance where a disk is full."""
    return RuntimeError(
        f"results, figures or report cannot be written to {directory}: "
        f"{error.strerror or error}; runs that are finished are kept, give the same "
        "command again when the cause is removed."
    )


def _show_verdicts(outcome: Any, screen: Any) -> None:
    """The verdicts as a table."""
    from rich.table import Table

    decided = [c for c in outcome["claims"] if c["verdict"] != "undecided"]
    if not decided:
        return
    table = Table(show_edge=False)
    for heading in ("", "verdict", "claim"):
        table.add_column(heading)
    for claim in decided:
        table.add_row(claim["claim"], claim["verdict"], claim["text"])
    screen.print(table)
