"""The arguments of an agent's constructor, as its file holds them."""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from typing import Any

from acl_gym.utils.serialization import Missing, own_name, to_json, to_settings

NOT_GIVEN = (
    "env",
    "executor",
    "heuristic",
    "initial",
    "n_actions",
    "seed",
    "workers",
)
"""Arguments of constructors that a file holds otherwise, that `load` has itself, or that
say where the environment is."""


def keywords_of(kind: type) -> set[str]:
    """The arguments of an agent's constructor that a file holds or `load` is given."""
    return {
        name
        for name, parameter in inspect.signature(kind).parameters.items()
        if parameter.kind not in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)
        and name not in NOT_GIVEN
    } - {"partition"}


def check_constructor(kind: type, parameters: dict[str, Any]) -> None:
    """Refuse to write what `load` could not make again.

    Raises:
        TypeError: the constructor does not take what `load` passes to it.
    """
    passed = dict.fromkeys({"n_actions", *keywords_of(kind), *parameters})
    try:
        inspect.signature(kind).bind(None, None, **passed)
    except TypeError as error:
        raise TypeError(
            f"{kind.__name__} must be made by {kind.__name__}(env, partition, "
            "n_actions=..., and what `parameters` returns) to be saved, because load "
            f"makes it so, but {error}; let its constructor take these, for instance "
            "by **keywords that it passes on."
        ) from error


def saved_parameter(value: Any) -> Any:
    """The saved form of a parameter: the value itself, or the name of its class."""
    try:
        return to_json(value, "a parameter")
    except TypeError:
        return to_settings(Missing("", own_name(value)))


def lacking_in(
    saved: Any, unsaved: Any, kind: type, given_again: Sequence[str]
) -> set[str]:
    """The arguments of the constructor that the file does not hold.

    Args:
        saved: its parameters.
        unsaved: the names of others that it does not hold.
        kind: the class.
        given_again: what `load` takes, because it may be a function.
    """
    known = {"cost", "deposit", "update", "alpha", "beta", "epsilon", *given_again}
    by_name = {
        name
        for name, value in saved.items()
        if isinstance(value, dict) and value.get("type") == "function"
    }
    return (by_name - known) | (set(unsaved) & keywords_of(kind))
