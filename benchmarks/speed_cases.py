"""The cases of throughput.py: each does some work and returns its number of steps."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
from numpy_colony import NumpyColony
from walks import Remembered, Trial

from acl_gym.agents.acl import ACL
from acl_gym.agents.returning import ReturningACL
from acl_gym.partitions import Crisp, Fuzzy, Partition
from acl_gym.partitions.automatic import thesis_partition

Work = Callable[[], int]
"""Makes some steps and returns their number, all slots counted."""

PENDULUM = "acl_gym/Pendulum-v0"
SYSTEMS = {
    "pendulum": PENDULUM,
    "navigation": "acl_gym/Navigation-v0",
    "grid-1d": "acl_gym/GridSearch1D-v0",
    "grid-2d": "acl_gym/GridSearch2D-v0",
}
TAU0 = {"pendulum": 1e-4}  # Table 5.2; 0.001 elsewhere, Table 4.1
TRIALS_OF_A_RUN = 100
BACK = 10
"""How often the same paths are walked back."""
WALKERS = 250, 2_500
"""Ants that walk about 10,000 and 100,000 steps in 60 steps of time."""


@dataclass(frozen=True)
class Plan:
    """A case before it is measured.

    Attributes:
        name: what is measured.
        system: one of `SYSTEMS`, or "peers".
        n_ants: slots of the environment.
        make: builds the work; building is not measured.
        reference: the case to which the ratio is taken, by name; "" for none.
        by_seconds: take the ratio of the seconds of one repetition, not of steps.
    """

    name: str
    system: str
    n_ants: int
    make: Callable[[], Work]
    reference: str = ""
    by_seconds: bool = False


def make_env(system: str, n_ants: int) -> gym.vector.VectorEnv[Any, Any, Any]:
    """The native vector environment of a system."""
    return gym.make_vec(SYSTEMS[system], num_envs=n_ants)


def partition_of(system: str, kind: str, env: Any) -> Partition:
    """The thesis's cells: 40 x 41 of §5.3, 729 of §4.5.2, a cell a state."""
    cell_kind = Crisp if kind == "crisp" else Fuzzy
    return thesis_partition(env, kind=cell_kind)


def kinds_of(system: str) -> tuple[str, ...]:
    """The kinds of cells that apply to a system."""
    return ("discrete",) if system.startswith("grid") else ("fuzzy", "crisp")


def steps_for(n_ants: int) -> int:
    """Vector steps that take about a tenth of a second."""
    return max(5, min(2_000, 1_000_000 // n_ants))


def step_alone(env: gym.vector.VectorEnv[Any, Any, Any], steps: int) -> Work:
    """Step a vector environment with actions that were drawn in advance."""
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    n_actions = int(env.single_action_space.n)  # type: ignore[attr-defined]
    actions = rng.integers(0, n_actions, (steps, env.num_envs))

    def work() -> int:
        for row in actions:
            env.step(row)
        return actions.size

    return work


def step_selecting(system: str, kind: str, n_ants: int) -> Work:
    """Step with actions that a colony selects, without learning."""
    env, steps = make_env(system, n_ants), steps_for(n_ants)
    agent = ACL(env, partition_of(system, kind, env), seed=0)
    observation, _ = env.reset(seed=0)

    def work() -> int:
        nonlocal observation
        for _ in range(steps):
            actions, _ = agent.predict(observation, deterministic=False)
            observation = env.step(actions)[0]
        return steps * n_ants

    return work


def learn(system: str, kind: str, n_ants: int, trials: int) -> Work:
    """Make trials of a new colony: all of Algorithm 4.2, including the deposit."""
    env = make_env(system, n_ants)
    partition = partition_of(system, kind, env)

    def work() -> int:
        with warnings.catch_warnings():
            warnings.simplefilter(
                "ignore"
            )  # tau0 is that of the thesis, even above the bound
            tau0 = TAU0.get(system, 1e-3)
            agent = ACL(env, partition, tau0=tau0, seed=0, max_steps=300)
        return agent.learn(trials=trials).num_timesteps

    return work


def learn_returning(n_ants: int) -> Work:
    """Let a new returning colony learn the pendulum: it walks back 30 times as often."""
    env = make_env("pendulum", n_ants)

    def work() -> int:
        agent = ReturningACL(env, seed=0)
        return agent.learn(total_timesteps=max(10_000, 60 * n_ants)).num_timesteps

    return work


def deposit(ants: int) -> Work:
    """Deposit the solutions of one trial, on about as many cells as are walked back."""
    trial = Trial(64, ants=ants, steps=40)

    def work() -> int:
        for _ in range(BACK):
            trial.deposit()
        return BACK * trial.n_steps

    return work


def walk_back(ants: int) -> Work:
    """Walk remembered paths back, and merge what was laid."""
    remembered = Remembered(ants)

    def work() -> int:
        for _ in range(BACK):
            remembered.walk_back()
        return BACK * remembered.n_steps

    return work


def learn_in_numpy(n_ants: int, trials: int) -> Work:
    """The same trials of the fuzzy pendulum in vectorised NumPy."""

    def work() -> int:
        colony = NumpyColony(n_ants)
        for _ in range(trials):
            colony.trial()
        return colony.steps

    return work


def train_dqn(steps: int) -> Work:
    """Train Stable-Baselines3's DQN with the comparison's settings, on one thread."""
    import torch

    from acl_gym.sb3.dqn import make_dqn

    torch.set_num_threads(1)

    def work() -> int:
        model = make_dqn(PENDULUM, seed=0)
        model.learn(total_timesteps=steps)
        return int(model.num_timesteps)

    return work


def cart_pole(n: int) -> str:
    """The name of the case with which environments are compared."""
    return f"CartPole-v1 of Gymnasium, {n:,} slots"


def alone(system: str, n: int) -> str:
    """The name of the case of an environment alone."""
    return f"{system} alone, {n:,} slots"


def loop(system: str, kind: str, n: int) -> str:
    """The name of the case of a complete learning loop."""
    return f"{kind} {system} learning, {n:,} ants"


def in_numpy(n: int) -> str:
    """The name of the case of the NumPy colony."""
    return f"fuzzy pendulum learning in NumPy, {n:,} ants"


def returning(n: int) -> str:
    """The name of the case of a returning colony that learns."""
    return f"returning ants learning the pendulum, {n:,} ants"


def walking_back(n: int) -> str:
    """The name of the case of ants that walk back."""
    return f"walking back, 64 x 65 cells, {n:,} ants"


def depositing(n: int) -> str:
    """The name of the case with which walking back is compared."""
    return f"deposit, 64 x 64 cells, {n:,} ants"


COMPLETE_RUN = f"fuzzy pendulum, complete run of {TRIALS_OF_A_RUN} trials, 250 ants"


def trials_for(n_ants: int) -> int:
    """Trials of a learning case; the first trials are the longest."""
    return 1 if n_ants > 2_000 else 4


def plan(systems: list[str], sizes: list[int], dqn_steps: int) -> Iterator[Plan]:
    """Every case, each reference before the cases compared with it."""
    alone_sizes = sorted({*sizes, 2_048})
    for n in alone_sizes:
        yield Plan(
            cart_pole(n),
            "peers",
            n,
            lambda n=n: step_alone(
                gym.make_vec("CartPole-v1", n, vectorization_mode="vector_entry_point"),
                steps_for(n),
            ),
        )
    for system in systems:
        for n in alone_sizes if system == "pendulum" else sizes:
            yield Plan(
                alone(system, n),
                system,
                n,
                lambda s=system, n=n: step_alone(make_env(s, n), steps_for(n)),
                cart_pole(n),
            )
        for kind in kinds_of(system):
            for n in sizes:
                yield Plan(
                    f"{kind} {system} selecting, {n:,} ants",
                    system,
                    n,
                    lambda s=system, k=kind, n=n: step_selecting(s, k, n),
                    alone(system, n),
                )
                yield Plan(
                    loop(system, kind, n),
                    system,
                    n,
                    lambda s=system, k=kind, n=n: learn(s, k, n, trials_for(n)),
                    alone(system, n),
                )
    if "pendulum" not in systems:
        return
    for n in (n for n in sizes if n <= 2_000):  # its memory grows by one table per ant
        yield Plan(
            in_numpy(n),
            "pendulum",
            n,
            lambda n=n: learn_in_numpy(n, trials_for(n)),
            loop("pendulum", "fuzzy", n),
        )
    for n in (n for n in sizes if n <= 2_000):
        yield Plan(
            returning(n),
            "pendulum",
            n,
            lambda n=n: learn_returning(n),
            loop("pendulum", "fuzzy", n),
        )
    for n in WALKERS:
        yield Plan(depositing(n), "pendulum", n, lambda n=n: deposit(n))
        yield Plan(
            walking_back(n),
            "pendulum",
            n,
            lambda n=n: walk_back(n),
            depositing(n),
        )
    yield Plan(
        "synchronous vector of single pendulums, 16 slots",
        "pendulum",
        16,
        lambda: step_alone(
            gym.make_vec(PENDULUM, 16, vectorization_mode="sync"), steps=200
        ),
        alone("pendulum", 16) if 16 in sizes else "",
    )
    from acl_gym.sb3.dqn import DQNSettings

    dqn, dqn_slots = (
        f"DQN of Stable-Baselines3, {dqn_steps:,} steps",
        DQNSettings().num_envs,
    )
    yield Plan(dqn, "peers", dqn_slots, lambda: train_dqn(dqn_steps))
    yield Plan(
        COMPLETE_RUN,
        "pendulum",
        250,
        lambda: learn("pendulum", "fuzzy", 250, TRIALS_OF_A_RUN),
        dqn,
        by_seconds=True,
    )
