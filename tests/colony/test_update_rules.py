"""The update rules: their equations, their names, and what a file holds of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given, settings
from numpy.typing import NDArray

from acl_gym import ACL, Crisp, Fuzzy, evaluate_policy_cost
from acl_gym.colony.pheromone import Pheromone
from acl_gym.colony.selection import RULES
from acl_gym.colony.update_rule import TrialResult, UpdateRule
from acl_gym.colony.update_rules import (
    UPDATE_RULES,
    EachVisit,
    InTurn,
    OncePerAnt,
    OncePerTrial,
    Reinforcement,
    as_update,
    update_from_settings,
)
from acl_gym.utils.serialization import to_settings
from tests.agents import reference_colony as reference
from tests.agents.reference_colony import chains
from tests.colony.test_pheromone import Trial, trials
from tests.colony.test_selection import colonies

Array = np.ndarray
ROW = Crisp([np.arange(6.0)])
PENDULUM = "acl_gym/Pendulum-v0"


def pendulum_colony(kind: type = Fuzzy, **parameters: Any) -> ACL:
    env = gym.make_vec(PENDULUM, num_envs=20)
    grid = kind.from_box(env.single_observation_space, (8, 9), circular=[0])
    parameters = {"tau0": 1e-6, "max_steps": 40, "seed": 5, **parameters}
    return ACL(env, grid, **parameters)


def result_of(trial: Trial) -> TrialResult:
    return TrialResult(
        trial.packed(),
        trial.costs,
        1.0 / trial.costs,
        np.zeros(len(trial.costs), dtype=np.bool_),
    )


def decayed_late(trial: Trial, each_ant: bool) -> Array:
    """The levels after decay at the end of the trial, over the whole table."""
    kept, most = np.ones(trial.tau.shape), np.zeros(trial.tau.shape)
    for solution in trial.solutions:
        own = np.zeros(trial.tau.shape)
        for beta, action in solution:
            own[:, action] = np.maximum(own[:, action], beta)
        kept *= 1.0 - trial.gamma * own
        most = np.maximum(most, own)
    left = kept if each_ant else 1.0 - trial.gamma * most
    return np.asarray(left * (trial.tau - trial.pheromone.tau0) + trial.pheromone.tau0)


@pytest.mark.parametrize("rule", [OncePerAnt(), OncePerTrial()])
@given(trials())
@settings(max_examples=40, deadline=None)
def test_late_decay_is_once_per_ant_or_once(rule: UpdateRule, trial: Trial) -> None:
    """To the last bit: the order of the factors is that of the ants."""
    late = decayed_late(trial, isinstance(rule, OncePerAnt))
    expected = Pheromone(*trial.tau.shape, trial.pheromone.tau0, 2.0)
    expected.set_levels(late)
    result = result_of(trial)
    Reinforcement(late.size)(expected, result.solutions, result.deposits, trial.rho)
    own = as_update(rule)
    own.local_update(
        trial.pheromone, trial.index[:, 0], trial.degree[:, 0], trial.action[:, 0], 0.5
    )
    own.global_update(trial.pheromone, result, trial.gamma, trial.rho)
    np.testing.assert_array_equal(trial.tau, expected.levels)
    assert trial.pheromone.stale.all()


@pytest.mark.parametrize("restricted", [False, True])
@pytest.mark.parametrize("selection", RULES)
@given(colonies())
@settings(max_examples=25, deadline=None)
def test_in_turn_is_choosing_and_decaying_ant_by_ant(
    selection: str,
    restricted: bool,
    colony: tuple[Pheromone, Array, Array, np.random.Generator],
) -> None:
    pheromone, index, degree, rng = colony
    tau = pheromone.levels.copy()
    n_actions = tau.shape[1]
    allowed = None
    if restricted:
        allowed = rng.random((len(index), n_actions)) < 0.6
        allowed[~allowed.any(axis=1), 0] = True
    state = rng.bit_generator.state
    actions = InTurn().choose(
        selection, pheromone, index, degree, 0.25, rng, allowed, 0.3
    )
    rng.bit_generator.state = state
    coins, choices = rng.random((2, len(index)))
    for j, action in enumerate(actions):
        beta = reference.dense(index[j], degree[j], len(tau))
        columns = (
            np.arange(n_actions) if allowed is None else np.flatnonzero(allowed[j])
        )
        chosen = reference.chosen(
            selection,
            tau[:, columns],
            beta,
            pheromone.alpha,
            0.25,
            coins[j],
            choices[j],
        )
        assert action == columns[chosen]
        # As the kernel rounds it, so that later ants compare the same levels.
        excess = tau[:, action] - pheromone.tau0
        visited = index[j]
        tau[visited, action] = (
            pheromone.tau0 + (1.0 - 0.3 * beta[visited]) * excess[visited]
        )
    np.testing.assert_array_equal(pheromone.levels, tau)
    assert pheromone.stale[index].all()
    InTurn().local_update(pheromone, index, degree, actions, 0.3)
    np.testing.assert_array_equal(pheromone.levels, tau)


@pytest.mark.parametrize("kind", [Fuzzy, Crisp])
def test_rules_differ_in_the_local_update_only(kind: type) -> None:
    """Without local decay all are one; with it no two are alike."""
    for gamma, distinct in ((0.0, 1), (0.2, len(UPDATE_RULES))):
        tables = [
            pendulum_colony(kind, local_decay=gamma, update=name).learn(trials=3).table
            for name in UPDATE_RULES
        ]
        assert len({np.round(table, 12).tobytes() for table in tables}) == distinct


@pytest.mark.parametrize("update", UPDATE_RULES)
@pytest.mark.parametrize("selection", RULES)
def test_predictions_change_nothing(update: str, selection: str) -> None:
    """Predicting, evaluating and drawing softly leave the run as it would have been."""
    parameters = {"update": update, "selection": selection, "local_decay": 0.2}
    quiet, asked = (pendulum_colony(**parameters) for _ in range(2))
    states = asked.partition.cell_states()
    for _ in range(3):
        for colony in (quiet, asked):
            colony.learn(trials=1)
        table, generator = asked.table.copy(), asked.rng.bit_generator.state
        for deterministic in (True, False):
            asked.predict(states, deterministic=deterministic)
        evaluate_policy_cost(asked, asked.env, max_steps=20)
        soft = asked.soft_policy(seed=1)
        evaluate_policy_cost(soft, asked.env, max_steps=20)
        soft.predict(states)
        np.testing.assert_array_equal(asked.table, table)
        assert asked.rng.bit_generator.state == generator
        np.testing.assert_array_equal(asked.table, quiet.table)


@pytest.mark.parametrize("update", UPDATE_RULES)
def test_a_rule_is_saved_by_its_name(update: str, tmp_path: Path) -> None:
    whole = pendulum_colony(update=update).learn(trials=4)
    first = pendulum_colony(update=UPDATE_RULES[update]).learn(trials=2)
    again = ACL.load(first.save(tmp_path / "colony"), first.env)
    assert again.update == UPDATE_RULES[update]
    assert again.parameters() == whole.parameters()
    np.testing.assert_array_equal(again.learn(trials=2).table, whole.table)


@dataclass
class Counting(UpdateRule):
    """A rule of a user's own, which remembers from trial to trial."""

    needs_episodes: ClassVar[bool] = True
    step: float = 1.0
    log: list[Any] = field(default_factory=list)
    total: float = 0.0

    def start_trial(self, pheromone: Pheromone, trial: int) -> None:
        self.log.append(trial)

    def local_update(self, pheromone: Pheromone, *arguments: Any) -> None:
        self.log.append("local")

    def global_update(
        self, pheromone: Pheromone, result: TrialResult, gamma: float, rho: float
    ) -> None:
        episodes = result.episodes
        assert episodes is not None
        costs = np.where(episodes.taken(), episodes.stage_costs, 0.0).sum(axis=0)
        np.testing.assert_allclose(costs, result.costs)
        np.testing.assert_array_equal(episodes.terminated, result.terminated)
        np.testing.assert_array_equal(result.deposits, 1.0 / result.costs)
        self.log.append((gamma, rho))
        self.total += float(result.costs.sum())
        pheromone.set_levels(pheromone.levels + self.step)

    def memory(self) -> dict[str, NDArray[Any]]:
        return {"total": np.array(self.total)}

    def restore(self, memory: dict[str, NDArray[Any]]) -> None:
        self.total = float(memory["total"])


def test_a_rule_of_ones_own_sees_the_trial(tmp_path: Path) -> None:
    rule = Counting(step=2.0)
    colony = ACL(
        chains(3), ROW, tau0=1.0, max_steps=2, seed=0, update=rule, global_decay=0.4
    )
    colony.learn(trials=2)
    assert rule.log == []  # the colony works with a copy
    own = colony.update
    assert isinstance(own, Counting)
    trial = ["local", "local", (0.01, 0.4)]
    assert own.log == [0, *trial, 1, *trial]
    assert (colony.table == 5.0).all()
    assert own.total > 0

    restored = ACL.load(colony.save(tmp_path / "colony"), chains(3))
    states = np.arange(5.0)[:, None]
    np.testing.assert_array_equal(
        restored.predict(states)[0], colony.predict(states)[0]
    )
    with pytest.raises(ValueError, match=r"was '.*:Counting'.*set agent\.update"):
        restored.learn(trials=1)
    assert restored.parameters() == colony.parameters()


def test_a_rule_of_ones_own_is_set_again_and_remembers(tmp_path: Path) -> None:
    """Saved once more without the rule, a file still holds what it remembered."""
    colony = ACL(chains(3), ROW, max_steps=2, seed=0, update=Counting())
    colony.learn(trials=2)
    own = colony.update
    assert isinstance(own, Counting)
    assert own.total > 0.0

    restored = ACL.load(colony.save(tmp_path / "colony"))
    again = ACL.load(restored.save(tmp_path / "again"), chains(3))
    again.update = Counting()
    assert isinstance(again.update, Counting)
    assert again.update.total == own.total
    again.learn(trials=1)
    colony.learn(trials=1)
    assert again.update.total == own.total
    np.testing.assert_array_equal(again.table, colony.table)


def test_another_rule_does_not_take_over_what_a_missing_one_remembered(
    tmp_path: Path,
) -> None:
    class Other(Counting):
        pass

    colony = ACL(chains(3), ROW, max_steps=2, seed=0, update=Counting())
    path = colony.learn(trials=2).save(tmp_path / "colony")
    restored = ACL.load(path, chains(3))
    restored.update = Other()
    assert isinstance(restored.update, Other)
    assert restored.update.total == 0.0
    assert restored.learn(trials=1).trials == 3


def test_what_is_no_rule_is_refused() -> None:
    with pytest.raises(ValueError, match="update must be one of 'each_visit'"):
        ACL(chains(2), ROW, update="backwards")
    with pytest.raises(TypeError, match="or an UpdateRule, got 3"):
        ACL(chains(2), ROW, update=3)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="update must be one of"):
        update_from_settings({"type": "Linear"})
    with pytest.raises(ValueError, match="update must be an UpdateRule"):
        update_from_settings(3)
    assert update_from_settings(to_settings(EachVisit())) == EachVisit()
