"""How commands fail: one line on stderr, an exit code, a traceback only if asked for."""

from __future__ import annotations

import errno
import os
import sys
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

from acl_gym.utils.text import replace_unprintable_letters

INTERRUPTED = 130
"""The exit code of a program ended by Ctrl-C, by convention of the shells."""

READER_GONE = 141
"""The exit code where nobody reads what is printed: 128 + the number of SIGPIPE."""

_PLAIN = (ValueError, TypeError, OSError, RuntimeError, ImportError, AttributeError)
"""Errors whose messages are sentences, so that the name of the class adds nothing."""


class BadArgumentError(Exception):
    """An error in the arguments; exit code 2."""


class InterruptedRunError(Exception):
    """A signal has ended a run, with a message about the results.

    Attributes:
        code: the exit code, 128 + the number of the signal.
    """

    def __init__(self, message: str, code: int = INTERRUPTED) -> None:
        super().__init__(message)
        self.code = code


class _Flags:
    debug = False


def set_debug(value: bool) -> None:
    """Show tracebacks from now on; the callback of `--debug`."""
    _Flags.debug = _Flags.debug or value


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
    replace_unprintable_letters()
    with warnings.catch_warnings():
        warnings.showwarning = lambda message, *_: report(name, f"warning: {message}")
        try:
            code = main(args, prog_name, standalone_mode=False)
            if code == INTERRUPTED:  # what Typer returns after Ctrl-C
                report(name, _interrupted())
            sys.stdout.flush()
        except SystemExit as leaving:
            # Typer and Rich turn a broken pipe into an exit of their own.
            cause = leaving.__context__
            if not (isinstance(cause, OSError) and cause.errno == errno.EPIPE):
                raise
            code = _leave_pipe()
        except OSError as error:
            code = (
                _leave_pipe() if error.errno == errno.EPIPE else _explain(name, error)
            )
        except Exception as error:
            code = _explain(name, error)
    sys.exit(code if isinstance(code, int) else 0)


def _leave_pipe() -> int:
    """Say nothing where the reader has gone, as in `| head`; returns the exit code.

    Python's own flush at exit would fail as well, so it goes nowhere.
    """
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())
    return READER_GONE


def _interrupted() -> str:
    """What Ctrl-C has left behind."""
    # Not imported here: Ctrl-C may have come in the middle of an import of NumPy, which
    # cannot be begun again. What was not imported has written nothing.
    files = sys.modules.get("acl_gym.utils.files")
    has_written = getattr(files, "has_written", None)
    if has_written is not None and has_written():
        return "interrupted; files written so far are kept."
    return "interrupted; nothing was written."


def _explain(name: str, error: Exception) -> int:
    """Report an error; returns the exit code."""
    if _Flags.debug:
        traceback.print_exception(error)
    if isinstance(error, typer.TyperException):  # from the parser
        path = getattr(getattr(error, "ctx", None), "command_path", name)
        message = error.format_message()
        if not message.endswith((".", "?")):
            message += "."
        report(name, f"{message} See '{path} --help'.")
        return 2
    report(name, in_words(error))
    if isinstance(error, InterruptedRunError):
        return error.code
    return 2 if isinstance(error, BadArgumentError) else 1


def in_words(error: BaseException) -> str:
    """The message of an error and its notes, in one line."""
    words, notes = _message(error), getattr(error, "__notes__", [])
    if notes and not words.endswith((".", "!", "?")):
        words += "."
    return " ".join([words, *notes])


def _message(error: BaseException) -> str:
    """The message of an error; with the name of its class where that says more."""
    message = str(error)
    if isinstance(error, MemoryError):
        words = "there is not enough memory; take fewer ants, cells or steps"
        return f"{words} ({message})." if message else f"{words}."
    told = isinstance(error, (*_PLAIN, BadArgumentError, InterruptedRunError))
    if not message:
        return f"{type(error).__name__}; add --debug to see where it comes from."
    return message if told else f"{type(error).__name__}: {message}"


def report(name: str, message: str) -> None:
    """Write one line to stderr, also where it is a pipe that is no longer read."""
    with suppress(BrokenPipeError):
        typer.echo(f"{name}: {' '.join(message.split())}", err=True)


@contextmanager
def bad_arguments() -> Iterator[None]:
    """Turn errors raised while arguments are processed into `BadArgumentError`."""
    try:
        yield
    except (BadArgumentError, typer.TyperException):
        raise
    except Exception as error:
        # An environment of any package may raise anything at what it does not like.
        raise BadArgumentError(in_words(error)) from error
