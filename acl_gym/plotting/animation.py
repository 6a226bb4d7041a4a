"""How a colony learns the pendulum, as a GIF: policy, pheromone, and a swing-up."""

from __future__ import annotations

import io
import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import LogNorm
from PIL import Image, ImageDraw

from acl_gym.agents.base import TabularAgent
from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.evaluation import evaluate_policy_cost, record_trajectory
from acl_gym.plotting import pendulum, style
from acl_gym.policies import TablePolicy
from acl_gym.utils.files import write_atomically
from acl_gym.utils.text import digits

SHOWN = (0, 2, 4, 6, 8, 10, 12, 15, 20, 30, 60, 100)
"""After these trials the policy is shown and followed."""

_SECONDS = 3.0
"""How long the pendulum is swung by each policy."""

_BETWEEN = 2  # frames from one sample to the next
_DPI = 110
_COLOURS = 128
_ROD, _BOB, _PIVOT = (40, 46, 54), (213, 94, 0), (120, 126, 134)


def animate(
    path: Path,
    agent: TabularAgent,
    env: ControlVectorEnv,
    trials: tuple[int, ...] = SHOWN,
) -> None:
    """Let a colony learn the pendulum and write what it looks like as a GIF.

    Args:
        path: of the file, which appears complete or not at all.
        agent: a new colony on the pendulum; it learns.
        env: the pendulum on which its policies are shown, with one slot.
        trials: after which trials the policy is shown, increasing.
    """
    system: Any = env.system
    step = system.sampling_time
    frames: list[Image.Image] = []
    for trial in trials:
        if trial > agent.trials:
            agent.learn(trials=trial - agent.trials)
        policy = agent.policy.copy()
        cost = evaluate_policy_cost(policy, env).cost
        name = f"after {trial} trials" if trial else "before learning"
        title = f"{name}\npolicy cost {digits(cost)}"
        steps = round(_SECONDS / step)
        swing = record_trajectory(policy, env, np.zeros(2), max_steps=steps)
        frames += _swing(*_background(title, env, policy), swing.states[:, 0], steps)
    # One palette for all frames, from the first and the last and much of the bob's colour.
    both = Image.new("RGB", (frames[0].width, 2 * frames[0].height + 60), _BOB)
    both.paste(frames[0], (0, 0))
    both.paste(frames[-1], (0, frames[0].height))
    palette = both.quantize(_COLOURS)
    first, *rest = (
        frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames
    )
    buffer = io.BytesIO()
    duration = round(1000 * step / _BETWEEN)
    options = {"save_all": True, "append_images": rest, "loop": 0, "optimize": True}
    first.save(buffer, format="gif", duration=duration, **options)
    write_atomically(path, buffer.getvalue())


@style.in_style()
def _background(
    title: str, env: ControlVectorEnv, policy: TablePolicy
) -> tuple[Image.Image, float, float, float]:
    """All but the pendulum; and x, y and length of that in pixels."""
    figure = style.new_figure(2.75)
    left, middle, right = figure.subplots(1, 3, width_ratios=(1, 1.18, 1))
    pendulum.draw_policy(left, env, policy)
    left.set_title("policy")
    left.set_ylabel(pendulum.OMEGA)
    strongest = policy.table.max(axis=1).reshape(pendulum.cells_of(policy)).T
    shades = middle.imshow(
        strongest,
        origin="lower",
        extent=(*left.get_xlim(), *left.get_ylim()),
        cmap="cividis",
        norm=LogNorm(1e-4, 1.0),
    )
    middle.grid(visible=False)
    middle.set_title("strongest pheromone")
    style.multiples_of_pi(middle.xaxis)
    for ax in (left, middle):
        ax.set_xlabel(pendulum.THETA)
    figure.colorbar(shades, ax=middle, pad=0.02)
    right.set_aspect("equal")
    right.set_xlim(-1.2, 1.2)
    right.set_ylim(-1.2, 1.2)
    right.set_axis_off()
    right.set_title(title)
    figure.set_dpi(_DPI)
    canvas: Any = figure.canvas
    canvas.draw()
    image = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
    centre, end = right.transData.transform([(0.0, 0.0), (1.0, 0.0)])
    return image, centre[0], image.height - centre[1], end[0] - centre[0]


def _swing(
    background: Image.Image, x: float, y: float, length: float, angles: Any, steps: int
) -> list[Image.Image]:
    """The pendulum on its way, and standing still as it has ended."""
    theta = np.unwrap(angles, period=2 * math.pi)
    count = steps * _BETWEEN
    frames = []
    for angle in np.interp(np.arange(count) / _BETWEEN, np.arange(len(theta)), theta):
        frame = background.copy()
        draw = ImageDraw.Draw(frame)
        bob = x + length * math.sin(angle), y + length * math.cos(angle)
        draw.line([(x, y), bob], fill=_ROD, width=4)
        for (u, v), radius, colour in (((x, y), 4, _PIVOT), (bob, 10, _BOB)):
            draw.ellipse((u - radius, v - radius, u + radius, v + radius), fill=colour)
        frames.append(frame)
    return frames
