"""The single environment of swarm aggregation: one agent learns among others."""

from __future__ import annotations

import copy
from typing import Any, ClassVar

import gymnasium as gym

from acl_gym.envs.control.bookkeeping import (
    checked_options,
    checked_render_mode,
    made_system,
)
from acl_gym.envs.control.rendering import Frame, Renderer
from acl_gym.envs.swarm_aggregation.shared import (
    PAINTER,
    checked_states,
    inputs_of,
    rendered,
    require_start,
)
from acl_gym.envs.swarm_aggregation.system import SwarmAggregation
from acl_gym.envs.swarm_aggregation.world import World
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray

COMPANY = 9
"""Followers around the agent of a single environment, unless another number is given."""


class SwarmAggregationEnv(gym.Env[Any, Any]):
    """Keep together with a swarm without running into anyone.

    ## Description
    Agents aggregate (§6.3.3 of the thesis, after Gazi and Passino): they must form a
    cohesive swarm without central control and without collisions, in a square world with
    walls. The agent of this environment is one of ten; the nine others, the
    `followers`, follow the potential rule (6.5), by which agents attract each other from
    afar and repel each other when they are near. In `gym.make_vec(id, num_envs=n)` all
    slots are agents of one and the same world, see `SwarmAggregationVectorEnv`.

    ## Action Space
    `Discrete(5)`, the velocity for one time step of 0.2 s.

    | Num | Velocity         |
    |-----|------------------|
    | 0   | none             |
    | 1   | 1 along x        |
    | 2   | 1 along y        |
    | 3   | 1 against x      |
    | 4   | 1 against y      |

    `directions=8` gives `Discrete(9)`, with directions at equal angles. With
    `continuous=True` the action is the velocity itself, `Box(-1, 1, (2,), float64)`;
    a velocity whose norm is larger than `max_speed` is shortened to it. With
    `point_mass=True` actions are forces up to `max_force` on bodies with inertia, held
    for a time step.

    ## Observation Space
    `Box` of shape `(6,)`, float64: what the agent knows of itself and hears of others.

    | Num | Observation                                          | Min | Max | Unit   |
    |-----|------------------------------------------------------|-----|-----|--------|
    | 0   | own position, x                                      | -5  | 5   | length |
    | 1   | own position, y                                      | -5  | 5   | length |
    | 2   | mean of the others' positions, relative to it, x     | -10 | 10  | length |
    | 3   | the same, y                                          | -10 | 10  | length |
    | 4   | position of the nearest other, relative to it, x     | -10 | 10  | length |
    | 5   | the same, y                                          | -10 | 10  | length |

    Three parameters change it. `point_mass=True` puts the own velocity behind the
    position. `sensing_radius=` makes agents hear only those that are closer; the share of
    the others that it hears, in [0, 1], then comes before their mean, and what it does
    not hear is 0. `nearest=` sets how many nearest others there are, one after the other.

    With `observe="potential"` the observation has two numbers only, after the velocity of
    a point mass: the velocity or force by which the potential rule would move the agent
    now. That is the mean of (6.5) over the agents it hears, minus the gradient of the
    profile and of the potential around obstacles. A small table is enough to learn from
    it.

    ## Rewards
    The reward is minus the stage cost of the state after the step,
    `distance_weight * d + collision_weight * k + profile_weight * (sigma - least)`. d is
    the distance of the agent from the centre, the mean position of all agents of the
    world. k is the number of other agents closer than `collision_distance`, 0.2, plus one
    if an obstacle has stopped the agent. sigma is the profile of `valleys` where the
    agent is, and `least` minus the sum of their depths; without valleys the term is 0.

    ## Starting State
    All agents at rest at positions that are uniform over the world without its obstacles.

    ## Episode End
    Never terminated; truncated after 100 steps, unless `max_episode_steps` sets another
    limit (-1: none). The infos of a step hold `"distance"`, d, and `"collisions"`, k; no
    success is reported, because it has no meaning here.

    ## Arguments
    Every parameter of `SwarmAggregation` is a keyword of `gym.make` and `gym.make_vec`.
    A state for `reset(options={"state": ...})` is the position of the agent, followed by
    its velocity with `point_mass=True`; or a row for each agent of the world.

    >>> import gymnasium as gym, acl_gym
    >>> env = gym.make("acl_gym/SwarmAggregation-v0", followers=2, nearest=0)
    >>> observation, info = env.reset(options={"state": [[0, 0], [1, 0], [0, 3]]})
    >>> observation.tolist()
    [0.0, 0.0, 0.5, 1.5]

    ## Version History
    - v0: first version.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012
        "render_modes": ["human", "rgb_array"],
        "render_fps": 20,
    }
    system_type: ClassVar[type[SwarmAggregation]] = SwarmAggregation

    def __init__(self, render_mode: str | None = None, **parameters: Any) -> None:
        self.render_mode = checked_render_mode(render_mode, self.metadata)
        self.parameters = copy.deepcopy(parameters)
        self.system = made_system(self.system_type, parameters)
        self.observation_space = self.system.observation_space
        self.action_space = self.system.action_space
        self._world = World(self.system, 1, COMPANY, render_mode is not None)
        self._renderer = Renderer(self.system, PAINTER, self.metadata["render_fps"])

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[FloatArray, dict[str, Any]]:
        """Start an episode.

        Args:
            seed: seeds the generator of initial states; None continues its stream.
            options: `{"state": array}` sets the agent's state, shape `(state_size,)`, or
                those of all agents of the world, `(1 + followers, state_size)`, the
                agent first. What is not set is drawn.

        Returns:
            The first observation, and an empty info.

        Raises:
            ValueError: the seed, a state or a key of `options` is not valid.
            TypeError: the seed is not an integer.
        """
        seed = validation.seed(seed)
        given = checked_options(options, ("state",)).get("state")
        if given is not None:
            rows = validation.real_array("options['state']", given, finite=False)
            given = checked_states(rows[None] if rows.ndim < 2 else rows, self._world)
        super().reset(seed=seed)
        self._world.start(self.np_random, given)
        if self.render_mode == "human":
            self.render()
        return self._world.observe()[0], {}

    def step(self, action: Any) -> tuple[FloatArray, float, bool, bool, dict[str, Any]]:
        """Move for one time step.

        Args:
            action: its number; where actions are a Box, the velocity or force `(2,)`.

        Returns:
            `(observation, reward, terminated, truncated, info)`; both flags are False.

        Raises:
            ResetNeeded: there was no `reset` yet.
            ValueError: `action` is not an action of this environment.
            TypeError: the action is not a number of the right kind.
        """
        require_start(self._world)
        outcome = self._world.step(inputs_of([action], 1, self.system))
        if self.render_mode == "human":
            self.render()
        info = {
            "distance": float(outcome.distance[0]),
            "collisions": int(outcome.collisions[0]),
        }
        observation = self._world.observe()[0]
        return observation, float(outcome.rewards[0]), False, False, info

    @property
    def states(self) -> FloatArray:
        """The states of all agents of the world, the one that learns first; a copy."""
        return require_start(self._world).copy()

    def render(self) -> Frame | None:
        """A frame `(480, 480, 3)` for "rgb_array"; shows it for "human".

        Raises:
            ResetNeeded: there was no `reset` yet.
            DependencyNotInstalled: pygame is missing.
        """
        return rendered(self.render_mode, self.metadata, self._world, self._renderer)

    def close(self) -> None:
        """Close the window if there is one."""
        self._renderer.close()
