"""The pendulum's parameters: what they are, what is refused, what follows from them."""

import copy
import dataclasses
import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces

from acl_gym.envs.pendulum import Pendulum, PendulumEnv, PendulumVectorEnv

ENV_ID = "acl_gym/Pendulum-v0"
NAN, INF = float("nan"), float("inf")

POSITIVE = (
    "inertia",
    "motor_gain",
    "mass",
    "length",
    "sampling_time",
    "omega_max",
)
NOT_NEGATIVE = ("damping", "gravity", "torque_weight")
NO_NUMBER = ("1", None, True, 1j, [1.0], np.array([1.0, 2.0]))
NO_VECTOR = (
    [],
    1.0,
    None,
    "abc",
    [1.0, None],
    [1.0, NAN],
    [1.0, INF],
    [1.0, 1j],
    [[1.0, 2.0]],
    [1.0, [2.0]],
)

BAD = [
    *((name, value) for name in POSITIVE for value in (0.0, -1.0, NAN, INF)),
    *((name, value) for name in NOT_NEGATIVE for value in (-1e-9, NAN, -INF)),
    *((name, value) for name in POSITIVE + NOT_NEGATIVE for value in NO_NUMBER),
    *(("substeps", value) for value in (0, -1, 1.0, 1.5, NAN, "2", None, True)),
    *(("substeps", value) for value in (10_001, 10**12)),
    *(("torques", value) for value in NO_VECTOR),
    *(("goal_bounds", value) for value in NO_VECTOR),
    *(
        ("goal_bounds", value)
        for value in ([0.1], [0.1, 0.1, 0.1], [0.0, 0.1], [0.1, -0.1])
    ),
    *(
        ("state_weight", value)
        for value in (
            1.0,
            None,
            "abcd",
            [1.0, 0.1],
            np.eye(3),
            [[1.0, 0.0], [0.0]],
            [[1.0, 0.2], [0.3, 1.0]],  # not symmetric
            [[1.0, 0.0], [0.0, -0.1]],
            [[1.0, 2.0], [2.0, 1.0]],  # an eigenvalue is -1
            [[1.0, NAN], [NAN, 1.0]],
            [[INF, 0.0], [0.0, 1.0]],
            [[1.0, 1j], [1j, 1.0]],
        )
    ),
]


@pytest.mark.parametrize(("name", "value"), BAD)
@pytest.mark.parametrize("make", [Pendulum, PendulumEnv, PendulumVectorEnv])
def test_bad_value_is_refused_by_name(make: Any, name: str, value: Any) -> None:
    with pytest.raises((TypeError, ValueError), match=rf"^{name}\b"):
        make(**{name: value})


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("torques", ["-1", "1"]),
        ("torques", np.array([-1.0, 1j])),
        ("goal_bounds", ["0.1", "0.1"]),
        ("goal_bounds", np.array([0.1, 0.1 + 1j])),
        ("state_weight", [["1", "0"], ["0", "1"]]),
        ("state_weight", 1j * np.eye(2)),
    ],
)
def test_arrays_of_other_types_are_refused(name: str, value: Any) -> None:
    with pytest.raises((TypeError, ValueError), match=rf"^{name}\b"):
        Pendulum(**{name: value})


@pytest.mark.parametrize("name", ["mass", "torques"])
def test_integers_beyond_all_floats_are_refused(name: str) -> None:
    value = 10**400
    with pytest.raises((TypeError, ValueError), match=rf"^{name}\b"):
        Pendulum(**{name: [value] if name == "torques" else value})


def test_goal_that_leaves_no_initial_state_is_refused() -> None:
    with pytest.raises(ValueError, match="goal_bounds"):
        Pendulum(goal_bounds=(4.0, 10.0))


@pytest.mark.parametrize("direction", [(1 / 3, 1.0), (0.3, 0.1), (1.0, -2.0)])
def test_weight_of_one_direction_only(direction: tuple[float, float]) -> None:
    # v v' is positive semi-definite, though rounding may say otherwise.
    weight = np.outer(direction, direction)
    assert np.array_equal(Pendulum(state_weight=weight).state_weight, weight)


@pytest.mark.parametrize("make", [Pendulum, PendulumEnv, PendulumVectorEnv])
def test_unknown_parameter_is_refused(make: Any) -> None:
    with pytest.raises(TypeError, match="masss"):
        make(masss=0.1)


@pytest.mark.parametrize("make", [gym.make, gym.make_vec])
def test_parameters_pass_through_the_registry(make: Any) -> None:
    env = make(ENV_ID, mass=0.2, torques=[-1, 1], substeps=3)
    assert env.unwrapped.system == Pendulum(mass=0.2, torques=(-1.0, 1.0), substeps=3)
    env.close()
    with pytest.raises(TypeError, match="masss"):
        make(ENV_ID, masss=0.1)
    with pytest.raises(ValueError, match=r"^mass\b"):
        make(ENV_ID, mass=-0.1)


def test_defaults_are_those_of_the_thesis() -> None:
    assert dataclasses.asdict(Pendulum()) == {
        "inertia": 0.005,
        "motor_gain": 0.1,
        "damping": 0.01,
        "mass": 0.1,
        "length": 0.1,
        "gravity": 9.81,
        "torques": (-0.8, 0.0, 0.8),
        "continuous": False,
        "sampling_time": 0.1,
        "substeps": 1,
        "omega_max": 9.0,
        "goal_bounds": (0.1, 0.1),
        "state_weight": ((1.0, 0.0), (0.0, 0.1)),
        "torque_weight": 0.05,
    }


@pytest.mark.parametrize("torques", [(0.5,), (-1.0, 1.0), tuple(range(-3, 4))])
def test_one_action_for_each_torque(torques: tuple[float, ...]) -> None:
    n = len(torques)
    env = PendulumEnv(torques=torques)
    assert env.action_space == env.system.action_space == spaces.Discrete(n)
    vector = PendulumVectorEnv(3, torques=torques)
    assert vector.single_action_space == spaces.Discrete(n)
    assert vector.action_space == spaces.MultiDiscrete([n, n, n])
    vector.reset(seed=1)
    vector.step([n - 1] * 3)
    with pytest.raises(ValueError, match=rf"0\.\.{n - 1}"):
        vector.step([n] * 3)


def test_observation_space_is_the_state_space() -> None:
    space = Pendulum(omega_max=4.0).observation_space
    assert space.dtype == np.float64
    assert space.low.tolist() == [0.0, -4.0]
    assert space.high.tolist() == [2 * np.pi, 4.0]


def test_parameters_do_not_change() -> None:
    torques = [-1.0, 1.0]
    weight = np.eye(2)
    system = Pendulum(torques=torques, state_weight=weight)
    torques.append(2.0)
    weight[:] = 7.0
    assert system.torques == (-1.0, 1.0)
    assert system.state_weight == ((1.0, 0.0), (0.0, 1.0))
    for field in dataclasses.fields(system):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(system, field.name, getattr(system, field.name))


def test_equal_parameters_make_equal_systems() -> None:
    ours = Pendulum()
    other = Pendulum(
        mass=np.float64(0.1),
        torques=np.array([-0.8, 0.0, 0.8]),
        goal_bounds=[0.1, 0.1],
        state_weight=np.diag([1, 0.1]),
        substeps=np.int64(1),
        omega_max=9,
    )
    assert ours == other
    assert hash(ours) == hash(other)
    assert ours != Pendulum(mass=0.2)
    assert ours != Pendulum(torques=(0.0, -0.8, 0.8))
    assert len({ours, other, Pendulum(substeps=2)}) == 2


@pytest.mark.parametrize(
    "twin", [copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))]
)
def test_systems_can_be_copied(twin: Any) -> None:
    system = Pendulum(mass=0.2, torques=(-1.0, 1.0))
    states = system.sample_states(np.random.default_rng(1), 8)
    other, moved = twin(system), states.copy()
    assert other == system
    for one, array in ((system, states), (other, moved)):
        actions, flags = np.zeros(8, dtype=np.int64), np.empty(8, dtype=np.bool_)
        one.advance(array, actions, None, np.empty(8), flags)
    np.testing.assert_array_equal(states, moved)


BAD_STATES = {
    "flat": [1.0, 2.0],
    "three variables": [[1.0, 2.0, 3.0]],
    "nested": [[[1.0, 2.0]]],
    "number": 1.0,
    "ragged": [[1.0, 2.0], [1.0]],
    "nan": [[1.0, NAN]],
    "infinite": [[INF, 1.0]],
    "too fast": [[1.0, 9.0001]],
    "too fast backwards": [[1.0, -9.0001]],
    "none": [[1.0, None]],
    "words": [["up", "down"]],
    "digits as strings": [["1.0", "2.0"]],
    "complex": [[1.0, 1j]],
    "complex array": np.array([[1.0, 1j]]),
    "beyond all floats": [[10**400, 0.0]],
    "object": [object()],
}


@pytest.mark.parametrize("states", BAD_STATES.values(), ids=BAD_STATES)
def test_bad_states_are_refused(states: Any) -> None:
    with pytest.raises(ValueError, match=r"state|omega"):
        Pendulum().checked_states(states)


def test_message_names_the_first_bad_row() -> None:
    with pytest.raises(ValueError, match=r"row 1\b"):
        Pendulum().checked_states([[0, 0], [NAN, 0], [NAN, 0]])
    with pytest.raises(ValueError, match=r"row 2\b.*omega_max"):
        Pendulum().checked_states([[0, 0], [0, 9], [0, -10]])


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (
            {"torques": [-1e10, 1e10]},
            r"keep the angle below 100000 rad .* up to 2e\+09",
        ),
        ({"omega_max": 1e300}, "keep the angle below 100000 rad in one step"),
        (
            {"state_weight": [[1e308, 0.0], [0.0, 1e308]]},
            "must give a finite stage cost",
        ),
        (
            {"torque_weight": 1e308, "torques": [-1e3, 1e3]},
            "finite stage cost, got inf",
        ),
    ],
)
def test_parameters_whose_steps_are_no_numbers_are_refused(
    changed: dict[str, Any], message: str
) -> None:
    """They gave NaN as state and reward, or minus infinity."""
    with pytest.raises(ValueError, match=message):
        Pendulum(**changed)
