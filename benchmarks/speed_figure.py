"""The figure of throughput.py: steps per second over the number of ants."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from acl_gym.plotting.style import WIDTH, in_style

PANELS = ("pendulum", "navigation", "grid-1d", "grid-2d")
PEER_SLOTS = 2_048  # close to the 2,000 of the curves; measured for the ratios only
# Part of the name of a case -> label, colour, dashes.
CURVES = {
    " alone": ("environment alone", "#333333", (0, (1, 1))),
    "fuzzy {system} selecting": ("with selection, fuzzy", "#56B4E9", (0, (4, 1.2))),
    "fuzzy {system} learning,": ("learning, fuzzy", "#D55E00", "-"),
    "crisp {system} learning,": ("learning, crisp", "#E69F00", (0, (4, 1.2))),
    "discrete {system} learning,": ("learning, discrete", "#CC79A7", "-"),
    "learning in NumPy": ("learning, fuzzy, NumPy", "#009E73", (0, (6, 1, 1, 1))),
}


@in_style()
def draw(cases: list[dict[str, Any]], path: str) -> None:
    """Write the figure; the suffix of the path selects the format."""
    systems = [name for name in PANELS if any(case["system"] == name for case in cases)]
    if not systems:
        raise SystemExit(
            "no system was measured, so there is nothing to draw; add --systems."
        )
    rows = (len(systems) + 1) // 2
    columns = min(2, len(systems))
    figure = Figure(figsize=(0.5 * WIDTH * columns, 0.5 + 2.4 * rows))
    axes = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    used: dict[str, Line2D] = {}
    for ax, system in zip(axes.flat, systems, strict=False):
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.set_title(system, loc="left")
        own = [case for case in cases if case["system"] == system]
        for pattern, (label, color, dashes) in CURVES.items():
            part = pattern.format(system=system)
            points = sorted(
                (case["n_ants"], case["steps_per_second"], case["slowest"],
                 case["fastest"])
                for case in own
                if part in case["name"]
                and "single" not in case["name"]
                and case["n_ants"] != PEER_SLOTS
            )  # fmt: skip
            if not points:
                continue
            ants, middle, slowest, fastest = zip(*points, strict=True)
            (line,) = ax.plot(ants, middle, color=color, linestyle=dashes, marker=".",
                              linewidth=1.3, markersize=4)  # fmt: skip
            ax.fill_between(ants, slowest, fastest, color=color, alpha=0.15, lw=0)
            used[label] = line
        _peers(ax, cases, used, own_panel=system == "pendulum")
    for ax in axes[:, 0]:
        ax.set_ylabel("slot-steps per second")
    for ax in axes[-1]:
        ax.set_xlabel("ants or slots")
    for ax in axes.flat[len(systems) :]:
        ax.set_visible(False)
    for label, line in used.items():
        line.set_label(label)
    figure.legend(
        handles=list(used.values()), loc="outside lower center", ncols=3, fontsize=7.5
    )
    figure.savefig(path, dpi=200)


def _peers(
    ax: Any, cases: list[dict[str, Any]], used: dict[str, Line2D], *, own_panel: bool
) -> None:
    """Draw Gymnasium's CartPole in every panel, other pendulums in our pendulum's."""
    points = sorted(
        (case["n_ants"], case["steps_per_second"])
        for case in cases
        if case["name"].startswith("CartPole") and case["n_ants"] != PEER_SLOTS
    )
    if points:
        ants, rates = zip(*points, strict=True)
        (line,) = ax.plot(ants, rates, color="0.6", linewidth=1.0)
        used["Gymnasium's CartPole alone"] = line
    others = {"gymnax": "^", "envpool": "s", "DQN": "v", "synchronous": "d"}
    for word, marker in others.items():
        if not own_panel:
            return
        for case in (case for case in cases if word in case["name"]):
            (line,) = ax.plot(
                case["n_ants"],
                case["steps_per_second"],
                color="#0072B2",
                marker=marker,
                markersize=5,
                linestyle="",
            )
            label = {
                "gymnax": "gymnax's pendulum (all cores)",
                "envpool": "EnvPool's pendulum",
                "DQN": "DQN learning",
                "synchronous": "our single pendulums in a row",
            }[word]
            used[label] = line
