"""A picture of any plant: a gauge for each state variable and each input."""

from __future__ import annotations

from typing import Any

from acl_gym.envs.control.rendering import Painter
from acl_gym.envs.plant.system import Plant
from acl_gym.utils.typing import FloatArray

_PAPER = (255, 255, 255)
_SCALE = (225, 225, 225)
_GOAL = (170, 215, 190)
_STATE = (0, 114, 178)
_INPUT = (213, 94, 0)


class PlantPainter(Painter[Plant]):
    """Draws a bar for each variable with its goal and value; below, the inputs."""

    def draw(self, pygame: Any, canvas: Any, state: FloatArray, action: Any) -> None:
        """See `Painter.draw`."""
        canvas.fill(_PAPER)
        system = self.system
        inputs = system.inputs
        state = state[: system.low.size]  # without uncertain parameters
        gauges = state.size + inputs.shape[1]
        size = canvas.get_width()
        height = size / gauges
        goal = system.goal_box
        for i in range(gauges):
            top, left, width = (i + 0.3) * height, 0.06 * size, 0.88 * size
            pygame.draw.rect(canvas, _SCALE, (left, top, width, 0.4 * height))
            if i < state.size:
                low, high, value = system.low[i], system.high[i], state[i]
                if goal is not None:
                    turns = (-1, 0, 1) if i in system.circular else (0,)
                    for edges in (goal[:, i] + turn * (high - low) for turn in turns):
                        if edges[1] < low or edges[0] > high:
                            continue
                        begin, end = (
                            left + width * _share(edge, low, high) for edge in edges
                        )
                        area = (begin, top, max(end - begin, 2.0), 0.4 * height)
                        pygame.draw.rect(canvas, _GOAL, area)
                colour = _STATE
            else:
                column = inputs[:, i - state.size]
                low, high = min(column.min(), 0.0), max(column.max(), 0.0)
                value = 0.0
                if action is not None:
                    real = system.real_inputs
                    value = action[i - state.size] if real else column[action]
                colour = _INPUT
            x = left + width * _share(value, low, high)
            mark = (x - 0.008 * size, top - 0.1 * height, 0.016 * size, 0.6 * height)
            pygame.draw.rect(canvas, colour, mark)


def _share(value: float, low: float, high: float) -> float:
    """How far a value lies between two others, within 0 and 1."""
    if high == low:
        return 0.5
    return float(min(max((value - low) / (high - low), 0.0), 1.0))
