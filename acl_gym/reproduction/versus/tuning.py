"""The search for settings: the same budget and the same procedure for every method.

Optuna's tree-structured Parzen estimator proposes settings, each is run with the same
seeds, and its value is the cost of the last policies. What was proposed is a function of
the seed and of the values before it, so a search that was stopped goes on as if it had
not been: what is in its file is told again and not run again.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from acl_gym.experiments.runner import versions
from acl_gym.reproduction.versus.arena import Arena
from acl_gym.reproduction.versus.arenas import ARENAS
from acl_gym.reproduction.versus.contest import Contest, learn
from acl_gym.reproduction.versus.spaces import (
    Choice,
    Dimension,
    Integer,
    Real,
    defaults_of,
    space_of,
)
from acl_gym.reproduction.versus.tuned import FOLDER, Search, path_of, read_search
from acl_gym.utils.files import write_atomically

EVALUATIONS = 16
SEEDS = (1000, 1001)
"""Those of the search; the comparison has others."""

STARTUP = 6
"""Evaluations that are drawn evenly before the sampler begins to learn from them."""

SAMPLER_SEED = 0


def search(
    name: str,
    method: str,
    folder: Path = FOLDER,
    *,
    evaluations: int = EVALUATIONS,
    seeds: tuple[int, ...] = SEEDS,
    tell: Callable[[], None] = lambda: None,
) -> Search:
    """Search for the settings of a method in an arena, and keep all of it in a file.

    Args:
        name: of the arena.
        method: of it.
        folder: where the file is, or is made.
        evaluations: how many settings are tried, the first of them the defaults, then
            those of `others_of`.
        seeds: of the runs of each.
        tell: called after each evaluation, also after one that was there.

    Returns:
        The search.

    Raises:
        ModuleNotFoundError: Optuna is not installed.
        ValueError: the file is of another search.
    """
    try:
        import optuna
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            "tuning needs Optuna, which the comparison itself does not; "
            "pip install 'acl-gym[dev]'."
        ) from error
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    arena = ARENAS[name]
    found = begun(name, method, folder, seeds)
    known = found["evaluations"]
    fixed = defaults_of(arena, method)
    distributions = {
        key: _distribution(each) for key, each in space_of(arena, method).items()
    }
    study = optuna.create_study(
        sampler=optuna.samplers.TPESampler(
            seed=SAMPLER_SEED, n_startup_trials=STARTUP, multivariate=True
        )
    )
    for known_settings in (fixed, *others_of(arena, method)):
        study.enqueue_trial({key: known_settings[key] for key in distributions})
    for number in range(evaluations):
        trial = study.ask(distributions)
        if number < len(known):
            if known[number]["parameters"] != trial.params:
                raise ValueError(
                    f"{path_of(name, method, folder)} must hold the search of this "
                    f"version, but its evaluation {number} is another; remove the file "
                    "to search anew."
                )
        else:
            settings = {**fixed, **trial.params}
            known.append(
                {
                    "parameters": trial.params,
                    **evaluate(Contest(arena, method, settings), seeds),
                }
            )
            text = json.dumps(found, indent=1)
            write_atomically(path_of(name, method, folder), f"{text}\n".encode())
        study.tell(trial, known[number]["value"])
        tell()
    return found


def others_of(arena: Arena, method: str) -> list[dict[str, Any]]:
    """Settings that are tried after the defaults, before the sampler proposes any.

    On the grids those of Chapter 3, without a tabu list: under one, an action that failed
    by chance may not be chosen again.
    """
    if method == "acl" and arena.finite:
        return [{**defaults_of(arena, method), "tabu": False, "local_decay": 0.0}]
    return []


def evaluate(contest: Contest, seeds: tuple[int, ...]) -> dict[str, Any]:
    """What settings are worth.

    Args:
        contest: the method with the settings.
        seeds: of the runs.

    Returns:
        `value`, the mean over the seeds of the cost of the last policy; `costs`, that
        of each; `on_the_way`, the mean cost of the policies over the interactions of a
        run; `seconds` of learning, in the mean; `failures`, why runs broke down.
    """
    began = time.perf_counter()
    runs = [learn(contest, seed, lambda done: None) for seed in seeds]
    costs = [run["rows"]["policy_cost"][-1] for run in runs]
    return {
        "value": float(np.mean(costs)),
        "costs": costs,
        "on_the_way": float(np.mean([mean_cost(run["rows"]) for run in runs])),
        "seconds": round(float(np.mean([run["seconds"] for run in runs])), 3),
        "seconds_in_all": round(time.perf_counter() - began, 3),
        "failures": [run["failure"] for run in runs if run["failure"]],
    }


def mean_cost(rows: dict[str, list[float]]) -> float:
    """The mean cost of policies over interactions; each lasts until the next."""
    steps, costs = np.asarray(rows["env_steps"]), np.asarray(rows["policy_cost"])
    spans = np.diff(steps, prepend=0.0)
    held = np.concatenate([costs[:1], costs[:-1]])  # the first from the beginning
    return float(spans @ held / steps[-1])


def begun(name: str, method: str, folder: Path, seeds: tuple[int, ...]) -> Search:
    """The search as far as it is in its file.

    Raises:
        ValueError: the file is of another search.
    """
    arena: Arena = ARENAS[name]
    about = {
        "arena": name,
        "method": method,
        "system": json.loads(json.dumps(asdict(arena))),
        "objective": "mean cost of the last policies",
        "seeds": list(seeds),
        "sampler": {
            "name": "TPE, multivariate",
            "seed": SAMPLER_SEED,
            "startup": STARTUP,
        },
        "space": {
            key: {"kind": type(each).__name__, **json.loads(json.dumps(asdict(each)))}
            for key, each in space_of(arena, method).items()
        },
    }
    if path_of(name, method, folder).is_file():
        found = read_search(name, method, folder)
        for key, value in about.items():
            if found.get(key) != value:
                raise ValueError(
                    f"{path_of(name, method, folder)} must be of this search, but its "
                    f"{key} is {found.get(key)!r:.200} and not {value!r:.200}; remove "
                    "the file to search anew."
                )
        return found
    folder.mkdir(parents=True, exist_ok=True)
    made = {**versions(), "optuna": version("optuna")}
    return {**about, "versions": made, "evaluations": []}


def _distribution(dimension: Dimension) -> Any:
    from optuna import distributions

    if isinstance(dimension, Choice):
        return distributions.CategoricalDistribution(dimension.values)
    if isinstance(dimension, Integer):
        return distributions.IntDistribution(dimension.low, dimension.high, log=True)
    if not isinstance(dimension, Real):
        raise TypeError(
            f"a dimension must be Real, Integer or Choice, got {dimension}."
        )
    return distributions.FloatDistribution(
        dimension.low, dimension.high, log=dimension.log
    )
