"""The navigation's parameters: what they are, what is refused, what follows."""

import copy
import dataclasses
import itertools
import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces

from acl_gym.envs.navigation import Navigation, NavigationEnv, NavigationVectorEnv

ENV_ID = "acl_gym/Navigation-v0"
NAN, INF = float("nan"), float("inf")

POSITIVE = ("mass", "sampling_time", "position_max", "velocity_max")
NOT_NEGATIVE = ("base_damping", "force_weight")
NO_NUMBER = ("1", None, True, 1j, [1.0], np.array([1.0, 2.0]))
PAIRS = ("goal_bounds", "goal_spacing")
NO_PAIR = (
    [],
    1.0,
    None,
    "ab",
    [0.1],
    [0.1, 0.1, 0.1],
    [0.0, 0.1],
    [0.1, -0.1],
    [0.1, NAN],
    [0.1, INF],
    [0.1, 1j],
    [[0.1, 0.1]],
)
NO_PEAKS = (
    1.0,
    None,
    "",
    "abcde",
    [1.0, 0.0, 0.0, 1.0, 1.0],  # one peak, but not in a list
    [[1.0, 0.0, 0.0, 1.0]],
    [[1.0, 0.0, 0.0, 1.0, 1.0, 1.0]],
    [[1.0, 0.0, 0.0, 1.0, 1.0], [1.0, 0.0]],
    [[-1.0, 0.0, 0.0, 1.0, 1.0]],
    [[1.0, 0.0, 0.0, 0.0, 1.0]],
    [[1.0, 0.0, 0.0, 1.0, -1.0]],
    [[1.0, 0.0, 0.0, 1e-60, 1.0]],
    [[1.0, 1e200, 0.0, 1.0, 1.0]],
    [[1.0, NAN, 0.0, 1.0, 1.0]],
    [[INF, 0.0, 0.0, 1.0, 1.0]],
)
NO_FORCES = (
    [],
    1.0,
    None,
    [1.0, 0.0],
    [[1.0]],
    [[1.0, 0.0, 1.0]],
    [[1.0, 0.0], [1.0]],
    [[1.0, NAN]],
    [[1.0, 1j]],
    [["1", "0"]],
)
NO_WEIGHT = (
    1.0,
    None,
    "abcd",
    [1.0, 0.1],
    [1.0, 1.0, 1.0, -0.1],
    [1.0, 1.0, 1.0, NAN],
    np.eye(3),
    np.ones((4, 4)) - np.eye(4),  # an eigenvalue is -1
    np.triu(np.ones((4, 4))),  # not symmetric
    np.diag([1.0, 1.0, 1.0, INF]),
    1j * np.eye(4),
)

BAD = [
    *((name, value) for name in POSITIVE for value in (0.0, -1.0, NAN, INF)),
    *((name, value) for name in NOT_NEGATIVE for value in (-1e-9, NAN, -INF)),
    *((name, value) for name in POSITIVE + NOT_NEGATIVE for value in NO_NUMBER),
    *(("substeps", value) for value in (0, -1, 1.0, 1.5, NAN, "2", None, True)),
    *(("substeps", value) for value in (10_001, 10**12)),
    *((name, value) for name in PAIRS for value in NO_PAIR),
    *(("peaks", value) for value in NO_PEAKS),
    *(("forces", value) for value in NO_FORCES),
    *(("state_weight", value) for value in NO_WEIGHT),
    *(("cost", value) for value in ("quadratisch", "", None, 1)),
    *(("goal_rule", value) for value in ("bound", "Bounds", None, 1)),
]


@pytest.mark.parametrize(("name", "value"), BAD)
@pytest.mark.parametrize("make", [Navigation, NavigationEnv, NavigationVectorEnv])
def test_bad_value_is_refused_by_name(make: Any, name: str, value: Any) -> None:
    with pytest.raises((TypeError, ValueError), match=rf"^{name}\b"):
        make(**{name: value})


@pytest.mark.parametrize(
    "parameters",
    [
        # The strongest damping is 8.5 kg/s: 0.3 * 8.5 > 2.5.
        {"sampling_time": 0.3, "substeps": 1},
        {"mass": 0.5, "substeps": 1},
        {"base_damping": 13.0, "peaks": (), "substeps": 1},
        {"sampling_time": 0.6, "substeps": 2},
        # A needle that a grid would miss.
        {"peaks": [[40.0, 0.123, 4.567, 1e-3, 1e-3]]},
        {"base_damping": 1e300},
    ],
)
def test_steps_in_which_the_integration_would_diverge(parameters: Any) -> None:
    with pytest.raises(ValueError, match=r"sampling_time / substeps .*more substeps"):
        Navigation(**parameters)


def test_more_substeps_make_stronger_damping_possible() -> None:
    system = Navigation(base_damping=40.0, substeps=4)
    states, rewards = np.array([[0.0], [2.0], [0.0], [-2.0]]), np.empty(1)
    for _ in range(30):
        system.advance(states, np.array([4]), None, rewards, np.empty(1, dtype=bool))
    assert np.abs(states[[1, 3]]).max() < 1e-6


@pytest.mark.parametrize(
    "parameters",
    [
        {"forces": [[1e308, 0.0]], "mass": 1e-3, "base_damping": 0.0, "peaks": ()},
        {"sampling_time": 1e60, "base_damping": 0.0, "peaks": ()},
        {"position_max": 1e120},
        {"velocity_max": 1e120},
    ],
)
def test_leaps_beyond_all_measure_are_refused(parameters: Any) -> None:
    with pytest.raises(ValueError, match=r"^sampling_time, forces / mass"):
        Navigation(**parameters)


def test_costs_beyond_all_floats_are_refused() -> None:
    with pytest.raises(ValueError, match=r"^state_weight and force_weight"):
        Navigation(state_weight=[1e308] * 4)
    with pytest.raises(ValueError, match=r"^state_weight and force_weight"):
        Navigation(force_weight=1e308)


@pytest.mark.parametrize(
    ("rule", "name", "value"),
    [
        ("bounds", "goal_bounds", (5.0, 2.0)),
        ("bounds", "goal_bounds", (9.0, 9.0)),
        ("membership", "goal_spacing", (1e4, 1e4)),
    ],
)
def test_goal_that_leaves_no_initial_state_is_refused(
    rule: str, name: str, value: tuple[float, float]
) -> None:
    with pytest.raises(ValueError, match=rf"^{name} must leave 1%"):
        Navigation(goal_rule=rule, **{name: value})
    # The size of the rule that is not in use does not matter.
    other = "membership" if rule == "bounds" else "bounds"
    Navigation(goal_rule=other, **{name: value})


def test_unknown_parameter_is_refused() -> None:
    for make in (Navigation, NavigationEnv, NavigationVectorEnv):
        with pytest.raises(TypeError, match="masss"):
            make(masss=0.1)


@pytest.mark.parametrize("make", [gym.make, gym.make_vec])
def test_parameters_pass_through_the_registry(make: Any) -> None:
    env = make(ENV_ID, mass=2, peaks=[], cost="time", goal_rule="membership")
    assert env.unwrapped.system == Navigation(
        mass=2.0, peaks=(), cost="time", goal_rule="membership"
    )
    env.close()
    with pytest.raises(ValueError, match=r"^mass\b"):
        make(ENV_ID, mass=-0.1)


def test_defaults_are_those_of_the_thesis() -> None:
    assert dataclasses.asdict(Navigation()) == {
        "mass": 1.0,
        "base_damping": 0.5,
        "peaks": ((8.0, 0.0, -2.3, 2.5, 1.5), (8.0, 4.7, 1.0, 1.5, 2.0)),
        "forces": tuple(itertools.product((-1.0, 0.0, 1.0), (-1.0, 0.0, 1.0))),
        "sampling_time": 0.2,
        "substeps": 2,
        "position_max": 5.0,
        "velocity_max": 2.0,
        "cost": "quadratic",
        "goal_rule": "bounds",
        "goal_bounds": (0.25, 0.05),
        "goal_spacing": (0.1, 2.0),
        "state_weight": tuple(map(tuple, np.diag([0.2, 0.1, 0.2, 0.1]).tolist())),
        "force_weight": 0.0,
    }


@pytest.mark.parametrize("n", [1, 2, 25])
def test_one_action_for_each_force(n: int) -> None:
    env = NavigationEnv(forces=[(0.1 * i, -0.1 * i) for i in range(n)])
    assert env.action_space == spaces.Discrete(n)
    env.reset(seed=1)
    env.step(n - 1)
    with pytest.raises(ValueError, match=rf"0\.\.{n - 1}"):
        env.step(n)


def test_observation_space_is_the_state_space() -> None:
    space = Navigation(position_max=4.0, velocity_max=3.0).observation_space
    assert space.dtype == np.float64
    assert space.low.tolist() == [-4.0, -3.0, -4.0, -3.0]
    assert space.high.tolist() == [4.0, 3.0, 4.0, 3.0]


def test_equal_parameters_make_equal_systems() -> None:
    ours = Navigation()
    other = Navigation(
        mass=np.float64(1),
        peaks=np.array(ours.peaks),
        forces=np.array(ours.forces, dtype=np.int64),
        goal_bounds=[0.25, 0.05],
        state_weight=np.diag([0.2, 0.1, 0.2, 0.1]),
        substeps=np.int64(2),
        position_max=5,
    )
    assert ours == other
    assert hash(ours) == hash(other)
    assert ours != Navigation(peaks=ours.peaks[::-1])
    assert len({ours, other, Navigation(peaks=())}) == 2
    assert Navigation(peaks=[]) == Navigation(peaks=np.empty((0, 5)))


def test_parameters_do_not_change() -> None:
    forces, weight = [[-1.0, 0.0], [1.0, 0.0]], np.eye(4)
    system = Navigation(forces=forces, state_weight=weight)
    forces[0][0] = 7.0
    weight[:] = 7.0
    assert system.forces == ((-1.0, 0.0), (1.0, 0.0))
    assert system.state_weight == tuple(map(tuple, np.eye(4).tolist()))
    for field in dataclasses.fields(system):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(system, field.name, getattr(system, field.name))


@pytest.mark.parametrize(
    "twin", [copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))]
)
def test_systems_can_be_copied(twin: Any) -> None:
    system = Navigation(mass=2.0, cost="time")
    states = system.sample_states(np.random.default_rng(1), 8)
    other, moved = twin(system), states.copy()
    assert other == system
    for one, array in ((system, states), (other, moved)):
        actions, flags = np.zeros(8, dtype=np.int64), np.empty(8, dtype=np.bool_)
        one.advance(array, actions, None, np.empty(8), flags)
    np.testing.assert_array_equal(states, moved)


BAD_STATES = {
    "flat": [1.0, 0.0, 1.0, 0.0],
    "three variables": [[1.0, 0.0, 1.0]],
    "number": 1.0,
    "ragged": [[1.0, 0.0, 1.0, 0.0], [1.0]],
    "nan": [[1.0, NAN, 1.0, 0.0]],
    "infinite": [[INF, 0.0, 1.0, 0.0]],
    "too far": [[5.0001, 0.0, 0.0, 0.0]],
    "too fast": [[0.0, 0.0, 0.0, -2.0001]],
    "words": [["a", "b", "c", "d"]],
    "complex": [[1j, 0.0, 1.0, 0.0]],
}


@pytest.mark.parametrize("states", BAD_STATES.values(), ids=BAD_STATES)
def test_bad_states_are_refused(states: Any) -> None:
    with pytest.raises(ValueError, match=r"^states must"):
        Navigation().checked_states(states)


def test_message_names_the_first_bad_row_and_variable() -> None:
    good = [0.0, 0.0, 0.0, 0.0]
    with pytest.raises(ValueError, match=r"row 1\b"):
        Navigation().checked_states([good, [NAN, 0, 0, 0], [NAN, 0, 0, 0]])
    with pytest.raises(ValueError, match=r"v2 in \[-2, 2\].*-3 in row 1.*velocity_max"):
        Navigation().checked_states([good, [0, 0, 5, -3]])
    with pytest.raises(ValueError, match=r"c2 in \[-5, 5\].*9 in row 0.*position_max"):
        Navigation().checked_states([[0, 0, 9, -3]])
