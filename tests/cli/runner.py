"""How the tests of the command line call it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from typer.testing import CliRunner

from acl_gym.cli.app import app

ROOT = Path(__file__).resolve().parents[2]
PENDULUM = "acl_gym/Pendulum-v0"
SMALL = ["train", PENDULUM, "--ants", "10", "--cells", "6,7", "--trials", "5"]
SMALL += ["--evaluate-every", "2", "--agent", "acl"]
COMMANDS = ("train", "evaluate", "design", "envs", "compare", "reproduce", "report")


def invoke(*arguments: str) -> Any:
    return CliRunner().invoke(app, list(arguments), prog_name="acl-gym")


def figures(*arguments: str) -> Any:
    result = invoke(*arguments, "--json")
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


def run(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """In a new interpreter, in another folder; without the message about compilation."""
    done = subprocess.run(
        [sys.executable, "-m", "acl_gym", *arguments],
        cwd=cwd,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    lines = done.stderr.splitlines(keepends=True)
    done.stderr = "".join(line for line in lines if "compiling its kernels" not in line)
    return done


def refused(code: int, *arguments: str) -> str:
    """The one line of an invocation that fails."""
    result = invoke(*arguments)
    assert result.exit_code == code, result.output
    assert result.stdout == ""
    lines = result.stderr.splitlines()
    assert len(lines) == 1, result.stderr
    assert lines[0].startswith("acl-gym: ")
    return str(lines[0])


MODULE = """
import gymnasium as gym, numpy as np

class Corridor(gym.Env):
    observation_space = gym.spaces.Box(0.0, 2.0, (1,), np.float64)
    action_space = gym.spaces.Discrete(2)

    def __init__(self, slip=0.0, render_mode=None):
        self.slip = slip

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.x = self.np_random.uniform(0.0, 1.8)
        return np.array([self.x]), {}

    def step(self, action):
        slips = self.np_random.random() < self.slip
        move = 0.1 if (action == 1) != slips else -0.1
        self.x = float(np.clip(self.x + move, 0.0, 2.0))
        return np.array([self.x]), -1.0, self.x >= 1.95, False, {}

gym.register("Corridor-v0", entry_point=Corridor, max_episode_steps=80)
"""

STARTED = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler);"
    "signal.signal(signal.SIGTERM, signal.SIG_DFL);"
    "from acl_gym.cli import main; main()"
)
"""Python's own handlers, as in a terminal; a shell may have set to ignore a signal."""
