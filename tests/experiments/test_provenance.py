"""A run is made again when the code that it depends on changes, and only then."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from acl_gym.experiments.provenance import ROOT, RUNS, code_of_runs, sources_of

MATTERS = {
    *("agents/acl", "agents/base", "agents/q_learning", "agents/training"),
    *("colony/pheromone", "colony/selection", "colony/solutions", "colony/costs"),
    *("colony/deposits", "colony/schedules", "colony/update_rules"),
    *("policies/base", "policies/table", "policies/soft"),
    *("envs/pendulum/system", "envs/pendulum/kernels", "envs/navigation/system"),
    *("envs/grid_search/maps", "envs/two_state/system", "envs/control/environments"),
    *("envs/wrappers/perturbations", "partitions/grid", "partitions/kernels"),
    *("partitions/automatic", "evaluation/rollout", "evaluation/policy_cost"),
    *("planning/q_iteration", "planning/value_iteration", "sb3/dqn", "sb3/adapter"),
    *("experiments/methods", "experiments/study", "experiments/results"),
}
DOES_NOT = {
    *("__init__", "cli/reproduce", "cli/app", "utils/compiling", "theory/aco"),
    *("envs/control/rendering", "envs/pendulum/painter", "envs/navigation/painter"),
    *("callbacks/files", "callbacks/tensorboard", "experiments/runner"),
    *("experiments/provenance", "experiments/report", "experiments/claims"),
    *("experiments/statistics", "experiments/store", "experiments/systems"),
}


def names(files: dict[str, Path]) -> set[str]:
    return {
        path.relative_to(ROOT).with_suffix("").as_posix().removesuffix("/__init__")
        for path in files.values()
    }


def test_what_matters_and_what_does_not() -> None:
    files = names(sources_of(RUNS))
    assert files >= MATTERS
    assert files.isdisjoint(DOES_NOT)
    everything = {
        p.relative_to(ROOT).with_suffix("").as_posix() for p in ROOT.rglob("*.py")
    }
    assert everything >= DOES_NOT, "a name is out of date"


@pytest.fixture(scope="module")
def copied(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The package, to be changed."""
    copy = tmp_path_factory.mktemp("code") / "acl_gym"
    shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns("__pycache__"))
    return copy


@pytest.fixture(scope="module")
def unchanged(copied: Path) -> str:
    return hash_of(copied)


def hash_of(root: Path) -> str:
    code_of_runs.cache_clear()
    return code_of_runs(root)


@pytest.mark.parametrize(
    ("file", "addition", "expected"),
    [
        ("colony/pheromone.py", "\nLIMIT = 3\n", True),
        ("envs/two_state/system.py", "\nLIMIT = 3\n", True),
        ("experiments/methods.py", "\nLIMIT = 3\n", True),
        ("envs/grid_search/layouts/11x11.txt", "#", True),
        ("colony/pheromone.py", "\n# A remark.\n", False),
        ("colony/pheromone.py", '\n"""A remark."""\n', False),
        ("callbacks/files.py", "\nLIMIT = 3\n", False),
        ("experiments/claims.py", "\nLIMIT = 3\n", False),
        ("envs/pendulum/painter.py", "\nLIMIT = 3\n", False),
        (
            "colony/pheromone.py",
            "\nfrom typing import TYPE_CHECKING\n"
            "if TYPE_CHECKING:\n    from acl_gym.cli.app import app\n",
            False,
        ),
        (
            "colony/pheromone.py",
            "\nimport typing\nif typing.TYPE_CHECKING:\n    A = 1\nelse:\n    A = 2\n",
            True,
        ),
    ],
)
def test_a_change(
    copied: Path, unchanged: str, file: str, addition: str, expected: bool
) -> None:
    path = copied / file
    content = path.read_text()
    path.write_text(content + addition)
    try:
        assert (hash_of(copied) != unchanged) is expected
    finally:
        path.write_text(content)


def test_imports_for_the_type_checker_are_not_followed(copied: Path) -> None:
    path = copied / "colony" / "pheromone.py"
    content = path.read_text()
    path.write_text(
        f"{content}\nfrom typing import TYPE_CHECKING\n"
        "if TYPE_CHECKING:\n    from acl_gym.callbacks import files\n"
    )
    assert "acl_gym.callbacks.files" not in sources_of(RUNS, copied)
    for executed in (
        "from acl_gym.callbacks import files\n",
        "if TYPE_CHECKING:\n    pass\nelse:\n    from acl_gym.callbacks import files\n",
    ):
        path.write_text(f"{content}\n{executed}")
        assert "acl_gym.callbacks.files" in sources_of(RUNS, copied)
    path.write_text(content)


LOADED = """
import json, sys
from dataclasses import replace
from acl_gym.experiments import methods
from acl_gym.experiments.systems import grid_1d, grid_2d, navigation, pendulum, two_state
for study in (
    grid_1d(), grid_2d(), navigation("time", "crisp"), two_state(2),
    pendulum("fuzzy", cells=(8, 9)),
    replace(grid_1d(), method="q-learning", settings={}),
):
    methods.run(study.brief(), 0)
print(json.dumps([name for name in sys.modules if name.startswith("acl_gym")]))
"""


def test_nothing_that_runs_is_forgotten() -> None:
    """All modules that runs load count, but for those that draw or say something."""
    done = subprocess.run(
        [sys.executable, "-c", LOADED],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    loaded = json.loads(done.stdout.splitlines()[-1])
    assert "acl_gym.evaluation.rollout" in loaded
    known = sources_of(RUNS)
    forgotten = {
        name
        for name in loaded
        if name not in known and not _is_package(name) and name != "acl_gym"
    }
    silent = {n for n in forgotten if n.endswith(("compiling", "rendering", "painter"))}
    of_packages = (
        "acl_gym.callbacks.",
        "acl_gym.evaluation.robustness",
        "acl_gym.evaluation.trajectory",
        "acl_gym.swarm.aggregation.bounds",
        "acl_gym.swarm.aggregation.flow",
        "acl_gym.swarm.consensus",
        "acl_gym.swarm.pso.stability",
    )
    by_packages = {n for n in forgotten if n.startswith(of_packages)}
    # `systems` was imported by this test, to have something to run.
    assert forgotten - silent - by_packages <= {"acl_gym.experiments.systems"}


def _is_package(name: str) -> bool:
    return (ROOT.parent / name.replace(".", "/") / "__init__.py").exists()
