"""The picture of the double bridge: nest, food, branches as arcs, and the ant."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from acl_gym.envs.control.rendering import Painter
from acl_gym.envs.graph.double_bridge.system import NEST, DoubleBridge
from acl_gym.utils.typing import FloatArray

_PAPER = (255, 255, 255)
_BRIDGE = (150, 150, 150)
_NEST = (0, 0, 0)
_FOOD = (0, 158, 115)
_ANT = (213, 94, 0)

_ENDS = (0.12, 0.88)
"""Where the bridge begins and ends, in widths of the canvas."""

_POINTS = 61


class DoubleBridgePainter(Painter[DoubleBridge]):
    """Draws the branches as arcs: the longer one swings out further.

    The nest is black, the food green, the ant orange. A closed branch has a gap.
    """

    def draw(
        self, pygame: Any, canvas: Any, state: FloatArray, action: int | None
    ) -> None:
        """See `Painter.draw`."""
        size = canvas.get_width()
        canvas.fill(_PAPER)
        width, radius = max(1, size // 120), size // 32
        system = self.system
        for module in range(system.modules):
            for branch in range(2):
                shares = np.linspace(0, 1, _POINTS)
                points = [self._point(module, branch, share, size) for share in shares]
                gap = branch == system.closed
                third = _POINTS // 3
                parts = (points[:third], points[-third:]) if gap else (points,)
                for part in parts:
                    pygame.draw.lines(canvas, _BRIDGE, False, part, width)
        nest, food = (self._where(place, size) for place in (NEST, system.food))
        pygame.draw.circle(canvas, _NEST, nest, 2 * radius)
        pygame.draw.circle(canvas, _FOOD, food, 2 * radius)
        pygame.draw.circle(canvas, _ANT, self._where(int(state[0]), size), radius)

    def _where(self, state: int, size: int) -> tuple[int, int]:
        module, branch, share = self.system.place(state)
        return self._point(module, branch or 0, share, size)

    def _point(
        self, module: int, branch: int, share: float, size: int
    ) -> tuple[int, int]:
        """The pixel of a point on a branch."""
        left, right = _ENDS
        span = (right - left) / self.system.modules
        # The first branch of a module is on the left of an ant that walks to the right,
        # which is up, and in the next module it is on its right.
        side = 1 if self.system.branch_of(module, 0) == branch else -1
        swing = self._swing(branch) * min(span, 0.8)
        x = left + (module + share) * span
        y = 0.5 - side * swing * math.sin(math.pi * share)
        return int(x * size), int(y * size)

    def _swing(self, branch: int) -> float:
        """How far a branch swings out, in widths of a module, at most half of one."""
        ratio = self.system.lengths[branch] / min(self.system.lengths)
        return min(0.5, 0.2 * ratio)
