"""Make the figures of docs/returning.md and docs/returning-measured.md, and print what they show.

- growing.png: one colony on the pendulum after some numbers of interactions, its policy
  and the cost to go that its levels promise, on cells that become finer.
- returning_curves.png: the policy cost over the interactions, of the returning colony,
  of sequential Q-learning with the same memory, growth and optimism, and of Q(lambda),
  Q-learning and ACL with their tuned settings. The returning colony and Q-learning with
  memory have the settings of `ablation.py`, which are not tuned for the pendulum.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pandas as pd
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MultipleLocator
from tqdm.auto import tqdm

from acl_gym import Fuzzy, ReturningACL, evaluate_policy_cost, fuzzy_q_iteration
from acl_gym.agents.base import TabularAgent
from acl_gym.callbacks import Callback
from acl_gym.experiments.comparison.tasks import tuned
from acl_gym.experiments.methods import make_agent
from acl_gym.partitions.base import locate_all
from acl_gym.plotting import draw_learning_curves, style
from acl_gym.plotting.pendulum import OMEGA, THETA, handles

from ablation import TASKS, without_ants  # isort: skip  # the script beside this one
from tables import at_least_one  # isort: skip  # the script beside this one

OUT = Path(__file__).parent.parent / "docs" / "figures"
PENDULUM = "acl_gym/Pendulum-v0"
MOMENTS = (500, 1_000, 2_000, 10_000)
FINE = (200, 201)
"""Cells on which the best policy is computed from the model."""

OPTIMUM = 38.4
"""Cost of the best policy, by value iteration on 1600 x 1601 cells."""

POINTS = 241
"""Along each axis of a map."""

GOAL = {"markerfacecolor": "#F0E442", "marker": "o", "markersize": 5, "linestyle": ""}

SPACING = 1.06
"""An evaluation is due when the interactions have grown by so much."""

CURVES: dict[str, dict[str, Any]] = {
    "ReturningACL": {"color": "#D55E00", "linewidth": 2.0},
    "Q-learning that remembers": {"color": "#CC79A7", "linestyle": "--"},
    "Q(λ)": {"color": "#009E73", "linestyle": "-."},
    "Q-learning": {"color": "#0072B2", "linestyle": (0, (4, 1.2))},
    "ACL": {"color": "black", "linestyle": ":"},
}


class Evaluation(Callback):
    """Evaluates the policy after trials that lie further and further apart."""

    def __init__(self) -> None:
        self.rows: list[dict[str, float]] = []
        self._env = gym.make_vec(PENDULUM, num_envs=1)
        self._due = 0.0

    def on_trial_end(self, agent: Any, row: dict[str, Any]) -> bool:
        """Evaluate if it is time to."""
        if row["env_steps"] >= self._due:
            cost = evaluate_policy_cost(agent.policy, self._env).cost
            kept = ("env_steps", "seconds")
            self.rows.append({**{n: row[n] for n in kept}, "policy_cost": cost})
            self._due = SPACING * row["env_steps"]
        return True


def agents(name: str, seed: int) -> tuple[TabularAgent, int]:
    """An agent of a curve, and how many interactions it has."""
    if name == "ReturningACL":
        return ReturningACL(gym.make_vec(PENDULUM, num_envs=5), seed=seed), 60_000
    if name == "Q-learning that remembers":
        return without_ants(TASKS["pendulum"], seed), 60_000
    method = {"Q(λ)": "q-lambda", "Q-learning": "q", "ACL": "acl"}[name]
    steps = 3_000_000 if method == "acl" else 1_000_000
    return make_agent(tuned("pendulum", method), seed), steps


def curves(seeds: int, path: Path) -> None:
    """Let all of them learn, and draw how their policies become better."""
    logs: dict[str, list[pd.DataFrame]] = {}
    for name in CURVES:
        logs[name] = []
        for seed in tqdm(range(seeds), desc=name, leave=False):
            (agent, steps), evaluation = agents(name, seed), Evaluation()
            agent.learn(total_timesteps=steps, callback=evaluation)
            logs[name].append(pd.DataFrame(evaluation.rows))
        for share in (0.25, 0.10):
            good = OPTIMUM * (1 + share)
            first = [
                rows.loc[rows["policy_cost"] <= good, "env_steps"].min()
                for rows in logs[name]
            ]
            middle = np.median([math.inf if math.isnan(one) else one for one in first])
            print(f"{name}: within {share:.0%} after {middle:,.0f} (median)")
        last = [rows["policy_cost"].iloc[-1] for rows in logs[name]]
        print(
            f"{name}: last cost {np.median(last):.1f} [{min(last):.1f}, {max(last):.1f}]"
        )
    with style.in_style():
        figure = style.new_figure(3.4)
        ax = figure.subplots()
        draw_learning_curves(ax, logs, list(CURVES.values()))
        ax.axhline(OPTIMUM, **style.BOUND)
        ax.text(
            0.006, 0.96 * OPTIMUM, "the best there is", fontsize=7.5, va="top",
            transform=ax.get_yaxis_transform(),
        )  # fmt: skip
        ax.set(ylabel="cost of the policy", ylim=(29.0, 2_600.0))
        style.plain_log(ax.yaxis)
        ax.set_title(f"pendulum: median of {seeds} runs, band from lowest to highest")
        figure.savefig(path, dpi=200)


def growing(seed: int, path: Path) -> None:
    """Draw a colony after some numbers of interactions, and the best policy."""
    env = gym.make_vec(PENDULUM, num_envs=5)
    colony = ReturningACL(env, seed=seed)
    shown: list[tuple[Any, Any, str]] = []
    for moment in MOMENTS:
        while colony.num_timesteps < moment:
            colony.learn(trials=1)
        cost = evaluate_policy_cost(colony, env).cost
        cells = " × ".join(str(line.size) for line in colony.partition.centres)
        title = f"{colony.num_timesteps:,} interactions\n{cells} cells\ncost {cost:.1f}"
        shown.append((colony.policy.copy(), colony.partition, title))
        print(title.replace("\n", ", "))
    grid = Fuzzy.from_box(env.single_observation_space, FINE, circular=[0])
    best = fuzzy_q_iteration(env, grid, discount=1.0).policy
    cost = evaluate_policy_cost(best, env).cost
    shown.append((best, None, f"the best there is\nby the model\ncost {cost:.1f}"))
    with style.in_style():
        draw_growing(env, shown).savefig(path, dpi=200)


def draw_growing(env: Any, shown: list[tuple[Any, Any, str]]) -> Figure:
    """Policies above, and what their levels promise below, with the centres of cells."""
    figure = style.new_figure(4.7, 9.0)
    rows = figure.subplots(2, len(shown), sharex=True, sharey=True)
    torques = np.array(env.unwrapped.system.torques)
    greys = ListedColormap([str(grey) for grey in np.linspace(0, 1, torques.size)])
    shades = np.argsort(np.argsort(torques))  # of each action
    theta, omega = np.linspace(0, 2 * math.pi, POINTS), np.linspace(-9, 9, POINTS)
    states = np.stack(np.meshgrid(theta % (2 * math.pi), omega), axis=-1).reshape(-1, 2)
    places = {"shading": "nearest", "rasterized": True}
    for (above, below), (policy, partition, title) in zip(rows.T, shown, strict=True):
        grid = policy.partition
        index, degree = locate_all(grid, states, grid.n_cells)
        levels = np.einsum("nk,nku->nu", degree, policy.table[index])
        actions = shades[levels.argmax(axis=1)].reshape(POINTS, POINTS)
        above.pcolormesh(theta, omega, actions, cmap=greys, **places)
        above.plot(math.pi, 0.0, color=style.ORANGE, **GOAL)
        above.set_title(title, fontsize=8)
        costs = -levels.max(axis=1).reshape(POINTS, POINTS)
        scale = {"cmap": "cividis_r", "vmin": 0.0, "vmax": 100.0}
        mesh = below.pcolormesh(theta, omega, costs, **scale, **places)
        if partition is not None:
            centres = np.meshgrid(*partition.centres)
            below.plot(*map(np.ravel, centres), ".", color="0.15", markersize=1.8)
        below.set_xlabel(THETA)
    for ax in rows.flat:
        ax.grid(visible=False)
        ax.set(xlim=(0.0, 2 * math.pi), ylim=(-9.0, 9.0))
        style.multiples_of_pi(ax.xaxis)
        ax.yaxis.set_major_locator(MultipleLocator(3.0))
    names = ("policy", "promised cost to go")
    for row, name in zip(rows, names, strict=True):
        row[0].set_ylabel(f"{name}\n{OMEGA}")
    figure.colorbar(mesh, ax=rows[1], pad=0.01, extend="max")
    dots = Line2D(
        [], [], color="0.15", linestyle="", marker=".", label="centre of a cell"
    )
    style.legend(figure, [*handles(env.unwrapped), dots], ncols=6)
    return figure


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=OUT, help="a folder")
    parser.add_argument(
        "--seeds", type=at_least_one, default=5, help="runs of each curve"
    )
    parser.add_argument("--seed", type=int, default=0, help="of the growing colony")
    parser.add_argument("--only", choices=("growing", "curves"))
    options = parser.parse_args()
    if options.only != "curves":
        growing(options.seed, options.out / "growing.png")
    if options.only != "growing":
        curves(options.seeds, options.out / "returning_curves.png")


if __name__ == "__main__":
    main()
