"""Only DQN and the adapter need Stable-Baselines3 and torch."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.test_readme import BLOCKS

ABSENT = """
import sys
from importlib.machinery import PathFinder

installed = PathFinder.find_spec

def find_spec(name, path=None, target=None):
    absent = name.partition(".")[0] in ("torch", "stable_baselines3")
    return None if absent else installed(name, path, target)

PathFinder.find_spec = find_spec
"""
LOADED = """
import sys
heavy = {"torch", "stable_baselines3"} & {name.partition(".")[0] for name in sys.modules}
assert not heavy, heavy
"""


def run(code: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


def test_the_ten_lines_run_without_both(tmp_path: Path) -> None:
    done = run(ABSENT + BLOCKS[0], tmp_path)
    assert done.returncode == 0, done.stderr
    assert float(done.stdout.split()[0]) < 1.25 * 38.4
    assert (tmp_path / "swing_up.npz").exists()


EVERYTHING = """
import gymnasium as gym
from acl_gym import ACL, CSVLog, Checkpoint, EarlyStop, PolicyEvaluation, QLearning
from acl_gym import TensorBoardLog, evaluate_policy_cost, value_iteration

env = gym.make_vec("acl_gym/GridSearch1D-v0", num_envs=10)
callbacks = [
    PolicyEvaluation(env, save_best="best"),
    Checkpoint("checkpoints"),
    CSVLog("log.csv"),
    TensorBoardLog("board"),
    EarlyStop(patience=100),
]
for kind in (ACL, QLearning):
    agent = kind(env, seed=0).learn(trials=3, callback=callbacks, progress_bar=True)
    evaluate_policy_cost(agent, env)
    agent.save("agent")
    kind.load("agent", env).learn(trials=1).predict(3)
value_iteration(env)
"""


def test_learning_saving_and_logging_load_neither(tmp_path: Path) -> None:
    done = run(EVERYTHING + LOADED, tmp_path)
    assert done.returncode == 0, done.stderr
    assert list((tmp_path / "board").iterdir())


TRAIN = """
from acl_gym.cli import main
for command in (
    ["train", "acl_gym/GridSearch1D-v0", "--trials", "3", "--seed", "0"],
    ["evaluate", "GridSearch1D-v0.npz"],
    ["envs"],
):
    sys.argv = ["acl-gym", *command]
    try:
        main()
    except SystemExit as end:
        assert not end.code, end.code
"""


@pytest.mark.parametrize("setting", [ABSENT, "import sys\n"], ids=["absent", "present"])
def test_the_shell_trains_and_evaluates_with_neither(
    setting: str, tmp_path: Path
) -> None:
    done = run(setting + TRAIN + LOADED, tmp_path)
    assert done.returncode == 0, done.stderr


COMPARE = """
from acl_gym.cli import main
for options in [], ["--agents", "dqn"]:
    sys.argv = ["acl-gym", "compare", *options]
    try:
        main()
    except SystemExit as end:
        assert end.code == 2, end.code
"""


def test_a_comparison_with_dqn_is_refused_before_it_starts(tmp_path: Path) -> None:
    done = run(ABSENT + COMPARE, tmp_path)
    assert done.returncode == 0, done.stderr
    remedies = (", or leave them out: --agents acl-fuzzy,", ".")
    for said, remedy in zip(done.stderr.splitlines(), remedies, strict=True):
        assert "run `pip install stable-baselines3 torch`" + remedy in said
    assert not list(tmp_path.iterdir())


NEEDS_THEM = [
    "from acl_gym import VectorEnvAdapter",
    "import acl_gym; acl_gym.VectorEnvAdapter",
    "from acl_gym.sb3.dqn import make_dqn",
    "from acl_gym.sb3.callback import PolicyCostCallback",
]
TRY_EACH = f"""
from acl_gym import *
assert ACL and plant  # a star imports what works without them
for line in {NEEDS_THEM}:
    try:
        exec(line)
    except ModuleNotFoundError as error:
        print(line, error, sep=": ")
"""


def test_what_needs_them_says_what_to_install(tmp_path: Path) -> None:
    done = run(ABSENT + TRY_EACH, tmp_path)
    assert done.returncode == 0, done.stderr
    for line, said in zip(NEEDS_THEM, done.stdout.splitlines(), strict=True):
        assert re.match(
            rf"{re.escape(line)}: VectorEnvAdapter and DQN need Stable-Baselines3 and "
            r"torch, .*No module named 'stable_baselines3'.*"
            r"pip install stable-baselines3 torch",
            said,
        )
