"""When a plant has changed: is it better to go on learning, or to start anew (§7.3)?

A colony learns to swing up the pendulum of the thesis. Then mass, damping or the gain of
the motor jumps, or drifts away over as many interactions as are watched, and the colony
goes on in one of several ways:

- `whole memory`: `ReturningACL` with its defaults, which remembers all it has seen;
- `small memory`: the same with `memory_size=2_000`, so that it forgets all the time;
- `forget`: `forget()` is called at the change: it keeps its levels, but no memory;
- `model`: the steps of the newest 300 interactions make a model (`LearnedVectorEnv`), in
  which the colony goes on for 5,000 steps; the policy, a fifth of whose actions are random,
  then gathers more. Eight rounds in 2,000 interactions, after which nothing is learned any
  more. Only where the plant jumps;
- `restart`: a new `ReturningACL`, which is what one does who retunes after each change;
- `ACL`: the colony of the thesis, 250 ants on 40 x 41 fuzzy cells, whose pheromone decays;
- `ACL, restart`: a new one.

After the change the policy is evaluated as it is (`ChangingVectorEnv.now`). Prints over
the seeds the median of the extra cost: what the policy cost beyond the optimum J* of the
changed plant, on the average over the interactions watched; and the median number of
interactions until it is within 25% of J* for the first time. J* is that of fuzzy Q-iteration,
which knows the plant; in a drift it is that of the plant of the time for the extra cost,
and that of the last plant for the interactions. With --figure
it draws both over the size of the change.
"""

from __future__ import annotations

import json
import statistics
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.lines import Line2D
from tqdm.auto import tqdm

from acl_gym import (
    ACL,
    ChangingVectorEnv,
    Drift,
    Fuzzy,
    Jump,
    LearnedVectorEnv,
    ReturningACL,
    Transitions,
    evaluate_policy_cost,
    plant,
)
from acl_gym.agents.acl import PheromoneBoundWarning
from acl_gym.evaluation import with_slots_for
from acl_gym.plotting.style import BLUE, GREEN, ORANGE, in_style, new_figure
from acl_gym.utils.text import replace_unprintable_letters

# The scripts beside this one.
from tables import add_results, add_seeds, markdown, parser_of, rows_of  # isort: skip
from uncertain_plants import (  # isort: skip
    NOMINAL,
    SETTINGS,
    optimal_cost,
    pendulum,
)

Row = dict[str, Any]

WITHIN = 0.25


@dataclass(frozen=True)
class PlantChange:
    """How the plant changes.

    Attributes:
        parameter: which parameter.
        factor: by which it is multiplied in the end.
        drifts: over all the interactions watched, not at once.
    """

    parameter: str
    factor: float
    drifts: bool = False

    def schedule(self, at: int, steps: int) -> dict[str, Any]:
        """For `ChangingVectorEnv`, from so many steps on."""
        value = NOMINAL[self.parameter] * self.factor
        if self.drifts:
            return {self.parameter: Drift(at, at + steps, value)}
        return {self.parameter: Jump(at, value)}


CHANGES = {
    f"{parameter} x {factor:g}": PlantChange(parameter, factor)
    for parameter, factors in (
        ("mass", (0.5, 0.8, 1.25, 1.35)),
        ("damping", (0.25, 0.5, 1.25, 1.5)),
        ("gain", (-1.0, 0.8, 0.9, 1.25, 1.5)),
    )
    for factor in factors
} | {
    "gain drifts to x 0.8": PlantChange("gain", 0.8, drifts=True),
    "mass drifts to x 1.25": PlantChange("mass", 1.25, drifts=True),
}


def acl(env: Any, seed: int) -> ACL:
    """The colony of the thesis, with its settings for the pendulum."""
    grid = Fuzzy.from_box(env.single_observation_space, (40, 41), circular=[0])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PheromoneBoundWarning)
        return ACL(env, grid, tau0=1e-4, seed=seed)


def returning(env: Any, seed: int) -> ReturningACL:
    """With its defaults."""
    return ReturningACL(env, seed=seed)


def returning_small(env: Any, seed: int) -> ReturningACL:
    """With a small memory."""
    return ReturningACL(env, memory_size=2_000, seed=seed)


@dataclass(frozen=True)
class Method:
    """What a colony does when the plant has changed.

    Attributes:
        make: a function of an environment and a seed that returns a new agent.
        ants: of the agent.
        anew: a new agent is made at the change.
        forgets: `forget()` is called at the change.
        in_model: it goes on in a model of what was seen last, see `go_on_in_a_model`.
        before: interactions in the plant as it was.
        after: interactions that are watched.
        every: interactions between two evaluations.
    """

    make: Callable[[Any, int], Any]
    ants: int = 5
    anew: bool = False
    forgets: bool = False
    in_model: bool = False
    before: int = 10_000
    after: int = 10_000
    every: int = 300


MANY: Row = {"ants": 250, "before": 1_000_000, "after": 1_000_000, "every": 25_000}
METHODS = {
    "whole memory": Method(returning),
    "small memory": Method(returning_small),
    "forget": Method(returning, forgets=True),
    "model": Method(returning, in_model=True),
    "restart": Method(returning, anew=True),
    "ACL": Method(acl, **MANY),
    "ACL, restart": Method(acl, anew=True, **MANY),
}


def make_env(ants: int) -> Any:
    """The plant as it was."""
    return plant(pendulum, num_envs=ants, **SETTINGS)


class Before:
    """Agents that have learned in the plant as it was, each learned once and kept."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._agents: dict[Any, tuple[Path, type, int]] = {}

    def agent(
        self, method: Method, seed: int, schedule: PlantChange
    ) -> tuple[Any, Any]:
        """An agent as it is at the change, and the environment that changes."""
        key = method.make, method.before, seed
        if key not in self._agents:
            agent = method.make(make_env(method.ants), seed)
            agent.learn(total_timesteps=method.before)
            path = self._folder / f"{len(self._agents)}.npz"
            agent.save(path)
            self._agents[key] = path, type(agent), agent.num_timesteps
        path, kind, at = self._agents[key]
        changes = schedule.schedule(at, method.after)
        env = ChangingVectorEnv(make_env(method.ants), changes, steps=at)
        if method.anew:
            return method.make(env, seed + 1_000), env
        agent = kind.load(path, env)
        if method.forgets:
            agent.forget()
        return agent, env


def go_on(method: Method, agent: Any, env: Any, seed: int) -> Iterator[int]:
    """Learn in the plant; after each piece the interactions since the change."""
    first, made = agent.num_timesteps, 0
    while made < method.after:
        due = first + (made // method.every + 1) * method.every
        agent.learn(total_timesteps=due - agent.num_timesteps)
        made = agent.num_timesteps - first
        yield made


class Exploring:
    """The policy of an agent, a fifth of whose actions are random."""

    def __init__(self, agent: Any, seed: int) -> None:
        self._agent, self._rng = agent, np.random.default_rng(seed)

    def predict(self, observation: Any) -> Any:
        """An action for each observation."""
        actions, count = self._agent.predict(observation)[0], len(observation)
        others = self._rng.integers(len(SETTINGS["inputs"]), size=count)
        return np.where(self._rng.random(count) < 0.2, others, actions)


ROUNDS = (100, 200, 300, 500, 700, 1_000, 1_500, 2_000)
WINDOW, IN_MODEL = 300, 5_000


def go_on_in_a_model(method: Method, agent: Any, env: Any, seed: int) -> Iterator[int]:
    """Learn in a model of the newest steps; after each round the interactions made.

    It does not know of the change: at first the window holds steps of before.
    """
    exploring = Exploring(agent, seed)
    window = Transitions.record(make_env(method.ants), WINDOW, exploring, seed=seed)
    known = {name: SETTINGS[name] for name in ("goal", "tolerance", "cost")}
    made, begin = 0, None
    for due in ROUNDS:
        new = Transitions.record(env, due - made, exploring, seed=seed + due)
        window, made = (window + new)[-WINDOW:], made + len(new)
        model = LearnedVectorEnv(
            window, 20, initial=None, regressor="gaussian process", begin=begin, **known
        )
        begin = model.dynamics
        agent.set_env(model)
        agent.forget()  # what was done in the model before
        agent.learn(total_timesteps=IN_MODEL)
        yield made
    yield method.after


class Judge:
    """Evaluates policies in a plant that changes, as it is at the time."""

    def __init__(self, env: ChangingVectorEnv) -> None:
        self._env = env
        self._values: dict[str, float] = {}
        self._now: Any = None

    def cost(self, agent: Any) -> float:
        """The policy cost now; an environment is made only when the plant has changed."""
        if self._values != self._env.values:
            self._values = self._env.values
            self._now = with_slots_for(self._env.now())
        return evaluate_policy_cost(agent, self._now).cost


def optimal_costs(change: PlantChange) -> list[float]:
    """J* after the change; of a drift, at its begin, its end and evenly between."""
    plain = make_env(1)
    shares = np.linspace(0.0, 1.0, 5) if change.drifts else [1.0]
    factors = [1.0 + (change.factor - 1.0) * share for share in shares]
    return [
        optimal_cost(
            plain.with_parameters(**{change.parameter: NOMINAL[change.parameter] * f})
        )
        for f in factors
    ]


def run(before: Before, name: str, change: str, best: list[float], seed: int) -> Row:
    """Go on, or start anew, in the plant that changes, and evaluate at intervals."""
    method = METHODS[name]
    agent, env = before.agent(method, seed, CHANGES[change])
    rounds = go_on_in_a_model if method.in_model else go_on
    judge = Judge(env)
    interactions, costs, seconds = [0], [judge.cost(agent)], 0.0
    began = time.process_time()
    for made in rounds(method, agent, env, seed):
        seconds += time.process_time() - began
        interactions.append(made)
        costs.append(judge.cost(agent))
        began = time.process_time()
    span = np.linspace(0, method.after, 1001)
    times = np.linspace(0, method.after, len(best))
    optimal, found = (
        np.interp(span, *pair) for pair in ((times, best), (interactions, costs))
    )
    good = np.array(costs) <= (1 + WITHIN) * best[-1]
    return {
        "change": change,
        "method": name,
        "seed": seed,
        "best": best[-1],
        "extra": float((found - optimal).mean()),
        "near": interactions[int(np.argmax(good))] if good.any() else None,
        "last": costs[-1],
        "interactions": interactions,
        "costs": costs,
        "seconds": seconds,
    }


def study(changes: Sequence[str], methods: Sequence[str], seeds: range) -> list[Row]:
    """A row for each run."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        before = Before(Path(folder))
        for name in tqdm(changes, desc="changes"):
            change = CHANGES[name]
            best = optimal_costs(change)
            rows += [
                run(before, method, name, best, seed)
                for method in methods
                if not (METHODS[method].in_model and change.drifts)
                for seed in seeds
            ]
    return rows


def summary(rows: Sequence[Row], change: str, method: str) -> Row | None:
    """Medians over the seeds; a run that is never near is so later than all others."""
    runs = [r for r in rows if (r["change"], r["method"]) == (change, method)]
    if not runs:
        return None
    near = [np.inf if r["near"] is None else r["near"] for r in runs]
    return {
        "best": runs[0]["best"],
        "first": statistics.median(r["costs"][0] for r in runs),
        "extra": statistics.median(r["extra"] for r in runs),
        "near": statistics.median(near),
        "runs": sum(each < np.inf for each in near),
        "of": len(runs),
        "last": statistics.median(r["last"] for r in runs),
    }


def as_markdown(rows: Sequence[Row]) -> str:
    """The table."""
    heads = ["change", "J*", "method", "cost at the change", "extra cost"]
    heads += ["within 25% after", "runs", "cost at the end"]
    lines = []
    for change in _in_order(CHANGES, rows, "change"):
        for method in _in_order(METHODS, rows, "method"):
            each = summary(rows, change, method)
            if each is None:
                continue
            near = "never" if each["near"] == np.inf else f"{each['near']:,.0f}"
            best, first, extra, last = (
                f"{each[name]:.1f}" for name in ("best", "first", "extra", "last")
            )
            runs = f"{each['runs']}/{each['of']}"
            lines.append([change, best, method, first, extra, near, runs, last])
    return markdown(heads, lines, names=(0, 2))


LOOKS: dict[str, Row] = {
    "whole memory": {"color": BLUE, "marker": "o"},
    "small memory": {"color": ORANGE, "marker": "s"},
    "forget": {"color": GREEN, "marker": "^"},
    "model": {"color": "#E69F00", "marker": "*"},
    "restart": {"color": "0.3", "marker": "x"},
    "ACL": {"color": "#CC79A7", "marker": "D"},
    "ACL, restart": {"color": "0.6", "marker": "+"},
}


AT_ONCE, NEVER = 200.0, 5e6  # where the lower panel shows them


@in_style()
def draw(rows: Sequence[Row], path: Path) -> None:
    """Draw extra cost and interactions until near over the changes, a panel for each."""
    changes = _in_order(CHANGES, rows, "change")
    methods = _in_order(METHODS, rows, "method")
    figure = new_figure(4.6, dpi=150)
    upper, lower = figure.subplots(2, 1, sharex=True)
    places = np.arange(len(changes))
    for i, method in enumerate(methods):
        every = [summary(rows, change, method) for change in changes]
        found = [each for each in every if each is not None]
        at = np.array([p for p, e in zip(places, every, strict=True) if e is not None])
        at = at + 0.12 * (i - (len(methods) - 1) / 2)
        looks = {**LOOKS[method], "linestyle": "none", "markersize": 5}
        upper.plot(at, [each["extra"] for each in found], **looks)
        near = np.array([each["near"] for each in found])
        lower.plot(at, np.clip(near, AT_ONCE, NEVER), **looks)
    upper.set(yscale="log", ylabel="extra policy cost")
    lower.set(
        yscale="log",
        ylabel="interactions until\nwithin 25% of J*",
        xticks=places,
        xlim=(-0.6, len(changes) - 0.4),
        ylim=(AT_ONCE / 1.6, NEVER * 1.6),
    )
    lower.set_yticks(
        [AT_ONCE, 1e3, 1e4, 1e5, 1e6, NEVER],
        ["at once", "1,000", "10,000", "100,000", "1,000,000", "never"],
    )
    lower.minorticks_off()
    lower.set_xticklabels(changes, rotation=60, ha="right")
    for ax in (upper, lower):
        ax.grid(axis="x", visible=False)
        for place in places[1:]:
            ax.axvline(place - 0.5, color="0.9", lw=0.6)
    handles = [
        Line2D([], [], linestyle="none", markersize=5, **LOOKS[each])
        for each in methods
    ]
    figure.legend(handles, methods, ncols=3, loc="outside upper center")
    figure.savefig(path)


def _in_order(
    known: Sequence[str] | Row, rows: Sequence[Row], column: str
) -> list[str]:
    return [name for name in known if any(row[column] == name for row in rows)]


def main(arguments: list[str] | None = None) -> int:
    """Run and print; returns the exit code."""
    parser = parser_of(__doc__)
    for option, allowed in (("--changes", CHANGES), ("--methods", METHODS)):
        parser.add_argument(
            option,
            nargs="+",
            choices=list(allowed),
            default=list(allowed),
            metavar="NAME",
            help=f"some of {', '.join(map(repr, allowed))} (default: all)",
        )
    add_seeds(parser)
    add_results(parser, "the medians")
    options = parser.parse_args(arguments)
    if options.from_json is None:
        rows = study(options.changes, options.methods, range(options.seeds))
    else:
        rows = rows_of(options.from_json)
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
