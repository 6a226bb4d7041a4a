"""Pictures and tables for notebooks, and numbers as text."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from acl_gym.utils import pictures, text


def test_a_png_holds_its_pixels() -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (3, 5, 3), dtype=np.uint8)
    with Image.open(io.BytesIO(pictures.png(pixels))) as image:
        image.load()  # checks the sums of all parts
        assert (np.asarray(image) == pixels).all()


def test_values_go_from_blue_over_grey_to_orange() -> None:
    assert pictures.action_colours(3, [-1.0, 0.0, 1.0]) == [
        "#0072B2",
        "#E8E8E8",
        "#D55E00",
    ]
    assert pictures.action_colours(2, [1.0, 2.0]) == ["#0072B2", "#D55E00"]
    assert pictures.action_colours(1, [0.0]) == ["#0072B2"]


@pytest.mark.parametrize("count", [1, 8, 9, 40])
def test_all_colours_differ(count: int) -> None:
    assert len(set(pictures.action_colours(count))) == count


def test_directions_have_colours_and_no_direction_is_grey() -> None:
    vectors = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0], [0.0, 0.0]])
    colours = pictures.direction_colours(vectors)
    assert colours == ["#D55E00", "#F0E442", "#0072B2", "#CC79A7", "#E8E8E8"]
    assert [pictures.rgb(colour) for colour in colours[:1]] == [(213, 94, 0)]


def test_tables_are_escaped_but_for_markup() -> None:
    page = pictures.table([["<b>", pictures.Markup("<i>x</i>")]], heads=["&", ""])
    assert "&lt;b&gt;" in page
    assert "<i>x</i>" in page
    assert "&amp;" in page


def test_a_guarded_page_shows_the_line_instead_of_an_error() -> None:
    class Thing:
        def __repr__(self) -> str:
            return "<thing>"

        @pictures.guarded
        def page(self) -> str:
            raise RuntimeError

    assert Thing().page() == "<pre>&lt;thing&gt;</pre>"


@pytest.mark.parametrize(
    ("number", "shown"),
    [(0, "0"), (999, "999"), (1000, "1.0k"), (99_900, "100k"), (2_613_000, "2.6M"),
     (13e6, "13M"), (5e9, "5.0G")],
)  # fmt: skip
def test_numbers_of_things(number: float, shown: str) -> None:
    assert text.count(number) == shown


def test_signs() -> None:
    assert [text.signed(value) for value in (-0.8, 0.0, 0.8)] == ["−0.8", "0", "+0.8"]


def test_short_texts_stand_on_one_line() -> None:
    assert text.short("a\n  b") == "a b"
    assert text.short("x" * 50, 10) == "xxxxxxx..."
