"""What `acl-gym train` says of learning: what was learned, or why it has ended."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from acl_gym.callbacks import Row
from acl_gym.cli.agents import AGENTS, name_of
from acl_gym.cli.common import console
from acl_gym.cli.errors import in_words
from acl_gym.cli.solutions import seeks_best, solution, solution_in_words
from acl_gym.colony.deposits import InverseCost
from acl_gym.evaluation import reports_returns


def how_to_go_on(learner: Any, begun: int, last: int, target: Path) -> str:
    """What to say where a signal has ended learning.

    Args:
        learner: the agent.
        begun: its trials before.
        last: those that were planned.
        target: its file.
    """
    if learner.trials == begun:
        return "interrupted before the first trial was complete; nothing is saved."
    return (
        f"interrupted; the agent is saved after trial {learner.trials} of {last}. To go "
        f"on: acl-gym train --resume {target}"
    )


def failed(error: Exception, learner: Any, begun: int, target: Path) -> Exception:
    """What to report where learning has failed.

    Args:
        error: what was raised.
        learner: the agent.
        begun: its trials before.
        target: its file.
    """
    words = in_words(error)
    deposit = getattr(learner, "deposit", None)
    if isinstance(deposit, InverseCost) and getattr(learner, "cost", None) is None:
        rollout = learner.rollout
        # Before the first walk there are none.
        back = getattr(rollout, "returned", None)
        costs = np.ones(1) if back is None else rollout.cost[back] + deposit.offset
        if (costs <= 0.0).any():
            remedy = "deposit=rank:5, or deposit=return if rewards are never negative"
            if AGENTS[name_of(learner)].seeks_best:
                remedy = "deposit=return if rewards are never negative"
            words = (
                "ants deposit 1 / cost, and costs must be > 0, but an ant has cost "
                f"{costs.min():g}: the rewards are not negative costs. Add --param "
                f"{remedy}."
            )
    if learner.trials > begun:
        words += (
            f" The agent is saved as it was after trial {learner.trials}, {target}."
        )
    return RuntimeError(words)


def _measures(row: dict[str, Any]) -> dict[str, Any]:
    """What an evaluation has found; None where it is not known."""
    names = ("policy_cost", "policy_return", "success_rate")
    return {name: row.get(name) for name in names}


def summary(
    learner: Any, cheapest: Row | None, target: Path, best: Path | None
) -> dict[str, Any]:
    """What was learned, JSON types.

    Args:
        learner: the agent.
        cheapest: the row of the best policy; None if none was saved.
        target: the file of the agent.
        best: the file of the best policy; None if none is written.
    """
    last = learner.history[-1]
    found = None
    if best is not None and cheapest is not None:
        found = {
            "file": str(best),
            "trial": cheapest["trial"],
            **_measures(cheapest),
        }
    return {
        **learner.metadata,
        "agent": name_of(learner),
        "partition": repr(learner.partition),
        "parameters": learner.parameters(),
        "trials": learner.trials,
        "env_steps": learner.num_timesteps,
        "seconds": learner.seconds,
        **({"solution": solution(learner)} if seeks_best(learner) else {}),
        **_measures(last),
        "file": str(target),
        "best": found,
        "rows": learner.history,
    }


def print_rows(
    learner: Any, cheapest: Row | None, target: Path, best: Path | None
) -> None:
    """Print the evaluations, and where the files are; see `summary`."""
    from rich.table import Table

    cost = getattr(learner, "cost", None)
    what = "return" if reports_returns(learner.rollout.env, cost) else "cost"
    rows = [row for row in learner.history if "policy_cost" in row]
    heads = ["trial", "steps", "seconds", f"ants' {what}", f"policy {what}"]
    known = any("success_rate" in row for row in rows)
    table = Table(box=None, pad_edge=False, header_style="bold")
    for head in [*heads, "success"][: 5 + known]:
        table.add_column(head, justify="right")
    for row in rows:
        cells = [
            f"{row['trial']}",
            f"{row['env_steps']:,}",
            f"{row['seconds']:.2f}",
            f"{row[f'ants_{what}']:.2f}",
            f"{row[f'policy_{what}']:.4f}",
            f"{row['success_rate']:.1%}" if "success_rate" in row else "",
        ]
        table.add_row(*cells[: 5 + known])
    screen = console()
    screen.print(table)
    lines = [f"Saved {target}. To evaluate it again: acl-gym evaluate {target}"]
    if best is not None and cheapest is not None:
        lines.append(
            f"The best policy, after trial {cheapest['trial']} with a {what} of "
            f"{cheapest[f'policy_{what}']:.4f}: {best}"
        )
    if seeks_best(learner):
        lines += solution_in_words(solution(learner))
    for line in lines:
        screen.print(line, markup=False, highlight=False, soft_wrap=True)
