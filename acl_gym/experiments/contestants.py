"""The contestants of the comparison: which methods, and how a run of one is made.

A run is a (method, seed) on a course (`courses`). `comparison` puts runs together.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import VectorEnv

from acl_gym.agents.acl import ACL, PheromoneBoundWarning
from acl_gym.agents.base import TabularAgent
from acl_gym.agents.q_learning import QLearning
from acl_gym.callbacks import Agent, Callback, PolicyEvaluation
from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.evaluation import PolicyCost, Predictor, control_env, evaluate_policy_cost
from acl_gym.experiments.courses import CONTINUOUS, Budget, Course
from acl_gym.experiments.pictures import PICTURES
from acl_gym.partitions import Partition
from acl_gym.partitions.grid import Grid
from acl_gym.planning.q_iteration import fuzzy_q_iteration
from acl_gym.planning.value_iteration import value_iteration
from acl_gym.utils.typing import Row

Report = Callable[[float], None]
"""Told the fraction of a run that is done."""

Run = dict[str, Any]
"""The result of one run, all of it JSON; the keys are those of `finish_run`."""

PRESETS = {"smoke": 1, "quick": 3, "full": 10}
"""How many runs of each method, with seeds 0, 1, ...; each course has its budgets."""

CONTESTANTS = tuple(CONTINUOUS)
"""Every method there is, in order; not each runs on each course."""


def run(method: str, course: Course, seed: int, budget: Budget, report: Report) -> Run:
    """Train one method with one seed and say how it went.

    Args:
        method: one of the course's.
        course: where it runs.
        seed: the seed.
        budget: how much to do.
        report: told of progress.

    Raises:
        ValueError: the method does not exist there.
    """
    course.require(method)
    train = _train_dqn if method == "dqn" else _train_table
    return {
        "agent": method,
        "label": course.methods[method],
        "seed": seed,
        **train(method, course, seed, budget, report),
    }


def _train_table(
    method: str, course: Course, seed: int, budget: Budget, report: Report
) -> Run:
    env = make_env(course.env_id, course.slots)
    grid = course.partition(method)
    compile_kernels(method, course, env, grid)
    agent = _make_agent(method, course, env, grid, seed)
    evaluation = PolicyEvaluation(env)
    agent.learn(
        trials=budget.trials, callback=[evaluation, _Progress(report, budget.trials)]
    )
    if evaluation.best is None:  # pragma: no cover - every trial is evaluated
        raise RuntimeError("no trial was evaluated")
    parameters = {
        **agent.parameters(),
        "slots": course.slots,
        "partition": repr(grid),
        "trials": budget.trials,
    }
    return finish_run(
        agent, env.with_slots, course, agent.history, evaluation.best, parameters
    )


def _train_dqn(
    method: str, course: Course, seed: int, budget: Budget, report: Report
) -> Run:
    # Only here: importing torch takes seconds that the other methods do not need.
    import torch
    from stable_baselines3.common.callbacks import ConvertCallback

    from acl_gym.sb3.callback import PolicyCostCallback
    from acl_gym.sb3.dqn import DQNSettings, make_dqn, scaled_env

    torch.set_num_threads(1)  # the fastest for such small networks
    chosen = DQNSettings(**course.settings(method, long_run=budget.long_run))

    def scaled(slots: int | None) -> VectorEnv[Any, Any, Any]:
        return scaled_env(course.env_id, slots)

    model = make_dqn(course.env_id, chosen, seed)
    evaluation = PolicyCostCallback(scaled(None), every=budget.dqn_every)

    def tell(local: dict[str, Any], _: dict[str, Any]) -> bool:
        report(min(local["self"].num_timesteps / budget.dqn_steps, 1.0))
        return True

    model.learn(
        total_timesteps=budget.dqn_steps,
        callback=[evaluation, ConvertCallback(tell)],
    )
    if evaluation.best is None:  # pragma: no cover - the last policy is evaluated
        raise RuntimeError("no policy was evaluated")
    parameters = {
        **asdict(chosen),
        "net_arch": list(chosen.net_arch),
        "steps": budget.dqn_steps,
    }
    return finish_run(
        model, scaled, course, evaluation.history, evaluation.best, parameters
    )


def finish_run(
    model: Predictor,
    make: Callable[[int], VectorEnv[Any, Any, Any]],
    course: Course,
    history: list[Row],
    best: PolicyCost,
    parameters: dict[str, Any],
) -> Run:
    """Bring what a run has left behind into JSON types.

    Args:
        model: the agent after training.
        make: makes the environment that `model` sees, with so many slots.
        course: says how policies are pictured.
        history: rows with `env_steps`, `seconds`, `policy_cost`, `success_rate`.
        best: the evaluation of the best policy of `history`.
        parameters: the settings of the run.
    """
    columns = ("env_steps", "seconds", "policy_cost", "success_rate")
    rows = [{name: row[name] for name in columns} for row in history]
    cheapest = min(rows, key=lambda row: row["policy_cost"])
    return {
        "rows": rows,
        "best": {**cheapest, "success_rate": best.success_rate},
        "parameters": parameters,
        "picture": PICTURES[course.pictures].record(model, make),
    }


def find_reference(course: Course, budget: Budget) -> dict[str, Any]:
    """What the policies are held against, found by dynamic programming on the model.

    Args:
        course: where.
        budget: says on how fine a partition, if not on the exact model.

    Returns:
        `optimal_cost`, or `best_known_cost` where the policy is not taken for the
        optimum; `success_rate`; `method`; its `picture`; and where it is found on a
        partition `cells`, and `coarse`: what the same method reaches on the cells
        that the fuzzy methods have.
    """
    env = make_env(course.env_id, 1)
    name = "optimal_cost" if course.optimum else "best_known_cost"
    record = PICTURES[course.pictures].record
    if budget.reference is None:
        exact = value_iteration(env)
        starts = env.system.evaluation_states()[:, 0].astype(np.int64)
        return {
            name: float(-exact.values[starts].mean()),
            "success_rate": evaluate_policy_cost(exact.policy, env).success_rate,
            "method": "value iteration",
            "picture": record(exact.policy, env.with_slots),
        }
    fine = budget.reference()
    optimum = fuzzy_q_iteration(env, fine)
    best = evaluate_policy_cost(optimum.policy, env)
    own = course.partitions["fuzzy"]()
    coarse = fuzzy_q_iteration(env, own)
    on_coarse = evaluate_policy_cost(coarse.policy, env)
    return {
        name: best.cost,
        "success_rate": best.success_rate,
        "method": "fuzzy Q-iteration",
        "cells": _cells(fine),
        "coarse": {
            "cells": _cells(own),
            "policy_cost": on_coarse.cost,
            "success_rate": on_coarse.success_rate,
        },
        "picture": record(optimum.policy, env.with_slots),
    }


def _cells(grid: Partition) -> list[int]:
    """How many centres each variable has."""
    if not isinstance(grid, Grid):
        raise TypeError(f"the partition must be a grid, got {grid!r}.")
    return [len(centres) for centres in grid.centres]


def _make_agent(
    method: str, course: Course, env: ControlVectorEnv, grid: Partition, seed: int
) -> TabularAgent:
    kind = ACL if method.startswith("acl-") else QLearning
    settings = course.settings(method)
    with warnings.catch_warnings():
        # Table 4.1 has a tau_0 above 1 / J_max; the course has it on purpose.
        warnings.simplefilter("ignore", PheromoneBoundWarning)
        return kind(env, grid, max_steps=course.max_steps, seed=seed, **settings)


def compile_kernels(
    method: str, course: Course, env: ControlVectorEnv, grid: Partition
) -> None:
    """Run every kernel once, so that no measured time holds a compilation."""
    agent = _make_agent(method, course, env.with_slots(2), grid, 0)
    agent.learn(trials=1, callback=PolicyEvaluation(env, max_steps=2))


def compile_all(course: Course, budget: Budget) -> None:
    """Compile the kernels of every table-based method and of the reference."""
    env = make_env(course.env_id, 2)
    for method in course.methods:
        if method != "dqn":
            compile_kernels(method, course, env, course.partition(method))
    if budget.reference is None:
        value_iteration(env, max_iterations=1)
    else:
        fuzzy_q_iteration(env, course.partitions["fuzzy"](), max_iterations=1)


class _Progress(Callback):
    def __init__(self, report: Report, trials: int) -> None:
        self._report = report
        self._trials = trials

    def on_trial_end(self, agent: Agent, row: Row) -> bool | None:
        self._report(row["trial"] / self._trials)
        return True


def make_env(env_id: str, slots: int) -> ControlVectorEnv:
    """An environment of the comparison with so many slots."""
    return control_env(gym.make_vec(env_id, num_envs=slots))
