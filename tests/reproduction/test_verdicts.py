"""The statistics by which claims are decided."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acl_gym.reproduction.evidence import Evidence, MissingRunsError
from acl_gym.reproduction.systems import row
from acl_gym.reproduction.verdicts import (
    FEW,
    Claim,
    Part,
    Tried,
    interval,
    iqm,
    ratio,
    swing_at_the_end,
    trial_of,
    verdict,
)


def part(holds: bool) -> Part:
    return Part("", "", holds)


def test_verdicts() -> None:
    yes, no = part(True), part(False)
    assert verdict([yes, yes]) == "holds"
    assert verdict([yes, no]) == "holds in part"
    assert verdict([no]) == "does not hold"
    assert verdict([]) == "undecided"


def test_a_claim_without_its_runs_is_undecided() -> None:
    def decide(evidence: Evidence) -> list[Part]:
        evidence.runs(row())
        return [part(True)]

    claim = Claim("C0", "text", "§0", decide)
    assert claim.judge(Evidence({}))["verdict"] == "undecided"
    found = claim.judge(Evidence({row().key: [{}]}))
    assert (found["verdict"], found["parts"][0]["holds"]) == ("holds", True)
    few = claim.judge(Evidence({row().key: [{}]}), FEW - 1)
    assert (few["verdict"], few["parts"][0]["holds"]) == ("undecided", True)
    with pytest.raises(MissingRunsError):
        Evidence({}).runs(row())


def test_what_was_tried_is_told_where_a_claim_is_wanting() -> None:
    def missing(evidence: Evidence) -> Tried:
        evidence.runs(row())
        return Tried("never", "told")

    for holds, told in ((True, []), (False, [{"what": "more", "found": "less"}])):
        claim = Claim(
            *("C0", "text", "§0", lambda _, holds=holds: [part(holds)]),
            (lambda _: Tried("more", "less"), missing),
        )
        claim = replace(claim, understanding="so it is")
        found = claim.judge(Evidence({}))
        assert found["tried"] == told
        # What is made of all runs is not said of none.
        assert found["understanding"] == ("" if holds else "so it is")


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=40))
def test_the_interquartile_mean(values: list[float]) -> None:
    cut = int(0.25 * len(values))
    kept = sorted(values)[cut : len(values) - cut]
    assert iqm(np.array(values)) == pytest.approx(np.mean(kept), abs=1e-6)


def test_intervals_cover_the_mean_about_as_often_as_they_say() -> None:
    rng = np.random.default_rng(3)
    hits = 0
    for trial in range(150):
        low, high = interval(rng.normal(5.0, 1.0, 30), seed=trial)[1:]
        hits += low <= 5.0 <= high
    assert 0.88 <= hits / 150 <= 0.99


def test_a_ratio_draws_each_setting_apart() -> None:
    found = ratio(np.full(5, 6.0), np.array([1.0, 2.0, 3.0]))
    assert found.value == 3.0
    assert 2.0 <= found.low < 3.0 < found.high <= 6.0
    assert str(ratio(np.full(3, 1.0), np.full(4, 2.0))) == "0.5 [0.5, 0.5]"


def test_infinite_values_stay_infinite_and_warn_nobody() -> None:
    found = interval(np.array([1.0, np.inf, np.inf, np.inf]))
    assert found.value == np.inf


@given(
    st.lists(st.lists(st.booleans(), min_size=5, max_size=5), min_size=1, max_size=6)
)
def test_the_trial_from_which_on(reached: list[list[bool]]) -> None:
    found = trial_of(np.array(reached))
    for run, trial in zip(reached, found, strict=True):
        expected = next((i + 1 for i in range(5) if all(run[i:])), np.inf)
        assert trial == expected


def test_swing_at_the_end() -> None:
    costs = np.array([[900.0, 10.0, 12.0, 14.0], [1.0, 7.0, 7.0, 7.0]])
    assert swing_at_the_end(costs, trials=3).tolist() == [4 / 12, 0.0]
