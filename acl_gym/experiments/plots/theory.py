"""Figures 3.3 and 3.4 from runs: simulated levels against the bounds of §3.4."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from acl_gym import theory
from acl_gym.experiments.plots.looks import in_symbols
from acl_gym.experiments.results import Results
from acl_gym.experiments.study import Experiment
from acl_gym.experiments.thesis.theory import (
    LIMIT,
    expected_deposits,
    gap,
    kept,
    parameters,
)
from acl_gym.plotting import style
from acl_gym.plotting.style import BLACK, BLUE, ORANGE

_LEVEL = r"level $\tau$ in q"


def level_band(experiment: Experiment, results: Results) -> Figure:
    """The level in q between the bounds on its expectation: a panel for each study."""
    count = len(experiment.studies)
    figure, axes = style.small_multiples(count, count, 2.2)
    for ax, (label, study) in zip(axes, experiment.studies.items(), strict=True):
        levels = results.values(study, "level_q")
        trials = np.arange(levels.shape[1] + 1)  # levels rise in the first few
        levels = np.pad(
            levels, ((0, 0), (1, 0)), constant_values=study.settings["tau0"]
        )
        low, high = theory.expected_band(
            int(trials[-1]), *parameters(study), expected_deposits(study)[0]
        )
        mean = {"color": BLACK, "linewidth": 1.1}
        style.draw_band(ax, trials, levels, mean, centre=np.mean)
        ax.plot(trials, high, color=BLUE, linewidth=1.0, linestyle="--")
        ax.plot(trials, low, color=BLUE, linewidth=1.0, linestyle=":")
        ax.set_title(label)
        ax.set_xscale("symlog", linthresh=1.0)
        ax.set_xlim(0, trials[-1])
        style.plain_numbers(ax.xaxis)
        ax.set_ylim(bottom=0.0)
    style.label_outer(axes, count, "trial", _LEVEL)
    handles = [
        Patch(color="0.85", label="all runs"),
        Line2D([], [], color=BLACK, label="mean"),
        Line2D([], [], color=BLUE, linestyle="--", label="upper bound, eq. (3.27)"),
        Line2D([], [], color=BLUE, linestyle=":", label="lower bound, eq. (3.28)"),
    ]
    style.legend(figure, handles)
    return figure


def policy_gap(experiment: Experiment, results: Results) -> Figure:
    """Both regions of Figure 3.4 for each study, and how many runs have settled."""
    studies = experiment.studies
    figure = style.new_figure(1.3 + 0.34 * len(studies))
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(2, 1))
    for place, study in enumerate(studies.values()):
        deposits = expected_deposits(study)
        for shift, deposit, color in zip(
            (-0.14, 0.14), deposits, (BLUE, ORANGE), strict=True
        ):
            low = theory.expected_lower_limit(*parameters(study), deposit)
            high = theory.expected_upper_limit(*parameters(study), deposit)
            ends = [float(low), float(high)]
            left.plot(ends, [place + shift] * 2, "|-", color=color, linewidth=4)
        mean = results.values(study, "level_q")[:, -LIMIT:].mean(axis=1)
        left.plot(mean, np.full(mean.size, place), ".", color=BLACK, markersize=3)
        share = kept(results, study).mean()
        right.barh(place, share, height=0.5, color=BLUE if gap(study) > 0 else "0.6")
        right.text(share + 0.02, place, f"{share:.0%}", va="center", fontsize="small")
    left.set_yticks(range(len(studies)), list(map(in_symbols, studies)))
    left.invert_yaxis()
    left.set_xscale("log")
    left.set_xlabel(_LEVEL)
    right.set_xlim(0.0, 1.25)
    right.set_xlabel("share of runs that keep u* to the end")
    handles = [
        Line2D([], [], color=BLUE, linewidth=4, label="bounds while u* leads"),
        Line2D(
            [], [], color=ORANGE, linewidth=4, label="bounds while the second leads"
        ),
        Line2D([], [], color=BLACK, marker=".", linestyle="", label="mean of a run"),
        Patch(color=BLUE, label=r"$\Delta$ > 0"),
        Patch(color="0.6", label=r"$\Delta$ < 0"),
    ]
    style.legend(figure, handles, ncols=3)
    return figure
