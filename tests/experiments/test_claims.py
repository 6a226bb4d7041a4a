"""How verdicts on claims are reached."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acl_gym.experiments.claims import (
    FEW,
    Claim,
    Part,
    Tried,
    settled_from,
    verdict,
)
from acl_gym.experiments.results import Results, Run
from acl_gym.experiments.systems import grid_1d
from acl_gym.experiments.thesis.common import late_swing

NONE = Results({})


def part(holds: bool) -> Part:
    return Part("", "", holds)


def test_verdicts() -> None:
    yes, no = part(True), part(False)
    assert verdict([yes, yes]) == "holds"
    assert verdict([yes, no]) == "holds in part"
    assert verdict([no]) == "does not hold"
    assert verdict([]) == "undecided"


def test_a_claim_without_its_runs_is_undecided() -> None:
    def decide(results: Results) -> list[Part]:
        results.runs(grid_1d())
        return [part(True)]

    claim = Claim("C0", "text", "§0", decide)
    assert claim.judge(NONE)["verdict"] == "undecided"
    results = Results({grid_1d().key: [Run(pd.DataFrame(), np.zeros(1), 0.0)]})
    found = claim.judge(results)
    assert (found["verdict"], found["parts"][0]["holds"]) == ("holds", True)
    few = claim.judge(results, FEW - 1)
    assert (few["verdict"], few["parts"][0]["holds"]) == ("undecided", True)


@pytest.mark.parametrize(
    ("holds", "tried"), [(True, []), (False, [{"what": "more", "found": "less"}])]
)
def test_what_was_tried_is_reported_where_a_claim_does_not_hold(
    holds: bool, tried: list[dict[str, str]]
) -> None:
    def missing(results: Results) -> Tried:
        results.runs(grid_1d())
        return Tried("never", "reported")

    claim = Claim(
        *("C0", "text", "§0", lambda _: [part(holds)]),
        (lambda _: Tried("more", "less"), missing),
    )
    claim = replace(claim, understanding="that is why")
    found = claim.judge(NONE)
    assert found["tried"] == tried
    assert found["understanding"] == ("" if holds else "that is why")


@given(
    st.lists(st.lists(st.booleans(), min_size=5, max_size=5), min_size=1, max_size=6)
)
def test_the_trial_from_which_on(reached: list[list[bool]]) -> None:
    found = settled_from(np.array(reached))
    for run, trial in zip(reached, found, strict=True):
        expected = next((i + 1 for i in range(5) if all(run[i:])), np.inf)
        assert trial == expected


def test_the_swing_at_the_end() -> None:
    costs = np.array([[900.0, 10.0, 12.0, 14.0], [1.0, 7.0, 7.0, 7.0]])
    assert late_swing(costs, trials=3).tolist() == [4 / 12, 0.0]
