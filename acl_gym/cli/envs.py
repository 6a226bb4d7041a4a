"""`acl-gym envs`: the environments of this package and their parameters.

The list is read from the docstrings in the source files, because importing the modules
imports Numba, which takes a second.
"""

from __future__ import annotations

import ast
import inspect
import re
import shutil
import textwrap
from dataclasses import MISSING, Field, fields, is_dataclass
from typing import Annotated, Any

import typer

from acl_gym.cli.common import (
    DebugOption,
    JsonOption,
    print_json,
)
from acl_gym.cli.environments import Environment
from acl_gym.cli.errors import BadArgumentError
from acl_gym.cli.sources import class_node
from acl_gym.envs import ENVIRONMENTS
from acl_gym.utils.validation import did_you_mean

HELP = """List the environments of acl-gym, or show the parameters of one.

Parameters and max_episode_steps are keywords of gym.make and gym.make_vec, and can be
set with --env-arg of acl-gym train.

\b
Examples:
  acl-gym envs
  acl-gym envs acl_gym/Pendulum-v0
  acl-gym envs --json
"""


def envs(
    env_id: Annotated[
        str | None,
        typer.Argument(
            metavar="[ID]",
            help="Show the parameters of this environment.",
            show_default=False,
        ),
    ] = None,
    seed: Annotated[
        int,
        typer.Option(min=0, metavar="N", help="Seed of the example observation."),
    ] = 0,
    as_json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """List environments; see `HELP`."""
    if env_id is None:
        rows = [describe(each) for each in ENVIRONMENTS]
        if as_json:
            print_json(rows)
        else:
            _print_list(rows)
        return
    if env_id not in ENVIRONMENTS:
        raise BadArgumentError(
            f"acl-gym has no environment {env_id!r}; choose from "
            f"{', '.join(ENVIRONMENTS)}.{did_you_mean(env_id, ENVIRONMENTS)}"
        )
    found = {**describe(env_id), **_example(env_id, seed)}
    if as_json:
        print_json(found)
    else:
        _print_one(found)


def describe(env_id: str) -> dict[str, Any]:
    """A summary of an environment from its docstring, read without importing it."""
    module, name = ENVIRONMENTS[env_id][0].split(":")
    # The package of a system imports the class from its module `env`.
    text = ast.get_docstring(class_node(f"{module}.env", name)) or ""
    section = re.search(r"§[\d.]*\d|Chapter \d+", text)
    return {
        "id": env_id,
        "description": text.partition("\n")[0],
        "observation": _first_sentence(text, "Observation Space"),
        "actions": _first_sentence(text, "Action Space"),
        "thesis": section[0] if section else "",
    }


def parameters(system: type) -> list[dict[str, Any]]:
    """Name, default and meaning of each field of a system, from its docstring."""
    if not is_dataclass(system):
        return []
    meanings = _attributes(inspect.getdoc(system) or "")
    return [
        {
            "name": field.name,
            "default": _default(field),
            "meaning": meanings.get(field.name, ""),
        }
        for field in fields(system)
        if field.init
    ]


def _default(field: Field[Any]) -> Any:
    if field.default is not MISSING:
        return field.default
    if field.default_factory is not MISSING:
        return field.default_factory()
    return None


def _first_sentence(text: str, head: str) -> str:
    """The first sentence under a heading of a docstring, without backquotes."""
    match = re.search(rf"^## {head}\n+((?:.+\n?)+)", text, re.MULTILINE)
    if match is None:
        return ""
    paragraph = " ".join(match[1].split()).replace("`", "")
    return re.split(r"(?<=[^.])\.(?= |$)", paragraph)[0]


def _attributes(text: str) -> dict[str, str]:
    """The entries in the section `Attributes:` of a Google docstring."""
    _, _, section = text.partition("Attributes:\n")
    entries: dict[str, str] = {}
    name = ""
    for line in section.splitlines():
        if line and not line.startswith(" "):
            break
        if match := re.match(r"    (\w+): (.*)", line):
            name = match[1]
            entries[name] = match[2]
        elif name and line.strip():
            entries[name] += " " + line.strip()
    return entries


def _example(env_id: str, seed: int) -> dict[str, Any]:
    env: Any = Environment(env_id).single()
    observation, _ = env.reset(seed=seed)
    return {
        "example": observation.tolist(),
        "parameters": parameters(type(env.unwrapped.system)),
    }


def _print_list(rows: list[dict[str, Any]]) -> None:
    """A paragraph for each environment, which wraps at any width."""
    for row in rows:
        typer.echo(row["id"])
        _wrapped(row["description"])
        for head in ("observation", "actions", "thesis"):
            _wrapped(f"{head}: {row[head]}")
        typer.echo()
    typer.echo("For the parameters of one: acl-gym envs ID")


def _print_one(found: dict[str, Any]) -> None:
    typer.echo(found["id"])
    _wrapped(found["description"])
    _wrapped(f"observation: {found['observation']}; for example {found['example']}")
    for head in ("actions", "thesis"):
        _wrapped(f"{head}: {found[head]}")
    typer.echo("\nParameters (--env-arg NAME=VALUE), with their defaults:")
    for each in found["parameters"]:
        _wrapped(f"{each['name']} = {each['default']}", indent=2)
        _wrapped(each["meaning"], indent=6)


def _wrapped(text: str, indent: int = 2) -> None:
    """Print words that wrap at the width of the terminal, and are never cut."""
    space = " " * indent
    lines = textwrap.wrap(
        text,
        max(20, shutil.get_terminal_size((80, 24)).columns),
        initial_indent=space,
        subsequent_indent=space,
        break_long_words=False,
        break_on_hyphens=False,
    )
    typer.echo("\n".join(lines))
