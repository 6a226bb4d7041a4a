"""`acl-gym evaluate`: the cost of a saved policy."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from acl_gym.cli.common import (
    FOREIGN_EPISODES,
    BadArgumentError,
    DebugOption,
    JsonOption,
    bad_arguments,
    console,
    default_steps,
    load_agent,
    make_env,
    print_json,
)

if TYPE_CHECKING:
    from acl_gym.evaluation import PolicyCost

HELP = """Evaluate the policy of a saved agent.

The greedy policy is run without exploration. A file written by acl-gym train records
its environment and how it was evaluated; without options the evaluation is repeated and
gives the same cost. A file saved from Python needs --env-id.

\b
Examples:
  acl-gym evaluate pendulum.npz
  acl-gym evaluate pendulum.npz --episodes 1000 --seed 7     random initial states
  acl-gym evaluate swing_up.npz --env-id acl_gym/Pendulum-v0 --json
"""


def evaluate(
    file: Annotated[
        str, typer.Argument(metavar="FILE", help="A saved agent.", show_default=False)
    ],
    env_id: Annotated[
        str | None,
        typer.Option(
            metavar="ID",
            help="Evaluate in this environment.  [default: the one in the file]",
            show_default=False,
        ),
    ] = None,
    episodes: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="N",
            help="Number of episodes, from random initial states.  [default: the "
            "evaluation states of the environment, or "
            f"{FOREIGN_EPISODES} random ones if it has none]",
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
    as_json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Evaluate; see `HELP`."""
    from acl_gym.envs.control.environments import ControlVectorEnv
    from acl_gym.evaluation import evaluate_policy_cost

    agent = load_agent(file)
    known_id, env_args, how = _recorded_evaluation(agent.metadata)
    if env_id is not None and env_id != known_id:
        # Arguments and evaluation of another environment do not apply.
        known_id, env_args, how = env_id, {}, {}
    if known_id is None:
        raise BadArgumentError(
            f"{file} does not name its environment; add --env-id ID."
        )
    if seed is None:
        seed = how.get("seed", 0)
    with bad_arguments():
        env = make_env(known_id, 1, env_args)
        base = env.unwrapped
        states = None
        count = episodes or how.get("episodes") or FOREIGN_EPISODES
        if isinstance(base, ControlVectorEnv):
            states = base.system.evaluation_states()
            if episodes is not None:
                rng = np.random.default_rng(seed)
                states = base.system.sample_states(rng, episodes).T.copy()
            count = len(states)
        env = make_env(known_id, count, env_args)
        agent.set_env(env)
        if max_steps is None:
            max_steps = how.get("max_steps") or default_steps(env)
    result = evaluate_policy_cost(agent, env, states, max_steps=max_steps, seed=seed)
    settings = {
        "file": file,
        "env_id": known_id,
        "env_args": env_args,
        "episodes": count,
        "max_steps": max_steps,
        "seed": seed,
    }
    if as_json:
        print_json({**settings, **figures(result)})
    else:
        _print(settings, figures(result))


def figures(result: PolicyCost) -> dict[str, Any]:
    """The printed results of an evaluation, JSON types only."""
    return {
        "policy_cost": result.cost,
        "mean_return": result.mean_return,
        "success_rate": result.success_rate,
        "mean_length": float(result.lengths.mean()),
        "cost_min": float(result.costs.min()),
        "cost_median": float(np.median(result.costs)),
        "cost_max": float(result.costs.max()),
    }


def _recorded_evaluation(
    metadata: dict[str, Any],
) -> tuple[str | None, dict[str, Any], dict[str, Any]]:
    env_id = metadata.get("env_id")
    env_args = metadata.get("env_args", {})
    how = metadata.get("evaluation", {})
    sound = (
        (env_id is None or isinstance(env_id, str))
        and isinstance(env_args, dict)
        and isinstance(how, dict)
    )
    if not sound:
        raise BadArgumentError(
            "the file's metadata must hold env_id, env_args and evaluation as acl-gym "
            f"train writes them, got {metadata!r}."
        )
    return env_id, env_args, how


def _print(settings: dict[str, Any], found: dict[str, Any]) -> None:
    from rich.table import Table

    table = Table(box=None, pad_edge=False, show_header=False)
    table.add_column(style="bold")
    table.add_column(justify="right")
    table.add_row("policy cost", f"{found['policy_cost']:.4f}")
    table.add_row("mean return", f"{found['mean_return']:.4f}")
    if found["success_rate"] is not None:
        table.add_row("success", f"{found['success_rate']:.1%}")
    table.add_row("mean length", f"{found['mean_length']:.1f}")
    for name in ("min", "median", "max"):
        table.add_row(f"cost, {name}", f"{found[f'cost_{name}']:.4f}")
    target = console()
    target.print(
        f"{settings['env_id']}, {settings['episodes']} episodes of at most "
        f"{settings['max_steps']} steps",
        markup=False,
        highlight=False,
        soft_wrap=True,
    )
    target.print(table)
