"""Measure colonies, Q-learning, DQN, PPO and A2C on environments that Gymnasium brings.

Every run trains once, with the settings of gymnasium_settings.py and one seed. Its
final policy, and the best of those that were seen on the way, are then followed,
without exploring, through the same fresh episodes for all methods. The figures go to
results.json and, as a Markdown table, to table.md in the folder of --out; each run is
kept there as soon as it is done, so that a command that was stopped goes on where it was.
The returning colony and Q-learning with replay have one setting for all environments.

examples:
  python benchmarks/gymnasium_envs.py                        the published table, 3 seeds
  python benchmarks/gymnasium_envs.py --seeds 10             the same with seeds 0 to 9
  python benchmarks/gymnasium_envs.py --agents returning,q-replay --env Taxi-v4,CartPole-v1
"""

from __future__ import annotations

import argparse
import json
import statistics
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import VectorEnv
from gymnasium_settings import ENVIRONMENTS, Candidate, Environment

from acl_gym import (
    ACL,
    Crisp,
    Fuzzy,
    PolicyEvaluation,
    QLearning,
    ReturningACL,
    WaitingVectorEnv,
)
from acl_gym.agents.acl import PheromoneBoundWarning
from acl_gym.colony.episodes import Episode
from acl_gym.envs.wrappers.scaling import ScaledVectorObservation
from acl_gym.evaluation import Predictor, evaluate_policy_cost
from acl_gym.experiments.provenance import circumstances, code_of_runs, versions
from acl_gym.partitions.automatic import automatic_partition
from acl_gym.utils.files import write_atomically
from acl_gym.utils.hashing import hashed
from acl_gym.utils.text import replace_unprintable_letters

Run = dict[str, Any]

METHODS = {
    "acl": "ACL",
    "returning": "Returning ACL",
    "q-learning": "Q-learning",
    "q-replay": "Q-learning, replay",
    "dqn": "DQN",
    "ppo": "PPO",
    "a2c": "A2C",
}
NETWORKS = ("dqn", "ppo", "a2c")
AGENTS: dict[str, type[ACL | ReturningACL | QLearning]] = {
    "acl": ACL,
    "returning": ReturningACL,
    "q-learning": QLearning,
    "q-replay": QLearning,
}
CHOOSING_SEED, TABLE_SEED = 20_000, 10_000
"""Slot i of an evaluation is seeded with this + i; training seeds are drawn anew."""


def make_env(
    environment: Environment, slots: int, angles: bool = False, scaled: bool = False
) -> VectorEnv[Any, Any, Any]:
    """Gymnasium's own environment in so many slots; `angles` is for Acrobot's.

    With `scaled`, observations are scaled to [-1, 1]; they must have bounds.
    """
    env = _with_slots(environment, slots, angles)
    return ScaledVectorObservation(env) if scaled else env


def _with_slots(environment: Environment, slots: int, angles: bool) -> WaitingVectorEnv:
    kwargs = dict(environment.kwargs)
    if environment.limit is not None:
        kwargs["max_episode_steps"] = environment.limit
    if not angles:
        return WaitingVectorEnv.make(environment.env_id, slots, **kwargs)
    return WaitingVectorEnv(
        [lambda: with_angles(gym.make(environment.env_id, **kwargs))] * slots
    )


def with_angles(env: gym.Env[Any, Any]) -> gym.Env[Any, Any]:
    """Acrobot's two angles in place of their cosines and sines: 4 variables, not 6."""
    box = env.observation_space
    low = np.array([-np.pi, -np.pi, *box.low[4:]])
    return gym.wrappers.TransformObservation(
        env,
        lambda o: np.array(
            [np.arctan2(o[1], o[0]), np.arctan2(o[3], o[2]), o[4], o[5]]
        ),
        gym.spaces.Box(low, -low, dtype=np.float64),
    )


def time_limit(environment: Environment) -> int:
    return environment.limit or gym.spec(environment.env_id).max_episode_steps or 300


def follow(
    policy: Predictor,
    environment: Environment,
    angles: bool = False,
    scaled: bool = False,
) -> dict[str, float]:
    """The mean return over the episodes of the table."""
    env = make_env(environment, environment.episodes, angles, scaled)
    limit = time_limit(environment)
    result = evaluate_policy_cost(policy, env, max_steps=limit, seed=TABLE_SEED)
    env.close()
    return {
        "return": result.mean_return,
        "success_rate": result.success_rate,
        "length": float(result.lengths.mean()),
    }


@dataclass(frozen=True)
class Task:
    """One run: its file's name, the arguments of `run`, and what identifies it."""

    name: str
    arguments: tuple[Any, ...]
    settings: dict[str, Any]


def run(name: str, method: str, candidate: Candidate, seed: int) -> Run:
    """Train once and follow the final and the best policy."""
    warnings.simplefilter("ignore", PheromoneBoundWarning)
    environment, settings = ENVIRONMENTS[name], dict(candidate)
    if "episodes" in settings:
        episodes = settings.pop("episodes")
        environment = replace(environment, episodes=episodes, choosing=episodes)
    train = train_network if method in NETWORKS else train_tabular
    result = train(environment, method, settings, seed)
    return {"env": name, "method": method, "seed": seed, **result}


def train_tabular(
    environment: Environment,
    method: str,
    settings: Candidate,
    seed: int,
) -> Run:
    """A colony or Q-learning; Numba has compiled before the clock starts."""
    keys = ("slots", "trials", "total", "every", "kind", "cells", "bounds", "angles")
    slots, trials, total, every, kind, cells, bounds, angles = (
        settings.pop(key, None) for key in keys
    )
    angles = bool(angles)
    env: VectorEnv[Any, Any, Any] = make_env(environment, slots, angles)
    if gym.spec(environment.env_id).vector_entry_point is not None:
        env = gym.make_vec(environment.env_id, num_envs=slots)  # native, and faster
    partition = None  # the agent chooses one, which grows
    if kind != "growing":
        partition = automatic_partition(
            env, kind=Crisp if kind == "crisp" else Fuzzy, cells=cells, bounds=bounds
        )
    if "cost" in settings:
        settings["cost"] = COSTS[settings["cost"]]
    make = AGENTS[method]
    steps = time_limit(environment)
    warm = make(
        make_env(environment, 2, angles), partition, max_steps=2, seed=0, **settings
    )
    warm.learn(trials=1)  # Numba compiles
    agent = make(env, partition, max_steps=steps, seed=seed, **settings)
    watch = PolicyEvaluation(
        make_env(environment, environment.choosing, angles),
        every=every,
        max_steps=time_limit(environment),
        seed=CHOOSING_SEED,
    )
    agent.learn(total, trials, callback=watch)
    rows = [row for row in agent.history if "policy_cost" in row]
    return outcome(agent.policy, watch.best_policy, rows, environment, angles)


def train_network(
    environment: Environment,
    method: str,
    settings: Candidate,
    seed: int,
) -> Run:
    """A model of Stable-Baselines3; discrete observations become one-hot there.

    With `scaled`, it sees observations scaled to [-1, 1] and normalised rewards.
    """
    import torch
    from stable_baselines3 import A2C, DQN, PPO
    from stable_baselines3.common.vec_env import VecNormalize

    from acl_gym.sb3.adapter import VectorEnvAdapter
    from acl_gym.sb3.callback import PolicyCostCallback

    torch.set_num_threads(1)  # the fastest for such small networks
    slots, steps, every, net_arch = (
        settings.pop(key) for key in ("slots", "steps", "every", "net_arch")
    )
    scaled, policy = settings.pop("scaled", False), {"net_arch": list(net_arch)}
    if method == "dqn":
        policy["optimizer_kwargs"] = {"fused": True}
    learns_in = VectorEnvAdapter(make_env(environment, slots, scaled=scaled))
    if scaled:
        learns_in = VecNormalize(
            learns_in, norm_obs=False, gamma=settings.get("gamma", 0.99)
        )
    model = {"dqn": DQN, "ppo": PPO, "a2c": A2C}[method](
        "MlpPolicy",
        learns_in,
        seed=seed,
        device="cpu",
        policy_kwargs=policy,
        **settings,
    )
    watch = PolicyCostCallback(
        make_env(environment, environment.choosing, scaled=scaled),
        every=every,
        max_steps=time_limit(environment),
        seed=CHOOSING_SEED,
    )
    model.learn(steps, callback=watch)
    final = follow(model, environment, scaled=scaled)
    watch.restore_best()
    result = outcome(model, model, watch.history, environment, scaled=scaled)
    return {**result, "final": final}


def outcome(
    final: Predictor,
    best: Any,
    rows: list[dict[str, float]],
    environment: Environment,
    angles: bool = False,
    scaled: bool = False,
) -> Run:
    """What a run comes to, in JSON types."""
    cheapest = min(rows, key=lambda row: row["policy_cost"])
    target = environment.on_the_way
    target = environment.target if target is None else target
    good = (row for row in rows if row["policy_return"] >= target)
    first: dict[str, float] = next(good, {})
    return {
        "final": follow(final, environment, angles, scaled),
        "best": follow(best, environment, angles, scaled),
        "steps": rows[-1]["env_steps"],
        "seconds": rows[-1]["seconds"],
        "best_steps": cheapest["env_steps"],
        "best_seconds": cheapest["seconds"],
        "target_steps": first.get("env_steps"),
        "target_seconds": first.get("seconds"),
        "curve": [[row["env_steps"], row["policy_return"]] for row in rows],
    }


def highest_point(episode: Episode) -> float:
    """Steps to the flag; without it, the more the lower the car has stayed.

    For MountainCar, where a solution that never arrives costs 200 however near it came.
    """
    if episode.terminated:
        return float(episode.actions.size)
    return 200.0 + 200.0 * (0.5 - float(episode.observations[:, 0].max()))


COSTS: dict[str, Callable[[Episode], float]] = {"highest_point": highest_point}
"""Costs of whole episodes that candidates name."""


SMOKE: dict[str, Candidate] = {
    "acl": {"slots": 10, "trials": 2, "every": 1, "episodes": 2},
    "q-learning": {"slots": 5, "trials": 2, "every": 1, "episodes": 2},
    "returning": {"slots": 5, "total": 100, "every": 1, "episodes": 2},
    "q-replay": {"slots": 5, "total": 100, "every": 1, "episodes": 2},
    "dqn": {
        "episodes": 2,
        "steps": 400,
        "every": 200,
        "learning_starts": 100,
        "train_freq": 4,
    },
    "ppo": {"episodes": 2, "steps": 400, "every": 200, "n_steps": 16, "batch_size": 32},
    "a2c": {"episodes": 2, "steps": 400, "every": 200},
}
"""To see that all of it works; its figures mean nothing."""


def list_tasks(
    names: Sequence[str], methods: Sequence[str], seeds: Sequence[int], preset: str
) -> list[Task]:
    """Every run: of the chosen settings, or of all candidates in a search."""
    tasks = []
    for name in names:
        for method in methods:
            candidates = ENVIRONMENTS[name].candidates[method]
            if preset != "search":
                candidates = candidates[:1]
            for number, candidate in enumerate(candidates):
                if preset == "smoke":
                    candidate = {**candidate, **SMOKE[method]}
                shown = {key: _shown(value) for key, value in candidate.items()}
                tasks += [
                    Task(
                        f"{name}-{method}-{number}-{seed}",
                        (name, method, candidate, seed),
                        {"number": number, "settings": shown},
                    )
                    for seed in seeds
                ]
    return tasks


def _shown(value: Any) -> Any:
    return value if isinstance(value, (int, float, str, bool)) else repr(value)


def run_tasks(tasks: Sequence[Task], directory: Path) -> list[tuple[Task, Run]]:
    """The result of each task; those that are not there are made and kept."""
    directory.mkdir(parents=True, exist_ok=True)
    done = []
    for task in tasks:
        path = directory / f"{task.name}.json"
        key = hashed([task.settings, code_of_runs(), versions()])
        stored = json.loads(path.read_text()) if path.exists() else {}
        if stored.get("key") != key:
            result = {**run(*task.arguments), "made": circumstances(1)}
            stored = {"key": key, "settings": task.settings, "result": result}
            write_atomically(path, json.dumps(stored).encode())
        print(f"done: {task.name}", flush=True)
        done.append((task, stored["result"]))
    return done


def kept_runs(tasks: Sequence[Task], directory: Path) -> list[tuple[Task, Run]]:
    """The tasks that have been run with the same settings, whatever the code."""
    kept = []
    for task in tasks:
        path = directory / f"{task.name}.json"
        if path.exists():
            stored = json.loads(path.read_text())
            if stored["settings"] == task.settings:
                kept.append((task, stored["result"]))
    return kept


def summarise(done: Sequence[tuple[Task, Run]]) -> list[dict[str, Any]]:
    """One row for each environment, method and candidate, over its seeds."""
    groups: dict[tuple[str, str, int], list[Run]] = {}
    for task, result in done:
        key = (result["env"], result["method"], task.settings["number"])
        groups.setdefault(key, []).append(result)
    rows = []
    for (name, method, number), runs in groups.items():
        target = ENVIRONMENTS[name].target
        row: dict[str, Any] = {"env": name, "method": method, "candidate": number}
        row["seeds"] = [result["seed"] for result in runs]
        for which in ("final", "best"):
            returns = [result[which]["return"] for result in runs]
            row[which] = {
                "median": statistics.median(returns),
                "lowest": min(returns),
                "highest": max(returns),
                "reached": sum(value >= target for value in returns),
            }
        for measure in ("steps", "seconds", "best_steps", "best_seconds"):
            row[measure] = statistics.median(result[measure] for result in runs)
        for measure in ("target_steps", "target_seconds"):  # None: not reached
            known = [result.get(measure) for result in runs]
            middle = statistics.median(np.inf if x is None else x for x in known)
            row[measure] = None if np.isinf(middle) else middle
        rows.append(row)
    return rows


def as_markdown(rows: Sequence[dict[str, Any]]) -> str:
    """The table of docs/gymnasium.md."""
    lines = [
        "| environment (target) | method | final policy | best policy seen "
        "| steps to the target | seconds | all steps | seconds |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in rows:
        candidate = f", candidate {row['candidate']}" if row["candidate"] else ""
        cells = [
            f"{row['env']} ({ENVIRONMENTS[row['env']].target:g})",
            METHODS[row["method"]] + candidate,
            *(_cell(row[which], len(row["seeds"])) for which in ("final", "best")),
            _number(row["target_steps"], ",.0f"),
            _number(row["target_seconds"], ".2g"),
            f"{row['steps']:,.0f}",
            f"{row['seconds']:.3g}",
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _number(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)


def _cell(figures: dict[str, float], seeds: int) -> str:
    low, median, high = (
        f"{figures[name] + 0.0:.4g}" for name in ("lowest", "median", "highest")
    )
    spread = "" if low == high else f" ({low} to {high})"
    return f"{median}{spread}; {figures['reached']} of {seeds}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, write and print; returns the exit code."""
    options = _parser().parse_args(arguments)
    first, count = {"smoke": (0, 1), "search": (100, 1), "full": (0, 3)}[options.preset]
    first = first if options.seed is None else options.seed
    seeds = range(first, first + (options.seeds or count))
    tasks = list_tasks(options.env, options.agents, seeds, options.preset)
    folder = options.out / "runs"
    done = (kept_runs if options.table_only else run_tasks)(tasks, folder)
    if not done:
        print(f"There are no runs in {folder}; leave out --table-only to make them.")
        return 1
    rows = summarise(done)
    stored = {
        "preset": options.preset,
        "gymnasium": gym.__version__,
        "environments": {
            name: {
                "id": ENVIRONMENTS[name].env_id,
                "target": ENVIRONMENTS[name].target,
                "why": ENVIRONMENTS[name].why,
                "episodes": ENVIRONMENTS[name].episodes,
                "time_limit": time_limit(ENVIRONMENTS[name]),
            }
            for name in options.env
        },
        "table": rows,
        "runs": [{**result, **task.settings} for task, result in done],
    }
    table = as_markdown(rows)
    write_atomically(
        options.out / "results.json", json.dumps(stored, indent=1).encode()
    )
    write_atomically(options.out / "table.md", table.encode())
    print(table)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--preset",
        choices=("smoke", "search", "full"),
        default="full",
        help="smoke: seconds, figures without meaning. full: the chosen settings with "
        "seeds 0, 1 and 2; about 25 minutes of one core for each. search: all candidates of "
        "gymnasium_settings.py with seed 100 (default: %(default)s)",
    )
    parser.add_argument(
        "--env",
        type=_names(ENVIRONMENTS),
        default=list(ENVIRONMENTS),
        help=f"some of {', '.join(ENVIRONMENTS)}, with commas (default: all)",
    )
    parser.add_argument(
        "--agents",
        type=_names(METHODS),
        default=list(METHODS),
        help=f"some of {', '.join(METHODS)}, with commas (default: all)",
    )
    parser.add_argument(
        "--seeds",
        type=_at_least(1),
        metavar="N",
        help="runs of each (default: 3, of the other presets 1)",
    )
    parser.add_argument(
        "--seed",
        type=_at_least(0),
        metavar="N",
        help="of the first run; the others follow it (default: 0, in a search 100)",
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("runs/gymnasium"),
        help="where results go, and where runs are kept (default: %(default)s)",
    )
    parser.add_argument(
        "--table-only",
        action="store_true",
        help="make no runs, only the table of those that are kept",
    )
    return parser


def _at_least(least: int) -> Callable[[str], int]:
    def whole(text: str) -> int:
        if not (text.isdecimal() and int(text) >= least):
            raise argparse.ArgumentTypeError(
                f"must be an integer >= {least}, got {text!r}"
            )
        return int(text)

    return whole


def _names(known: Iterable[str]) -> Callable[[str], list[str]]:
    def names(text: str) -> list[str]:
        given = text.split(",")
        for name in given:
            if name not in known:
                raise argparse.ArgumentTypeError(
                    f"{name!r} is not one of {', '.join(known)}"
                )
        return given

    return names


if __name__ == "__main__":
    replace_unprintable_letters()
    raise SystemExit(main())
