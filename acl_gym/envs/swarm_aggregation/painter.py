"""The picture of a swarm: agents coloured by speed, their trails, valleys and obstacles."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from acl_gym.envs.control.rendering import Painter
from acl_gym.envs.swarm_aggregation.system import SwarmAggregation
from acl_gym.envs.swarm_aggregation.world import Scene
from acl_gym.utils.typing import FloatArray, IntArray

_PAPER = np.array([255.0, 255.0, 255.0])
_VALLEY = np.array([0.0, 158.0, 115.0])
_HILL = np.array([213.0, 94.0, 0.0])
_ROCK = (110, 110, 116)
_LEARNER = (213, 94, 0)
_EDGE = (255, 255, 255)
_SLOW, _FAST = np.array([0.0, 40.0, 85.0]), np.array([50.0, 150.0, 225.0])
_TRAIL, _LEARNERS_TRAIL = (203, 219, 235), (242, 196, 160)
_DEEPEST = 0.45  # how much of the colour of a valley the picture takes at its deepest

_BACKGROUND = 120  # pixels of the profile, which is smooth
_SHADES = 64  # of speeds


class SwarmAggregationPainter(Painter[SwarmAggregation]):
    """Draws the world: food is green, danger orange, obstacles grey.

    Agents are blue, the lighter the faster. An agent that learns among others that do
    not is orange.
    """

    def draw(self, pygame: Any, canvas: Any, state: Scene, action: Any) -> None:
        """See `Painter.draw`."""
        size = canvas.get_width()
        self._draw_profile(pygame, canvas)
        for x, y, radius in self.system.obstacles:
            centre = self._pixels(np.array([[x, y]]), size)[0].tolist()
            scale = size / (2.0 * self.system.half_width)
            pygame.draw.circle(canvas, _ROCK, centre, radius * scale)
        self._draw_trails(pygame, canvas, state)
        shades = self._shades(state.speeds)
        pixels = self._pixels(state.positions, size).tolist()
        radius = _radius(len(pixels), size)
        # The others first, so that those that learn are seen.
        for i in range(len(pixels) - 1, -1, -1):
            if self._stands_out(state, i):
                pygame.draw.circle(canvas, _EDGE, pixels[i], radius * 1.9)
                pygame.draw.circle(canvas, _LEARNER, pixels[i], radius * 1.5)
            else:
                pygame.draw.circle(canvas, self._colours[shades[i]], pixels[i], radius)

    def _stands_out(self, state: Scene, agent: int) -> bool:
        return agent < state.learners < len(state.positions)

    def _pixels(self, positions: FloatArray, size: int) -> IntArray:
        """Where positions are drawn; y grows upwards."""
        shares = positions / (2.0 * self.system.half_width) + 0.5
        shares[..., 1] = 1.0 - shares[..., 1]
        return np.rint(shares * (size - 1)).astype(np.int64)

    def _shades(self, speeds: FloatArray) -> list[int]:
        share = np.clip(speeds / self.system.max_speed, 0.0, 1.0)
        return np.rint(share * (_SHADES - 1)).astype(int).tolist()  # type: ignore[no-any-return]

    @cached_property
    def _colours(self) -> list[tuple[int, ...]]:
        """From slow to fast."""
        share = np.linspace(0.0, 1.0, _SHADES)[:, None]
        mixed = np.rint(_SLOW + share * (_FAST - _SLOW)).astype(int)
        return [tuple(each) for each in mixed.tolist()]

    def _draw_trails(self, pygame: Any, canvas: Any, state: Scene) -> None:
        """A line through earlier positions of each agent, paler than its dot."""
        if not len(state.trail):
            return
        size = canvas.get_width()
        way = np.concatenate([state.trail, state.positions[None]]).transpose(1, 0, 2)
        width = max(1, round(0.6 * _radius(len(way), size)))
        for i, points in enumerate(self._pixels(way, size).tolist()):
            colour = _LEARNERS_TRAIL if self._stands_out(state, i) else _TRAIL
            pygame.draw.lines(canvas, colour, False, points, width)

    def _draw_profile(self, pygame: Any, canvas: Any) -> None:
        surface = pygame.surfarray.make_surface(self._background)
        pygame.transform.smoothscale(surface, canvas.get_size(), canvas)

    @cached_property
    def _background(self) -> Any:
        """Colours of the profile, `(columns, rows, 3)` from the top, uint8."""
        profile, edge = self.system.profile, self.system.half_width
        line = np.linspace(-edge, edge, _BACKGROUND)
        if profile is None:
            plain = np.broadcast_to(_PAPER, (_BACKGROUND, _BACKGROUND, 3))
            return plain.astype(np.uint8)
        x, y = np.meshgrid(line, line[::-1], indexing="ij")
        height = profile.value(np.stack([x, y], axis=-1))
        share = _DEEPEST * height / (np.abs(height).max() or 1.0)
        towards = np.where(share[..., None] < 0, _VALLEY, _HILL)
        mixed = _PAPER + np.abs(share)[..., None] * (towards - _PAPER)
        return np.rint(mixed).astype(np.uint8)


def _radius(count: int, size: int) -> float:
    """Of a dot, in pixels: the more agents, the smaller."""
    return size / 480.0 * float(np.clip(30.0 / np.sqrt(count), 1.4, 5.0))
