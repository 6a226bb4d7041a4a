"""The plant that a Python file describes."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

import gymnasium as gym
from gymnasium.vector import VectorEnv

from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.plant import Plant, PlantEnv, PlantVectorEnv
from acl_gym.utils import validation

NAMES = ("env", "plant")
"""Which of several plants in a file is taken, the first of these names."""

MAKER = "make"
"""A function of this name that takes `num_envs` comes before all plants."""

_LARGEST = 10_000_000  # bytes; no program for a plant is that long


class PlantFileError(ValueError):
    """A file does not describe a plant, and what is wrong with it on one line."""


def load_plant(path: str | Path) -> ControlVectorEnv:
    """Run a Python file and return the plant that it makes.

    The file is run as `python FILE` runs it, but under another name than `__main__`, so
    that what stands below `if __name__ == "__main__":` is not. Its folder comes first in
    `sys.path` meanwhile.

    Args:
        path: the file. It defines a function `make(num_envs)` that returns a plant, or
            leaves what `acl_gym.plant` returns in a name of the module: `env`, `plant`,
            or any other name if there is only one.

    Returns:
        The plant as a vector environment.

    Raises:
        FileNotFoundError: there is no such file.
        PlantFileError: it is no program, fails, or makes no plant.
    """
    file = validation.path("path", path)
    module = _run(file)
    maker = vars(module).get(MAKER)
    if callable(maker) and getattr(maker, "__module__", None) == module.__name__:
        return _made(file, maker)
    found = {
        name: value
        for name, value in vars(module).items()
        if not name.startswith("_") and isinstance(value, gym.Env | VectorEnv)
    }
    plants = {name: env for name, env in found.items() if _is_plant(env)}
    name = next((name for name in NAMES if name in plants), None)
    if name is None and len({id(env) for env in plants.values()}) == 1:
        name = next(iter(plants))
    if name is None:
        raise PlantFileError(_why_none(file, list(found), list(plants)))
    return _checked(file, plants[name])


def as_vector_env(env: Any) -> ControlVectorEnv:
    """Return a plant as a vector environment that may be stepped.

    Args:
        env: what `acl_gym.plant` returns, single or vector, without further wrappers.

    Raises:
        TypeError: it is something else.
        ValueError: it has no goal, or its actions are not numbered, two or more.
    """
    if not _is_plant(env):
        raise TypeError(
            "a controller is designed for what acl_gym.plant(...) returns, without "
            f"wrappers, got {validation.shown(env)}."
        )
    base = env.unwrapped
    if not base.system.has_goal:
        raise ValueError(
            "a controller is designed to reach a goal, got a plant with goal=None; give "
            "it the state to which it is to be brought."
        )
    if base.system.real_inputs is not None or len(base.system.inputs) < 2:
        raise ValueError(
            "a controller chooses among two inputs or more, got a plant with inputs="
            f"{validation.shown(base.parameters['inputs'])}; give some values of each "
            "input, such as inputs=[-1, 0, 1]."
        )
    if isinstance(base, PlantEnv):
        steps = base.system.evaluation_steps
        return PlantVectorEnv(1, max_episode_steps=steps, **base.parameters)
    made: ControlVectorEnv = base
    return made


def _is_plant(env: Any) -> bool:
    base = getattr(env, "unwrapped", None)
    if isinstance(base, PlantEnv):
        return env is base or getattr(env, "env", None) is base  # or in a TimeLimit
    return (
        env is base
        and isinstance(base, ControlVectorEnv)
        and isinstance(base.system, Plant)
    )


def _run(file: Path) -> ModuleType:
    """The module that a file makes, run from its source, so that nothing is cached."""
    if not file.exists():
        raise FileNotFoundError(
            f"there is no file {file}; `acl-gym design --show pendulum` prints one to "
            "begin with."
        )
    size = file.stat().st_size
    if not file.is_file() or size > _LARGEST:
        kind = "a folder" if file.is_dir() else "something else"
        raise PlantFileError(
            f"{file} must be a Python file of at most {_LARGEST:,} bytes that calls "
            f"acl_gym.plant(...), got {f'{size:,} bytes' if file.is_file() else kind}."
        )
    try:
        code = compile(file.read_bytes(), str(file.absolute()), "exec")
    except SyntaxError as error:
        line = f", line {error.lineno}" if error.lineno else ""
        # Some of Python's messages end in a question, "Perhaps you forgot a comma?".
        end = "" if error.msg.endswith((".", "?", "!")) else "."
        raise PlantFileError(f"{file}{line} is not Python: {error.msg}{end}") from error
    except ValueError as error:  # such as null bytes
        raise PlantFileError(f"{file} is not Python: {error}.") from error
    module = ModuleType(f"plant_file_{file.stem}")
    module.__file__ = str(file.absolute())
    # Classes and compiled functions look their module up by its name.
    sys.modules[module.__name__] = module
    with _running(file):
        exec(code, vars(module))
    return module


@contextmanager
def _running(file: Path, remedy: str = "") -> Iterator[None]:
    """Run code of a file: its folder comes first in `sys.path`, and errors name it.

    Args:
        file: whose code is run.
        remedy: what an error says at its end.

    Raises:
        PlantFileError: the code raises something, or ends the program.
    """
    path = sys.path.copy()
    sys.path.insert(0, str(file.absolute().parent))
    try:
        yield
    except SystemExit as leaving:
        raise PlantFileError(
            f"{file} ends the program, sys.exit({leaving.code!r}), before its plant can "
            'be used; put that below `if __name__ == "__main__":`.'
        ) from leaving
    except Exception as error:
        raise PlantFileError(f"{_failure(file, error)}{remedy}") from error
    finally:
        sys.path[:] = path


def _failure(file: Path, error: Exception) -> str:
    """What a file raised, and in which of its lines."""
    own = [
        frame.lineno
        for frame in traceback.extract_tb(error.__traceback__)
        if frame.filename == str(file.absolute())
    ]
    line = f", line {own[-1]}," if own else ""
    words = " ".join(str(error).split())
    return f"{file}{line} raised {type(error).__name__}: {words}"


def _made(file: Path, maker: Callable[..., Any]) -> ControlVectorEnv:
    with _running(file, f"; {MAKER}(num_envs) must return a plant."):
        env = maker(num_envs=1)
    return _checked(file, env)


def _checked(file: Path, env: Any) -> ControlVectorEnv:
    try:
        return as_vector_env(env)
    except (TypeError, ValueError) as error:
        raise PlantFileError(f"{file}: {error}") from error


def _why_none(file: Path, found: list[str], plants: list[str]) -> str:
    if plants:
        return (
            f"{file} must say which of its plants is meant, got {', '.join(plants)}; "
            f"call it `{NAMES[0]}`."
        )
    if found:
        return (
            f"{file} must make a plant with acl_gym.plant(...), without wrappers, got "
            f"only other environments, {', '.join(found)}."
        )
    return (
        f"{file} must make a plant and keep it in a name, such as `{NAMES[0]} = "
        "acl_gym.plant(...)`, got a file without one; `acl-gym design --show pendulum` "
        "prints an example."
    )
