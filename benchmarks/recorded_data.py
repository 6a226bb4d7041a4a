"""Swing the pendulum up from recorded data only, and ask the model where that will fail.

Random torques, held for three steps, are recorded in one of these ways; then a returning
colony learns in a model of the recording, without another touch of the pendulum:

- anywhere: runs of ten steps from anywhere in the state space;
- rest: runs of forty steps, each from hanging at rest;
- lower: those steps of `anywhere` that begin in the lower half of the circle, so that
  nothing was seen of the pendulum upright.

Before the policy is tried on the pendulum, the model says from each of the 100 evaluation
states how uncertain it is along the way that it predicts: the largest spread of a step.
The program then tries the policy and compares: the cost that the model promised, what it
was, from how many states the goal was reached, and the spread where it was and was not.

With few steps, `--remedies` compares what can be done about a model that is not sure:
nothing, pessimism, or an end of the episode where the spread is too large. All remedies
learn from the same recordings, in the same model.

    python benchmarks/recorded_data.py --seeds 5
    python benchmarks/recorded_data.py --kinds anywhere --transitions 300 --json
    python benchmarks/recorded_data.py --kinds anywhere lower --transitions 12 20 \\
        --model-steps 12000 --remedies none pessimism=10 most_spread=0.3
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
import time
import warnings
from typing import Any

import gymnasium as gym
import numpy as np

from acl_gym import LearnedVectorEnv, ReturningACL, Transitions, evaluate_policy_cost
from acl_gym.callbacks import PolicyEvaluation
from acl_gym.envs.learned import DataWarning

KINDS = ("anywhere", "rest", "lower")
EVALUATED = gym.make_vec("acl_gym/Pendulum-v0", num_envs=1)


class AtRest(gym.Wrapper[Any, Any, Any, Any]):
    """A pendulum that always begins hanging at rest."""

    def reset(self, *, seed: Any = None, options: Any = None) -> Any:
        return self.env.reset(seed=seed, options={"state": np.zeros(2)})


def recorded(kind: str, steps: int, seed: int) -> Transitions:
    if kind == "rest":
        env = AtRest(gym.make("acl_gym/Pendulum-v0", max_episode_steps=40))
        return Transitions.record(env, steps, hold=3, seed=seed)
    env = gym.make("acl_gym/Pendulum-v0", max_episode_steps=10)
    if kind == "anywhere":
        return Transitions.record(env, steps, hold=3, seed=seed)
    data = Transitions.record(env, 3 * steps, hold=3, seed=seed)
    lower = np.cos(data.states[:, 0]) > 0.0
    lower[np.flatnonzero(lower)[steps:]] = False
    return data[lower]


def spread_on_the_way(policy: Any, model: LearnedVectorEnv, states: Any) -> Any:
    """The largest spread of a step of each way that the model predicts, `(n,)`."""
    env = model.with_slots(len(states))
    seen, _ = env.reset(options={"state": states, "finished": "wait"})
    largest, walking = np.zeros(len(states)), np.ones(len(states), np.bool_)
    while walking.any():
        actions, _ = policy.predict(seen)
        spread = env.spread(env.states, actions)
        largest = np.where(walking, np.maximum(largest, spread), largest)
        seen, _, ended, cut, _ = env.step(actions)
        walking &= ~(ended | cut)
    return largest


def remedy(text: str) -> dict[str, float]:
    """Arguments of `LearnedVectorEnv`, of "none" or "name=value"."""
    name, _, value = text.partition("=")
    return {} if text == "none" else {name: float(value)}


def trial(
    model: LearnedVectorEnv, kind: str, how: str, seed: int, model_steps: int
) -> dict[str, Any]:
    """Let a colony learn in a model, and try its policy on the pendulum."""
    system = EVALUATED.unwrapped.system  # type: ignore[attr-defined]
    began = time.perf_counter()
    best = PolicyEvaluation(model, every=5)
    ReturningACL(model, walks_back=10, seed=seed).learn(
        total_timesteps=model_steps, callback=best
    )
    seconds = time.perf_counter() - began
    states = system.evaluation_states()
    spread = spread_on_the_way(best.best_policy, model, states)
    promised = evaluate_policy_cost(best.best_policy, model, states)  # type: ignore[arg-type]
    found = evaluate_policy_cost(best.best_policy, EVALUATED)  # type: ignore[arg-type]
    # A state counts as well where the goal was reached for about what was promised.
    well = found.success & (found.costs < 1.25 * np.maximum(promised.costs, 10.0))
    return {
        "kind": kind,
        "remedy": how,
        "seed": seed,
        "interactions": len(model.transitions),
        "seconds": seconds,
        "model_cost": promised.cost,
        "policy_cost": found.cost,
        "success_rate": found.success_rate,
        "as_promised": float(well.mean()),
        "spread_where_as_promised": _median(spread[well]),
        "spread_elsewhere": _median(spread[~well]),
        "chance_that_worse_has_more_spread": _auc(spread, ~well),
    }


def _median(values: Any) -> float | None:
    return float(np.median(values)) if values.size else None


def _auc(spread: Any, worse: Any) -> float | None:
    """How often a state that went worse had more spread than one that went well."""
    if not worse.any() or worse.all():
        return None
    bad, good = spread[worse][:, None], spread[~worse]
    return float(np.mean((bad > good) + 0.5 * (bad == good)))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument(
        "--transitions", type=int, nargs="+", default=[300], help="recorded steps"
    )
    parser.add_argument("--seeds", type=int, default=5, help="runs of each kind")
    parser.add_argument(
        "--remedies",
        nargs="+",
        default=["none"],
        metavar="none|NAME=VALUE",
        help="arguments of LearnedVectorEnv: pessimism=10, most_spread=0.3",
    )
    parser.add_argument(
        "--model-steps", type=int, default=60_000, help="of all ants in a model"
    )
    parser.add_argument("--json", action="store_true", help="print JSON")
    options = parser.parse_args()
    warnings.simplefilter(
        "ignore", DataWarning
    )  # that there are few steps is the point
    rows = []
    task = EVALUATED.unwrapped.system.task  # type: ignore[attr-defined]
    for kind, steps in itertools.product(options.kinds, options.transitions):
        for seed in range(options.seeds):
            data, dynamics = recorded(kind, steps, seed), None
            for how in options.remedies:
                model = LearnedVectorEnv(
                    data,
                    50,
                    initial="anywhere",
                    dynamics=dynamics,
                    **remedy(how),
                    **task,
                )
                dynamics = model.dynamics
                rows.append(trial(model, kind, how, seed, options.model_steps))
                row = rows[-1]
                print(
                    f"{kind} {steps} {how} {seed}: promised {row['model_cost']:.1f}, "
                    f"found {row['policy_cost']:.1f}, success "
                    f"{row['success_rate']:.0%}",
                    file=sys.stderr,
                )
    if options.json:
        print(json.dumps({"rows": rows}, indent=1))
        return
    print(
        "kind      steps remedy           promised  found  success  all reach it  "
        "as promised  spread there, elsewhere"
    )
    groups = itertools.product(options.kinds, options.transitions, options.remedies)
    for kind, steps, how in groups:
        own = [
            row
            for row in rows
            if (row["kind"], row["interactions"], row["remedy"]) == (kind, steps, how)
        ]
        all_reach = sum(row["success_rate"] == 1.0 for row in own)

        def middle(name: str, own: list[dict[str, Any]] = own) -> float:
            values = [row[name] for row in own if row[name] is not None]
            return float(np.median(values)) if values else float("nan")

        print(
            f"{kind:8} {steps:6} {how:15} {middle('model_cost'):10.1f} "
            f"{middle('policy_cost'):6.1f} {middle('success_rate'):8.0%} "
            f"{all_reach:7} of {len(own):2} {middle('as_promised'):12.0%}  "
            f"{middle('spread_where_as_promised'):.3f}, "
            f"{middle('spread_elsewhere'):.3f}"
        )


if __name__ == "__main__":
    main()
