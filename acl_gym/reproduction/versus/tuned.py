"""What searches have found: one file for each arena and method, shipped with the code."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from acl_gym.reproduction.versus.arena import Arena
from acl_gym.reproduction.versus.arenas import ARENAS
from acl_gym.reproduction.versus.spaces import METHODS, TABLES, defaults_of
from acl_gym.utils import validation

FOLDER = Path(__file__).parents[1] / "tuned"

Search = dict[str, Any]
"""A search as its file holds it; `evaluations` are in the order in which they were made."""


def methods_in(arena: Arena) -> tuple[str, ...]:
    """The methods that take part in an arena."""
    return tuple(METHODS) if arena.dqn_steps else TABLES


def path_of(name: str, method: str, folder: Path = FOLDER) -> Path:
    """The file of a search."""
    return folder / f"{name}-{method}.json"


def read_search(name: str, method: str, folder: Path = FOLDER) -> Search:
    """The search of a method in an arena.

    Args:
        name: of the arena.
        method: of it.
        folder: where the files are.

    Raises:
        ValueError: there is no arena or method of the name, or the file is damaged.
        FileNotFoundError: it was not searched.
    """
    validation.one_of("arena", name, tuple(ARENAS))
    validation.one_of("method", method, methods_in(ARENAS[name]))
    path = path_of(name, method, folder)
    if not path.is_file():
        raise FileNotFoundError(
            f"{method} was not tuned in {name}: there is no {path}; "
            f"`python benchmarks/tune.py --only {name}-{method}` makes it."
        )
    try:
        search: Search = json.loads(path.read_text())
        if not all("value" in each for each in search["evaluations"]):
            raise KeyError("value")
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(
            f"{path} is not the data of a search; remove it and make it again with "
            "`python benchmarks/tune.py`."
        ) from error
    return search


def best_of(search: Search) -> dict[str, Any]:
    """The evaluation with the lowest value.

    Of equal ones that whose policies cost least on the way, and then the first: where
    every setting finds the optimum, the soonest.
    """
    evaluations: list[dict[str, Any]] = search["evaluations"]
    return min(evaluations, key=order)


def order(evaluation: dict[str, Any]) -> tuple[float, float]:
    """By what evaluations are ranked."""
    # Sums over the same states in another order of slots may differ in their last bits.
    return round(evaluation["value"], 9), evaluation["on_the_way"]


def settings_of(name: str, method: str, folder: Path = FOLDER) -> dict[str, Any]:
    """The best settings found for a method in an arena, whole."""
    best = best_of(read_search(name, method, folder))["parameters"]
    return {**defaults_of(ARENAS[name], method), **best}
