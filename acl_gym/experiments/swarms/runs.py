"""How runs of swarms are made: aggregation and foraging, particle swarms, ants."""

from __future__ import annotations

import math
import time
from typing import Any

import gymnasium as gym
import numpy as np
import pandas as pd
from scipy.sparse.csgraph import connected_components
from scipy.spatial.distance import cdist

from acl_gym.agents.acl import ACL
from acl_gym.agents.moving_ants import Ants, StigmergyEnvironment
from acl_gym.experiments.results import Run
from acl_gym.experiments.swarms.study import SwarmStudy, make_channel
from acl_gym.partitions import Fuzzy
from acl_gym.swarm import run
from acl_gym.swarm.aggregation import (
    AggregatingAgents,
    Field,
    Gaussians,
    Plane,
    Profile,
    Quadratic,
    centre,
    rms_distance,
    size,
)
from acl_gym.swarm.pso import minimize
from acl_gym.swarm.pso.benchmark_functions import BENCHMARK_FUNCTIONS
from acl_gym.utils import validation
from acl_gym.utils.steps import hold_last_value
from acl_gym.utils.typing import FloatArray, Row

PART = 1.0
"""Agents that are less than this apart belong to the same part of a swarm; two agents rest
at a distance of 0.774."""

FOOD = np.array([3.0, 3.0])
"""Where the minimum of a profile is; a swarm starts around (0, 0)."""

SLOPE = np.array([1.0, 1.0])
"""The gradient of the plane: a swarm drifts to the lower left."""

PROFILES: dict[str, Profile] = {
    "plane": Plane(SLOPE),
    "quadratic": Quadratic(FOOD),
    "Gaussian": Gaussians(FOOD[None], depths=20.0, widths=3.0),
}


class NoisyField(Field):
    """A field in which agents observe the slope with an error.

    Args:
        agents: how many.
        noise: the standard deviation of the error of each coordinate of the slope, >= 0,
            drawn anew for each agent in each step.
        options: see `Field`.
    """

    def __init__(self, agents: int, noise: float, **options: Any) -> None:
        super().__init__(agents, **options)
        self.noise = validation.number("noise", noise, at_least=0)

    def reset(self, rng: np.random.Generator) -> None:
        """See `Field.reset`."""
        super().reset(rng)
        self._draw(rng)

    def step(self, u: Any, rng: np.random.Generator) -> None:
        """See `Field.step`; draws the errors of the next observation."""
        super().step(u, rng)
        self._draw(rng)

    def observe(self) -> dict[str, FloatArray]:
        """See `Field.observe`."""
        seen = super().observe()
        seen["slope"] = seen["slope"] + self._error
        return seen

    def _draw(self, rng: np.random.Generator) -> None:
        self._error = self.noise * rng.standard_normal(self.positions.shape)


def count_parts(positions: FloatArray, reach: float = PART) -> int:
    """How many parts a swarm has: groups of agents linked by distances below `reach`."""
    return int(connected_components(cdist(positions, positions) < reach)[0])


def run_aggregation(study: SwarmStudy, seed: int) -> Run:
    """Let agents aggregate, or forage.

    The settings are `agents`, how many; `time_step`, s; for foraging a `profile`, a key of
    `PROFILES`, and the `noise` with which slopes are observed, see `NoisyField`.

    Starts are the first numbers drawn, so that a seed has the same one in every channel.

    Returns:
        A row for each of `study.curve_points()`, see `_measured`; as the table the last
        positions.
    """
    settings = study.settings
    agents, time_step = settings["agents"], settings["time_step"]
    name = settings.get("profile")
    field = NoisyField(
        *(agents, settings.get("noise", 0.0)),
        time_step=time_step,
        profile=None if name is None else PROFILES[name],
    )
    channel = make_channel(agents, **study.channel)
    began = time.perf_counter()
    history = run(
        *(AggregatingAgents(), field, study.steps, seed, channel),
        stale=study.stale,
        record=("positions",),
    )
    seconds = time.perf_counter() - began
    x = history["positions"]
    rows = [
        {"env_steps": float(k), "seconds": seconds * k / study.steps}
        | _measured(x, k, time_step)
        | ({} if name is None else _foraged(name, x[k], x[0], k * time_step))
        for k in study.curve_points() or ()
    ]
    return Run(pd.DataFrame(rows), x[-1].ravel(), seconds, "", seed)


def _measured(x: FloatArray, k: int, time_step: float) -> Row:
    """What a swarm is like after k steps.

    Returns:
        How far the centre has drifted (`drift`) and how fast it moves (`centre_speed`);
        the largest (`size`) and the rms distance from it; and the number of `parts`.
    """
    moved = centre(x[max(k, 1)]) - centre(x[max(k, 1) - 1])
    return {
        "drift": float(np.linalg.norm(centre(x[k]) - centre(x[0]))),
        "centre_speed": float(np.linalg.norm(moved)) / time_step,
        "size": size(x[k]),
        "rms": rms_distance(x[k]),
        "parts": float(count_parts(x[k])),
    }


def _foraged(profile: str, now: FloatArray, start: FloatArray, seconds: float) -> Row:
    """How far agents, and their centre, are from where the profile leads them.

    That is the minimum, or, on the plane, where the centre would be without noise.
    """
    goal = centre(start) - SLOPE * seconds if profile == "plane" else FOOD
    away = np.square(now - goal).sum(axis=1)
    return {
        "miss": float(np.sqrt(away.mean())),
        "centre_miss": float(np.linalg.norm(centre(now) - goal)),
    }


def run_pso(study: SwarmStudy, seed: int) -> Run:
    """Minimize a benchmark function in `study.steps` evaluations.

    The settings are `function`, a key of `BENCHMARK_FUNCTIONS`; `variables`, how many; and
    keyword arguments of `minimize`.

    Returns:
        A row for each of `study.curve_points()` with the least value so far; as the table
        the best point.
    """
    settings = dict(study.settings)
    benchmark = BENCHMARK_FUNCTIONS[settings.pop("function")]
    n_particles = settings.setdefault("n_particles", 40)
    began = time.perf_counter()
    with np.errstate(over="ignore", invalid="ignore"):  # where a swarm explodes
        found = minimize(
            benchmark.function,
            benchmark.bounds(settings.pop("variables")),
            **settings,
            max_evaluations=study.steps,
            seed=seed,
            topology=make_channel(n_particles, **study.channel),
            history=True,
        )
    seconds = time.perf_counter() - began
    at = np.array(study.curve_points())
    rows = {
        "env_steps": at,
        "seconds": seconds * at / study.steps,
        "value": hold_last_value(found.history["nfev"], found.history["fun"], at),
    }
    failure = "" if math.isfinite(found.history["spread"][-1]) else found.message
    frame = pd.DataFrame(rows, dtype=np.float64)
    return Run(frame, np.array(found.x), seconds, failure, seed)


def run_ants(study: SwarmStudy, seed: int) -> Run:
    """Learn once by `ACL.learn` and once by `swarm.run`, and compare what was learned.

    The settings are `env`, "grid" or "pendulum"; `ants`, how many; and keyword arguments
    of `ACL`.

    Returns:
        One row: how many `entries` the pheromone has; how many of them have changed
        (`learned`), and how many are `differing` between both; and whether both have
        drawn the same random numbers (`same_draws`). As the table both pheromones, first
        that of `ACL.learn`.
    """
    settings = dict(study.settings)
    name, ants = settings.pop("env"), settings.pop("ants")
    learned, source = (_colony(name, ants, seed, settings) for _ in range(2))
    learned.learn(trials=study.steps)
    began = time.perf_counter()
    swarm = StigmergyEnvironment(source, study.steps)
    channel = make_channel(ants, **study.channel)
    most = study.steps * (source.max_steps + 1 + study.channel.get("delay", 0))
    run(Ants(source), swarm, most, source.rng, channel, stale=study.stale)
    seconds = time.perf_counter() - began
    levels, table = swarm.pheromone.levels, np.array(learned.table)
    row = {
        "env_steps": float(study.steps),
        "seconds": seconds,
        "entries": float(table.size),
        "learned": float((table != learned.tau0).sum()),
        "differing": float((levels != table).sum()),
        "same_draws": float(
            source.rng.bit_generator.state == learned.rng.bit_generator.state
        ),
    }
    both = np.concatenate([table.ravel(), levels.ravel()])
    return Run(pd.DataFrame([row]), both, seconds, "", seed)


ANT_ENVIRONMENTS = {
    "grid": "acl_gym/GridSearch2D-v0",
    "pendulum": "acl_gym/Pendulum-v0",
}
"""Where ants walk, by the names that studies have for it."""


def _colony(name: str, ants: int, seed: int, settings: dict[str, Any]) -> ACL:
    env = gym.make_vec(ANT_ENVIRONMENTS[name], num_envs=ants)
    partition = None
    if name == "pendulum":
        box: Any = env.single_observation_space
        partition = Fuzzy.from_box(box, (8, 9), circular=[0])
    return ACL(env, partition, seed=seed, **settings)
