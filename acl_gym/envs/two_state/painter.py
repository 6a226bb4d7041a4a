"""The picture of the two-state system: states as circles, actions as lines."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from acl_gym.envs.control.rendering import Painter
from acl_gym.envs.two_state.kernels import AT_GOAL
from acl_gym.envs.two_state.system import TwoState
from acl_gym.utils.typing import FloatArray

_PAPER = (255, 255, 255)
_STATE = (0, 0, 0)
_ANT = (213, 94, 0)
_WAY = (150, 150, 150)


class TwoStatePainter(Painter[TwoState]):
    """Draws the states as circles and the actions as lines between them.

    The circle of the ant's state is filled.
    """

    def draw(
        self, pygame: Any, canvas: Any, state: FloatArray, action: int | None
    ) -> None:
        """See `Painter.draw`."""
        size = canvas.get_width()
        places = [(int(x * size), size // 2) for x in (0.15, 0.5, 0.85)]
        thin, thick = max(1, size // 240), max(3, size // 80)
        canvas.fill(_PAPER)
        taken = action is not None and int(state[0]) == AT_GOAL
        pygame.draw.line(canvas, _WAY, places[0], places[1], thin)
        n_actions = len(self.system.costs)
        for u in range(n_actions):
            # Arcs between q' and the goal, side by side, the best action uppermost.
            lift = (u - (n_actions - 1) / 2) * 0.6 * size / n_actions
            points = [
                (
                    places[1][0] + share * (places[2][0] - places[1][0]),
                    places[1][1] + lift * math.sin(math.pi * share),
                )
                for share in np.linspace(0, 1, 25)
            ]
            here = taken and u == action
            colour, width = (_ANT, thick) if here else (_WAY, thin)
            pygame.draw.lines(canvas, colour, False, points, width)
        for number, place in enumerate(places):
            pygame.draw.circle(canvas, _PAPER, place, size // 16)
            there = number == int(state[0])
            colour, width = (_ANT, 0) if there else (_STATE, thin)
            pygame.draw.circle(canvas, colour, place, size // 16, width)
