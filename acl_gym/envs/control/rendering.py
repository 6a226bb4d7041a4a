"""Frames of a control system with pygame, drawn off screen and shown if asked to."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.error import DependencyNotInstalled
from numpy.typing import NDArray

from acl_gym.envs.control.system import ControlSystem
from acl_gym.utils.typing import FloatArray

Frame = NDArray[np.uint8]

SIZE = 480  # pixels, of a square frame
_OVERSAMPLING = 2  # drawn larger and scaled down: smooth edges


class Renderer:
    """Draws one state at a time.

    Args:
        system: what is drawn; its `draw` does the work.
        frames_per_second: of the window.
    """

    def __init__(self, system: ControlSystem, frames_per_second: int) -> None:
        self._system = system
        self._frames_per_second = frames_per_second
        self._window: Any = None
        self._clock: Any = None

    def __getstate__(self) -> dict[str, Any]:
        """A copy has no window until it shows something."""
        return {**self.__dict__, "_window": None, "_clock": None}

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

    def frame(
        self, state: FloatArray, action: int | None, table: FloatArray | None = None
    ) -> Frame:
        """The picture of a state, `(height, width, 3)`.

        Args:
            state: `(state_size,)`.
            action: what was done to reach it; None at the start of an episode.
            table: `(n_states, n_actions)`, drawn on top; None draws none.

        Raises:
            DependencyNotInstalled: pygame is missing.
        """
        pixels = self._pygame.surfarray.array3d(self._surface(state, action, table))
        return np.ascontiguousarray(pixels.transpose(1, 0, 2))

    def show(
        self, state: FloatArray, action: int | None, table: FloatArray | None = None
    ) -> None:
        """Show the picture in a window, no faster than real time."""
        pygame = self._pygame
        if self._window is None:
            pygame.display.init()  # the screen only: no sound is needed
            self._window = pygame.display.set_mode((SIZE, SIZE))
            pygame.display.set_caption(type(self._system).__name__)
            self._clock = pygame.time.Clock()
        self._window.blit(self._surface(state, action, table), (0, 0))
        pygame.event.pump()
        self._clock.tick(self._frames_per_second)
        pygame.display.flip()

    def close(self) -> None:
        """Close the window if there is one."""
        if self._window is not None:
            self._pygame.display.quit()
            self._window = None

    def _surface(
        self, state: FloatArray, action: int | None, table: FloatArray | None
    ) -> Any:
        large = self._pygame.Surface((_OVERSAMPLING * SIZE, _OVERSAMPLING * SIZE))
        self._system.draw(self._pygame, large, state, action)
        if table is not None:
            self._system.draw_table(self._pygame, large, table)
        return self._pygame.transform.smoothscale(large, (SIZE, SIZE))
