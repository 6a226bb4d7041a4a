"""Other readings of the local update, against the equations."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from acl_gym.reproduction import orders
from acl_gym.reproduction.systems import row, swing
from acl_gym.reproduction.training import learn
from tests.reproduction.slices import shortened, silent


def levels(setting: Any, order: str, gamma: float) -> Any:
    changed = replace(setting, colony={**setting.colony, "local_decay": gamma})
    return learn(replace(changed, order=order), 3, silent)["levels"]


@pytest.mark.parametrize("setting", [swing("fuzzy"), swing("crisp"), row()])
def test_without_local_decay_all_are_one(setting: Any) -> None:
    short = shortened(setting)
    expected = levels(short, orders.TWO_PHASES, 0.0)
    assert len(np.unique(expected)) > 5
    for order in orders.ORDERS:
        np.testing.assert_allclose(levels(short, order, 0.0), expected, rtol=1e-9)


@pytest.mark.parametrize("setting", [swing("fuzzy"), swing("crisp"), row()])
def test_with_it_no_two_are_alike(setting: Any) -> None:
    short = shortened(setting)
    found = [levels(short, order, 0.2).tobytes() for order in orders.ORDERS]
    assert len(set(found)) == len(orders.ORDERS)


def test_one_phase_is_choosing_and_decaying_ant_by_ant() -> None:
    rng = np.random.default_rng(5)
    colony = orders.colony(orders.ONE_PHASE, None, swing("fuzzy").make_partition(),
                           n_actions=3, local_decay=0.3, epsilon=0.25,
                           tau0=0.1)  # fmt: skip
    colony.pheromone.set_levels(rng.uniform(0.1, 1.0, colony.pheromone.levels.shape))
    index = rng.integers(0, 6, (40, 4))  # few cells: ants meet
    degree = rng.dirichlet(np.ones(4), 40)
    expected, tau = [], colony.pheromone.levels.copy()
    coin, choice = np.random.default_rng(8).random((2, 40))
    for j in range(40):
        shares = tau[index[j]] ** 3 / (tau[index[j]] ** 3).sum(axis=1, keepdims=True)
        edges = np.cumsum(degree[j] @ shares)
        action = int(np.searchsorted(edges[:2], choice[j], side="right"))
        if coin[j] < 0.25:
            action = int(choice[j] * 3)
        for cell, beta in zip(index[j], degree[j], strict=True):
            tau[cell, action] = (1 - 0.3 * beta) * tau[cell, action] + 0.3 * beta * 0.1
        expected.append(action)
    found = colony._choose(index, degree, 0.25, np.random.default_rng(8), None)
    assert found.tolist() == expected
    np.testing.assert_allclose(colony.pheromone.levels, tau)
    colony.pheromone.local_update(index, degree, found, 0.3)
    np.testing.assert_allclose(colony.pheromone.levels, tau)


def test_what_does_not_go_together() -> None:
    with pytest.raises(ValueError, match="order must be one of two phases"):
        orders.colony("backwards", None)
    partition = swing("crisp").make_partition()
    with pytest.raises(ValueError, match=r"selection must be .* got 'epsilon_greedy'"):
        orders.colony(
            *(orders.ONE_PHASE, None, partition),
            n_actions=3,
            selection="epsilon_greedy",
        )
