"""The best solutions of ants, as the commands print them."""

from __future__ import annotations

from typing import Any

from acl_gym.cli.agents import AGENTS, name_of

SHOWN_CITIES = 12
"""Of a tour so many cities are printed; JSON has all."""


def seeks_best(learner: Any) -> bool:
    """Whether an agent looks for one best solution."""
    return AGENTS[name_of(learner)].seeks_best


def solution(learner: Any) -> dict[str, Any] | None:
    """The best solution that ants have ever found, JSON types only; None before.

    Its `cost` and `steps`, and on the travelling salesman problem the `tour`, a list of
    cities. It is not what the policy does, to which other figures belong.
    """
    found = learner.best_solution
    if found is None:
        return None
    result = {"cost": learner.best_cost, "steps": len(found)}
    if learner.instance is not None:
        result["tour"] = learner.best_tour.tolist()
    return result


def solution_in_words(found: dict[str, Any] | None) -> list[str]:
    """Lines about what `solution` gave."""
    if found is None:
        return ["No ant has completed a solution."]
    lines = [
        f"The best solution of all ants: {found['steps']} steps, a cost of "
        f"{found['cost']:.6g}."
    ]
    if tour := found.get("tour"):
        shown = ", ".join(map(str, tour[:SHOWN_CITIES]))
        rest = len(tour) - SHOWN_CITIES
        more = f", ... and {rest} more (--json gives all)" if rest > 0 else ""
        lines.append(f"Its tour: {shown}{more}")
    return lines
