"""`acl-gym compare`, which benchmarks/compare_acl_rl.py runs too."""

from __future__ import annotations

import textwrap
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from acl_gym.cli.common import DebugOption, JsonOption, check_name, console
from acl_gym.cli.environments import Environment
from acl_gym.cli.errors import (
    BadArgumentError,
    Command,
    InterruptedRunError,
    bad_arguments,
)

if TYPE_CHECKING:
    from rich.console import Console

    from acl_gym.experiments.comparison.tasks import System
    from acl_gym.experiments.results import Results
    from acl_gym.experiments.study import Experiment

HELP = """Compare both colonies with reinforcement learning on one task.

Trains ACL, the returning colony, Q-learning, Q(lambda), Q-learning with replay, and DQN,
PPO and A2C of Stable-Baselines3 over several seeds, evaluates them alike, and writes
results.json, results.parquet, figures and report.html.
A run that was killed goes on where it stopped when the same command is given again.

The environment may be any with Discrete actions, also "module:id", which imports a
module. For those listed below settings were chosen; others get general settings that
were not tuned: an automatic partition, and deposits by rank where rewards are not
negative costs. Policies are then judged by their return in 100 random episodes.

\b
Examples:
  acl-gym compare
  acl-gym compare --agents returning,acl --seeds 5 --out results/tables
  acl-gym compare --env acl_gym/GridSearch2D-v0 --out results/grid
  acl-gym compare --env CartPole-v1 --seeds 3
  acl-gym compare --preset full --out results/full
"""


class CompareCommand(Command):
    """Its help lists presets and methods, which are looked up only then."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help."""
        from acl_gym.experiments.comparison.tasks import ON_POLICY, SYSTEMS
        from acl_gym.experiments.names import PRESETS

        presets = "\n".join(
            f"  {name:8} runs of each method: {seeds}"
            for name, seeds in PRESETS.items()
        )
        systems = list(SYSTEMS.values())
        methods = "\n".join(
            f"  {name:15} {agent.label}" for name, agent in systems[0].agents.items()
        )
        environments = "\n".join(
            f"  {system.env_id}\n    trials: {system.budgets['quick'].trials}, steps of "
            f"DQN: {system.budgets['quick'].dqn_steps:,}, of\n    methods that remember: "
            f"{system.budgets['quick'].memory_steps:,} (quick)\n"
            + textwrap.indent(textwrap.fill(", ".join(system.agents), 72), "    ")
            for system in systems
        )
        self.epilog = (
            f"\b\nPresets:\n{presets}\n\n\b\nMethods:\n{methods}\n\n"
            "The name of a method alone, such as acl, stands for its fuzzy and its crisp "
            "partition; returning and q-replay for one that they choose and that grows. "
            f"PPO and A2C get {ON_POLICY} times the steps of DQN, which take as long, or in "
            "the quick preset twice its steps.\n\n"
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
            help="Environment, any id.  [default: the first of those below]",
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
    from acl_gym.experiments.names import METHODS, PRESETS, agent_names, agents_called

    # Names first: a wrong one is answered before anything slow is imported.
    check_name("--preset", preset, PRESETS)
    chosen = None if env is None else Environment(env)
    if chosen is not None:
        chosen.check_id()
    wanted = None
    if agents is not None:
        wanted = [name.strip() for name in agents.split(",") if name.strip()]
        for name in wanted or [""]:
            check_name(
                "--agents", name, {**dict.fromkeys(agent_names(False)), **METHODS}
            )
    if chosen is not None:
        chosen.import_module()
    from acl_gym.experiments.comparison.compare import compare as run_comparison
    from acl_gym.experiments.comparison.tasks import BY_ENV_ID

    default, *_ = BY_ENV_ID
    env = env or default
    system = BY_ENV_ID.get(env) or _foreign(env)
    if out is None:
        name = "" if env == default else f"-{system.colony.task.short_name}"
        out = Path(f"results/compare{name}")
    names = list(system.agents)
    if wanted is not None:
        for name in wanted:
            if not agents_called(name, names):
                check_name(f"--agents for {env}", name, names)
        called = [each for name in wanted for each in agents_called(name, names)]
        names = list(dict.fromkeys(called))
    _check_packages(names)
    terminal = console(stderr=as_json)
    try:
        found = run_comparison(
            system,
            preset,
            names,
            seeds,
            out,
            first_seed=seed,
            fresh=fresh,
            workers=workers,
            console=terminal,
        )
    except KeyboardInterrupt as error:
        raise InterruptedRunError(
            "interrupted; finished runs are kept, give the same command to go on."
        ) from error
    _print_summary(*found, terminal)
    terminal.print(f"\nReport: {out / 'report.html'}\nResults: {out / 'results.json'}")
    if as_json:
        typer.echo((out / "results.json").read_text(encoding="utf-8"))


def _check_packages(names: list[str]) -> None:
    """Refuse networks before any run where what they need is not installed."""
    from acl_gym.experiments.names import NETWORKS

    networks = [name for name in names if name in NETWORKS]
    if not networks or all(map(find_spec, ("stable_baselines3", "torch"))):
        return
    others = ",".join(name for name in names if name not in networks)
    without = f", or leave them out: --agents {others}" if others else ""
    raise BadArgumentError(
        f"the agents of Stable-Baselines3, here {', '.join(networks)}, need it and torch, "
        f"which are not installed; run `pip install stable-baselines3 torch`{without}."
    )


def _foreign(env_id: str) -> System:
    """An environment for which no settings were chosen."""
    from acl_gym.experiments.comparison.foreign import foreign_system

    # The same words on continuous actions as those of the other commands.
    Environment(env_id).vector(1)
    with bad_arguments():
        return foreign_system(env_id)


def _print_summary(experiment: Experiment, results: Results, terminal: Console) -> None:
    """Print the summary as a table of at most 100 columns."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    from acl_gym.experiments import tables
    from acl_gym.experiments.references import reference

    known = reference(experiment, results)
    cost = tables.number("cost", known.cost)
    shown = tables.summary(experiment, results, brief=True)
    table = Table(
        title=f"Medians over seeds; {known.symbol} = {cost}",
        box=box.SIMPLE_HEAD,
        show_edge=False,
        padding=0,
    )
    for place, heading in enumerate(shown.headings):
        table.add_column(heading, justify="right" if place else "left", no_wrap=True)
    for line, row in enumerate(shown.rows):
        cells = []
        for place, cell in enumerate(row):
            first, _, second = cell.partition("\n")
            text = Text(first, style="bold" if [line, place] in shown.best else "")
            cells.append(text.append(f"\n{second}", style="dim") if second else text)
        table.add_row(*cells)
    terminal.print(table)
    terminal.print(experiment.text, style="dim", highlight=False)
