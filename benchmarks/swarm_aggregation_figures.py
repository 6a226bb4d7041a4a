"""Make the film and the figure of docs/swarm-aggregation.md, and print its numbers.

The film: 200 agents aggregate, and 200 others forage among obstacles. The figure: the
interaction, sizes beside their bounds, the law of the sum of squares, and the centre
under several channels.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from acl_gym.envs.control.rendering import Renderer
from acl_gym.envs.swarm_aggregation import SwarmAggregation
from acl_gym.envs.swarm_aggregation.shared import PAINTER
from acl_gym.envs.swarm_aggregation.world import TRAIL, Scene
from acl_gym.plotting import style
from acl_gym.swarm import Channel, Delayed, Everyone, Lossy, Nearest, Radius, run
from acl_gym.swarm.aggregation import (
    AggregatingAgents,
    BoundedRepulsion,
    Field,
    Gaussians,
    Interaction,
    Kinematic,
    Obstacles,
    UnboundedRepulsion,
    bounds,
    flow,
    rms_bound,
    rms_distance,
    size,
    size_bound,
    sum_of_squares,
)

OUT = Path(__file__).parent.parent / "docs" / "figures"

A, B, C = 1.0, 20.0, 0.2
COUNTS = (2, 3, 5, 10, 20, 50, 100)
CENTRES: dict[str, tuple[Channel, bool]] = {
    "Everyone()": (Everyone(), False),
    "Radius(1.3)": (Radius(1.3), False),
    "Lossy(Everyone(), 0.3, symmetric=True)": (
        Lossy(Everyone(), 0.3, symmetric=True),
        False,
    ),
    "Lossy(Everyone(), 0.3)": (Lossy(Everyone(), 0.3), False),
    "Radius of 0.6 to 1.6": (Radius(np.linspace(0.6, 1.6, 20)), False),
    "Nearest(5)": (Nearest(5), False),
    "Delayed(Everyone(), 1)": (Delayed(Everyone(), 1), False),
    "Everyone(), stale=True": (Everyone(), True),
}

SIDE = 300  # pixels of one of the two pictures in the film
FRAMES, HOLD = 60, 10
VALLEYS = ((2.9, 2.6, 9.0, 3.2), (2.4, -3.0, 1.0, 0.9), (-0.8, 3.5, -2.0, 1.0))
ROCKS = ((-0.7, -0.9, 0.8), (0.7, 1.0, 0.6), (1.4, -1.3, 0.6), (-1.7, 1.3, 0.5))


# --- numbers ----------------------------------------------------------------------------


def sizes() -> list[dict[str, float]]:
    """Resting swarms of the bounded repulsion beside their bounds."""
    rows = []
    for count in COUNTS:
        field = Field(count, time_step=min(0.01, 0.1 / count), bounds=(-2, 2))
        run(AggregatingAgents(), field, 10_000, 0)
        rows.append(
            {
                "agents": count,
                "size": size(field.positions),
                "size_bound": float(size_bound(count, A, B, C)),
                "rms": rms_distance(field.positions),
                "rms_bound": float(rms_bound(count, A, B, C)),
            }
        )
    return rows


def law() -> dict[str, Any]:
    """The sum of squares of 12 agents with the unbounded repulsion, and its law."""
    start = np.random.default_rng(0).normal(size=(12, 2))
    times = np.linspace(0.0, 0.2, 41)
    repulsion = UnboundedRepulsion()
    found = [sum_of_squares(x) for x in flow(start, repulsion, times, tolerance=1e-11)]
    wanted = bounds.sum_of_squares(times, found[0], 12, 1.0, 0.6)
    return {
        "times": times.tolist(),
        "measured": found,
        "law": wanted.tolist(),
        "largest_error": float(np.abs(found - wanted).max()),
    }


def centres() -> list[dict[str, Any]]:
    """How far the centre of 20 agents moves within 500 steps."""
    rows = []
    for name, (channel, stale) in CENTRES.items():
        field = Field(20, time_step=0.01)
        history = run(
            AggregatingAgents(), field, 500, 1, channel, stale=stale, record=("x",)
        )
        middle = history["x"].mean(axis=1)
        moved = np.linalg.norm(middle - middle[0], axis=1)
        rows.append(
            {
                "channel": name,
                "moved": float(moved.max()),
                "size": size(field.positions),
            }
        )
    return rows


# --- pictures ---------------------------------------------------------------------------


@style.in_style()
def draw(rows: list[dict[str, float]], found: dict[str, Any], path: Path) -> None:
    figure = style.new_figure(2.5)
    left, middle, right = figure.subplots(1, 3)
    r = np.linspace(0.02, 1.8, 400)
    for interaction, colour, label in (
        (BoundedRepulsion(), style.BLUE, "bounded"),
        (UnboundedRepulsion(), style.ORANGE, "unbounded"),
    ):
        along = interaction(np.stack([r, np.zeros_like(r)], axis=1))[:, 0]
        left.plot(r, along, color=colour, label=label)
    delta = float(BoundedRepulsion().rest_distance)
    left.axhline(0.0, **style.BOUND)
    left.plot([delta], [0.0], "o", color=style.BLACK, markersize=4)
    left.annotate("rest", (delta, 0.0), (delta + 0.05, 0.45), fontsize=8)
    left.set(ylim=(-2.0, 4.5), xlabel="distance r", ylabel="push, g along r")
    left.legend(loc="upper right")

    counts = [row["agents"] for row in rows]
    for key, colour in (("size", style.BLUE), ("rms", style.ORANGE)):
        middle.plot(counts, [row[key] for row in rows], "o-", color=colour, label=key)
        limits = [row[f"{key}_bound"] for row in rows]
        middle.plot(counts, limits, "--", color=colour, label="its bound")
    middle.set(xscale="log", ylim=(0, None), xlabel="agents", ylabel="length, at rest")
    middle.legend(loc="center right")

    right.plot(found["times"], found["law"], color="0.6", linewidth=3.5, label="law")
    right.plot(found["times"], found["measured"], "--", color=style.BLUE, label="swarm")
    right.axhline(float(bounds.resting_sum_of_squares(12, 1.0, 0.6)), **style.BOUND)
    right.set(ylim=(0, None), xlabel="time, s", ylabel="sum of squares S")
    right.legend(loc="upper right")
    for ax, title in (
        (left, "two agents"),
        (middle, "bounded repulsion"),
        (right, "unbounded repulsion"),
    ):
        ax.set_title(title, fontsize=9)
    figure.savefig(path)


def film(path: Path) -> None:
    """200 agents aggregate on the left, 200 forage on the right."""
    alone = _Camera(SwarmAggregation(half_width=4.0))
    meeting = Field(200, Kinematic(max_speed=4.0), time_step=0.004, bounds=(-3.9, 3.9))
    alone.watch(
        meeting, UnboundedRepulsion(attraction=0.02, repulsion=0.05), Everyone()
    )
    world = SwarmAggregation(half_width=4.5, valleys=VALLEYS, obstacles=ROCKS)
    rows, rocks = np.array(VALLEYS), np.array(ROCKS)
    start = np.random.default_rng(3).uniform([-4.1, -4.1], [-2.1, -1.8], (200, 2))
    foraging = Field(
        start,
        Kinematic(max_speed=1.5),
        time_step=0.02,
        profile=Gaussians(rows[:, :2], rows[:, 2], rows[:, 3]),
        obstacles=Obstacles(rocks[:, :2], rocks[:, 2], strength=30.0, reach=0.35),
    )
    beside = _Camera(world)
    beside.watch(
        foraging, UnboundedRepulsion(attraction=0.03, repulsion=0.025), Radius(1.2)
    )
    pairs = list(zip(alone.frames, beside.frames, strict=True))
    images = [
        Image.fromarray(np.concatenate(pair, axis=1)).quantize(96) for pair in pairs
    ]
    images += [images[-1]] * HOLD
    images[0].save(
        path,
        save_all=True,
        append_images=images[1:],
        duration=80,
        loop=0,
        optimize=True,
    )


class _Camera:
    """Takes frames of a swarm in a field as the environment draws its own."""

    def __init__(self, system: SwarmAggregation) -> None:
        self._renderer = Renderer(system, PAINTER, 20)
        self._before: list[np.ndarray] = []
        self.frames: list[np.ndarray] = []

    def watch(self, field: Field, interaction: Interaction, channel: Channel) -> None:
        every = 13

        def shoot(step: int, _: Any, __: Any) -> None:
            if step % every == 0:
                self._take(field, every * field.time_step)

        run(
            AggregatingAgents(interaction),
            field,
            FRAMES * every,
            0,
            channel,
            callback=shoot,
        )

    def _take(self, field: Field, passed: float) -> None:
        x = field.positions.copy()
        before = self._before[-1] if self._before else x
        limit = float(field.particles.max_speed)  # type: ignore[attr-defined]
        speeds = np.hypot(*(x - before).T) / passed / limit
        trail = np.array(self._before[-TRAIL:]).reshape(-1, len(x), 2)
        frame = self._renderer.frame(Scene(x, speeds, len(x), trail), None)
        small = Image.fromarray(frame).resize((SIDE, SIDE), Image.Resampling.LANCZOS)
        self.frames.append(np.asarray(small))
        self._before.append(x)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=OUT, help="a folder")
    parser.add_argument("--json", action="store_true", help="print JSON, draw nothing")
    options = parser.parse_args()
    rows, found, moved = sizes(), law(), centres()
    if options.json:
        print(json.dumps({"sizes": rows, "law": found, "centres": moved}))
        return
    print("bounded repulsion, a = 1, b = 20, c = 0.2, everyone hears everyone, at rest")
    for row in rows:
        print(
            f"  {row['agents']:4} agents: size {row['size']:.3f} < {row['size_bound']:.3f}"
            f", rms {row['rms']:.3f} < {row['rms_bound']:.3f}"
        )
    print(f"sum of squares: off its law by {found['largest_error']:.1e} at most")
    print("the centre of 20 agents moves within 500 steps, and they end within")
    for row in moved:
        print(f"  {row['channel']:40} {row['moved']:7.1e}  {row['size']:.2f}")
    options.out.mkdir(parents=True, exist_ok=True)
    draw(rows, found, options.out / "swarm-aggregation.png")
    film(options.out / "swarm-aggregation.gif")


if __name__ == "__main__":
    main()
