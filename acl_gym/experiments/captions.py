"""What stands beside the figures of a report: captions, and words for the blind.

Figures of policies differ from system to system, and so does what is said of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from acl_gym.experiments import statistics, wording

Comparison = dict[str, Any]

_COMMON = {
    "summary": (
        "Median over seeds and 95% interval. Left: policy cost, {reference} as a line. "
        "Middle and right: training until the first policy within a margin of "
        "{name}. An arrow says that the interval has no upper end, because some seeds "
        "never came so close; how many did stands at the margin."
    ),
    "learning_curves": (
        "Policy cost against environment steps and against wall-clock time; above, of "
        "the policy as it was at the time, below, of the best one until then. Line: "
        "median over seeds. Band: from the smallest to the largest. A policy counts "
        "from its evaluation to the next, the last one to the end. Costs beyond ten "
        "times {name} are cut off."
    ),
}
_OF_SYSTEM = {
    "pendulum": {
        "policy_maps": (
            "Torque that the policy chooses at each angle and angular velocity: the "
            "last policy of the seed whose final cost is the median, and the optimum."
        ),
        "trajectories": (
            "From hanging at rest, under the last policy of the seed whose final cost "
            "is the median, and under the optimum. A dot is the arrival at the goal, "
            "where an episode ends; π and −π are the same upright position. The time "
            "axis ends soon after the last arrival; how the others end, the legend "
            "says."
        ),
    },
    "navigation": {
        "policy_maps": (
            "Force that the policy chooses for a vehicle at rest at each position: the "
            "best policy known, and of each method the last policy of the seed whose "
            "final cost is the median."
        ),
        "trajectories": (
            "From the corners and the middles of the edges, at rest, under the best "
            "policy known and under the last policy of the seed whose final cost is "
            "the median. To arrive, the vehicle must be nearly at rest within the "
            "goal; a way that ends in a cross may lead there and hover."
        ),
    },
    "grid": {
        "policy_maps": (
            "Move that the policy makes in each cell, and what it costs until the "
            "goal: the optimum, and of each method the last policy of the seed whose "
            "final cost is the median. A best action is one of an optimal policy; "
            "another may cost more from its cell on, even if few steps."
        ),
    },
}


def caption(name: str, comparison: Comparison) -> str:
    """The caption of a figure."""
    texts = {**_COMMON, **_OF_SYSTEM[comparison["pictures"]]}
    reference_ = comparison["reference"]
    is_optimum = "optimal_cost" in reference_
    return texts.get(name, name).format(
        name=wording.the_reference(reference_),
        reference="the optimum J*" if is_optimum else "the best known cost",
    )


def reference(found: dict[str, Any]) -> str:
    """What the policies are held against, in a sentence or two."""
    cost = wording.cost(wording.reference_cost(found))
    if "cells" not in found:
        return f"The optimum J* = {cost} is exact, by {found['method']} on the model."
    cells = " × ".join(map(str, found["cells"]))
    how = f"found by {found['method']}, which knows the model, on {cells} cells"
    if "optimal_cost" in found:
        return f"The optimum is taken to be J* = {cost}, {how}."
    return (
        f"The optimum is not known. The best known cost is {cost}, {how}; an optimal "
        "policy may cost less."
    )


def alternative(
    name: str, comparison: Comparison, summary: Sequence[statistics.Entry]
) -> str:
    """What a figure shows, in words, for those who do not see it."""
    labels = wording.listed(
        [wording.in_a_sentence(entry["label"]) for entry in summary]
    )
    costs = "; ".join(
        f"{wording.in_a_sentence(entry['label'])} "
        f"{wording.cost(entry['final_policy_cost']['median'])} at the end, "
        f"{wording.cost(entry['best_policy_cost']['median'])} at best"
        for entry in summary
    )
    held_against = wording.the_reference(comparison["reference"])
    if name == "summary":
        return (
            "Dot plot with a row for each method: policy cost, and time and "
            f"environment steps to come close to {held_against}. Median policy cost: "
            f"{costs}."
        )
    if name == "learning_curves":
        return (
            "Four panels of policy cost, both axes logarithmic, against environment "
            "steps and seconds, for the policy at the time and for the best so far. "
            f"Median policy cost: {costs}."
        )
    if name == "policy_maps":
        return f"{_MAPS[comparison['pictures']]} {labels}."
    if name == "trajectories":
        return f"{_WAYS[comparison['pictures']]}: {_endings(comparison)}."
    return f"Figure {name}."


_MAPS = {
    "pendulum": (
        "Pictures of the torque chosen over angle and angular velocity, for the "
        "optimum and for the last policy of"
    ),
    "navigation": (
        "Arrows of the force chosen at each position, over the damping, for the best "
        "policy known and for the last policy of"
    ),
    "grid": (
        "Maps with an arrow in each cell for the move chosen there, for the optimum "
        "and for the last policy of"
    ),
}
_WAYS = {
    "pendulum": (
        "Angle, angular velocity, torque and cost so far against time, from hanging at "
        "rest"
    ),
    "navigation": "Ways over the plane from its corners and edges",
}


def _endings(comparison: Comparison) -> str:
    """How the trajectories of each method's median run end."""
    groups = statistics.by_agent(comparison["runs"]).values()
    texts = []
    for run in map(statistics.median_run, groups):
        picture = run["picture"]
        paths = picture.get("trajectories") or [picture["trajectory"]]
        label = wording.in_a_sentence(run["label"])
        if len(paths) > 1:
            arrived = sum(path["reached"] for path in paths)
            texts.append(f"{label} arrives {arrived} of {len(paths)} times")
        else:
            verb = "reaches" if paths[0]["reached"] else "does not reach"
            cost = wording.cost(paths[0]["cost"][-1])
            texts.append(f"{label} {verb} the goal, cost {cost}")
    return "; ".join(texts)
