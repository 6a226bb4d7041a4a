"""The checks of arguments: what passes, what is refused, and how the message reads."""

from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acl_gym.utils import validation

NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize(
    "value", [2, 2.0, -3.5, Fraction(1, 4), np.float32(0.5), np.int8(3), 0, -0.0]
)
def test_real_numbers_become_floats(value: Any) -> None:
    result = validation.number("x", value)
    assert type(result) is float
    assert result == value


@pytest.mark.parametrize(
    "value", [True, np.True_, "1", None, 1j, [1.0], np.array([1.0]), Decimal(1)]
)
def test_other_types_are_no_numbers(value: Any) -> None:
    with pytest.raises(TypeError, match=r"^rate must be a real number, got .* of type"):
        validation.number("rate", value)


@pytest.mark.parametrize(
    "value",
    [NAN, INF, -INF, np.float64(NAN), pytest.param(10**400, id="beyond all floats")],
)
def test_numbers_must_be_finite(value: Any) -> None:
    with pytest.raises(ValueError, match=r"^rate must lie in \(-inf, inf\), got"):
        validation.number("rate", value)


@pytest.mark.parametrize(
    ("bounds", "inside", "outside", "interval"),
    [
        ({"above": 0}, [1e-300, 5], [0, -0.0, -1], r"\(0, inf\)"),
        ({"at_least": 0}, [0, -0.0, 5], [-1e-300, -1], r"\[0, inf\)"),
        ({"below": 1}, [0.999, -5], [1, 2], r"\(-inf, 1\)"),
        ({"at_most": 1}, [1, -5], [1.001, 2], r"\(-inf, 1\]"),
        ({"above": 0, "at_most": 1}, [0.1, 1], [0, 1.1, -1], r"\(0, 1\]"),
        ({"at_least": 0, "below": 1}, [0, 0.9], [1, -0.1], r"\[0, 1\)"),
        ({"at_least": 0, "at_most": 1}, [0, 1], [-0.1, 1.1], r"\[0, 1\]"),
        ({"above": 0, "below": 1}, [0.5], [0, 1], r"\(0, 1\)"),
    ],
    ids=str,
)
def test_bounds(
    bounds: dict[str, float], inside: list[float], outside: list[float], interval: str
) -> None:
    for value in inside:
        assert validation.number("rate", value, **bounds) == value
    for value in [*outside, NAN, INF, -INF]:
        with pytest.raises(ValueError, match=rf"^rate must lie in {interval}, got"):
            validation.number("rate", value, **bounds)


@pytest.mark.parametrize("value", [2**63, 10**30, np.uint64(2**63)])
def test_integers_must_fit_into_arrays_unless_told_otherwise(value: Any) -> None:
    with pytest.raises(ValueError, match=r"^count must be at most 9223372036854775807"):
        validation.integer("count", value, at_least=1)
    assert validation.integer("seed", value, at_least=0, at_most=None) == value
    assert validation.seed(value) == value


def test_a_seed_is_none_or_a_whole_number() -> None:
    assert validation.seed(None) is None
    with pytest.raises(ValueError, match=r"^seed must be at least 0, got -1\."):
        validation.seed(-1)
    with pytest.raises(TypeError, match=r"^seed must be an integer, got 1\.5"):
        validation.seed(1.5)


class _NoRepr:
    def __repr__(self) -> str:
        raise RuntimeError


@pytest.mark.parametrize("value", [True, False, np.True_, np.False_])
def test_a_switch_becomes_a_bool(value: Any) -> None:
    result = validation.boolean("x", value)
    assert type(result) is bool
    assert result == value


@pytest.mark.parametrize("value", [1, 0, None, "yes", "", np.int8(1), [True]])
def test_anything_else_is_no_switch(value: Any) -> None:
    with pytest.raises(TypeError, match=r"^walk must be True or False, got"):
        validation.boolean("walk", value)


def test_any_value_is_shown_shortly() -> None:
    assert validation.shown(1.5) == "1.5"
    assert validation.shown(np.eye(2)) == "array([[1., 0.], [0., 1.]])"  # on one line
    assert len(validation.shown("x" * 10_000)) < 300  # the limit and the dots
    assert validation.shown(_NoRepr()) == "an object of type _NoRepr"
    assert validation.shown(10**5000) == "an object of type int"  # too long for Python


@pytest.mark.parametrize("value", [None, 3, [], 1.5, np.ones(2)])
def test_paths_are_text_or_paths(value: Any) -> None:
    with pytest.raises(TypeError, match=r"^file must be a path, text or pathlib\.Path"):
        validation.path("file", value)


@pytest.mark.parametrize("value", ["", "a\0b"])
def test_paths_have_a_name(value: str) -> None:
    with pytest.raises(ValueError, match=r"^file must be the name of a file, got"):
        validation.path("file", value)
    assert validation.path("file", "a/b").name == "b"


def test_more_memory_than_there_is_is_refused() -> None:
    validation.check_memory("a few numbers", 1000, "use fewer")
    with pytest.raises(
        ValueError, match=r"^all must fit into .* need 10,000,000,000,0"
    ):
        validation.check_memory("all", 10**19, "use fewer")


def test_a_view_that_stands_for_too_many_numbers_is_refused() -> None:
    with pytest.raises(ValueError, match=r"^the numbers of x must fit into"):
        validation.real_array("x", np.broadcast_to(1.0, (10**6, 10**6)))


@pytest.mark.parametrize(
    "values", [np.ma.masked_array([1.0, 2.0], [True, False]), [[1], [1, 2]], object()]
)
def test_masked_and_ragged_values_are_no_numbers(values: Any) -> None:
    with pytest.raises(ValueError, match=r"^x must be an array of finite real numbers"):
        validation.real_array("x", values)


@pytest.mark.parametrize("value", [1, 7, np.int32(3), np.uint8(200), 2**63 - 1])
def test_integers_become_ints(value: Any) -> None:
    result = validation.integer("count", value, at_least=1)
    assert type(result) is int
    assert result == value


@pytest.mark.parametrize(
    "value", [True, np.False_, 1.0, NAN, "1", None, [1], np.array([1]), Fraction(2, 1)]
)
def test_other_types_are_no_integers(value: Any) -> None:
    with pytest.raises(TypeError, match=r"^count must be an integer, got .* of type"):
        validation.integer("count", value, at_least=1)


@pytest.mark.parametrize("value", [0, -1, np.int64(-5)])
def test_integers_must_not_be_too_small(value: Any) -> None:
    message = rf"^count must be at least 1, got {value}\."
    with pytest.raises(ValueError, match=message):
        validation.integer("count", value, at_least=1)


def test_one_of_the_choices_passes() -> None:
    assert validation.one_of("mode", "fast", ("slow", "fast")) == "fast"


@pytest.mark.parametrize("value", ["Fast", "", None, 1, ["fast"]])
def test_anything_but_a_choice_is_refused(value: Any) -> None:
    with pytest.raises(ValueError, match=r"^mode must be one of 'slow', 'fast', got"):
        validation.one_of("mode", value, ("slow", "fast"))


@pytest.mark.parametrize("folder", [".", "..", "/", "a/.."])
def test_a_file_has_a_name(folder: str) -> None:
    assert validation.path("directory", folder) == Path(folder)
    with pytest.raises(
        ValueError, match="path must be the name of a file, got the fol"
    ):
        validation.file_path("path", folder)
    assert validation.file_path("path", f"{folder}/name").name == "name"
