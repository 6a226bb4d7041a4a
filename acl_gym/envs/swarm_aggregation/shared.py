"""What the single and the vector environment share around the world."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from acl_gym.envs.control.bookkeeping import (
    checked_actions,
    checked_inputs,
    warn_of_no_render_mode,
)
from acl_gym.envs.control.rendering import Frame, Renderer
from acl_gym.envs.swarm_aggregation.system import SwarmAggregation
from acl_gym.envs.swarm_aggregation.world import World
from acl_gym.utils.boxes import input_bounds
from acl_gym.utils.typing import FloatArray

PAINTER = "acl_gym.envs.swarm_aggregation.painter:SwarmAggregationPainter"


def require_start(world: World) -> FloatArray:
    """The states of a world that has begun.

    Raises:
        ResetNeeded: it has not.
    """
    if world.states is None:
        raise ResetNeeded("the agents have no states yet; call reset() first.")
    return world.states


def inputs_of(actions: Any, count: int, system: SwarmAggregation) -> FloatArray:
    """The velocities or forces of actions, `(count, 2)`."""
    if system.continuous:
        low, high = input_bounds("actions", system.action_space)
        return checked_inputs(actions, count, low, high)
    numbers = checked_actions(actions, count, len(system.inputs))
    return np.asarray(system.inputs[numbers])


def checked_states(rows: NDArray[Any], world: World) -> FloatArray:
    """States that a reset was given, of the learners or of all agents."""
    if rows.shape[:1] not in ((world.learners,), (world.n,)):
        wanted = f"{world.learners} rows, one for each agent"
        if world.n > world.learners:
            wanted += (
                f" that takes actions, or {world.n}, one for each agent of the world"
            )
        raise ValueError(
            f"options['state'] must hold {wanted}, got shape {rows.shape}."
        )
    return world.system.checked_states(rows)


def rendered(
    mode: str | None, metadata: dict[str, Any], world: World, renderer: Renderer
) -> Frame | None:
    """Draw the world as the mode says."""
    if mode is None:
        warn_of_no_render_mode(metadata)
        return None
    require_start(world)
    if mode == "human":
        renderer.show(world.scene(), None)
        return None
    return renderer.frame(world.scene(), None)
