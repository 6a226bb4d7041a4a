"""What `acl-gym train` says of a model that was learned, and of its policy."""

from __future__ import annotations

from typing import Any

import numpy as np

from acl_gym.cli.common import console
from acl_gym.cli.model_words import model_in_words
from acl_gym.colony.episodes import Episode
from acl_gym.envs.control.lookup import system_of
from acl_gym.envs.learned import LearnedVectorEnv
from acl_gym.envs.learned.quality import UNSURE
from acl_gym.evaluation import evaluate_policy_cost
from acl_gym.model_based import PlantLearning
from acl_gym.utils.typing import FloatArray


def facts_of_model(learned: PlantLearning, plant: Any) -> dict[str, Any]:
    """How well the model predicts what it has not seen, and where it is not sure."""
    model = learned.model
    spread = spread_of_paths(learned, plant)
    cost, goal = model.learned_cost, model.learned_goal
    return {
        "regressor": model.dynamics.regressor,
        "errors": model.dynamics.errors,
        "spread_median": float(np.median(spread)),
        "spread_highest": float(spread.max()),
        "unsure": float((spread > UNSURE).mean()),
        "learned_cost_error": None if cost is None else cost.error,
        "learned_goal_recall": None if goal is None else goal.recall,
    }


def spread_of_paths(learned: PlantLearning, plant: Any) -> FloatArray:
    """The largest spread on the path of the policy from each start, in the model.

    Args:
        learned: the policy and its model.
        plant: its evaluation states are the starts if it has some with the variables of
            the model; otherwise those of the model are.
    """
    model: LearnedVectorEnv = learned.model
    system, states = system_of(plant), None
    if (
        system is not None
        and system.observation_space == model.system.observation_space
    ):
        states = system.evaluation_states()

    def largest(episode: Episode) -> float:
        variables = model.system.variables(episode.observations[:-1])
        return float(model.spread(variables, episode.actions).max())

    found = evaluate_policy_cost(learned.policy, model, states, cost=largest)
    return found.costs


def print_found(facts: dict[str, Any]) -> None:
    """What was learned, from what, and how sure that is."""
    from rich.table import Table

    screen = console()
    table = Table(box=None, pad_edge=False, header_style="bold")
    heads = ("interactions", "seconds", "model error", "cost in the model")
    for head in heads:
        table.add_column(head, justify="right")
    for row in facts["rows"]:
        table.add_row(
            f"{row['interactions']:,}",
            f"{row['seconds']:.2f}",
            f"{row['model_error']:.3f}",
            f"{row['model_cost']:.4f}",
        )
    screen.print(table)
    model, best = facts["model"], facts["best"]
    lines = model_in_words(
        model["regressor"],
        facts["recorded_steps"],
        model["errors"],
        median=model["spread_median"],
        highest=model["spread_highest"],
        limit=UNSURE,
        unsure=model["unsure"],
    )
    if model["learned_cost_error"] is not None:
        lines.append(
            "The cost was learned from rewards, with an error of "
            f"{model['learned_cost_error']:.3f}."
        )
    if model["learned_goal_recall"] is not None:
        lines.append(
            "The goal was learned from terminations, of which it finds "
            f"{model['learned_goal_recall']:.0%}."
        )
    lines.append(f"In {facts['env_id']} the best policy has {_measures(best)}.")
    lines.append(
        f"Saved {facts['file']} and {best['file']}. To evaluate it again: acl-gym "
        f"evaluate {best['file']}"
    )
    if facts["plant"] is not None:
        lines.append(
            f"Every step is in {facts['plant']}; the same command with more "
            "--interactions and --out goes on from there."
        )
    for line in lines:
        screen.print(line, markup=False, highlight=False, soft_wrap=True)


def _measures(found: dict[str, Any]) -> str:
    if "policy_return" in found:
        words = f"a mean return of {found['policy_return']:.4f}"
    else:
        words = f"a cost of {found['policy_cost']:.4f}"
    known = found.get("success_rate")
    return words if known is None else f"{words} and reaches the goal from {known:.1%}"
