"""A grid world in plain Python: cells in a dictionary, one ant at a time."""

from collections import deque

import numpy as np
from hypothesis import strategies as st

STEPS = {
    "north": (-1, 0),
    "south": (1, 0),
    "east": (0, 1),
    "west": (0, -1),
}
NAMES_2D = ("north", "south", "east", "west")
NAMES_1D = ("west", "east")


def cells_of(rows: tuple[str, ...]) -> list[tuple[int, int]]:
    """The cells that are no obstacles, row by row."""
    return [
        (i, j)
        for i, row in enumerate(rows)
        for j, character in enumerate(row)
        if character != "#"
    ]


def follow(
    rows: tuple[str, ...], state: int, name: str, carried_out: bool = True
) -> tuple[int, bool]:
    """The next state, and whether it is a goal."""
    cells = cells_of(rows)
    row, column = cells[state]
    down, right = STEPS[name]
    ahead = (row + down, column + right)
    if carried_out and ahead in cells:
        row, column = ahead
    return cells.index((row, column)), rows[row][column] == "G"


def distances(rows: tuple[str, ...]) -> list[int]:
    """Steps to the nearest goal from each state, breadth first; -1 if there is no way."""
    cells = cells_of(rows)
    found = {cell: 0 for cell in cells if rows[cell[0]][cell[1]] == "G"}
    queue = deque(found)
    while queue:
        row, column = queue.popleft()
        for down, right in STEPS.values():
            near = (row + down, column + right)
            if near in cells and near not in found:
                found[near] = found[row, column] + 1
                queue.append(near)
    return [found.get(cell, -1) for cell in cells]


@st.composite
def worlds(draw: st.DrawFn) -> tuple[str, ...]:
    """Maps of any shape with one goal or two; what has no way to one is walled in."""
    height, width = draw(st.integers(1, 5)), draw(st.integers(2, 5))
    size = height * width
    cells = draw(st.lists(st.sampled_from("..#"), min_size=size, max_size=size))
    goal = draw(st.integers(0, size - 1))
    beside = goal - 1 if goal % width else goal + 1  # a free cell, so that one is left
    cells[goal], cells[beside] = "G", "."
    other = draw(st.integers(0, size - 1))
    if other != beside and cells[other] == ".":
        cells[other] = "G"
    rows = tuple("".join(cells[i * width : (i + 1) * width]) for i in range(height))
    canvas = [list(row) for row in rows]
    for (i, j), steps in zip(cells_of(rows), distances(rows), strict=True):
        near = [(i + down, j + right) for down, right in STEPS.values()]
        if steps < 0 or not set(near) & set(cells_of(rows)):
            canvas[i][j] = "#"
    return tuple("".join(row) for row in canvas)


def mean_path(rows: tuple[str, ...]) -> float:
    """The mean shortest way over the cells that are no goals."""
    steps = np.array(distances(rows))
    return float(steps[steps > 0].mean())
