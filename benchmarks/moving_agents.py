"""Make the figures of docs/moving-agents.md, and print its numbers.

Agents meet by going to the mean of those that they hear, under every channel; what the
strict reading of Definition 6.2 changes; and a drawing of the framework, Figure 6.1.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

from acl_gym.plotting import style
from acl_gym.swarm import (
    AggregatingAgents,
    Channel,
    ConsensusAgents,
    Delayed,
    Environment,
    Everyone,
    Field,
    Lossy,
    Nearest,
    Radius,
    Ring,
    VonNeumann,
    run,
)
from acl_gym.utils import validation

OUT = Path(__file__).parent.parent / "docs" / "figures"

CHANNELS: tuple[Channel, ...] = (
    Everyone(),
    Ring(2),
    VonNeumann(),
    Radius(0.3),
    Nearest(5),
    Lossy(Everyone(), 0.3),
    Lossy(Everyone(), 0.3, symmetric=True),
    Delayed(Everyone(), 2),
)
AGENTS, STEPS = 60, 100
RING, RING_STEPS = 12, 120

GREY = "0.6"
CODE: dict[str, Any] = {"family": "monospace", "fontsize": 7.5, "color": "0.35"}
ARROW: dict[str, Any] = {
    "arrowstyle": "-|>",
    "mutation_scale": 11,
    "shrinkA": 0,
    "shrinkB": 0,
    "linewidth": 1.2,
}


class Plane(Environment):
    """Points in the unit square that move by their inputs."""

    def __init__(self, n: int) -> None:
        self._n = n

    def reset(self, rng: np.random.Generator) -> None:
        self.x = rng.random((self._n, 2))

    def observe(self) -> Any:
        return self.x

    def step(self, u: Any, rng: np.random.Generator) -> None:
        self.x = self.x + u


def centre_moved(x: Any) -> Any:
    """How far the centre is from where it began, in each step."""
    centre = x.mean(axis=1)
    return np.linalg.norm(centre - centre[0], axis=1)


def disagreement(x: Any) -> Any:
    """The root mean square distance of agents from their centre, in each step."""
    return np.sqrt(((x - x.mean(axis=1, keepdims=True)) ** 2).sum(axis=2).mean(axis=1))


def meetings(seed: int) -> list[dict[str, Any]]:
    """Where agents meet under each channel."""
    rows = []
    for channel in CHANNELS:
        x = run(ConsensusAgents(), Plane(AGENTS), STEPS, seed, channel, record=("x",))[
            "x"
        ]
        rows.append(
            {
                "channel": repr(channel),
                "disagreement": float(disagreement(x)[-1]),
                "centre_moved": float(centre_moved(x)[-1]),
            }
        )
    return rows


def readings(seed: int) -> dict[str, Any]:
    """What both readings of Definition 6.2 come to, step by step."""
    found: dict[str, Any] = {}
    for name, stale in (("split", False), ("strict", True)):
        agents, plane = ConsensusAgents(gain=1.0), Plane(RING)
        ring = run(agents, plane, RING_STEPS, seed, Ring(), stale=stale, record=("x",))
        # They attract each other, and repel those that are near: eq. (6.5).
        field = Field(20, bounds=(0.0, 1.0), time_step=0.002)
        cluster = run(AggregatingAgents(), field, 400, seed, stale=stale, record=("x",))
        found[name] = {
            "disagreement": disagreement(ring["x"]),
            "centre_moved": centre_moved(cluster["x"]),
        }
    # The slowest mode of averaging over oneself and both neighbours on a ring.
    slowest = (1.0 + 2.0 * np.cos(2.0 * np.pi / RING)) / 3.0
    found["factors"] = {"split": float(slowest), "strict": float(np.sqrt(slowest))}
    return found


def draw_readings(found: dict[str, Any], path: Path) -> None:
    """Draw both readings."""
    with style.in_style():
        figure = style.new_figure(2.9, 7.6)
        meeting, cluster = figure.subplots(1, 2)
        names = {"split": "observe, send, hear", "strict": "Definition 6.2, literally"}
        for (name, label), colour in zip(
            names.items(), (style.BLUE, style.ORANGE), strict=True
        ):
            rows = found[name]["disagreement"]
            meeting.semilogy(rows, color=colour, label=label)
            moved = np.maximum.accumulate(found[name]["centre_moved"])
            moved[moved == 0.0] = np.nan  # no logarithm
            cluster.semilogy(moved, color=colour, label=label)
        meeting.set(xlabel="step", ylabel="distance from the centre, rms")
        meeting.set_title("meeting on a ring: twice as many steps")
        meeting.legend(loc="lower left")
        cluster.set(xlabel="step", ylabel="most that the centre has moved")
        cluster.set_ylim(1e-17, 1.0)
        cluster.set_title("attraction and repulsion: the centre moves")
        figure.savefig(path, dpi=200)


def draw_framework(path: Path) -> None:
    """Draw Figure 6.1: who tells whom what."""
    with style.in_style():
        figure = style.new_figure(3.7, 7.6)
        figure.set_layout_engine("none")
        ax = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        ax.set(xlim=(0.0, 7.6), ylim=(0.0, 3.7))
        ax.axis("off")

        box(ax, (4.3, 0.15), (3.15, 3.4), GREY)
        words(ax, (5.87, 3.28), "environment", code="Environment")
        cards(ax, (0.2, 0.35), (1.75, 2.75), style.BLUE)
        words(
            ax, (1.07, 2.1), "dynamic agents", "$A_1, \\ldots, A_N$",
            "internal states $z_i$", code="DynamicAgents",
        )  # fmt: skip
        cards(ax, (4.65, 2.1), (2.05, 0.68), style.GREEN)
        words(ax, (5.68, 2.55), "particles $P_1, \\ldots, P_N$", "states $x_i$")
        box(ax, (4.65, 1.25), (2.05, 0.6), style.GREEN)
        words(ax, (5.68, 1.67), "process", "state $\\psi$")
        box(ax, (4.65, 0.25), (2.05, 0.78), style.ORANGE)
        words(ax, (5.68, 0.85), "channel", "neighbours $N_i$", code="Channel")

        left, right = 2.13, 4.3
        arrow(ax, (left, 2.75), (right, 2.75), "inputs $u_i$", "decide")
        arrow(ax, (right, 1.75), (left, 1.75), "observations $y_i$", "observe")
        right = 4.65
        arrow(ax, (left, 0.88), (right, 0.88), "messages $v_i$", "send", style.ORANGE)
        arrow(ax, (right, 0.42), (left, 0.42), "messages $w_i$", "hear", style.ORANGE)
        # Who is near whom follows from where the particles are.
        ax.add_patch(
            FancyArrowPatch(
                (6.88, 2.45),
                (6.72, 0.62),
                connectionstyle="arc3,rad=-0.35",
                color="0.15",
                **ARROW,
            )
        )
        ax.text(7.24, 1.55, "$x_s$", ha="center", va="center", fontsize=9)
        figure.savefig(path, dpi=200)


def box(ax: Any, corner: Any, size: Any, colour: str) -> None:
    """A box that hides what is behind it."""
    pale = 1.0 - 0.12 * (1.0 - np.array(to_rgb(colour)))
    shape = "round,pad=0,rounding_size=0.08"
    ax.add_patch(
        FancyBboxPatch(
            corner, *size, boxstyle=shape, facecolor=pale, edgecolor=colour, linewidth=1
        )
    )


def cards(ax: Any, corner: Any, size: Any, colour: str) -> None:
    """A pile of boxes."""
    for shift in (0.16, 0.08, 0.0):
        box(ax, (corner[0] + shift, corner[1] + shift), size, colour)


def words(ax: Any, at: Any, title: str, *lines: str, code: str = "") -> None:
    """A title with lines below it, the last of them the name of a class."""
    x, y = at
    ax.text(x, y, title, ha="center", va="center", weight="bold", fontsize=9)
    for row, line in enumerate(lines, start=1):
        ax.text(x, y - 0.23 * row, line, ha="center", va="center", fontsize=8.5)
    y -= 0.24 * (len(lines) + 1)
    ax.text(x, y, code, ha="center", va="center", **CODE)


def arrow(
    ax: Any, start: Any, end: Any, label: str, method: str, colour: str = "0.15"
) -> None:
    """An arrow with what goes along it above, and the method of the agents below."""
    ax.add_patch(FancyArrowPatch(start, end, color=colour, **ARROW))
    middle = 0.5 * (2.13 + 4.3)
    ax.text(middle, start[1] + 0.11, label, ha="center", va="center", fontsize=8.5)
    ax.text(
        middle, start[1] - 0.12, method, ha="center", va="center", **CODE,
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=OUT, help="a folder")
    parser.add_argument("--json", action="store_true", help="print JSON, draw nothing")
    options = parser.parse_args()
    try:
        validation.seed(options.seed)
    except ValueError as error:
        parser.error(str(error))

    rows, found = meetings(options.seed), readings(options.seed)
    both = {
        name: {
            "factor": found["factors"][name],
            "measured": float(
                (found[name]["disagreement"][60] / found[name]["disagreement"][20])
                ** (1 / 40)
            ),
            "centre_moved": float(found[name]["centre_moved"][-1]),
        }
        for name in ("split", "strict")
    }
    if options.json:
        print(json.dumps({"channels": rows, "readings": both}))
        return
    print(
        f"{AGENTS} agents meet for {STEPS} steps: where they end, rms from the centre"
    )
    for row in rows:
        print(
            f"  {row['channel']:58} {row['disagreement']:7.1e}, the centre has moved "
            f"by {row['centre_moved']:7.1e}"
        )
    print("one step multiplies the disagreement on a ring of 12 agents by")
    for name, row in both.items():
        print(
            f"  {name:6} {row['measured']:.4f} (in theory {row['factor']:.4f}); with "
            f"attraction and repulsion the centre moves by {row['centre_moved']:.1e}"
        )
    options.out.mkdir(parents=True, exist_ok=True)
    draw_framework(options.out / "moving-agents.png")
    draw_readings(found, options.out / "moving-agents-readings.png")


if __name__ == "__main__":
    main()
