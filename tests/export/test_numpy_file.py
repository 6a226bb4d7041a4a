"""The exported arrays, evaluated by the lines of the documentation alone."""

from __future__ import annotations

import inspect
import subprocess
import sys
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acl_gym import Crisp, Discrete, Fuzzy, QLearning, SoftPolicy
from acl_gym.export.numpy_file import NUMPY_CODE
from acl_gym.partitions import Grid
from acl_gym.policies import PartitionPolicy, TablePolicy
from tests.export.policies import hard_observations, random_policy


def act_by_numpy(policy: TablePolicy, path: Path, states: np.ndarray) -> list[int]:
    """Run the documented lines in this process, on a file at `path`."""
    written = policy.to_numpy(path)
    space: dict[str, object] = {}
    exec(NUMPY_CODE.replace("policy.npz", str(written)), space)
    return [space["act"](state) for state in states]  # type: ignore[operator]


def test_the_lines_are_those_of_the_docstring() -> None:
    docstring = inspect.getdoc(PartitionPolicy.to_numpy)
    assert docstring is not None
    shown = docstring.split("```python\n")[1].split("```")[0]
    assert shown == NUMPY_CODE


def test_runs_without_this_package(tmp_path: Path) -> None:
    policy = random_policy(Fuzzy, (7, 40), (True, False), 3, 3)
    states = hard_observations(policy, 1000, seed=4)[3:]  # without the huge ones
    policy.to_numpy(tmp_path / "policy")
    np.save(tmp_path / "states.npy", states)
    program = (
        "import sys\nsys.modules['acl_gym'] = None  # any import of it fails\n"
        f"{NUMPY_CODE}"
        "print(*[act(x) for x in np.load('states.npy')])\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    actions = [int(word) for word in done.stdout.split()]
    assert actions == policy.predict(states)[0].tolist()


@settings(max_examples=40)
@given(
    st.sampled_from([Fuzzy, Crisp]),
    st.lists(st.tuples(st.integers(1, 6), st.booleans()), min_size=1, max_size=4),
    st.integers(1, 7),
    st.booleans(),
    st.integers(0, 2**32 - 1),
)
def test_any_grid(
    tmp_path_factory: pytest.TempPathFactory,
    kind: type[Grid],
    axes: list[tuple[int, bool]],
    n_actions: int,
    regular: bool,
    seed: int,
) -> None:
    sizes, circular = zip(*axes, strict=True)
    policy = random_policy(kind, sizes, circular, n_actions, seed, regular)
    # Larger ones overflow in a division, of which NumPy warns; the action is right.
    states = np.clip(hard_observations(policy, 100, seed), -1e200, 1e200)
    actions = act_by_numpy(policy, tmp_path_factory.mktemp("n") / "p.npz", states)
    assert actions == policy.predict(states)[0].tolist()


@pytest.mark.parametrize(
    "partition",
    [
        Discrete(9, starts=-4),
        Discrete([[2, 3], [4, 5]], starts=3),
        Discrete(1),
        Discrete([2] * 14),
    ],
)
def test_discrete_states(partition: Discrete, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    table = rng.integers(0, 3, (partition.n_cells, 4)).astype(float)  # ties
    policy = TablePolicy(partition, table, first_action=2)
    states = partition.cell_states()[:200]
    actions = act_by_numpy(policy, tmp_path / "p", states)
    assert actions == policy.predict(states)[0].tolist()


def test_what_actions_mean(tmp_path: Path) -> None:
    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=2)
    agent = QLearning(env, seed=0)
    with np.load(agent.to_numpy(tmp_path / "p"), allow_pickle=False) as arrays:
        assert arrays["input_values"].tolist() == [[-0.8], [0.0], [0.8]]
        assert arrays["inputs"].tolist() == ["torque u, N m"]
        assert arrays["observations"].tolist()[1] == "angular velocity omega, rad/s"


def test_the_same_policy_gives_the_same_bytes(tmp_path: Path) -> None:
    policy = random_policy(Fuzzy, (3,), (True,), 2, 0)
    first = policy.to_numpy(tmp_path / "a").read_bytes()
    assert first == policy.to_numpy(tmp_path / "b.npz").read_bytes()


def test_refusals(tmp_path: Path) -> None:
    policy = random_policy(Fuzzy, (3,), (True,), 2, 0)
    with pytest.raises(FileNotFoundError, match="there is no folder"):
        policy.to_numpy(tmp_path / "nowhere" / "p")
    with pytest.raises(TypeError, match="got SoftPolicy, which draws its actions"):
        SoftPolicy(Fuzzy([[0.0, 1.0]]), np.ones((2, 2))).to_numpy(tmp_path / "p")
