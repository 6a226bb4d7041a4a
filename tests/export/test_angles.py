"""Exported policies take observations with cosine and sine of an angle as they are."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acl_gym.envs.control.signals import Signals
from acl_gym.partitions import Crisp, Fuzzy, Grid
from acl_gym.policies import TablePolicy
from tests.export.compiled import actions_of, compiled
from tests.export.policies import hard_observations, random_policy
from tests.export.test_numpy_file import act_by_numpy

needs_gcc = pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")

COUNT = 10_000

# Cosine before and after the sine, next to each other and apart; with a lone centre.
LAYOUTS = [
    ((7, 5), [(0, 1)]),
    ((7, 5), [(2, 0)]),
    ((4, 6, 3), [(3, 1)]),
    ((6, 5, 3, 1), [(0, 1), (3, 2)]),
    ((16,), [(1, 0)]),
    ((1, 5, 4), [(4, 0), (1, 2)]),
]


def angled_policy(
    kind: type[Grid], layout: tuple[tuple[int, ...], list[tuple[int, int]]], seed: int
) -> TablePolicy:
    sizes, angles = layout
    circular = (False,) * len(sizes)
    return random_policy(kind, sizes, circular, 4, seed, regular=False, angles=angles)


def differences(
    policy: TablePolicy, states: np.ndarray, actions: np.ndarray, reach: float
) -> int:
    """How many actions differ; each must be best, or tie, for angles turned by `reach`."""
    wanted = policy.predict(states)[0]
    differ = np.flatnonzero(actions != wanted)
    grid = policy.partition
    assert isinstance(grid, (Crisp, Fuzzy))
    for row in differ:
        variables = grid.variables(states[row : row + 1])
        around = list(grid._angles.circular)
        good = False
        for sides in np.ndindex(*(3,) * len(around)):
            near = variables.copy()
            near[:, around] += reach * (np.array(sides) - 1.0)
            index, degree = grid(grid.observations(near))
            values = (degree[0, :, None] * policy.table[index[0]]).sum(axis=0)
            chosen = values[actions[row] - policy.first_action]
            good |= bool(chosen >= values.max() * (1.0 - 1e-12))
        assert good, (row, states[row])
    return differ.size


@needs_gcc
@pytest.mark.parametrize("kind", [Fuzzy, Crisp])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_c_in_double(
    kind: type[Grid],
    layout: tuple[tuple[int, ...], list[tuple[int, int]]],
    tmp_path: Path,
) -> None:
    """Where atan2 of C is that of NumPy, as without vector units, nothing differs."""
    policy = angled_policy(kind, layout, 3)
    header = policy.to_c(tmp_path / "p.h", precision="double")
    program = compiled(header, "double", libraries=("-lm",))
    states = hard_observations(policy, COUNT, seed=2)
    actions = actions_of(program, "double", states)
    # A third lie on borders on purpose, where the last place of an angle decides.
    assert differences(policy, states, actions, 1e-15) < COUNT // 100
    rng = np.random.default_rng(4)
    inside = grid_observations(policy, rng, COUNT)
    actions = actions_of(program, "double", inside)
    assert differences(policy, inside, actions, 1e-15) <= 1
    assert len(np.unique(actions)) == 4


def grid_observations(
    policy: TablePolicy, rng: np.random.Generator, count: int
) -> np.ndarray:
    """Uniform over the ranges of a grid, and so on no border."""
    grid = policy.partition
    assert isinstance(grid, (Crisp, Fuzzy))
    columns = [rng.uniform(line[0], line[-1] + 1.0, count) for line in grid.centres]
    return grid.observations(np.stack(columns, axis=1))


@needs_gcc
@pytest.mark.parametrize("kind", [Fuzzy, Crisp])
def test_c_in_float(kind: type[Grid], tmp_path: Path) -> None:
    """Fewer than 1 in 1,000 uniform observations are within 10^-5 of a border."""
    policy = angled_policy(kind, LAYOUTS[3], 5)
    program = compiled(policy.to_c(tmp_path / "p"), "float", libraries=("-lm",))
    states = grid_observations(policy, np.random.default_rng(0), COUNT)
    states = states.astype(np.float32).astype(np.float64)
    actions = actions_of(program, "float", states)
    assert (actions != policy.predict(states)[0]).sum() < COUNT // 1000


@needs_gcc
@pytest.mark.parametrize("precision", ["float", "double"])
@pytest.mark.parametrize("kind", [Fuzzy, Crisp])
def test_what_predict_refuses_is_invalid_in_c(
    kind: type[Grid], precision: str, tmp_path: Path
) -> None:
    policy = angled_policy(kind, LAYOUTS[3], 0)
    header = policy.to_c(tmp_path / "p.h", precision=precision)
    bad = np.zeros((18, 6))
    for row, value in enumerate((np.nan, np.inf, -np.inf)):
        bad[6 * row : 6 * row + 6][np.diag_indices(6)] = value
    bad = np.vstack([bad, [[np.inf, -np.inf, 0, 0, 0, 0]], np.zeros((1, 6))])
    program = compiled(header, precision, libraries=("-lm",))
    actions = actions_of(program, precision, bad)
    assert (actions[:-1] == policy.first_action - 1).all()
    assert actions[-1] == policy.predict(np.zeros(6))[0]
    for row in bad[:-1]:
        with pytest.raises(ValueError, match="states must be finite"):
            policy.predict(row)


@needs_gcc
@pytest.mark.skipif(shutil.which("g++") is None, reason="needs g++")
def test_compiles_as_cpp_and_within_the_stated_stack(tmp_path: Path) -> None:
    policy = angled_policy(Fuzzy, LAYOUTS[3], 0)
    header = policy.to_c(tmp_path / "p.h", precision="double")
    compiler = ("g++", "-x", "c++", "-std=c++11", "-O2", "-fstack-usage")
    program = compiled(header, "double", compiler=compiler, libraries=("-lm",))
    states = grid_observations(policy, np.random.default_rng(1), 1000)
    actions = actions_of(program, "double", states)
    assert differences(policy, states, actions, 1e-15) <= 1
    lines = next(tmp_path.glob("*.su")).read_text().splitlines()
    used = max(int(line.split("\t")[1]) for line in lines)
    stated = next(
        line for line in header.read_text().splitlines() if "bytes of local" in line
    )
    # Beside what is declared: main's observation, and 14 registers of 8 bytes.
    assert used <= int(stated.split(", ")[1].split()[0]) + 48 + 8 + 14 * 8


def test_the_head_of_a_header_explains_the_angle(tmp_path: Path) -> None:
    names = ("cos theta", "speed, m/s", "height, m", "sin theta")
    signals = Signals(names, ("force, N",), ((-1.0,), (1.0,)))
    grid = Crisp([[0.0, 3.0], [0.0, 1.0], [2.0, 4.0]], angles=[(0, 3)])
    policy = TablePolicy(grid, np.ones((8, 2)), signals=signals)
    text = policy.to_c(tmp_path / "p.h").read_text()
    for line in (
        "Observations, float x[4]:",
        "x[0]: cos theta; cosine of an angle, its sine is x[3]",
        "x[1]: speed, m/s; centres 0 to 1",
        "x[2]: height, m; centres 2 to 4",
        "x[3]: sin theta; sine of the angle with cosine x[0]",
        "cc -std=c99 -O2 main.c -o main -lm",
        "1 call of atan2f.",
        "v[0] = atan2f(x[3], x[0]);",
        "v[2] = x[2];",
        "crisp cells, 2 x 2 x 2, 2 actions",
    ):
        assert line in text
    twice = policy.to_c(tmp_path / "d.h", precision="double").read_text()
    assert "which may differ in the last place" in twice
    plain = TablePolicy(Crisp(grid.centres), np.ones((8, 2))).to_c(tmp_path / "q.h")
    assert "math.h>" not in plain.read_text().replace("the one of <math.h>", "")
    with np.load(policy.to_numpy(tmp_path / "n")) as arrays:
        assert arrays["columns"].tolist() == [0, 1, 2]
        assert arrays["sines"].tolist() == [3, -1, -1]
        assert arrays["observations"].tolist() == list(names)


@settings(max_examples=30)
@given(
    st.sampled_from([Fuzzy, Crisp]), st.sampled_from(LAYOUTS), st.integers(0, 2**32 - 1)
)
def test_the_lines_of_numpy(
    tmp_path_factory: pytest.TempPathFactory,
    kind: type[Grid],
    layout: tuple[tuple[int, ...], list[tuple[int, int]]],
    seed: int,
) -> None:
    policy = angled_policy(kind, layout, seed)
    # Larger ones overflow in a division, of which NumPy warns; the action is right.
    states = np.clip(hard_observations(policy, 100, seed), -1e200, 1e200)
    actions = act_by_numpy(policy, tmp_path_factory.mktemp("n") / "p.npz", states)
    assert differences(policy, states, np.array(actions), 1e-15) <= 1


def test_the_lines_of_numpy_take_float32(tmp_path: Path) -> None:
    policy = angled_policy(Crisp, LAYOUTS[1], 1)
    rng = np.random.default_rng(2)
    states = grid_observations(policy, rng, 300).astype(np.float32)
    actions = act_by_numpy(policy, tmp_path / "p.npz", states)
    assert actions == policy.predict(states)[0].tolist()
