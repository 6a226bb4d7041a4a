"""Real inputs between a few actions: what it gains, over the number of actions.

Agents learn in `ActionGrid` with 3 to 21 values of the input. Then the greedy policy over
these values is evaluated, and the interpolated policy between them, in the environment
with real inputs. Prints medians and ranges. `--file FILE` keeps every row, so that studies
and numbers of actions may be measured one after the other, and `--draw FILE.png` draws
the figure of docs/continuous-actions.md from them without a new run.

The study "rules" compares rules of interpolation on the thesis's pendulum.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from acl_gym import (
    ACL,
    ActionGrid,
    Fuzzy,
    QLearning,
    ReturningACL,
    WaitingVectorEnv,
    evaluate_policy_cost,
    fuzzy_q_iteration,
)
from acl_gym.envs.limits import time_limit
from acl_gym.policies import InterpolatedPolicy, TablePolicy
from acl_gym.utils.text import replace_unprintable_letters

COUNTS = (3, 5, 7, 9, 15, 21)
DEFAULT_COUNTS = {"rules": (3, 5, 9), "mountain-car": (2, *COUNTS)}
"""Where they are others than `COUNTS`: full force only is enough for the car."""

GREEDY, BETWEEN = "greedy", "interpolated"
COLOURS = {GREEDY: "#0072B2", BETWEEN: "#D55E00"}


def pendulum(slots: int) -> Any:
    """The thesis's pendulum with a real torque."""
    return gym.make_vec("acl_gym/Pendulum-v0", num_envs=slots, continuous=True)


def foreign(env_id: str) -> Callable[[int], Any]:
    """An environment of Gymnasium, step by step in Python."""
    return lambda slots: WaitingVectorEnv.make(env_id, slots)


def thesis_cells(env: Any) -> Fuzzy:
    return Fuzzy.from_box(env.single_observation_space, (40, 41), circular=[0])


def returning(env: Any, seed: int, steps: int) -> TablePolicy:
    return ReturningACL(env, seed=seed).learn(total_timesteps=steps).policy


def of_thesis(env: Any, seed: int, steps: int) -> TablePolicy:
    return ACL(env, thesis_cells(env), seed=seed).learn(trials=100).policy


def q_lambda(env: Any, seed: int, steps: int) -> TablePolicy:
    agent = QLearning(env, thesis_cells(env), seed=seed, trace_decay=0.5)
    return agent.learn(total_timesteps=steps).policy


def planned(env: Any, seed: int, steps: int) -> TablePolicy:
    """Fuzzy Q-iteration on fine cells: no learning, only the actions matter."""
    torques = env.values.ravel().tolist()
    numbered = gym.make_vec("acl_gym/Pendulum-v0", num_envs=1, torques=torques)
    box = numbered.single_observation_space
    fine = Fuzzy.from_box(box, (120, 121), circular=[0])
    return fuzzy_q_iteration(numbered, fine, discount=0.99, tolerance=1e-3).policy


class Study(NamedTuple):
    """An agent in an environment.

    Attributes:
        title: of its panel.
        make: the environment with real inputs, of some slots.
        learn: a policy from an environment with numbered actions, a seed and a budget.
        slots: in which it learns.
        steps: of all slots together.
        returns: whether the result is a return, to be large, and not a cost.
        episodes: of an evaluation where starts are random.
    """

    title: str
    make: Callable[[int], Any]
    learn: Callable[[Any, int, int], TablePolicy]
    slots: int
    steps: int
    returns: bool = False
    episodes: int = 100


STUDIES = {
    "pendulum": Study(
        "thesis's pendulum, ReturningACL, 20,000 steps", pendulum, returning, 5, 20_000
    ),
    "pendulum-q": Study(
        "thesis's pendulum, Q(0.5), 400,000 steps", pendulum, q_lambda, 100, 400_000
    ),
    "pendulum-acl": Study(
        "thesis's pendulum, ACL, 100 trials of 250 ants", pendulum, of_thesis, 250, 0
    ),
    "pendulum-plan": Study(
        "thesis's pendulum, fuzzy Q-iteration", pendulum, planned, 1, 0
    ),
    "pendulum-v1": Study(
        "Pendulum-v1, ReturningACL, 100,000 steps",
        foreign("Pendulum-v1"),
        returning,
        5,
        100_000,
        True,
    ),
    "mountain-car": Study(
        "MountainCarContinuous-v0, ReturningACL, 100,000 steps",
        foreign("MountainCarContinuous-v0"),
        returning,
        5,
        100_000,
        True,
        20,  # starts differ little, and are long where the goal is never reached
    ),
}


def result(policy: Any, env: Any) -> dict[str, float | None]:
    """Cost, return and success of a policy, from the same starts for all."""
    found = evaluate_policy_cost(policy, env, max_steps=time_limit(env), seed=12345)
    return {
        "cost": found.cost,
        "return": found.mean_return,
        "success_rate": found.success_rate,
    }


def both(name: str, count: int, seed: int) -> Iterator[dict[str, Any]]:
    """Learn once; a row for each policy over the same table."""
    study = STUDIES[name]
    env = ActionGrid(study.make(study.slots), count)
    began = time.perf_counter()
    greedy = study.learn(env, seed, study.steps)
    seconds = time.perf_counter() - began
    box = study.make(study.episodes)
    between = InterpolatedPolicy(greedy, env.values)
    for policy, model in ((GREEDY, Chosen(greedy, env.values)), (BETWEEN, between)):
        yield {
            "study": name,
            "actions": count,
            "seed": seed,
            "policy": policy,
            "seconds": seconds,
            **result(model, box),
        }


class Chosen:
    """The inputs of a policy's actions, by a rule of its values.

    Args:
        policy: over the table.
        values: the inputs of its actions, `(n_actions, 1)`, evenly spaced.
        rule: gives the place between 0 and n_actions - 1 from values `(n, n_actions)`;
            None takes the best one.
        per_cell: whether cells choose by themselves, and their inputs are weighed by the
            degrees of the state.
    """

    def __init__(
        self,
        policy: TablePolicy,
        values: np.ndarray,
        rule: Callable[[np.ndarray], np.ndarray] | None = None,
        per_cell: bool = False,
    ) -> None:
        self.policy, self.values = policy, values
        self.rule, self.per_cell = rule, per_cell

    def predict(self, observation: Any, *, deterministic: bool = True) -> Any:
        if self.rule is None:
            return self.values[self.policy.predict(observation)[0]], None
        index, degree, _ = self.policy.located(observation)
        table = self.policy.table
        if self.per_cell:
            places = np.zeros(len(index))
            for corner in range(index.shape[1]):
                places += degree[:, corner] * self.rule(table[index[:, corner]])
        else:
            places = self.rule(np.einsum("nk,nku->nu", degree, table[index]))
        low, high = float(self.values[0, 0]), float(self.values[-1, 0])
        inputs = low + (high - low) * places[:, None] / (len(self.values) - 1)
        return np.clip(inputs, low, high).astype(self.values.dtype), None


def _three(values: np.ndarray) -> tuple[np.ndarray, ...]:
    """The best place, and the values below, at and above it; -inf where there is none."""
    best = values.argmax(axis=1)
    rows = np.arange(len(values))
    padded = np.pad(values, ((0, 0), (1, 1)), constant_values=-np.inf)
    return best, padded[rows, best], padded[rows, best + 1], padded[rows, best + 2]


def power(exponent: float) -> Callable[[np.ndarray], np.ndarray]:
    """The thesis's mean: weights tau^exponent of the best action and its neighbours."""

    def rule(values: np.ndarray) -> np.ndarray:
        best, low, top, high = _three(values)
        below, above = (np.maximum(v, 0.0) / top for v in (low, high))
        below, above = below**exponent, above**exponent
        return np.asarray(best + (above - below) / (1.0 + below + above))

    return rule


def softmax(scale: float) -> Callable[[np.ndarray], np.ndarray]:
    """Weights exp(value / s), s a share of the spread of the values at the state."""

    def rule(values: np.ndarray) -> np.ndarray:
        best, low, top, high = _three(values)
        spread = scale * np.ptp(values, axis=1) + 1e-300
        below, above = (np.exp((v - top) / spread) for v in (low, high))
        return np.asarray(best + (above - below) / (1.0 + below + above))

    return rule


def above_the_least(values: np.ndarray) -> np.ndarray:
    """Weights: how far each of the three values lies above the least of them."""
    best, low, top, high = _three(values)
    inner = np.isfinite(low) & np.isfinite(high)
    least = np.where(inner, np.minimum(low, high), 0.0)
    low, high = (np.where(inner, v, 0.0) - least for v in (low, high))
    total = np.where(inner, low + high + top - least, 0.0)
    return np.asarray(best + (high - low) / np.where(total > 0, total, np.inf))


def parabola(values: np.ndarray) -> np.ndarray:
    """The rule of `InterpolatedPolicy`."""
    best, low, top, high = _three(values)
    inner = np.isfinite(low) & np.isfinite(high)
    below, above = (np.where(inner, top - v, 0.0) for v in (low, high))
    total = below + above
    return np.asarray(best + (below - above) / np.where(total > 0, 2 * total, np.inf))


def parabola_at_ends(values: np.ndarray) -> np.ndarray:
    """The same, and at an end the parabola through it and the next two actions."""
    count = values.shape[1]
    middle = np.clip(values.argmax(axis=1), 1, count - 2)
    rows = np.arange(len(values))
    low, top, high = (values[rows, middle + step] for step in (-1, 0, 1))
    bend = 2.0 * (2.0 * top - low - high)
    at_end = (values.argmax(axis=1) - middle).astype(float)
    offset = np.where(bend > 0, (high - low) / np.where(bend > 0, bend, 1.0), at_end)
    return np.asarray(middle + np.clip(offset, -1.0, 1.0))


RULES: dict[str, tuple[Callable[[np.ndarray], np.ndarray] | None, bool]] = {
    "greedy": (None, False),
    "parabola (InterpolatedPolicy)": (parabola, False),
    "parabola, each cell by itself": (parabola, True),
    "parabola, at the ends too": (parabola_at_ends, False),
    "above the least": (above_the_least, False),
    "softmax, 0.1 of the spread": (softmax(0.1), False),
    "softmax, 0.03 of the spread": (softmax(0.03), False),
    "tau": (power(1.0), False),
    "tau^3": (power(3.0), False),
    "tau^10": (power(10.0), False),
}


def rules(count: int, seed: int) -> Iterator[dict[str, Any]]:
    """A row for each rule and agent on the thesis's pendulum."""
    for name in ("pendulum-acl", "pendulum", "pendulum-q"):
        study = STUDIES[name]
        env = ActionGrid(study.make(study.slots), count)
        policy = study.learn(env, seed, study.steps)
        box = study.make(study.episodes)
        for rule, (function, per_cell) in RULES.items():
            if rule.startswith("tau") and name != "pendulum-acl":
                continue  # other tables have levels of any sign
            model = Chosen(policy, env.values, function, per_cell)
            yield {
                "study": "rules",
                "agent": name,
                "actions": count,
                "seed": seed,
                "policy": rule,
                **result(model, box),
            }


def measure(
    names: Iterable[str], counts: list[int], seeds: int
) -> list[dict[str, Any]]:
    """All rows, seeds outermost, so that an early end has some of each."""
    rows: list[dict[str, Any]] = []
    for name in names:
        for seed in range(seeds):
            for count in counts:
                some = (
                    rules(count, seed) if name == "rules" else both(name, count, seed)
                )
                rows += some
                print(f"{name}: seed {seed}, {count} actions", file=sys.stderr)
    return rows


def summary(rows: list[dict[str, Any]]) -> list[str]:
    """A line for each study, number of actions and policy."""
    groups: dict[tuple[Any, ...], list[dict[str, Any]]] = {}
    for row in rows:
        key = row.get("agent", row["study"]), row["actions"], row["policy"]
        groups.setdefault((row["study"], *key), []).append(row)
    lines = []
    for (study, name, count, policy), found in groups.items():
        returns = study in STUDIES and STUDIES[study].returns
        values = np.array([row["return" if returns else "cost"] for row in found])
        rates = [row["success_rate"] for row in found]
        reached = (
            ""
            if None in rates
            else f", arrive {np.min(rates):.0%} to {np.max(rates):.0%}"
        )
        lines.append(
            f"{name:13} {count:3} actions  {policy:30} median {np.median(values):8.2f} "
            f"[{values.min():.2f}, {values.max():.2f}] of {len(values)}{reached}"
        )
    return lines


def draw(rows: list[dict[str, Any]]) -> Figure:
    """Cost or return over the number of actions, a panel for each study."""
    names = [name for name in STUDIES if any(row["study"] == name for row in rows)]
    columns = min(3, len(names))
    height = -(-len(names) // columns)
    figure = Figure(figsize=(4.2 * columns, 3.3 * height), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(height, columns, squeeze=False).ravel()
    for panel in panels[len(names) :]:
        panel.set_axis_off()
    for panel, name in zip(panels, names, strict=False):
        study = STUDIES[name]
        measure = "return" if study.returns else "cost"
        for policy, shift in ((GREEDY, -0.012), (BETWEEN, 0.012)):
            own = [r for r in rows if r["study"] == name and r["policy"] == policy]
            counts = sorted({row["actions"] for row in own})
            values = [[r[measure] for r in own if r["actions"] == c] for c in counts]
            middle = [float(np.median(each)) for each in values]
            place = np.array(counts) * np.exp(shift)
            panel.plot(place, middle, "o-", color=COLOURS[policy], label=policy, ms=4)
            panel.vlines(
                place,
                [min(each) for each in values],
                [max(each) for each in values],
                color=COLOURS[policy],
                alpha=0.45,
            )
        panel.set(xscale="log", xlabel="actions", ylabel=f"mean {measure}")
        panel.set_xticks(counts, [str(c) for c in counts])
        panel.minorticks_off()
        panel.set_title(study.title.replace(", ", ",\n", 1), fontsize=9)
        panel.grid(alpha=0.3)
    lines, labels = panels[0].get_legend_handles_labels()
    figure.legend(lines, labels, loc="outside upper center", ncols=2)
    return figure


def draw_maps() -> Figure:
    """The torque over the state: three torques of Q(0.5), and what lies between them."""
    study, count = STUDIES["pendulum-q"], 3
    env = ActionGrid(study.make(study.slots), count)
    greedy = study.learn(env, 0, study.steps)
    between = InterpolatedPolicy(greedy, env.values)
    figure = Figure(figsize=(9, 3.7), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, 2, sharey=True)
    angle, speed = np.linspace(0, 2 * np.pi, 301), np.linspace(-9, 9, 301)
    states = np.stack(np.meshgrid(angle, speed), axis=-1).reshape(-1, 2)
    for panel, model, title in (
        (panels[0], Chosen(greedy, env.values), f"{GREEDY}: one of three torques"),
        (panels[1], between, f"{BETWEEN} between the same three"),
    ):
        torque = model.predict(states)[0].reshape(301, 301)
        cost = result(model, study.make(study.episodes))["cost"]
        image = panel.pcolormesh(
            angle, speed, torque, cmap="PuOr", shading="nearest", rasterized=True
        )
        panel.set_xlabel("angle, upright at pi (rad)")
        panel.set_title(f"{title}, cost {cost:.1f}", fontsize=10)
    panels[0].set_ylabel("angular velocity (rad/s)")
    figure.colorbar(image, ax=panels, label="torque (N m)")
    return figure


def main(arguments: list[str] | None = None) -> int:
    """Measure, print, keep and draw; returns the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--study",
        nargs="+",
        default=list(STUDIES),
        choices=[*STUDIES, "rules"],
        help="which (default: all but rules)",
    )
    parser.add_argument("--seeds", type=int, default=5, help="seeds (default: 5)")
    parser.add_argument(
        "--actions",
        type=int,
        nargs="+",
        help=f"numbers of actions (default: {' '.join(map(str, COUNTS))}, with exceptions)",
    )
    parser.add_argument("--json", action="store_true", help="print every row as JSON")
    parser.add_argument("--file", type=Path, help="keep the rows in this file")
    parser.add_argument(
        "--draw", type=Path, help="draw the rows of --file, measure nothing"
    )
    parser.add_argument(
        "--maps", type=Path, help="draw two policies over the state, measure nothing"
    )
    options = parser.parse_args(arguments)
    if options.maps is not None:
        draw_maps().savefig(options.maps, dpi=130)
        return 0
    rows: list[dict[str, Any]] = []
    least = 3 if "rules" in options.study else 2
    if options.seeds < 1 or min(options.actions or COUNTS) < least:
        parser.error(f"--seeds must be at least 1, and --actions at least {least}.")
    if options.draw is not None and options.file is None:
        parser.error("--draw needs the rows of a --file.")
    if options.file is not None and options.file.exists():
        rows = json.loads(options.file.read_text())["rows"]
    if options.draw is None:
        for name in options.study:
            counts = options.actions or DEFAULT_COUNTS.get(name, COUNTS)
            rows = [
                row
                for row in rows
                if row["study"] != name or row["actions"] not in counts
            ]
            rows += measure([name], list(counts), options.seeds)
            if options.file is not None:
                options.file.parent.mkdir(parents=True, exist_ok=True)
                options.file.write_text(json.dumps({"rows": rows}, indent=0))
    else:
        options.draw.parent.mkdir(parents=True, exist_ok=True)
        draw(rows).savefig(options.draw, dpi=140)
    print(json.dumps({"rows": rows}) if options.json else "\n".join(summary(rows)))
    return 0


if __name__ == "__main__":
    replace_unprintable_letters()
    raise SystemExit(main())
