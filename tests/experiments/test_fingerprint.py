"""A result is made again when the code that it depends on changes, and only then."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from acl_gym.experiments.fingerprint import ROOT, code_fingerprint, sources_of

LEARN = "acl_gym.reproduction.training"
COMPARE = "acl_gym.experiments.contestants"

MATTERS = [
    *("__init__", "agents/acl", "colony/pheromone", "colony/selection"),
    *("evaluation/rollout", "evaluation/policy_cost", "callbacks/evaluation"),
    *("envs/__init__", "envs/control/environments", "envs/control/stepping"),
    *("envs/pendulum/system", "envs/pendulum/env", "envs/pendulum/kernels"),
    *("envs/navigation/system", "envs/navigation/kernels", "envs/two_state/system"),
    *("envs/grid_search/maps", "envs/grid_search/system"),
    *("partitions/grid", "partitions/automatic", "partitions/kernels"),
    *("colony/costs", "colony/deposits", "colony/schedules"),
]
OF_ONE = {
    LEARN: ["reproduction/training", "reproduction/settings", "reproduction/orders"],
    COMPARE: ["experiments/contestants", "agents/q_learning", "sb3/dqn"],
}
NEITHER = [
    *("cli/reproduce", "cli/app", "utils/compiling"),
    *("theory/__init__", "theory/convergence", "theory/aco"),
    *("envs/control/rendering", "envs/grid_search/painter", "envs/navigation/painter"),
    *("experiments/runner", "experiments/fingerprint", "experiments/drawing"),
    *("experiments/report", "experiments/figures/grid", "experiments/comparison"),
    *("reproduction/page", "reproduction/verdicts", "reproduction/evidence"),
    *("reproduction/claims/pendulum", "reproduction/figures/bands"),
    *("reproduction/catalogue/pendulum", "reproduction/systems"),
    *("reproduction/store", "reproduction/cluster", "reproduction/reproduce"),
]


@pytest.fixture(scope="module")
def copied(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The package, to be changed."""
    copy = tmp_path_factory.mktemp("code") / "acl_gym"
    shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns("__pycache__"))
    return copy


def changed(root: Path, file: str, module: str) -> bool:
    """Whether the hash of a module's code is another one when a file has changed."""
    path = root / file
    before, content = code_fingerprint(module, root), path.read_bytes()
    path.write_bytes(content + b"# mended\n")
    code_fingerprint.cache_clear()
    after = code_fingerprint(module, root)
    path.write_bytes(content)
    code_fingerprint.cache_clear()
    return before != after


@pytest.mark.parametrize("module", [LEARN, COMPARE])
def test_what_matters_and_what_does_not(module: str) -> None:
    files = {
        path.relative_to(ROOT).with_suffix("").as_posix()
        for path in sources_of(module).values()
    }
    there = {p.relative_to(ROOT).with_suffix("").as_posix() for p in ROOT.rglob("*.py")}
    named = {*MATTERS, *NEITHER, *OF_ONE[LEARN], *OF_ONE[COMPARE]}
    assert named <= there
    assert {*MATTERS, *OF_ONE[module]} <= files
    assert files.isdisjoint(NEITHER)
    other = LEARN if module == COMPARE else COMPARE
    assert files.isdisjoint(
        name
        for name in OF_ONE[other]
        if "reproduction" in name or "experiments" in name
    )


@pytest.mark.parametrize(
    ("file", "expected"),
    [
        ("colony/pheromone.py", True),
        ("envs/two_state/system.py", True),
        ("partitions/grid.py", True),
        ("reproduction/training.py", True),
        ("reproduction/claims/grids.py", False),
        ("reproduction/figures/bands.py", False),
        ("reproduction/templates/page.html.j2", False),
        ("cli/reproduce.py", False),
    ],
)
def test_a_change(copied: Path, file: str, expected: bool) -> None:
    assert changed(copied, file, LEARN) is expected


def test_code_from_elsewhere_may_use_all_of_it() -> None:
    assert set(sources_of("tests.somewhere")) >= {LEARN, COMPARE, "acl_gym.cli.app"}


RUN = """
import json, sys
from dataclasses import replace
from acl_gym.reproduction.training import learn
from acl_gym.reproduction.settings import Setting
for env_id, kind, cells in [
    ("Pendulum", "fuzzy", (8, 9)), ("Navigation", "crisp", "regular"),
    ("GridSearch1D", "discrete", None), ("GridSearch2D", "discrete", None),
    ("TwoState", "discrete", None),
]:
    setting = Setting(f"acl_gym/{env_id}-v0", 3, 1, {"max_steps": 3}, {}, kind, cells)
    learn(setting, 0, lambda done: None)
print(json.dumps([name for name in sys.modules if name.startswith("acl_gym")]))
"""


def test_nothing_that_runs_is_forgotten() -> None:
    """All modules that a run has loaded are looked at, but for those that only talk."""
    done = subprocess.run(
        [sys.executable, "-c", RUN],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    loaded = set(json.loads(done.stdout.splitlines()[-1]))
    assert "acl_gym.evaluation.rollout" in loaded
    assert loaded - set(sources_of(LEARN)) <= {
        *("acl_gym.utils.compiling", "acl_gym.envs.control.rendering"),
        *("acl_gym.envs.grid_search.painter", "acl_gym.envs.navigation.painter"),
    }
