"""`acl-gym train`: learn in any environment and save the agent."""

from __future__ import annotations

import inspect
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from acl_gym.cli.common import (
    AGENTS,
    FOREIGN_EPISODES,
    AgentName,
    BadArgumentError,
    DebugOption,
    JsonOption,
    bad_arguments,
    console,
    default_steps,
    make_env,
    parse_settings,
    print_json,
)

if TYPE_CHECKING:
    from gymnasium.vector import VectorEnv

    from acl_gym.agents.base import TabularAgent
    from acl_gym.callbacks import Callback, PolicyEvaluation
    from acl_gym.partitions import Partition

HELP = """Learn in an environment, print the progress, and save the agent.

ENV_ID is the id of any Gymnasium environment with Discrete actions; "module:id" imports
a module first, which may be in the working directory. ACL expects rewards that are
negative costs; use --param deposit=return if rewards are never negative.

\b
Examples:
  acl-gym train acl_gym/Pendulum-v0
  acl-gym train acl_gym/GridSearch2D-v0 --ants 86 --param tabu=true --out grid.npz
  acl-gym train acl_gym/Pendulum-v0 --ants 2000 --trials 50 --seed 3
  acl-gym train acl_gym/Pendulum-v0 --agent q-learning --param epsilon=0.05
  acl-gym train acl_gym/Pendulum-v0 --partition crisp --param global_decay=0.001
  acl-gym train acl_gym/Pendulum-v0 --env-arg torques=[-1,0,1] --cells 64,65
  acl-gym train my_module:MyEnv-v0 --max-steps 200 --log run.csv --json
"""

RANDOM_STEPS = 10_000
"""Random steps from which missing bounds of observations are estimated."""

_OWN_OPTIONS = ("env", "partition", "max_steps", "seed", "n_actions", "heuristic")


def train(
    env_id: Annotated[
        str,
        typer.Argument(metavar="ENV_ID", help="See acl-gym envs.", show_default=False),
    ],
    agent: Annotated[AgentName, typer.Option(help="The learning algorithm.")] = "acl",
    trials: Annotated[
        int,
        typer.Option(
            min=1,
            metavar="K",
            help="Number of trials; in each, every ant makes one episode.",
        ),
    ] = 100,
    ants: Annotated[
        int,
        typer.Option(
            min=1, metavar="M", help="Number of ants: slots of the vector environment."
        ),
    ] = 250,
    partition: Annotated[
        Literal["auto", "fuzzy", "crisp"],
        typer.Option(
            help="How continuous observations are partitioned into cells; auto means "
            "fuzzy. Missing bounds are estimated from random steps."
        ),
    ] = "auto",
    cells: Annotated[
        str | None,
        typer.Option(
            metavar="N,N,...",
            help="Cells of each variable, or one number for all.  "
            "[default: those of the thesis, or a few thousand in total]",
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
            help="A parameter of the agent, such as epsilon=0.2; repeat the option for "
            "more. An unknown name prints the list of parameters.",
            show_default=False,
        ),
    ] = None,
    env_arg: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE",
            help="A parameter of the environment, see acl-gym envs ENV_ID. Values are "
            "read as JSON: numbers, true, false, [lists].",
            show_default=False,
        ),
    ] = None,
    seed: Annotated[
        int,
        typer.Option(
            min=0, metavar="N", help="Seed; the same seed gives the same run."
        ),
    ] = 0,
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
            help="Save the agent to this file.  [default: the name of the environment, "
            "with a number if the file exists]",
            show_default=False,
        ),
    ] = None,
    evaluate_every: Annotated[
        int, typer.Option(min=1, metavar="N", help="Trials between evaluations.")
    ] = 10,
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
        bool, typer.Option("--quiet", help="Print no progress bar and no table.")
    ] = False,
    as_json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Learn; see `HELP`."""
    from acl_gym import set_num_threads
    from acl_gym.utils import files

    with bad_arguments():
        set_num_threads(threads)
        out = files.checked_target(
            _free_name(env_id) if out is None else files.with_suffix(out)
        )
        kind = agent_class(agent)
        settings = parse_settings("--param", param or (), _parameters(kind))
        env_args = parse_settings("--env-arg", env_arg or ())
        env = make_env(env_id, ants, env_args)
        steps = max_steps or default_steps(env)
        grid = _make_partition(env, partition, _cells(cells))
        learner = kind(env, grid, max_steps=steps, seed=seed, **settings)
        evaluation = _make_evaluation(env, env_id, env_args, evaluate_every, steps)
        watchers = [evaluation, *_make_logs(log, tensorboard)]
    learner.metadata = {
        "env_id": env_id,
        "env_args": env_args,
        "evaluation": {
            "episodes": None if evaluation.env is env else evaluation.env.num_envs,
            "max_steps": steps,
            "seed": evaluation.seed,
        },
    }
    learner.learn(
        trials=trials,
        callback=watchers,
        progress_bar=not quiet and sys.stderr.isatty(),
    )
    learner.save(out)
    if as_json:
        print_json(_summary(learner, agent, ants, out))
    elif not quiet:
        _print_rows(learner, out)


def agent_class(name: str) -> Any:
    """The class that `--agent` selects."""
    import acl_gym

    return getattr(acl_gym, AGENTS[name])


def parameter_names(kind: type) -> list[str]:
    """Names for `--param`: constructor keywords that have no option of their own."""
    parameters = inspect.signature(kind).parameters
    return [name for name in parameters if name not in _OWN_OPTIONS]


def _parameters(kind: type) -> dict[str, str]:
    """What `--param` may set, and the range of each number, as in "> 0"."""
    from acl_gym.utils.parameters import parameters_of

    declared = parameters_of(kind)
    return {
        name: declared[name].range.in_words() if name in declared else ""
        for name in parameter_names(kind)
    }


def _cells(text: str | None) -> list[int] | None:
    if text is None:
        return None
    try:
        return [int(part) for part in text.split(",")]
    except ValueError:
        raise BadArgumentError(
            f"--cells must be whole numbers such as 40,41, got {text!r}."
        ) from None


def _make_partition(env: VectorEnv, kind: str, cells: list[int] | None) -> Partition:
    from acl_gym import Crisp, Fuzzy
    from acl_gym.partitions.automatic import automatic_partition

    return automatic_partition(
        env,
        kind=Crisp if kind == "crisp" else Fuzzy,
        cells=cells[0] if cells and len(cells) == 1 else cells,
        random_steps=max(RANDOM_STEPS, env.num_envs),
    )


def _make_evaluation(
    env: VectorEnv, env_id: str, env_args: dict[str, Any], every: int, steps: int
) -> PolicyEvaluation:
    """Evaluate from the environment's evaluation states, or from fixed random ones."""
    from acl_gym import PolicyEvaluation
    from acl_gym.envs.control.environments import ControlVectorEnv

    if not isinstance(env.unwrapped, ControlVectorEnv):
        env = make_env(env_id, FOREIGN_EPISODES, env_args)
    return PolicyEvaluation(env, every=every, max_steps=steps)


def _make_logs(log: Path | None, tensorboard: Path | None) -> list[Callback]:
    from acl_gym import CSVLog, TensorBoardLog

    logs: list[Callback] = []
    if log is not None:
        logs.append(CSVLog(log))
    if tensorboard is not None:
        logs.append(TensorBoardLog(tensorboard))
    return logs


def _summary(learner: TabularAgent, name: str, ants: int, out: Path) -> dict[str, Any]:
    last = learner.history[-1]
    return {
        **learner.metadata,
        "agent": name,
        "ants": ants,
        "partition": repr(learner.partition),
        "parameters": learner.parameters(),
        "trials": learner.trials,
        "env_steps": learner.num_timesteps,
        "seconds": learner.seconds,
        "policy_cost": last["policy_cost"],
        "policy_return": last.get("policy_return"),
        "success_rate": last.get("success_rate"),
        "file": str(out),
        "rows": learner.history,
    }


def _print_rows(learner: TabularAgent, out: Path) -> None:
    from rich.table import Table

    from acl_gym.evaluation import reports_returns

    table = Table(box=None, pad_edge=False, header_style="bold")
    cost = getattr(learner, "cost", None)
    what = "return" if reports_returns(learner.rollout.env, cost) else "cost"
    heads = ("trial", "steps", "seconds", f"ants' {what}", f"policy {what}", "success")
    for head in heads:
        table.add_column(head, justify="right")
    for row in learner.history:
        if "policy_cost" in row:
            table.add_row(
                f"{row['trial']}",
                f"{row['env_steps']:,}",
                f"{row['seconds']:.2f}",
                f"{row[f'ants_{what}']:.2f}",
                f"{row[f'policy_{what}']:.4f}",
                f"{row['success_rate']:.1%}" if "success_rate" in row else "",
            )
    target = console()
    target.print(table)
    line = f"Saved {out}. To evaluate it again: acl-gym evaluate {out}"
    target.print(line, markup=False, highlight=False, soft_wrap=True)


def _free_name(env_id: str) -> Path:
    """A file name that is not taken in this folder: Pendulum-v0.npz, -2, -3, ..."""
    stem = env_id.rpartition(":")[2].rpartition("/")[2]
    path, number = Path(f"{stem}.npz"), 1
    while path.exists():
        number += 1
        path = Path(f"{stem}-{number}.npz")
    return path
