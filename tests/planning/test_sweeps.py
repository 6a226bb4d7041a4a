"""Sweeps stop at the tolerance or at the limit."""

from __future__ import annotations

import pytest

from acl_gym.planning.sweeps import checked_settings, sweep_until_converged


@pytest.mark.parametrize(
    ("limit", "expected"), [(10, (3, 0.25)), (2, (2, 0.5)), (1, (1, 1.0))]
)
def test_sweeps_stop_at_the_tolerance_or_the_limit(
    limit: int, expected: tuple[int, float]
) -> None:
    changes = iter([1.0, 0.5, 0.25, 0.125])
    found = sweep_until_converged(lambda: next(changes), 0.25, limit, None)
    assert found == expected


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ((1.1, 0.1, 1), "discount must"),
        ((1.0, 0.0, 1), "tolerance must"),
        ((1.0, 0.1, 0), "max_iterations must"),
    ],
)
def test_settings_out_of_range_are_refused(
    settings: tuple[float, float, int], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        checked_settings(*settings)
