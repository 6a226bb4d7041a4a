"""`acl-gym reproduce` and `acl-gym report`."""

from __future__ import annotations

import json
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

HELP = """Repeat experiments of the thesis and judge its claims.

Runs the figures that are named, 30 colonies for each setting, and writes figures,
results.json and report.html. A run that is there already, made by the same code, is not
made again: what was killed goes on when the same command is given again.

\b
Examples:
  acl-gym reproduce --list                   the figures, and what they need
  acl-gym reproduce fig5.4 --runs 3          one figure, in a minute
  acl-gym reproduce claims --out results/c   all that decides a claim
  acl-gym reproduce versus --runs 3          against Q-learning, Q(lambda) and DQN
  acl-gym reproduce all                      everything, an hour or so on two cores
  acl-gym reproduce all --executor ray       on a cluster (pip install acl-gym[cluster])
"""

REPORT_HELP = """Write the report of a reproduction anew.

It is made from results.json and the figures; no run is needed, and none is made.

\b
Examples:
  acl-gym report results/reproduce
"""


class ReproduceCommand(Command):
    """Its help lists the experiments, which are looked up only then."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help."""
        from acl_gym.reproduction.catalogue import EXPERIMENTS

        names = "\n".join(f"  {each.name:17} {each.title}" for each in EXPERIMENTS)
        self.epilog = f"\b\nExperiments:\n{names}"
        super().format_help(ctx, formatter)


def reproduce(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[NAME]...",
            help="Figures, see below; `claims` or `all`.  [default: all]",
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
        str, typer.Option(metavar="local|ray", help="Who runs the colonies.")
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
    from acl_gym.experiments.runner import alone_in
    from acl_gym.reproduction import reproduce as reproduction
    from acl_gym.reproduction import resume
    from acl_gym.reproduction.catalogue import RUNS
    from acl_gym.reproduction.page import PAGE

    wanted = names or ["all"]
    try:
        experiments = reproduction.chosen(wanted)
    except ValueError as error:
        raise BadArgumentError(str(error)) from error
    if executor not in reproduction.EXECUTORS:
        raise BadArgumentError(
            f"--executor must be one of {', '.join(reproduction.EXECUTORS)}, got "
            f"{executor!r}."
        )
    if only_list:
        _list(experiments, as_json)
        return
    screen = console(stderr=as_json)
    runs = runs or RUNS
    outcome, made_from = reproduction.already(wanted, runs, out, seed, figures)
    if outcome is not None:
        screen.print(f"Nothing to do: all of it is in {out}, made by the same code.")
        _tell(outcome, as_json, screen, out / PAGE if figures else None)
        return
    try:
        out.mkdir(parents=True, exist_ok=True)
        with alone_in(out):  # to the end: the page has to be that of these runs
            outcome, evidence = reproduction.reproduce(
                wanted,
                runs,
                out,
                first_seed=seed,
                workers=workers,
                executor=executor,
                console=screen,
            )
            if figures:
                reproduction.draw(experiments, evidence, out, screen)
                reproduction.write_report(out)
            resume.finish(out, made_from)
    except KeyboardInterrupt as error:
        raise InterruptedRunError(
            "interrupted; finished runs are kept, give the same command to go on."
        ) from error
    except OSError as error:
        raise _cannot_write(out, error) from error
    _tell(outcome, as_json, screen, out / PAGE if figures else None)


def report(
    directory: Annotated[
        Path, typer.Argument(metavar="DIR", help="What `reproduce` has written.")
    ] = Path("results/reproduce"),
    seed: Annotated[
        int,
        typer.Option(
            min=0, metavar="N", help="Not used: a report has no chance in it."
        ),
    ] = 0,
    as_json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Write the page; see `REPORT_HELP`."""
    from acl_gym.reproduction import page

    try:
        page.write_claims(directory)
        path = page.write_page(directory)
    except (FileNotFoundError, ValueError) as error:
        raise BadArgumentError(str(error)) from error
    except OSError as error:
        raise _cannot_write(directory, error) from error
    if as_json:
        verdicts = {
            claim["claim"]: claim["verdict"]
            for claim in page.read_outcome(directory)["claims"]
        }
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
                "settings": [study.label for study in each.studies],
            }
            for each in experiments
        ]
        typer.echo(json.dumps(rows, indent=1))
        return
    for each in experiments:
        words = [", ".join(each.claims)] if each.claims else []
        words += [f"to understand {', '.join(each.explains)}"] if each.explains else []
        told = f" ({'; '.join(words)})" if words else ""
        typer.echo(f"{each.name:17} {each.title}{told}")


def _cannot_write(directory: Path, error: OSError) -> RuntimeError:
    """For instance of a disk that is full."""
    return RuntimeError(
        f"results, figures or report cannot be written to {directory}: "
        f"{error.strerror or error}; runs that are finished are kept, mend it and give "
        "the same command again."
    )


def _tell(outcome: Any, as_json: bool, screen: Any, page: Path | None) -> None:
    """What came of it."""
    if as_json:
        from acl_gym.reproduction.outcome import figures_only

        typer.echo(json.dumps(figures_only(outcome), indent=1))
        return
    _show(outcome, screen)
    if page is not None:
        screen.print(f"Report: {page}")


def _show(outcome: Any, screen: Any) -> None:
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
