"""The contestants of the comparison: which methods, with which settings and budget.

A run is an (agent, seed). `comparison` puts the runs together.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import VectorEnv

from acl_gym.agents.acl import ACL
from acl_gym.agents.q_iteration import fuzzy_q_iteration
from acl_gym.agents.q_learning import QLearning
from acl_gym.agents.tabular import TabularAgent
from acl_gym.callbacks import Callback, PolicyEvaluation, Row
from acl_gym.envs.control_env import ControlVectorEnv
from acl_gym.envs.pendulum import Pendulum
from acl_gym.evaluation import (
    FloatArray,
    PolicyCost,
    Predictor,
    Trajectory,
    actions_in,
    control_env,
    evaluate_policy_cost,
    record_trajectory,
)
from acl_gym.partition import Crisp, Fuzzy, Partition

Report = Callable[[float], None]
"""Told the fraction of a run that is done."""

Run = dict[str, Any]
"""The result of one run, all of it JSON; the keys are those of `finish_run`."""

ENVIRONMENT = "acl_gym/Pendulum-v0"
SLOTS = 250
CELLS = (40, 41)


@dataclass(frozen=True, kw_only=True)
class Preset:
    """How much is run.

    Attributes:
        seeds: runs of each agent, with seeds 0, 1, ...
        trials: K of the tabular agents.
        dqn_steps: environment steps of DQN.
        dqn_every: environment steps between two evaluations of DQN.
        long_run: DQN's settings for long training instead of those for short.
        optimum_cells: cells of the value iteration that gives J*.
    """

    seeds: int
    trials: int
    dqn_steps: int
    dqn_every: int
    long_run: bool = False
    optimum_cells: tuple[int, int]


PRESETS = {
    # To see that all of it works; its figures mean nothing.
    "smoke": Preset(
        seeds=1,
        trials=2,
        dqn_steps=1_200,
        dqn_every=400,
        optimum_cells=(100, 101),
    ),
    "quick": Preset(
        seeds=3,
        trials=100,
        dqn_steps=20_000,
        dqn_every=1_000,
        optimum_cells=(400, 401),
    ),
    "full": Preset(
        seeds=10,
        trials=100,
        dqn_steps=200_000,
        dqn_every=2_000,
        long_run=True,
        optimum_cells=(1600, 1601),
    ),
}


@dataclass(frozen=True)
class Contestant:
    """One method of the comparison.

    Attributes:
        label: its name in figures and tables.
        train: trains one run.
    """

    label: str
    train: Callable[[str, int, Preset, Report], Run]


def _tabular(kind: type[ACL] | type[QLearning], partition: type[Crisp] | type[Fuzzy]):  # type: ignore[no-untyped-def]
    def train(env_id: str, seed: int, preset: Preset, report: Report) -> Run:
        env = make_env(env_id, SLOTS)
        grid = make_partition(env, partition, CELLS)
        compile_kernels(kind, env, grid)
        agent = kind(env, grid, seed=seed)
        evaluation = PolicyEvaluation(env)
        agent.learn(
            trials=preset.trials,
            callback=[evaluation, _Progress(report, preset.trials)],
        )
        if evaluation.best is None:  # pragma: no cover - every trial is evaluated
            raise RuntimeError("no trial was evaluated")
        parameters = {
            **agent.parameters(),
            "slots": SLOTS,
            "partition": repr(grid),
            "trials": preset.trials,
        }
        return finish_run(
            agent, env.with_slots, agent.history, evaluation.best, parameters
        )

    return train


def _train_dqn(env_id: str, seed: int, preset: Preset, report: Report) -> Run:
    # Only here: importing torch takes seconds that the other methods do not need.
    import torch
    from stable_baselines3.common.callbacks import ConvertCallback

    from acl_gym.agents.dqn import (
        LONG_RUN,
        DQNSettings,
        PolicyCostCallback,
        make_dqn,
        scaled_env,
    )

    torch.set_num_threads(1)  # the fastest for such small networks
    settings = LONG_RUN if preset.long_run else DQNSettings()
    circular = make_env(env_id, 1).system.circular

    def scaled(slots: int | None) -> VectorEnv[Any, Any, Any]:
        return scaled_env(env_id, slots, circular=circular)

    model = make_dqn(env_id, settings, seed, circular=circular)
    evaluation = PolicyCostCallback(scaled(None), every=preset.dqn_every)

    def tell(local: dict[str, Any], _: dict[str, Any]) -> bool:
        report(min(local["self"].num_timesteps / preset.dqn_steps, 1.0))
        return True

    model.learn(
        total_timesteps=preset.dqn_steps,
        callback=[evaluation, ConvertCallback(tell)],
    )
    if evaluation.best is None:  # pragma: no cover - the last policy is evaluated
        raise RuntimeError("no policy was evaluated")
    parameters = {
        **asdict(settings),
        "net_arch": list(settings.net_arch),
        "steps": preset.dqn_steps,
    }
    return finish_run(model, scaled, evaluation.history, evaluation.best, parameters)


CONTESTANTS = {
    "acl-fuzzy": Contestant("ACL, fuzzy", _tabular(ACL, Fuzzy)),
    "acl-crisp": Contestant("ACL, crisp", _tabular(ACL, Crisp)),
    "q-fuzzy": Contestant("Q-learning, fuzzy", _tabular(QLearning, Fuzzy)),
    "q-crisp": Contestant("Q-learning, crisp", _tabular(QLearning, Crisp)),
    "dqn": Contestant("DQN", _train_dqn),
}


def run(agent: str, env_id: str, seed: int, preset: Preset, report: Report) -> Run:
    """Train one agent with one seed and say how it went.

    Args:
        agent: a key of `CONTESTANTS`.
        env_id: the environment.
        seed: the seed.
        preset: how much to do.
        report: told of progress.
    """
    contestant = CONTESTANTS[agent]
    result = contestant.train(env_id, seed, preset, report)
    return {"agent": agent, "label": contestant.label, "seed": seed, **result}


def finish_run(
    model: Predictor,
    make: Callable[[int], VectorEnv[Any, Any, Any]],
    history: list[Row],
    best: PolicyCost,
    parameters: dict[str, Any],
) -> Run:
    """Bring what a run has left behind into JSON types.

    Args:
        model: the agent after training.
        make: makes the environment that `model` sees, with so many slots.
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
        **picture(model, make),
    }


def picture(
    model: Predictor, make: Callable[[int], VectorEnv[Any, Any, Any]]
) -> dict[str, Any]:
    """The policy as a map over the state space, and the trajectory from rest."""
    theta, omega = map_axes(control_env(make(1)))
    grid = np.stack(np.meshgrid(theta, omega), axis=-1)
    states = grid.reshape(-1, 2)
    actions = actions_in(model, make(len(states)), states)
    trajectory = record_trajectory(model, make(1), np.zeros(2))
    return {
        "policy_map": actions.reshape(grid.shape[:2]).tolist(),
        "trajectory": _as_json(trajectory, _pendulum(control_env(make(1)))),
    }


def map_axes(env: ControlVectorEnv) -> tuple[FloatArray, FloatArray]:
    """Angles and velocities of the policy maps, four times finer than the cells."""
    n_theta, n_omega = 4 * CELLS[0], 4 * (CELLS[1] - 1) + 1
    low, high = env.single_observation_space.low, env.single_observation_space.high  # type: ignore[attr-defined]
    return (
        np.linspace(low[0], high[0], n_theta, endpoint=False),
        np.linspace(low[1], high[1], n_omega),
    )


def find_reference(env_id: str, preset: Preset) -> dict[str, Any]:
    """The optimum J*, by value iteration on a fine grid, and on the agents' own.

    Args:
        env_id: the environment.
        preset: says how fine.
    """
    env = make_env(env_id, 1)
    fine = make_partition(env, Fuzzy, preset.optimum_cells)
    optimum = fuzzy_q_iteration(env, fine)
    best = evaluate_policy_cost(optimum.policy, env)
    coarse = fuzzy_q_iteration(env, make_partition(env, Fuzzy, CELLS))
    on_coarse = evaluate_policy_cost(coarse.policy, env)
    return {
        "optimal_cost": best.cost,
        "success_rate": best.success_rate,
        "cells": list(preset.optimum_cells),
        "coarse": {
            "cells": list(CELLS),
            "policy_cost": on_coarse.cost,
            "success_rate": on_coarse.success_rate,
        },
        **picture(optimum.policy, env.with_slots),
    }


def make_partition(
    env: ControlVectorEnv, kind: type[Crisp] | type[Fuzzy], cells: tuple[int, int]
) -> Partition:
    """Centres (5.2)-(5.3) over the observations of `env`."""
    space = env.single_observation_space
    if not isinstance(space, gym.spaces.Box):
        raise TypeError(f"env must have a Box of observations, got {space}.")
    return kind.from_box(space, cells, circular=env.system.circular)


def compile_kernels(
    kind: type[ACL] | type[QLearning], env: ControlVectorEnv, partition: Partition
) -> None:
    """Run every kernel once, so that no measured time holds a compilation."""
    agent = kind(env.with_slots(2), partition, max_steps=2, seed=0)
    agent.learn(trials=1, callback=PolicyEvaluation(env))


def compile_all(env_id: str) -> None:
    """Compile the kernels of every tabular contestant and of the reference."""
    env = make_env(env_id, 2)
    for partition in (Fuzzy, Crisp):
        grid = make_partition(env, partition, (3, 3))
        for kind in (ACL, QLearning):
            compile_kernels(kind, env, grid)
        fuzzy_q_iteration(env, grid, max_iterations=1)


class _Progress(Callback):
    def __init__(self, report: Report, trials: int) -> None:
        self._report = report
        self._trials = trials

    def on_trial_end(self, agent: TabularAgent, row: Row) -> bool | None:
        self._report(row["trial"] / self._trials)
        return True


def make_env(env_id: str, slots: int) -> ControlVectorEnv:
    """An environment of the comparison with so many slots."""
    return control_env(gym.make_vec(env_id, num_envs=slots))


def torques(env: ControlVectorEnv) -> tuple[float, ...]:
    """The torque of each action, N m."""
    return _pendulum(env).torques


def _pendulum(env: ControlVectorEnv) -> Pendulum:
    if not isinstance(env.system, Pendulum):
        raise TypeError(f"the comparison is drawn for the pendulum, got {env}.")
    return env.system


def _as_json(trajectory: Trajectory, system: Pendulum) -> dict[str, Any]:
    theta = np.unwrap(trajectory.states[:, 0], period=2 * math.pi)
    return {
        "time": (system.sampling_time * np.arange(len(theta))).tolist(),
        "theta": theta.tolist(),
        "omega": trajectory.states[:, 1].tolist(),
        "torque": np.array(system.torques)[trajectory.actions].tolist(),
        "cost": np.concatenate([[0.0], np.cumsum(trajectory.costs)]).tolist(),
        "reached": trajectory.success,
    }
