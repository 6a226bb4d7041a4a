"""Results made by formula: nothing is trained."""

from __future__ import annotations

import zlib
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from acl_gym.experiments import systems
from acl_gym.experiments.results import Results, Run
from acl_gym.experiments.study import PENDULUM, Experiment, Study, Task
from acl_gym.experiments.swarms.study import SwarmStudy

OPTIMUM = 40.0
TRIALS = 20


def make_run(study: Study, seed: int, costs: Iterable[float] | None = None) -> Run:
    """A run with these policy costs, evaluated each 1,000 steps and each second."""
    if costs is None:
        trials = np.arange(1 if study.method == "planning" else TRIALS)
        costs = OPTIMUM + seed + 2_000 * 0.5**trials * (study.method != "planning")
    cost = np.array([*costs], dtype=np.float64)
    at = np.arange(1.0, len(cost) + 1)
    falling, rng = 1 / at, np.random.default_rng(seed)
    rows = {
        "env_steps": 1_000 * at + 7 * seed,
        "seconds": at,
        "policy_cost": cost,
        "success_rate": (cost < 60).astype(float),
        "ants_cost": 2 * cost,
        "policy_variation": falling,
        "sensitivity": falling,
        "level_q": 0.3 + 0.01 * rng.random(len(cost)),
        "level_best": 0.5 + 0 * at,
        "level_second": 0.6 - 0.2 * np.minimum(at - 1, 1),
        "discount": 0.98 + 0 * at,
    }
    table = np.empty(0)
    if study.method != "dqn":
        env: Any = study.task.make_system_env(1)
        n_actions = int(env.single_action_space.n)
        table = rng.random(study.make_partition().n_cells * n_actions)
    made = {"date": f"2026-01-0{seed + 1}", "cpu": "a CPU"}
    return Run(pd.DataFrame(rows), table, float(at[-1]), "", seed, made)


def make_swarm_run(study: SwarmStudy, seed: int) -> Run:
    """A run of a swarm: numbers drawn by the study and the seed, from 0.1 to 1."""
    rng = np.random.default_rng([seed, zlib.crc32(study.key.encode())])
    points = study.curve_points() or [study.steps]
    names = {
        "aggregation": ("drift", "centre_speed", "size", "rms", "parts"),
        "pso": ("value",),
        "moving-ants": ("entries", "learned", "differing", "same_draws"),
    }[study.method]
    if study.measure == "miss":
        names = (*names, "miss", "centre_miss")
    rows = {name: rng.uniform(0.1, 1.0, len(points)) for name in names}
    at = {"env_steps": np.array(points, dtype=np.float64)}
    table = rng.random(2 * study.settings.get("agents", 50))
    return Run(pd.DataFrame({**at, **rows}), table, 1.0, "", seed)


def make_results(experiment: Experiment[Any], seeds: int = 3, **costs: Any) -> Results:
    """Runs of all studies; `costs` are those of each seed under a study's label."""
    named = {**experiment.studies, **experiment.references}
    runs = {}
    for label, study in named.items():
        count = min(seeds, study.most_runs or seeds)
        given = costs.get(label, [None] * count)
        if isinstance(study, SwarmStudy):
            runs[study.key] = [make_swarm_run(study, seed) for seed in range(count)]
            continue
        runs[study.key] = [make_run(study, i, each) for i, each in enumerate(given)]
    return Results(runs)


def make_experiment(
    studies: dict[str, Study], *plots: str, **options: Any
) -> Experiment:
    """These studies, and dynamic programming on the cells of the first."""
    reference = systems.planned(next(iter(studies.values())))
    return Experiment(
        name="trial",
        title="A trial, rho = 0.1",
        section="§5.3",
        studies=studies,
        references={"J*": reference},
        plots=plots,
        text="What is tried.",
        options={
            "agents": {label: label for label in studies},
            "optimum": True,
            **options,
        },
    )


def pendulums() -> dict[str, Study]:
    """All methods on a coarse pendulum."""
    colony = systems.pendulum("fuzzy", 10, (8, 9))
    q = replace(colony, method="q-learning", settings={"discount": 0.98})
    dqn = Study(task=Task(env_id=PENDULUM), method="dqn", steps=20_000)
    return {
        "ACL, fuzzy": colony,
        "ACL, crisp": replace(colony, kind="crisp"),
        "Q-learning": q,
        "Q(λ)": q.with_settings(trace_decay=0.8),
        "DQN": dqn,
    }
