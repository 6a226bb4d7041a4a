"""Which policies are drawn, and what they are called."""

from __future__ import annotations

from typing import Any

from acl_gym.experiments import statistics, wording

Comparison = dict[str, Any]
Run = dict[str, Any]


def median_runs(comparison: Comparison) -> list[Run]:
    """Of each method the run whose final cost is the median."""
    groups = statistics.by_agent(comparison["runs"]).values()
    return [statistics.median_run(own) for own in groups]


def run_title(run: Run) -> str:
    """Method, seed and cost of the last policy, in two lines."""
    cost = wording.cost(run["rows"][-1]["policy_cost"])
    return f"{run['label']} (seed {run['seed']})\ncost {cost}"


def reference_title(reference: dict[str, Any]) -> str:
    """What it is and its cost, in two lines."""
    cost = wording.cost(wording.reference_cost(reference))
    if "optimal_cost" in reference:
        return f"Optimum\nJ* = {cost}"
    return f"Best policy known\ncost {cost}"
