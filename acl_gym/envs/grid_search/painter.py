"""Pictures of grid worlds: the map, the ant, and arrows for a table."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from acl_gym.envs.control.rendering import Painter
from acl_gym.envs.grid_search.maps import GOAL, WALL
from acl_gym.envs.grid_search.system import GridSearch
from acl_gym.utils.typing import FloatArray, IntArray

Characters = NDArray[np.str_]
Direction = tuple[int, int]  # rows and columns

# Colours that stay apart for the colour-blind and in print.
_PAPER = (255, 255, 255)
_OBSTACLE = (64, 64, 68)
_LINE = (224, 224, 224)
_OPEN = (250, 250, 250)
_GREEN = (0, 158, 115)
_BLUE = (0, 114, 178)
_BEST = (20, 20, 20)
_FAINT, _FAINTEST = 130, 225  # grey of another action with half of a cell, with none


class GridSearchPainter(Painter[GridSearch]):
    """Draws the map, the ant with a tip towards its last move, and tables as arrows."""

    def __init__(self, system: GridSearch) -> None:
        super().__init__(system)
        self._characters: Characters = np.array([list(row) for row in system.rows])
        self._cells = system.cells
        self._starts = np.setdiff1d(np.arange(system.n_states), system.goal_states)

    def draw(
        self, pygame: Any, canvas: Any, state: FloatArray, action: int | None
    ) -> None:
        """See `Painter.draw`."""
        heading = None if action is None else self.system.directions[action]
        draw_map(pygame, canvas, self._characters)
        cell = self._cells[int(state[0])]
        draw_ant(pygame, canvas, self._characters, cell, heading)

    def check_table(self, table: Any) -> None:
        """Refuse anything but a table of levels >= 0, `(n_states, n_actions)`.

        Raises:
            TypeError: it is not a NumPy array.
            ValueError: it has another shape or holds negative or infinite values.
        """
        if not isinstance(table, np.ndarray):
            raise TypeError(
                f"table must be a NumPy array, got {type(table).__name__}; it is kept, "
                "so that frames follow it."
            )
        shape = (self.system.n_states, len(self.system.directions))
        if table.shape != shape:
            raise ValueError(
                "table must have a row for each state and a column for each action, "
                f"shape {shape}, got {table.shape}."
            )
        if not (np.isfinite(table) & (table >= 0)).all():
            raise ValueError(
                "table must hold finite levels >= 0, whose share in a cell is drawn; "
                "subtract the least value of each row from other values."
            )

    def draw_table(self, pygame: Any, canvas: Any, table: FloatArray) -> None:
        """Draw an arrow for each action, the longer the larger its share of the cell."""
        self.check_table(table)
        cells, levels = self._cells[self._starts], table[self._starts]
        directions = self.system.directions
        draw_arrows(pygame, canvas, self._characters, cells, levels, directions)


class _Layout:
    """The places of the cells on a canvas: square, centred, as large as possible."""

    def __init__(self, canvas: Any, shape: tuple[int, ...]) -> None:
        size = int(canvas.get_width())
        self.margin = max(2, size // 80)
        self.side = (size - 2 * self.margin) // max(shape)
        self.top = (size - self.side * shape[0]) // 2
        self.left = (size - self.side * shape[1]) // 2

    def rectangle(self, row: int, column: int) -> tuple[int, int, int, int]:
        """Left, top, width and height of a cell."""
        side = self.side
        return self.left + side * column, self.top + side * row, side, side

    def centre(self, cell: IntArray) -> FloatArray:
        """The x and y of the centre of a cell."""
        row, column = cell
        corner = np.array([self.left + self.side * column, self.top + self.side * row])
        return corner + 0.5 * self.side


def draw_map(pygame: Any, canvas: Any, characters: Characters) -> None:
    """Fill the canvas with a map: obstacles dark, free cells light, goals green."""
    canvas.fill(_PAPER)
    layout = _Layout(canvas, characters.shape)
    rows, columns = characters.shape
    edge = max(2, layout.margin // 2)
    frame = pygame.Rect(
        layout.left, layout.top, layout.side * columns, layout.side * rows
    )
    pygame.draw.rect(canvas, _OBSTACLE, frame.inflate(2 * edge, 2 * edge))
    line = max(1, layout.side // 40)
    for row in range(rows):
        for column in range(columns):
            character = characters[row, column]
            if character == WALL:
                continue
            cell = pygame.Rect(layout.rectangle(row, column))
            pygame.draw.rect(canvas, _LINE, cell)
            colour = _GREEN if character == GOAL else _OPEN
            pygame.draw.rect(canvas, colour, cell.inflate(-2 * line, -2 * line))


def draw_ant(
    pygame: Any,
    canvas: Any,
    characters: Characters,
    cell: IntArray,
    heading: Direction | None,
) -> None:
    """Draw the ant as a disc, with a tip towards the move it tried last."""
    layout = _Layout(canvas, characters.shape)
    centre = layout.centre(cell)
    pygame.draw.circle(canvas, _BLUE, tuple(centre), 0.33 * layout.side)
    if heading is not None:
        ahead, aside = np.array([[[0.48, 0.2, 0.2]]]), np.array([[[0.0, 0.26, -0.26]]])
        tip = _pixels(centre[None, None], (heading,), ahead, aside, layout.side)[0, 0]
        pygame.draw.polygon(canvas, _BLUE, tip)


def draw_arrows(
    pygame: Any,
    canvas: Any,
    characters: Characters,
    cells: IntArray,
    table: FloatArray,
    directions: tuple[Direction, ...],
) -> None:
    """Draw an arrow for each action of each cell, as large and dark as its share.

    Args:
        pygame: the module.
        canvas: a surface with the map.
        characters: the map.
        cells: row and column of each row of the table, `(n, 2)`.
        table: values >= 0, `(n, n_actions)`.
        directions: rows and columns by which each action moves.
    """
    layout = _Layout(canvas, characters.shape)
    total = table.sum(axis=1, keepdims=True)
    even = np.full(table.shape, 1.0 / table.shape[1])
    share = np.divide(table, total, out=even, where=total > 0)
    highest = share == share.max(axis=1, keepdims=True)
    best = highest & (highest.sum(axis=1, keepdims=True) == 1)  # none where levels tie
    length = 0.46 * np.sqrt(share)
    grey = _FAINTEST + (_FAINT - _FAINTEST) * np.minimum(1.0, 2.0 * share)
    # The best arrow fills the cell, the others grow out of its centre.
    half, tail = np.where(best, 0.055, 0.04), np.where(best, -0.8 * length, 0.0)
    neck, wide = np.maximum(0.0, length - 0.24), 3.2 * half
    ahead = np.stack([tail, neck, neck, length, neck, neck, tail], axis=-1)
    aside = np.stack([half, half, wide, 0 * half, -wide, -half, -half], axis=-1)
    centres = np.array([layout.centre(cell) for cell in cells])[:, None]
    outlines = _pixels(centres, directions, ahead, aside, layout.side)
    visible = length * layout.side >= 1.0
    for i, order in enumerate(np.argsort(share, axis=1, kind="stable")):
        for action in order:  # the best one on top
            if visible[i, action]:
                colour = _BEST if best[i, action] else (int(grey[i, action]),) * 3
                pygame.draw.polygon(canvas, colour, outlines[i, action])


def _pixels(
    centres: FloatArray,
    directions: tuple[Direction, ...],
    ahead: FloatArray,
    aside: FloatArray,
    side: int,
) -> FloatArray:
    """Pixels of points relative to the centre of a cell and the direction of an action.

    Args:
        centres: pixels, `(n, 1, 2)`.
        directions: rows and columns of each action.
        ahead: how far the points are ahead, in sides of a cell, `(n, n_actions, k)`.
        aside: how far they are to the right of it, the same.
        side: of a cell, in pixels.

    Returns:
        Array `(n, n_actions, k, 2)`.
    """
    down, right = np.array(directions, dtype=np.float64).T[..., None]
    x, y = ahead * right - aside * down, ahead * down + aside * right
    return np.asarray(centres[..., None, :] + side * np.stack([x, y], axis=-1))
