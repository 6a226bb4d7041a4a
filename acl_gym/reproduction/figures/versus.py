"""ACL against reinforcement learning: learning curves, last costs, sweeps, orders."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from acl_gym.experiments import drawing
from acl_gym.experiments.drawing import SMALL, STYLES, TINY
from acl_gym.reproduction.evidence import Evidence
from acl_gym.reproduction.settings import Experiment
from acl_gym.reproduction.verdicts import interval
from acl_gym.reproduction.versus.contest import Contest
from acl_gym.reproduction.versus.findings import contests, reference_of
from acl_gym.reproduction.versus.spaces import LONG, NAMES
from acl_gym.utils.typing import FloatArray

_STYLES = {
    "acl": STYLES["acl-fuzzy"],
    "q": STYLES["q-fuzzy"],
    "q-lambda": STYLES["q-lambda-fuzzy"],
    "dqn": STYLES["dqn"],
    LONG: STYLES["acl-crisp"],
}
_MARKERS = {LONG: "P", "acl": "o", "q": "s", "q-lambda": "^", "dqn": "D"}
_SHORT = {"acl": "ACL", "q": "Q", "q-lambda": "Q(λ)", "dqn": "DQN", LONG: "4 ACL"}
_POINTS = 300
_NARROW = 1.05


def race(experiment: Experiment, evidence: Evidence) -> Figure:
    """Cost of policies over interactions and over seconds, and the last ones."""
    name, cost = reference_of(experiment, evidence)
    figure = drawing.new_figure(3.1)
    steps, seconds, last = figure.subplots(1, 3, width_ratios=(1.0, 1.0, 0.8))
    seconds.sharey(steps)
    found = contests(experiment)
    for contest in found.values():
        _curve(steps, evidence.runs(contest), "env_steps", contest.method)
        _curve(seconds, evidence.runs(contest), "seconds", contest.method)
    for ax, label in ((steps, "interactions"), (seconds, "seconds of learning")):
        drawing.prepare(ax)
        ax.set_xscale("log")
        ax.set_xlabel(label, fontsize=SMALL)
        ax.axhline(cost, **drawing.BOUND)
    drawing.prepare(last)
    last.set_yscale("log")
    _strips(last, {each.method: each for each in found.values()}, evidence)
    last.axhline(cost, **drawing.BOUND)  # its own scale: they are close together
    last.set_xlabel("last policies", fontsize=SMALL)
    drawing.plain_log(last.yaxis, sparse=True)
    steps.set_yscale("log")
    seconds.tick_params(labelleft=False)
    steps.set_ylabel("policy cost $J^h$", fontsize=SMALL)
    steps.set_ylim(bottom=cost / 1.4)  # room for the name of the line
    drawing.plain_log(steps.yaxis, sparse=True)
    drawing.optimal_cost_line(steps, cost, "J*" if name == "J*" else "best known")
    _legend(figure, [contest.method for contest in found.values()])
    return figure


def _curve(ax: Axes, runs: list[dict[str, Any]], x: str, method: str) -> None:
    """The median of the runs, their middle half, and all of them faintly."""
    begins = max(run["rows"][x][0] for run in runs)
    ends = max(run["rows"][x][-1] for run in runs)
    at = np.geomspace(max(begins, 1e-4), max(ends, 2e-4), _POINTS)
    costs = np.array([_held(run["rows"], x, at) for run in runs])
    low, first, middle, third, high = np.quantile(
        costs, [0.0, 0.25, 0.5, 0.75, 1.0], axis=0
    )
    color = _STYLES[method].color
    ax.fill_between(at, low, high, color=color, alpha=0.10, linewidth=0)
    ax.fill_between(at, first, third, color=color, alpha=0.25, linewidth=0)
    ax.plot(at, middle, **_line(method))


def _held(rows: dict[str, list[float]], x: str, at: FloatArray) -> FloatArray:
    """Costs at some x; a policy counts from its evaluation to the next."""
    place = np.searchsorted(np.asarray(rows[x]), at, side="right") - 1
    return np.asarray(rows["policy_cost"])[np.maximum(place, 0)]


def harder(experiment: Experiment, evidence: Evidence) -> Figure:
    """A panel for each arena: the last cost of each run of each method."""
    rows = experiment.options["rows"]
    figure = drawing.new_figure(2.3)
    axes = figure.subplots(1, len(rows), squeeze=False)[0]
    for ax, (label, row) in zip(axes, rows.items(), strict=True):
        drawing.prepare(ax)
        ax.set_yscale("log")
        _strips(ax, row, evidence)
        drawing.plain_log(ax.yaxis, sparse=True)
        first, _, rest = label.partition(", ")
        ax.set_title(f"{first}\n{rest}" if rest else label, fontsize=TINY, loc="left")
    axes[0].set_ylabel("cost of the last policy", fontsize=SMALL)
    _legend(figure, list(next(iter(rows.values()))))
    return figure


def sweep(experiment: Experiment, evidence: Evidence) -> Figure:
    """The last cost of each method over something that is varied."""
    rows, x = experiment.options["rows"], experiment.options["x"]
    figure = drawing.new_figure(2.9, 4.6)
    ax = figure.subplots()
    drawing.prepare(ax)
    methods = list(next(iter(rows.values())))
    for place, method in enumerate(methods):
        shift = 1.06 ** (place - (len(methods) - 1) / 2)
        at = np.array(x) * shift  # apart, so that intervals can be told from each other
        costs = [evidence.last(row[method]) for row in rows.values()]
        found = [interval(each) for each in costs]
        middle = np.array([each.value for each in found])
        ends = np.array([[each.low, each.high] for each in found]).T
        ax.errorbar(
            at, middle, np.abs(ends - middle), capsize=2, marker=_MARKERS[method],
            markersize=4, **_line(method),
        )  # fmt: skip
        for place_x, each in zip(at, costs, strict=True):
            ax.plot(
                np.full(len(each), place_x), each, linestyle="", marker="_",
                markersize=4, color=_STYLES[method].color, alpha=0.35,
            )  # fmt: skip
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_xticks(x, labels=list(map(str, x)))
    ax.minorticks_off()
    drawing.plain_log(ax.yaxis, sparse=True)
    ax.set_xlabel(experiment.options["xlabel"], fontsize=SMALL)
    ax.set_ylabel("cost of the last policy", fontsize=SMALL)
    _legend(figure, methods)
    return figure


def order(experiment: Experiment, evidence: Evidence) -> Figure:
    """Last costs with the slots in reverse order over those in order."""
    pairs = experiment.options["pairs"]
    figure = drawing.new_figure(2.9)
    axes = figure.subplots(1, len(pairs), squeeze=False)[0]
    for ax, (label, (forth, back)) in zip(axes, pairs.items(), strict=True):
        drawing.prepare(ax)
        both = list(zip(evidence.last(forth), evidence.last(back), strict=False))
        x, y = np.array(both).T
        low, high = min(x.min(), y.min()), max(x.max(), y.max())
        room = 0.08 * (high - low) or 0.01 * high
        ax.plot([low - room, high + room], [low - room, high + room], **drawing.BOUND)
        ax.plot(
            x, y, linestyle="", marker=_MARKERS[forth.method], markersize=4,
            color=_STYLES[forth.method].color, alpha=0.8,
        )  # fmt: skip
        ax.set_aspect("equal")
        ax.set_title(label, fontsize=SMALL, loc="left")
        ax.set_xlabel("cost, slots in order", fontsize=TINY)
    axes[0].set_ylabel("cost, in reverse order", fontsize=TINY)
    return figure


def _strips(ax: Axes, row: dict[str, Contest], evidence: Evidence) -> None:
    """Every run's last cost beside the interquartile mean with its interval."""
    for place, (name, contest) in enumerate(row.items()):
        costs = evidence.last(contest)
        color, marker = _STYLES[name].color, _MARKERS[name]
        spread = np.linspace(-0.16, 0.16, len(costs)) if len(costs) > 1 else [0.0]
        ax.plot(
            place - 0.12 + np.asarray(spread), costs, linestyle="", marker=marker,
            markersize=2.2, color=color, alpha=0.45, markeredgewidth=0,
        )  # fmt: skip
        middle = interval(costs)
        ax.errorbar(
            [place + 0.24], [middle.value],
            [[middle.value - middle.low], [middle.high - middle.value]],
            color=color, marker=marker, markersize=4, capsize=2, linewidth=1.2,
        )  # fmt: skip
    values = np.concatenate([evidence.last(contest) for contest in row.values()])
    low, high = float(values.min()), float(values.max())
    if high < _NARROW * low:  # do not make much of what is nothing
        ax.set_ylim(low / _NARROW, high * _NARROW)
    ax.set_xlim(-0.6, len(row) - 0.4)
    ax.set_xticks(range(len(row)), labels=[_SHORT.get(each, each) for each in row])


def _line(method: str) -> dict[str, Any]:
    color, dashes = _STYLES[method]
    return {"color": color, "linestyle": dashes, "linewidth": 1.3}


def _legend(figure: Figure, methods: list[str]) -> None:
    handles = [
        Line2D(
            [], [], marker=_MARKERS[method], markersize=4, label=NAMES[method],
            **_line(method),
        )
        for method in methods
    ]  # fmt: skip
    drawing.legend(figure, handles, loc="outside lower center", ncols=len(handles))
