"""`acl-gym design`: a controller and a report from a file that describes a plant."""

from __future__ import annotations

import shlex
from importlib.resources import as_file
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer

from acl_gym.cli import recorded
from acl_gym.cli.common import DebugOption, JsonOption, check_name, print_json
from acl_gym.cli.design_help import EXAMPLES, example, example_file
from acl_gym.cli.design_output import print_design, progress
from acl_gym.cli.errors import (
    BadArgumentError,
    InterruptedRunError,
    bad_arguments,
    report,
)
from acl_gym.cli.interrupts import Interruption


def design(
    plant: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE",
            help="PLANT.py or DATA.csv, which describes the plant.",
            show_default=False,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="The folder that is written; files of the same names are replaced.  "
            "[default: a new folder named after the file]",
            show_default=False,
        ),
    ] = None,
    seed: Annotated[
        int,
        typer.Option(
            min=0, metavar="N", help="Seed; the same seed gives the same controller."
        ),
    ] = 0,
    seconds: Annotated[
        float | None,
        typer.Option(
            metavar="S",
            help="The most seconds for learning.  [default: 60; with --steps none]",
            show_default=False,
        ),
    ] = None,
    steps: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="N",
            help="Learn for so many interactions with the model, whether or not the "
            "policy still improves: what repeats a design exactly.",
            show_default=False,
        ),
    ] = None,
    example_name: Annotated[
        str | None,
        typer.Option(
            "--example",
            metavar="NAME",
            help="Take a plant that is shipped, see below, in place of a file.",
            show_default=False,
        ),
    ] = None,
    show: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Print the file of an example, and do nothing else.",
            show_default=False,
        ),
    ] = None,
    state: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,...",
            help="For DATA.csv: the columns of the state; a name with a comma in double "
            "quotes.",
            show_default=False,
        ),
    ] = None,
    input_names: Annotated[
        str | None,
        typer.Option(
            "--input",
            metavar="NAME,...",
            help="For DATA.csv: the columns of the inputs.",
            show_default=False,
        ),
    ] = None,
    goal: Annotated[
        str | None,
        typer.Option(
            metavar="X,...",
            help="For DATA.csv: the state to which the plant is to be brought.",
            show_default=False,
        ),
    ] = None,
    tolerance: Annotated[
        str | None,
        typer.Option(
            metavar="X,...",
            help="For DATA.csv: half-widths of the goal, one for all or for each "
            "variable.  [default: a fortieth of each range]",
            show_default=False,
        ),
    ] = None,
    cost: Annotated[
        str,
        typer.Option(
            metavar="Q,...:R,...|time",
            help="For DATA.csv: weights on the squared error of each variable and on the "
            "square of each input, such as 1,0.1:0.05; or time.",
        ),
    ] = "time",
    circular: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,...",
            help="For DATA.csv: the variables that wrap around, such as angles, from -pi "
            "to pi if --low and --high do not say otherwise.",
            show_default=False,
        ),
    ] = None,
    low: Annotated[
        str | None,
        typer.Option(
            metavar="X,...",
            help="For DATA.csv: lower ends of the variables, where the model stops them "
            "as a wall would; an empty one is taken from the data.  [default: from the data]",
            show_default=False,
        ),
    ] = None,
    high: Annotated[
        str | None,
        typer.Option(
            metavar="X,...",
            help="For DATA.csv: upper ends of the variables.  [default: from the data]",
            show_default=False,
        ),
    ] = None,
    starts: Annotated[
        str | None,
        typer.Option(
            metavar="X,...:X,...",
            help="For DATA.csv: lower and upper ends of the states in which episodes "
            "begin, such as 3,-0.5:3.3,0.5; uniformly within these.  [default: recorded "
            "states]",
            show_default=False,
        ),
    ] = None,
    actions: Annotated[
        str | None,
        typer.Option(
            metavar="U;U;...",
            help="For DATA.csv: the inputs to choose among, such as -1;0;1, or "
            "-1,0;1,0 for two.  [default: those in the data]",
            show_default=False,
        ),
    ] = None,
    time_name: Annotated[
        str | None,
        typer.Option(
            "--time",
            metavar="NAME",
            help="For DATA.csv: the column of the time in seconds.",
            show_default=False,
        ),
    ] = None,
    run_name: Annotated[
        str | None,
        typer.Option(
            "--run",
            metavar="NAME",
            help="For DATA.csv: the column that changes from one run to the next.",
            show_default=False,
        ),
    ] = None,
    sampling_time: Annotated[
        float | None,
        typer.Option(
            metavar="S",
            help="For DATA.csv: seconds from one row to the next, without --time.",
            show_default=False,
        ),
    ] = None,
    max_steps: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="T",
            help="For DATA.csv: steps within which the goal is to be reached.  "
            "[default: 100]",
            show_default=False,
        ),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print no progress.")] = False,
    as_json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Design; see `acl_gym.cli.design_help`."""
    if show is not None:
        typer.echo(example(check_name("--show", show, EXAMPLES)), nl=False)
        return
    if (plant is None) == (example_name is None):
        raise BadArgumentError(
            "give either a file that describes a plant, PLANT.py, or --example NAME; "
            "`acl-gym design --show pendulum` prints a file to begin with."
        )
    if seconds is not None and not 0.0 < seconds < float("inf"):
        raise BadArgumentError(f"--seconds must be a number > 0, got {seconds:g}.")
    if seconds is None and steps is None:
        from acl_gym.design.run import SECONDS

        seconds = SECONDS
    given = {
        "--state": state,
        "--input": input_names,
        "--goal": goal,
        "--tolerance": tolerance,
        "--cost": None if cost == "time" else cost,
        "--circular": circular,
        "--low": low,
        "--high": high,
        "--starts": starts,
        "--actions": actions,
        "--time": time_name,
        "--run": run_name,
        "--sampling-time": sampling_time,
        "--max-steps": max_steps,
    }
    words = [f"{name}={value}" for name, value in given.items() if value is not None]
    learning = {"seed": seed, "seconds": seconds, "steps": steps}
    shown = _Shown(quiet, as_json)
    if plant is None:
        name = check_name("--example", str(example_name), EXAMPLES)
        _refuse_columns(f"--example {name}", words)
        with as_file(example_file(name)) as file:
            loaded = _loaded(file)
            _run(loaded, file, name, ["--example", name], out, learning, shown)
        return
    if plant.suffix.lower() in recorded.SUFFIXES:
        loaded = recorded.load(plant, given)
    else:
        _refuse_columns(str(plant), words)
        loaded = _loaded(plant)
    _run(loaded, plant, plant.stem, [str(plant), *words], out, learning, shown)


class _Shown(NamedTuple):
    """What is printed.

    Attributes:
        quiet: no progress.
        as_json: JSON and nothing else.
    """

    quiet: bool
    as_json: bool


def _loaded(file: Path) -> Any:
    from acl_gym.design.plants import load_plant

    with bad_arguments():
        return load_plant(file)


def _refuse_columns(what: str, words: list[str]) -> None:
    if words:
        raise BadArgumentError(
            f"{words[0].partition('=')[0]} describes measurements, a file that ends in "
            f"{' or '.join(recorded.SUFFIXES)}, got {what}, which describes its plant by "
            "itself; leave it out."
        )


def _run(
    env: Any,
    file: Path,
    stem: str,
    named: list[str],
    out: Path | None,
    learning: dict[str, Any],
    shown: _Shown,
) -> None:
    """Design and print.

    Args:
        env: the plant.
        file: that describes it.
        stem: what a new folder is named after.
        named: how the command line names the plant.
        out: the folder, or None.
        learning: `seed`, `seconds` and `steps`.
        shown: what is printed.
    """
    from acl_gym.design import design as design_controller
    from acl_gym.design.run import checked_folder

    with bad_arguments():
        folder = checked_folder(_free_folder(stem) if out is None else out)
    command = shlex.join(["acl-gym", "design", *named, "--out", str(folder)])
    with Interruption() as interruption, progress(not shown.quiet) as tell:
        try:
            made = design_controller(
                env,
                folder,
                source=file,
                command=command,
                stop=lambda: interruption.wanted,
                tell=tell,
                on_learned=interruption.learning_is_over,
                **learning,
            )
        except KeyboardInterrupt:
            if not interruption.wanted:
                raise
            raise InterruptedRunError(
                "interrupted before there was a policy; nothing is saved.",
                interruption.exit_code,
            ) from None
    if shown.as_json:
        print_json(made.summary)
    else:
        print_design(made)
    if interruption.wanted:
        raise InterruptedRunError(
            f"interrupted; the best controller so far is in {folder}.",
            interruption.exit_code,
        )
    if not made.succeeded:
        why = (
            f"the goal is reached from {made.measures.success_rate:.1%} of the starts, "
            "less than 95%"
        )
        if made.model_fault is not None:
            why = f"{made.model_fault}, so that its figures say nothing about the plant"
        report("acl-gym", f"{why}. What to try: {' '.join(made.advice)}")
        raise typer.Exit(1)


def _free_folder(stem: str) -> Path:
    """A name that is not taken in this folder: pendulum-design, -2, -3, ..."""
    path, number = Path(f"{stem}-design"), 1
    while path.exists():
        number += 1
        path = Path(f"{stem}-design-{number}")
    return path
