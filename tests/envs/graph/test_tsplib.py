"""The reader for files of TSPLIB, on good files, broken ones and noise."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from acl_gym.envs.graph import read_tour, read_tsplib
from acl_gym.envs.graph.tsplib import parse_tour, parse_tsplib

# The Odyssey of Ulysses, and a shortest tour of 6859 km.
ULYSSES = """
NAME: ulysses16
TYPE: TSP
COMMENT: Odyssey of Ulysses: (Groetschel/Padberg)
COMMENT: a second one
DIMENSION: 16
EDGE_WEIGHT_TYPE: GEO
DISPLAY_DATA_TYPE: COORD_DISPLAY
NODE_COORD_SECTION
 1 38.24 20.42
 2 39.57 26.15
 3 40.56 25.32
 4 36.26 23.12
 5 33.48 10.54
 6 37.56 12.19
 7 38.42 13.11
 8 37.52 20.44
 9 41.23 9.10
 10 41.17 13.05
 11 36.08 -5.21
 12 38.47 15.13
 13 38.15 15.35
 14 37.51 15.17
 15 35.49 14.32
 16 39.36 19.56
 EOF
"""
WAY = """
NAME : ulysses16.opt.tour
TYPE : TOUR
DIMENSION : 16
TOUR_SECTION
1 14 13 12 7 6 15 5 11 9 10
16 3 2 4 8
-1
EOF
"""
SMALL = """NAME : small
TYPE : TSP
DIMENSION : 3
EDGE_WEIGHT_TYPE : EUC_2D
NODE_COORD_SECTION
1 0 0
2 3.0e0 4
3 0 8
EOF
"""
MATRIX = """NAME : matrix
TYPE : {kind}
DIMENSION : 4
EDGE_WEIGHT_TYPE : EXPLICIT
EDGE_WEIGHT_FORMAT : {form}
{more}EDGE_WEIGHT_SECTION
{numbers}
{end}EOF
"""
FULL = np.array([[0, 1, 2, 3], [1, 0, 4, 5], [2, 4, 0, 6], [3, 5, 6, 0]])


def matrix(form: str, numbers: str, kind: str = "TSP") -> str:
    return MATRIX.format(form=form, numbers=numbers, kind=kind, more="", end="")


def test_places_on_the_earth_have_the_known_shortest_tour() -> None:
    instance = parse_tsplib(ULYSSES)
    assert instance.name == "ulysses16"
    assert instance.length(parse_tour(WAY)) == 6859.0
    assert instance.coordinates is not None
    # Longitude to the right, latitude upwards.
    assert instance.coordinates[0].tolist() == [20.42, 38.24]


@pytest.mark.parametrize(
    ("form", "numbers"),
    [
        ("FULL_MATRIX", "0 1 2 3\n1 0 4 5 2\n4 0 6\n3 5 6 0"),
        ("UPPER_ROW", "1 2 3\n4 5\n6"),
        ("UPPER_DIAG_ROW ", "0 1 2 3 0 4 5 0 6 0"),
        ("LOWER_ROW", "1\n2 4\n3 5 6"),
        ("LOWER_DIAG_ROW", "0 1 0 2 4 0 3 5 6 0"),
        ("UPPER_COL", "1\n2 4\n3 5 6"),
        ("UPPER_DIAG_COL", "9 1 9 2 4 9 3 5 6 9"),
        ("LOWER_COL", "1 2 3\n4 5\n6"),
        ("LOWER_DIAG_COL", "0 1 2 3 0 4 5 0 6 0"),
    ],
)
def test_every_form_of_a_matrix(form: str, numbers: str) -> None:
    found = parse_tsplib(matrix(form, numbers))
    np.testing.assert_array_equal(found.distances, FULL)
    assert found.coordinates is None
    assert found.optimum is None


def test_asymmetric_matrices() -> None:
    numbers = "9999 1 2 3 7 9999 4 5 8 9 9999 6 0 0 0 9999"
    found = parse_tsplib(matrix("FULL_MATRIX", numbers, "ATSP (a remark)"))
    assert not found.symmetric
    assert found.distances[1].tolist() == [7, 0, 4, 5]
    with pytest.raises(
        ValueError, match=r"TYPE TSP must be symmetric.*set TYPE to ATSP"
    ):
        parse_tsplib(matrix("FULL_MATRIX", numbers))


def test_where_a_matrix_is_to_be_shown() -> None:
    text = MATRIX.format(
        kind="TSP",
        form="UPPER_ROW",
        more="DISPLAY_DATA_TYPE : TWOD_DISPLAY\n",
        numbers="1 2 3 4 5 6",
        end="DISPLAY_DATA_SECTION\n2 1.5 1\n1 0 0\n4 3 3\n3 2 2\n",
    )
    found = parse_tsplib(text)
    assert found.coordinates is not None
    assert found.coordinates.tolist() == [[0, 0], [1.5, 1], [2, 2], [3, 3]]
    np.testing.assert_array_equal(found.distances, FULL)


def test_files(tmp_path: Path) -> None:
    file = tmp_path / "small.tsp"
    file.write_text(SMALL)
    found = read_tsplib(file, optimum=18)
    assert found.distances.tolist() == [[0, 5, 8], [5, 0, 5], [8, 5, 0]]
    assert found.optimum == 18.0
    # Letters of old files, and line ends of other systems.
    file.write_bytes(SMALL.replace("small", "Stra\xdfe").encode("latin-1"))
    assert read_tsplib(str(file)).n_cities == 3
    file.write_bytes(SMALL.encode("utf-8-sig"))  # with a byte-order mark
    assert read_tsplib(file).name == "small"
    file.write_bytes(SMALL.replace("\n", "\r\n").encode())
    assert read_tsplib(file).name == "small"
    (tmp_path / "a.tour").write_text(WAY)
    assert read_tour(tmp_path / "a.tour").tolist()[:3] == [0, 13, 12]


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        read_tsplib(tmp_path / "nothing.tsp")
    for bad in (tmp_path, "/dev/zero"):
        with pytest.raises(ValueError, match="path must be a file"):
            read_tsplib(bad)
    os.mkfifo(tmp_path / "pipe")  # nobody will ever write into it
    with pytest.raises(ValueError, match="path must be a file"):
        read_tsplib(tmp_path / "pipe")
    huge = tmp_path / "huge.tsp"
    with huge.open("wb") as file:
        file.truncate(2**34)  # a hole, which takes no space
    with pytest.raises(ValueError, match=r"huge\.tsp: .*at most"):
        read_tsplib(huge)
    with pytest.raises(TypeError, match="path must be a path"):
        read_tsplib(3)  # type: ignore[arg-type]


CHANGES = {
    "no type": (
        "TYPE : TSP\n",
        "",
        "there must be a line TYPE : followed by one of TSP, ATSP,",
    ),
    "vehicles": ("TYPE : TSP", "TYPE : CVRP", "got 'CVRP'"),
    "no dimension": (
        "DIMENSION : 3\n",
        "",
        "a line DIMENSION : followed by the number of cities, but",
    ),
    "half": ("DIMENSION : 3", "DIMENSION : 3.5", "got '3.5'"),
    "negative": ("DIMENSION : 3", "DIMENSION : -3", "got '-3'"),
    "one": ("DIMENSION : 3", "DIMENSION : 1", "2 to 100,000 cities, got 1"),
    "two": ("DIMENSION : 3", "DIMENSION : 2", "must hold 6 numbers, got 9"),
    "four": ("DIMENSION : 3", "DIMENSION : 4", "must hold 12 numbers, got 9"),
    "huge": ("DIMENSION : 3", f"DIMENSION : {10**12}", "got 1000000000000"),
    "endless": ("DIMENSION : 3", f"DIMENSION : {'9' * 9000}", "DIMENSION must be"),
    "other digits": ("DIMENSION : 3", "DIMENSION : \u0663", "DIMENSION must be"),
    "two types": ("TYPE : TSP", "TYPE : TSP\nTYPE : ATSP", "line 3: there is a second"),
    "metric": ("EUC_2D", "XRAY1", "EDGE_WEIGHT_TYPE must be one of EUC_2D"),
    "no section": ("NODE_COORD_SECTION\n", "", "line 5 must be KEYWORD : value"),
    "section": ("NODE_COORD", "DEPOT", "'DEPOT_SECTION' must be one of"),
    "two sections": ("EOF", "NODE_COORD_SECTION\nEOF", "second NODE_COORD_SECTION"),
    "edges": ("EOF", "FIXED_EDGES_SECTION\n1 2\n-1\nEOF", "fixed edges are not"),
    "no format": (
        "EUC_2D",
        "EXPLICIT",
        "a line EDGE_WEIGHT_FORMAT : followed by one of",
    ),
    "word": ("0 8", "0 eight", "must hold numbers, got 'eight'"),
    "underscore": ("0 8", "0 1_000", "must hold numbers, got '1_000'"),
    "nan": ("0 8", "0 nan", "must hold finite numbers, got [0.0, nan] for city 3."),
    "infinite": ("0 8", "0 1e999", "finite numbers, got [0.0, inf] for city 3."),
    "far": ("0 8", "0 1e300", "distances must be finite"),
    "third number": ("0 8", "0 8 9", "must hold 9 numbers, got 10"),
    "city twice": ("3 0 8", "2 0 8", "must number the cities 1 to 3, each once"),
    "from zero": ("3 0 8", "0 0 8", "must number the cities 1 to 3, each once"),
    "half a city": ("3 0 8", "2.5 0 8", "must number the cities 1 to 3, each once"),
    "nan city": ("3 0 8", "nan 0 8", "must number the cities 1 to 3, each once"),
    "huge city": ("3 0 8", "1e30 0 8", "must number the cities 1 to 3, each once"),
    "no end": ("3 0 8\nEOF\n", "3 0", "must hold 9 numbers, got 8"),
}


@pytest.mark.parametrize("change", CHANGES)
def test_broken_files_have_one_clear_error(change: str) -> None:
    old, new, message = CHANGES[change]
    assert old in SMALL
    with pytest.raises(ValueError, match="TSPLIB text: ") as caught:
        parse_tsplib(SMALL.replace(old, new))
    assert message in str(caught.value)
    assert len(str(caught.value)) < 500


@pytest.mark.parametrize("number", ["-1", "nan", "inf"])
@pytest.mark.parametrize("form", ["UPPER_ROW", "LOWER_ROW"])
def test_bad_distances_in_a_triangle(form: str, number: str) -> None:
    with pytest.raises(ValueError, match=f"TSPLIB text: distances .*got {number}"):
        parse_tsplib(matrix(form, f"1 2 3 4 5 {number}"))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("TOUR\n", "TSP\n", "TYPE must be one of TOUR"),
        ("TOUR_SECTION\n", "", "must be KEYWORD : value"),
        ("16 3 2", "3 2", "must hold 16 numbers, got 15"),
        ("16 3 2", "17 3 2", "must number the cities 1 to 16"),
        ("16 3 2", "1 3 2", "must number the cities 1 to 16"),
    ],
)
def test_broken_tours(old: str, new: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        parse_tour(
            WAY.replace(f" : {old}", f" : {new}").replace(f"\n{old}", f"\n{new}")
        )


@pytest.mark.parametrize("parse", [parse_tsplib, parse_tour])
@pytest.mark.parametrize("text", [b"NAME: a", None])
def test_what_is_no_text_is_refused(parse: Any, text: Any) -> None:
    with pytest.raises(TypeError, match="text must be what stands in a file of TSPLIB"):
        parse(text)


def test_the_diagonal_of_a_triangle_may_be_as_large_as_it_likes() -> None:
    text = (
        "TYPE: TSP\nDIMENSION: 3\nEDGE_WEIGHT_TYPE: EXPLICIT\n"
        "EDGE_WEIGHT_FORMAT: UPPER_DIAG_ROW\nEDGE_WEIGHT_SECTION\n"
        "1e308 1 2 1e308 3 1e308\nEOF"
    )
    assert parse_tsplib(text).length([0, 1, 2]) == 6.0


def test_empty_text() -> None:
    with pytest.raises(ValueError, match="empty: there must be a line TYPE : "):
        parse_tsplib("", "empty")


LINES = st.sampled_from(
    [
        *SMALL.splitlines(),
        *matrix("UPPER_ROW", "1 2 3 4 5 6").splitlines(),
        "TOUR_SECTION",
        "DISPLAY_DATA_SECTION",
        "-1",
        "DIMENSION : 999999999999",
        "EDGE_WEIGHT_TYPE : GEO",
        "EDGE_WEIGHT_FORMAT : FULL_MATRIX",
        "1e400 nan -inf",
        ": :",
        "",
    ]
)
TEXTS = st.one_of(
    st.lists(LINES, max_size=14).map("\n".join),
    st.text(max_size=200),
    st.binary(max_size=200).map(lambda raw: raw.decode("utf-8", errors="replace")),
    st.tuples(st.integers(0, len(SMALL)), st.text(max_size=5)).map(
        lambda cut: SMALL[: cut[0]] + cut[1] + SMALL[cut[0] + len(cut[1]) :]
    ),
)


@settings(max_examples=300, deadline=None)
@given(text=TEXTS)
@example(text="EOF")
@example(text="NODE_COORD_SECTION")
@example(text="\x00")
def test_any_text_is_read_or_refused(text: str) -> None:
    for parse in (parse_tsplib, parse_tour):
        message = "TSPLIB text: "
        try:
            found = parse(text)
            assert len(getattr(found, "distances", found)) >= 2
        except ValueError as error:
            message = str(error)
        assert message.startswith("TSPLIB text: ")
        assert "\n" not in message
