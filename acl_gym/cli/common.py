"""What the commands share: errors on one line, `NAME=VALUE`, environments, tables."""

from __future__ import annotations

import json
import os
import sys
import traceback
import warnings
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from typer.core import TyperCommand, TyperGroup

if TYPE_CHECKING:
    from gymnasium.vector import VectorEnv
    from rich.console import Console

    from acl_gym.agents.base import TabularAgent

INTERRUPTED = 130
"""The exit code of a program that Ctrl-C has ended, as shells have it."""

AGENTS = {"acl": "ACL", "q-learning": "QLearning"}
"""What `--agent` calls them -> their class in `acl_gym`."""

AgentName = Literal["acl", "q-learning"]

FOREIGN_EPISODES = 100
"""Episodes of an evaluation where the environment names no initial states."""


class BadArgumentError(Exception):
    """What the user has typed cannot be done; exit code 2."""


class InterruptedRunError(Exception):
    """Ctrl-C came, and there is something to say about it; exit code 130."""


class _Flags:
    debug = False


def _set_debug(value: bool) -> None:
    _Flags.debug = _Flags.debug or value


DebugOption = Annotated[
    bool,
    typer.Option(
        "--debug",
        callback=_set_debug,
        is_eager=True,
        help="Show the whole traceback of an error.",
    ),
]
JsonOption = Annotated[
    bool, typer.Option("--json", help="Print figures as JSON, and nothing else.")
]


class Command(TyperCommand):
    """A command whose errors are one line on stderr and an exit code."""

    def main(
        self,
        args: Sequence[str] | None = None,
        prog_name: str | None = None,
        complete_var: str | None = None,
        standalone_mode: bool = True,
        windows_expand_args: bool = True,
        **extra: Any,
    ) -> Any:
        """Run the command and exit."""
        return _run(super().main, args, prog_name, standalone_mode)


class Group(TyperGroup):
    """Commands whose errors are one line on stderr and an exit code."""

    def main(
        self,
        args: Sequence[str] | None = None,
        prog_name: str | None = None,
        complete_var: str | None = None,
        standalone_mode: bool = True,
        windows_expand_args: bool = True,
        **extra: Any,
    ) -> Any:
        """Run the command and exit."""
        return _run(super().main, args, prog_name, standalone_mode)


def _run(
    main: Callable[..., Any],
    args: Sequence[str] | None,
    prog_name: str | None,
    standalone_mode: bool,
) -> Any:
    if not standalone_mode:
        return main(args, prog_name, standalone_mode=False)
    _Flags.debug = False
    name = prog_name or "acl-gym"
    with warnings.catch_warnings():
        warnings.showwarning = lambda message, *_: _tell(name, f"warning: {message}")
        try:
            code = main(args, prog_name, standalone_mode=False)
            if code == INTERRUPTED:  # what Typer makes of Ctrl-C
                _tell(name, "interrupted; what is in files already is kept.")
        except Exception as error:
            code = _explain(name, error)
    sys.exit(code if isinstance(code, int) else 0)


def _explain(name: str, error: Exception) -> int:
    """Tell what has gone wrong; the exit code."""
    if _Flags.debug:
        traceback.print_exception(error)
    if isinstance(error, typer.TyperException):  # of the parser
        path = getattr(getattr(error, "ctx", None), "command_path", name)
        message = error.format_message().rstrip(".")
        _tell(name, f"{message}. See '{path} --help'.")
        return 2
    if isinstance(error, (BadArgumentError, InterruptedRunError)):
        _tell(name, str(error))
        return 2 if isinstance(error, BadArgumentError) else INTERRUPTED
    message = str(error)
    plain = isinstance(
        error, (ValueError, TypeError, OSError, RuntimeError, ImportError)
    )
    if not (plain and message):
        message = f"{type(error).__name__}: {message}"
    _tell(name, message)
    return 1


def _tell(name: str, message: str) -> None:
    typer.echo(f"{name}: {' '.join(message.split())}", err=True)


@contextmanager
def bad_arguments() -> Iterator[None]:
    """While arguments are turned into objects: their errors are those of the user."""
    import gymnasium as gym

    try:
        yield
    except (ValueError, TypeError, OSError, ImportError, gym.error.Error) as error:
        raise BadArgumentError(str(error)) from error


def parse_settings(
    option: str, texts: Iterable[str], allowed: Collection[str] | None = None
) -> dict[str, Any]:
    """Turn `name=value` into a dict; a value that is JSON is read as such.

    Args:
        option: the option they were given to.
        texts: `name=value` each.
        allowed: names that there are; None allows all.

    Raises:
        BadArgumentError: a text has no `=`, a name is not allowed or there twice.
    """
    settings: dict[str, Any] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or not name.isidentifier():
            raise BadArgumentError(f"{option} must be name=value, got {text!r}.")
        if allowed is not None and name not in allowed:
            raise BadArgumentError(
                f"{option} knows no {name!r}; there are {', '.join(sorted(allowed))}."
            )
        if name in settings:
            raise BadArgumentError(f"{option} sets {name!r} twice.")
        try:
            settings[name] = json.loads(value)
        except json.JSONDecodeError:
            settings[name] = value
    return settings


def make_env(env_id: str, num_envs: int, env_args: dict[str, Any]) -> VectorEnv:
    """Make any registered vector environment; `module:id` imports the module first.

    The module may lie in the working directory, as for `python -m`.

    Raises:
        BadArgumentError: there is no such id, or it cannot be made so.
    """
    import gymnasium as gym

    from acl_gym.envs.control.environments import ControlVectorEnv
    from acl_gym.envs.wrappers.waiting import WaitingVectorEnv

    module, _, name = env_id.rpartition(":")
    if module and os.getcwd() not in sys.path:
        sys.path.insert(0, os.getcwd())
    with bad_arguments():
        if module:
            import_module(module)
        # A first one without arguments tells which there are.
        plain = gym.make_vec(env_id, num_envs=1) if env_args else None
        if plain is not None:
            if isinstance(plain.unwrapped, ControlVectorEnv):
                _check_names(env_id, plain.unwrapped.system_type, env_args)
            plain.close()
        if gym.spec(name).vector_entry_point is None:
            return WaitingVectorEnv.make(name, num_envs, **env_args)
        return gym.make_vec(env_id, num_envs=num_envs, **env_args)


def _check_names(env_id: str, system: type, env_args: dict[str, Any]) -> None:
    if not is_dataclass(system):
        return
    names = [*(field.name for field in fields(system)), "max_episode_steps"]
    if unknown := [name for name in env_args if name not in names]:
        raise ValueError(
            f"{env_id} has no parameter {unknown[0]!r}; there are {', '.join(names)}."
        )


def default_steps(env: VectorEnv) -> int:
    """T: that of the environment, 300 if it has none."""
    from acl_gym.agents.base import DEFAULT_MAX_STEPS, time_limit
    from acl_gym.envs.control.environments import ControlVectorEnv

    base = env.unwrapped
    if isinstance(base, ControlVectorEnv):
        return base.system.evaluation_steps
    return time_limit(env) or DEFAULT_MAX_STEPS


def load_agent(path: str) -> TabularAgent:
    """Load an agent of whatever kind the file holds.

    Raises:
        BadArgumentError: there is no such file, or it is not one of ours.
    """
    import acl_gym
    from acl_gym.utils import files

    with bad_arguments():
        name = str(files.load(path)[0].get("agent"))
        if name not in AGENTS.values():
            raise ValueError(
                f"{path} must hold one of {', '.join(AGENTS.values())}, got {name!r}."
            )
        agent: TabularAgent = getattr(acl_gym, name).load(path)
        return agent


def print_json(value: Any) -> None:
    """Print JSON, with numbers so that reading gives the same ones."""
    typer.echo(json.dumps(value, indent=1))


def console(stderr: bool = False) -> Console:
    """Where tables go; a file or a pipe is given a width, a terminal knows its own."""
    from rich.console import Console

    stream = sys.stderr if stderr else sys.stdout
    return Console(file=stream, width=None if stream.isatty() else 100)
