"""The pendulum swung up from hanging at rest: angle, velocity, torque, cost."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.figure import Figure

from acl_gym.experiments import drawing, wording
from acl_gym.experiments.drawing import SMALL
from acl_gym.reproduction.claims.swings import trajectory
from acl_gym.reproduction.evidence import Evidence
from acl_gym.reproduction.figures.bands import in_greek
from acl_gym.reproduction.settings import Experiment

TORQUES = np.array([-0.8, 0.0, 0.8])
SAMPLING_TIME = 0.1
LONGEST = 15.0
"""Seconds that are drawn at most; a policy that hovers would take 30."""


def swing(experiment: Experiment, evidence: Evidence) -> Figure:
    """Four stacked panels, by the last policy of the run with the cheapest one."""
    setting = experiment.studies[0].setting
    run = evidence.best_run(setting)
    path = trajectory(evidence, setting, run)
    time = SAMPLING_TIME * np.arange(len(path.states))
    figure = drawing.new_figure(5.2, 5.2)
    axes = figure.subplots(4, 1, sharex=True, height_ratios=(1.5, 1.3, 0.9, 1.2))
    for ax in axes:
        drawing.prepare(ax)
    theta = np.unwrap(path.states[:, 0], period=2 * math.pi)
    axes[0].plot(time, theta, color="black", linewidth=1.2)
    axes[0].set_ylabel(r"$\theta$ (rad)", fontsize=SMALL)
    drawing.multiples_of_pi(axes[0].yaxis)
    for upright in (-math.pi, math.pi):
        if theta.min() - 0.3 < upright < theta.max() + 0.3:
            axes[0].axhline(upright, **drawing.BOUND)
    axes[1].plot(time, path.states[:, 1], color="black", linewidth=1.2)
    axes[1].set_ylabel(r"$\omega$ (rad/s)", fontsize=SMALL)
    torque = np.append(TORQUES[path.actions], TORQUES[path.actions[-1:]])
    axes[2].plot(time, torque, drawstyle="steps-post", color="black", linewidth=1.0)
    axes[2].set_ylabel("torque (N m)", fontsize=SMALL)
    axes[2].set_yticks(TORQUES)
    cost = np.concatenate([[0.0], np.cumsum(path.costs)])
    axes[3].plot(time, cost, color="black", linewidth=1.2)
    axes[3].set_ylabel("cost so far", fontsize=SMALL)
    axes[3].set_xlabel("time (s)", fontsize=SMALL)
    axes[3].set_xlim(0.0, min(float(time[-1]), LONGEST))
    ending = (
        f"goal at {time[-1]:.1f} s, cost {wording.cost(float(cost[-1]))}"
        if path.success
        else f"no goal in {time[-1]:.0f} s"
    )
    label = in_greek(experiment.studies[0].label)
    axes[0].set_title(f"{label} (seed {run}): {ending}", fontsize=SMALL, loc="left")
    return figure
