"""The picture of the pendulum: pole, goal region and torque."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from acl_gym.envs.control.rendering import Painter
from acl_gym.envs.pendulum.system import Pendulum
from acl_gym.utils.typing import FloatArray

_PAPER = (255, 255, 255)
_GOAL = (205, 232, 216)
_POLE = (0, 114, 178)
_PIVOT = (40, 40, 40)
_TORQUE = (213, 94, 0)


class PendulumPainter(Painter[Pendulum]):
    """Draws the pole, the goal region behind it, and an arc for the torque."""

    def draw(self, pygame: Any, canvas: Any, state: FloatArray, action: Any) -> None:
        """See `Painter.draw`."""
        size = canvas.get_width()
        pivot = np.array([0.5, 0.5]) * size
        length = 0.36 * size

        canvas.fill(_PAPER)
        bound = self.system.goal_bounds[0]
        edge = np.linspace(math.pi - bound, math.pi + bound, 9)
        sector = [tuple(pivot), *(_point(size, a, 1.12 * length) for a in edge)]
        pygame.draw.polygon(canvas, _GOAL, sector)
        theta = float(state[0])
        width = 0.035 * size
        side = 0.5 * width
        normal = np.array([math.cos(theta), -math.sin(theta)]) * side
        tip = np.array(_point(size, theta, length))
        corners = [pivot - normal, pivot + normal, tip + normal, tip - normal]
        pygame.draw.polygon(canvas, _POLE, [tuple(c) for c in corners])
        pygame.draw.circle(canvas, _POLE, tuple(tip), 1.6 * width)
        pygame.draw.circle(canvas, _PIVOT, tuple(pivot), 0.8 * width)
        if action is None:
            torque = 0.0
        elif self.system.continuous:
            torque = float(action[0])
        else:
            torque = self.system.torques[action]
        if torque:
            self._draw_torque(pygame, canvas, torque, size)

    def _draw_torque(self, pygame: Any, canvas: Any, torque: float, size: int) -> None:
        """Draw an arrow along an arc over the pivot, whose length shows the torque."""
        share = torque / max(abs(u) for u in self.system.torques)
        radius, thickness = 0.1 * size, max(2, round(0.012 * size))
        angles = math.pi / 2 * np.linspace(0.0, 1.0, 25) * share
        middle = math.pi  # the arc is centred above the pivot
        arc = middle + angles - angles[-1] / 2
        points = [_point(size, a, radius) for a in arc]
        pygame.draw.lines(canvas, _TORQUE, False, points, thickness)
        forward = math.copysign(0.35, torque)
        head = [
            _point(size, arc[-1], radius + 0.025 * size),
            _point(size, arc[-1], radius - 0.025 * size),
            _point(size, arc[-1] + forward, radius),
        ]
        pygame.draw.polygon(canvas, _TORQUE, head)


def _point(size: int, angle: float, radius: float) -> tuple[float, float]:
    """A pixel; theta = 0 hangs down, positive angles turn counter-clockwise."""
    middle = 0.5 * size
    return middle + radius * math.sin(angle), middle + radius * math.cos(angle)
