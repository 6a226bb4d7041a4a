"""`acl-gym train`: learn in any environment and save the agent."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from acl_gym.cli.agents import AGENTS, load_agent, name_of, parameters
from acl_gym.cli.common import DebugOption, JsonOption, check_name
from acl_gym.cli.environments import (
    Environment,
    check_named_by_file,
    from_metadata,
    parse_bins,
)
from acl_gym.cli.errors import BadArgumentError, Command, bad_arguments, report
from acl_gym.cli.targets import checked_file, free_name, name_after

HELP = """Learn in an environment, print the progress, and save the agent.

The agent is the returning colony: its ants walk back and remember, and its partition is
chosen and grows. --agent acl is the colony of the thesis, --agent q-learning is
Q-learning and Q(lambda); --agent ant-system, ant-colony-system and max-min look for one
best solution, such as a shortest tour, where states are numbered. Without --agent, a parameter may choose: --param deposit=rank:5
takes the colony of the thesis, the first that has deposits.

ENV_ID is the id of any Gymnasium environment; "module:id" imports a module first, which
may be in the working directory. Two files are written: NAME.npz, the agent as it is at
the end, and NAME-best.npz, as it was when its policy was the best.

Ctrl-C, and SIGTERM, end learning after the trial under way (or at once if that takes
more than two seconds) and save the agent; --resume goes on from there as if nothing had
happened. The exit code is then 130, or 143. A second Ctrl-C ends the program at once.

\b
Examples:
  acl-gym train acl_gym/Pendulum-v0
  acl-gym train --resume Pendulum-v0.npz --trials 50            50 more trials
  acl-gym train acl_gym/Pendulum-v0 --agent acl --ants 2000 --seed 3
  acl-gym train acl_gym/GridSearch2D-v0 --param epsilon=0.2
  acl-gym train acl_gym/GridSearch2D-v0 --ants 86 --param tabu=true
  acl-gym train acl_gym/Pendulum-v0 --agent q-learning --param trace_decay=0.5
  acl-gym train acl_gym/Pendulum-v0 --partition crisp --param tau0=0.001
  acl-gym train acl_gym/Pendulum-v0 --param epsilon=linear:0.3:0.01:50
  acl-gym train acl_gym/Pendulum-v0 --env-arg torques=[-1,0,1] --cells 64,65
  acl-gym train CartPole-v1 --param deposit=rank:5
  acl-gym train acl_gym/TravellingSalesman-v0 --agent max-min
  acl-gym train Pendulum-v1 --discretize 5
  acl-gym train my_module:MyEnv-v0 --max-steps 200 --log run.csv --json
"""


class TrainCommand(Command):
    """Its help lists the parameters of the agents, which are looked up only then."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help."""
        from acl_gym.cli.settings import OBJECTS, SCHEDULES, signature

        blocks = []
        for name in AGENTS:
            lines = [
                textwrap.fill(
                    f"{each:14} {declared.default}  {declared.words}",
                    78,
                    initial_indent="  ",
                    subsequent_indent=" " * 17,
                )
                for each, declared in parameters(name).items()
            ]
            blocks += [f"Parameters of --agent {name} with their defaults:", *lines, ""]
        families = {"a number that changes (schedule)": SCHEDULES, **OBJECTS}
        for title, kinds in families.items():
            blocks.append(f"Values for {title}:")
            blocks += [f"  {signature(name, kind)}" for name, kind in kinds.items()]
            blocks.append("")
        blocks.append("Costs add up: settling_time:0:3.14+2*overshoot:0:3.14+0.1")
        self.epilog = "\b\n" + "\n\n\b\n".join("\n".join(blocks).split("\n\n"))
        super().format_help(ctx, formatter)


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
            help="Number of trials; in each, every ant makes one episode. With --resume: "
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
            "sets inputs between them.",
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
    log: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.csv", help="Write one row per trial.", show_default=False
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
    """Learn; see `HELP`."""
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
        learner = load_agent(str(resume))
        environment = _resumed_environment(resume, learner, typed, arguments, bins)
        known = name_of(learner)
        if agent not in (None, known):
            raise BadArgumentError(
                f"--agent must be {known}, as in {resume}, got {agent!r}; leave it out."
            )
        wanted = list(param or ())
        if agent is None and "deposit" not in parameters(known):
            wanted = _without_deposit(wanted, known)
        changes = parse_parameters("--param", wanted, parameters(known))
        for option, value, now in (
            ("--seed", seed, learner.seed),
            ("--max-steps", max_steps, learner.max_steps),
        ):
            if value not in (None, now):
                raise BadArgumentError(
                    f"{option} must be {now}, as in {resume}, got {value}; leave it out."
                )
        target = checked_file(
            name_after(resume, environment.name) if out is None else out
        )
        plan = learning.go_on(
            environment, learner, changes, ants, evaluate_every, trials
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


def _without_deposit(param: list[str], known: str) -> list[str]:
    """Leave out a deposit, with a word, where an agent goes on that needs none.

    It says how ants turn costs into pheromone, and lets them learn from rewards of any
    sign. Other agents do so without it, so that a script that always sets it still works.
    """
    kept = [each for each in param if each.partition("=")[0].strip() != "deposit"]
    if len(kept) < len(param):
        report(
            "acl-gym",
            f"note: --param deposit is left out: this file holds --agent {known}, which "
            "takes rewards of any sign as they are.",
        )
    return kept


def _cells(text: str | None) -> list[int] | None:
    if text is None:
        return None
    try:
        return [int(part) for part in text.split(",")]
    except ValueError:
        raise BadArgumentError(
            f"--cells must be whole numbers such as 40,41, got {text!r}."
        ) from None


def _resumed_environment(
    file: Path,
    learner: Any,
    typed: Environment | None,
    arguments: dict[str, Any],
    bins: tuple[int, ...] | None,
) -> Environment:
    """The environment that a file names, or the user where it names none."""
    found = from_metadata(str(file), learner.metadata)
    if found is None:
        if typed is None:
            raise BadArgumentError(
                f"{file} does not name its environment; name it: acl-gym train ENV_ID "
                f"--resume {file}."
            )
        typed.import_module()
        return typed
    if typed is not None and typed.name != found.name:
        raise BadArgumentError(
            f"{file} was trained in {found.name}, got {typed.name}; leave ENV_ID out to "
            "go on there."
        )
    if bins is not None and found.bins is not None and len(bins) != len(found.bins):
        same = len(set(bins) | set(found.bins)) == 1
    else:
        same = bins in (None, found.bins)
    if not same:
        raise BadArgumentError(
            f"--discretize must be {','.join(map(str, found.bins or ())) or 'left out'}, "
            f"as in {file}, got {','.join(map(str, bins or ()))}."
        )
    for name, value in arguments.items():
        if found.arguments.get(name, value) != value or name not in found.arguments:
            raise BadArgumentError(
                f"--env-arg {name} must be as in {file}, "
                f"{found.arguments.get(name, 'where it is not set')!r}, got {value!r}; "
                "leave it out."
            )
    if typed is not None and typed.module:
        typed.import_module()
    untyped = {k: v for k, v in found.arguments.items() if k not in arguments}
    check_named_by_file(str(file), Environment(found.env_id, untyped, found.bins), "")
    return found
