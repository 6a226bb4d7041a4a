"""What a vector environment over a system is made of, and others made of it.

Its spaces, its parameters and its pictures are those of a `ControlSystem`. How its slots
move is in `environments`.
"""

from __future__ import annotations

import copy
import math
from typing import Any, ClassVar, Self

from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from acl_gym.envs.autoreset import ChoosesAutoreset
from acl_gym.envs.control.bookkeeping import checked_render_mode, made_system
from acl_gym.envs.control.rendering import Renderer
from acl_gym.envs.control.system import ControlSystem
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray

Observation = NDArray[Any]


class SystemVectorEnv(ChoosesAutoreset, VectorEnv[Observation, Any, NDArray[Any]]):
    """The base of vector environments over a control system.

    Args:
        num_envs: number of slots, >= 1.
        max_episode_steps: see `ControlVectorEnv`.
        autoreset_mode: see `ControlVectorEnv`.
        render_mode: see `ControlVectorEnv`.
        parameters: the parameters of the system, see its class.

    Raises:
        TypeError: the system has no parameter of such a name.
        ValueError: an argument or a parameter is not valid, or so many slots do not fit
            into memory.
    """

    max_episode_steps: int | None
    metadata: dict[str, Any] = {  # noqa: RUF012
        "render_modes": ["rgb_array"],
        "render_fps": 10,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }
    system_type: ClassVar[type[ControlSystem]]
    painter: ClassVar[str | None] = None
    """"module:class" of what draws the system, see `Renderer`; None draws nothing."""

    def __init__(
        self,
        num_envs: int = 1,
        *,
        max_episode_steps: int | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        **parameters: Any,
    ) -> None:
        self._num_envs = validation.integer("num_envs", num_envs, at_least=1)
        self.max_episode_steps = max_episode_steps
        self.set_autoreset_mode(autoreset_mode)
        self.render_mode = checked_render_mode(render_mode, self.metadata)
        self.parameters = copy.deepcopy(parameters)  # the caller may change a list
        self._system = made_system(self.system_type, parameters)
        self.single_observation_space = self.system.observation_space
        self.single_action_space = self.system.action_space
        self._check_memory()
        self.observation_space = batch_space(
            self.single_observation_space, self.num_envs
        )
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        fps = self.metadata["render_fps"]
        self._renderer = Renderer(self.system, self.painter, fps)

    def _check_memory(self) -> None:
        """Refuse more slots than fit into memory, before any is taken."""
        validation.check_memory(
            f"{self.num_envs:,} slots",
            self.num_envs * _least_bytes_a_slot(self.single_observation_space),
            "use fewer ants or slots",
        )

    # Not to be replaced: kernels rely on arrays of these sizes.
    @property
    def num_envs(self) -> int:  # type: ignore[override]
        """The number of slots."""
        return self._num_envs

    @property
    def system(self) -> ControlSystem:
        """The parameters and dynamics of the system."""
        return self._system

    def system_with(self, **values: Any) -> tuple[ControlSystem, dict[str, Any]]:
        """The system with other values of some parameters, and the arguments of it.

        Args:
            values: see `with_parameters`.

        Raises:
            TypeError: see `with_parameters`.
            ValueError: a value is not valid.
        """
        arguments = self._arguments_with(values)
        return made_system(self.system_type, arguments), arguments

    def set_system(self, system: ControlSystem, arguments: dict[str, Any]) -> None:
        """Go on with another system.

        Args:
            system: of `system_with`.
            arguments: its arguments.

        Raises:
            ValueError: what can be observed or done there differs.
        """
        for name in ("observation_space", "action_space"):
            own, other = (getattr(each, name) for each in (self._system, system))
            if own != other:
                raise ValueError(
                    f"the {name.replace('_', ' ')} must stay as it is, {own}, got "
                    f"{other}; let other parameters change."
                )
        self._system, self.parameters = system, arguments
        self._renderer.set_system(system)

    def show_table(self, table: FloatArray | None) -> None:
        """Draw a table over the frames from now on; see `ControlEnv.show_table`."""
        self._renderer.show_table(table)

    def with_slots(self, num_envs: int) -> Self:
        """Make a new environment that differs only in the number of slots.

        Its random numbers continue a copy of this environment's stream, if that was
        seeded.

        Args:
            num_envs: how many slots it has, >= 1.

        Raises:
            TypeError: `num_envs` is not an integer.
            ValueError: it is less than 1, or so many slots do not fit into memory.
        """
        return self._made_anew(num_envs, self.parameters)

    def with_parameters(self, **values: Any) -> Self:
        """Make a new environment in which some parameters of the system differ.

        Args:
            values: of the parameters by their names, see the class of the system; of a
                plant, those that its dynamics takes. A parameter that was uncertain is
                known there.

        Returns:
            An environment with the same number of slots, see `with_slots`.

        Raises:
            TypeError: there is no parameter of that name, or a value has a wrong type.
            ValueError: a value is not valid.
        """
        return self._made_anew(self.num_envs, self._arguments_with(values))

    def _arguments_with(self, values: dict[str, Any]) -> dict[str, Any]:
        """The arguments of the system if some of its parameters have other values."""
        return {**self.parameters, **values}

    def _made_anew(self, num_envs: int, parameters: dict[str, Any]) -> Self:
        made = self._constructed(
            num_envs,
            max_episode_steps=self.max_episode_steps,
            autoreset_mode=self.autoreset_mode,
            render_mode=self.render_mode,
            **parameters,
        )
        made._np_random = copy.deepcopy(self._np_random)
        made._np_random_seed = self._np_random_seed
        return made

    def _constructed(self, num_envs: int, **arguments: Any) -> Self:
        """Another environment of this class."""
        return type(self)(num_envs, **arguments)


def _least_bytes_a_slot(space: Any) -> int:
    """What a slot takes at least: its part of the batched spaces, state and results."""
    numbers = math.prod(space.shape)
    # Bounds, whether they are finite, and the observation; and the state.
    of_variables = numbers * (3 * space.dtype.itemsize + 2 + 8)
    # Action, its space (two numbers), steps, index and reward; three flags.
    return int(of_variables + 6 * 8 + 3)
