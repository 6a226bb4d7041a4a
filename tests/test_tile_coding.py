"""The rival from outside: its policy for batches of states, and what the command says.

MushroomRL has an environment of its own, `make peers-mushroom`; without it what needs it
is skipped.
"""

from __future__ import annotations

import json
import runpy
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from acl_gym.evaluation import evaluate_policy_cost

ROOT = Path(__file__).resolve().parents[1]
SCRIPT = ROOT / "benchmarks" / "tile_coding.py"
INTERPRETER = ROOT / ".venv-mushroom" / "bin" / "python"
tiles = SimpleNamespace(**runpy.run_path(str(SCRIPT)))


@dataclass
class Tiling:
    """As MushroomRL has it: ranges of the variables, and tiles along each."""

    _range: list[list[float]]
    _n_tiles: list[int]

    @property
    def size(self) -> int:
        return int(np.prod(self._n_tiles))


# Two tilings of [0, 1) x [0, 2): 2 x 3 tiles, and one that begins a quarter earlier.
TILINGS = [
    Tiling([[0.0, 1.0], [0.0, 2.0]], [2, 3]),
    Tiling([[-0.25, 1.25], [-0.5, 2.5]], [3, 2]),
]
RANGES = np.array([0.0, 0.0]), np.array([1.0, 2.0])


def test_values_are_sums_of_the_weights_of_tiles() -> None:
    """The first variable runs fastest, as in MushroomRL."""
    weights = np.arange(24.0)  # of two actions, 12 features each
    policy = tiles.TilePolicy(weights, TILINGS, 2, RANGES)
    # (0.6, 1.9): column 1 and row 2 of the first tiling, tile 1 + 2 * 2 = 5; of the
    # second column 1 and row 1, tile 1 + 3 * 1 = 4, which is feature 6 + 4 = 10.
    assert policy.values(np.array([[0.6, 1.9]])).tolist() == [[5 + 10, 17 + 22]]
    actions, _ = policy.predict(np.array([[0.6, 1.9], [0.0, 0.0]]))
    assert actions.tolist() == [1, 1]


def test_states_beyond_the_range_count_as_those_at_its_end() -> None:
    policy = tiles.TilePolicy(np.arange(24.0), TILINGS, 2, RANGES)
    ends = policy.values(np.array([[0.0, 0.0], [0.999, 1.999]]))
    beyond = policy.values(np.array([[-9.0, -1.0], [1.0, 2.0]]))
    assert np.array_equal(ends, beyond)


@pytest.mark.parametrize("name", tiles.TASKS)
def test_policies_of_tasks_can_be_evaluated(name: str) -> None:
    """Without weights the first action is taken always, which is bad in all of them."""
    task = tiles.TASKS[name]
    low, high = task.ranges()
    assert np.isfinite([low, high]).all()
    n_tiles = [1] * low.size
    tiling = Tiling([list(pair) for pair in zip(low, high, strict=True)], n_tiles)
    policy = tiles.TilePolicy(np.array([1.0, 0.0]), [tiling], 2, (low, high))
    found = evaluate_policy_cost(policy, task.evaluation_env(), seed=0)
    assert found.cost > task.marks[0]


def test_settings_can_be_changed() -> None:
    task = tiles.TASKS["pendulum"]
    found = tiles.changed(task, ["epsilon=0.2", "tiles=3"], 500)
    assert (found.settings.epsilon, found.settings.tiles, found.steps) == (0.2, 3, 500)
    with pytest.raises(ValueError, match=r"--set must name one of .*, got 'speed=1'"):
        tiles.changed(task, ["speed=1"], None)
    with pytest.raises(ValueError, match=r"--set tiles must be a number \(int\)"):
        tiles.changed(task, ["tiles=many"], None)


def test_the_table_has_medians_and_how_many_got_there() -> None:
    def one(first: float, last: float) -> dict[str, object]:
        rows = [
            {"env_steps": 500, "seconds": 1.0, "policy_cost": first},
            {"env_steps": 1_000, "seconds": 2.0, "policy_cost": last},
        ]
        return {"rows": rows, "last": last, "best": min(first, last)}

    runs = [one(130.0, 124.0), one(120.0, 105.0), one(200.0, 109.0)]
    assert tiles.table("MountainCar-v0", runs) == (
        "| MountainCar-v0 | 3 | 1,000 | 2 | 1,000 (2 of 3) | 2 | 109 | 109 | 2 |"
    )


def test_wrong_arguments() -> None:
    command = [sys.executable, str(SCRIPT), "--set", "epsilon=much"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr == (
        "tile_coding.py: --set epsilon must be a number (float), got 'much'.\n"
    )


@pytest.mark.slow
@pytest.mark.skipif(not INTERPRETER.exists(), reason="needs .venv-mushroom")
def test_it_learns_on_the_mountain() -> None:
    command = [str(INTERPRETER), str(SCRIPT), "--tasks", "MountainCar-v0", "--json"]
    done = subprocess.run(
        [*command, "--steps", "8000", "--seeds", "1"],
        capture_output=True,
        text=True,
        check=True,
    )
    (task,) = json.loads(done.stdout)["tasks"]
    (run,) = task["runs"]
    assert [row["env_steps"] for row in run["rows"]][-1] == 8_000
    assert run["best"] < 200.0  # it has arrived
