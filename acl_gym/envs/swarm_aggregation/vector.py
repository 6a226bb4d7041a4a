"""The vector environment of swarm aggregation: a slot is an agent, all in one world."""

from __future__ import annotations

import copy
from typing import Any, ClassVar

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike

from acl_gym.envs.autoreset import ChoosesAutoreset
from acl_gym.envs.control.bookkeeping import (
    checked_options,
    checked_render_mode,
    final_infos,
    made_system,
)
from acl_gym.envs.control.rendering import Frame, Renderer
from acl_gym.envs.limits import checked_limit, trial_limit
from acl_gym.envs.reset_mask import checked_reset_mask
from acl_gym.envs.swarm_aggregation.shared import (
    PAINTER,
    checked_states,
    inputs_of,
    rendered,
    require_start,
)
from acl_gym.envs.swarm_aggregation.system import SwarmAggregation
from acl_gym.envs.swarm_aggregation.world import Outcome, World
from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, FloatArray

StepResult = tuple[FloatArray, FloatArray, BoolArray, BoolArray, dict[str, Any]]


class SwarmAggregationVectorEnv(ChoosesAutoreset, VectorEnv[FloatArray, Any, Any]):
    """One world with an agent in each slot; see `SwarmAggregationEnv`.

    Unlike in other vector environments, slots are not copies of a task but the members
    of one swarm: what one does, the others see. So they share one episode. It is
    truncated for all of them in the same step, and starts anew for all of them:

    - "NextStep": the step after the last one ignores the actions and starts the next
      episode of all agents, with rewards of 0;
    - "SameStep": the last step starts it, and the last observations of all agents are in
      `infos["final_obs"]`;
    - "Disabled": the caller calls `reset()`, or `reset` with a mask of all slots.

    In the middle of an episode a mask of some slots puts only these agents elsewhere: the
    states of the others stay as they are to the last bit, as does the time. What the
    others observe may change, since they see the agents that were moved.

    Args:
        num_envs: number of agents that take actions, >= 1. No others are in the world,
            unless `followers` says so.
        max_episode_steps: the episode is truncated after this many steps; None or -1 sets
            no limit. `gym.make_vec` passes the limit of the id if it is left out.
        autoreset_mode: "NextStep", "SameStep" or "Disabled", see above.
        render_mode: "rgb_array" lets `render` return a frame for each slot, which is the
            same picture of the world for all; "human" shows it in a window; None draws
            nothing.
        parameters: those of `SwarmAggregation`.

    Note:
        One generator serves all agents in the order of their numbers. With the same seed,
        another number of slots gives other initial states.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012
        "render_modes": ["human", "rgb_array"],
        "render_fps": 20,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }
    system_type: ClassVar[type[SwarmAggregation]] = SwarmAggregation
    slots_share_a_world: ClassVar[bool] = True
    """Its slots cannot be taken apart, as the slots of other environments can."""

    def __init__(
        self,
        num_envs: int = 1,
        *,
        max_episode_steps: int | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        **parameters: Any,
    ) -> None:
        self.num_envs = validation.integer("num_envs", num_envs, at_least=1)
        self.max_episode_steps = checked_limit(max_episode_steps)
        self.set_autoreset_mode(autoreset_mode)
        self.render_mode = checked_render_mode(render_mode, self.metadata)
        self.parameters = copy.deepcopy(parameters)
        self.system = made_system(self.system_type, parameters)
        self._world = World(self.system, self.num_envs, 0, render_mode is not None)
        self.single_observation_space = self.system.observation_space
        self.single_action_space = self.system.action_space
        self.observation_space = batch_space(
            self.single_observation_space, self.num_envs
        )
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._renderer = Renderer(self.system, PAINTER, self.metadata["render_fps"])
        self._steps = 0
        self._ended = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[FloatArray, dict[str, Any]]:
        """Start an episode of all agents, or put some of them elsewhere.

        Args:
            seed: seeds the generator of initial states; None continues its stream.
            options: any of

                - `"state"`: array `(num_envs, state_size)`, sets the states of the agents
                  in the slots; `(n, state_size)` sets those of all n agents of the
                  world, followers last. Rows of agents outside the mask are ignored;
                - `"reset_mask"`: bool array `(num_envs,)`: only these agents are put
                  elsewhere, and the episode goes on, see the class. A mask of all
                  slots starts an episode.

        Returns:
            The observations of all slots, `(num_envs, ...)`, and empty infos.

        Raises:
            ValueError: the seed, a state, the mask or a key of `options` is not valid,
                or a mask leaves out slots although their episode has ended.
            TypeError: the seed is not an integer, or the mask is not a bool array.
            ResetNeeded: a mask was given before the first full reset.
        """
        seed = validation.seed(seed)
        options = checked_options(options, ("state", "reset_mask"))
        begun = self._world.states is not None
        mask = checked_reset_mask(options.get("reset_mask"), self.num_envs, begun=begun)
        if mask is None:
            mask = np.ones(self.num_envs, np.bool_)
        if self._ended and not mask.all():
            raise ValueError(
                "options['reset_mask'] must hold all slots where the episode has ended, "
                f"because they share it, got {int(mask.sum())} of {self.num_envs}; "
                "leave it out."
            )
        given = options.get("state")
        if given is not None:
            rows = validation.real_array("options['state']", given, finite=False)
            if not mask.all():
                self._fill_in(rows, mask)
            given = checked_states(rows, self._world)
        super().reset(seed=seed)
        if mask.all():
            self._begin(given)
        else:
            agents = np.flatnonzero(mask)
            chosen = None if given is None else given[agents]
            self._world.place(agents, self.np_random, chosen)
        if self.render_mode == "human":
            self.render()
        return self._world.observe(), {}

    def _fill_in(self, rows: FloatArray, mask: BoolArray) -> None:
        """Replace what was given for agents that are not reset, which may be anything."""
        present = self.states
        n, size = present.shape
        if rows.shape in ((self.num_envs, size), (n, size)):
            kept = np.ones(len(rows), np.bool_)
            kept[: self.num_envs] = ~mask
            rows[kept] = present[: len(rows)][kept]

    def step(self, actions: ArrayLike) -> StepResult:
        """Move all agents for one time step.

        Args:
            actions: numbers of actions, `(num_envs,)`; where actions are a Box,
                velocities or forces, `(num_envs, 2)`.

        Returns:
            `(observations, rewards, terminations, truncations, infos)`, new arrays. The
            infos hold `"distance"` and `"collisions"` of each slot, with "SameStep" at
            the end of an episode in `infos["final_info"]`.

        Raises:
            ResetNeeded: there was no reset yet, or autoreset is disabled and the episode
                has ended.
            ValueError: an action has the wrong shape, is out of range or not finite.
            TypeError: the actions are not numbers of the right kind.
        """
        require_start(self._world)
        inputs = inputs_of(actions, self.num_envs, self.system)
        n = self.num_envs
        if self._ended:
            if self.autoreset_mode is AutoresetMode.DISABLED:
                raise ResetNeeded(
                    "the episode of all slots has ended and autoreset is disabled; call "
                    "reset() before the next step."
                )
            self._begin(None)
            result: StepResult = (
                self._world.observe(),
                np.zeros(n),
                np.zeros(n, np.bool_),
                np.zeros(n, np.bool_),
                {},
            )
        else:
            result = self._moved(self._world.step(inputs))
        if self.render_mode == "human":
            self.render()
        return result

    def _moved(self, outcome: Outcome) -> StepResult:
        """What `step` returns of agents that have moved."""
        n = self.num_envs
        self._steps += 1
        limit = trial_limit(self.max_episode_steps, None)
        self._ended = 0 < limit <= self._steps
        infos: dict[str, Any] = {}
        for name, values in (
            ("distance", outcome.distance),
            ("collisions", outcome.collisions),
        ):
            infos |= {name: values, f"_{name}": np.ones(n, np.bool_)}
        observation = self._world.observe()
        truncated = np.full(n, self._ended)
        if self._ended and self.autoreset_mode is AutoresetMode.SAME_STEP:
            infos = final_infos(observation, truncated, infos)
            self._begin(None)
            observation = self._world.observe()
        return observation, outcome.rewards, np.zeros(n, np.bool_), truncated, infos

    def _begin(self, given: FloatArray | None) -> None:
        """Start an episode of all agents."""
        self._world.start(self.np_random, given)
        self._steps, self._ended = 0, False

    @property
    def states(self) -> FloatArray:
        """The states of all agents of the world, those of the slots first; a copy."""
        return require_start(self._world).copy()

    def render(self) -> tuple[Frame, ...] | None:
        """A frame `(480, 480, 3)` for each slot: all are the same picture of the world.

        Raises:
            ResetNeeded: there was no `reset` yet.
            DependencyNotInstalled: pygame is missing.
        """
        frame = rendered(self.render_mode, self.metadata, self._world, self._renderer)
        return None if frame is None else (frame,) * self.num_envs

    def close_extras(self, **_: Any) -> None:
        """Close the window if there is one."""
        self._renderer.close()
