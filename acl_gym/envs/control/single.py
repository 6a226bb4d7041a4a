"""The single environment over a control system."""

from __future__ import annotations

import copy
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from acl_gym.envs.control.bookkeeping import (
    checked_actions,
    checked_inputs,
    checked_options,
    checked_render_mode,
    draw_uniforms,
    drawn_action,
    made_system,
    n_actions_of,
    real_input_bounds,
    warn_of_no_render_mode,
)
from acl_gym.envs.control.rendering import Frame, Renderer
from acl_gym.envs.control.system import ControlSystem
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray


class ControlEnv(gym.Env[NDArray[Any], Any]):
    """The single environment over a control system.

    It has no time limit of its own: `gym.make(id)` adds the one registered with the id,
    `gym.make(id, max_episode_steps=T)` another, `max_episode_steps=-1` none.

    Args:
        render_mode: "human" shows a window, "rgb_array" lets `render` return frames,
            None draws nothing.
        parameters: the parameters of the system, see its class.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012
        "render_modes": ["human", "rgb_array"],
        "render_fps": 10,
    }
    system_type: ClassVar[type[ControlSystem]]
    painter: ClassVar[str | None] = None
    """"module:class" of what draws the system, see `Renderer`; None draws nothing."""

    def __init__(self, render_mode: str | None = None, **parameters: Any) -> None:
        self.render_mode = checked_render_mode(render_mode, self.metadata)
        self.parameters = copy.deepcopy(parameters)  # the caller may change a list
        self.system = made_system(self.system_type, parameters)
        self.observation_space = self.system.observation_space
        self.action_space = self.system.action_space
        self._input_bounds = real_input_bounds(self.system)
        self._n_actions = n_actions_of(self.system)
        fps = self.metadata["render_fps"]
        self._renderer = Renderer(self.system, self.painter, fps)
        self._state: FloatArray | None = None
        self._finished = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[Any], dict[str, Any]]:
        """Start an episode.

        Args:
            seed: seeds the generator of initial states; None continues its stream.
            options: `{"state": array}`, shape `(state_size,)`, sets the state
                instead of drawing it; a state of one variable may be a number. Any
                state of the system is allowed, also a goal: the episode then ends
                when a step leads to a goal.

        Returns:
            The first observation and the info: empty, or `"action_mask"`, a bool
            array `(n_actions,)`, if not all actions are always available.

        Raises:
            ValueError: the seed, the state or a key of `options` is not valid.
            TypeError: the seed is not an integer.
        """
        seed = validation.seed(seed)
        options = checked_options(options, ("state",))
        given = options.get("state")
        state = None
        if given is not None:
            row = validation.real_array("options['state']", given, finite=False)
            state = self.system.checked_states(row[None]).T.copy()
        super().reset(seed=seed)
        if state is None:
            state = self.system.sample_states(self.np_random, 1)
        self._state = state
        self._finished = False
        self._action: int | FloatArray | None = None
        if self.render_mode == "human":
            self.render()
        return self.system.observe(state)[0], self._info(state)

    def step(
        self, action: Any
    ) -> tuple[NDArray[Any], float, bool, bool, dict[str, Any]]:
        """Apply an action for one sampling time.

        Args:
            action: its number; where the actions are a Box, the inputs `(n_inputs,)`,
                set to its bounds where they are beyond.

        Returns:
            `(observation, reward, terminated, truncated, info)` with reward
            = -(stage cost), `terminated` once the goal is reached or the system says
            that the episode has failed, and the info that `reset` describes with
            `"is_success"`, whether this step reached the goal.

        Raises:
            ResetNeeded: there was no `reset` yet, or the episode is over.
            ValueError: `action` is not an action of this environment.
        """
        if self._state is None or self._finished:
            raise ResetNeeded(
                "step() needs a running episode, but this one "
                + ("has not begun" if self._state is None else "is over")
                + "; call reset() first."
            )
        actions: NDArray[Any]
        if self._input_bounds is not None:
            actions = checked_inputs([action], 1, *self._input_bounds)
        else:
            actions = checked_actions([action], 1, self._n_actions)
        rewards, reached = np.empty(1), np.empty(1, dtype=np.bool_)
        uniforms = draw_uniforms(self.system, self, 1)
        failed = self.system.advance(self._state, actions, uniforms, rewards, reached)
        success = bool(reached[0])
        self._finished = success or (failed is not None and bool(failed[0]))
        self._action = drawn_action(actions[0])
        if self.render_mode == "human":
            self.render()
        observation = self.system.observe(self._state)[0]
        # In every step: whether it is the last, only a wrapper with a limit knows.
        info = {**self._info(self._state), "is_success": success}
        return observation, float(rewards[0]), self._finished, False, info

    def render(self) -> Frame | None:
        """A frame `(480, 480, 3)` for "rgb_array"; shows it for "human".

        Raises:
            ResetNeeded: there was no `reset` yet.
            DependencyNotInstalled: pygame is missing.
        """
        if self.render_mode is None:
            warn_of_no_render_mode(self.metadata)
            return None
        if self._state is None:
            raise ResetNeeded("render() needs a state; call reset() first.")
        state = self._state[:, 0]
        if self.render_mode == "human":
            self._renderer.show(state, self._action)
            return None
        return self._renderer.frame(state, self._action)

    def show_table(self, table: FloatArray | None) -> None:
        """Draw a table of (state, action) values over the frames from now on.

        Args:
            table: `(n_states, n_actions)`, such as the pheromone of a colony. The
                array is kept, not copied, so that frames follow it as it changes;
                None draws no table from now on.

        Raises:
            ValueError: the system draws no tables, or the table does not fit it.
            TypeError: it is not a NumPy array.
        """
        self._renderer.show_table(table)

    def close(self) -> None:
        """Close the window if there is one."""
        self._renderer.close()

    def _info(self, state: FloatArray) -> dict[str, Any]:
        mask = self.system.action_mask(state)
        return {} if mask is None else {"action_mask": mask[0]}
