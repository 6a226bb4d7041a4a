"""How a colony learns the pendulum, as an animation: policy, pheromone, and a swing."""

from __future__ import annotations

import io
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LogNorm
from PIL import Image, ImageDraw

from acl_gym.agents.acl import ACL
from acl_gym.evaluation import evaluate_policy_cost, record_trajectory
from acl_gym.experiments import drawing, wording
from acl_gym.experiments.drawing import SMALL, TINY
from acl_gym.policies import TablePolicy
from acl_gym.reproduction.figures.policies import draw_map
from acl_gym.reproduction.settings import Study
from acl_gym.reproduction.systems import swing
from acl_gym.utils.files import write_atomically

SHOWN = (0, 2, 4, 6, 8, 10, 12, 15, 20, 30, 60, 100)
"""After these trials the policy is shown and followed."""

SECONDS = 3.0
"""How long the pendulum is swung by each policy."""

_STEP = 0.1  # sampling time, s
_BETWEEN = 2  # pictures from one sample to the next
_DPI = 110
_COLOURS = 128
_ROD, _BOB, _PIVOT = (40, 46, 54), (213, 94, 0), (120, 126, 134)


def animate(path: Path, seed: int = 0, shown: tuple[int, ...] = SHOWN) -> None:
    """Write the animation as a GIF.

    Args:
        path: where it goes; it appears whole or not at all.
        seed: of the colony: 250 ants on the fuzzy pendulum, Table 5.2.
        shown: after which trials, increasing.
    """
    setting = replace(swing("fuzzy"), trials=max(shown[-1], 1))
    study = Study("fuzzy", setting)
    env = setting.make_env()
    colony = ACL(env, setting.make_partition(), seed=seed, **setting.colony)
    frames: list[Any] = []
    for trial in shown:
        if trial > colony.trials:
            colony.learn(trials=trial - colony.trials)
        policy = colony.policy.copy()
        cost = evaluate_policy_cost(policy, env, max_steps=300).cost
        path_of = record_trajectory(
            policy, setting.make_env(1), np.zeros(2), max_steps=round(SECONDS / _STEP)
        )
        background, place = _background(study, policy, trial, cost)
        frames += _swing(background, place, path_of.states)
    reduced = _beside(frames[0], frames[-1]).quantize(_COLOURS)
    pictures = [frame.quantize(palette=reduced, dither=0) for frame in frames]
    buffer = io.BytesIO()
    pictures[0].save(
        buffer,
        format="gif",
        save_all=True,
        append_images=pictures[1:],
        duration=round(1000 * _STEP / _BETWEEN),
        loop=0,
        optimize=True,
    )
    write_atomically(path, buffer.getvalue())


def _beside(first: Any, last: Any) -> Any:
    """Two pictures as one, whose colours are those of all; the bob counts for more."""
    both = Image.new("RGB", (first.width, 2 * first.height + 60), _BOB)
    both.paste(first, (0, 0))
    both.paste(last, (0, first.height))
    return both


def _background(
    study: Study, policy: TablePolicy, trial: int, cost: float
) -> tuple[Any, tuple[float, float, float]]:
    """All but the pendulum; and where that is: x, y and length in pixels."""
    figure = drawing.new_figure(2.75, 7.2)
    left, middle, right = figure.subplots(1, 3, width_ratios=(1, 1.18, 1))
    draw_map(left, study, policy)
    left.set_ylabel(r"$\omega$ (rad/s)", fontsize=SMALL)
    left.set_title("policy", fontsize=SMALL, loc="left")
    n_theta, n_omega = study.setting.cells
    strongest = policy.table.max(axis=1).reshape(n_theta, n_omega).T
    shades = middle.imshow(
        strongest,
        origin="lower",
        aspect="auto",
        extent=(0.0, 2 * math.pi, -9.0, 9.0),
        cmap="cividis",
        norm=LogNorm(1e-4, 1.0),
        interpolation="nearest",
    )
    middle.set_xlabel(r"$\theta$ (rad)", fontsize=SMALL)
    middle.set_title("strongest pheromone", fontsize=SMALL, loc="left")
    middle.tick_params(labelsize=TINY)
    drawing.multiples_of_pi(middle.xaxis)
    figure.colorbar(shades, ax=middle, pad=0.02).ax.tick_params(labelsize=TINY)
    right.set_aspect("equal")
    right.set_xlim(-1.2, 1.2)
    right.set_ylim(-1.2, 1.2)
    right.set_axis_off()
    name = "before learning" if trial == 0 else f"after {trial} trials"
    right.set_title(
        f"{name}\npolicy cost {wording.cost(cost)}", fontsize=SMALL, loc="left"
    )
    figure.set_dpi(_DPI)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()  # type: ignore[no-untyped-call]
    pixels = canvas.buffer_rgba()  # type: ignore[no-untyped-call]
    image = Image.fromarray(np.asarray(pixels)).convert("RGB")
    centre, end = right.transData.transform([(0.0, 0.0), (1.0, 0.0)])
    return image, (centre[0], image.height - centre[1], end[0] - centre[0])


def _swing(
    background: Any, place: tuple[float, float, float], states: Any
) -> list[Any]:
    """Pictures of the pendulum on its way, and of how it has ended."""
    x, y, length = place
    theta = np.unwrap(states[:, 0], period=2 * math.pi)
    times = np.arange(0, len(theta) - 1 + 1e-9, 1 / _BETWEEN)
    angles = np.interp(times, np.arange(len(theta)), theta)
    still = round(SECONDS / _STEP * _BETWEEN) - len(angles)
    frames = []
    for angle in [*angles, *[angles[-1]] * max(still, 0)]:
        frame = background.copy()
        draw = ImageDraw.Draw(frame)
        bob = x + length * math.sin(angle), y + length * math.cos(angle)
        draw.line([(x, y), bob], fill=_ROD, width=4)
        for (u, v), radius, colour in (((x, y), 4, _PIVOT), (bob, 10, _BOB)):
            draw.ellipse((u - radius, v - radius, u + radius, v + radius), fill=colour)
        frames.append(frame)
    return frames
