"""Policies as pictures: grey maps of the pendulum, forces of the vehicle, arrows."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from acl_gym.evaluation import evaluate_policy_cost
from acl_gym.experiments import drawing, wording
from acl_gym.experiments.drawing import SMALL, TINY
from acl_gym.experiments.figures import grid, navigation
from acl_gym.experiments.figures.pendulum import GOAL
from acl_gym.experiments.pictures import PICTURES, Picture
from acl_gym.policies import TablePolicy
from acl_gym.reproduction.evidence import Evidence, baseline
from acl_gym.reproduction.figures import bands
from acl_gym.reproduction.settings import NAVIGATION, PENDULUM, Experiment, Study

FINER = 4
"""How many times finer than the partition a policy is drawn."""


def policies(experiment: Experiment, evidence: Evidence) -> Figure:
    """The last policy of each study's run with the cheapest one."""
    shown = []
    for study in experiment.studies:
        run = evidence.best_run(study.setting)
        cost = wording.cost(float(evidence.last(study.setting)[run]))
        title = bands.in_greek(f"{study.label} (seed {run})\ncost {cost}")
        shown.append((title, study, evidence.policy(study.setting, run)))
    system = experiment.studies[0].setting.env_id
    if system == PENDULUM:
        return _pendulum(shown)
    return _vehicle(shown) if system == NAVIGATION else _grid(shown)


def baseline_policy(experiment: Experiment, evidence: Evidence) -> Figure:
    """Fuzzy Q-iteration on the cells of a study."""
    study = experiment.studies[-1]
    policy, cost, discount = baseline(study.setting)
    title = (
        f"fuzzy Q-iteration, discount {discount:g}\ncost {wording.cost(cost.cost)}, "
        f"{cost.success_rate:.0%} arrive"
    )
    return _vehicle([(title, study, policy)])


Shown = list[tuple[str, Study, TablePolicy]]


def bands_and_policies(experiment: Experiment, evidence: Evidence) -> Figure:
    """Cost over the trials above, a policy below, a column a study."""
    count = len(experiment.studies)
    figure = drawing.new_figure(4.4)
    axes = figure.subplots(2, count, squeeze=False)
    for column, study in enumerate(experiment.studies):
        ax = axes[0, column]
        if column:
            ax.sharey(axes[0, 0])
        bands.draw_band(ax, study, evidence)
        ax.set_title(bands.in_greek(study.label), fontsize=SMALL, loc="left")
        ax.set_xlabel("trial", fontsize=SMALL)
        run = evidence.best_run(study.setting)
        draw_map(axes[1, column], study, evidence.policy(study.setting, run))
        axes[1, column].set_title(f"seed {run}", fontsize=SMALL, loc="left")
    drawing.plain_log(axes[0, 0].yaxis, sparse=True)
    axes[0, 0].set_ylabel(bands.NAMES["policy_cost"], fontsize=SMALL)
    axes[1, 0].set_ylabel(r"$\omega$ (rad/s)", fontsize=SMALL)
    handles = bands.band_handles(evidence, experiment.studies, optimum=True)
    handles += torque_handles()
    drawing.legend(figure, handles, ncols=4, loc="outside lower center")
    return figure


def _pendulum(shown: Shown) -> Figure:
    figure = drawing.new_figure(3.1, 0.4 + 3.4 * len(shown))
    axes = figure.subplots(1, len(shown), sharex=True, sharey=True, squeeze=False)[0]
    for ax, (title, study, policy) in zip(axes, shown, strict=True):
        draw_map(ax, study, policy)
        ax.set_title(title, fontsize=SMALL)
    axes[0].set_ylabel(r"$\omega$ (rad/s)", fontsize=SMALL)
    drawing.legend(figure, torque_handles(), ncols=4, loc="outside lower center")
    return figure


def draw_map(ax: Axes, study: Study, policy: TablePolicy) -> None:
    """A policy of the pendulum: white is the full positive torque, black the negative.

    Args:
        ax: where.
        study: whose partition says how fine it is drawn.
        policy: at each state the torques -0.8, 0 and 0.8 N m are actions 0, 1 and 2.
    """
    n_theta, n_omega = study.setting.cells
    theta = np.linspace(0.0, 2 * math.pi, FINER * n_theta + 1)
    omega = np.linspace(-9.0, 9.0, FINER * (n_omega - 1) + 1)
    states = np.stack(np.meshgrid(theta, omega), axis=-1)
    flat = states.reshape(-1, 2).copy()
    flat[:, 0] %= 2 * math.pi
    actions = policy.predict(flat)[0].reshape(states.shape[:2])
    ax.pcolormesh(
        theta,
        omega,
        actions,
        cmap=ListedColormap(["0.0", "0.5", "1.0"]),
        norm=BoundaryNorm(np.arange(4) - 0.5, 3),
        shading="nearest",
        rasterized=True,
    )
    ax.plot(math.pi, 0.0, **GOAL)
    ax.set_xlim(0.0, 2 * math.pi)
    ax.set_ylim(-9.0, 9.0)
    ax.set_xlabel(r"$\theta$ (rad)", fontsize=SMALL)
    ax.tick_params(labelsize=TINY)
    drawing.multiples_of_pi(ax.xaxis)
    ax.yaxis.set_major_locator(MaxNLocator(6, steps=(1, 2, 3, 5, 10)))


def torque_handles() -> list[Any]:
    """What the greys of a map stand for."""
    greys = {"0.0": -0.8, "0.5": 0.0, "1.0": 0.8}
    handles: list[Any] = [
        Patch(facecolor=grey, edgecolor="0.3", label=drawing.torque(torque))
        for grey, torque in greys.items()
    ]
    return [*handles, Line2D([], [], **GOAL, label="goal")]


def _vehicle(shown: Shown) -> Figure:
    """Forces at rest on the left, ways from the edges on the right, a row a policy."""
    env = shown[0][1].setting.make_env(1)
    scene = PICTURES["navigation"].scene(env)
    pictures = [_picture("navigation", study, policy) for _, study, policy in shown]

    def draw(ax: Axes, number: int) -> None:
        title, study, policy = shown[number // 2]
        picture = pictures[number // 2]
        if number % 2 == 0:
            navigation.draw_forces(ax, scene, picture)
            ax.set_title(title, fontsize=SMALL)
            return
        color = drawing.style(f"acl-{study.setting.kind}").color
        for path in picture["trajectories"]:
            navigation.draw_path(ax, path, color)
        result = evaluate_policy_cost(
            policy,
            study.setting.make_env(1),
            max_steps=study.setting.colony["max_steps"],
        )
        ax.set_title(
            f"ways of vehicles that start at rest\n{result.success_rate:.0%} of the "
            "evaluation arrive",
            fontsize=SMALL,
        )

    figure = navigation.small_multiples(scene, 2 * len(shown), draw, columns=2)
    drawing.legend(
        figure, navigation.shared_handles(), ncols=2, loc="outside lower center"
    )
    return figure


def _grid(shown: Shown) -> Figure:
    """An arrow a cell, over what the policy costs from there."""
    pictures = [_picture("grid", study, policy) for _, study, policy in shown]
    dearest = max(
        cost for each in pictures for cost in each["cost_to_go"] if cost is not None
    )
    figure = drawing.new_figure(3.9)
    axes = figure.subplots(1, len(shown), squeeze=False)[0]
    for ax, (title, study, _), picture in zip(axes, shown, pictures, strict=True):
        scene = PICTURES["grid"].scene(study.setting.make_env(1))
        grid.draw_policy(ax, scene, picture, Normalize(0.0, dearest))
        ax.set_title(title, fontsize=SMALL)
    handles = [
        grid.arrow_handle(grid.BEST, "a best action"),
        grid.arrow_handle(grid.OTHER, "another action"),
        Patch(**grid.NEVER, label="from here never to the goal"),
        Line2D([], [], **grid.GOAL, label="goal"),
    ]
    drawing.legend(figure, handles, ncols=4, loc="outside lower center")
    return figure


def _picture(kind: str, study: Study, policy: TablePolicy) -> Picture:
    make: Callable[[int], Any] = study.setting.make_env
    return PICTURES[kind].record(policy, make)
