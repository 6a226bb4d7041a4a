"""`acl-gym evaluate`: the cost of a saved policy, in figures, in a window or as a film."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from acl_gym.cli.common import DebugOption, JsonOption, console, print_json
from acl_gym.cli.environments import Environment, check_named_by_file, from_metadata
from acl_gym.cli.errors import BadArgumentError, bad_arguments

if TYPE_CHECKING:
    from acl_gym.evaluation import PolicyCost

HELP = """Evaluate the policy of a saved agent.

The greedy policy is run without exploration. A file written by acl-gym train records
its environment and how it was evaluated; without options the evaluation is repeated and
gives the same cost. A file saved from Python needs --env-id, and so does one that names
a module: a file may come from anywhere, so no module is imported because it says so.

\b
Examples:
  acl-gym evaluate pendulum.npz
  acl-gym evaluate pendulum-best.npz --video pendulum.gif
  acl-gym evaluate pendulum.npz --render
  acl-gym evaluate pendulum.npz --episodes 1000 --seed 7   random starts
  acl-gym evaluate swing_up.npz --env-id acl_gym/Pendulum-v0 --json
  acl-gym evaluate mine.npz --env-id my_module:MyEnv-v0
  acl-gym evaluate Pendulum-v1.npz --interpolate           real inputs
"""

MOST_EPISODES = 100_000
"""More are not evaluated at once because a file says so."""

MOST_STEPS = 10_000_000
"""A file cannot ask for longer episodes."""


def evaluate(
    file: Annotated[
        str, typer.Argument(metavar="FILE", help="A saved agent.", show_default=False)
    ],
    env_id: Annotated[
        str | None,
        typer.Option(
            "--env-id",
            "--env",
            metavar="ID",
            help='Evaluate in this environment; "module:id" imports a module first.  '
            "[default: the one in the file]",
            show_default=False,
        ),
    ] = None,
    env_arg: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE",
            help="A parameter of the environment, in place of that in the file.",
            show_default=False,
        ),
    ] = None,
    discretize: Annotated[
        str | None,
        typer.Option(
            metavar="N|N,N,...",
            help="See acl-gym train; for a file that does not record it.",
            show_default=False,
        ),
    ] = None,
    interpolate: Annotated[
        bool,
        typer.Option(
            "--interpolate",
            help="Evaluate the policy of real inputs between the values of --discretize "
            "(docs/continuous-actions.md).",
        ),
    ] = False,
    episodes: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="N",
            help="Number of episodes, from random initial states.  [default: the "
            "evaluation states of the environment, or 100 random ones if it has none]",
            show_default=False,
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(
            min=0,
            metavar="N",
            help="Seed of the initial states and the environment.  [default: that in "
            "the file, or 0]",
            show_default=False,
        ),
    ] = None,
    max_steps: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="T",
            help="The most steps of an episode.  [default: the limit in the file]",
            show_default=False,
        ),
    ] = None,
    render: Annotated[
        bool,
        typer.Option(
            "--render", help="Show an episode in a window; with --episodes N show N."
        ),
    ] = False,
    video: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.gif|mp4",
            help="Write an episode to a film; with --episodes N write N.",
            show_default=False,
        ),
    ] = None,
    as_json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Evaluate; see `HELP`."""
    from acl_gym.cli.settings import parse_settings

    typed = None if env_id is None else Environment(env_id)
    if typed is not None:
        typed.check_id()
    arguments = parse_settings("--env-arg", env_arg or ())
    if render or video is not None:
        from acl_gym.cli import showing

        showing.check(render, video)
    from acl_gym.cli.agents import load_agent
    from acl_gym.cli.solutions import seeks_best, solution, solution_in_words

    agent = load_agent(file)
    environment, how = _chosen(file, agent.metadata, typed, arguments, discretize)
    walked = environment.with_real_inputs() if interpolate else environment
    if seed is None:
        seed = how.get("seed", 0)
    if max_steps is None:
        max_steps = how.get("max_steps")
    policy = agent
    if interpolate:
        with bad_arguments():
            # So that it knows the inputs of its actions, and that they fit.
            agent.set_env(environment.vector(1))
            policy = agent.interpolated_policy()
    result, settings = evaluate_agent(
        agent, policy, walked, episodes, how.get("episodes"), max_steps, seed
    )
    if render or video is not None:
        shown = episodes or 1
        showing.play(policy, walked, shown, settings["max_steps"], seed, video)
    settings = {"file": file, **settings}
    if interpolate:
        settings |= environment.facts
        settings["interpolated"] = True
    if video is not None:
        settings["video"] = str(video)
    solutions = {"solution": solution(agent)} if seeks_best(agent) else {}
    if as_json:
        print_json({**settings, **figures(result), **solutions})
    else:
        from acl_gym.evaluation import reports_returns

        returns = reports_returns(agent.env, getattr(agent, "cost", None))
        _print(settings, figures(result), returns)
        for found in solutions.values():
            for line in solution_in_words(found):
                console().print(line, markup=False, highlight=False, soft_wrap=True)


def _chosen(
    file: str,
    metadata: dict[str, Any],
    typed: Environment | None,
    arguments: dict[str, Any],
    discretize: str | None,
) -> tuple[Environment, dict[str, Any]]:
    """The environment, and how it was evaluated as far as that holds for it."""
    from acl_gym.cli.numbering import parse_bins

    found = from_metadata(file, metadata)
    how = _recorded(file, metadata) if found is not None else {}
    if found is None or (typed is not None and typed.name != found.name):
        if typed is None:
            raise BadArgumentError(
                f"{file} does not name its environment; add --env-id ID."
            )
        # Arguments and evaluation of another environment do not apply.
        found, how = Environment(typed.env_id), {}
    kept = {name: v for name, v in found.arguments.items() if name not in arguments}
    if typed is not None:
        typed.import_module()
    check_named_by_file(file, Environment(found.env_id, kept, found.bins), "--env-id")
    chosen = replace(found, arguments={**kept, **arguments})
    bins = parse_bins(discretize)
    if bins is not None:
        chosen = replace(chosen, bins=bins, end_to_end=False)
    return chosen, how


def _recorded(file: str, metadata: dict[str, Any]) -> dict[str, Any]:
    """How `acl-gym train` has evaluated: `episodes`, `max_steps` and `seed`, if known.

    Raises:
        BadArgumentError: the file holds something else there.
    """
    how = metadata.get("evaluation", {})
    limits = {"episodes": MOST_EPISODES, "max_steps": MOST_STEPS, "seed": 2**63}
    sound = isinstance(how, dict) and all(
        how.get(name) is None
        or (type(how[name]) is int and (name != "seed") <= how[name] <= limit)
        for name, limit in limits.items()
    )
    if not sound:
        raise BadArgumentError(
            f"the metadata of {file} must hold evaluation as acl-gym train writes it, "
            f"with at most {MOST_EPISODES:,} episodes, got {repr(how)[:200]}."
        )
    return {name: how[name] for name in limits if how.get(name) is not None}


def evaluate_agent(
    agent: Any,
    policy: Any,
    environment: Environment,
    episodes: int | None,
    recorded: int | None,
    max_steps: int | None,
    seed: int,
) -> tuple[PolicyCost, dict[str, Any]]:
    """Follow an agent's policy, and let the agent keep the environment.

    Args:
        agent: of any kind of this package, for its episode cost.
        policy: what is followed, the agent or a policy of it.
        environment: where.
        episodes: how many, from random states; None takes the evaluation states.
        recorded: how many if the environment has no evaluation states; None takes
            `FOREIGN_EPISODES`.
        max_steps: the most steps of an episode; None takes the limit.
        seed: of the states and the environment.

    Returns:
        What was found, and how: JSON types.
    """
    import numpy as np

    from acl_gym.cli.environments import default_steps
    from acl_gym.cli.learning import FOREIGN_EPISODES
    from acl_gym.envs.control.environments import ControlVectorEnv
    from acl_gym.evaluation import evaluate_policy_cost

    base = environment.vector(1, real_inputs=True).unwrapped
    states, count = None, episodes or recorded or FOREIGN_EPISODES
    if isinstance(base, ControlVectorEnv):
        states = base.system.evaluation_states()
        if episodes is not None:
            rng = np.random.default_rng(seed)
            states = base.system.sample_states(rng, episodes).T.copy()
        count = len(states)
    env = environment.vector(count, real_inputs=policy is not agent)
    if policy is agent:
        with bad_arguments():
            agent.set_env(env)
    max_steps = max_steps or default_steps(env)
    result = evaluate_policy_cost(
        policy,
        env,
        states,
        max_steps=max_steps,
        seed=seed,
        cost=getattr(agent, "cost", None),  # as in training
    )
    return result, {
        **environment.facts,
        "episodes": count,
        "max_steps": max_steps,
        "seed": seed,
    }


def figures(result: PolicyCost) -> dict[str, Any]:
    """The printed results of an evaluation, JSON types only."""
    import numpy as np

    return {
        "policy_cost": result.cost,
        "mean_return": result.mean_return,
        "success_rate": result.success_rate,
        "mean_length": float(result.lengths.mean()),
        "cost_min": float(result.costs.min()),
        "cost_median": float(np.median(result.costs)),
        "cost_max": float(result.costs.max()),
    }


def _print(settings: dict[str, Any], found: dict[str, Any], returns: bool) -> None:
    from rich.table import Table

    what, sign, low, high = "cost", 1.0, "min", "max"
    if returns:
        what, sign, low, high = "return", -1.0, "max", "min"
    table = Table(box=None, pad_edge=False, show_header=False)
    table.add_column(style="bold")
    table.add_column(justify="right")
    mean = found["mean_return"] if returns else found["policy_cost"]
    table.add_row("mean return" if returns else "policy cost", f"{mean:.4f}")
    if found["success_rate"] is not None:
        table.add_row("success", f"{found['success_rate']:.1%}")
    table.add_row("mean length", f"{found['mean_length']:.1f}")
    for name, key in (("min", low), ("median", "median"), ("max", high)):
        table.add_row(f"{what}, {name}", f"{sign * found[f'cost_{key}']:.4f}")
    screen = console()
    screen.print(
        f"{settings['env_id']}, {settings['episodes']} episodes of at most "
        f"{settings['max_steps']} steps",
        markup=False,
        highlight=False,
        soft_wrap=True,
    )
    screen.print(table)
    if "video" in settings:
        screen.print(f"Wrote {settings['video']}.", markup=False, soft_wrap=True)
