"""What an engineer says in one line, as numbers for pairs."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from acl_gym import (
    ACL,
    AntSystem,
    Crisp,
    Discrete,
    PolicyPrior,
    PotentialPrior,
    ScaledVectorObservation,
    WaitingVectorEnv,
)

Array = np.ndarray
CELLS = Crisp([[1.0, 3.0], [-2.0, 0.0, 2.0]], [2 * np.pi, None])


def pendulum() -> Any:
    return gym.make_vec("acl_gym/Pendulum-v0", num_envs=2)


def navigation() -> Any:
    return gym.make_vec("acl_gym/Navigation-v0", num_envs=2)


def test_the_nearest_torque_is_preferred() -> None:
    """Torques are -0.8, 0 and 0.8; -0.4 omega is 0.8, 0 or -0.8; 0.3 is next to 0."""
    brake = PolicyPrior(lambda states: -0.4 * states[:, 1], preferred=5.0, others=2.0)
    rows = [[2.0, 2.0, 5.0], [2.0, 5.0, 2.0], [5.0, 2.0, 2.0]]
    assert brake(pendulum(), CELLS).tolist() == rows * 2
    little = PolicyPrior(lambda states: np.full(len(states), 0.3))
    assert little(pendulum(), CELLS).tolist() == [[1.0, 10.0, 1.0]] * 6


def test_two_inputs_have_a_nearest_action_as_well() -> None:
    forces = navigation().unwrapped.system.forces
    cells = Crisp([[0.0], [0.0], [-1.0, 1.0], [0.0]])
    pull = PolicyPrior(lambda states: np.stack([states[:, 0] + 3.0, -states[:, 2]], 1))
    best = pull(navigation(), cells).argmax(axis=1)
    assert [forces[u] for u in best] == [(1.0, 1.0), (1.0, -1.0)]


def test_integers_are_the_numbers_of_actions() -> None:
    class Late(gym.Env[int, int]):
        observation_space = gym.spaces.Discrete(2)
        action_space = gym.spaces.Discrete(3, start=4)

    env = WaitingVectorEnv([Late])
    prior = PolicyPrior(lambda states: 4 + 2 * states)
    found = prior(env, Discrete(2))
    assert found.tolist() == [[10.0, 1.0, 1.0], [1.0, 1.0, 10.0]]
    for wrong in (3, 7):
        with pytest.raises(ValueError, match=r"actions in 4\.\.6, one for each of 2"):
            PolicyPrior(lambda states, wrong=wrong: [4, wrong])(env, Discrete(2))


@pytest.mark.parametrize(
    ("returned", "message"),
    [
        ([0.0] * 5, "for each of 6 states"),
        ([0] * 5, "for each of 6 states"),
        ("x", "for each of 6 states, got"),
        (None, "for each of 6 states, got"),
        (np.zeros((6, 2)), "must return 1 inputs for each state, torque u, N m, got 2"),
        ([0.0] * 5 + [np.nan], "finite real numbers"),
        (np.zeros((6, 1), int), r"actions in 0\.\.2"),
        ([True] * 6, "for each of 6 states"),
    ],
)
def test_what_is_neither_action_nor_input_is_refused(
    returned: Any, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        PolicyPrior(lambda states: returned)(pendulum(), CELLS)


def test_inputs_need_an_environment_that_says_what_they_are() -> None:
    env = WaitingVectorEnv([lambda: gym.make("CartPole-v1")])
    rule = PolicyPrior(lambda states: states[:, 0])
    with pytest.raises(ValueError, match="numbers of actions, integers, because"):
        rule(env, Crisp([[0.0]] * 4))


def test_the_next_state_of_least_potential_is_preferred() -> None:
    """One step of each torque from each centre, by the environment itself."""

    def speed(states: Array) -> Array:
        return np.abs(states[:, 1])

    env = pendulum()
    env.reset(seed=3)
    before = env.unwrapped._state.copy()
    found = PotentialPrior(speed, preferred=3.0, others=1.0)(env, CELLS)
    np.testing.assert_array_equal(env.unwrapped._state, before)
    for cell, state in enumerate(CELLS.cell_states()):
        after = np.empty(3)
        for action in range(3):
            env.reset(options={"state": np.tile(state, (2, 1))})
            after[action] = abs(env.step(np.full(2, action))[0][0, 1])
        share = (after - after.min()) / np.ptp(after)
        np.testing.assert_allclose(found[cell], 3.0 - 2.0 * share)


def test_where_actions_make_no_difference_all_are_preferred() -> None:
    flat = PotentialPrior(lambda states: np.ones(len(states)))
    assert (flat(pendulum(), CELLS) == 10.0).all()


def test_a_potential_needs_states_that_can_be_set() -> None:
    prior = PotentialPrior(lambda states: states[:, 0])
    foreign = WaitingVectorEnv([lambda: gym.make("CartPole-v1")])
    for env in (foreign, ScaledVectorObservation(pendulum())):
        with pytest.raises(ValueError, match="an environment of acl_gym without"):
            prior(env, CELLS)
    with pytest.raises(ValueError, match=r"each of 6 states, got shape \(6, 2\)"):
        PotentialPrior(lambda states: states)(pendulum(), CELLS)


@pytest.mark.parametrize("kind", [PolicyPrior, PotentialPrior])
def test_bad_arguments_are_refused(kind: Any) -> None:
    with pytest.raises(TypeError, match="must be a function of states, got 3"):
        kind(3)
    with pytest.raises(ValueError, match="preferred must lie in"):
        kind(np.sum, preferred=np.inf)
    with pytest.raises(TypeError, match="others must be a real number, got 'x'"):
        kind(np.sum, others="x")
    with pytest.raises(TypeError, match="needs a vector environment with Discrete"):
        kind(np.sum)(None, CELLS)


@pytest.mark.parametrize("env_id", ["acl_gym/Navigation-v0", "acl_gym/GridSearch2D-v0"])
def test_the_way_of_resetting_makes_no_difference(env_id: str) -> None:
    """An action that ends an episode is judged by where it ended, not by a new start."""

    def potential(states: Any) -> Any:
        return np.abs(states.reshape(len(states), -1)).sum(axis=1)

    found = [
        ACL(
            gym.make_vec(env_id, num_envs=3, autoreset_mode=mode),
            heuristic=PotentialPrior(potential),
        ).heuristic
        for mode in AutoresetMode
    ]
    assert all(np.array_equal(each, found[0]) for each in found)


def test_what_is_forbidden_is_the_worst() -> None:
    """A salesman cannot stay where he is."""
    distances = np.ones((4, 4))
    env = gym.make_vec("acl_gym/TravellingSalesman-v0", num_envs=2, distances=distances)
    prior = PotentialPrior(lambda cities: cities.reshape(-1) * 1.0)
    eta = AntSystem(env, heuristic=prior).heuristic
    assert eta is not None
    assert np.diag(eta).tolist() == [1.0] * 4
    assert eta[0].tolist() == [1.0, 10.0, 5.5, 1.0]
