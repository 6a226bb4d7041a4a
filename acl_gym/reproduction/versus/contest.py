"""One run of a method in an arena: what it costs to learn, and what is learned."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv
from gymnasium.wrappers.vector import TransformReward
from numpy.typing import NDArray

from acl_gym.agents.acl import ACL, PheromoneBoundWarning
from acl_gym.agents.base import TabularAgent
from acl_gym.agents.q_learning import QLearning
from acl_gym.callbacks import Agent, Callback
from acl_gym.envs.wrappers.perturbations import ReversedLuck, ReversedSlots
from acl_gym.evaluation import evaluate_policy_cost
from acl_gym.reproduction.settings import Learner, Named, Result
from acl_gym.reproduction.versus.arena import Arena
from acl_gym.reproduction.versus.spaces import METHODS
from acl_gym.reproduction.versus.wholes import WHOLES
from acl_gym.utils.typing import Row

Report = Callable[[float], None]

COLUMNS = ("env_steps", "seconds", "policy_cost", "success_rate")
"""What is kept of each evaluation; seconds are those of learning, without it."""

POINTS = 120
"""Points of the curves that a report draws."""


@dataclass(frozen=True)
class Contest(Named):
    """A method with its settings in an arena, all but the seed.

    Attributes:
        arena: where it learns, and for how long.
        method: a key of `spaces.METHODS`.
        settings: slots, max_steps (T), kind (of partition) and keyword arguments of
            the agent; of DQN, what differs from the defaults of `DQNSettings`. "reward"
            is what Q-learning learns from: "stage", the costs that the environment
            charges, or "steps", 1 for each.
        backwards: whether the slots are in reverse order, with the same luck for each.
        most_runs: how many runs are made at most; not part of what results depend on.
    """

    arena: Arena
    method: str
    settings: dict[str, Any]
    backwards: bool = False
    most_runs: int | None = None

    @property
    def system(self) -> str:
        """For file names."""
        return f"versus-{self.method}"

    @property
    def text(self) -> str:
        """All of it in one line."""
        arena = self.arena
        steps = arena.dqn_steps if self.method == "dqn" else arena.steps
        parts = [METHODS[self.method], f"{steps:,} interactions"]
        if arena.cells is not None:
            parts.append(" x ".join(map(str, arena.cells)))
        values = {**self.settings, **arena.env, **arena.veil}
        if arena.judged_by is not None:
            values["cost"] = arena.judged_by
        parts += [f"{name} = {_short(value)}" for name, value in values.items()]
        return ", ".join(parts + ["slots in reverse order"] * self.backwards)

    @property
    def kernels(self) -> tuple[Any, ...]:
        """What is compiled for it: contests with the same need the same kernels."""
        arena, settings = self.arena, self.settings
        traced = settings.get("trace_decay", 0) > 0
        return arena.env_id, self.method, settings.get("kind"), traced, len(arena.env)

    def brief(self) -> Contest:
        """The same in a moment, to compile its kernels or to try it out."""
        arena = replace(self.arena, steps=200, dqn_steps=64, dqn_every=32)
        settings = self.settings
        if self.method == "dqn":
            settings = {**settings, "learning_starts": 16}
        else:
            settings = {**settings, "slots": 4, "max_steps": 10}
        return replace(self, arena=arena, settings=settings)

    @property
    def learner(self) -> Learner:
        """See `learn`."""
        return learn

    def along(
        self, runs: Sequence[dict[str, Any]], measure: str
    ) -> NDArray[np.float64]:
        """A measure of each run at `positions`, `(runs, points)`.

        A policy counts from its evaluation to the next; before the first, the first.
        """
        at = np.asarray(self.positions())
        found = []
        for run in runs:
            steps = np.asarray(run["rows"]["env_steps"])
            place = np.searchsorted(steps, at, side="right") - 1
            found.append(np.asarray(run["rows"][measure])[np.maximum(place, 0)])
        return np.array(found)

    def positions(self) -> list[int]:
        """Where curves have their points, in interactions."""
        arena = self.arena
        last = arena.dqn_steps if self.method == "dqn" else arena.steps
        first = max(1.0, last / 1_000)
        return [int(x) for x in np.unique(np.rint(np.geomspace(first, last, POINTS)))]


def learn(contest: Contest, seed: int, report: Report) -> Result:
    """Run a contest once.

    Args:
        contest: what to run.
        seed: of the agent, and through it of its environment.
        report: told the fraction that is done.

    Returns:
        `rows`, the values of each of `COLUMNS`; `levels`, the table at the end, flat,
        nothing of DQN; `seconds` of learning; `failure`, why it broke down, "" if it
        did not.
    """
    run = _learn_dqn if contest.method == "dqn" else _learn_table
    return run(contest, seed, report)


def _learn_table(contest: Contest, seed: int, report: Report) -> Result:
    arena = contest.arena
    agent = make_agent(contest, seed)
    evaluation = Evaluation(arena, report)
    failure = ""
    try:
        agent.learn(total_timesteps=arena.steps, callback=evaluation)
    except ValueError as error:  # values that overflow: Q-learning may diverge
        failure = str(error)
        evaluation.rows.append(
            {
                "env_steps": agent.num_timesteps + 1,
                "seconds": agent.seconds,
                "policy_cost": arena.ceiling,
                "success_rate": 0.0,
            }
        )
    return {
        "rows": _columns(evaluation.rows),
        "levels": np.array(agent.table).ravel(),
        "seconds": agent.seconds,
        "failure": failure,
    }


def make_agent(contest: Contest, seed: int) -> TabularAgent:
    """The agent of a table-based method, ready to learn."""
    arena = contest.arena
    settings = dict(contest.settings)
    slots, kind = settings.pop("slots"), settings.pop("kind")
    env: VectorEnv[Any, Any, Any] = arena.make_env(slots)
    if contest.backwards:
        env = ReversedSlots(env)
    if settings.pop("reward", "stage") == "steps":
        env = TransformReward(env, lambda reward: np.full_like(reward, -1.0))
    grid = arena.partition(kind)
    agent: TabularAgent
    if contest.method == "acl":
        if arena.judged_by is not None:
            settings["cost"] = WHOLES[arena.judged_by].cost
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", PheromoneBoundWarning)  # the thesis's tau0
            agent = ACL(env, grid, seed=seed, **settings)
    else:
        agent = QLearning(env, grid, seed=seed, **settings)
    if contest.backwards:
        agent.rng = ReversedLuck(agent.rng)  # type: ignore[assignment]
    return agent


class Evaluation(Callback):
    """Evaluates the policy ever more seldom, by the cost of the arena.

    Args:
        arena: where, and from which states.
        report: told the fraction that is done.

    Attributes:
        rows: one an evaluation.
    """

    def __init__(self, arena: Arena, report: Report) -> None:
        self.rows: list[Row] = []
        self._arena, self._report = arena, report
        self._states = arena.states()
        self._env = arena.make_env(len(self._states))
        self._steps = arena.evaluation_steps
        self._whole = arena.judged_by and WHOLES[arena.judged_by].cost
        self._due = 0.0

    def on_trial_end(self, agent: Agent, row: Row) -> bool | None:
        """Evaluate if it is time to, and after the last trial."""
        done = row["env_steps"]
        if done >= self._due or done >= self._arena.steps:
            result = evaluate_policy_cost(
                agent.policy,
                self._env,
                self._states,
                max_steps=self._steps,
                seed=0,
                cost=self._whole or None,
            )
            found = {"policy_cost": result.cost, "success_rate": result.success_rate}
            self.rows.append({**row, **found})
            self._due = self._arena.spacing * done
        self._report(min(1.0, done / self._arena.steps))
        return True


def _learn_dqn(contest: Contest, seed: int, report: Report) -> Result:
    # Only here: importing torch takes seconds that the other methods do not need.
    import torch
    from stable_baselines3.common.callbacks import ConvertCallback

    from acl_gym.sb3.callback import PolicyCostCallback
    from acl_gym.sb3.dqn import DQNSettings, make_dqn, scaled_env

    torch.set_num_threads(1)  # the fastest for such small networks
    arena = contest.arena
    settings = {**arena.course.dqn_short, **contest.settings}
    rate = settings.get("learning_rate")
    if rate is not None:
        settings["final_learning_rate"] = rate
    model = make_dqn(arena.env_id, DQNSettings(**settings), seed, **arena.env)
    evaluation = PolicyCostCallback(
        scaled_env(arena.env_id, **arena.env), every=arena.dqn_every
    )

    def tell(local: dict[str, Any], _: dict[str, Any]) -> bool:
        report(min(local["self"].num_timesteps / arena.dqn_steps, 1.0))
        return True

    model.learn(arena.dqn_steps, callback=[evaluation, ConvertCallback(tell)])
    return {
        "rows": _columns(evaluation.history),
        "levels": np.empty(0),
        "seconds": evaluation.history[-1]["seconds"],
        "failure": "",
    }


def _columns(rows: list[Row]) -> dict[str, list[float]]:
    return {name: [float(row[name]) for row in rows] for name in COLUMNS}


def _short(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
