"""The short benchmarks run, and their JSON holds what their tables show."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.scripts import run_script

FOLDER = Path(__file__).resolve().parent.parent / "benchmarks"

ONCE = ("--repetitions", "1")

pytestmark = pytest.mark.slow


def printed(script: str, *arguments: str) -> str:
    done = run_script(FOLDER / script, *arguments)
    assert done.returncode == 0, done.stderr
    return done.stdout


def output_of(script: str, *arguments: str) -> Any:
    return json.loads(printed(script, "--json", *arguments))


def test_asynchronous() -> None:
    arguments = ["--seeds", "1", "--cases", "grid", "--colonies", "returning"]
    found = output_of("asynchronous.py", *arguments)
    assert found["best"]["grid"] == pytest.approx(10.0, abs=0.3)  # mean shortest path
    for row in found["rows"]:
        near = row["reached"]["25%"]
        assert 0.0 < row["walking"] <= 1.0
        assert near["interactions"] <= row["ants"] * near["env_steps"]
    walking = {row["schedule"]: row["walking"] for row in found["rows"]}
    assert walking["synchronous"] < walking["asynchronous"] == 1.0


def test_how_many_ants() -> None:
    arguments = ["--ants", "2", "5", "--seeds", "2", "--interactions", "4000"]
    rows = output_of("how_many_ants.py", *arguments)["rows"]
    assert [row["ants"] for row in rows] == [2, 5]
    for row in rows:
        assert 300 <= row["good after"] <= row["slowest"] <= 4_500
        assert 38.0 < row["last cost"] <= row["highest"] < 100.0


def test_numbered_actions() -> None:
    rows = output_of("numbered_actions.py", "--steps", "20", "--seeds", "2")["rows"]
    assert len(rows) == 3
    many = rows[-1]
    assert many["plant"] == "Pendulum-v1, 9 torques"
    assert many["values"] < 0.5 * many["flags"]
    assert many["values_are_better"] == 2


def test_recorded_data() -> None:
    arguments = ["--kinds", "anywhere", "--transitions", "12", "--seeds", "1"]
    arguments += ["--model-steps", "1000", "--remedies", "none", "pessimism=10"]
    plain, careful = output_of("recorded_data.py", *arguments)["rows"]
    assert plain["interactions"] == careful["interactions"] == 12
    assert (plain["remedy"], careful["remedy"]) == ("none", "pessimism=10")
    assert careful["model_cost"] > plain["model_cost"]


def test_double_bridge() -> None:
    found = output_of("double_bridge.py", "--colonies", "1000")
    for row in found["equal"]:
        # Four and a half standard errors: wrong once in 7,000 seeds for 20 rows.
        error = (row["exact"] * (1 - row["exact"]) / 1_000) ** 0.5
        assert abs(row["simulated"] - row["exact"]) <= 4.5 * error + 0.002
    short = [row["short"] for row in found["unequal"]]
    assert short[0] < short[1] < short[2]
    assert found["unequal"][3] == {
        "experiment": "2, short branch late",
        "short": 0.0,
        "long": 1.0,
    }


def test_moving_agents() -> None:
    found = output_of("moving_agents.py")
    for row in found["readings"].values():
        assert row["measured"] == pytest.approx(row["factor"], abs=2e-3)
    split, strict = found["readings"]["split"], found["readings"]["strict"]
    assert split["centre_moved"] < 1e-14 < 1e-4 < strict["centre_moved"]
    rows = {row["channel"]: row for row in found["channels"]}
    everyone = rows["Everyone(include_self=True)"]
    assert everyone["disagreement"] < 1e-12
    assert rows["Radius(0.3, include_self=True)"]["disagreement"] > 0.1


def test_swarm_aggregation() -> None:
    sizes = ["--agents", "40,80", "--seconds", "0.01", "--repetitions", "1"]
    found = output_of("swarm_aggregation.py", *sizes, "--no-peer")
    assert len(found["rows"]) == 8
    for row in found["rows"]:
        rate = row["agents"] / row["seconds"]
        assert row["agent_steps_per_second"] == pytest.approx(rate)
    assert set(found["growth"]) == {"forces", "run", "environment", "pettingzoo"}
    assert found["simple_spread"] is None


def test_swarm_aggregation_figures() -> None:
    found = output_of("swarm_aggregation_figures.py")
    for row in found["sizes"]:
        assert row["rms"] <= row["size"] < row["size_bound"]
        assert row["rms"] < row["rms_bound"]
    assert found["law"]["largest_error"] < 1e-6
    moved = {row["channel"]: row["moved"] for row in found["centres"]}
    assert moved["Everyone()"] < 1e-12 < 1e-3 < moved["Nearest(5)"]


def test_swarm_aggregation_learning() -> None:
    found = output_of("swarm_aggregation_learning.py", "--methods", "rule,mean,stay")
    rule, mean, stay = found["runs"]
    assert rule["cost"] < stay["cost"] < mean["cost"]
    for run in found["runs"]:
        parts = run["distance"] + run["collisions"]
        assert run["cost"] == pytest.approx(parts)


def test_aco_theory() -> None:
    for row in output_of("aco_theory.py", "--colonies", "50")["rows"]:
        assert row["highest_level"] <= 1 + 1e-12
        never = row["trials_most"] is None
        assert never == (row["evaporation"] == "tour" and row["tau0"] == "tau_max")
        if row["evaporation"] == "all":
            assert row["later_than_k0"] == 0.0


def test_plant() -> None:
    cases = output_of("plant.py", "--slots", "3", *ONCE)["cases"]
    assert [case["slots"] for case in cases] == [1, 3, 3, 3]
    assert cases[0]["ratio_to_reference"] == 1.0
    assert all(case["steps_per_second"] > 0 for case in cases)


def test_throughput_of_walking_back() -> None:
    found = output_of("throughput.py", "--only", "walking back", "--no-peers", *ONCE)
    names = [case["name"] for case in found["cases"]]
    for ants in ("250", "2,500"):
        deposit = f"deposit, 64 x 64 cells, {ants} ants"
        back = names.index(f"walking back, 64 x 65 cells, {ants} ants")
        assert found["cases"][back]["reference"] == deposit
    assert [row["asked"] for row in found["criteria"]] == ["at most"]


def test_workers() -> None:
    small = ("--slots", "2", "--steps", "2", "--milliseconds", "0.1", "--without-ray")
    # Its processes import the script anew, as the main program.
    command = [sys.executable, str(FOLDER / "workers.py"), "--json"]
    done = subprocess.run(
        [*command, *small, *ONCE], capture_output=True, text=True, check=True
    )
    cases = json.loads(done.stdout)["cases"]
    assert [case["name"] for case in cases[-2:]] == [
        "WorkersVectorEnv, processes, 1",
        "WorkersVectorEnv, processes, 2",
    ]
    assert cases[0]["ratio_to_reference"] == 1.0
    assert all(case["steps_per_second"] > 0 for case in cases)


@pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")
def test_policy_export() -> None:
    rows = output_of("policy_export.py", *ONCE)["rows"]
    assert len(rows) == 4 * 4
    # A call of C takes a hundredth of `predict`, which enters NumPy and Numba.
    assert all(row["ratio_to_predict"] < 0.5 for row in rows if "table_bytes" in row)


def test_ablation() -> None:
    """Where a state is a cell nothing grows, so that three variants are left out."""
    arguments = ["--tasks", "grid,pendulum", "--steps", "1500"]
    rows = output_of("ablation.py", *arguments, "--seeds", "1")["rows"]
    assert [row["variant"] for row in rows if row["task"] == "grid"] == [
        *("returning", "no memory", "one walk back", "neither", "no ants", "none"),
    ]
    assert len(rows) == 6 + 9
    for row in rows:
        assert row["best"] >= row["last"]
        assert row["runs"][0]["steps"] >= 1500
        assert row["reached_25"] == (row["steps_25"] is not None)


def test_returning_figures(tmp_path: Path) -> None:
    """The better the later; the last is within 25% of the best there is."""
    shown = printed("returning_figures.py", "--only", "growing", "--out", str(tmp_path))
    costs = [float(line.rpartition(" ")[2]) for line in shown.splitlines()]
    assert len(costs) == 4
    assert costs[0] > costs[-1]
    assert 38.4 < costs[-1] < 1.25 * 38.4
    assert (tmp_path / "growing.png").stat().st_size > 100_000


def test_continuous_actions() -> None:
    studies = ["--study", "pendulum-plan", "pendulum-acl", "rules"]
    arguments = ["--seeds", "1", "--actions", "3", *studies]
    rows = output_of("continuous_actions.py", *arguments)["rows"]
    planned = {r["policy"]: r for r in rows if r["study"] == "pendulum-plan"}
    assert planned["interpolated"]["cost"] < planned["greedy"]["cost"] < 40.0
    costs = {(r.get("agent", r["study"]), r["policy"]): r["cost"] for r in rows}
    assert costs["pendulum-acl", "tau"] > costs["pendulum-acl", "greedy"]
    # The formula of the benchmark is that of the package, but for rounding.
    formula = costs["pendulum-acl", "parabola (InterpolatedPolicy)"]
    assert formula == pytest.approx(costs["pendulum-acl", "interpolated"], rel=1e-3)


def test_prior_knowledge() -> None:
    """One run of each kind: what is told shows before anything is learned."""
    arguments = ["--tasks", "pendulum", "--agents", "ReturningACL", "--ways", "initial"]
    rows = output_of("prior_knowledge.py", *arguments, "--seeds", "1")["rows"]
    assert [row["knowledge"] for row in rows] == ["none", "good", "useless", "wrong"]
    before = {row["knowledge"]: row["before"] for row in rows}
    assert before["good"] < before["wrong"]
    assert all(row["runs"][0]["interactions"][-1] >= 6_000 for row in rows)


def test_safe_learning() -> None:
    """The inner loop does no harm from the first step on; nor does the shield."""
    arguments = ["--tasks", "hold", "--kinds", "free;shield, model;inner loop"]
    rows = output_of("safe_learning.py", *arguments, "--seeds", "1", "--steps", "600")
    found = {row["kind"]: row for row in rows["rows"]}
    assert found["free"]["violations"] > 0
    for kind in ("shield, model", "inner loop"):
        assert found[kind]["violations"] == found[kind]["final_violations"] == 0
        assert found[kind]["cost"] < found["free"]["cost"]
    assert found["shield, model"]["interventions"] > 0


def test_uncertain_plants() -> None:
    """One run of each kind where the range matters most: the mass."""
    small = ("--seeds", "1", "--interactions", "3000", "--draws", "4")
    found = output_of(
        "uncertain_plants.py", "--cases", "mass", "--widths", "40", *small
    )
    assert found["best"][0]["corner"] == pytest.approx({"mass": 0.14})
    assert found["best"][0]["hardest"] > found["best"][0]["nominal"] > 38
    learned = {row["learned_on"]: row for row in found["rows"]}
    assert list(learned) == ["nominal", "range", "hardest"]
    for row in learned.values():
        assert row["worst"] >= max(row["nominal"], row["mean"])
    assert learned["hardest"]["worst"] < learned["nominal"]["worst"]


def test_changing_plants() -> None:
    """A small change: what was learned is still good, and a new colony knows nothing."""
    arguments = ["--changes", "mass x 0.8", "--methods", "forget", "restart"]
    rows = output_of("changing_plants.py", *arguments, "--seeds", "1")["rows"]
    kept, anew = rows
    assert (kept["method"], anew["method"]) == ("forget", "restart")
    assert kept["costs"][0] < 1.5 * kept["best"] < anew["costs"][0]
    assert kept["extra"] < anew["extra"]
    assert all(row["interactions"][-1] >= 10_000 for row in rows)


def test_particle_swarms() -> None:
    """Short searches, by acl-gym alone; peers have an environment of their own."""
    chosen = ("--functions", "sphere", "--methods", "acl-gym", "as pygmo")
    small = ("--seeds", "2", "--evaluations", "8000")
    found = output_of("particle_swarms.py", *chosen, *small, *ONCE)
    assert len(found["quality"]) == 2 * 2
    for row in found["quality"]:
        assert len(set(row["values"])) == 2
        # Everyone hears everyone: faster than on a ring.
        assert (row["median"] < 10.0) == (row["topology"] == "global")
    assert found["rank_tests"] == []
    assert all(row["median"] > 0 for row in found["speed"])
    cases = [row["case"] for row in found["speed"]]
    assert cases[0] == "sphere, acl-gym"
    assert not any("pygmo" in case for case in cases)


PEERS = FOLDER.parent / ".venv-swarms" / "bin" / "python"


@pytest.mark.skipif(not PEERS.exists(), reason="needs .venv-swarms")
def test_particle_swarms_of_peers(tmp_path: Path) -> None:
    command = [str(PEERS), str(FOLDER / "particle_swarms.py"), "--json"]
    small = ("--functions", "sphere", "--seeds", "2", "--evaluations", "8000")
    done = subprocess.run(
        [*command, *small, "--only", "quality"],
        capture_output=True,
        text=True,
        check=True,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(FOLDER.parent)},
    )
    found = json.loads(done.stdout)
    assert set(found["versions"]) == {"pyswarms", "pygmo"}
    tests = {(test["topology"], test["peer"]) for test in found["rank_tests"]}
    assert len(tests) == len(found["rank_tests"]) == 4
    for row in found["quality"]:  # some swarms of pyswarms stay at a bound
        assert (min(row["values"]) < 10.0) == (row["topology"] == "global")
    assert list(tmp_path.iterdir()) == [], "pyswarms leaves no log behind"


def test_swarm_tunes_acl() -> None:
    found = output_of(
        "swarm_tunes_acl.py", "--iterations", "1", "--particles", "2", "--fresh", "2"
    )
    assert found["points"] == 4
    assert 0.0 <= found["tuned"]["epsilon"] <= 0.5
    for row in found["fresh"]:
        assert len(row["default"]) == len(row["tuned"]) == 2
        assert min(row["tuned"]) >= 10.0 - 0.3, "the mean shortest path"


def test_particle_swarm_figures(tmp_path: Path) -> None:
    found = output_of("particle_swarm_figures.py", "--seeds", "1")
    assert found["spread"]["standard"] < 1.0
    assert found["spread"]["as printed"] > 1e100
    assert len(found["topologies"]) == 5 * 6
    assert len(found["boundaries"]) == 5 * 4
