"""What a controller returns becomes actions, or one clear error."""

from __future__ import annotations

import math
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.vector import SyncVectorEnv
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from acl_gym.envs.control.actuator import Actuator, nearest_actions

NUMBERS = st.floats(-10, 10, width=32)


class Boxed(gym.Env):
    """Has two real inputs."""

    observation_space = spaces.Box(-1, 1, (1,), np.float64)
    action_space = spaces.Box(np.array([-1, -2]), np.array([1, 2]), dtype=np.float64)


class Numbered(gym.Env):
    """Counts its actions from 5."""

    observation_space = spaces.Box(-1, 1, (1,), np.float64)
    action_space = spaces.Discrete(3, start=5)


class Parted(gym.Env):
    """Has actions of two parts."""

    observation_space = spaces.Box(-1, 1, (1,), np.float64)
    action_space = spaces.MultiDiscrete([2, 2])


def actuator(kind: Any, slots: int = 2) -> Actuator:
    if isinstance(kind, str):
        return Actuator(gym.make_vec(kind, num_envs=slots))
    return Actuator(SyncVectorEnv([kind] * slots))


@given(st.integers(1, 4), st.integers(1, 5), st.integers(1, 3), st.data())
def test_nearest_action_by_its_definition(
    n: int, n_actions: int, n_inputs: int, data: st.DataObject
) -> None:
    wanted = data.draw(hnp.arrays(np.float64, (n, n_inputs), elements=NUMBERS))
    available = data.draw(
        hnp.arrays(np.float64, (n_actions, n_inputs), elements=NUMBERS)
    )
    found = nearest_actions(wanted, available)
    for row, action in zip(wanted, found, strict=True):
        distances = [math.dist(row, inputs) for inputs in available]
        assert distances[action] == pytest.approx(min(distances), abs=1e-12)


def test_of_two_actions_that_are_equally_near_the_first() -> None:
    found = nearest_actions(np.array([[0.5]]), np.array([[1.0], [0.0], [1.0]]))
    assert found.tolist() == [0]


def test_physical_inputs_stand_for_the_nearest_action() -> None:
    pendulum = actuator("acl_gym/Pendulum-v0", 3)  # torques -0.8, 0, 0.8
    assert pendulum.of_controller("rule", [-9.0, 0.1, 0.5]).tolist() == [0, 1, 2]
    column = np.array([[-0.3], [0.41], [0.0]], dtype=np.float32)
    assert pendulum.of_controller("rule", column).tolist() == [1, 2, 1]
    vehicle = actuator("acl_gym/Navigation-v0", 2)
    assert vehicle.of_controller("rule", [[1.0, -0.2], [-7.0, 2.0]]).tolist() == [7, 2]


def test_numbers_of_actions_are_taken_as_they_are() -> None:
    pendulum = actuator("acl_gym/Pendulum-v0", 3)
    given = np.array([2, 0, 1], dtype=np.int32)
    taken = pendulum.of_controller("rule", given)
    assert taken.tolist() == [2, 0, 1]
    assert taken.dtype == np.int64
    later = actuator(Numbered, 2)
    assert later.of_controller("rule", [5, 7]).tolist() == [5, 7]
    assert later.of_learner([6, 6]).tolist() == [6, 6]


def test_rows_of_a_box_are_taken_as_they_are() -> None:
    taken = actuator(Boxed).of_controller("rule", [[1, -2], [0, 0]])
    assert taken.tolist() == [[1.0, -2.0], [0.0, 0.0]]
    assert taken.dtype == np.float64
    pendulum = Actuator(gym.make_vec("Pendulum-v1", num_envs=2))
    assert pendulum.of_controller("rule", [2.0, 0.1]).dtype == np.float32


@pytest.mark.parametrize(
    ("kind", "given", "error", "words"),
    [
        ("acl_gym/Pendulum-v0", [0, 3], ValueError, "2 integers in 0..2"),
        ("acl_gym/Pendulum-v0", [0, -1], ValueError, "2 integers in 0..2"),
        ("acl_gym/Pendulum-v0", [0], ValueError, "2 integers in 0..2"),
        ("acl_gym/Pendulum-v0", [True, False], TypeError, "2 integers in 0..2"),
        ("acl_gym/Pendulum-v0", "left", TypeError, "2 integers in 0..2"),
        (
            "acl_gym/Pendulum-v0",
            [0.0, math.nan],
            ValueError,
            "finite, got nan in slot 1",
        ),
        ("acl_gym/Pendulum-v0", [[0.0, 0.0]] * 2, ValueError, r"shape \(2, 1\)"),
        ("acl_gym/Pendulum-v0", [[0.0]] * 3, ValueError, r"shape \(2, 1\)"),
        ("acl_gym/Pendulum-v0", [[0.0], [0.0, 1.0]], TypeError, "2 integers"),
        (Numbered, [5.0, 6.0], ValueError, "the inputs of the actions are not known"),
        (Numbered, [4, 5], ValueError, "2 integers in 5..7"),
        (Numbered, [5, 8], ValueError, "2 integers in 5..7"),
        (Boxed, [[0, 0], [0, 3]], ValueError, r"\[-2, 2\], got 3 in slot 1; saturate"),
        (Boxed, [[0, 0], [0, math.inf]], ValueError, "finite, got inf in slot 1"),
        (Boxed, [0, 0], ValueError, r"shape \(2, 2\)"),
        (Boxed, [1j, 1j], ValueError, "must be real numbers"),
    ],
)
def test_what_is_refused(kind: Any, given: Any, error: Any, words: str) -> None:
    with pytest.raises(error, match=rf"what rule returns.*{words}"):
        actuator(kind).of_controller("rule", given)


def test_a_learner_chooses_numbers_and_nothing_is_rounded_for_it() -> None:
    with pytest.raises(TypeError, match=r"actions must be 2 integers in 0\.\.2"):
        actuator("acl_gym/Pendulum-v0").of_learner([0.1, 0.2])


def test_other_actions_are_refused() -> None:
    with pytest.raises(ValueError, match="must have Discrete or Box actions"):
        actuator(Parted)
