"""The command `acl-gym design`."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acl_gym.cli.design import _free_folder
from acl_gym.cli.design_help import EXAMPLES, example
from acl_gym.cli.recorded import split_names
from acl_gym.design.recordings import Recording, plant_of_recording
from tests.cli.runner import STARTED, figures, invoke, refused, run

# A mass on a line is brought to rest; learned in a second.
PLANT = """
import acl_gym

env = acl_gym.plant(
    lambda x, u: [x[1], u[0]], low=[-1, -1], high=[1, 1], inputs={inputs},
    sampling_time=0.1, goal=[0, 0], tolerance=[0.2, 0.2], cost=([1, 0.1], 0.01),
    max_episode_steps=40,
)
"""


def plant(inputs: str = "[-1, 0, 1]") -> str:
    Path("mass.py").write_text(PLANT.format(inputs=inputs))
    return "mass.py"


def test_a_file_becomes_a_folder() -> None:
    result = invoke("design", plant(), "--steps", "2500", "--seed", "1")
    assert result.exit_code == 0, result.output
    assert "The goal is reached from" in result.stdout
    assert "settling time, s" in result.stdout
    folder = Path("mass-design")
    assert str(folder / "policy.h") in result.stdout
    assert (folder / "plant.py").read_text() == Path("mass.py").read_text()
    summary = json.loads((folder / "summary.json").read_text())
    assert {"cost", "success_rate", "seconds"} <= set(summary)
    # The command in the summary gives the same again, in the same folder.
    command = summary["command"].split()
    assert command[:3] == ["acl-gym", "design", "mass.py"]
    before = (folder / "policy.h").read_bytes()
    (folder / "policy.h").unlink()
    again = figures(*command[1:])
    assert (folder / "policy.h").read_bytes() == before
    assert again["cost"] == summary["cost"]
    assert _free_folder("mass") == Path("mass-design-2")  # of another one


def test_a_goal_out_of_reach_is_1_and_says_what_to_try() -> None:
    result = invoke(
        "design", plant("[-0.01, 0.01]"), "--out", "weak", "--steps", "1000"
    )
    assert result.exit_code == 1
    # On a busy machine its progress is reported as well.
    lines = [line for line in result.stderr.splitlines() if ": learning, " not in line]
    assert len(lines) == 1
    assert "less than 95%. What to try: " in lines[0]
    assert "the worst start" in lines[0]
    assert json.loads(Path("weak", "summary.json").read_text())["reaches_goal"] is False


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nothing.py"], "there is no file nothing.py"),
        (["broken.py"], "broken.py, line 1 is not Python: '(' was never closed"),
        (["empty.py"], "must make a plant and keep it in a name"),
        (["."], "must be a Python file"),
        ([], "give either a file that describes a plant"),
        (["mass.py", "--example", "pendulum"], "give either a file"),
        (["--example", "pendulun"], "Did you mean 'pendulum'?"),
        (["--show", "nothing"], "--show must be one of 'pendulum'"),
        (["mass.py", "--seconds", "0"], "--seconds must be a number > 0, got 0"),
        (["mass.py", "--out", "mass.py"], "mass.py is a file"),
        (["mass.py", "--out", "a/b"], "there is no folder a"),
        (["mass.py", "--state", "x"], "--state describes measurements"),
        (["data.csv"], "--state is missing"),
        (
            ["none.csv", *["--state", "x", "--input", "u", "--goal", "0"]],
            "time between two rows",
        ),
    ],
)
def test_bad_arguments_are_one_line_and_2(arguments: list[str], message: str) -> None:
    plant()
    Path("broken.py").write_text("x = (")
    Path("empty.py").write_text("")
    assert message in refused(2, "design", *arguments)
    assert not list(Path().glob("*-design"))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--goal a,0", "--goal must be numbers such as 3.14,0, got 'a,0'"),
        ("--goal 1", "goal must hold a number for each of the 2 columns"),
        ("--cost 1", "--cost must be time, or weights"),
        ("--low 1", "low must hold a number, or nothing, for each of the 2"),
        ("--state place,sped", "must have a column 'sped'"),
        ("--circular height", "circular must hold names"),
        ("--starts 1,0", "--starts must be the lower and the upper ends"),
        ("--starts 0,0:1", "starts must hold 2 lower and 2 upper ends"),
        ("--starts 1,0:0,1", "finite and low <= high"),
        ("--starts 0,0:1,inf", "finite and low <= high"),
        ("--starts 0,0:1,99", "initial must lie within low and high, variable 1"),
        ("--actions 1,2", "inputs must hold a row of 1 numbers"),
    ],
)
def test_bad_words_about_measurements(options: str, message: str) -> None:
    record("data.csv", 20)
    usual = [
        "--state",
        "place,speed",
        "--input",
        "force",
        "--goal",
        "0,0",
        "--time",
        "t",
        "--run",
        "run",
    ]
    assert message in refused(2, "design", "data.csv", *usual, *options.split())


def test_starts_of_measurements_lie_where_they_are_wanted() -> None:
    record("data.csv", 20)
    columns: dict[str, Any] = {
        "state": ("place", "speed"),
        "input": ("force",),
        "goal": (0.0, 0.0),
    }
    known: dict[str, Any] = {
        **columns,
        "time": "t",
        "run": "run",
        "tolerance": (0.1, 0.1),
    }
    box = ((0.3, -0.2), (0.6, 0.2))
    system = plant_of_recording("data.csv", Recording(**known, starts=box)).system
    drawn = system.sample_states(np.random.default_rng(0), 500).T
    np.testing.assert_array_less(np.tile(box[0], (500, 1)), drawn)
    np.testing.assert_array_less(drawn, np.tile(box[1], (500, 1)))
    assert np.ptp(drawn, axis=0) == pytest.approx([0.3, 0.4], rel=0.05)
    # Without them, recorded states.
    system = plant_of_recording("data.csv", Recording(**known)).system
    recorded = np.loadtxt("data.csv", delimiter=",", skiprows=1)[:, 2:4]
    drawn = system.sample_states(np.random.default_rng(0), 50).T
    apart = np.abs(drawn[:, None] - recorded).max(axis=2).min(axis=1)
    assert apart.max() < 1e-9


def record(name: str, runs: int) -> None:
    """A table of a mass on a line under random forces, eight rows a run."""
    rng = np.random.default_rng(0)
    rows = ["run,t,place,speed,force"]
    for number in range(runs):
        place, speed = rng.uniform(-1.0, 1.0, 2)
        for step in range(8):
            force = rng.integers(-1, 2)
            rows.append(f"{number},{0.1 * step:.1f},{place},{speed},{force}")
            place += 0.1 * speed + 0.005 * force
            speed += 0.1 * force
    Path(name).write_text("\n".join(rows))


def test_measurements_become_a_folder() -> None:
    record("data.csv", 40)
    words = "--state place,speed --input force --time t --run run --goal 0,0"
    words += " --tolerance 0.2,0.2 --cost 1,0.1:0.01 --low -1,-1 --high 1,1"
    words += " --max-steps 40 --steps 2500 --starts -0.9,-0.8:0.9,0.8"
    summary = figures("design", "data.csv", *words.split())
    assert summary["success_rate"] >= 0.95
    model = summary["model"]
    assert (model["steps"], model["runs"]) == (280, 40)
    assert model["errors"]["speed"] < 0.05
    assert model["sampling_time"] == pytest.approx(0.1)
    folder = Path("data-design")
    assert (folder / "model.png").exists()
    assert (folder / "data.csv").read_text() == Path("data.csv").read_text()
    page = (folder / "report.html").read_text()
    assert "280 recorded steps in 40 runs" in page
    assert "What was assumed" in page
    assert model["starts"] == [[-0.9, -0.8], [0.9, 0.8]]
    assert "states between -0.9, -0.8 and 0.9, 0.8, as <code>--starts</code>" in page
    assert "--starts=-0.9,-0.8:0.9,0.8" in summary["command"]
    assert -0.9 <= summary["worst_start"][0] <= 0.9


@pytest.mark.filterwarnings("ignore::acl_gym.envs.learned.DataWarning")
def test_a_model_that_predicts_nothing_is_1_and_says_what_to_do() -> None:
    """An angle in degrees, described as one in radians."""
    rng = np.random.default_rng(0)
    rows, angle, speed = ["t,angle,speed,force"], 0.0, 0.0
    for step in range(200):
        if step % 5 == 0:
            force = rng.integers(-1, 2)
        rows.append(f"{0.1 * step:.1f},{np.degrees(angle)},{speed},{force}")
        angle += 0.1 * speed
        speed += 0.1 * (10.0 * force - np.sin(angle) - 0.2 * speed)
    Path("data.csv").write_text("\n".join(rows))
    words = "--state angle,speed --circular angle --input force --time t --goal 0,0"
    words += " --tolerance 3,9 --steps 1500 --quiet"
    result = invoke("design", "data.csv", *words.split())
    assert result.exit_code == 1, result.output
    last = result.stderr.splitlines()[-1]
    assert "the model does not predict angle: its error in cross-val" in last
    assert "figures say nothing about the plant" in last
    assert (
        "Repair the recording or its description: the angle angle goes through" in last
    )
    assert "give --low and --high such as 0 and 360" in last
    assert "Errors in cross-validation" in result.stdout
    assert "Its spread on the paths of the policy" in result.stdout
    page = Path("data-design", "report.html").read_text()
    assert "These figures say nothing about the plant" in page


def test_names_with_a_comma_stand_in_double_quotes() -> None:
    assert split_names('theta, "U Motor, V" ,omega') == ["theta", "U Motor, V", "omega"]
    assert split_names("angle\n,") == ["angle", ""]
    record("data.csv", 20)
    text = Path("data.csv").read_text()
    Path("data.csv").write_text(text.replace("speed,force", 'speed,"force, N"'))
    words = ["--state", "place,speed", "--time", "t", "--run", "run", "--goal", "1"]
    # The columns are found, so that the next fault is the one that is told.
    quoted = refused(2, "design", "data.csv", *words, "--input", '"force, N"')
    assert "goal must hold a number for each of the 2 columns" in quoted
    words[-1] = "0,0"
    bare = refused(2, "design", "data.csv", *words, "--input", "force, N")
    assert "stands in double quotes, such as '\"force, N\"'" in bare


def test_show_prints_a_file_that_can_be_used() -> None:
    for name in EXAMPLES:
        shown = invoke("design", "--show", name)
        assert shown.exit_code == 0
        assert shown.stdout == example(name)


def test_help_teaches_with_a_complete_file() -> None:
    shown = invoke("design", "--help")
    assert shown.exit_code == 0
    text = [line.strip() for line in shown.stdout.splitlines()]
    for line in example("pendulum").splitlines():
        assert line.strip() in text, line
    for name in EXAMPLES:
        assert name in shown.stdout


def test_a_plant_that_fails_while_learning_is_one_line_and_1() -> None:
    Path("mass.py").write_text(
        PLANT.format(inputs="[-1, 1]").replace(
            "[x[1], u[0]]", "[x[1] / (x[0] < 0.9), u[0]]"
        )
    )
    line = refused(1, "design", "mass.py", "--quiet")
    assert "the dynamics gave no finite next state in slot" in line
    assert not Path("mass-design").exists()


@pytest.mark.skipif(sys.platform == "win32", reason="sends a signal")
def test_ctrl_c_keeps_the_best_so_far(tmp_path: Path) -> None:
    plant()
    command = [sys.executable, "-c", STARTED, "design", "mass.py", "--out", "kept"]
    process = subprocess.Popen(
        [*command, "--steps", "100000000"],
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        # A line every five seconds says that there is a policy.
        while "learning, " not in (line := process.stderr.readline()):
            assert line, "it has ended"
        process.send_signal(signal.SIGINT)
        _, words = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 130, words
    assert "interrupted" in words.splitlines()[-1]
    assert "best controller so far is in kept" in words
    assert Path("kept", "policy.h").exists()


def test_an_example_in_a_new_interpreter() -> None:
    done = run("design", "--example", "pendulum", "--steps", "6000", cwd=Path())
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert Path("pendulum-design", "report.html").exists()
