"""What it costs to learn, with and without an inner loop and a shield (§7.3).

Two tasks, in each of which a simple controller is known that does the job, but poorly:

- hold: a pendulum is to be held upright from small deviations; more than 0.5 rad from
  upright is a violation;
- navigation: the vehicle of §4.5 is to stay out of the regions in which the damping exceeds
  3 kg/s on its way; the controller knows a way around them and follows it slowly. It starts
  where that controller stays out.

`ReturningACL` with its defaults and five ants learns with each of these arrangements:

- free: it chooses the inputs, and nothing watches over it;
- shield: the controller takes over where the state leaves a set with a margin, without a
  model;
- shield, model: where the model says that the learner's action, and the controller after
  it, would not stay in the safe set;
- shield, model, masks: the same, and the actions that would be replaced are forbidden;
- inner loop: it chooses the parameters of the controller;
- inner loop, shield, model: likewise, among more daring ones, under the shield.

Prints for each the violations on the way (steps outside the safe set in 1,000, and in how
many of 1,000 episodes there was one), the cost of a step on the way in the first tenth of the
interactions and in all, how often the shield stepped in, and at the end the cost of the
greedy policy, with its violations, under the same arrangement and without the shield: medians
over the seeds.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector import VectorWrapper
from matplotlib.lines import Line2D
from matplotlib.ticker import EngFormatter
from tqdm.auto import tqdm

from acl_gym import InnerLoop, ReturningACL, Shield, evaluate_policy_cost, plant
from acl_gym.envs.control.actuator import nearest_actions
from acl_gym.envs.navigation import NavigationVectorEnv
from acl_gym.envs.navigation.system import Navigation
from acl_gym.envs.wrappers import StateFeedback
from acl_gym.plotting.style import BLACK, BLUE, GREEN, ORANGE, in_style, new_figure
from acl_gym.utils.text import replace_unprintable_letters

from ablation import at_least_one  # isort: skip  # the script beside this one

Row = dict[str, Any]
Array = np.ndarray
SLOTS = 5
START = np.array([0.2, 0.4])  # rad, rad/s
STARTS = 100


class Watch(VectorWrapper):
    """Notes what happens in each step, outside all other wrappers.

    Args:
        env: whose finished slots wait.
        safe: which of its states are safe.
    """

    def __init__(self, env: Any, safe: Callable[[Array], Array]) -> None:
        super().__init__(env)
        self.safe = safe
        self.costs: list[Array] = []
        self.violations: list[Array] = []
        self.episodes: list[Array] = []  # whether there was a violation in each
        self._idle = np.zeros(self.num_envs, dtype=bool)
        self._seen = np.zeros(self.num_envs, dtype=bool)
        self._length = np.zeros(self.num_envs, dtype=int)

    def reset(self, *, seed: Any = None, options: Any = None) -> Any:
        begun = self._length > 0
        self.episodes.append(self._seen[begun])
        self._idle[:], self._seen[:], self._length[:] = False, False, 0
        return self.env.reset(seed=seed, options=options)

    def step(self, actions: Any) -> Any:
        result = self.env.step(actions)
        walks = ~self._idle
        outside = ~self.safe(result[0])
        self.costs.append(-result[1][walks])
        self.violations.append(outside[walks])
        self._seen |= outside & walks
        self._length += walks
        self._idle |= result[2] | result[3]
        return result

    def summary(self) -> Row:
        """Costs and violations of all steps so far."""
        self.episodes.append(self._seen[self._length > 0])
        costs = np.concatenate(self.costs)
        tenth = max(costs.size // 10, 1)
        return {
            "steps": int(costs.size),
            "cost_first_tenth": float(costs[:tenth].mean()),
            "cost": float(costs.mean()),
            "violations": 1_000 * float(np.concatenate(self.violations).mean()),
            "episodes": 1_000 * float(np.concatenate(self.episodes).mean()),
        }


# --- a pendulum that is held upright --------------------------------------------------


def upright(x: Array, u: Array) -> Any:
    """The pendulum of §5.2; angle from upright, rad, and angular velocity, rad/s."""
    return [x[1], 19.62 * np.sin(x[0]) - 2.0 * x[1] + 20.0 * u[0]]


def upright_cost(x: Array, u: Array) -> Array:
    """The stage cost (5.4)."""
    return x[0] ** 2 + 0.1 * x[1] ** 2 + 0.05 * u[0] ** 2


def held_states() -> Array:
    """Starts on a regular grid."""
    grid = np.meshgrid(*(np.linspace(-most, most, 10) for most in START))
    return np.stack(grid, axis=-1).reshape(-1, 2)


def held_pendulums(slots: int) -> Any:
    """Pendulums that start near upright, and are watched for 5 s."""
    return plant(
        upright,
        low=[-np.pi, -9.0],
        high=[np.pi, 9.0],
        circular=[0],
        inputs=np.linspace(-0.8, 0.8, 9),
        sampling_time=0.05,
        goal=None,
        cost=upright_cost,
        max_episode_steps=100,
        num_envs=slots,
        initial=spaces.Box(-START, START, dtype=np.float64),
        evaluation_states=held_states(),
    )


def is_upright(x: Array) -> Array:
    """Whether pendulums are within 0.5 rad."""
    return np.abs(x[:, 0]) <= 0.5


def nearly_upright(x: Array) -> Array:
    """Whether they are, and will be in 0.2 s as fast as they are now."""
    return np.abs(x[:, 0] + 0.2 * x[:, 1]) <= 0.25


POOR = StateFeedback([1.3, 0.05], [0.0, 0.0], low=-0.8, high=0.8)


# --- the vehicle of §4.5, kept away from the damped regions ---------------------------

MOST_DAMPING = 3.0  # kg/s
VEHICLE = Navigation()


def undamped(x: Array) -> Array:
    """Whether vehicles are outside the damped regions."""
    return VEHICLE.damping(x[:, 0], x[:, 2]) <= MOST_DAMPING


def will_be_undamped(x: Array) -> Array:
    """Whether they are, and would still be where they can stop, and half way to it."""
    place, speed = x[:, [0, 2]], x[:, [1, 3]]
    way = 0.5 * speed * np.abs(speed)  # at 1 m/s^2
    good = undamped(x)
    for share in (0.5, 1.0):
        reached = place + share * way
        good &= VEHICLE.damping(*reached.T) <= MOST_DAMPING
    return good


class Way:
    """Which way to go from each place: down a field of distances around the regions.

    Args:
        margin: how much less damping than allowed counts as a region, kg/s.
    """

    def __init__(self, margin: float = 1.0) -> None:
        self.places = np.linspace(-5.0, 5.0, 101)
        c1, c2 = np.meshgrid(self.places, self.places, indexing="ij")
        blocked = VEHICLE.damping(c1, c2) > MOST_DAMPING - margin
        distance = np.where(c1**2 + c2**2 < 0.01, 0.0, np.inf)
        moves = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]
        for _ in range(400):
            padded = np.pad(distance, 1, constant_values=np.inf)
            nearer = [
                padded[1 + i : 102 + i, 1 + j : 102 + j] + 0.1 * np.hypot(i, j)
                for i, j in moves
            ]
            # Ways out of a region are long, so that none leads through it.
            further = np.min(nearer, axis=0) + 10.0 * blocked
            distance = np.minimum(distance, further)
        self.slope = np.stack(np.gradient(distance, 0.1), axis=-1)
        self.distance = distance

    def __call__(self, x: Array, speed: Any) -> Array:
        """Forces, N, that hold a speed along the way; slower near the goal."""
        place, velocity = x[:, [0, 2]], x[:, [1, 3]]
        nearest = np.rint((place + 5.0) * 10.0).astype(int)
        slope = self.slope[nearest[:, 0], nearest[:, 1]]
        length = np.linalg.norm(slope, axis=1, keepdims=True)
        direction = -slope / np.maximum(length, 1e-9)
        near = np.linalg.norm(place, axis=1, keepdims=True)
        straight = -place / np.maximum(near, 1e-9)
        direction = np.where(near < 1.0, straight, direction)
        wanted = np.minimum(speed, 0.6 * near) * direction
        return 4.0 * (wanted - velocity)


WAY = Way()


def slowly(x: Array) -> Array:
    """The baseline: along the way at 0.5 m/s."""
    return WAY(x, 0.5)


class Undamped(Navigation):
    """Vehicles that begin where the slow controller stays out of the damped regions."""

    def sample_states(self, rng: np.random.Generator, count: int) -> Array:
        found = np.empty((4, 0))
        while found.shape[1] < count:
            drawn = super().sample_states(rng, 2 * count + 20)
            found = np.concatenate([found, drawn[:, self.can_start(drawn)]], axis=1)
        return found[:, :count].copy()

    def can_start(self, states: Array) -> Array:
        """Whether the slow controller stays out from here for 4 s, `(n,)`."""
        states, forces = states.copy(), np.array(self.forces)
        good = undamped(states.T)
        rewards, reached = np.empty(good.size), np.empty(good.size, dtype=bool)
        for _ in range(20):
            wanted = slowly(states.T)
            actions = np.square(wanted[:, None] - forces).sum(axis=2).argmin(axis=1)
            super().advance(states, actions, None, rewards, reached)
            good &= undamped(states.T)
        return good

    def evaluation_states(self) -> Array:
        return self.sample_states(np.random.default_rng(7), STARTS).T.copy()


class UndampedVectorEnv(NavigationVectorEnv):
    """Many of them."""

    system_type = Undamped


def vehicles(slots: int) -> Any:
    """Vehicles that have 150 steps of 0.2 s."""
    return UndampedVectorEnv(slots, max_episode_steps=150)


# --- arrangements ---------------------------------------------------------------------


@dataclass(frozen=True)
class Task:
    """A plant, what is known of it, and how long the colony learns.

    Attributes:
        make: makes plants.
        baseline: the controller that is known.
        safe: the safe set.
        margin: a smaller one, for a shield without a model.
        look_ahead: steps that a model predicts.
        controller: the inner loop.
        cautious: parameters for it that are all safe enough.
        daring: more of them.
        steps: interactions of a run.
    """

    make: Callable[[int], Any]
    baseline: Callable[[Array], Array]
    safe: Callable[[Array], Array]
    margin: Callable[[Array], Array]
    look_ahead: int
    controller: Callable[[Array, Array], Array]
    cautious: Any
    daring: Any
    steps: int


def _gains(stiffness: Sequence[float], damping: Sequence[float]) -> list[list[float]]:
    return [[k, d] for k in stiffness for d in damping]


TASKS = {
    "hold": Task(
        make=held_pendulums,
        baseline=POOR,
        safe=is_upright,
        margin=nearly_upright,
        look_ahead=10,
        controller=StateFeedback(set_point=[0.0, 0.0], low=-0.8, high=0.8),
        cautious=_gains((1.3, 2.0, 3.0), (0.05, 0.2, 0.4)),
        daring=_gains((0.0, 1.3, 3.0), (-0.1, 0.05, 0.4)),
        steps=20_000,
    ),
    "navigation": Task(
        make=vehicles,
        baseline=slowly,
        safe=undamped,
        margin=will_be_undamped,
        look_ahead=12,
        controller=WAY,
        cautious=[0.5, 0.75, 1.0],
        daring=[0.5, 1.0, 1.5, 2.0],
        steps=40_000,
    ),
}


def arranged(task: Task, kind: str, plants: Any) -> Any:
    """The plants in one of the arrangements."""
    if kind == "free":
        return plants
    model: Row = {"predict": True, "look_ahead": task.look_ahead}
    if kind == "inner loop":
        return InnerLoop(plants, task.controller, task.cautious)
    if kind == "shield":
        return Shield(plants, task.baseline, task.margin)
    if kind == "inner loop, shield, model":
        plants = _shielded(task, plants, **model)
        return InnerLoop(plants, task.controller, task.daring)
    return _shielded(task, plants, **model, mask_actions=kind.endswith("masks"))


def _shielded(task: Task, plants: Any, **keywords: Any) -> Any:
    return Shield(plants, task.baseline, task.safe, **keywords)


def run(task: Task, kind: str, seed: int) -> Row:
    """Learn in one arrangement; evaluate the greedy policy in the same one."""
    plants = task.make(SLOTS)
    shielded = arranged(task, kind, plants)
    watch = Watch(shielded, task.safe)
    began = time.process_time()
    colony = ReturningACL(watch, seed=seed).learn(total_timesteps=task.steps)
    seconds = time.process_time() - began
    found = watch.summary()
    interventions = _interventions(shielded)
    return {
        "seed": seed,
        **found,
        "interventions": None
        if interventions is None
        else 1_000 * interventions / found["steps"],
        "seconds": seconds,
        **judged(task, kind, colony, seed),
        **without_shield(task, kind, colony, seed),
        "exploring": found_costs(watch),
    }


def found_costs(watch: Watch) -> Row:
    """Violations and cost of each hundredth of the interactions."""
    costs, outside = (np.concatenate(a) for a in (watch.costs, watch.violations))
    parts = np.array_split(np.arange(costs.size), 100)
    return {
        "costs": [float(costs[part].mean()) for part in parts],
        "violations": [int(outside[part].sum()) for part in parts],
    }


def _interventions(env: Any) -> int | None:
    """How often shields have stepped in; None where there is none."""
    while isinstance(env, VectorWrapper):
        if isinstance(env, Shield):
            return int(env.interventions.sum())
        env = env.env
    return None


def judged(task: Task, kind: str, policy: Any, seed: int) -> Row:
    """Cost and violations of a policy from the evaluation states."""
    watch = Watch(arranged(task, kind, task.make(STARTS)), task.safe)
    states = watch.unwrapped.system.evaluation_states()
    result = evaluate_policy_cost(policy, watch, states, seed=seed)
    found = watch.summary()
    return {
        "final_cost": result.cost,
        "final_success": result.success_rate,
        "final_violations": found["violations"],
        "final_episodes": found["episodes"],
    }


def without_shield(task: Task, kind: str, policy: Any, seed: int) -> Row:
    """What becomes of a policy that learned under a shield once it is taken away."""
    if not kind.startswith("shield"):
        return {"bare_cost": None, "bare_episodes": None}
    found = judged(task, "free", policy, seed)
    return {"bare_cost": found["final_cost"], "bare_episodes": found["final_episodes"]}


class Follow:
    """The baseline as a policy of the plant itself."""

    def __init__(self, task: Task) -> None:
        self._wants = task.baseline
        self._inputs = np.array(task.make(1).system.signals.values)

    def predict(self, observation: Any, *, deterministic: bool = True) -> Any:
        wanted = np.reshape(self._wants(observation), (len(observation), -1))
        return nearest_actions(wanted, self._inputs), None


def study(
    tasks: Iterable[str], kinds: Sequence[str], seeds: range, steps: int | None = None
) -> list[Row]:
    """A row for each task and arrangement, and one for the baseline alone."""
    rows = []
    for name in tasks:
        task = replace(TASKS[name], steps=steps or TASKS[name].steps)
        alone = judged(task, "free", Follow(task), 0)
        rows.append({"task": name, "kind": "baseline alone", **alone, "runs": []})
        for kind in tqdm(kinds, desc=name, leave=False):
            runs = [run(task, kind, seed) for seed in seeds]
            rows.append({"task": name, "kind": kind, **medians(runs), "runs": runs})
    return rows


def medians(runs: Sequence[Row]) -> Row:
    """The median of each measure."""
    numbers = [key for key in runs[0] if key not in ("seed", "exploring")]
    return {
        key: None
        if runs[0][key] is None
        else statistics.median(one[key] for one in runs)
        for key in numbers
    }


COLUMNS = {
    "episodes": "violated, of 1,000 episodes",
    "violations": "outside, of 1,000 steps",
    "interventions": "replaced, of 1,000 actions",
    "cost_first_tenth": "cost of a step, first tenth",
    "cost": "cost of a step, all",
    "final_cost": "policy cost",
    "worst": "worst",
    "final_episodes": "violated",
    "bare_cost": "without its shield: policy cost",
    "bare_episodes": "violated",
    "seconds": "seconds",
}


def as_markdown(rows: Sequence[Row]) -> str:
    """A table for each task."""
    tables = []
    for task in dict.fromkeys(row["task"] for row in rows):
        lines = [
            f"{task}:",
            "",
            f"| arrangement | {' | '.join(COLUMNS.values())} |",
            f"| --- |{' ---: |' * len(COLUMNS)}",
        ]
        for row in rows:
            if row["task"] == task:
                costs = [one["final_cost"] for one in row["runs"]]
                full = {**row, "worst": max(costs) if costs else None}
                cells = [shown(full.get(key)) for key in COLUMNS]
                lines.append(f"| {row['kind']} | {' | '.join(cells)} |")
        tables.append("\n".join(lines))
    return "\n\n".join(tables)


def shown(value: float | None) -> str:
    """A number with three digits or so."""
    if value is None:
        return ""
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"


LOOKS: dict[str, Row] = {
    "free": {"color": BLACK},
    "shield": {"color": BLUE, "linestyle": ":"},
    "shield, model": {"color": BLUE},
    "shield, model, masks": {"color": BLUE, "linestyle": "--"},
    "inner loop": {"color": GREEN},
    "inner loop, shield, model": {"color": ORANGE},
}


@in_style()
def draw(rows: Sequence[Row], path: Path) -> None:
    """Draw cost and violations on the way, medians over the seeds."""
    tasks = [name for name in TASKS if any(row["task"] == name for row in rows)]
    figure = new_figure(2.3 * len(tasks) + 0.5, dpi=150)
    grid = figure.subplots(len(tasks), 2, squeeze=False)
    for line, name in zip(grid, tasks, strict=True):
        when = np.linspace(0.0, TASKS[name].steps, 101)
        for row in rows:
            if row["task"] != name or not row["runs"]:
                continue
            each = [one["exploring"] for one in row["runs"]]
            # Of a twentieth of the interactions, so that it is one of several trials.
            costs = np.reshape([one["costs"] for one in each], (len(each), 20, 5))
            cost = np.median(costs.mean(axis=2), axis=0)
            outside = np.median([np.cumsum(one["violations"]) for one in each], axis=0)
            line[0].plot(when[3::5], cost, **LOOKS[row["kind"]])
            line[1].plot(when, [0.0, *outside], **LOOKS[row["kind"]])
        line[0].set(ylabel=f"{name}\ncost of a step")
        if name == "hold":  # costs differ by a factor of a hundred
            line[0].set_yscale("log")
        else:
            line[0].set_ylim(bottom=0.0)
        line[1].set(ylabel="steps outside so far")
        line[1].set_yscale("symlog", linthresh=10.0)
        line[1].set_ylim(bottom=-0.5)
        for ax in line:
            ax.set(xlim=(0, when[-1]), xlabel="interactions")
            ax.xaxis.set_major_formatter(EngFormatter(sep=""))
    handles = [Line2D([], [], **look) for look in LOOKS.values()]
    figure.legend(handles, list(LOOKS), ncols=3, loc="outside upper center")
    figure.savefig(path)


def _some(allowed: Sequence[str], separator: str) -> Callable[[str], list[str]]:
    def names(text: str) -> list[str]:
        given = [name.strip() for name in text.split(separator)]
        for name in given:
            if name not in allowed:
                raise argparse.ArgumentTypeError(
                    f"{name!r} is not one of {'; '.join(allowed)}"
                )
        return given

    return names


def main(arguments: list[str] | None = None) -> int:
    """Run and print; returns the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__.replace("%", "%%"),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--tasks",
        type=_some(list(TASKS), ","),
        default=list(TASKS),
        help=f"some of {', '.join(TASKS)} (default: both)",
    )
    parser.add_argument(
        "--kinds",
        type=_some(list(LOOKS), ";"),
        default=list(LOOKS),
        help=f"some of {'; '.join(LOOKS)}, between semicolons (default: all)",
    )
    parser.add_argument(
        "--seeds",
        type=at_least_one,
        default=5,
        help="runs of each, with successive seeds (default: %(default)s)",
    )
    parser.add_argument(
        "--steps",
        type=at_least_one,
        help="interactions of a run (default: "
        + ", ".join(f"{task.steps:,} for {name}" for name, task in TASKS.items())
        + ")",
    )
    parser.add_argument(
        "--from-json",
        type=Path,
        nargs="+",
        metavar="FILE",
        help="show what --json has printed, one file after the other",
    )
    parser.add_argument("--figure", type=Path, metavar="PNG", help="draw the curves")
    parser.add_argument("--json", action="store_true", help="print JSON, no table")
    options = parser.parse_args(arguments)
    if options.from_json is not None:
        read = [json.loads(path.read_text())["rows"] for path in options.from_json]
        # The baseline alone is in every file.
        kept = {(row["task"], row["kind"]): row for part in read for row in part}
        order = ["baseline alone", *LOOKS]
        rows = sorted(kept.values(), key=lambda row: order.index(row["kind"]))
    else:
        seeds = range(options.seeds)
        rows = study(options.tasks, options.kinds, seeds, options.steps)
    if options.figure is not None:
        draw(rows, options.figure)
    if options.json:
        print(json.dumps({"rows": rows}))
    else:
        print(as_markdown(rows))
    return 0


if __name__ == "__main__":
    replace_unprintable_letters()
    raise SystemExit(main())
