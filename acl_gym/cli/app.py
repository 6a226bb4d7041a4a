"""The command `acl-gym` with its subcommands."""

from __future__ import annotations

from typing import Annotated

import typer

import acl_gym
from acl_gym.cli.common import DebugOption
from acl_gym.cli.compare import HELP as COMPARE_HELP
from acl_gym.cli.compare import CompareCommand, compare
from acl_gym.cli.design import design
from acl_gym.cli.design_help import HELP as DESIGN_HELP
from acl_gym.cli.design_help import DesignCommand
from acl_gym.cli.envs import HELP as ENVS_HELP
from acl_gym.cli.envs import envs
from acl_gym.cli.errors import Command, Group
from acl_gym.cli.evaluate import HELP as EVALUATE_HELP
from acl_gym.cli.evaluate import evaluate
from acl_gym.cli.reproduce import HELP as REPRODUCE_HELP
from acl_gym.cli.reproduce import REPORT_HELP, ReproduceCommand, report, reproduce
from acl_gym.cli.train import train
from acl_gym.cli.train_help import HELP as TRAIN_HELP
from acl_gym.cli.train_help import TrainCommand

HELP = """Ant Colony Learning: colonies of ants that learn control policies.

\b
Examples:
  acl-gym envs                                   list the environments
  acl-gym train acl_gym/Pendulum-v0 --out a.npz  learn, in a few seconds
  acl-gym evaluate a.npz                         evaluate the saved policy
  acl-gym design --example pendulum              a controller in C, a report
  acl-gym compare                                compare ACL, Q-learning, DQN
  acl-gym reproduce fig5.4 --runs 3              repeat a figure of the thesis

For the options of a command: acl-gym train --help. Exit codes are 0 for success, 1 for
a run that failed, 2 for bad arguments, 130 for Ctrl-C, 143 for SIGTERM, and 141 if the
reader of the results has gone (as in `| head`); files are saved all the same.
"""

app = typer.Typer(cls=Group, add_completion=False, rich_markup_mode=None)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"acl-gym {acl_gym.__version__}")
        raise typer.Exit


@app.callback(help=HELP, invoke_without_command=True)
def _main(
    context: typer.Context,
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_show_version, is_eager=True, help="Show the version."
        ),
    ] = False,
    debug: DebugOption = False,
) -> None:
    """Show the help if no command is given."""
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())
        raise typer.Exit(2)


app.command(help=TRAIN_HELP, cls=TrainCommand)(train)
app.command(help=EVALUATE_HELP)(evaluate)
app.command(help=DESIGN_HELP, cls=DesignCommand)(design)
app.command(help=ENVS_HELP)(envs)
app.command(help=COMPARE_HELP, cls=CompareCommand)(compare)
app.command(help=REPRODUCE_HELP, cls=ReproduceCommand)(reproduce)
app.command(help=REPORT_HELP, cls=Command)(report)
