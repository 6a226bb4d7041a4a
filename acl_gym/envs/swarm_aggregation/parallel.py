"""The swarm as a `ParallelEnv` of PettingZoo, `pip install "acl-gym[pettingzoo]"`."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

from gymnasium import spaces
from gymnasium.error import ResetNeeded
from pettingzoo import ParallelEnv

from acl_gym.envs.control.bookkeeping import checked_options
from acl_gym.envs.swarm_aggregation.vector import SwarmAggregationVectorEnv
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray

_OF_VECTORS = {
    "num_envs": "num_agents",
    "max_episode_steps": "max_cycles",
    "autoreset_mode": "reset(), since nothing starts anew by itself",
}
"""Parameters of the vector environment, and what is in their place here."""

Each = dict[str, Any]
"""A value for each agent by its name."""


def parallel_env(num_agents: int = 10, **keywords: Any) -> SwarmAggregationParallelEnv:
    """Make the environment, as in the modules of PettingZoo; see the class."""
    return SwarmAggregationParallelEnv(num_agents, **keywords)


class SwarmAggregationParallelEnv(
    ParallelEnv[str, FloatArray, Any]  # type: ignore[misc]
):
    """A view of `SwarmAggregationVectorEnv`, in which agents have names.

    What agents observe and do, and what it costs, is described in `SwarmAggregationEnv`.
    All agents leave together, when the episode is truncated.

    Args:
        num_agents: how many agents take actions, >= 1.
        max_cycles: the episode is truncated after this many steps, >= 1.
        render_mode: "human", "rgb_array" or None.
        parameters: those of `SwarmAggregation`.

    Attributes:
        possible_agents: the names "agent_0", "agent_1" and so on.
        agents: those that are in the world, all or none.

    Example:
        >>> from acl_gym.envs.swarm_aggregation.parallel import parallel_env
        >>> env = parallel_env(num_agents=3)
        >>> observations, infos = env.reset(seed=0)
        >>> actions = {agent: env.action_space(agent).sample() for agent in env.agents}
        >>> _, rewards, *_ = env.step(actions)
        >>> sorted(rewards)
        ['agent_0', 'agent_1', 'agent_2']
    """

    metadata: dict[str, Any] = {  # noqa: RUF012
        "name": "swarm_aggregation_v0",
        "render_modes": ["human", "rgb_array"],
        "render_fps": SwarmAggregationVectorEnv.metadata["render_fps"],
        "is_parallelizable": True,
    }

    def __init__(
        self,
        num_agents: int = 10,
        *,
        max_cycles: int = 100,
        render_mode: str | None = None,
        **parameters: Any,
    ) -> None:
        for name, instead in _OF_VECTORS.items():
            if name in parameters:
                raise TypeError(
                    f"parallel_env has no parameter {name!r}; use {instead}."
                )
        self._env = SwarmAggregationVectorEnv(
            validation.integer("num_agents", num_agents, at_least=1),
            max_episode_steps=validation.integer("max_cycles", max_cycles, at_least=1),
            autoreset_mode="Disabled",
            render_mode=render_mode,
            **parameters,
        )
        self.render_mode = render_mode
        self.possible_agents = [f"agent_{i}" for i in range(self._env.num_envs)]
        self.agents: list[str] = []
        self._all = {
            flag: dict.fromkeys(self.possible_agents, flag) for flag in (False, True)
        }
        # Each agent has its own, because spaces hold random numbers.
        names, system = self.possible_agents, self._env.system
        self.observation_spaces = {
            agent: copy.copy(system.observation_space) for agent in names
        }
        self.action_spaces = {agent: copy.copy(system.action_space) for agent in names}

    def observation_space(self, agent: str) -> spaces.Box:
        """What an agent observes; always the same object."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Discrete | spaces.Box:
        """What an agent can do; always the same object."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, FloatArray], dict[str, dict[str, Any]]]:
        """Start an episode of all agents.

        Args:
            seed: seeds the generator of initial states; None continues its stream.
            options: `{"state": array}`, see `SwarmAggregationVectorEnv.reset`. Other
                keys are ignored, as PettingZoo has it.

        Returns:
            Observations and empty infos of all agents.

        Raises:
            ValueError: the seed or a state is not valid.
            TypeError: the seed is not an integer, or `options` is no dict.
        """
        if options is not None and not isinstance(options, dict):
            checked_options(options, ())  # says so
        kept = {key: value for key, value in (options or {}).items() if key == "state"}
        observations, _ = self._env.reset(seed=seed, options=kept)
        self.agents = self.possible_agents[:]
        return self._of_each(observations), {agent: {} for agent in self.agents}

    def step(
        self, actions: Mapping[str, Any]
    ) -> tuple[
        dict[str, FloatArray],
        dict[str, float],
        dict[str, bool],
        dict[str, bool],
        dict[str, dict[str, Any]],
    ]:
        """Move all agents for one time step.

        Args:
            actions: one for each of `agents`.

        Returns:
            Observations, rewards, terminations, truncations and infos of all agents.

        Raises:
            ResetNeeded: the episode has ended, or has not begun.
            ValueError: there is not one action for each agent, or one is not valid.
            TypeError: an action is of the wrong kind.
        """
        if not self.agents:
            raise ResetNeeded("no agents are in the world; call reset() first.")
        if not isinstance(actions, Mapping):
            raise TypeError(
                "actions must be a dict with one for each agent, such as "
                f"{{{self.agents[0]!r}: action}}, got {validation.shown(actions)}."
            )
        if actions.keys() != self._all[False].keys():
            raise ValueError(
                f"actions must hold one for each of {len(self.agents)} agents, "
                f"{self.agents[0]} to {self.agents[-1]}, got "
                f"{validation.shown(sorted(map(str, actions)))}."
            )
        rows = validation.as_array(list(map(actions.__getitem__, self.agents)))
        if rows is None:
            raise TypeError(
                "actions must be alike for all agents, elements of action_space(agent), "
                f"got {validation.shown(dict(actions))}."
            )
        observations, rewards, _, truncated, infos = self._env.step(rows)
        ends = bool(truncated[0])
        told = zip(
            self.agents,
            infos["distance"].tolist(),
            infos["collisions"].tolist(),
            strict=True,
        )
        results = (
            self._of_each(observations),
            self._of_each(rewards.tolist()),
            # Agents share an episode, which is truncated and never terminated. Copying
            # a dict takes a tenth of the time of making it.
            self._all[False].copy(),
            self._all[ends].copy(),
            {
                agent: {"distance": distance, "collisions": collisions}
                for agent, distance, collisions in told
            },
        )
        if ends:
            self.agents = []
        return results

    def state(self) -> FloatArray:
        """The states of all agents of the world, `(n, state_size)`."""
        return self._env.states

    def render(self) -> Any:
        """A frame `(480, 480, 3)` for "rgb_array"; shows it for "human"."""
        frames = self._env.render()
        return None if frames is None else frames[0]

    def close(self) -> None:
        """Close the window if there is one."""
        self._env.close()

    def _of_each(self, values: Any) -> Each:
        return dict(zip(self.agents, values, strict=True))
