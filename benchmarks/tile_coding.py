"""True online Sarsa(lambda) with tile coding, of MushroomRL: a rival from outside.

MushroomRL pins versions that conflict with those of acl-gym, so that it has an environment
of its own: `make peers-mushroom` makes .venv-mushroom, where this package and its locked
dependencies are installed too, so that policies are evaluated by the same code from the
same starts as all others. Settings are in `TASKS`; `--search` looks for better ones with the
budget and the sampler that benchmarks/tune.py has for the methods of this package.

examples:
  .venv-mushroom/bin/python benchmarks/tile_coding.py                     all tasks, a table
  .venv-mushroom/bin/python benchmarks/tile_coding.py --tasks pendulum --seeds 30 --json
  .venv-mushroom/bin/python benchmarks/tile_coding.py --tasks MountainCar-v0 --search 16
  .venv-mushroom/bin/python benchmarks/tile_coding.py --set epsilon=0.05 --set learning_rate=0.5

A run learns in one slot, as MushroomRL's `Core` does. JSON has for each run `rows`:
`env_steps`, `seconds` (of learning alone) and `policy_cost` after so many interactions,
`success_rate` where success is known, and `policy_return` in Gymnasium's tasks.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray
from tqdm.auto import tqdm

from acl_gym import WaitingVectorEnv
from acl_gym.evaluation import evaluate_policy_cost, policy_measures
from acl_gym.utils.text import replace_unprintable_letters

Row = dict[str, Any]
Arrays = tuple[NDArray[np.float64], NDArray[np.float64]]

SEARCH_SEEDS = (1000, 1001)
"""As in tune.py; runs of the table have others."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What the agent runs with.

    Attributes:
        n_tilings: tilings, each displaced a little, >= 1.
        tiles: of each tiling along each variable, >= 1.
        learning_rate: alpha times `n_tilings`: the share of the error by which the value
            of a state is corrected at once, > 0.
        discount: gamma, in [0, 1].
        trace_decay: lambda, in [0, 1].
        epsilon: probability of a random action, in [0, 1].
        horizon: steps after which an episode is truncated, >= 1.
    """

    n_tilings: int = 8
    tiles: int = 8
    learning_rate: float = 0.5
    discount: float = 0.99
    trace_decay: float = 0.9
    epsilon: float = 0.05
    horizon: int


@dataclass(frozen=True, kw_only=True)
class Task:
    """An environment and how its policies are judged.

    Attributes:
        env_id: of the environment.
        steps: interactions of a run.
        settings: of the agent.
        marks: costs that count as close, for the columns of the table.
        bounds: of variables that have none, by their number; states beyond are clipped.
        starts: episodes of an evaluation, of seeds that are the same in each; None: the
            evaluation states of the environment.
    """

    env_id: str
    steps: int
    settings: Settings
    marks: tuple[float, float]
    bounds: dict[int, tuple[float, float]] = field(default_factory=dict)
    starts: int | None = None

    def ranges(self) -> Arrays:
        """The lowest and the highest value of each variable."""
        box: Any = gym.make(self.env_id).observation_space
        low, high = box.low.astype(np.float64), box.high.astype(np.float64)
        for axis, (least, most) in self.bounds.items():
            low[axis], high[axis] = least, most
        return low, high

    def evaluation_env(self) -> VectorEnv[Any, Any, Any]:
        """Where policies are evaluated."""
        if self.starts is None:
            return gym.make_vec(self.env_id, num_envs=1)
        return WaitingVectorEnv.make(self.env_id, self.starts)


TASKS = {
    "pendulum": Task(
        env_id="acl_gym/Pendulum-v0",
        steps=100_000,
        # 100 instead of the 300 of an evaluation, as DQN has.
        # The best of a search of 16.
        settings=Settings(
            tiles=5,
            learning_rate=0.367,
            discount=0.98,
            trace_decay=0.333,
            epsilon=0.232,
            horizon=100,
        ),
        marks=(1.25 * 38.4, 1.1 * 38.4),  # J* by value iteration on a fine grid
    ),
    "MountainCar-v0": Task(
        env_id="MountainCar-v0",
        steps=100_000,
        settings=Settings(discount=1.0, epsilon=0.0, horizon=200),
        marks=(125.0, 110.0),  # that of Gymnasium is 110
        starts=50,
    ),
    "CartPole-v1": Task(
        env_id="CartPole-v1",
        steps=50_000,
        settings=Settings(tiles=5, learning_rate=0.2, horizon=500),
        marks=(-400.0, -475.0),  # that of Gymnasium is 475
        bounds={0: (-2.4, 2.4), 1: (-3.0, 3.0), 2: (-0.21, 0.21), 3: (-3.5, 3.5)},
        starts=50,
    ),
}
EVALUATION_SEED = 20_000
"""Slot i of an evaluation is seeded with this + i, as in gymnasium_envs.py."""


class TilePolicy:
    """The greedy policy of an agent, for whole batches of states.

    MushroomRL computes features one state after the other; this is the same arithmetic.

    Args:
        weights: of the approximator, `(n_actions * n_features,)`.
        tilings: of MushroomRL.
        n_actions: how many actions there are.
        ranges: see `Task.ranges`.
    """

    def __init__(
        self,
        weights: NDArray[np.float64],
        tilings: Sequence[Any],
        n_actions: int,
        ranges: Arrays,
    ) -> None:
        self.weights = weights.reshape(n_actions, -1)
        self.tilings, self.ranges = tilings, ranges

    def values(self, states: NDArray[Any]) -> NDArray[np.float64]:
        """The action values of states `(n, d)`, shape `(n, n_actions)`."""
        states = within(states, self.ranges)
        values, offset = np.zeros((len(states), len(self.weights))), 0
        for tiling in self.tilings:
            index, factor = np.full(len(states), offset), 1
            for axis, ((low, high), number) in enumerate(
                zip(tiling._range, tiling._n_tiles, strict=True)
            ):
                place = number * (states[:, axis] - low) / (high - low)
                index += factor * np.floor(place).astype(np.int64)
                factor *= number
            values += self.weights[:, index].T
            offset += tiling.size
        return values

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.int64], Any]:
        """The greedy actions for a batch of observations `(n, d)`."""
        return self.values(np.asarray(observation, np.float64)).argmax(axis=1), state


def within(states: NDArray[Any], ranges: Arrays) -> NDArray[np.float64]:
    """States clipped to what the tilings cover.

    The highest value belongs to no tile of some tilings; a number just below it might be
    rounded up to it where its tile is computed.
    """
    low, high = ranges
    return np.clip(states, low, high - 1e-9 * (high - low)).astype(np.float64)


def run(task: Task, seed: int, evaluations: int = 50) -> Row:
    """Learn once, and evaluate so many times on the way, ever more rarely."""
    from mushroom_rl.algorithms.value import TrueOnlineSARSALambda
    from mushroom_rl.core import Core, Environment, MDPInfo
    from mushroom_rl.features import Features
    from mushroom_rl.features.tiles import Tiles
    from mushroom_rl.policy import EpsGreedy
    from mushroom_rl.utils import spaces
    from mushroom_rl.utils.parameters import Parameter

    settings, ranges = task.settings, task.ranges()
    n_actions = int(gym.make(task.env_id).action_space.n)  # type: ignore[attr-defined]

    class Plant(Environment):  # type: ignore[misc]
        """The environment as MushroomRL has it; its `Core` counts the horizon."""

        def __init__(self) -> None:
            self._env = gym.make(task.env_id, max_episode_steps=settings.horizon)
            self._seed: int | None = seed
            box = spaces.Box(*ranges)
            actions = spaces.Discrete(n_actions)
            super().__init__(MDPInfo(box, actions, settings.discount, settings.horizon))

        def reset(self, state: Any = None) -> NDArray[np.float64]:
            observation, _ = self._env.reset(seed=self._seed)
            self._seed = None
            return within(observation, ranges)

        def step(self, action: Any) -> tuple[Any, float, bool, dict[str, Any]]:
            found = self._env.step(int(action[0]))
            observation, reward, terminated = found[:3]
            return within(observation, ranges), float(reward), bool(terminated), {}

    np.random.seed(seed)  # noqa: NPY002 - MushroomRL draws from the global generator
    low, high = ranges
    tilings = Tiles.generate(
        settings.n_tilings, [settings.tiles] * low.size, low, high, uniform=False
    )
    features = Features(tilings=tilings)
    plant = Plant()
    agent = TrueOnlineSARSALambda(
        plant.info,
        EpsGreedy(epsilon=Parameter(settings.epsilon)),
        Parameter(settings.learning_rate / settings.n_tilings),
        settings.trace_decay,
        features,
        {
            "input_shape": (features.size,),
            "output_shape": (n_actions,),
            "n_actions": n_actions,
        },
    )
    env, rows = task.evaluation_env(), []
    due = set(
        np.geomspace(min(500, task.steps), task.steps, evaluations).round().tolist()
    )
    steps, seconds = 0, 0.0

    def evaluate(dataset: Any) -> None:
        nonlocal steps, seconds, began
        steps += 1
        if steps not in due:
            return
        seconds += time.perf_counter() - began
        policy = TilePolicy(agent.Q.get_weights(), tilings, n_actions, ranges)
        result = evaluate_policy_cost(policy, env, seed=EVALUATION_SEED)
        found = policy_measures(result, env)
        rows.append({"env_steps": steps, "seconds": seconds, **found})
        began = time.perf_counter()

    core = Core(agent, plant, callbacks_fit=[evaluate])
    began = time.perf_counter()
    core.learn(n_steps=task.steps, n_steps_per_fit=1, quiet=True)
    costs = [row["policy_cost"] for row in rows]
    return {"seed": seed, "rows": rows, "last": costs[-1], "best": min(costs)}


def table(name: str, runs: Sequence[Row]) -> str:
    """One line for each task; medians over the seeds."""
    cells = [name, str(len(runs))]
    for mark in TASKS[name].marks:
        firsts = []
        for one in runs:
            reached = (row for row in one["rows"] if row["policy_cost"] <= mark)
            firsts.append(next(reached, None))
        known = [row for row in firsts if row is not None]
        for key in ("env_steps", "seconds"):
            values = [np.inf if row is None else row[key] for row in firsts]
            middle = statistics.median(values)
            cells.append("never" if middle == np.inf else f"{middle:,.4g}")
        cells[-2] += f" ({len(known)} of {len(runs)})" * (len(known) < len(runs))
    cells += [
        f"{statistics.median(run[key] for run in runs):.4g}" for key in ("last", "best")
    ]
    cells.append(f"{statistics.median(run['rows'][-1]['seconds'] for run in runs):.3g}")
    return f"| {' | '.join(cells)} |"


HEAD = (
    "| task | runs | steps to the first mark | seconds | steps to the second | seconds "
    "| last cost | best | seconds of a run |\n"
    "| --- | --- | --- | --- | --- | --- | --- | --- | --- |"
)


def search(task: Task, evaluations: int) -> Row:
    """Settings that are better on a task: the first evaluation has those of `TASKS`."""
    import optuna
    from tune import SAMPLER

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(
        sampler=optuna.samplers.TPESampler(
            seed=SAMPLER["seed"], n_startup_trials=SAMPLER["startup"], multivariate=True
        )
    )
    names = ("tiles", "learning_rate", "discount", "trace_decay", "epsilon")
    study.enqueue_trial({name: getattr(task.settings, name) for name in names})
    tried = []
    for _ in tqdm(range(evaluations), unit="evaluation"):
        trial = study.ask()
        found = {
            "tiles": trial.suggest_int(
                "tiles", 4, 16 if len(task.ranges()[0]) < 3 else 7
            ),
            "learning_rate": trial.suggest_float("learning_rate", 0.03, 1.5, log=True),
            "discount": trial.suggest_categorical("discount", (0.95, 0.98, 0.99, 1.0)),
            "trace_decay": trial.suggest_float("trace_decay", 0.1, 0.98),
            "epsilon": trial.suggest_float("epsilon", 0.0, 0.3),
        }
        other = replace(task, settings=replace(task.settings, **found))
        costs = [run(other, seed)["last"] for seed in SEARCH_SEEDS]
        tried.append(
            {"settings": found, "costs": costs, "value": float(np.mean(costs))}
        )
        study.tell(trial, tried[-1]["value"])
    return {"best": min(tried, key=lambda each: each["value"]), "tried": tried}


def changed(task: Task, pairs: Iterable[str], steps: int | None) -> Task:
    """A task with some settings, such as "epsilon=0.1", and another number of steps.

    Raises:
        ValueError: there is no such setting, or its value is no number.
    """
    found: dict[str, float | int] = {}
    for pair in pairs:
        name, _, text = pair.partition("=")
        kinds = {
            each: type(getattr(task.settings, each)) for each in vars(task.settings)
        }
        if name not in kinds:
            raise ValueError(
                f"--set must name one of {', '.join(kinds)}, got {pair!r}; for instance "
                "epsilon=0.1."
            )
        try:
            found[name] = kinds[name](text)
        except ValueError:
            raise ValueError(
                f"--set {name} must be a number ({kinds[name].__name__}), got {text!r}."
            ) from None
    settings = replace(task.settings, **found)
    return replace(task, settings=settings, steps=steps or task.steps)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run and print; returns the exit code."""
    options = _parser().parse_args(arguments)
    try:
        tasks = {
            name: changed(TASKS[name], options.set, options.steps)
            for name in options.tasks
        }
    except ValueError as error:
        print(f"tile_coding.py: {error}", file=sys.stderr)
        return 2
    if options.search:
        found = {name: search(task, options.search) for name, task in tasks.items()}
        print(json.dumps(found, indent=1))
        return 0
    results = []
    for name, task in tasks.items():
        run(replace(task, steps=200), 0, 1)  # Numba compiles
        seeds = range(options.seed, options.seed + options.seeds)
        runs = [run(task, seed) for seed in tqdm(seeds, desc=name, leave=False)]
        settings = vars(task.settings)
        results.append({"task": name, "settings": settings, "runs": runs})
    if options.json:
        print(json.dumps({"method": "true online Sarsa(lambda)", "tasks": results}))
    else:
        lines = [table(each["task"], each["runs"]) for each in results]
        print("\n".join([HEAD, *lines]))
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--tasks",
        nargs="+",
        choices=tuple(TASKS),
        default=list(TASKS),
        help="what is learned (default: all)",
    )
    parser.add_argument(
        "--seeds",
        type=_at_least(1),
        default=3,
        metavar="N",
        help="runs of each task (default: %(default)s)",
    )
    parser.add_argument(
        "--seed", type=_at_least(0), default=0, metavar="N", help="the first seed"
    )
    parser.add_argument(
        "--steps",
        type=_at_least(1),
        metavar="N",
        help="interactions of each run (default: those of the task)",
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help=f"one of {', '.join(Settings.__annotations__)}; may be given again",
    )
    parser.add_argument(
        "--search",
        type=_at_least(1),
        metavar="N",
        help="try so many settings, two runs of each, and print them as JSON",
    )
    parser.add_argument("--json", action="store_true", help="print JSON, no table")
    return parser


def _at_least(least: int) -> Any:
    def whole(text: str) -> int:
        if not (text.isdecimal() and int(text) >= least):
            raise argparse.ArgumentTypeError(
                f"must be an integer >= {least}, got {text!r}"
            )
        return int(text)

    return whole


if __name__ == "__main__":
    replace_unprintable_letters()
    raise SystemExit(main())
