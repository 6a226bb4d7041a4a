"""The environment that a command works on: by id, arguments and bins of its actions."""

from __future__ import annotations

import inspect
import math
import os
import re
import sys
from dataclasses import dataclass, field, fields, is_dataclass, replace
from difflib import get_close_matches
from importlib import import_module
from typing import TYPE_CHECKING, Any

import gymnasium as gym
from gymnasium import spaces
from gymnasium.envs.registration import load_env_creator

from acl_gym.cli.errors import BadArgumentError, bad_arguments
from acl_gym.cli.numbering import counts_of, discretized, gridded
from acl_gym.envs import ENVIRONMENTS
from acl_gym.utils.vector_envs import has_independent_slots

if TYPE_CHECKING:
    from gymnasium.vector import VectorEnv

_OWN_KEYWORDS = (
    "disable_env_checker",
    "entry_point",
    "env_id",
    "num_envs",
    "render_mode",
    "vector_kwargs",
    "vectorization_mode",
    "wrappers",
)
"""Keywords of `gym.make` that are no parameters of the environment."""

_IMPORTS = re.compile(r"[A-Za-z_][\w.]*:[A-Za-z_][\w./-]*")
"""A text that says "module:name", which some environments import."""


@dataclass(frozen=True)
class Environment:
    """An environment as the user chose it, or as an agent's file names it.

    Attributes:
        env_id: a registered id, or `module:id`.
        arguments: keywords of the environment, plain values.
        bins: into how many actions each dimension of a Box is divided, one number for
            all or one for each; None leaves the actions as they are.
        end_to_end: whether these reach from one end of the range to the other, as in an
            `ActionGrid`. Otherwise they are the middles of equal parts.
    """

    env_id: str
    arguments: dict[str, Any] = field(default_factory=dict)
    bins: tuple[int, ...] | None = None
    end_to_end: bool = False

    @property
    def name(self) -> str:
        """The id without the module."""
        return self.env_id.rpartition(":")[2]

    @property
    def module(self) -> str:
        """The module that registers the id; "" if none is named."""
        return self.env_id.rpartition(":")[0]

    @property
    def is_own(self) -> bool:
        """Whether it is of this package."""
        return self.name in ENVIRONMENTS

    def check_id(self) -> None:
        """Check that there is such an id, without importing anything.

        Ids of modules that are still to be imported are not checked.

        Raises:
            BadArgumentError: there is no such id.
        """
        if not self.module and self.name not in gym.registry:
            raise BadArgumentError(_unknown(self.name))

    def import_module(self) -> None:
        """Import the module of the id, which may be in the working directory.

        Only for an id that the user has typed, never for one that a file names.

        Raises:
            BadArgumentError: it cannot be imported.
        """
        if not self.module:
            return
        if os.getcwd() not in sys.path:
            sys.path.insert(0, os.getcwd())
        with bad_arguments():
            import_module(self.module)
        if self.name not in gym.registry:
            raise BadArgumentError(
                f"{self.module} was imported, but registers no {self.name!r}."
            )

    def with_real_inputs(self) -> Environment:
        """The same without numbered actions, for a policy that sets real inputs.

        Raises:
            BadArgumentError: its actions were not numbered by `bins`.
        """
        if self.bins is None:
            raise BadArgumentError(
                f"--interpolate is for agents that were trained with --discretize, but "
                f"{self.name} was not; leave it out, or train with --discretize 5."
            )
        return self._plain()

    def has_real_inputs(self) -> bool:
        """Whether its own actions are a Box."""
        space = self._plain().vector(1, real_inputs=True).single_action_space
        return isinstance(space, spaces.Box)

    def from_end_to_end(self, values: int) -> Environment:
        """The same with so many values of each real input, both ends included."""
        return replace(self, bins=(values,), end_to_end=True)

    def _plain(self) -> Environment:
        """The same with its own actions."""
        return replace(self, bins=None, end_to_end=False)

    @property
    def facts(self) -> dict[str, Any]:
        """What a file says about it, JSON types; see `from_metadata`."""
        bins = None if self.bins is None else list(self.bins)
        found = {
            "env_id": self.env_id,
            "env_args": self.arguments,
            "discretize": bins,
        }
        return {**found, "end_to_end": True} if self.end_to_end else found

    def vector(self, slots: int, real_inputs: bool = False) -> VectorEnv[Any, Any, Any]:
        """Make it with some slots; one of this package natively.

        Where the slots of a native environment would share a world, how many there are
        would be a part of the task. Then each slot has a single environment of its own.

        Args:
            slots: how many.
            real_inputs: whether its actions may be a Box.

        Raises:
            BadArgumentError: it cannot be made with these arguments, or its actions are
                not those of `bins`.
        """
        from acl_gym.envs.wrappers.action_grid import ActionGrid
        from acl_gym.envs.wrappers.waiting import WaitingVectorEnv

        self.check_id()
        self._check_arguments()
        env: VectorEnv[Any, Any, Any]
        with bad_arguments():
            if self.end_to_end and self.bins is not None:
                plain = self._plain().vector(slots, real_inputs=True)
                env = ActionGrid(plain, counts_of(self.bins))
            elif self.bins is None and has_independent_slots(self.name):
                env = gym.make_vec(self.name, num_envs=slots, **self.arguments)
            else:
                env = WaitingVectorEnv([self.single] * slots)
            if not (real_inputs and isinstance(env.single_action_space, spaces.Box)):
                self._check_actions(env.single_action_space)
        return env

    def single(self, render_mode: str | None = None) -> gym.Env[Any, Any]:
        """Make one that can be rendered."""
        keywords = dict(self.arguments)
        if render_mode is not None:
            keywords["render_mode"] = render_mode
        env = gym.make(self.name, **keywords)
        if self.bins is None:
            return env
        if self.end_to_end:
            return gridded(env, self.bins)
        return discretized(self.name, env, self.bins)

    def _check_arguments(self) -> None:
        for name in self.arguments:
            if name in _OWN_KEYWORDS:
                raise BadArgumentError(
                    f"{name} is no parameter of {self.name}; leave out --env-arg {name}."
                )
        if not self.is_own:
            self._check_switches()
        if not self.arguments or not self.is_own:
            return
        # A system of this package says which parameters it has.
        with bad_arguments():
            plain: Any = gym.make_vec(self.name, num_envs=1)
            system = plain.unwrapped.system_type
            plain.close()
        if not is_dataclass(system):
            return
        names = [*(each.name for each in fields(system)), "max_episode_steps"]
        for name in self.arguments:
            if name not in names:
                raise BadArgumentError(
                    f"{self.name} has no parameter {name!r}; choose from "
                    f"{', '.join(names)}."
                )

    def _check_switches(self) -> None:
        """Refuse a text where the environment has True or False: it would be true."""
        with bad_arguments():
            entry_point: Any = gym.registry[self.name].entry_point
            if self.arguments and isinstance(entry_point, str):
                entry_point = load_env_creator(entry_point)
        if not self.arguments or not callable(entry_point):
            return
        known = inspect.signature(entry_point).parameters
        for name, value in self.arguments.items():
            is_switch = name in known and isinstance(known[name].default, bool)
            if is_switch and not isinstance(value, (bool, int)):
                raise BadArgumentError(
                    f"--env-arg {name} must be true or false, got {value!r}."
                )

    def _check_actions(self, space: spaces.Space[Any]) -> None:
        if isinstance(space, spaces.Box):
            twin = _twin(self.name)
            hint = f"; {twin} of this package has discrete ones" if twin else ""
            count = math.prod(space.shape)
            of_each = f" of each of its {count} dimensions" if count > 1 else ""
            raise BadArgumentError(
                f"{self.name} must have Discrete actions, but has continuous ones, "
                f"{space}; add --discretize 5 for five values{of_each} "
                f"(gymnasium.wrappers.DiscretizeAction){hint}."
            )
        if not isinstance(space, spaces.Discrete):
            raise BadArgumentError(
                f"{self.name} must have Discrete actions, got {space}; give it a wrapper "
                "that numbers its actions, in a module of your own."
            )


def default_steps(env: VectorEnv[Any, Any, Any]) -> int:
    """T: the limit of the environment, or 300 if it has none."""
    from acl_gym.envs.control.environments import ControlVectorEnv
    from acl_gym.envs.limits import usual_max_steps

    base = env.unwrapped
    if isinstance(base, ControlVectorEnv):
        return base.system.evaluation_steps
    return usual_max_steps(env)


def from_metadata(file: str, metadata: dict[str, Any]) -> Environment | None:
    """The environment that a file names; None if it names none.

    A file may come from anywhere. So it may name what is registered, with plain values;
    a module is imported only if the user types it.

    Args:
        file: its name, for messages.
        metadata: of the agent.

    Raises:
        BadArgumentError: the metadata are not those that `acl-gym train` writes.
    """
    env_id = metadata.get("env_id")
    if env_id is None:
        return None
    arguments = metadata.get("env_args", {})
    bins = metadata.get("discretize")
    end_to_end = metadata.get("end_to_end", False)
    sound = (
        isinstance(env_id, str)
        and isinstance(arguments, dict)
        and all(map(_is_plain, arguments.values()))
        and (
            bins is None
            or (isinstance(bins, list) and all(type(each) is int for each in bins))
        )
        and type(end_to_end) is bool
    )
    if not sound:
        raise BadArgumentError(
            f"the metadata of {file} must hold env_id, env_args and discretize as "
            f"acl-gym train writes them, got {repr(metadata)[:200]}."
        )
    return Environment(
        env_id, arguments, None if bins is None else tuple(bins), end_to_end
    )


def check_named_by_file(file: str, found: Environment, option: str) -> None:
    """Check that an environment can be made without importing what a file names.

    Args:
        file: the file, for messages.
        found: what it names.
        option: how the user can name it, such as "--env-id".

    Raises:
        BadArgumentError: the id is not registered, or an argument may name a module.
    """
    if found.name not in gym.registry:
        typed = f"{option} {found.env_id if found.module else 'MODULE:' + found.name}"
        raise BadArgumentError(
            f"{file} names the environment {found.env_id!r}, which is not registered; a "
            "module is not imported because a file says so. If you trust it, name it "
            f"yourself: add {typed.strip()}."
        )
    for name, value in found.arguments.items():
        if isinstance(value, str) and _IMPORTS.fullmatch(value):
            raise BadArgumentError(
                f"{file} sets {name}={value!r}, which may name a module; it is not "
                "imported because a file says so. If you trust it, add --env-arg "
                f"{name}={value}."
            )


def _is_plain(value: Any, depth: int = 0) -> bool:
    """Whether a value is a number, a text, None, or a list or dict of such."""
    if isinstance(value, dict):
        keys = all(isinstance(key, str) for key in value)
        return (
            keys and depth < 20 and all(_is_plain(v, depth + 1) for v in value.values())
        )
    if isinstance(value, list):
        return depth < 20 and all(_is_plain(each, depth + 1) for each in value)
    return value is None or isinstance(value, (bool, int, float, str))


def _stem(env_id: str) -> str:
    return env_id.rpartition("/")[2].rpartition("-v")[0] or env_id.rpartition("/")[2]


def _twin(name: str) -> str:
    """The environment of this package with the same name as one of another."""
    return next(
        (each for each in ENVIRONMENTS if each != name and _stem(each) == _stem(name)),
        "",
    )


def _unknown(name: str) -> str:
    """The message about an id that is not registered."""
    known = list(gym.registry)
    similar = [each for each in known if _stem(each).lower() == _stem(name).lower()]
    own = [each for each in similar if each in ENVIRONMENTS]
    plain = [each for each in similar if "/" not in each]
    # Of the versions of one environment the newest.
    similar = [*own[-1:], *sorted(plain or set(similar) - set(own))[-1:]]
    similar = similar or get_close_matches(name, known, 1)
    if not similar:
        stems = {_stem(each): each for each in known}
        similar = [stems[each] for each in get_close_matches(_stem(name), stems, 1)]
    message = f"there is no environment {name!r}."
    if not similar:
        return (
            f"{message} `acl-gym envs` lists those of this package; for one of your own "
            "name the module that registers it, module:Id-v0."
        )
    words = [repr(each) + _remark(each) for each in similar]
    return f"{message} Did you mean {' or '.join(words)}?"


def _remark(env_id: str) -> str:
    """What to know of an environment that is named beside one of this package."""
    if env_id in ENVIRONMENTS:
        return " of this package"
    if _twin(env_id) == "acl_gym/Pendulum-v0":
        return " of Gymnasium, whose torque is continuous, with --discretize 5"
    return ""
