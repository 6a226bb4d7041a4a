"""The colony that learns in a model of a plant where the caller names none."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from acl_gym.agents.returning import ReturningACL
from acl_gym.envs.learned import LearnedVectorEnv
from acl_gym.envs.learned.system import LearnedSystem
from acl_gym.partitions.around_goal import partition_around_goal
from acl_gym.partitions.grid import Fuzzy


def default_agent(
    seed: int | None, **settings: Any
) -> Callable[[LearnedVectorEnv], ReturningACL]:
    """What learns in a model if nothing else is said.

    Args:
        seed: of the agent.
        **settings: parameters that are to differ.
    """
    # Steps in a model are cheap: fewer walks back make more of them in the same time.
    chosen: dict[str, Any] = {"walks_back": 10, **settings}

    def make(model: Any) -> ReturningACL:
        own = dict(chosen)
        if own.get("partition") is None:
            own["partition"] = cells_of_goal(model)
        return ReturningACL(model, seed=seed, **own)

    return make


def cells_of_goal(model: Any) -> Fuzzy | None:
    """Cells for the goal of a model, where a grid that grows would be too coarse."""
    system = getattr(model, "system", None)
    if not isinstance(system, LearnedSystem) or system.goal_box is None:
        return None
    known = system.dynamics.description
    if known.circular or known.shown_angles.pairs:
        return None  # what is observed are not the variables of the goal
    return partition_around_goal(system.low, system.high, *system.goal_box)
