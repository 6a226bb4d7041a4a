"""How fast the colony walks and learns, beside others in the same run.

Every figure is a median of several repetitions after a warm-up, on one thread. Only
the ratios mean something on another day or another machine.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass

import gymnasium as gym
import numpy as np
from rich.console import Console
from rich.table import Table
from tqdm.auto import tqdm

import acl_gym
from acl_gym.agents.acl import ACL
from acl_gym.partition import Crisp, Fuzzy

PENDULUM = "acl_gym/Pendulum-v0"
CELLS = (40, 41)
DQN_STEPS = 5_000


@dataclass(frozen=True)
class Case:
    """One measured figure.

    Attributes:
        name: what was measured.
        n_ants: slots of the environment.
        steps_per_second: slot-steps a second, median.
        slowest: steps a second in the slowest repetition.
        fastest: steps a second in the fastest repetition.
        seconds: of one repetition, median.
        reference: the name of the case that the ratio is to.
        ratio_to_reference: how many times the reference's steps a second; for the
            whole learning run, how many times it fits into DQN's training.
    """

    name: str
    n_ants: int
    steps_per_second: float
    slowest: float
    fastest: float
    seconds: float
    reference: str
    ratio_to_reference: float


Work = Callable[[], int]
"""Does some steps and says how many."""


def measure(work: Work, repetitions: int) -> list[tuple[int, float]]:
    """Steps and seconds of each repetition, after one that is not counted."""
    work()
    results = []
    for _ in range(repetitions):
        start = time.perf_counter()
        steps = work()
        results.append((steps, time.perf_counter() - start))
    return results


def step_environment(env_id: str, n_ants: int, steps: int) -> Work:
    """Step a native vector environment with random actions."""
    env = gym.make_vec(env_id, num_envs=n_ants)
    env.reset(seed=0)
    actions = np.random.default_rng(0).integers(
        0, env.single_action_space.n, (steps, n_ants)
    )

    def work() -> int:
        for row in actions:
            env.step(row)
        return steps * n_ants

    return work


def step_synchronous(n_ants: int, steps: int) -> Work:
    """Step Gymnasium's synchronous vector of our single environment."""
    env = gym.make_vec(PENDULUM, num_envs=n_ants, vectorization_mode="sync")
    env.reset(seed=0)
    actions = np.random.default_rng(0).integers(0, 3, (steps, n_ants))

    def work() -> int:
        for row in actions:
            env.step(row)
        return steps * n_ants

    return work


def learn(kind: type[Crisp] | type[Fuzzy], n_ants: int, trials: int) -> Work:
    """Make trials of a colony: selection, steps, decay and deposit."""

    def work() -> int:
        env = gym.make_vec(PENDULUM, num_envs=n_ants)
        grid = kind.from_box(env.single_observation_space, CELLS, circular=[0])
        return ACL(env, grid, seed=0).learn(trials=trials).num_timesteps

    return work


def train_dqn(steps: int) -> Work:
    """Train Stable-Baselines3's DQN with the comparison's settings."""
    import torch

    from acl_gym.agents.dqn import make_dqn

    torch.set_num_threads(1)

    def work() -> int:
        model = make_dqn(PENDULUM, seed=0)
        model.learn(total_timesteps=steps)
        return int(model.num_timesteps)

    return work


def run(quick: bool, progress: bool) -> list[Case]:
    """Measure every case.

    Args:
        quick: fewer repetitions and sizes, to see that it works.
        progress: show a bar.
    """
    repetitions = 2 if quick else 5
    sizes = (16, 250) if quick else (1, 16, 250, 2_000, 20_000)
    dqn_steps = 2_000 if quick else DQN_STEPS  # it begins to learn after 1,000
    plan: list[tuple[str, int, Work, int, str]] = []
    for n in sizes:
        steps = max(20, min(2_000, 400_000 // n))
        cart_pole = f"CartPole-v1, {n} slots"
        plan += [
            (cart_pole, n, step_environment("CartPole-v1", n, steps), repetitions, ""),
            (
                f"pendulum alone, {n} slots",
                n,
                step_environment(PENDULUM, n, steps),
                repetitions,
                cart_pole,
            ),
        ]
        plan += [
            (
                f"{kind.__name__.lower()} colony learning, {n} ants",
                n,
                learn(kind, n, trials=1 if n > 2_000 else 4),
                repetitions,
                cart_pole,
            )
            for kind in (Fuzzy, Crisp)
        ]
    plan += [
        (
            "synchronous vector of single pendulums, 16 slots",
            16,
            step_synchronous(16, 200),
            repetitions,
            "CartPole-v1, 16 slots",
        ),
        (f"DQN, {dqn_steps:,} steps", 8, train_dqn(dqn_steps), 1 if quick else 2, ""),
        (
            "fuzzy colony, whole run of 100 trials",
            250,
            learn(Fuzzy, 250, trials=100),
            repetitions,
            f"DQN, {dqn_steps:,} steps",
        ),
    ]
    measured: dict[str, tuple[float, float]] = {}  # name: median rate, seconds
    cases = []
    for name, n_ants, work, count, reference in tqdm(plan, disable=not progress):
        results = measure(work, count)
        rates = [steps / seconds for steps, seconds in results]
        rate = statistics.median(rates)
        seconds = statistics.median(seconds for _, seconds in results)
        measured[name] = rate, seconds
        ratio = 1.0
        if reference:
            whole_run = reference.startswith("DQN")
            ratio = (
                measured[reference][1] / seconds
                if whole_run
                else rate / measured[reference][0]
            )
        cases.append(
            Case(
                name,
                n_ants,
                rate,
                min(rates),
                max(rates),
                seconds,
                reference or name,
                ratio,
            )
        )
    return cases


def as_table(cases: list[Case]) -> Table:
    """The cases for the terminal."""
    table = Table(title=f"acl-gym {acl_gym.__version__}: steps a second, one thread")
    table.add_column("case")
    table.add_column("steps/s", justify="right")
    table.add_column("seconds", justify="right")
    table.add_column("ratio", justify="right")
    table.add_column("to")
    for case in cases:
        table.add_row(
            case.name,
            f"{case.steps_per_second:,.0f}",
            f"{case.seconds:.3f}",
            f"{case.ratio_to_reference:.2f}",
            "" if case.reference == case.name else case.reference,
        )
    return table


def main(arguments: list[str] | None = None) -> int:
    """Measure and print; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="print JSON, no table")
    parser.add_argument(
        "--quick", action="store_true", help="fewer repetitions and sizes"
    )
    options = parser.parse_args(arguments)
    cases = run(options.quick, progress=not options.json)
    if options.json:
        print(json.dumps({"cases": [asdict(case) for case in cases]}, indent=1))
    else:
        Console().print(as_table(cases))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
