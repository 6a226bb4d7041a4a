"""The throughput benchmark runs and prints its promised output; no time is judged."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from acl_gym import ACL
from acl_gym.partitions.automatic import thesis_partition

FOLDER = Path(__file__).resolve().parents[1] / "benchmarks"


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(FOLDER / "throughput.py"), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture
def brief(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The benchmark as a module, its cases cut short."""
    monkeypatch.syspath_prepend(str(FOLDER))
    import speed_cases
    import throughput

    monkeypatch.setattr(speed_cases, "TRIALS_OF_A_RUN", 2)
    monkeypatch.setattr(speed_cases, "steps_for", lambda n_ants: 5)
    train_dqn = speed_cases.train_dqn
    monkeypatch.setattr(speed_cases, "train_dqn", lambda steps: train_dqn(200))
    # It needs fewer kernels, and those of the tests are compiled once for all.
    first = throughput.FIRST_TRIAL.replace("Pendulum", "GridSearch1D")
    monkeypatch.setattr(throughput, "FIRST_TRIAL", first)
    cache = os.environ.get("NUMBA_CACHE_DIR", str(tmp_path))
    folder = SimpleNamespace(TemporaryDirectory=lambda: nullcontext(cache))
    monkeypatch.setattr(throughput, "tempfile", folder)
    return throughput


def test_quick_run_prints_json_and_draws(
    brief: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    figure = tmp_path / "speed.png"
    arguments = ["--quick", "--json", "--systems", "pendulum", "grid-1d"]
    assert brief.main([*arguments, "--ants", "16", "--figure", str(figure)]) == 0
    result = json.loads(capsys.readouterr().out)
    cases = result["cases"]
    names = [case["name"] for case in cases]
    assert len(set(names)) == len(names)
    for case in cases:
        assert case["n_ants"] >= 1
        assert case["steps_per_second"] > 0
        assert case["slowest"] <= case["steps_per_second"] <= case["fastest"]
        assert case["ratio_to_reference"] > 0
        assert case["load"] >= 0
        assert case["reference"] in names
    for words in (
        "DQN",
        "complete run",
        "in NumPy",
        "synchronous",
        "CartPole",
        "crisp",
    ):
        assert any(words in name for name in names), words
    for criterion in result["criteria"]:
        measured, bound = criterion["measured"], criterion["bound"]
        above = measured >= bound
        assert criterion["met"] == (
            above if criterion["asked"] == "at least" else measured <= bound
        )
    assert len(result["criteria"]) >= 2
    assert all(seconds > 0 for seconds in result["startup"].values())
    assert figure.stat().st_size > 10_000


def test_memory_of_a_trial_is_reported() -> None:
    done = run("--memory", "500")
    result = json.loads(done.stdout)
    assert result["n_ants"] == 500
    assert 0 < result["ant_steps"] <= 500 * 300
    assert result["gib_peak"] >= result["gib_before"] > 0


@pytest.mark.parametrize(
    "arguments",
    [
        ("--ants", "0"),
        ("--repetitions", "0"),
        ("--systems", "car"),
        ("--memory", "0"),
        ("--memory", "-5"),
        ("--only", "["),
        ("--only", "no such case"),
        ("--figure", "speed.foo"),
        ("--figure", "/no/such/folder/speed.png"),
    ],
)
def test_bad_arguments_are_refused_in_a_line(
    arguments: tuple[str, ...],
    brief: Any,
    capsys: pytest.CaptureFixture[str],
) -> None:
    try:
        code = brief.main([*arguments])
    except SystemExit as end:  # of argparse
        code = end.code
    assert code == 2
    assert arguments[0] in capsys.readouterr().err.splitlines()[-1]


def test_the_numpy_colony_is_the_colony(monkeypatch: pytest.MonkeyPatch) -> None:
    """Same random numbers, same pheromone: both sides of the ratio do the same work."""
    monkeypatch.syspath_prepend(str(FOLDER))
    from numpy_colony import NumpyColony

    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=30)
    colony = ACL(env, thesis_partition(env), seed=4, max_steps=60).learn(trials=4)
    plain = NumpyColony(30, max_steps=60, seed=4)
    for _ in range(4):
        plain.trial()
    assert plain.steps == colony.num_timesteps
    np.testing.assert_allclose(plain.levels, colony.table, rtol=1e-9)


def test_every_criterion_is_judged(monkeypatch: pytest.MonkeyPatch) -> None:
    """Renaming a case must not silently drop its criterion."""
    monkeypatch.syspath_prepend(str(FOLDER))
    from speed_cases import COMPLETE_RUN, SYSTEMS, plan
    from speed_criteria import complete_run_row, criteria

    plans = list(plan(list(SYSTEMS), [250, 2_000], 5_000))
    rates = {each.name: 1e6 * (1 + n) for n, each in enumerate(plans)}
    rates |= {"pendulum of envpool 1, 2,048 slots": 2e6, "pendulum of gymnax 1": 3e6}
    rows = [*criteria(rates), complete_run_row(1.9)]
    assert len(rows) == 11
    assert len({row["what"] for row in rows}) == 11
    assert rows[0]["measured"] == (
        rates["fuzzy pendulum learning, 2,000 ants"]
        / rates["fuzzy pendulum learning in NumPy, 2,000 ants"]
    )
    assert rows[-1]["met"]
    assert not complete_run_row(2.1)["met"]
    assert COMPLETE_RUN in rates
