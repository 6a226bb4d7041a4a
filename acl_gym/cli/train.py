"""`acl-gym train`: learn in any environment and save the agent."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from acl_gym.cli.agents import AGENTS, parameters
from acl_gym.cli.common import DebugOption, JsonOption, check_name
from acl_gym.cli.environments import Environment
from acl_gym.cli.errors import BadArgumentError, bad_arguments, report
from acl_gym.cli.numbering import parse_bins
from acl_gym.cli.plant_options import PlantOptions
from acl_gym.cli.resuming import resumed_plan
from acl_gym.cli.targets import checked_file, free_name, name_after


def train(
    env_id: Annotated[
        str | None,
        typer.Argument(
            metavar="ENV_ID",
            help="See acl-gym envs; with --resume it may be left out.",
            show_default=False,
        ),
    ] = None,
    agent: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help=f"The learning algorithm: {', '.join(AGENTS)}.  [default: the first of "
            "these that has each --param]",
            show_default=False,
        ),
    ] = None,
    trials: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="K",
            help="Number of trials; in each, every ant sets out once. With --resume: "
            "that many more.  [default: 100; with --resume: what an interrupted run had "
            "left, or 100 more]",
            show_default=False,
        ),
    ] = None,
    ants: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="M",
            help="Number of ants: slots of the vector environment.  [default: 5 of the "
            "returning colony; of others 250, or 200 in environments of other packages; "
            "on the travelling salesman as many as are usual; "
            "with --resume: as before]",
            show_default=False,
        ),
    ] = None,
    partition: Annotated[
        Literal["auto", "fuzzy", "crisp"],
        typer.Option(
            help="How continuous observations are partitioned into cells; auto means "
            "fuzzy, with the returning colony coarse cells that grow. Missing bounds are "
            "estimated from random steps, or from what the returning colony sees."
        ),
    ] = "auto",
    cells: Annotated[
        str | None,
        typer.Option(
            metavar="N,N,...",
            help="Cells of each variable, or one number for all.  "
            "[default: those of the thesis, or a few thousand in total; with the "
            "returning colony they grow]",
            show_default=False,
        ),
    ] = None,
    discretize: Annotated[
        str | None,
        typer.Option(
            metavar="N|N,N,...",
            help="For continuous actions: the number of values of each dimension, one "
            "for all or one for each. They lie in the middle of equal parts of the range "
            "(gymnasium.wrappers.DiscretizeAction). acl-gym evaluate --interpolate then "
            "sets inputs between them.  [default: with --interactions or --from-data "
            "five from end to end]",
            show_default=False,
        ),
    ] = None,
    max_steps: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="T",
            help="The most steps of an episode, in learning and in evaluation.  "
            "[default: the limit of the environment, or 300]",
            show_default=False,
        ),
    ] = None,
    param: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE",
            help="A parameter of the agent, such as epsilon=0.2 or deposit=rank:5, see "
            "below; repeat the option for more.",
            show_default=False,
        ),
    ] = None,
    env_arg: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE",
            help="A parameter of the environment, see acl-gym envs ENV_ID: a number, "
            "true, false, a [list] or a text.",
            show_default=False,
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(
            min=0,
            metavar="N",
            help="Seed; the same seed gives the same run.  [default: 0]",
            show_default=False,
        ),
    ] = None,
    threads: Annotated[
        int,
        typer.Option(
            min=1,
            metavar="N",
            help="Threads; useful with several thousand ants. The result is the same.",
        ),
    ] = 1,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.npz",
            help="Save the agent to this file, and the best one beside it.  [default: "
            "the name of the environment, with a number if the file exists; with "
            "--resume: that file]",
            show_default=False,
        ),
    ] = None,
    resume: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.npz",
            help="Go on with a saved agent, bit for bit as if it had not stopped.",
            show_default=False,
        ),
    ] = None,
    checkpoint_every: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="N",
            help="Trials between checkpoints, which are saved to the same file.  "
            "[default: one each minute]",
            show_default=False,
        ),
    ] = None,
    keep_best: Annotated[
        bool,
        typer.Option(
            "--keep-best/--no-keep-best", help="Write NAME-best.npz, the best policy."
        ),
    ] = True,
    evaluate_every: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="N",
            help="Trials between evaluations.  [default: 10, or 2 in environments of "
            "other packages, whose best policies pass quickly; with --resume: as before]",
            show_default=False,
        ),
    ] = None,
    interactions: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="N",
            help="Make only N steps in the environment, record them, and learn in a model "
            "of what was recorded.",
            show_default=False,
        ),
    ] = None,
    restart_after: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="N",
            help="With --interactions: reset the environment after N steps. Where a reset "
            "is cheap and leads anywhere, short runs tell more.  [default: where its "
            "episodes end]",
            show_default=False,
        ),
    ] = None,
    from_data: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Learn in a model of recorded steps: .npz of acl_gym.Transitions, or "
            ".csv or .parquet with a row for each moment.",
            show_default=False,
        ),
    ] = None,
    state: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,...",
            help="Columns of a table that hold what the environment observes, in its "
            "order.",
            show_default=False,
        ),
    ] = None,
    input_: Annotated[
        str | None,
        typer.Option(
            "--input",
            metavar="NAME,...",
            help="Columns of the inputs, each held from its row to the next.",
            show_default=False,
        ),
    ] = None,
    time: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Column of the time in seconds, in which gaps are found.",
            show_default=False,
        ),
    ] = None,
    run: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Column whose value changes from one run to the next.",
            show_default=False,
        ),
    ] = None,
    reward: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Column of the reward of the step that begins in a row. The cost is learned "
            "from it if the environment does not say what its cost is.",
            show_default=False,
        ),
    ] = None,
    terminated: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Column of 0 and 1: whether an episode ended with that step. The goal is "
            "learned from it if the environment does not say what its goal is; needs --run.",
            show_default=False,
        ),
    ] = None,
    circular: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,...",
            help="With --interactions and --from-data: variables that wrap around, such as "
            "an angle that jumps from pi to -pi, by the names of --state or by numbers "
            "from 0, in addition to those that the environment names.",
            show_default=False,
        ),
    ] = None,
    log: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.csv",
            help="Write one row per trial; with --interactions, per round.",
            show_default=False,
        ),
    ] = None,
    tensorboard: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Write scalars for TensorBoard.", show_default=False
        ),
    ] = None,
    quiet: Annotated[
        bool, typer.Option("--quiet", help="Print no progress and no table.")
    ] = False,
    as_json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Learn; see `acl_gym.cli.train_help`."""
    from acl_gym.cli.settings import agent_with, parse_parameters, parse_settings

    # Names first: a wrong one is answered before anything slow is imported.
    if agent is not None:
        check_name("--agent", agent, AGENTS)
    arguments = parse_settings("--env-arg", env_arg or ())
    bins = parse_bins(discretize)
    wanted_cells = _cells(cells)
    typed = None if env_id is None else Environment(env_id, arguments, bins)
    if typed is not None:
        typed.check_id()
    few = PlantOptions(
        interactions,
        restart_after,
        from_data,
        state,
        input_,
        time,
        run,
        reward,
        terminated,
        circular,
    )
    if few.wanted:
        few.refuse_options(
            {
                "--resume": resume,
                "--trials": trials,
                "--ants": ants,
                "--partition": None if partition == "auto" else partition,
                "--cells": cells,
                "--evaluate-every": evaluate_every,
                "--checkpoint-every": checkpoint_every,
                "--tensorboard": tensorboard,
                "--no-keep-best": None if keep_best else True,
            }
        )
    few.check()
    if resume is None:
        if typed is None:
            raise BadArgumentError(
                "ENV_ID is missing: name an environment, see `acl-gym envs`, or a file "
                "to go on with, --resume FILE."
            )
        kind = agent or agent_with("--param", param or ())
        settings = parse_parameters("--param", param or (), parameters(kind))
        typed.import_module()
    from acl_gym import set_num_threads
    from acl_gym.cli import learning

    with bad_arguments():
        set_num_threads(threads)
    shown = learning.Shown(quiet, as_json)
    if few.wanted and typed is not None:
        from acl_gym.cli import from_plant

        from_plant.run(
            few,
            typed,
            kind,
            settings,
            target=checked_file(free_name(typed.name) if out is None else out),
            max_steps=max_steps,
            seed=seed or 0,
            log=log,
            shown=shown,
        )
        return
    if resume is None and typed is not None:
        target = checked_file(free_name(typed.name) if out is None else out)
        plan = learning.begin(
            typed,
            kind,
            settings,
            ants=ants,
            partition=partition,
            cells=wanted_cells,
            max_steps=max_steps,
            seed=seed or 0,
            evaluate_every=evaluate_every,
            trials=trials or learning.TRIALS,
            chosen_for=agent is None and shown.progress,
        )
        if agent is None and kind != next(iter(AGENTS)) and shown.progress:
            report("acl-gym", f"note: these parameters are those of --agent {kind}.")
    elif resume is not None:
        if cells is not None or partition != "auto":
            raise BadArgumentError(
                "--cells and --partition cannot be changed with --resume: the file "
                "holds a table over its cells; leave them out."
            )
        plan = resumed_plan(
            resume,
            typed,
            arguments,
            bins,
            agent=agent,
            param=list(param or ()),
            unchanged={"--seed": seed, "--max-steps": max_steps},
            ants=ants,
            evaluate_every=evaluate_every,
            trials=trials,
        )
        target = checked_file(
            name_after(resume, plan.environment.name) if out is None else out
        )
    best = (
        checked_file(target.with_name(f"{target.stem}-best.npz")) if keep_best else None
    )
    if resume is not None and best is not None:
        from acl_gym.cli.keeping import take_over_best

        take_over_best(plan.learner, resume, best)
    learning.run(
        plan,
        target,
        best,
        checkpoint_every,
        log=log,
        tensorboard=tensorboard,
        shown=shown,
    )


def _cells(text: str | None) -> list[int] | None:
    if text is None:
        return None
    try:
        return [int(part) for part in text.split(",")]
    except ValueError:
        raise BadArgumentError(
            f"--cells must be whole numbers such as 40,41, got {text!r}."
        ) from None
