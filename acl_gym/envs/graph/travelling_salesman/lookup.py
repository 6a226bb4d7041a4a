"""The travelling salesman behind a vector environment, however it was made."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from gymnasium import spaces
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv, VectorEnv

from acl_gym.envs import ENVIRONMENTS
from acl_gym.envs.graph.cities import TravellingSalesmanInstance
from acl_gym.envs.graph.travelling_salesman.env import TravellingSalesmanVectorEnv
from acl_gym.envs.graph.travelling_salesman.system import TravellingSalesman
from acl_gym.envs.wrappers.waiting import WaitingVectorEnv

_PLAIN = (SyncVectorEnv, AsyncVectorEnv, WaitingVectorEnv)
_MADE_BY = ENVIRONMENTS["acl_gym/TravellingSalesman-v0"].single


@dataclass(frozen=True)
class Salesman:
    """What is known of the tours through an environment.

    Attributes:
        instance: the cities, the same in all slots.
        start: "random", or the number of the city where every tour begins.
        is_plain: whether nothing is known that could change or watch a step, so that
            tours need not be walked: the environment of this package, or a vector of
            single ones as `gym.make` gives them, without wrappers of the user's.
    """

    instance: TravellingSalesmanInstance
    start: str | int
    is_plain: bool


def salesman_of(env: Any) -> Salesman | None:
    """The travelling salesman of a vector environment; None if it is another one.

    Args:
        env: `TravellingSalesmanVectorEnv`, or a `SyncVectorEnv`, `AsyncVectorEnv` or
            `WaitingVectorEnv` of single ones; wrappers are looked through.

    Raises:
        ValueError: slots hold different instances.
    """
    base = env.unwrapped if isinstance(env, VectorEnv) else None
    if isinstance(base, TravellingSalesmanVectorEnv):
        system: Any = base.system
        is_plain = type(env) is TravellingSalesmanVectorEnv
        return Salesman(base.instance, system.start, is_plain)
    systems = _systems(base)
    if not any(isinstance(each, TravellingSalesman) for each in systems):
        return None
    first = systems[0]
    for slot, each in enumerate(systems):
        if not (
            isinstance(each, TravellingSalesman) and each.instance == first.instance
        ):
            raise ValueError(
                "env must have the same instance in all slots, got "
                f"{_name(first)} in slot 0 and {_name(each)} in slot {slot}; ants share "
                "the pheromone on the arcs, so make an environment for each instance."
            )
    is_plain = (
        type(env) in _PLAIN
        and len({each.start for each in systems}) == 1
        and all(_is_as_made(spec, first.n_cities) for spec in _asked(base, "spec"))
    )
    return Salesman(first.cities, first.start, is_plain)


def _systems(base: Any) -> list[Any]:
    """What each slot of a vector of single environments calls its system."""
    if not isinstance(base, (SyncVectorEnv, AsyncVectorEnv)):
        return []
    seen, chosen = base.single_observation_space, base.single_action_space
    if not isinstance(seen, spaces.Discrete) or seen != chosen:
        return []
    if isinstance(base, AsyncVectorEnv):
        # A worker ends if it is asked for an attribute that it does not have, and the
        # environment ends with it.
        for name in ("system", "instance", "optimum"):
            if not all(base.call("has_wrapper_attr", name)):
                return []
    return _asked(base, "system")


def _asked(base: Any, name: str) -> list[Any]:
    """An attribute of each single environment, None where it has none."""
    if isinstance(base, SyncVectorEnv):
        inside = name == "system"
        return [getattr(e.unwrapped if inside else e, name, None) for e in base.envs]
    return list(base.get_attr(name))


def _is_as_made(spec: Any, n_cities: int) -> bool:
    """Whether a single environment is what `gym.make` gives, and lets tours end."""
    return (
        spec is not None
        and spec.entry_point == _MADE_BY
        and not spec.additional_wrappers
        and (spec.max_episode_steps is None or spec.max_episode_steps >= n_cities)
    )


def _name(system: Any) -> str:
    if isinstance(system, TravellingSalesman):
        return repr(system.cities.name)
    return "another environment"
