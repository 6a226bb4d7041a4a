"""What is printed: at any width, in any encoding, also from a zip file."""

from __future__ import annotations

import os
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import pytest

import acl_gym
from acl_gym.envs import ENVIRONMENTS
from acl_gym.experiments import names
from tests.cli.runner import ROOT, SMALL, invoke


@pytest.mark.parametrize("width", [60, 80, 120])
def test_environments_fit_the_terminal(
    width: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    shown = {each: invoke("envs", each).stdout for each in ENVIRONMENTS}
    shown["all"] = invoke("envs").stdout
    monkeypatch.setenv("COLUMNS", "10000")
    for each, text in shown.items():
        assert max(map(len, text.splitlines())) <= width
        wide = invoke("envs", *([] if each == "all" else [each])).stdout
        assert text.split() == wide.split(), "no word is cut"


@pytest.mark.parametrize("command", ["", "train", "evaluate", "envs", "compare"])
def test_help_fits_the_terminal(command: str) -> None:
    text = invoke(*filter(None, [command, "--help"])).stdout
    assert max(map(len, text.splitlines())) <= 80


SHOW_EACH = """
import sys
from acl_gym.cli import main
for arguments in ["envs"], ["train", "--help"], ["--help"], ["evaluate", "\u03bb.npz"]:
    sys.argv = ["acl-gym", *arguments]
    try:
        main()
    except SystemExit as end:
        assert end.code == (2 if "evaluate" in arguments else 0), (arguments, end.code)
"""


@pytest.mark.parametrize("encoding", ["ascii", "cp1252"])
def test_letters_that_cannot_be_shown(encoding: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", SHOW_EACH],
        env={
            **os.environ,
            "PYTHONIOENCODING": encoding,
            "PYTHONUTF8": "0",
            "PYTHONPATH": str(ROOT),
        },
        capture_output=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert b"Traceback" not in done.stderr
    # Typer takes ASCII for a mistake and writes UTF-8 there.
    known = "utf-8" if encoding == "ascii" else encoding
    assert "Examples:" in done.stdout.decode(known)
    assert "npz" in done.stderr.decode(known)


def test_the_list_of_environments_from_a_zip_file(tmp_path: Path) -> None:
    archive, source = tmp_path / "bundle.zip", Path(acl_gym.__file__).parent
    with zipfile.ZipFile(archive, "w") as bundle:
        for path in source.rglob("*.py"):
            bundle.write(path, Path("acl_gym") / path.relative_to(source))
    done = subprocess.run(
        [sys.executable, "-m", "acl_gym", "envs"],
        env={**os.environ, "PYTHONPATH": str(archive)},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert all(each in done.stdout for each in ENVIRONMENTS)
    bad = subprocess.run(
        [sys.executable, "-m", "acl_gym", "train", "CartPole-v1", "--param", "x=1"],
        env={**os.environ, "PYTHONPATH": str(archive)},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert "--param has no 'x'; choose from" in bad.stderr


WRONG = [
    ["trian"],
    ["train", "CartPol-v1"],
    ["train", "CartPole-v1", "--agent", "sarsa"],
    ["train", "CartPole-v1", "--param", "speed=1"],
    ["train", "CartPole-v1", "--param", "deposit=rnak"],
    ["reproduce", "fig39"],
    ["compare", "--env", "CartPol-v1"],
    ["compare", "--agents", "sarsa"],
    ["envs", "CartPole-v1"],
]
REFUSE_EACH = f"""
import sys
from acl_gym.cli.app import app
for arguments in {WRONG}:
    try:
        app(arguments, prog_name="acl-gym")
    except SystemExit as end:
        assert end.code == 2, end.code
    heavy = {{"torch", "numba", "matplotlib", "pandas"}} & set(sys.modules)
    assert not heavy, (arguments, heavy)
    print("end of", arguments, file=sys.stderr)
"""


def test_wrong_names_are_answered_before_anything_slow_is_imported() -> None:
    done = subprocess.run(
        [sys.executable, "-c", REFUSE_EACH],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    lines = done.stderr.splitlines()
    assert lines[1::2] == [f"end of {arguments}" for arguments in WRONG]
    assert all(line.startswith("acl-gym: ") for line in lines[::2])


def test_the_names_are_those_that_there_are() -> None:
    from acl_gym.experiments.reproduce import EXPERIMENTS

    assert tuple(each.name for each in EXPERIMENTS) == names.EXPERIMENTS


@pytest.mark.parametrize(
    "arguments",
    [
        ["reproduce", "--list"],
        ["envs", "--json"],
        [*SMALL, "--out", "a"],
        [*SMALL, "--out", "a", "--json"],
    ],
)
def test_a_reader_that_goes_away(arguments: list[str], tmp_path: Path) -> None:
    """As in `| head`: no traceback, and not the code of a run that failed."""
    with subprocess.Popen(
        [sys.executable, "-m", "acl_gym", *arguments],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as process:
        assert process.stdout is not None
        process.stdout.close()
        assert process.stderr is not None
        said = process.stderr.read()
    assert b"Error" not in said
    assert b"Traceback" not in said
    assert process.returncode == 141
    assert Path("a.npz").exists() == ("--out" in arguments)


def test_progress_without_a_terminal_is_plain_lines(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("acl_gym.cli.keeping.PROGRESS_SECONDS", 0.0)
    shown = invoke(*SMALL)
    assert "\r" not in shown.output
    lines = shown.stderr.splitlines()
    assert [line.split(",")[0] for line in lines] == [
        f"acl-gym: trial {k} of 5" for k in range(1, 6)
    ]
    assert "policy cost" not in lines[0]
    assert "ants' cost" in lines[0]
    assert "policy cost" in lines[2]
    for quiet in ("--quiet", "--json"):
        assert invoke(*SMALL, quiet).stderr == ""


def test_lines_of_progress_are_seconds_apart() -> None:
    began = time.monotonic()
    shown = invoke(*SMALL)
    assert len(shown.stderr.splitlines()) <= (time.monotonic() - began) / 5


def test_a_report_of_a_folder_that_is_not_there(tmp_path: Path) -> None:
    done = invoke("report", str(tmp_path / "no"))
    assert done.exit_code == 2
    assert "there is no folder" in done.stderr
