"""Figures 3.3 and 3.4 from a real run: simulated levels against the bounds of §3.4."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from acl_gym import theory
from acl_gym.experiments import drawing
from acl_gym.experiments.drawing import SMALL
from acl_gym.reproduction.claims.theory import common, expected_deposits, settled
from acl_gym.reproduction.evidence import Evidence
from acl_gym.reproduction.figures.bands import in_greek
from acl_gym.reproduction.settings import Experiment

_BOUND, _SECOND, _MEAN = "#0072B2", "#D55E00", "black"


def level_band(experiment: Experiment, evidence: Evidence) -> Figure:
    """The mean level in q between the bounds on its expectation, a panel a study."""
    figure = drawing.new_figure(2.7)
    axes = figure.subplots(1, len(experiment.studies), squeeze=False)[0]
    for ax, study in zip(axes, experiment.studies, strict=True):
        drawing.prepare(ax)
        setting = study.setting
        levels = evidence.rows(setting, "level_q")
        trials = np.arange(levels.shape[1] + 1)  # levels rise in the first few
        tau0 = setting.colony["tau0"]
        levels = np.pad(levels, ((0, 0), (1, 0)), constant_values=tau0)
        low, high = theory.expected_band(
            int(trials[-1]), *common(setting), expected_deposits(setting)[0]
        )
        ax.fill_between(
            trials, levels.min(axis=0), levels.max(axis=0), color="0.85", linewidth=0,
            label="all runs",
        )  # fmt: skip
        ax.plot(trials, levels.mean(axis=0), color=_MEAN, linewidth=1.1, label="mean")
        look = {"color": _BOUND, "linewidth": 1.0}
        ax.plot(trials, high, **look, linestyle="--", label="upper bound (3.27)")
        ax.plot(trials, low, **look, linestyle=":", label="lower bound (3.28)")
        ax.set_title(study.label, fontsize=SMALL, loc="left")
        ax.set_xlabel("trial", fontsize=SMALL)
        ax.set_xscale("symlog", linthresh=1.0)
        ax.set_xlim(0, trials[-1])
        drawing.plain_numbers(ax.xaxis)
        ax.set_ylim(bottom=0.0)
    axes[0].set_ylabel(r"level $\tau$ in q", fontsize=SMALL)
    handles, _ = axes[0].get_legend_handles_labels()
    drawing.legend(figure, handles, ncols=4, loc="outside lower center")
    return figure


def policy_gap(experiment: Experiment, evidence: Evidence) -> Figure:
    """Both regions of Figure 3.4 for each study, and how many runs have settled."""
    figure = drawing.new_figure(1.2 + 0.32 * len(experiment.studies))
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(2, 1))
    for ax in (left, right):
        drawing.prepare(ax)
    for place, study in enumerate(experiment.studies):
        setting = study.setting
        first, second = expected_deposits(setting)
        for shift, deposit, color in ((-0.14, first, _BOUND), (0.14, second, _SECOND)):
            low = theory.expected_lower_limit(*common(setting), deposit)
            high = theory.expected_upper_limit(*common(setting), deposit)
            ends = [float(low), float(high)]
            left.plot(ends, [place + shift] * 2, color=color, linewidth=4,
                      marker="|", markersize=7)  # fmt: skip
        mean = evidence.rows(setting, "level_q")[:, -100:].mean(axis=1)
        left.plot(mean, np.full(mean.size, place), ".", color=_MEAN, markersize=3)
        share = settled(evidence, setting)
        gap = float(theory.policy_gap(*common(setting), first, second))
        right.barh(place, share, height=0.5, color=_BOUND if gap > 0 else "0.6")
        right.annotate(
            f"{share:.0%}", (share, place), xytext=(3, 0), textcoords="offset points",
            va="center", fontsize=drawing.TINY,
        )  # fmt: skip
    left.set_yticks(range(len(experiment.studies)),
                    [in_greek(study.label) for study in experiment.studies])  # fmt: skip
    left.invert_yaxis()
    left.set_xscale("log")
    left.set_xlabel(r"level $\tau$ in q", fontsize=SMALL)
    right.set_xlim(0.0, 1.2)
    right.set_xlabel("share of runs that keep u* to the end", fontsize=SMALL)
    wide: dict[str, Any] = {"linewidth": 4}
    handles = [
        Line2D([], [], color=_BOUND, **wide, label="bounds while u* leads"),
        Line2D([], [], color=_SECOND, **wide, label="bounds while the second leads"),
        Line2D([], [], color=_MEAN, marker=".", linestyle="", label="mean of a run"),
        Patch(color=_BOUND, label=r"$\Delta$ > 0"),
        Patch(color="0.6", label=r"$\Delta$ < 0"),
    ]
    drawing.legend(figure, handles, ncols=5, loc="outside lower center")
    return figure
