"""How each method makes one run of a study; to add a method, add one entry to `METHODS`."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from gymnasium.vector import VectorEnv
from gymnasium.wrappers.vector import TransformReward

from acl_gym.agents.acl import ACL, PheromoneBoundWarning
from acl_gym.agents.base import TabularAgent
from acl_gym.agents.q_learning import QLearning
from acl_gym.agents.returning import ReturningACL
from acl_gym.callbacks.base import Callback
from acl_gym.colony.deposits import deposit_from_settings
from acl_gym.envs.wrappers.perturbations import ReversedDraws, ReversedSlots
from acl_gym.evaluation import Predictor, evaluate_policy_cost, policy_measures
from acl_gym.experiments.episode_costs import EPISODE_COSTS
from acl_gym.experiments.names import GROWING, NETWORKS
from acl_gym.experiments.results import Run
from acl_gym.experiments.study import AnyStudy, Study
from acl_gym.experiments.swarms.runs import run_aggregation, run_ants, run_pso
from acl_gym.experiments.swarms.study import AGGREGATION, ANTS, PSO
from acl_gym.partitions.settings import (
    partition_from_settings,
    partition_to_settings,
)
from acl_gym.planning.q_iteration import fuzzy_q_iteration
from acl_gym.planning.value_iteration import value_iteration
from acl_gym.policies import TablePolicy
from acl_gym.utils.typing import Row


class Method(NamedTuple):
    """A way to make runs. The label of a learning one in figures is in `names.METHODS`.

    Attributes:
        run: makes one run of a study.
        restore: makes the last policy of a run again, for the system without
            perturbations; None: a run has none.
    """

    run: Callable[[Any, int], Run]
    restore: Callable[[Study, Run], Predictor] | None = None


def run(study: AnyStudy, seed: int) -> Run:
    """Run a study once.

    Args:
        study: what to run.
        seed: of the agent, and through it of its environment.
    """
    warm_up(study)
    return METHODS[study.method].run(study, seed)


_WARM: set[tuple[Any, ...]] = set()


def warm_up(study: AnyStudy) -> None:
    """Compile the kernels of a study, so that measured times exclude compilation."""
    if study.kernels not in _WARM:
        METHODS[study.method].run(study.brief(), 0)
        _WARM.add(study.kernels)


def restore_policy(study: Study, run: Run) -> Any:
    """The last policy of a run.

    Raises:
        ValueError: runs of the method have no policy.
    """
    restore = METHODS[study.method].restore
    if restore is None:
        raise ValueError(f"runs of {study.method} have no policy to restore.")
    return restore(study, run)


class Evaluation(Callback):
    """Evaluates the policy after each trial, or at growing intervals.

    Args:
        study: says how.

    Attributes:
        rows: one an evaluation.
    """

    def __init__(self, study: Study) -> None:
        self.rows: list[Row] = []
        self._study, self._task = study, study.task
        self._env, self._states = study.task.evaluation_env()
        self._due = 0.0

    def on_trial_end(self, agent: Any, row: Row) -> bool | None:
        """Evaluate if it is time to, and after the last trial."""
        study, done = self._study, row["env_steps"]
        last = study.steps is not None and done >= study.steps
        if done < self._due and not last:
            return True
        cost = None if self._task.cost is None else EPISODE_COSTS[self._task.cost].cost
        result = evaluate_policy_cost(
            agent.policy,
            self._env,
            self._states,
            max_steps=self._task.longest_evaluation,
            seed=0,
            cost=cost,
        )
        table = agent.table
        levels = {name: table[pair] for name, pair in study.watched.items()}
        if study.method == "acl":
            levels |= {"lowest_level": table.min(), "highest_level": table.max()}
        self.rows.append(
            {
                **row,
                **policy_measures(result, self._env),
                **{name: float(level) for name, level in levels.items()},
            }
        )
        self._due = study.spacing * done
        return True


_AGENTS: dict[str, type[ACL | ReturningACL | QLearning]] = {
    "acl": ACL,
    "returning": ReturningACL,
    "q-learning": QLearning,
}


def make_agent(study: Study, seed: int) -> TabularAgent:
    """The agent of a method with a table, ready to learn."""
    task, settings = study.task, dict(study.settings)
    env: VectorEnv[Any, Any, Any] = task.make_env(study.slots)
    if study.reversed_slots:
        env = ReversedSlots(env)
    if settings.pop("reward", "stage") == "steps":
        env = TransformReward(env, lambda reward: np.full_like(reward, -1.0))
    if study.method == "acl" and task.cost is not None:
        settings["cost"] = EPISODE_COSTS[task.cost].cost
    if isinstance(settings.get("deposit"), dict):
        settings["deposit"] = deposit_from_settings(settings["deposit"])
    partition = None if study.kind == GROWING else study.make_partition()
    if study.kind == GROWING and study.method == "q-learning":
        settings["grows"] = True
    with warnings.catch_warnings():
        # Table 4.1 has a tau_0 above 1 / J_max: the thesis wants it so.
        warnings.simplefilter("ignore", PheromoneBoundWarning)
        agent = _AGENTS[study.method](env, partition, seed=seed, **settings)
    if study.reversed_slots:
        agent.rng = ReversedDraws(agent.rng)  # type: ignore[assignment]
    return agent


def _learn_table(study: Study, seed: int) -> Run:
    agent, evaluation = make_agent(study, seed), Evaluation(study)
    failure = ""
    try:
        agent.learn(study.steps, study.trials, callback=evaluation)
    except ValueError as error:
        if study.method != "q-learning":
            raise
        failure = str(error)  # values that overflow: Q-learning may diverge
        evaluation.rows.append(
            {
                "env_steps": agent.num_timesteps + 1,
                "seconds": agent.seconds,
                "policy_cost": study.task.highest_cost,
                "success_rate": 0.0,
            }
        )
    rows = pd.DataFrame(evaluation.rows, dtype=np.float64)
    grown = partition_to_settings(agent.partition) if study.kind == GROWING else None
    table = np.array(agent.table).ravel()
    return Run(rows, table, agent.seconds, failure, seed, partition=grown)


def _restore_table(study: Study, run: Run) -> TablePolicy:
    partition = study.make_partition()
    if run.partition is not None:
        partition = partition_from_settings(run.partition)
    return TablePolicy(partition, run.table.reshape(partition.n_cells, -1).copy())


def _learn_network(study: Study, seed: int) -> Run:
    # Only here: importing torch takes seconds that the other methods do not need.
    import torch

    from acl_gym.sb3.callback import PolicyCostCallback

    torch.set_num_threads(1)  # the fastest for such small networks
    env, states, longest = study.task.network_evaluation()
    evaluation = PolicyCostCallback(
        env, states, every=study.evaluate_every or 1_000, max_steps=longest
    )
    model = _make_network(study, seed)
    model.learn(study.steps, callback=evaluation)
    rows = pd.DataFrame(evaluation.history, dtype=np.float64)
    weights = torch.nn.utils.parameters_to_vector(_network(model).parameters())
    table = weights.detach().numpy().astype(np.float64)
    return Run(rows, table, float(rows["seconds"].iloc[-1]), "", seed)


def _network(model: Any) -> Any:
    """What of a model chooses actions."""
    return getattr(model, "q_net", model.policy)


def _make_network(study: Study, seed: int) -> Any:
    if study.task.perturbations or study.task.cost is not None:
        raise ValueError(
            f"{study.method} needs a task without perturbations and judged by its stage costs, got "
            f"{study.task}."
        )
    return study.task.make_network(study.method, study.settings, seed)


def _restore_network(study: Study, run: Run) -> Predictor:
    import torch

    from acl_gym.partitions.discrete import FINITE_SPACES
    from acl_gym.sb3.dqn import ScaledPolicy

    model = _make_network(study, run.seed)
    weights = torch.from_numpy(run.table.astype(np.float32))  # a copy
    torch.nn.utils.vector_to_parameters(weights, _network(model).parameters())
    env = study.task.make_system_env(1)
    if isinstance(env.single_observation_space, FINITE_SPACES):
        found: Predictor = model
        return found
    return ScaledPolicy(model, env.single_observation_space, env.system.circular)


def _plan(study: Study, seed: int) -> Run:
    """Value iteration where a state is a cell, else fuzzy Q-iteration; no seed matters.

    Of several discounts the one with the cheapest policy counts.
    """
    task, settings = study.task, dict(study.settings)
    env = task.make_system_env(1)
    discounts = settings.pop("discounts", [settings.pop("discount", 1.0)])
    began, found = time.perf_counter(), []
    partition = study.make_partition()
    for discount in discounts:
        if partition.cells_per_state == 1 and not hasattr(partition, "centres"):
            policy = value_iteration(env, discount=discount, **settings).policy
        else:
            policy = fuzzy_q_iteration(
                env, partition, discount=discount, **settings
            ).policy
        result = evaluate_policy_cost(policy, env, max_steps=task.longest_evaluation)
        found.append((result, policy, discount))
    seconds = time.perf_counter() - began
    best, policy, discount = min(found, key=lambda each: each[0].cost)
    row = {
        "env_steps": 0.0,
        "seconds": seconds,
        **policy_measures(best, env),
        "discount": discount,
    }
    rows = pd.DataFrame([row], dtype=np.float64)
    return Run(rows, policy.table.ravel(), seconds, "", seed)


METHODS = {
    "acl": Method(_learn_table, _restore_table),
    "returning": Method(_learn_table, _restore_table),
    "q-learning": Method(_learn_table, _restore_table),
    **{name: Method(_learn_network, _restore_network) for name in NETWORKS},
    "planning": Method(_plan, _restore_table),
    AGGREGATION: Method(run_aggregation),
    PSO: Method(run_pso),
    ANTS: Method(run_ants),
}
"""The methods by name."""
