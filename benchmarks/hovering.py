"""Why some learned policies hover beside the goal, and what helps.

Trains fuzzy colonies on the pendulum. After every trial of the second half it evaluates
the greedy policy, eq. (4.16), the soft one (`ACL.soft_policy`), the one that sets torques
between the three (`ACL.interpolated_policy`), and the greedy policy of colonies with a finer
partition around the goal, also interpolated. Draws the worst greedy policy near the
goal and how often each kind of policy fails, and prints the numbers in docs/hovering.md.
"""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from tqdm.auto import tqdm

from acl_gym import ACL, Fuzzy, evaluate_policy_cost
from acl_gym.evaluation import actions_in, record_trajectory
from acl_gym.policies import TablePolicy
from acl_gym.utils.text import replace_unprintable_letters

TRIALS = 100
FIRST_TRIAL = 51
COLOURS = {
    "greedy": "#0072B2",
    "soft": "#D55E00",
    "interpolated": "#CC79A7",
    "refined": "#009E73",
    "refined, interpolated": "#E69F00",
}
LABELS = {
    "greedy": "greedy",
    "soft": "soft, exponent 10",
    "interpolated": "interpolated torque",
    "refined": "greedy, finer cells at the goal",
    "refined, interpolated": "interpolated, finer cells",
}


@dataclass
class Outcome:
    """Cost and success rate of every policy, `(n, 2)`, and the worst greedy one."""

    policies: dict[str, np.ndarray]
    worst: TablePolicy
    worst_success: float
    worst_name: str


def study(seeds: int) -> Outcome:
    """Train colonies and evaluate each kind of policy after every trial."""
    found: dict[str, list[tuple[float, float]]] = {name: [] for name in COLOURS}
    worst: tuple[float, str, TablePolicy] | None = None

    def evaluate(name: str, policy: Any, env: Any) -> float:
        result = evaluate_policy_cost(policy, env)
        found[name].append((result.cost, result.success_rate))
        return result.success_rate

    for seed in tqdm(range(seeds), desc="pairs of colonies"):
        env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=250)
        box = gym.make_vec("acl_gym/Pendulum-v0", num_envs=1, continuous=True)
        grid = Fuzzy.from_box(env.single_observation_space, (40, 41), circular=[0])
        fine = grid.refine(0, math.pi + np.array([-0.1, -0.05, 0.05, 0.1]))
        fine = fine.refine(1, [-0.3, -0.15, 0.15, 0.3])
        colony, refined = ACL(env, grid, seed=seed), ACL(env, fine, seed=seed)
        for each in (colony, refined):
            each.learn(trials=FIRST_TRIAL - 1)
        for trial in range(FIRST_TRIAL, TRIALS + 1):
            colony.learn(trials=1)
            refined.learn(trials=1)
            success = evaluate("greedy", colony.policy, env)
            evaluate("soft", colony.soft_policy(seed=trial), env)
            evaluate("interpolated", colony.interpolated_policy(), box)
            evaluate("refined", refined.policy, env)
            evaluate("refined, interpolated", refined.interpolated_policy(), box)
            if worst is None or success < worst[0]:
                worst = success, f"seed {seed}, trial {trial}", colony.policy.copy()
    if worst is None:
        raise ValueError("seeds must be at least 1.")
    policies = {name: np.array(rows) for name, rows in found.items()}
    return Outcome(policies, worst[2], worst[0], worst[1])


def numbers_of(outcome: Outcome) -> dict[str, Any]:
    """The numbers quoted in docs/hovering.md."""
    return {
        "worst": outcome.worst_name,
        "worst_success_rate": outcome.worst_success,
        **{
            name: {
                "policies": len(data),
                "median_cost": float(np.median(data[:, 0])),
                "max_cost": float(data[:, 0].max()),
                "share_below_95_percent": float((data[:, 1] < 0.95).mean()),
                "lowest_success_rate": float(data[:, 1].min()),
                "median_final_cost": float(
                    np.median(data[TRIALS - FIRST_TRIAL :: TRIALS - FIRST_TRIAL + 1, 0])
                ),
            }
            for name, data in outcome.policies.items()
        },
    }


def draw(outcome: Outcome) -> Figure:
    """Draw the worst greedy policy near the goal, and how often each kind fails."""
    figure = Figure(figsize=(10, 4.2), layout="constrained")
    FigureCanvasAgg(figure)
    near, often = figure.subplots(1, 2, width_ratios=(1.15, 1))
    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=1).unwrapped
    angle, speed = np.linspace(-0.4, 0.4, 161), np.linspace(-1.8, 1.8, 161)
    mesh = np.stack(np.meshgrid(angle + math.pi, speed), axis=-1).reshape(-1, 2)
    policy_map = actions_in(outcome.worst, env.with_slots(len(mesh)), mesh)
    near.pcolormesh(
        angle,
        speed,
        policy_map.reshape(161, 161),
        cmap=ListedColormap(["#9a9a9a", "#cfcfcf", "#f7f7f7"]),
        shading="nearest",
        rasterized=True,
    )
    start = _a_start_that_hovers(outcome.worst, env)
    path = record_trajectory(outcome.worst, env, start).states[-60:]
    near.plot(
        path[:, 0] - math.pi,
        path[:, 1],
        "o-",
        color=COLOURS["greedy"],
        lw=0.7,
        ms=3.5,
        label="last 60 of 300 steps",
    )
    near.add_patch(
        Rectangle(
            (-0.1, -0.1), 0.2, 0.2, fill=False, ec=COLOURS["soft"], lw=2, label="goal"
        )
    )
    near.set(
        xlabel="angle from upright (rad)",
        ylabel="angular velocity (rad/s)",
        title=(
            f"a greedy policy that hovers ({outcome.worst_name}:\n"
            f"{outcome.worst_success:.0%} of the starts reach the goal)"
        ),
    )
    near.legend(loc="upper right", framealpha=0.95)
    for x, y, torque in ((0.3, 0.2, "-0.8"), (-0.17, 0.75, "0"), (-0.3, -0.4, "+0.8")):
        near.text(x, y, f"{torque} N m", ha="center", style="italic")

    for name, data in outcome.policies.items():
        rates = np.sort(data[:, 1])
        share = np.arange(1, len(rates) + 1) / len(rates)
        often.step(
            100 * rates,
            100 * share,
            where="post",
            color=COLOURS[name],
            label=LABELS[name],
        )
    often.set(
        xlabel="starts that reach the goal (%)",
        ylabel="policies with at most that share (%)",
        yscale="log",
        yticks=(0.2, 1, 10, 100),
        yticklabels=("0.2", "1", "10", "100"),
        xlim=(0, 101),
        title=f"policies of trials {FIRST_TRIAL} to {TRIALS}, all seeds",
    )
    often.grid(alpha=0.3)
    often.legend(loc="upper left")
    return figure


def _a_start_that_hovers(policy: TablePolicy, env: Any) -> np.ndarray:
    states = env.system.evaluation_states()
    success = evaluate_policy_cost(policy, env).success
    return np.asarray(states[int(np.argmin(success))])


def main(arguments: list[str] | None = None) -> int:
    """Train, draw and print; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10, help="number of seeds")
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("docs/figures/hovering.png"),
        help="file of the figure (default: %(default)s)",
    )
    options = parser.parse_args(arguments)
    outcome = study(options.seeds)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    draw(outcome).savefig(options.out, dpi=150)
    print(json.dumps(numbers_of(outcome), indent=1))
    return 0


if __name__ == "__main__":
    replace_unprintable_letters()
    raise SystemExit(main())
