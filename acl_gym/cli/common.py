"""Shared by the commands: errors on one line, `NAME=VALUE`, environments, tables."""

from __future__ import annotations

import json
import os
import sys
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
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
"""The exit code of a program ended by Ctrl-C, by convention of the shells."""

AGENTS = {"acl": "ACL", "q-learning": "QLearning"}
"""Value of `--agent` -> name of the class in `acl_gym`."""

AgentName = Literal["acl", "q-learning"]

FOREIGN_EPISODES = 100
"""Episodes of an evaluation if the environment has no evaluation states."""


class BadArgumentError(Exception):
    """An error in the arguments; exit code 2."""


class InterruptedRunError(Exception):
    """Ctrl-C was pressed, with a message about the results; exit code 130."""


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
        help="Show the full traceback of an error.",
    ),
]
JsonOption = Annotated[
    bool, typer.Option("--json", help="Print the results as JSON and nothing else.")
]


class _OneLineErrors:
    """Mixin of Typer's commands that reports errors on one line of stderr."""

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
        main = super().main  # type: ignore[misc]
        return _run(main, args, prog_name, standalone_mode)


class Command(_OneLineErrors, TyperCommand):
    """A command that reports errors on one line of stderr, with an exit code."""


class Group(_OneLineErrors, TyperGroup):
    """A group that reports errors on one line of stderr, with an exit code."""


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
        warnings.showwarning = lambda message, *_: _report(name, f"warning: {message}")
        try:
            code = main(args, prog_name, standalone_mode=False)
            if code == INTERRUPTED:  # what Typer returns after Ctrl-C
                _report(name, "interrupted; files written so far are kept.")
        except Exception as error:
            code = _explain(name, error)
    sys.exit(code if isinstance(code, int) else 0)


def _explain(name: str, error: Exception) -> int:
    """Report an error; returns the exit code."""
    if _Flags.debug:
        traceback.print_exception(error)
    if isinstance(error, typer.TyperException):  # from the parser
        path = getattr(getattr(error, "ctx", None), "command_path", name)
        message = error.format_message()
        if not message.endswith((".", "?")):
            message += "."
        _report(name, f"{message} See '{path} --help'.")
        return 2
    if isinstance(error, (BadArgumentError, InterruptedRunError)):
        _report(name, str(error))
        return 2 if isinstance(error, BadArgumentError) else INTERRUPTED
    message = str(error)
    plain = isinstance(
        error, (ValueError, TypeError, OSError, RuntimeError, ImportError)
    )
    if not (plain and message):
        message = f"{type(error).__name__}: {message}"
    _report(name, message)
    return 1


def _report(name: str, message: str) -> None:
    typer.echo(f"{name}: {' '.join(message.split())}", err=True)


@contextmanager
def bad_arguments() -> Iterator[None]:
    """Turn errors raised while arguments are processed into `BadArgumentError`."""
    import gymnasium as gym

    try:
        yield
    except (ValueError, TypeError, OSError, ImportError, gym.error.Error) as error:
        raise BadArgumentError(str(error)) from error


def parse_settings(
    option: str, texts: Iterable[str], allowed: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """Parse `name=value` pairs into a dict; values that are JSON are read as JSON.

    Args:
        option: the option, for messages.
        texts: the pairs, each `name=value`.
        allowed: the valid names, each with its range or ""; None allows all.

    Raises:
        BadArgumentError: a text has no `=`, or a name is unknown or repeated.
    """
    settings: dict[str, Any] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or not name.isidentifier():
            raise BadArgumentError(f"{option} must be name=value, got {text!r}.")
        if allowed is not None and name not in allowed:
            names = (
                f"{each} ({allowed[each]})".removesuffix(" ()")
                for each in sorted(allowed)
            )
            raise BadArgumentError(
                f"{option} has no {name!r}; choose from {', '.join(names)}."
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

    The module may be in the working directory, as with `python -m`.

    Raises:
        BadArgumentError: the id is unknown, or the environment cannot be made with
            these arguments.
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
        # Make one without arguments first, to learn which arguments there are.
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
            f"{env_id} has no parameter {unknown[0]!r}; choose from {', '.join(names)}."
        )


def default_steps(env: VectorEnv) -> int:
    """T: the limit of the environment, or 300 if it has none."""
    from acl_gym.agents.base import DEFAULT_MAX_STEPS, time_limit
    from acl_gym.envs.control.environments import ControlVectorEnv

    base = env.unwrapped
    if isinstance(base, ControlVectorEnv):
        return base.system.evaluation_steps
    return time_limit(env) or DEFAULT_MAX_STEPS


def load_agent(path: str) -> TabularAgent:
    """Load an agent of any kind from a file.

    Raises:
        BadArgumentError: there is no such file, or it holds no agent of this package.
    """
    import acl_gym
    from acl_gym.utils.archives import Archive

    with bad_arguments():
        name = str(Archive(path).header.get("agent"))
        if name not in AGENTS.values():
            raise ValueError(
                f"{path} must hold one of {', '.join(AGENTS.values())}, got {name!r}."
            )
        agent: TabularAgent = getattr(acl_gym, name).load(path)
        return agent


def print_json(value: Any) -> None:
    """Print JSON, with numbers in full precision."""
    typer.echo(json.dumps(value, indent=1))


def console(stderr: bool = False) -> Console:
    """The console for tables; a file or a pipe gets a fixed width."""
    from rich.console import Console

    stream = sys.stderr if stderr else sys.stdout
    return Console(file=stream, width=None if stream.isatty() else 100)
