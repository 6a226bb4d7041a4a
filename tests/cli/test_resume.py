"""Runs that stop and go on: nothing is lost, nothing counts double."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acl_gym import ACL
from acl_gym.cli.agents import load_agent
from tests.cli.runner import MODULE, PENDULUM, STARTED, figures, invoke, refused

RUN = ["train", PENDULUM, "--ants", "10", "--cells", "6,7", "--evaluate-every", "3"]
RUN += ["--agent", "acl"]
CHANGING = ["--param", "epsilon=linear:0.5:0.01:8", "--param", "alpha=harmonic:3:20"]

SLOW = (
    MODULE.replace("import gymnasium", "import time\nimport gymnasium")
    .replace("        slips =", "        time.sleep(SLEEP)\n        slips =")
    .replace("Corridor-v0", "Slow-v0")
)


def without_seconds(history: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [{k: v for k, v in row.items() if k != "seconds"} for row in history]


def assert_same(one: Any, other: Any) -> None:
    assert one.table.tobytes() == other.table.tobytes()
    assert without_seconds(one.history) == without_seconds(other.history)
    assert one.rng.bit_generator.state == other.rng.bit_generator.state
    assert one.num_timesteps == other.num_timesteps
    assert one.parameters() == other.parameters()


@pytest.mark.parametrize("first", [4, 6])
@pytest.mark.parametrize(
    "more",
    [
        [],
        [*CHANGING, "--param", "update=in_turn"],
        ["--agent", "q-learning", "--param", "trace_decay=0.5"],
        [
            *("--agent", "q-learning", "--param", "replay=2"),
            *("--param", "grows=true", "--param", "optimism=1"),
        ],
        ["--param", "cost=settling_time:0:3.14:0.3+0.1", "--param", "deposit=rank:2"],
        ["--param", "schedule=asynchronous", "--param", "deposit=rank:2"],
        ["--agent", "returning", "--param", "schedule=asynchronous"],
    ],
)
def test_two_parts_are_one_run(first: int, more: list[str], tmp_path: Path) -> None:
    """After trial 4 no evaluation is due, after trial 6 one is."""
    log = tmp_path / "log.csv"
    figures(*RUN, *more, "--trials", "8", "--out", "whole")
    figures(*RUN, *more, "--trials", str(first), "--out", "part", "--log", str(log))
    found = figures(
        *("train", "--resume", "part.npz", "--trials", str(8 - first)),
        *("--log", str(log)),
    )
    assert (found["file"], found["trials"]) == ("part.npz", 8)
    assert_same(load_agent("whole.npz"), load_agent("part.npz"))
    with log.open() as file:
        assert [row["trial"] for row in csv.DictReader(file)] == list("12345678")
    for name in ("policy_cost", "success_rate"):
        assert figures("evaluate", "part.npz")[name] == found[name]


def test_the_best_policy_is_kept() -> None:
    found = figures(*RUN, "--trials", "12", "--seed", "1", "--out", "a")
    costs = [row["policy_cost"] for row in found["rows"] if "policy_cost" in row]
    assert found["best"]["policy_cost"] == min(costs) < found["policy_cost"]
    best = load_agent("a-best.npz")
    assert best.trials == found["best"]["trial"]
    evaluated = figures("evaluate", found["best"]["file"])
    assert evaluated["policy_cost"] == found["best"]["policy_cost"]
    none = figures(*RUN, "--trials", "3", "--out", "b", "--no-keep-best")
    assert none["best"] is None
    assert not Path("b-best.npz").exists()


def test_a_best_policy_that_is_resumed_is_not_replaced() -> None:
    figures(*RUN, "--trials", "3", "--out", "a")
    found = figures("train", "--resume", "a-best.npz", "--trials", "1")
    assert found["file"] == "Pendulum-v0.npz"


def test_the_best_policy_goes_with_the_run_to_another_name() -> None:
    """With seed 2 trials 12 and 13 are both worse than an earlier one."""
    first = figures(*RUN, "--trials", "12", "--seed", "2", "--out", "a")["best"]
    found = figures("train", "--resume", "a.npz", "--trials", "1", "--out", "c")
    last = found["policy_cost"]
    assert last > first["policy_cost"]
    assert found["best"] == {**first, "file": "c-best.npz"}
    assert figures("evaluate", "c-best.npz")["policy_cost"] == first["policy_cost"]
    # Where the best was not kept, what is told is what is in the file.
    Path("a-best.npz").unlink()
    found = figures("train", "--resume", "a.npz", "--trials", "1", "--out", "d")
    assert (found["best"]["trial"], found["best"]["policy_cost"]) == (13, last)
    assert load_agent("d-best.npz").trials == 13


@pytest.mark.filterwarnings("default:.*is not the best policy of this run")
def test_a_best_policy_of_another_run_is_not_trusted() -> None:
    figures(*RUN, "--trials", "12", "--seed", "2", "--out", "a")
    # Of the same environment and trials, but of other ants.
    figures(*RUN, "--trials", "12", "--seed", "3", "--out", "c")
    shown = invoke("train", "--resume", "a.npz", "--trials", "1", "--out", "c")
    assert "c-best.npz was of another run" in shown.stderr
    assert Path("c-best.npz").read_bytes() == Path("a-best.npz").read_bytes()
    Path("a-best.npz").write_bytes(b"of something else")
    shown = invoke("train", "--resume", "a.npz", "--trials", "1")
    assert "a-best.npz is not the best policy of this run" in shown.stderr
    assert load_agent("a-best.npz").trials == 13


def test_what_is_resumed_says_so_and_refuses_what_cannot_change() -> None:
    figures(*RUN, "--trials", "3", "--out", "a")
    shown = invoke("train", PENDULUM, "--resume", "a.npz", "--trials", "2")
    assert "going on after trial 3 for 2 more, to trial 5" in shown.stderr
    for arguments, message in (
        (["--cells", "5"], "--cells and --partition cannot be changed"),
        (["--seed", "7"], "--seed must be 0, as in a.npz"),
        (["--max-steps", "9"], "--max-steps must be 300"),
        (["--agent", "q-learning"], "--agent must be acl"),
        (["--param", "tau0=0.5"], "tau0 is fixed"),
        (["--env-arg", "mass=2"], "--env-arg mass must be as in a.npz"),
        (["--discretize", "3"], "--discretize must be left out"),
    ):
        assert message in refused(2, "train", "--resume", "a.npz", *arguments)
    line = refused(2, "train", "CartPole-v1", "--resume", "a.npz")
    assert "was trained in acl_gym/Pendulum-v0, got CartPole-v1" in line
    changed = figures("train", "--resume", "a.npz", "--param", "epsilon=0.3")
    assert changed["parameters"]["epsilon"] == 0.3
    assert changed["trials"] == 105, "100 more, for the run was complete"


def test_a_deposit_is_left_out_where_an_agent_goes_on_that_needs_none() -> None:
    """A script that always sets one still works with the default agent."""
    arguments = ["train", "CartPole-v1", "--ants", "3", "--max-steps", "20"]
    for more, said in (([], True), (["--param", "deposit=rank:2"], False)):
        figures(*arguments, *more, "--trials", "1", "--out", "a")
        resumed = ["train", "CartPole-v1", "--resume", "a.npz", "--trials", "1"]
        shown = invoke(*resumed, "--param", "deposit=rank:5")
        assert shown.exit_code == 0, shown.output
        assert ("deposit is left out" in shown.stderr) is said
    assert load_agent("a.npz").deposit.exponent == 5
    figures(*arguments, "--trials", "1", "--out", "b")
    resumed = ["train", "--resume", "b.npz", "--agent", "returning"]
    line = refused(2, *resumed, "--param", "deposit=rank:5")
    assert "--param has no 'deposit'" in line


def test_agents_saved_from_python_are_resumed_where_the_user_says() -> None:
    figures(*RUN, "--trials", "3", "--out", "a")
    agent = ACL.load("a.npz")
    agent.metadata = {}
    agent.save("b.npz")
    assert "name it: acl-gym train ENV_ID" in refused(2, "train", "--resume", "b.npz")
    found = figures(
        *("train", PENDULUM, "--resume", "b.npz", "--ants", "10"),
        *("--trials", "1", "--evaluate-every", "3"),
    )
    again = figures("train", "--resume", "a.npz", "--trials", "1")
    assert without_seconds(found["rows"]) == without_seconds(again["rows"])


def start(tmp_path: Path, *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", STARTED, *arguments],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def wait_for_trials(process: subprocess.Popen[str], log: Path, count: int) -> None:
    """Until so many rows are in the log."""
    while process.poll() is None:
        if log.exists() and log.read_text().count("\n") > count:
            return
        time.sleep(0.01)
    raise AssertionError(process.communicate())


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)]
)
def test_a_signal_saves_the_run(number: int, code: int, tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    arguments = [*RUN, "--trials", "1000000", "--out", "a", "--quiet", "--log"]
    process = start(tmp_path, *arguments, str(log))
    wait_for_trials(process, log, 3)
    process.send_signal(number)
    out, err = process.communicate(timeout=60)
    assert (process.returncode, out) == (code, "")
    *_, line = err.splitlines()
    stopped = ACL.load(tmp_path / "a.npz")
    assert line == (
        f"acl-gym: interrupted; the agent is saved after trial {stopped.trials} of "
        "1000000. To go on: acl-gym train --resume a.npz"
    )
    assert [path.name for path in tmp_path.glob(".*")] == [], "no half files"
    whole = figures(*RUN, "--trials", str(stopped.trials + 2), "--out", "whole")
    figures("train", "--resume", "a.npz", "--trials", "2", "--out", "b")
    assert_same(load_agent("whole.npz"), load_agent("b.npz"))
    assert whole["trials"] == stopped.trials + 2


def test_what_was_left_of_a_run_is_the_default(tmp_path: Path) -> None:
    figures(*RUN, "--trials", "3", "--out", "a")
    agent = ACL.load("a.npz")
    agent.metadata["planned_trials"] = 5
    agent.save("a.npz")
    assert figures("train", "--resume", "a.npz")["trials"] == 5


def test_a_trial_that_takes_long_is_given_up(tmp_path: Path) -> None:
    """The agent is saved as it was after the last whole trial, and goes on from there."""
    module = tmp_path / "my_slow.py"
    module.write_text(SLOW.replace("SLEEP", "0.0"))
    arguments = ["train", "my_slow:Slow-v0", "--ants", "3", "--cells", "11"]
    arguments += ["--param", "tau0=0.001", "--evaluate-every", "100", "--out", "a"]
    code = (
        "import my_slow, gymnasium, time; from acl_gym.callbacks import CSVLog\n"
        "end = CSVLog.on_trial_end\n"
        "def slow(self, agent, row):\n"
        "    if row['trial'] == 2: my_slow.time = type('T', (), {'sleep': staticmethod("
        "lambda s: time.sleep(60))})\n"
        "    return end(self, agent, row)\n"
        "CSVLog.on_trial_end = slow\n"
    )
    log = tmp_path / "log.csv"
    with subprocess.Popen(
        [sys.executable, "-c", code + STARTED, *arguments, "--log", str(log)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])},
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        wait_for_trials(process, log, 2)
        time.sleep(0.2)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=50)  # less than one step
    assert process.returncode == 130, err
    assert "saved after trial 2 of 100" in err
    stopped = ACL.load(tmp_path / "a.npz")
    assert (stopped.trials, len(stopped.history)) == (2, 2)
    found = invoke(*arguments[:2], "--resume", "a.npz", "--trials", "2", "--json")
    whole = invoke(*arguments[:-1], "w", "--trials", "4", "--json")
    for result in (found, whole):
        assert result.exit_code == 0, result.output
    assert_same(load_agent("w.npz"), load_agent("a.npz"))


def test_the_second_signal_ends_at_once(tmp_path: Path) -> None:
    """Steps take long once there is a log, so that a trial is under way from then on."""
    log = tmp_path / "log.csv"
    seconds = f"0.05 if __import__('os').path.exists({str(log)!r}) else 0.0"
    (tmp_path / "my_slow.py").write_text(SLOW.replace("SLEEP", seconds))
    arguments = ["train", "my_slow:Slow-v0", "--ants", "2", "--cells", "5"]
    arguments += ["--evaluate-every", "1000"]
    process = start(tmp_path, *arguments, "--param", "tau0=0.001", "--log", str(log))
    while not log.exists():
        assert process.poll() is None, process.communicate()
        time.sleep(0.01)
    time.sleep(0.3)
    began = time.monotonic()
    for _ in range(2):
        process.send_signal(signal.SIGINT)
        time.sleep(0.2)
    _, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert "ended at once, by the second signal" in err
    assert time.monotonic() - began < 2.0, "less than the grace of the first"


@pytest.mark.parametrize("schedule", ["synchronous", "asynchronous"])
def test_only_what_came_after_the_last_checkpoint_is_lost(
    schedule: str, tmp_path: Path
) -> None:
    log = tmp_path / "log.csv"
    run = [*RUN, "--param", f"schedule={schedule}"]
    arguments = [*run, "--trials", "1000000", "--out", "a", "--checkpoint-every", "2"]
    process = start(tmp_path, *arguments, "--quiet", "--log", str(log))
    wait_for_trials(process, log, 5)
    process.kill()
    process.communicate()
    kept = ACL.load(tmp_path / "a.npz").trials
    rows = log.read_text().count("\n") - 1
    assert kept % 2 == 0
    assert rows - 2 <= kept <= rows
    found = figures(
        *("train", "--resume", "a.npz", "--trials", "3", "--log", str(log)),
    )
    figures(*run, "--trials", str(kept + 3), "--out", "whole")
    assert_same(load_agent("whole.npz"), load_agent("a.npz"))
    with log.open() as file:
        trials = [int(float(row["trial"])) for row in csv.DictReader(file)]
    assert trials == list(range(1, found["trials"] + 1)), "no trial twice"


def test_a_run_that_fails_keeps_what_it_has(tmp_path: Path) -> None:
    """A reward that is not finite in the third trial."""
    module = MODULE.replace("Corridor-v0", "Fails-v0").replace(
        "        super().reset(seed=seed)",
        "        super().reset(seed=seed)\n"
        "        Corridor.resets = getattr(Corridor, 'resets', 0) + 1",
    )
    module = module.replace(
        "np.array([self.x]), -1.0,",
        "np.array([self.x]), float('nan') if Corridor.resets > 30000 else -1.0,",
    )
    assert "30000" in module
    (tmp_path / "my_fails.py").write_text(module.replace("30000", "10"))
    arguments = ["train", "my_fails:Fails-v0", "--ants", "2", "--cells", "5"]
    sys.path.insert(0, str(tmp_path))
    try:
        import my_fails

        my_fails.Corridor.resets = -(10**9)  # type: ignore[attr-defined]
        from acl_gym.callbacks import CSVLog

        end = CSVLog.on_trial_end

        def fail(self: CSVLog, agent: Any, row: Any) -> Any:
            if row["trial"] == 3:
                my_fails.Corridor.resets = 10**9  # type: ignore[attr-defined]
            return end(self, agent, row)

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(CSVLog, "on_trial_end", fail)
            result = invoke(
                *arguments,
                *("--param", "tau0=0.001", "--log", "x.csv", "--out", "a"),
                *("--evaluate-every", "100"),
            )
    finally:
        sys.path.remove(str(tmp_path))
    assert result.exit_code == 1
    assert "rewards must be finite" in result.stderr
    assert "saved as it was after trial 3, a.npz" in result.stderr
    agent = ACL.load("a.npz")
    assert agent.trials == 3
    assert np.isfinite(agent.table).all()
    assert json.dumps(agent.history)
