"""acl-gym reproduce and report."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.runner import figures, invoke, refused

SMALL = ["reproduce", "fig3.9", "--runs", "2", "--workers", "1"]


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.usefixtures("short_runs")
def test_a_figure_and_its_report(tmp_path: Path) -> None:
    found = figures(*SMALL, "--out", "r")
    assert found["runs"] == 2
    (experiment,) = found["experiments"]
    assert experiment["name"] == "fig3.9"
    assert [s["label"] for s in experiment["studies"]] == ["M = 1", "M = 5", "M = 9"]
    verdicts = {claim["claim"]: claim["verdict"] for claim in found["claims"]}
    # Two runs decide nothing, but their figures are reported.
    assert verdicts["C5"] == verdicts["C13"] == "undecided"
    parts = {claim["claim"]: claim["parts"] for claim in found["claims"]}
    assert parts["C5"]
    assert not parts["C13"]
    folder = tmp_path / "r"
    for name in (
        "report.html",
        "results.json",
        "results.parquet",
        "figures/fig3.9.png",
        "curves/fig3.9.js",
    ):
        assert (folder / name).is_file()
    table = (folder / "claims.md").read_text()
    assert "| C5 |" in table
    assert "| C13 |" not in table, "none of its experiments was run"
    assert not list(folder.glob("*.lock")), "the one lock is that of the runs"
    files = sorted((folder / "runs").glob("*.parquet"))
    assert len(files) == 6
    before = [path.stat().st_mtime_ns for path in files]

    everything = [path for path in folder.rglob("*") if path.is_file()]
    times = [path.stat().st_mtime_ns for path in everything]
    again = invoke(*SMALL, "--out", "r")
    assert again.exit_code == 0, again.output
    assert "Nothing to do" in again.stdout
    assert "Report" in again.stdout
    assert [path.stat().st_mtime_ns for path in everything] == times

    # What is missing is made, and nothing else.
    for name in ("figures/fig3.9.png", "curves/fig3.9.js"):
        (folder / name).unlink()
        again = invoke(*SMALL, "--out", "r")
        assert "Nothing to do" not in again.stdout
        assert (folder / name).is_file()
    assert [path.stat().st_mtime_ns for path in files] == before

    # Whoever wants no figures leaves those that are there, of these results.
    again = invoke(*SMALL, "--out", "r", "--no-figures")
    assert "Nothing to do" in again.stdout
    assert (folder / "figures" / "fig3.9.png").is_file()

    (folder / "report.html").unlink()
    written = figures("report", str(folder))
    assert written["report"] == str(folder / "report.html")
    assert written["claims"] == verdicts
    assert (folder / "report.html").is_file()


@pytest.mark.usefixtures("short_runs")
def test_results_replace_what_was_made_of_others_only(tmp_path: Path) -> None:
    for name in ("fig3.9.svg", "fig5.4.png", "holiday.png"):
        path = tmp_path / "r" / "figures" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    again = invoke(*SMALL, "--out", "r", "--no-figures")
    assert again.exit_code == 0, again.output
    assert [path.name for path in path.parent.iterdir()] == ["holiday.png"]


def test_the_list() -> None:
    lines = invoke("reproduce", "--list").stdout.splitlines()
    assert any(line.startswith("fig5.4 ") and "C14" in line for line in lines)
    rows = figures("reproduce", "claims", "--list")
    assert {"fig5.4", "fig3.6"} <= {row["name"] for row in rows}
    assert "fig3.7" not in {row["name"] for row in rows}


def test_bad_arguments() -> None:
    assert "Did you mean 'fig3.9'?" in refused(2, "reproduce", "fig39")
    assert "--executor must be one of 'local', 'ray'" in refused(
        *(2, "reproduce", "fig3.9", "--executor", "slurm")
    )
    assert "there is no folder" in refused(2, "report", "/no/such/folder")
    refused(2, "reproduce", "fig3.9", "--runs", "0")
