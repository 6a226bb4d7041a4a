"""Files that describe a plant, and files that do not."""

from __future__ import annotations

import sys
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

import acl_gym
from acl_gym.design import PlantFileError, load_plant
from acl_gym.design.plants import as_vector_env

PLANT = """acl_gym.plant(
    lambda x, u: [u[0]], low=[-1], high=[1], inputs=[-1, 1], sampling_time=0.1,
    goal={goal}, max_episode_steps={steps}{more})
"""


def plant(steps: int = 7, goal: str = "[0]", more: str = "") -> str:
    return PLANT.format(steps=steps, goal=goal, more=more)


def load(tmp_path: Path, text: str) -> gym.vector.VectorEnv:
    file = tmp_path / "mine.py"
    file.write_text(f"import acl_gym\n{text}")
    return load_plant(file)


@pytest.mark.parametrize("more", ["", ", num_envs=3"])
@pytest.mark.parametrize("name", ["env", "plant", "anything"])
def test_a_plant_in_a_name(name: str, more: str, tmp_path: Path) -> None:
    env = load(tmp_path, f"{name} = {plant(more=more)}")
    assert env.max_episode_steps == env.system.evaluation_steps == 7
    env.reset(options={"state": np.full((env.num_envs, 1), 0.5)})
    env.step(np.zeros(env.num_envs, dtype=int))
    np.testing.assert_allclose(env.states, 0.4)


def test_which_of_several_is_taken(tmp_path: Path) -> None:
    two = f"other = {plant(5)}\nplant = {plant(6)}\nenv = {plant(7)}"
    assert load(tmp_path, two).system.evaluation_steps == 7
    maker = f"{two}\ndef make(num_envs): return {plant(8)}"
    assert load(tmp_path, maker).system.evaluation_steps == 8
    # Another name for the same plant is no second one; neither is a private one.
    same = f"a = b = {plant(9)}\n_c = {plant(5)}"
    assert load(tmp_path, same).system.evaluation_steps == 9
    # A `make` of another package is not meant.
    imported = f"from gymnasium import make\nenv = {plant(4)}"
    assert load(tmp_path, imported).system.evaluation_steps == 4


def test_modules_beside_the_file_are_found(tmp_path: Path) -> None:
    (tmp_path / "numbers_of_mine.py").write_text("STEPS = 11")
    text = f"from numbers_of_mine import STEPS\nenv = {plant().replace('=7', '=STEPS')}"
    before = sys.path.copy()
    assert load(tmp_path, text).system.evaluation_steps == 11
    assert sys.path == before
    del sys.modules["numbers_of_mine"]


def test_a_main_block_is_not_run(tmp_path: Path) -> None:
    text = f'env = {plant()}\nif __name__ == "__main__":\n    raise SystemExit(1)'
    assert load(tmp_path, text).system.evaluation_steps == 7


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = (", "line 2 is not Python: '\\(' was never closed"),
        ("x = [1 2]", "line 2 is not Python: .*Perhaps you forgot a comma\\?$"),
        ("a b", "line 2 is not Python: invalid syntax\\.$"),
        ("\0", "is not Python"),
        ("x = 1", "must make a plant and keep it in a name"),
        ("\n1 / 0", "line 3, raised ZeroDivisionError: division by zero"),
        ("raise RuntimeError('no\\nway')", "raised RuntimeError: no way"),
        ("import sys; sys.exit(3)", "ends the program, sys.exit\\(3\\)"),
        (f"a = {plant()}\nb = {plant()}", "which of its plants is meant, got a, b"),
        (f"env = {plant(goal='None')}", "to reach a goal, got a plant with goal=None"),
        (f"env = {plant().replace('[-1, 1]', '[]')}", "raised ValueError: inputs"),
        (
            "import gymnasium\nenv = gymnasium.make('CartPole-v1')",
            "got only other environments, env",
        ),
        ("def make(num_envs): return 3", "what acl_gym.plant\\(...\\) returns"),
        ("def make(): return 3", "must return a plant"),
    ],
)
def test_what_describes_no_plant_is_one_line(
    text: str, message: str, tmp_path: Path
) -> None:
    with pytest.raises(PlantFileError, match=message) as caught:
        load(tmp_path, text)
    assert "\n" not in str(caught.value)
    assert "mine.py" in str(caught.value)


def test_what_is_no_file(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="there is no file"):
        load_plant(tmp_path / "nothing.py")
    with pytest.raises(PlantFileError, match=r"must be a Python file .* got a folder"):
        load_plant(tmp_path)


def test_what_is_no_plant() -> None:
    with pytest.raises(TypeError, match=r"what acl_gym\.plant"):
        as_vector_env(gym.make_vec("acl_gym/Pendulum-v0", num_envs=2))
    wrapped = gym.wrappers.vector.RecordEpisodeStatistics(
        eval(plant(more=", num_envs=2"), {"acl_gym": acl_gym})
    )
    with pytest.raises(TypeError, match="without wrappers"):
        as_vector_env(wrapped)


def test_a_function_that_makes_the_plant_runs_as_the_file_does(tmp_path: Path) -> None:
    """It may import what lies beside the file, and must not end the program."""
    (tmp_path / "beside_the_maker.py").write_text("GOAL = [0]\n")
    made = "def make(num_envs):\n    from beside_the_maker import GOAL\n    {}"
    text = plant(goal="GOAL", more=", num_envs=num_envs").replace("\n", "\n    ")
    assert load(tmp_path, made.format(f"return {text}")).num_envs == 1
    with pytest.raises(PlantFileError, match=r"ends the program, sys\.exit\(3\)"):
        load(tmp_path, "def make(num_envs):\n    raise SystemExit(3)\n")


def test_a_file_that_is_too_large_says_so(tmp_path: Path) -> None:
    with pytest.raises(PlantFileError, match=r"at most 10,000,000 bytes .* got 10,0"):
        load(tmp_path, "#" * 10_000_000)


@pytest.mark.parametrize("inputs", [[1.0], gym.spaces.Box(-1.0, 1.0, (1,), np.float64)])
def test_inputs_that_leave_no_choice_are_refused(inputs: object) -> None:
    env = acl_gym.plant(
        lambda x, u: [u[0]],
        **{"low": [-1], "high": [1], "inputs": inputs, "sampling_time": 0.1},
        goal=[0],
        max_episode_steps=7,
    )
    with pytest.raises(
        ValueError, match=r"chooses among two inputs or more, got a plant"
    ):
        as_vector_env(env)
