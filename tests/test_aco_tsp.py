"""The benchmark on the travelling salesman problem: its rows, its table, its errors.

Rivals are not installed here: a small program stands in for ACOTSP, and a class for
colonyx.
"""

from __future__ import annotations

import json
import runpy
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

FOLDER = Path(__file__).resolve().parent.parent / "benchmarks"
SCRIPT = FOLDER / "aco_tsp.py"
bench = SimpleNamespace(**runpy.run_path(str(SCRIPT)))

STAND_IN = f"""#!{sys.executable}
import sys
given = dict(zip(sys.argv[1::2], sys.argv[2::2]))
print(" ".join(sys.argv[1:]), file=open({{log!r}}, "w"))
print("try 0, Best 10700, found at iteration 3, found at time 0.01")
print(" t_avgtotal = 0.250000")
"""


def output_of(capsys: pytest.CaptureFixture[str], *arguments: str) -> Any:
    assert bench.main([*arguments, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_rows(capsys: pytest.CaptureFixture[str]) -> None:
    """48 ants of Ant System make 48 tours a trial, 10 of Ant Colony System 10."""
    names = ("--algorithms", "as", "acs", "mmas", "q-learning")
    found = output_of(capsys, *names, "--tours", "200", "--seeds", "2")
    assert (found["instance"], found["optimum"]) == ("att48", 10_628)
    rows = found["rows"]
    assert [(row["algorithm"], row["seed"], row["tours"]) for row in rows] == [
        *(("as", 0, 240), ("as", 1, 240), ("acs", 0, 200), ("acs", 1, 200)),
        *(("mmas", 0, 240), ("mmas", 1, 240)),
        *(("q-learning", 0, 200), ("q-learning", 1, 200)),
    ]
    for row in rows:
        assert row["seconds"] > 0
        # The longest arcs of att48 measure 2,662; no tour is longer than 48 of them.
        assert 10_628 <= row["best"] < 48 * 2_662
    again = output_of(capsys, *names, "--tours", "200", "--seeds", "1", "--seed", "1")
    assert [row["best"] for row in again["rows"]] == [row["best"] for row in rows[1::2]]


def test_local_search_and_the_optimum(capsys: pytest.CaptureFixture[str]) -> None:
    """MMAS with 3-opt solves att48 within some of the 2,400 tours, and ends there."""
    found = output_of(
        capsys,
        *("--algorithms", "mmas", "--local-search", "3-opt", "--seeds", "1"),
        *("--tours", "2400", "--stop-at-optimum"),
    )
    (row,) = found["rows"]
    assert row["best"] == 10_628
    assert row["tours"] < 2_400


def test_a_limit_on_seconds(capsys: pytest.CaptureFixture[str]) -> None:
    names = ("--algorithms", "as", "q-learning", "--seeds", "1")
    found = output_of(capsys, *names, "--tours", "99999999", "--seconds", "0.01")
    assert all(row["seconds"] < 5 for row in found["rows"])


@pytest.mark.slow
def test_dqn(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """It only makes tours: any other action would be an error of the environment."""
    pytest.importorskip("torch")
    file = tmp_path / "six.tsp"
    points = "".join(f"{i + 1} {i % 3} {i // 3}\n" for i in range(6))
    file.write_text(
        "NAME: six\nTYPE: TSP\nDIMENSION: 6\nEDGE_WEIGHT_TYPE: EUC_2D\n"
        f"NODE_COORD_SECTION\n{points}EOF\n"
    )
    command = [sys.executable, str(SCRIPT), "--tsplib", str(file), "--json"]
    done = subprocess.run(
        [*command, "--algorithms", "dqn", "--tours", "60", "--seeds", "1"],
        capture_output=True,
        text=True,
        check=True,
    )
    found = json.loads(done.stdout)
    assert (found["instance"], found["optimum"]) == ("six", None)
    (row,) = found["rows"]
    assert row["tours"] == 60
    # Round two rows of three points at distance 1; three more is chance at its worst.
    assert 6 <= row["best"] < 9


def test_acotsp(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    program, log = tmp_path / "acotsp", tmp_path / "log"
    program.write_text(STAND_IN.format(log=str(log)))
    program.chmod(0o755)
    arguments = ("--algorithms", "acotsp", "mmas", "--acotsp", str(program))
    found = output_of(capsys, *arguments, "--seeds", "1", "--tours", "100")
    rival, mine = found["rows"]
    assert rival == {
        "algorithm": "acotsp mmas",
        "seed": 0,
        "tours": 144,  # three trials of 48 ants
        "seconds": 0.25,
        "best": 10_700,
    }
    assert (mine["algorithm"], mine["tours"]) == ("mmas", 144)
    said = log.read_text()
    assert "--mmas --tries 1 --seed 1 --ants 48 --quiet --rho 0.02" in said
    assert "--localsearch 0 --time 0.001 --tours 100" in said
    assert "att48.tsp" in said


def test_a_program_that_is_not_acotsp(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--algorithms", "acotsp", "--acotsp", sys.executable, "--seeds", "1"]
    assert bench.main(arguments) == 2
    said = capsys.readouterr().err
    assert said.startswith("aco_tsp.py: --acotsp must be the program ACOTSP 1.03, ")
    assert said.count("\n") == 1


class Colony:
    """As colonyx has it."""

    def __init__(self, **options: Any) -> None:
        self.options = options

    def fit(self, distances: Any) -> None:
        assert distances.shape == (48, 48)

    def score(self) -> float:
        return 11_000.0


def test_colonyx(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    made = []

    def ant_colony(**options: Any) -> Colony:
        made.append(options)
        return Colony(**options)

    stand_in = SimpleNamespace(AntColony=ant_colony, __spec__=object())
    monkeypatch.setitem(sys.modules, "colonyx", stand_in)
    arguments = ("--algorithms", "colonyx", "--seeds", "1", "--tours", "100")
    rows = output_of(capsys, *arguments)["rows"]
    assert [(row["algorithm"], row["tours"]) for row in rows] == [
        *(("colonyx as", 144), ("colonyx acs", 100), ("colonyx mmas", 144))
    ]
    assert made[0] == {
        "n_ants": 48,
        "n_iterations": 3,
        "rho": 0.5,
        "use_two_opt": False,
        "variant": "basic",
        "random_state": 0,
    }


def test_the_table_has_means_and_medians() -> None:
    rows = [
        bench.result("as", seed, 1_000, seconds, best)
        for seed, (seconds, best) in enumerate([(1.0, 110), (2.0, 120), (4.0, 130)])
    ]
    last = bench.table(rows, 100.0).splitlines()[-1]
    assert last == "| as | 3 | 120.0 | 10.0 | 110 | 20.00% | 500 | 2 |"
    unknown = bench.table([bench.result("acotsp as", 0, None, 1.5, 110)], None)
    assert unknown.splitlines()[-1] == "| acotsp as | 1 | 110.0 |  | 110 |  |  | 1.5 |"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--algorithms", "acotsp"], "acotsp needs --acotsp PATH"),
        (["--algorithms", "acotsp", "--acotsp", "nowhere"], "got 'nowhere'"),
        (["--tsplib", "nowhere.tsp"], "nowhere.tsp"),
    ],
)
def test_what_cannot_be_run(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert bench.main(arguments) == 2
    said = capsys.readouterr().err
    assert said.startswith("aco_tsp.py: ")
    assert message in said


@pytest.mark.parametrize("value", ["0", "-1", "many", "nan"])
def test_wrong_numbers(value: str, capsys: pytest.CaptureFixture[str]) -> None:
    for option in ("--seconds", "--tours", "--ants"):
        with pytest.raises(SystemExit, match="2"):
            bench.main([option, value])
        assert f"got '{value}'" in capsys.readouterr().err


def test_an_unknown_optimum(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "two.tsp"
    file.write_text(
        "NAME: two\nTYPE: ATSP\nDIMENSION: 2\nEDGE_WEIGHT_TYPE: EXPLICIT\n"
        "EDGE_WEIGHT_FORMAT: FULL_MATRIX\nEDGE_WEIGHT_SECTION\n0 3\n4 0\nEOF\n"
    )
    assert bench.main(["--tsplib", str(file), "--stop-at-optimum"]) == 2
    assert "give it by --optimum" in capsys.readouterr().err
    arguments = ("--tsplib", str(file), "--optimum", "7", "--stop-at-optimum")
    found = output_of(capsys, *arguments, "--seeds", "1", "--algorithms", "as")
    assert found["optimum"] == 7
    assert [row["best"] for row in found["rows"]] == [7]
