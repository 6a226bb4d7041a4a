"""The maps that come with the package, the program that made them, and a user's own."""

import subprocess
import sys
from importlib import resources
from typing import Any

import numpy as np
import pytest
from hypothesis import given

from acl_gym.envs.grid_search import maps
from acl_gym.envs.grid_search.maps import (
    MAPS,
    checked_map,
    goal_distances,
    load_map,
    make_map,
)
from tests.envs.grid_search import reference_grid as reference

FREE_CELLS = {"11x11": 86, "21x21": 278, "31x31": 640}  # §3.6.8
MEAN_PATHS = {"11x11": 9.99, "21x21": 19.85, "31x31": 19.97}  # as documented


@pytest.mark.parametrize("name", MAPS)
def test_the_program_makes_the_files(name: str) -> None:
    file = resources.files("acl_gym.envs.grid_search") / "layouts" / f"{name}.txt"
    assert file.read_text(encoding="ascii") == "\n".join(make_map(**MAPS[name])) + "\n"


@pytest.mark.parametrize("name", MAPS)
def test_maps_are_what_the_thesis_says(name: str) -> None:
    rows = load_map(name)
    size = int(name.split("x", maxsplit=1)[0])
    assert len(rows) == size
    assert {len(row) for row in rows} == {size}
    text = "".join(rows)
    assert set(text) == {"#", ".", "G"}
    assert text.count(".") == FREE_CELLS[name]
    assert text.count("G") == 1
    assert rows[size // 2][size // 2] == "G"
    assert min(reference.distances(rows)) == 0  # every cell has a way
    assert reference.mean_path(rows) == pytest.approx(MEAN_PATHS[name], abs=0.005)
    assert MEAN_PATHS["11x11"] == pytest.approx(10.0, abs=0.3)


@pytest.mark.parametrize("name", MAPS)
def test_no_dead_ends_and_no_lone_obstacles(name: str) -> None:
    rows = load_map(name)
    for kind in ("#", ".G"):
        same = {
            (i, j)
            for i, row in enumerate(rows)
            for j, character in enumerate(row)
            if character in kind
        }
        for i, j in same:
            near = {(i + down, j + right) for down, right in reference.STEPS.values()}
            assert len(near & same) >= (1 if kind == "#" else 2)


def test_other_maps_can_be_made() -> None:
    rows = make_map(9, 56, seed=3, mean_path=7.0)
    assert rows == make_map(9, 56, seed=3, mean_path=7.0) != make_map(9, 56, seed=3)
    assert "".join(rows).count(".") == 56
    assert reference.mean_path(rows) == pytest.approx(7.0, abs=0.05)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"size": 10}, "size must be odd"),
        ({"size": 3}, "size must be at least 5"),
        ({"free_cells": 0}, "free_cells must be at least 1"),
        ({"free_cells": 81}, "no map of size 9 with 81 free cells"),
        ({"free_cells": 9}, "no map of size 9 with 9 free cells"),
        ({"mean_path": 1.0}, "mean_path 1.0 was found"),
        ({"mean_path": float("nan")}, "mean_path must lie in"),
    ],
)
def test_impossible_maps_are_refused(
    arguments: dict[str, Any], message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(maps, "_ATTEMPTS", 5)
    with pytest.raises(ValueError, match=message):
        make_map(**{"size": 9, "free_cells": 56, "seed": 1, **arguments})


def test_printed_by_the_module() -> None:
    command = [sys.executable, "-m", "acl_gym.envs.grid_search"]
    printed = subprocess.run(command, check=True, capture_output=True, text=True)
    for name in MAPS:
        assert "\n".join([name, *load_map(name), ""]) in printed.stdout


@given(reference.worlds())
def test_distances_are_those_of_a_plain_search(rows: tuple[str, ...]) -> None:
    characters = np.array([list(row) for row in rows])
    ours = goal_distances(characters != "#", characters == "G")
    assert ours[characters != "#"].tolist() == reference.distances(rows)
    assert (ours[characters == "#"] == -1).all()


@given(reference.worlds())
def test_own_maps_are_taken_as_text_and_as_rows(rows: tuple[str, ...]) -> None:
    text = "\n".join(f"    {row} " for row in rows)
    assert checked_map(rows) == checked_map(list(rows)) == rows
    assert checked_map(f"\n{text}\n\n") == rows


@pytest.mark.parametrize(
    ("desc", "message"),
    [
        (["..", ".x", ".G"], r"'x' in row 1, column 1 \(from 0\)"),
        (["..", "...", ".G"], "3 cells in row 1 and 2 in row 0; fill up"),
        ("..\n\n.G", "0 cells in row 1"),
        (["..", ".."], "got no goal in 2 rows of 2 columns"),
        (["GG", "G#"], "got no free cell"),
        ("", "got no goal"),
        ([], "got no goal in 0 rows"),
        ([".G#.", "..#."], r"the '\.' in row 0, column 3 .* no way to a goal; open a"),
        ([".G#", "..#", "##G"], r"the 'G' in row 2, column 2 .* no way out or in"),
    ],
)
def test_bad_maps_are_refused(desc: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        checked_map(desc)


@pytest.mark.parametrize("desc", [1, [1, 2], [[".", "G"]], b".G", {".G": 1}, None])
def test_what_is_no_text_is_refused(desc: Any) -> None:
    with pytest.raises(TypeError, match="desc must be the text of a map"):
        checked_map(desc)
