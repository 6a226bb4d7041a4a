"""The worlds of the 2-D grid search (§3.6.6) as text, and the program that made them.

The maps of the thesis are not available. These have the same number of free cells
(§3.6.8) and the goal in the centre. Each character is a cell: `#` an obstacle,
`.` a free cell, `G` the goal.

    python -m acl_gym.envs.grid_search            prints the maps
    python -m acl_gym.envs.grid_search --write    writes the files of `layouts/` again
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from acl_gym.utils import validation
from acl_gym.utils.files import write_atomically
from acl_gym.utils.typing import BoolArray, IntArray

WALL, FREE, GOAL = "#", ".", "G"

# Name -> arguments of `make_map`. The counts are those of §3.6.8; the mean path of
# 11x11 is the "about 10" of §3.6.7, for the others the thesis gives none.
MAPS: dict[str, dict[str, Any]] = {
    "11x11": {"size": 11, "free_cells": 86, "seed": 1, "mean_path": 10.0},
    "21x21": {"size": 21, "free_cells": 278, "seed": 1},
    "31x31": {"size": 31, "free_cells": 640, "seed": 1},
}

_ATTEMPTS = 2_000  # maps that `make_map` starts before it gives up
_TOLERANCE = 0.05  # steps between the requested mean path and that of a map


def load_map(name: str) -> tuple[str, ...]:
    """The rows of a map that comes with the package, from north to south.

    Args:
        name: "11x11", "21x21" or "31x31".

    Raises:
        ValueError: there is no such map.
    """
    validation.one_of("map_name", name, tuple(MAPS))
    file = resources.files("acl_gym.envs.grid_search") / "layouts" / f"{name}.txt"
    return tuple(file.read_text(encoding="ascii").split())


def checked_map(desc: Any) -> tuple[str, ...]:
    """Return a user's own map as rows of characters, validated.

    Args:
        desc: the map as text of several lines or as a sequence of rows, from north to
            south. White space around a line and empty lines at both ends of a text
            are ignored.

    Raises:
        TypeError: `desc` is neither text nor a sequence of texts.
        ValueError: it is not a map in which every free cell has a way to a goal.
    """
    lines = desc.strip().split("\n") if isinstance(desc, str) else desc
    if not isinstance(lines, Sequence) or not all(isinstance(x, str) for x in lines):
        raise TypeError(
            "desc must be the text of a map or a sequence of its rows, got "
            f"{desc!r} of type {type(desc).__name__}."
        )
    rows = tuple(str(line).strip() for line in lines)
    for number, row in enumerate(rows):
        if len(row) != len(rows[0]):
            raise ValueError(
                f"desc must have rows of one length, got {len(row)} cells in row "
                f"{number} and {len(rows[0])} in row 0; fill up with '{WALL}'."
            )
        for column, character in enumerate(row):
            if character not in (WALL, FREE, GOAL):
                raise ValueError(
                    f"desc must hold '{WALL}' (obstacle), '{FREE}' (free) and '{GOAL}' "
                    "(goal) only, got "
                    f"{validation.shown(character)} in row {number}, column {column} "
                    "(from 0)."
                )
    _check_ways(rows)
    return rows


def _check_ways(rows: tuple[str, ...]) -> None:
    text = "".join(rows)
    if GOAL not in text or FREE not in text:
        raise ValueError(
            f"desc must have a goal '{GOAL}' and a free cell '{FREE}' to start from, "
            f"got {'no goal' if GOAL not in text else 'no free cell'} in {len(rows)} "
            f"rows of {len(rows[0]) if rows else 0} columns."
        )
    characters = np.array([list(row) for row in rows])
    open_cells, goals = characters != WALL, characters == GOAL
    for bad, trouble in (
        (open_cells & (goal_distances(open_cells, goals) < 0), "no way to a goal"),
        (goals & (_neighbours(open_cells) == 0), "no way out or in"),
    ):
        if bad.any():
            row, column = np.argwhere(bad)[0]
            raise ValueError(
                "desc must connect every free cell to a goal and every goal to some "
                f"cell, but the '{rows[row][column]}' in row {row}, column {column} "
                f"(from 0) has {trouble}; open a way or make it '{WALL}'."
            )


def goal_distances(open_cells: BoolArray, goals: BoolArray) -> IntArray:
    """The length of the shortest way from each cell to the nearest goal, in steps.

    Args:
        open_cells: `(rows, columns)`, whether a cell is no obstacle; goals are open.
        goals: `(rows, columns)`.

    Returns:
        Array `(rows, columns)`, -1 at obstacles and where no way leads to a goal.
    """
    distance = np.where(goals, 0, -1)
    front, steps = goals, 0
    while front.any():
        steps += 1
        near = np.zeros_like(front)
        near[1:] |= front[:-1]
        near[:-1] |= front[1:]
        near[:, 1:] |= front[:, :-1]
        near[:, :-1] |= front[:, 1:]
        front = near & open_cells & (distance < 0)
        distance[front] = steps
    return distance


def make_map(
    size: int, free_cells: int, seed: int, mean_path: float | None = None
) -> tuple[str, ...]:
    """Make a square world of walls around a goal in its centre.

    It starts from a random maze with exactly one path between any two cells and removes
    obstacles one by one until it has enough free cells: first at dead ends, then
    obstacles that stand alone, then any that separate two free cells. The result has
    walls, corridors and small squares, all connected, without dead ends and without
    lone obstacles.

    Args:
        size: rows and columns, odd, >= 5.
        free_cells: how many free cells there are besides the goal, about 0.6 to 0.8 of
            all cells.
        seed: of the generator; the same arguments give the same map.
        mean_path: the mean over the free cells of the shortest path to the goal, in
            steps, met within 0.05; None takes the first map with enough free cells.

    Returns:
        The rows of the map, from north to south.

    Raises:
        ValueError: the arguments are not valid, or no such map was found.
    """
    validation.integer("size", size, at_least=5)
    validation.integer("free_cells", free_cells, at_least=1)
    if size % 2 == 0:
        raise ValueError(f"size must be odd, for the goal in the centre, got {size}.")
    if mean_path is not None:
        validation.number("mean_path", mean_path, above=0)
    rng = np.random.default_rng(seed)
    goals = np.zeros((size, size), dtype=np.bool_)
    goals[size // 2, size // 2] = True
    for _ in range(_ATTEMPTS):
        walls = ~(_maze(size, rng) | goals)
        if not _thinned(walls, size * size - 1 - free_cells, rng):
            continue
        mean = float(goal_distances(~walls, goals)[~walls].sum()) / free_cells
        if mean_path is None or abs(mean - mean_path) <= _TOLERANCE:
            characters = np.where(walls, WALL, FREE)
            characters[goals] = GOAL
            return tuple("".join(row) for row in characters)
    raise ValueError(
        f"no map of size {size} with {free_cells} free cells and mean_path {mean_path} "
        f"was found in {_ATTEMPTS} attempts; ask for another number of free cells or "
        "another mean_path."
    )


def _maze(size: int, rng: np.random.Generator) -> BoolArray:
    """Return the free cells of a maze whose crossings are at even rows and columns.

    Depth first: a passage is dug from the last crossing to a random new one two cells
    away, or, if there is none, from the crossing before.
    """
    free = np.zeros((size, size), dtype=np.bool_)
    free[0, 0] = True
    trail = [(0, 0)]
    while trail:
        row, column = trail[-1]
        steps = [
            (down, right)
            for down, right in ((-1, 0), (1, 0), (0, 1), (0, -1))
            if 0 <= row + 2 * down < size
            and 0 <= column + 2 * right < size
            and not free[row + 2 * down, column + 2 * right]
        ]
        if not steps:
            trail.pop()
            continue
        down, right = steps[rng.integers(len(steps))]
        free[row + down, column + right] = True
        trail.append((row + 2 * down, column + 2 * right))
        free[trail[-1]] = True
    return free


def _thinned(walls: BoolArray, count: int, rng: np.random.Generator) -> bool:
    """Remove obstacles, in place, until `count` are left; return whether it worked."""
    while True:
        ways = _neighbours(~walls)
        dead_ends = ~walls & (ways < 2)
        alone = walls & (_neighbours(walls) == 0)
        if walls.sum() <= count:
            return bool(walls.sum() == count and not (dead_ends | alone).any())
        # An obstacle beside two free cells joins them; it cannot become a dead end.
        joins = walls & (ways >= 2)
        for choice in (joins & (_neighbours(dead_ends) > 0), alone, joins):
            if choice.any():
                cells = np.argwhere(choice)
                walls[tuple(cells[rng.integers(len(cells))])] = False
                break
        else:
            return False


def _neighbours(cells: BoolArray) -> IntArray:
    """How many of the four neighbours of each cell are True; none beyond the border."""
    padded = np.pad(cells, 1).astype(np.int64)
    return padded[:-2, 1:-1] + padded[2:, 1:-1] + padded[1:-1, :-2] + padded[1:-1, 2:]


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the maps, or write their files again."""
    parser = argparse.ArgumentParser(prog="python -m acl_gym.envs.grid_search")
    parser.add_argument("--write", action="store_true", help="write the files again")
    write = parser.parse_args(arguments).write
    for name, how in MAPS.items():
        text = "\n".join(make_map(**how)) + "\n"
        if write:
            folder = Path(__file__).parent / "layouts"
            write_atomically(folder / f"{name}.txt", text.encode("ascii"))
        else:
            sys.stdout.write(f"{name}\n{text}\n")
