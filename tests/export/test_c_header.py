"""The exported header, compiled, against `predict`."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acl_gym import ACL, Crisp, Discrete, Fuzzy, Partition, QLearning, SoftPolicy
from acl_gym.export.c_header import MOST_NUMBERS
from acl_gym.partitions import Grid
from acl_gym.policies import TablePolicy, random_ranks
from tests.export.compiled import actions_of, compiled
from tests.export.policies import hard_observations, random_policy

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")

COUNT = 10_000
EPS = float(np.finfo(np.float32).eps)


def expected(policy: TablePolicy, observations: np.ndarray) -> np.ndarray:
    return policy.predict(observations)[0]


@pytest.fixture(scope="module")
def colony() -> ACL:
    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=100)
    grid = Fuzzy.from_box(env.single_observation_space, (16, 17), circular=[0])
    return ACL(env, grid, tau0=1e-4, seed=0).learn(trials=5)


def test_learned_policy_to_the_bit_in_double(colony: ACL, tmp_path: Path) -> None:
    header = colony.policy.to_c(tmp_path / "swing_up.h", precision="double")
    program = compiled(header, "double")
    states = hard_observations(colony.policy, COUNT, seed=1)
    actions = actions_of(program, "double", states)
    assert (actions == expected(colony.policy, states)).all()
    assert set(actions.tolist()) == {0, 1, 2}


@pytest.mark.parametrize("kind", [Fuzzy, Crisp])
@pytest.mark.parametrize("regular", [True, False])
def test_random_policies_to_the_bit_in_double(
    kind: type[Grid], regular: bool, tmp_path: Path
) -> None:
    policy = random_policy(kind, (7, 40, 1), (True, False, True), 5, 3, regular)
    program = compiled(policy.to_c(tmp_path / "p", precision="double"), "double")
    states = hard_observations(policy, COUNT, seed=2)
    actions = actions_of(program, "double", states)
    assert (actions == expected(policy, states)).all()
    assert len(np.unique(actions)) == 5


@settings(max_examples=15)  # each is compiled
@given(
    st.sampled_from([Fuzzy, Crisp]),
    st.lists(st.tuples(st.integers(1, 6), st.booleans()), min_size=1, max_size=4),
    st.integers(1, 7),
    st.booleans(),
    st.integers(0, 2**32 - 1),
)
def test_any_grid_to_the_bit_in_double(
    tmp_path_factory: pytest.TempPathFactory,
    kind: type[Grid],
    axes: list[tuple[int, bool]],
    n_actions: int,
    regular: bool,
    seed: int,
) -> None:
    sizes, circular = zip(*axes, strict=True)
    policy = random_policy(kind, sizes, circular, n_actions, seed, regular)
    header = policy.to_c(tmp_path_factory.mktemp("any") / "p.h", precision="double")
    states = hard_observations(policy, 500, seed)
    actions = actions_of(compiled(header, "double"), "double", states)
    assert (actions == expected(policy, states)).all()


def test_float_differs_only_within_rounding_fuzzy(tmp_path: Path) -> None:
    """Where float and double choose differently, the two values tie but for rounding.

    Rounding moves x by at most 2 eps of the largest centre (centre and difference), a
    share by that over the spacing; a value by the shares of both axes, and by the
    rounding of levels, products and sums, about 10 eps.
    """
    policy = random_policy(Fuzzy, (20, 21), (False, False), 3, 5)
    header = policy.to_c(tmp_path / "p.h", precision="float")
    states = _within_float(hard_observations(policy, COUNT, seed=6))
    actions = actions_of(compiled(header, "float"), "float", states)
    wanted = expected(policy, states)
    differ = np.flatnonzero(actions != wanted)
    # So many only because a third of the states lie on centres and halfway between
    # them, where cells with levels alike hand over to each other's order of ties.
    assert differ.size < 0.05 * COUNT
    index, degree = policy.partition(states[differ])
    values = (degree[:, :, None] * policy.table[index]).sum(axis=1)
    rows = np.arange(differ.size)
    first = policy.first_action
    gap = values[rows, wanted[differ] - first] - values[rows, actions[differ] - first]
    edges = np.concatenate(policy.partition.centres)
    share = 2 * EPS * np.abs(edges).max() / 0.3
    assert (gap <= (2 * 2 * share + 10 * EPS) * policy.table.max()).all()


def test_float_differs_only_within_rounding_crisp(tmp_path: Path) -> None:
    """A crisp policy in float is that of a state as near as rounding moves a border."""
    policy = random_policy(Crisp, (20, 21), (True, False), 3, 5)
    header = policy.to_c(tmp_path / "p.h")
    states = _within_float(hard_observations(policy, COUNT, seed=6))
    turns = np.abs(states).max(axis=1) < 50.0  # few turns: each adds a rounding
    states = states[turns]
    actions = actions_of(compiled(header, "float"), "float", states)
    wanted = expected(policy, states)
    differ = actions != wanted
    assert differ.mean() < 0.05  # a third of the states lie on or next to borders
    reach = 8 * EPS * 50.0
    moved = np.stack([
        expected(policy, states + reach * np.array(side))
        for side in [(-1, -1), (-1, 1), (1, -1), (1, 1)]
    ])  # fmt: skip
    assert (moved == actions)[:, differ].any(axis=0).all()


def _within_float(states: np.ndarray) -> np.ndarray:
    """States that a float holds exactly, so that both are asked the same."""
    return np.clip(states, -1e6, 1e6).astype(np.float32).astype(np.float64)


@pytest.mark.parametrize("precision", ["float", "double"])
@pytest.mark.parametrize("kind", [Fuzzy, Crisp])
def test_what_predict_refuses_is_invalid(
    kind: type[Grid], precision: str, tmp_path: Path
) -> None:
    policy = random_policy(kind, (3, 1), (True, False), 3, 0)
    header = policy.to_c(tmp_path / "p.h", precision=precision, name="it")
    bad = [(np.nan, 0.0), (0.0, np.nan), (np.inf, 0.0), (0.0, -np.inf)]
    actions = actions_of(
        compiled(header, precision, "it"), precision, np.array([*bad, (0.0, 0.0)])
    )
    assert (actions[:4] == policy.first_action - 1).all()
    assert actions[4] == policy.predict([0.0, 0.0])[0]
    for row in bad:
        with pytest.raises(ValueError, match="finite"):
            policy.predict(row)


@pytest.mark.parametrize(
    ("partition", "number"),
    [
        (Discrete(9, starts=-4), "int32_t"),
        (Discrete([3, 1, 5], starts=[0, 7, -2]), "int32_t"),
        (Discrete([[2, 3], [4, 5]]), "int32_t"),
        (Discrete([3, 4], starts=[2**40, 0]), "int64_t"),
    ],
)
def test_discrete_states(partition: Discrete, number: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    table = rng.integers(0, 3, (partition.n_cells, 4)).astype(float)  # ties
    policy = TablePolicy(partition, table, first_action=2)
    program = compiled(policy.to_c(tmp_path / "p.h"), number)
    states = partition.cell_states()
    actions = actions_of(program, number, states.reshape(len(states), -1))
    assert actions.tolist() == expected(policy, states).tolist()
    flat = states.reshape(len(states), -1)
    outside = np.stack([flat.min(axis=0), flat.max(axis=0)])
    outside[0, -1] -= 1
    outside[1, -1] += 1
    assert actions_of(program, number, outside).tolist() == [1, 1]


def test_tables_of_any_size_of_numbers(tmp_path: Path) -> None:
    """Levels beyond a float are scaled; minus infinity is a level of crisp cells."""
    rng = np.random.default_rng(0)
    states = rng.uniform(-1, 3, (200, 1)).astype(np.float32).astype(float)
    fuzzy = TablePolicy(Fuzzy([[0, 1, 2]]), 1e-200 * rng.exponential(size=(3, 3)))
    program = compiled(fuzzy.to_c(tmp_path / "f.h"), "float")
    same = actions_of(program, "float", states) == expected(fuzzy, states)
    assert same.all()
    table = np.where(np.eye(3) > 0, 0.0, -np.inf)
    crisp = TablePolicy(Crisp([[0, 1, 2]]), table)
    program = compiled(crisp.to_c(tmp_path / "c.h"), "float")
    assert (actions_of(program, "float", states) == expected(crisp, states)).all()


def test_more_than_256_actions_and_cells(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    partition = Fuzzy([np.arange(300.0)])
    policy = TablePolicy(partition, rng.integers(0, 2, (300, 300)).astype(float))
    states = rng.uniform(-1, 301, (1000, 1))
    header = policy.to_c(tmp_path / "p.h", precision="double")
    actions = actions_of(compiled(header, "double"), "double", states)
    assert (actions == expected(policy, states)).all()


@pytest.mark.parametrize("kind", [Fuzzy, Crisp])
@pytest.mark.skipif(shutil.which("g++") is None, reason="needs g++")
def test_compiles_as_cpp(kind: type[Grid], tmp_path: Path) -> None:
    policy = random_policy(kind, (4, 5), (True, False), 3, 0)
    header = policy.to_c(tmp_path / "p.h", precision="double", inputs=[1, 2, 3])
    compiler = ("g++", "-x", "c++", "-std=c++11", "-O2")
    program = compiled(header, "double", compiler=compiler)
    states = hard_observations(policy, 1000, 1)
    assert (actions_of(program, "double", states) == expected(policy, states)).all()


def test_inputs_of_the_system_and_of_the_user(colony: ACL, tmp_path: Path) -> None:
    text = colony.policy.to_c(tmp_path / "a.h").read_text()
    assert "x[1]: angular velocity omega, rad/s; centres -9 to 9" in text
    assert "2  torque u, N m = 0.8" in text
    rows = re.search(r"policy_inputs\[3\]\[1\] = \{(.*?)\};", text, re.DOTALL)
    assert rows is not None
    assert re.findall(r"[-\d.]+f", rows[1]) == ["-0.8f", "0.0f", "0.8f"]
    text = colony.to_c(tmp_path / "b.h", inputs=[[0, 1], [2, 3], [4, 5.5]]).read_text()
    assert "policy_inputs[3][2]" in text
    assert "2  u[0] = 4.0; u[1] = 5.5" in text
    with pytest.raises(ValueError, match="each of the 3 actions, got 2"):
        colony.to_c(tmp_path / "c.h", inputs=[1, 2])
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.h", "b.h"]


def test_an_agent_without_an_environment_names_the_inputs_of_its_file(
    colony: ACL, tmp_path: Path
) -> None:
    colony.save(tmp_path / "agent")
    loaded = ACL.load(tmp_path / "agent")
    text = loaded.policy.to_c(tmp_path / "p.h").read_text()
    assert "policy_inputs[3][1]" in text
    assert text == colony.policy.to_c(tmp_path / "p.h").read_text()
    again = ACL.load(tmp_path / "agent", colony.env).to_c(tmp_path / "q.h").read_text()
    assert again.replace("q.h", "p.h") == text


def test_an_agent_that_never_had_an_environment_names_no_inputs(
    colony: ACL, tmp_path: Path
) -> None:
    agent = ACL(None, colony.partition, n_actions=3)
    text = agent.policy.to_c(tmp_path / "p.h").read_text()
    assert "inputs" not in text


def test_the_stated_memory_is_that_of_the_tables(tmp_path: Path) -> None:
    policy = random_policy(Fuzzy, (5, 6), (True, False), 3, 0)
    text = policy.to_c(tmp_path / "p.h").read_text()
    # A circle of 5 arcs, a line of 5 intervals: 3 halvings each, and 4 tests of bounds;
    # 4 corners with 2 shares and 3 actions each, and a period.
    assert "at most 14 comparisons of real numbers to locate x, 3 divisions" in text
    assert " 21 multiplications" in text
    stated = re.search(r"([\d,]+) bytes of constant tables", text)
    assert stated is not None
    sizes = {"float": 4, "uint8_t": 1, "int32_t": 4}
    tables = re.findall(r"static const (\w+) \w+\[(\d+)\] = \{(.*?)\}", text, re.DOTALL)
    for _, size, body in tables:
        assert int(size) == len(body.replace("\n", "").split(","))
    assert {name for name, _, _ in tables} == set(sizes)
    total = sum(sizes[name] * int(size) for name, size, _ in tables)
    assert int(stated[1].replace(",", "")) == total


@pytest.mark.parametrize("kind", [Fuzzy, Crisp])
def test_the_stack_is_about_what_is_stated(kind: type[Grid], tmp_path: Path) -> None:
    policy = random_policy(kind, (4, 5, 6), (True, False, False), 3, 0)
    header = policy.to_c(tmp_path / "p.h", precision="double")
    compiled(header, "double", compiler=("gcc", "-std=c99", "-O2", "-fstack-usage"))
    usage = next(tmp_path.glob("*.su")).read_text()
    used = max(int(line.split("\t")[1]) for line in usage.splitlines())
    stated = re.search(r"(\d+) bytes of local", header.read_text())
    assert stated is not None
    # Beside what is declared: main's observation, and 14 registers of 8 bytes.
    assert used <= int(stated[1]) + 24 + 8 + 14 * 8


def test_the_same_policy_gives_the_same_bytes(tmp_path: Path) -> None:
    first, second = (
        random_policy(Fuzzy, (5, 6), (True, False), 3, 0).to_c(tmp_path / f"{i}" / "p")
        for i in range(2)
        if (tmp_path / f"{i}").mkdir() is None
    )
    assert first.name == "p.h"
    assert first.read_bytes() == second.read_bytes()


@pytest.mark.parametrize(
    "name", ["", "1st", "swing up", "a-b", "_a", "a__b", "pólicy", "a;b", "x" * 41, 3]
)
def test_refuses_names_that_are_no_identifiers(name: object, tmp_path: Path) -> None:
    policy = random_policy(Crisp, (2,), (False,), 2, 0)
    with pytest.raises(ValueError, match="name must be a C identifier"):
        policy.to_c(tmp_path / "p.h", name=name)  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())


def test_refuses_other_arguments(tmp_path: Path) -> None:
    policy = random_policy(Fuzzy, (2,), (False,), 2, 0)
    with pytest.raises(ValueError, match="precision must be one of 'float', 'double'"):
        policy.to_c(tmp_path / "p.h", precision="single")
    with pytest.raises(FileNotFoundError, match="there is no folder"):
        policy.to_c(tmp_path / "nowhere" / "p.h")
    folder = tmp_path / "folder.h"
    folder.mkdir()
    with pytest.raises(IsADirectoryError, match=r"folder\.h is a folder"):
        policy.to_c(folder)
    n = MOST_NUMBERS // 2 + 1
    large = TablePolicy(Fuzzy([np.arange(n)]), np.zeros((n, 2)), np.zeros((n, 2), int))
    with pytest.raises(ValueError, match="a header holds at most 4,000,000 numbers"):
        large.to_c(tmp_path / "p.h")
    policy.table[0, 0] = np.nan
    with pytest.raises(ValueError, match="must hold finite numbers"):
        policy.to_c(tmp_path / "p.h")
    near = Fuzzy([[1.0, 1.0 + 1e-12]])
    with pytest.raises(ValueError, match=r"differ as floats.*precision='double'"):
        TablePolicy(near, np.zeros((2, 2))).to_c(tmp_path / "p.h")
    assert not (tmp_path / "p.h").exists()


def test_float_on_a_learned_policy(colony: ACL, tmp_path: Path) -> None:
    """On uniform states fewer than 1 in 1,000 differ: those within 10^-5 of a border."""
    policy = colony.policy
    program = compiled(policy.to_c(tmp_path / "p.h"), "float")
    rng = np.random.default_rng(0)
    states = _within_float(rng.uniform([0.0, -9.0], [2 * np.pi, 9.0], (COUNT, 2)))
    actions = actions_of(program, "float", states)
    assert (actions != expected(policy, states)).sum() < COUNT // 1000


def test_refuses_policies_that_are_no_greedy_table(tmp_path: Path) -> None:
    grid = Fuzzy([[0.0, 1.0]])
    soft = SoftPolicy(grid, np.ones((2, 2)))
    with pytest.raises(TypeError, match="got SoftPolicy, which draws its actions"):
        soft.to_c(tmp_path / "p.h")

    class Own(Crisp):
        def locate(self, states, slots, index, degree):  # type: ignore[no-untyped-def]
            index[:] = 0
            degree[:] = 1.0

    own = TablePolicy(Own([[0.0, 1.0]]), np.zeros((2, 2)))
    with pytest.raises(TypeError, match="got Own, which locates states"):
        own.to_c(tmp_path / "p.h")


def test_words_cannot_leave_the_comment(tmp_path: Path) -> None:
    from acl_gym.envs.control.signals import Signals

    evil = "angle */ int x; /* °\\\n??/"
    partition: Partition = Crisp([[0.0, 1.0]])
    signals = Signals((evil,), (evil,), ((1.0,), (2.0,)))
    ranks = random_ranks(2, 2, np.random.default_rng(0))
    policy = TablePolicy(partition, np.eye(2), ranks, signals=signals)
    program = compiled(policy.to_c(tmp_path / "p.h"), "float")
    assert actions_of(program, "float", np.array([[0.0], [1.0]])).tolist() == [0, 1]


def test_q_learning_exports_too(tmp_path: Path) -> None:
    env = gym.make_vec("acl_gym/GridSearch2D-v0", num_envs=20)
    agent = QLearning(env, seed=0).learn(trials=3)
    header = agent.policy.to_c(tmp_path / "p.h")
    states = np.arange(agent.partition.n_cells)
    actions = actions_of(compiled(header, "int32_t"), "int32_t", states[:, None])
    assert (actions == agent.predict(states)[0]).all()
    assert "2  rows to the south = 0.0; columns to the east = 1.0" in header.read_text()
