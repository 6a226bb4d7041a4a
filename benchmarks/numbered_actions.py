"""Does it help a model to be told what numbered actions set?

An environment numbers its actions. A model of recorded steps is then told of an action by
a flag, one for each, and learns of each action by itself. Where `inputs=` says what the
actions set, it is told of a number, and learns from one action what another does.

Random actions, each held for three steps, are recorded; the error is that of the next
state in 600 other random steps, relative to how much a variable changes in a step, in the
mean over the variables: 0 is perfect, 1 is no better than to predict no change.

    python benchmarks/numbered_actions.py
    python benchmarks/numbered_actions.py --steps 20 --seeds 3 --json
"""

from __future__ import annotations

import argparse
import json
import warnings
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np

from acl_gym import Transitions
from acl_gym.envs.learned import DataWarning, LearnedDynamics
from acl_gym.envs.learned.features import differences, periods_of

TESTED = 600


class Numbered(gym.ActionWrapper[Any, Any, Any]):
    """Gymnasium's pendulum with numbered torques, of which it does not tell."""

    def __init__(self, count: int) -> None:
        super().__init__(gym.make("Pendulum-v1", max_episode_steps=40))
        self.torques = np.linspace(-2.0, 2.0, count, dtype=np.float32)
        self.action_space = gym.spaces.Discrete(count)

    def action(self, action: Any) -> Any:
        return self.torques[[action]]


def plants() -> dict[str, tuple[Callable[[], Any], list[float]]]:
    """What is recorded, and what its actions set."""
    found: dict[str, tuple[Callable[[], Any], list[float]]] = {
        "MountainCar-v0": (lambda: gym.make("MountainCar-v0"), [-1.0, 0.0, 1.0])
    }
    for count in (3, 9):
        torques = np.linspace(-2.0, 2.0, count).tolist()
        found[f"Pendulum-v1, {count} torques"] = (
            lambda count=count: Numbered(count),  # type: ignore[misc]
            torques,
        )
    return found


def error(make: Callable[[], Any], steps: int, inputs: Any, seed: int) -> float:
    """Of a model of some recorded steps, in others."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        data = Transitions.record(make(), steps, hold=3, inputs=inputs, seed=seed)
        dynamics = LearnedDynamics(data)
    tested = Transitions.record(make(), TESTED, inputs=inputs, seed=seed + 10_000)
    angles = tested.description.shown_angles
    before, after = (
        angles.variables(each) for each in (tested.states, tested.next_states)
    )
    period = periods_of(tested.description)
    predicted = dynamics.next_variables(
        np.ascontiguousarray(before.T), np.ascontiguousarray(tested.inputs.T)
    )
    missed = differences(after, predicted.T, period)
    changed = differences(before, after, period)
    of_each = np.sqrt(np.mean(missed**2, axis=0)) / changed.std(axis=0)
    return float(of_each.mean())


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--steps", type=int, nargs="+", default=[20, 40, 150])
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--json", action="store_true", help="print JSON")
    options = parser.parse_args()
    rows = []
    for name, (make, inputs) in plants().items():
        for steps in options.steps:
            flags, values = (
                [error(make, steps, told, seed) for seed in range(options.seeds)]
                for told in (None, inputs)
            )
            rows.append(
                {
                    "plant": name,
                    "steps": steps,
                    "flags": float(np.median(flags)),
                    "values": float(np.median(values)),
                    "values_are_better": sum(
                        value < flag for flag, value in zip(flags, values, strict=True)
                    ),
                    "seeds": options.seeds,
                }
            )
    if options.json:
        print(json.dumps({"rows": rows}, indent=1))
        return
    print("plant                    steps  flags   values  values are better")
    for row in rows:
        print(
            f"{row['plant']:24} {row['steps']:5}  {row['flags']:.4f}  "
            f"{row['values']:.4f}  {row['values_are_better']} of {row['seeds']}"
        )


if __name__ == "__main__":
    main()
