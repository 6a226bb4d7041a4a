"""Frames of a system with pygame, drawn off screen and shown in a window."""

from __future__ import annotations

import pkgutil
from abc import ABC, abstractmethod
from functools import cached_property
from typing import Any, Generic, TypeVar

import numpy as np
from gymnasium.error import DependencyNotInstalled
from numpy.typing import NDArray

from acl_gym.utils.typing import FloatArray

Frame = NDArray[np.uint8]
System = TypeVar("System")

SIZE = 480  # pixels, of a square frame
_OVERSAMPLING = 2  # drawn larger and scaled down: smooth edges


class Painter(ABC, Generic[System]):
    """Draws the states of one system.

    pygame is an argument, not an import: a painter checks tables without it.

    Args:
        system: what is drawn.
    """

    def __init__(self, system: System) -> None:
        self.system = system

    @abstractmethod
    def draw(self, pygame: Any, canvas: Any, state: Any, action: Any) -> None:
        """Draw a state.

        Args:
            pygame: the module.
            canvas: a square pygame surface to fill.
            state: `(state_size,)`, or what else the environment draws.
            action: the one that led to it, or its inputs where they are real; None at
                the start of an episode.
        """

    def check_table(self, table: Any) -> None:
        """Refuse a (state, action) table that `draw_table` cannot draw.

        Raises:
            ValueError: always, unless the painter can draw tables.
        """
        raise ValueError(
            "only the grids (GridSearch1D, GridSearch2D) and TravellingSalesman draw "
            "tables, one value for each state and action, not "
            f"{type(self.system).__name__}; use frames without a table."
        )

    def draw_table(self, pygame: Any, canvas: Any, table: FloatArray) -> None:
        """Draw a (state, action) table over what `draw` has drawn.

        Args:
            pygame: the module.
            canvas: the surface that `draw` has filled.
            table: `(n_states, n_actions)`, for instance levels of pheromone.

        Raises:
            ValueError: the system or the table does not allow it, see `check_table`.
        """
        self.check_table(table)


class Renderer:
    """Draws one state at a time, and over it a table if there is one.

    Args:
        system: what is drawn.
        painter: "module:class" of its `Painter`, imported when it is first needed;
            None if the system has none.
        frames_per_second: of the window.
    """

    def __init__(
        self, system: Any, painter: str | None, frames_per_second: int
    ) -> None:
        self._system, self._location = system, painter
        self._frames_per_second = frames_per_second
        self._table: FloatArray | None = None
        self._window: Any = None
        self._clock: Any = None

    def __getstate__(self) -> dict[str, Any]:
        """A copy has no window until it shows something."""
        return {**self.__dict__, "_window": None, "_clock": None}

    @cached_property
    def _painter(self) -> Painter[Any]:
        if self._location is None:
            raise NotImplementedError(
                f"{type(self._system).__name__} cannot be drawn, its environment names "
                "no painter; make it without a render_mode."
            )
        painter: Painter[Any] = pkgutil.resolve_name(self._location)(self._system)
        return painter

    @property
    def _pygame(self) -> Any:
        try:
            # Only here: environments must work without pygame.
            import pygame
        except ImportError as error:
            raise DependencyNotInstalled(
                'rendering needs pygame; install it with `pip install "acl-gym[render]"`.'
            ) from error
        return pygame

    def set_system(self, system: Any) -> None:
        """Draw another system of the same kind from now on, and the same table."""
        self._system = system
        self.__dict__.pop("_painter", None)

    def show_table(self, table: FloatArray | None) -> None:
        """Draw `table` over the frames from now on; see `ControlEnv.show_table`."""
        if table is not None:
            self._painter.check_table(table)
        self._table = table

    def frame(self, state: Any, action: Any) -> Frame:
        """Return the picture of a state, `(height, width, 3)`.

        Args:
            state: `(state_size,)`, or what else the environment draws.
            action: the one that led to it, or its inputs where they are real; None at
                the start of an episode.

        Raises:
            DependencyNotInstalled: pygame is missing.
        """
        pixels = self._pygame.surfarray.array3d(self._surface(state, action))
        return np.ascontiguousarray(pixels.transpose(1, 0, 2))

    def show(self, state: Any, action: Any) -> None:
        """Show the picture of a state in a window, no faster than real time.

        Args:
            state: `(state_size,)`, or what else the environment draws.
            action: the one that led to it, or its inputs where they are real; None at
                the start of an episode.

        Raises:
            DependencyNotInstalled: pygame is missing.
        """
        pygame = self._pygame
        if self._window is None:
            pygame.display.init()  # the screen only: no sound is needed
            self._window = pygame.display.set_mode((SIZE, SIZE))
            pygame.display.set_caption(type(self._system).__name__)
            self._clock = pygame.time.Clock()
        self._window.blit(self._surface(state, action), (0, 0))
        pygame.event.pump()
        self._clock.tick(self._frames_per_second)
        pygame.display.flip()

    def close(self) -> None:
        """Close the window if there is one."""
        if self._window is not None:
            self._pygame.display.quit()
            self._window = None

    def _surface(self, state: Any, action: Any) -> Any:
        large = self._pygame.Surface((_OVERSAMPLING * SIZE, _OVERSAMPLING * SIZE))
        self._painter.draw(self._pygame, large, state, action)
        if self._table is not None:
            self._painter.draw_table(self._pygame, large, self._table)
        return self._pygame.transform.smoothscale(large, (SIZE, SIZE))
