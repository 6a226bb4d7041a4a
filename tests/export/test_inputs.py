"""Real inputs in exported policies, against `predict`."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acl_gym import Crisp, Discrete, Fuzzy
from acl_gym.export.numpy_file import NUMPY_INPUT_CODE
from acl_gym.partitions import Grid
from acl_gym.policies import InterpolatedPolicy, TablePolicy
from tests.export.compiled import DTYPES, STRICT, actions_of, compiled
from tests.export.policies import hard_observations, random_policy

needs_gcc = pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")

# Reads observations in binary from stdin; writes whether each is valid, and its inputs.
MAIN = """
#include "{header}"
#include <stdio.h>

int main(void)
{{
    {observed} x[policy_OBSERVATIONS];
    while (fread(x, sizeof x, 1, stdin) == 1) {{
        {real} u[policy_INPUTS + 1] = {{0}};
        u[policy_INPUTS] = ({real})policy_input(x, u);
        if (fwrite(u, sizeof u, 1, stdout) != 1) {{
            return 1;
        }}
    }}
    return 0;
}}
"""


def inputs_in_c(
    header: Path,
    observations: np.ndarray,
    real: str = "double",
    observed: str = "",
    libraries: tuple[str, ...] = (),
) -> np.ndarray:
    """The inputs of each observation, and in the last column whether it is valid."""
    observed = observed or real
    source, program = header.with_suffix(".main.c"), header.with_suffix(".program")
    source.write_text(MAIN.format(header=header.name, real=real, observed=observed))
    command = ["gcc", "-std=c99", "-O2", *STRICT, str(source), "-o", str(program)]
    command += libraries
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    rows = np.ascontiguousarray(observations, dtype=DTYPES[observed])
    found = subprocess.run(
        [str(program)], input=rows.tobytes(), capture_output=True, check=True
    )
    return np.frombuffer(found.stdout, dtype=DTYPES[real]).reshape(len(rows), -1)


def grid_of(counts: tuple[int, ...], seed: int) -> np.ndarray:
    """The inputs of all actions of an irregular grid, in random order."""
    rng = np.random.default_rng(seed)
    axes = [np.cumsum(rng.uniform(0.1, 2.0, n)) - rng.uniform(0, 3) for n in counts]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    return rng.permutation(points.reshape(-1, len(counts)))


def between(
    kind: type[Grid], counts: tuple[int, ...], seed: int, **options: Any
) -> InterpolatedPolicy:
    inputs = grid_of(counts, seed)
    policy = random_policy(kind, (7, 6), (True, False), len(inputs), seed, **options)
    return InterpolatedPolicy(policy, inputs)


@needs_gcc
@settings(max_examples=10)  # each is compiled
@given(
    st.sampled_from([Fuzzy, Crisp]),
    st.lists(st.integers(1, 5), min_size=1, max_size=3),
    st.integers(0, 2**32 - 1),
)
def test_any_policy_to_the_bit_in_double(
    tmp_path_factory: pytest.TempPathFactory,
    kind: type[Grid],
    counts: list[int],
    seed: int,
) -> None:
    policy = between(kind, tuple(counts), seed)
    header = policy.to_c(tmp_path_factory.mktemp("any") / "p.h", precision="double")
    states = hard_observations(policy.greedy, 500, seed)
    found = inputs_in_c(header, states)
    np.testing.assert_array_equal(found[:, :-1], policy.predict(states)[0])
    assert (found[:, -1] == 1.0).all()


@needs_gcc
@pytest.mark.parametrize("kind", [Fuzzy, Crisp])
def test_actions_and_invalid_observations(kind: type[Grid], tmp_path: Path) -> None:
    policy = between(kind, (3, 4), 1)
    header = policy.to_c(tmp_path / "p", precision="double")
    states = hard_observations(policy.greedy, 200, seed=1)
    actions = actions_of(compiled(header, "double"), "double", states)
    np.testing.assert_array_equal(actions, policy.greedy.predict(states)[0])
    bad = [(np.nan, 0.0), (0.0, np.inf), (-np.inf, 0.0)]
    assert (inputs_in_c(header, np.array(bad)) == 0.0).all()


@needs_gcc
def test_angles_and_discrete_observations(tmp_path: Path) -> None:
    inputs = grid_of((3, 3), 2)
    round_one = random_policy(Fuzzy, (6, 5), (True, False), 9, 2, angles=[(0, 1)])
    policy = InterpolatedPolicy(round_one, inputs)
    header = policy.to_c(tmp_path / "angles.h", precision="double")
    states = hard_observations(round_one, 300, seed=2)
    found = inputs_in_c(header, states, libraries=("-lm",))
    wanted = policy.predict(states)[0]
    same = (found[:, :-1] == wanted).all(axis=1)
    assert same.mean() > 0.9  # atan2 may differ in the last place
    np.testing.assert_allclose(found[same, :-1], wanted[same])

    table = np.random.default_rng(3).random((12, 9))
    policy = InterpolatedPolicy(TablePolicy(Discrete(12), table), inputs)
    header = policy.to_c(tmp_path / "numbers.h", precision="double")
    numbers = np.arange(-1, 13)
    found = inputs_in_c(header, numbers[:, None], observed="int32_t")
    np.testing.assert_array_equal(found[1:-1, :-1], policy.predict(numbers[1:-1])[0])
    assert found[:, -1].tolist() == [0.0, *[1.0] * 12, 0.0]


@needs_gcc
def test_float_differs_little_where_levels_differ(tmp_path: Path) -> None:
    """Levels from 0 to 1 in steps of no less than 1/8 are exact in a float."""
    rng = np.random.default_rng(4)
    grid = Crisp([np.arange(40.0)])
    table = rng.permuted(np.tile(np.arange(5) / 8, (40, 1)), axis=1)
    policy = InterpolatedPolicy(TablePolicy(grid, table), [-2.0, -1.0, 0.0, 1.0, 2.0])
    header = policy.to_c(tmp_path / "p.h")
    states = np.arange(40.0)[:, None]
    found = inputs_in_c(header, states, "float")[:, :-1]
    np.testing.assert_allclose(found, policy.predict(states)[0], atol=1e-6)


def test_a_header_of_numbered_actions_is_as_before(tmp_path: Path) -> None:
    policy = random_policy(Fuzzy, (4,), (False,), 3, 0)
    text = policy.to_c(tmp_path / "p.h").read_text()
    assert "policy_input(" not in text
    assert "policy_below" not in text


@pytest.mark.parametrize("kind", [Fuzzy, Crisp])
def test_lines_of_numpy(kind: type[Grid], tmp_path: Path) -> None:
    policy = between(kind, (4, 3), 5)
    file = policy.to_numpy(tmp_path / "policy")
    names: dict[str, Any] = {}
    code = NUMPY_INPUT_CODE.replace('"policy.npz"', repr(str(file)))
    exec(compile(code, "lines", "exec"), names)
    states = np.clip(hard_observations(policy.greedy, 300, seed=5), -1e3, 1e3)
    found = np.array([names["act"](x) for x in states])
    wanted = policy.predict(states)[0]
    # Values of neighbours that tie but for rounding may be taken in another order.
    assert (np.abs(found - wanted).max(axis=1) < 1e-6).mean() > 0.97
