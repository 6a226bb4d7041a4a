"""Parameters that follow the trials."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acl_gym.colony.schedules import (
    Exponential,
    Harmonic,
    Linear,
    Schedule,
    schedule_from_settings,
)
from acl_gym.utils.parameters import Parameter
from acl_gym.utils.serialization import Unsaved, to_settings


class Holder:
    rate = Parameter("A rate", scheduled=True, at_least=0, at_most=1)


@given(st.floats(0, 1), st.floats(0, 1), st.integers(1, 50))
def test_linear_goes_from_start_to_end(start: float, end: float, trials: int) -> None:
    schedule = Linear(start, end, trials)
    assert schedule(0) == start
    assert schedule(trials) == pytest.approx(end)
    assert schedule(10 * trials) == schedule(trials)
    middle = (schedule(0) + schedule(trials)) / 2
    assert Linear(start, end, 2 * trials)(trials) == pytest.approx(middle)


def test_exponential_and_harmonic() -> None:
    assert [Exponential(8.0, 0.5)(k) for k in range(4)] == [8, 4, 2, 1]
    assert Exponential(1.0, 2.0, end=3.0)(5) == 3.0
    assert Exponential(1.0, 0.5, end=0.1)(50) == 0.1
    assert Exponential(1.0, 10.0)(1000) == float("inf")
    assert Harmonic(1.0, 4)(12) == 0.25


@pytest.mark.parametrize(
    "schedule", [Linear(1, 0, 3), Exponential(1.0, 0.9, 0.1), Harmonic(0.5, 7), 0.25]
)
def test_schedules_survive_a_file(schedule: Schedule | float) -> None:
    assert schedule_from_settings("alpha", to_settings(schedule)) == schedule


def test_a_function_is_a_schedule_but_not_in_a_file() -> None:
    holder = Holder()
    holder.rate = lambda trial: 1 / (1 + trial)
    assert Holder.rate.at(holder, 3) == 0.25
    restored = schedule_from_settings("rate", to_settings(holder.rate))
    assert isinstance(restored, Unsaved)
    holder.rate = restored
    with pytest.raises(ValueError, match=r"a file cannot hold; set agent\.rate"):
        Holder.rate.at(holder, 0)


def test_numbers_are_checked_when_set_and_schedules_when_used() -> None:
    holder = Holder()
    holder.rate = 0.5
    assert holder.rate == Holder.rate.at(holder, 9) == 0.5
    with pytest.raises(ValueError, match=r"rate must lie in \[0, 1\], got 2"):
        holder.rate = 2.0
    for wrong in ("0.5", None, Linear):
        with pytest.raises(TypeError, match="rate must be a real number"):
            holder.rate = wrong
    holder.rate = Linear(0.0, 2.0, 10)
    assert Holder.rate.at(holder, 5) == 1.0
    with pytest.raises(ValueError, match=r"rate in trial 6 must lie in \[0, 1\]"):
        Holder.rate.at(holder, 6)


@pytest.mark.parametrize(
    ("kind", "arguments"),
    [
        (Linear, ("a", 1, 3)),
        (Linear, (1, 0, 0)),
        (Exponential, (0.0, 0.5)),
        (Exponential, (1.0, 0.0)),
        (Exponential, (1.0, 0.5, -1.0)),
        (Harmonic, (-1.0, 3)),
        (Harmonic, (1.0, 0)),
    ],
)
def test_bad_schedules(kind: type, arguments: tuple[object, ...]) -> None:
    with pytest.raises((TypeError, ValueError), match="must"):
        kind(*arguments)


def test_a_file_holds_schedules_only() -> None:
    with pytest.raises(ValueError, match="alpha must be one of"):
        schedule_from_settings("alpha", {"type": "eval"})
