"""The methods of few_interactions.py, each run once with a seed.

A method learns in one run up to the last number of interactions, and its policy is judged
at each of the numbers on the way. Seconds are those of the processor, without evaluation.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from few_plants import Measured, NAVIGATION, PENDULUM, PlantTask, ROUNDS  # isort: skip  # beside this one

from acl_gym import ACL, QLearning, ReturningACL, learn_from_plant
from acl_gym.agents.suitable import suitable_deposit
from acl_gym.experiments.comparison.foreign import ForeignTask, foreign_system
from acl_gym.experiments.comparison.tasks import tuned
from acl_gym.experiments.methods import make_agent
from acl_gym.experiments.names import GROWING
from acl_gym.experiments.study import Study
from acl_gym.model_based.arguments import FIRST_ROUNDS, GROWTH

Row = dict[str, Any]

TUNED = {PENDULUM: "pendulum", NAVIGATION: "navigation"}
"""The tuned tasks of this package's comparison, by environment."""

FEW_SLOTS = 5
"""Of methods without a model, where as many as were tuned would be too many."""


class Record:
    """The rows of one run, and a clock that stands still while policies are judged.

    Args:
        method: its name.
        task: the plant.
        seed: of the run.
        marks: the numbers of interactions after which a policy is judged, rising.

    Attributes:
        rows: one for each mark that was reached.
    """

    def __init__(
        self, method: str, task: PlantTask, seed: int, marks: Sequence[int]
    ) -> None:
        self.rows: list[Row] = []
        self._method, self._task, self._seed = method, task, seed
        self._left = list(marks)
        self._seconds, self._began = 0.0, time.process_time()

    @property
    def next(self) -> int | None:
        """The next mark; None after the last."""
        return self._left[0] if self._left else None

    def judge(self, policy: Any, made: int) -> None:
        """Judge a policy for each mark that was reached.

        Args:
            policy: `predict` gives numbers of actions.
            made: the interactions that it was learned from. They may be a few more than
                the mark, where a method stops only at the end of a trial.
        """
        self.judge_by(lambda: self._task.measure(policy), made)

    def judge_by(self, measure: Callable[[], Measured], made: int) -> None:
        """The same with a measure of the method's own, called once or not at all."""
        self._seconds += time.process_time() - self._began
        found = None
        while self._left and self._left[0] <= made:
            found = found or measure()
            self.rows.append(
                {
                    "method": self._method,
                    "seed": self._seed,
                    "interactions": self._left.pop(0),
                    "seconds": self._seconds,
                    "policy_cost": found.policy_cost,
                    "success_rate": found.success_rate,
                    "made": made,
                }
            )
        self._began = time.process_time()


def run_model(
    record: Record,
    task: PlantTask,
    seed: int,
    marks: Sequence[int],
    agent: Callable[[Any], Any] | None = None,
) -> None:
    """Learn in a model of what was recorded."""
    learn_from_plant(
        task.plant(),
        agent,
        marks[-1],
        rounds=rounds_of(task, marks),
        restart_after=task.steps_of_a_run,
        seed=seed,
        callback=lambda learning, row: record.judge(
            learning.policy, row["interactions"]
        ),
    )


def rounds_of(task: PlantTask, marks: Sequence[int]) -> list[int]:
    """The usual rounds of learn_from_plant, and one at each mark."""
    ends = list(ROUNDS.get(task.env_id, FIRST_ROUNDS))
    while task.env_id not in ROUNDS and ends[-1] < marks[-1]:
        ends.append(int(ends[-1] * GROWTH) + 1)
    return sorted({*marks, *(end for end in ends if end < marks[-1])})


def acl_in_model(task: PlantTask, seed: int) -> Callable[[Any], Any]:
    """The colony of the thesis, where rewards are no costs with a deposit by rank."""

    def make(model: Any) -> ACL:
        deposit = None
        if not task.is_own:
            deposit = suitable_deposit(model, model.max_episode_steps)
        return ACL(
            model, seed=seed, **({} if deposit is None else {"deposit": deposit})
        )

    return make


def q_in_model(task: PlantTask, seed: int) -> Callable[[Any], Any]:
    """Q(lambda) with the settings that it has without a model, in 50 slots."""

    def make(model: Any) -> QLearning:
        settings = dict(_study(task, "q-lambda").settings)
        for name in ("max_steps", "reward"):
            settings.pop(name, None)
        return QLearning(model, seed=seed, **settings)

    return make


def run_table(record: Record, task: PlantTask, seed: int, method: str) -> None:
    """Q-learning without a model, which learns to the end of each trial."""
    study = _study(task, method)
    slots = 1 if method == "q-lambda" else FEW_SLOTS
    settings = dict(study.settings)
    if task.starts == "rest" and task.steps_of_a_run is not None:
        settings["max_steps"] = task.steps_of_a_run
    agent = make_agent(replace(study, slots=slots, settings=settings), seed)
    while record.next is not None:
        agent.learn(total_timesteps=record.next - agent.num_timesteps)
        record.judge(agent.policy, agent.num_timesteps)


def run_returning(record: Record, task: PlantTask, seed: int) -> None:
    """The returning colony without a model."""
    env = ForeignTask(env_id=task.variant).make_env(FEW_SLOTS)
    more = {"max_steps": task.steps_of_a_run} if task.starts == "rest" else {}
    agent = ReturningACL(env, seed=seed, **more)
    while record.next is not None:
        agent.learn(total_timesteps=record.next - agent.num_timesteps)
        record.judge(agent.policy, agent.num_timesteps)


def run_dqn(record: Record, task: PlantTask, seed: int, marks: Sequence[int]) -> None:
    """DQN of Stable-Baselines3, with a shorter random beginning in a short run."""
    import torch
    from stable_baselines3.common.callbacks import BaseCallback

    from acl_gym.sb3.dqn import ScaledPolicy

    class Watch(BaseCallback):
        """Judges between updates."""

        def _on_rollout_start(self) -> None:
            self._judge()

        def _on_step(self) -> bool:
            return True

        def _on_training_end(self) -> None:
            self._judge()

        def _judge(self) -> None:
            if record.next is not None and self.num_timesteps >= record.next:
                record.judge(judged, self.num_timesteps)

    torch.set_num_threads(1)
    study = _study(task, "dqn")
    settings = dict(study.settings)
    settings["learning_starts"] = min(
        settings.get("learning_starts", 1_000), marks[-1] // 10
    )
    if task.starts == "rest" and task.steps_of_a_run is not None:
        settings["max_episode_steps"] = task.steps_of_a_run
    model = study.task.make_network("dqn", settings, seed)
    judged: Any = model
    if task.is_own:
        env = study.task.make_system_env(1)
        space = env.single_observation_space
        judged = ScaledPolicy(model, space, env.system.circular)
    model.learn(marks[-1], callback=Watch())


def _study(task: PlantTask, method: str) -> Study:
    """A method with its settings on the plant: tuned ones where there are such."""
    name = TUNED.get(task.env_id)
    if name is not None:
        found = tuned(name, method)
        return replace(found, task=replace(found.task, env_id=task.variant))
    system = foreign_system(task.variant)
    settings = {**system.settings[method]}
    if method != "dqn":
        settings["max_steps"] = task.limit
    return Study(
        task=system.task,
        method=method if method == "dqn" else "q-learning",
        settings=settings,
        kind=GROWING if method == "q-replay" else "fuzzy",
    )


def run(method: str, task: PlantTask, seed: int, marks: Sequence[int]) -> list[Row]:
    """One run of a method.

    Args:
        method: a key of `METHODS`.
        task: the plant.
        seed: of everything.
        marks: the numbers of interactions, rising.

    Returns:
        A row for each number.
    """
    record = Record(method, task, seed, marks)
    METHODS[method](record, task, seed, marks)
    return record.rows


def _run_pets(record: Record, task: PlantTask, seed: int, marks: Sequence[int]) -> None:
    try:
        from few_pets import run_pets  # which needs mbrl-lib
    except ImportError as error:
        raise ValueError(
            f"pets needs mbrl-lib, which cannot be imported ({error}); make peers-pets "
            "makes an environment for it."
        ) from error

    run_pets(record, task, seed, marks)


METHODS: dict[str, Callable[[Record, PlantTask, int, Sequence[int]], None]] = {
    "model": run_model,
    "model-acl": lambda r, t, s, m: run_model(r, t, s, m, acl_in_model(t, s)),
    "model-q": lambda r, t, s, m: run_model(r, t, s, m, q_in_model(t, s)),
    "returning": lambda r, t, s, m: run_returning(r, t, s),
    "q-learning": lambda r, t, s, m: run_table(r, t, s, "q-lambda"),
    "q-replay": lambda r, t, s, m: run_table(r, t, s, "q-replay"),
    "dqn": run_dqn,
    "pets": _run_pets,
}
"""What runs, by name."""
