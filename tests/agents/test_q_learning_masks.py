"""Q-learning where a state does not offer every action: U_q in (3.44) and (3.46)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acl_gym import Crisp, QLearning
from tests.planning.chains import Table, vector

MODES = ("NextStep", "SameStep", "Disabled")

CAB = np.array([[1, 0, 1], [1, 1, 0], [0, 1, 0], [1, 1, 1]], dtype=np.int8)
"""Which of the actions of `cab` each state offers."""


def cab() -> Table:
    """Three states and the goal; what a state does not offer would pay 100 at once."""
    offered = {(0, 0): 1, (0, 2): 0, (1, 0): 2, (1, 1): 0, (2, 1): 3}
    costs = {(1, 1): -2.0}

    def outcome(q: int, u: int) -> tuple[float, int, float, bool]:
        if (q, u) not in offered:
            return 1.0, 3, 100.0, True
        return 1.0, offered[q, u], costs.get((q, u), -1.0), offered[q, u] == 3

    return {q: {u: [outcome(q, u)] for u in range(3)} for q in range(4)}


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("trace_decay", [0.0, 0.8])
def test_only_what_a_state_offers_counts(mode: str, trace_decay: float) -> None:
    """What is not offered is never tried, or its value would be 100.

    It stays 0, more than any action is worth: (3.44) must not look at it.
    """
    agent = QLearning(
        vector(cab(), 6, mode, masks=CAB),
        Crisp([np.arange(4.0)]),
        learning_rate=1.0,
        discount=1.0,
        epsilon=0.5,
        trace_decay=trace_decay,
        max_steps=200,
        seed=0,
    ).learn(trials=100)
    values = [[-3, 0, -4], [-2, -5, 0], [0, -1, 0], [0, 0, 0]]
    np.testing.assert_array_equal(agent.table, values)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(("limit", "max_steps"), [(2, 50), (np.inf, 2)])
def test_what_is_offered_counts_where_an_episode_is_cut_off(
    mode: str, limit: float, max_steps: int
) -> None:
    agent = QLearning(
        vector(cab(), 6, mode, masks=CAB, limit=limit),
        Crisp([np.arange(4.0)]),
        learning_rate=1.0,
        discount=1.0,
        epsilon=0.5,
        max_steps=max_steps,
        seed=0,
    ).learn(trials=200)
    assert agent.table[0].tolist() == [-3, 0, -4]
    assert agent.table[1].tolist() == [-2, -5, 0]


def test_a_mask_of_the_next_episode_is_not_used() -> None:
    """Slots that reset themselves say what the new state offers, not the last one.

    Cells 0 and 1, truncated after one step: from cell 1 action 0 leads to cell 0. A new
    episode begins in cell 1, which offers action 0 only, worth -1 by now; action 1
    of cell 0, which the last state does offer, is worth more.
    """
    table: Table = {
        0: {u: [(1.0, 2, 0.0, True)] for u in range(2)},
        1: {u: [(1.0, 0, -1.0, False)] for u in range(2)},
        2: {u: [(1.0, 2, 0.0, True)] for u in range(2)},
    }
    offered = np.array([[1, 1], [1, 0], [1, 1]], dtype=np.int8)
    agent = QLearning(
        vector(table, 1, "SameStep", start=1, masks=offered, limit=1),
        Crisp([np.arange(3.0)]),
        learning_rate=1.0,
        discount=1.0,
        seed=0,
    )
    agent.set_table([[-7, 2], [0, 0], [0, 0]])
    agent.learn(trials=1)
    assert agent.table[1].tolist() == [-1 + 2, 0]


def test_a_state_that_offers_nothing() -> None:
    """It is an error, unless the episode has ended there."""
    offered = CAB.copy()
    offered[3] = 0
    keywords = {"discount": 1.0, "max_steps": 50, "seed": 0}
    grid = Crisp([np.arange(4.0)])
    QLearning(vector(cab(), 3, masks=offered), grid, **keywords).learn(trials=5)
    offered[1] = 0
    agent = QLearning(vector(cab(), 3, start=0, masks=offered), grid, **keywords)
    with pytest.raises(ValueError, match="allowed action, got none in slot"):
        agent.learn(trials=5)


def test_an_export_says_that_masks_are_left_out(tmp_path: Path, caplog: Any) -> None:
    agent = QLearning(vector(cab(), 6, "NextStep", masks=CAB), seed=0).learn(trials=1)
    free = QLearning(vector(cab(), 6, "NextStep"), seed=0).learn(trials=1)
    with caplog.at_level("WARNING", "acl_gym"):
        free.to_numpy(tmp_path / "free")
        assert not caplog.records
        agent.to_numpy(tmp_path / "masked")
    assert "not allow every action" in caplog.text
