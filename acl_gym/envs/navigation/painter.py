"""The picture of the 2-D navigation: vehicle, force and goal over the damping."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acl_gym.envs.control.rendering import Painter
from acl_gym.envs.navigation.system import Navigation
from acl_gym.utils.typing import FloatArray

Colour = tuple[int, int, int]

_PAPER: Colour = (255, 255, 255)
_DARKEST = np.array([112.0, 118.0, 130.0])  # the strongest damping
_WALL: Colour = (90, 90, 90)
_GOAL: Colour = (0, 158, 115)
_VEHICLE: Colour = (0, 114, 178)
_FORCE: Colour = (213, 94, 0)

_MARGIN = 0.045  # of the canvas, around the plane
_VEHICLE_RADIUS = 0.021
_FORCE_LENGTH = 0.1  # of the largest force, beyond the vehicle
_VELOCITY_SECONDS = 1.0  # the velocity line is how far the vehicle would drift


class NavigationPainter(Painter[Navigation]):
    """Draws the vehicle with its velocity and force, over the damping and the goal."""

    def draw(
        self, pygame: Any, canvas: Any, state: FloatArray, action: int | None
    ) -> None:
        """See `Painter.draw`; c1 is to the right, c2 upwards."""
        size = canvas.get_width()
        scale = (0.5 - _MARGIN) * size / self.system.position_max
        pygame.surfarray.blit_array(canvas, _background(self.system, size))
        low, high = _MARGIN * size, (1.0 - _MARGIN) * size
        wall = [(low, low), (high, low), (high, high), (low, high)]
        pygame.draw.lines(canvas, _WALL, True, wall, max(1, round(0.004 * size)))

        centre = np.array([0.5, 0.5]) * size
        outline = [tuple(centre + scale * point) for point in goal_outline(self.system)]
        pygame.draw.circle(canvas, _GOAL, tuple(centre), 0.045 * size, _line(size))
        pygame.draw.polygon(canvas, _GOAL, outline)

        c1, v1, c2, v2 = state.tolist()
        vehicle = centre + scale * np.array([c1, -c2])
        drift = vehicle + _VELOCITY_SECONDS * scale * np.array([v1, -v2])
        _draw_bar(pygame, canvas, _VEHICLE, vehicle, drift, 0.005 * size)
        if action is not None:
            _draw_force(self.system, pygame, canvas, vehicle, action, size)
        pygame.draw.circle(
            canvas, _PAPER, tuple(vehicle), (_VEHICLE_RADIUS + 0.003) * size
        )
        pygame.draw.circle(canvas, _VEHICLE, tuple(vehicle), _VEHICLE_RADIUS * size)


def goal_outline(system: Navigation) -> FloatArray:
    """The outline of the goal region for a vehicle at rest, m, shape `(n, 2)`."""
    if system.goal_rule == "bounds":
        half = min(system.goal_bounds[0], system.position_max)
        return np.array([[-half, -half], [half, -half], [half, half], [-half, half]])
    # (1 - |c1| / s)(1 - |c2| / s) = 0.5, one quarter and its three mirrored ones.
    spacing = system.goal_spacing[0]
    along = np.linspace(0.0, 0.5, 17)
    across = 1.0 - 0.5 / (1.0 - along)
    quarter = spacing * np.stack([along, across], axis=1)
    turned = [
        quarter @ np.array([[math.cos(a), -math.sin(a)], [math.sin(a), math.cos(a)]])
        for a in np.pi / 2 * np.arange(4)
    ]
    outline: FloatArray = np.concatenate(turned)
    return outline.clip(-system.position_max, system.position_max)


@lru_cache(maxsize=4)
def _background(system: Navigation, size: int) -> NDArray[np.uint8]:
    """The shades of the damping, `(size, size, 3)`: columns first, as pygame has it."""
    # From the middle of one pixel to the next, in m.
    pixels = (np.arange(size) + 0.5) / size - 0.5
    positions = pixels * system.position_max / (0.5 - _MARGIN)
    damping = system.damping(positions[:, None], -positions)
    inside = np.abs(positions) <= system.position_max
    plane = inside[:, None] & inside
    excess = damping - system.base_damping
    share = np.where(plane, excess / (excess[plane].max() or 1.0), 0.0)
    colours = np.array(_PAPER) + share[..., None] * (_DARKEST - np.array(_PAPER))
    return np.asarray(np.rint(colours), dtype=np.uint8)


def _line(size: int) -> int:
    return max(1, round(0.006 * size))


def _draw_bar(
    pygame: Any,
    canvas: Any,
    colour: Colour,
    start: FloatArray,
    end: FloatArray,
    width: float,
) -> None:
    """A line with square ends; pygame's own are slanted."""
    length = float(np.hypot(*(end - start)))
    if length < 1.0:
        return
    along = (end - start) / length
    side = 0.5 * width * np.array([-along[1], along[0]])
    corners = [start - side, start + side, end + side, end - side]
    pygame.draw.polygon(canvas, colour, [tuple(corner) for corner in corners])


def _draw_force(
    system: Navigation,
    pygame: Any,
    canvas: Any,
    vehicle: FloatArray,
    action: int,
    size: int,
) -> None:
    """An arrow from the vehicle's edge, as long as the force is large."""
    strength = float(np.hypot(*system.forces[action]))
    if strength == 0.0:
        return
    u1, u2 = system.forces[action]
    along = np.array([u1, -u2]) / strength
    side = np.array([-along[1], along[0]])
    largest = max(math.hypot(*force) for force in system.forces)
    head = 0.03 * size
    start = vehicle + _VEHICLE_RADIUS * size * along
    neck = start + _FORCE_LENGTH * size * strength / largest * along
    _draw_bar(pygame, canvas, _FORCE, start, neck, 0.013 * size)
    corners = [
        neck + 0.55 * head * side,
        neck - 0.55 * head * side,
        neck + head * along,
    ]
    pygame.draw.polygon(canvas, _FORCE, [tuple(corner) for corner in corners])
