"""Selection with a heuristic: tau^alpha eta^beta, against the equations."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acl_gym import ACL, Crisp
from acl_gym.colony.pheromone import Pheromone
from acl_gym.colony.schedules import Linear
from acl_gym.colony.selection import RULES, choose_actions
from acl_gym.colony.update_rules import InTurn
from acl_gym.utils import threads
from tests.agents import reference_colony as reference
from tests.agents.reference_colony import chains
from tests.colony.test_selection import colonies

Array = np.ndarray
ROW = Crisp([np.arange(6.0)])


def weighed(
    rule: str, pheromone: Pheromone, eta: Array, beta: float, allowed: Array
) -> Array:
    """The table whose choice with alpha = 1 is that of tau^alpha eta^beta, by cell."""
    alpha = pheromone.alpha
    table = np.zeros_like(pheromone.levels)
    for cell, levels in enumerate(pheromone.levels):
        scaled = np.where(eta[cell] > 0, (eta[cell] / eta[cell].max()) ** beta, 0.0)
        if not scaled[allowed].any():
            scaled = np.ones_like(scaled)
        if rule == "epsilon_greedy":
            table[cell] = levels * scaled ** (1 / alpha)
        else:
            counts = allowed & (scaled > 0)
            table[cell, counts] = (
                levels[counts] / levels[counts].max()
            ) ** alpha * scaled[counts]
    return table


@pytest.mark.parametrize("in_turn", [False, True])
@pytest.mark.parametrize("rule", RULES)
@given(colonies(), st.booleans(), st.sampled_from([0.0, 0.5, 1.0, 3.0]))
@settings(max_examples=40, deadline=None)
def test_choices_weigh_the_heuristic(
    rule: str,
    in_turn: bool,
    colony: tuple[Pheromone, Array, Array, np.random.Generator],
    restricted: bool,
    beta: float,
) -> None:
    plain, index, degree, rng = colony
    n_cells, n_actions = plain.levels.shape
    eta = np.exp(rng.normal(size=(n_cells, n_actions)))
    eta[rng.random(eta.shape) < 0.3] = 0.0
    eta[~eta.any(axis=1), 0] = 1.0
    allowed = np.ones((len(index), n_actions), dtype=bool)
    if restricted:
        allowed = rng.random(allowed.shape) < 0.5
        allowed[~allowed.any(axis=1), 0] = True
    pheromone = Pheromone(n_cells, n_actions, 1e-300, plain.alpha, eta, beta)
    pheromone.set_levels(plain.levels)
    mask = allowed if restricted else None
    state = rng.bit_generator.state
    if in_turn:  # without decay; levels far above tau0 stay exactly
        actions = InTurn().choose(rule, pheromone, index, degree, 0.2, rng, mask, 0.0)
    else:
        actions = choose_actions(rule, pheromone, index, degree, 0.2, rng, mask)
    rng.bit_generator.state = state
    coins, choices = rng.random((2, len(index)))
    for j, action in enumerate(actions):
        columns = np.flatnonzero(allowed[j])
        table = weighed(rule, pheromone, eta, beta, allowed[j])
        weights = reference.dense(index[j], degree[j], n_cells)
        if coins[j] < 0.2 and rule != "boltzmann":
            assert action == columns[int(choices[j] * len(columns))]
        elif rule == "epsilon_greedy":
            values = weights @ table[:, columns]
            assert values[list(columns).index(action)] == pytest.approx(
                values.max(), rel=1e-9
            )
        else:
            shares = table[:, columns] / table[:, columns].sum(axis=1, keepdims=True)
            edges = np.concatenate([[0.0], np.cumsum(weights @ shares)])
            place = list(columns).index(action)
            assert edges[place] - 1e-9 <= choices[j] <= edges[place + 1] + 1e-9


@pytest.mark.parametrize("n_threads", [1, 2])
@pytest.mark.parametrize("restricted", [False, True])
@pytest.mark.parametrize("rule", RULES)
def test_a_heuristic_of_ones_gives_the_same_bits(
    rule: str, restricted: bool, n_threads: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(threads, "worth_it", lambda ants: n_threads > 1)
    rng = np.random.default_rng(1)
    levels = np.exp(rng.normal(size=(30, 5)))
    index = rng.integers(0, 30, (500, 4)).astype(np.int32)
    degree = rng.dirichlet(np.ones(4), 500)
    allowed = np.ones((500, 5), dtype=bool)
    allowed[:, 1] = rng.random(500) < 0.5
    found = []
    for eta in (None, np.ones((30, 5)), np.full((30, 5), 7.0)):
        pheromone = Pheromone(30, 5, 1e-4, 2.5, eta, 2.0)
        pheromone.set_levels(levels)
        actions = choose_actions(
            *(rule, pheromone, index, degree, 0.1, np.random.default_rng(2)),
            allowed if restricted else None,
        )
        pheromone.repair(index)
        found.append((actions, pheromone.probabilities))
    for actions, probabilities in found[1:]:
        np.testing.assert_array_equal(actions, found[0][0])
        np.testing.assert_array_equal(probabilities, found[0][1])


def test_a_colony_is_led_by_its_heuristic() -> None:
    """To the right from the start, and left only by exploration."""
    eta = np.tile([0.0, 1.0], (6, 1))
    parameters: dict[str, Any] = {"tau0": 1e-3, "seed": 1, "max_steps": 5}
    led = ACL(chains(8), ROW, heuristic=eta, selection="boltzmann", **parameters).learn(
        trials=1
    )
    assert led.rollout.terminated.all()
    assert (led.table[:, 0] == 1e-3).all()
    plain = ACL(chains(8), ROW, **parameters).learn(trials=6)
    ones = ACL(
        chains(8),
        ROW,
        heuristic=lambda env, partition: np.ones((partition.n_cells, 2)),
        **parameters,
    ).learn(trials=6)
    np.testing.assert_array_equal(plain.table, ones.table)
    assert [row["sensitivity"] for row in plain.history] == [
        row["sensitivity"] for row in ones.history
    ]


def test_a_heuristic_is_saved_with_the_colony(tmp_path: Path) -> None:
    eta = np.random.default_rng(0).random((6, 2)) + 0.1
    parameters: dict[str, Any] = {
        "heuristic": eta,
        "beta": Linear(2.0, 0.5, 4),
        "tau0": 1e-3,
        "seed": 1,
        "max_steps": 20,
    }
    whole = ACL(chains(8, slip=0.3), ROW, **parameters).learn(trials=6)
    first = ACL(chains(8, slip=0.3), ROW, **parameters).learn(trials=3)
    again = ACL.load(first.save(tmp_path / "colony"), chains(8, slip=0.3))
    np.testing.assert_array_equal(again.heuristic, eta)
    np.testing.assert_array_equal(again.learn(trials=3).table, whole.table)
    assert again.pheromone.beta == whole.pheromone.beta == 0.5


@pytest.mark.parametrize(
    ("eta", "message"),
    [
        (np.ones((6, 3)), r"shape \(6, 2\)"),
        (np.zeros((6, 2)), "cell 0"),
        (-np.eye(6, 2), "cell 0"),
        (np.full((6, 2), np.inf), "cell 0"),
        ([[1, 1]] * 5 + [[np.nan, 1]], "cell 5"),
        ("x", "an array of real numbers, got 'x'"),
        ([[1, 1], [1]], r"shape \(6, 2\).* got 2 rows of 1 to 2 entries"),
        (np.ones(6), r"shape \(6, 2\).* got \(6,\)"),
        ([[1, 1]] * 5 + [[1, -2]], "got -2 for action 1 in cell 5"),
        ([[1, 1]] * 4 + [[0, 0]] * 2, "got only 0 in cell 4"),
        ([], "an array of real numbers"),
    ],
)
def test_a_bad_heuristic_is_refused(eta: Any, message: str) -> None:
    with pytest.raises(ValueError, match=f"heuristic must .*{message}"):
        ACL(chains(2), ROW, heuristic=eta)


def test_a_heuristic_may_be_of_truth_values() -> None:
    eta = np.arange(12).reshape(6, 2) % 3 > 0
    colony = ACL(chains(2), ROW, heuristic=eta)
    np.testing.assert_array_equal(colony.heuristic, eta.astype(float))
