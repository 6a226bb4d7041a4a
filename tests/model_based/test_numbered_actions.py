"""Plants that number their actions, where somebody knows what these set."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from acl_gym import Transitions, learn_from_plant
from acl_gym.envs.learned import LearnedDynamics
from tests.model_based.plants import QUICK, pendulum, quick

PUSHES = [-1.0, 0.0, 1.0]
"""What the actions of the mountain car set."""


class Noted(gym.Wrapper[Any, Any, Any, Any]):
    """Keeps the actions that it was given."""

    def __init__(self, env: Any) -> None:
        super().__init__(env)
        self.given: list[Any] = []

    def step(self, action: Any) -> Any:
        self.given.append(action)
        return self.env.step(action)


class Torques(gym.ActionWrapper[Any, Any, Any]):
    """Gymnasium's pendulum with numbered torques, of which it does not tell."""

    def __init__(self, count: int, first: int = 0) -> None:
        super().__init__(gym.make("Pendulum-v1", max_episode_steps=40))
        self.torques, self.first = (
            np.linspace(-2.0, 2.0, count, dtype=np.float32),
            first,
        )
        self.action_space = gym.spaces.Discrete(count, start=first)

    def action(self, action: Any) -> Any:
        assert self.first <= action < self.first + len(self.torques)
        return self.torques[[action - self.first]]


def test_what_actions_set_is_recorded() -> None:
    env = Noted(gym.make("MountainCar-v0"))
    learned = learn_from_plant(
        env, quick, 40, rounds=2, inputs=PUSHES, model_steps=200, seed=0
    )
    data = learned.transitions
    np.testing.assert_array_equal(data.inputs[:, 0], np.array(env.given) - 1.0)
    assert not data.description.numbered
    assert data.description.values == ((-1.0,), (0.0,), (1.0,))
    assert learned.model.single_action_space == env.action_space
    np.testing.assert_array_equal(learned.model.system.inputs[:, 0], PUSHES)
    actions, _ = learned.predict(data.states[:5])
    assert set(actions) <= {0, 1, 2}


def missed(inputs: Any) -> float:
    """The error of the velocity after a push that was never recorded, relative to it."""

    def backwards_or_not(observation: Any) -> Any:
        return np.array([rng.integers(2)])

    rng = np.random.default_rng(0)
    data = Transitions.record(
        gym.make("MountainCar-v0"), 150, backwards_or_not, inputs=inputs, seed=0
    )
    states = data.states[:100]  # where the car was
    # v' = v + 0.001 push - 0.0025 cos(3 x), of MountainCar-v0.
    expected = states[:, 1] + 0.001 - 0.0025 * np.cos(3 * states[:, 0])
    pushed = np.full((1, 100), 2.0 if inputs is None else inputs[2])
    found = LearnedDynamics(data).next_variables(
        np.ascontiguousarray(states.T), pushed
    )[1]
    return float(np.sqrt(np.mean((found - expected) ** 2)) / 0.001)


def test_a_model_knows_an_action_that_was_never_tried() -> None:
    """From the others, where it was told what they set; by numbers it cannot."""
    assert missed(PUSHES) < 0.05
    assert missed(None) > 0.5


def test_a_model_of_the_mountain_car_is_as_good_from_values_as_from_flags() -> None:
    """Of three actions that were all tried there is nothing more to be known."""
    errors = []
    for inputs in (PUSHES, None):
        learned = learn_from_plant(
            gym.make("MountainCar-v0"),
            quick,
            150,
            rounds=[75],
            inputs=inputs,
            model_steps=200,
            seed=0,
        )
        errors.append(learned.history[-1]["model_error"])
    assert max(errors) < 1e-3


@pytest.mark.parametrize("seed", [0, 1])
def test_many_actions_need_fewer_steps(seed: int) -> None:
    torques = np.linspace(-2.0, 2.0, 9)
    errors = []
    for inputs in (torques, None):
        data = Transitions.record(Torques(9), 30, hold=3, inputs=inputs, seed=seed)
        rng = np.random.default_rng(seed)
        angle, speed = rng.uniform(-np.pi, np.pi, 300), rng.uniform(-6, 6, 300)
        number = rng.integers(0, 9, 300)
        # speed' = speed + (15 sin(angle) + 3 u) 0.05, of Pendulum-v1.
        expected = speed + (15 * np.sin(angle) + 3 * torques[number]) * 0.05
        told = number.astype(float) if inputs is None else torques[number]
        dynamics = LearnedDynamics(data)
        found = dynamics.next_variables(np.stack([angle, speed]), told[None])[1]
        errors.append(float(np.sqrt(np.mean((found - expected) ** 2))))
    assert errors[0] < 0.25 * errors[1]


def test_actions_may_begin_at_another_number() -> None:
    for inputs in (None, [-2.0, 0.0, 2.0]):
        learned = learn_from_plant(
            Torques(3, first=5),
            quick,
            30,
            rounds=3,
            explore=0.0,
            inputs=inputs,
            model_steps=200,
            seed=0,
        )
        expected = {5.0, 6.0, 7.0} if inputs is None else {-2.0, 0.0, 2.0}
        assert set(learned.transitions.inputs[:, 0]) <= expected


def test_several_inputs_of_each_action() -> None:
    rows = [[-1.0, 0.0], [0.0, 2.0], [1.0, 0.0]]
    env = gym.make_vec("MountainCar-v0", num_envs=2)
    learned = learn_from_plant(
        env, quick, 40, rounds=1, inputs=rows, model_steps=200, seed=0
    )
    assert learned.transitions.inputs.shape == (40, 2)
    assert {tuple(row) for row in learned.transitions.inputs} == set(map(tuple, rows))


def test_a_folder_keeps_the_values_and_goes_on(tmp_path: Path) -> None:
    def run(interactions: int, inputs: Any) -> Any:
        return learn_from_plant(
            gym.make("MountainCar-v0"),
            interactions=interactions,
            rounds=[10],
            inputs=inputs,
            folder=tmp_path,
            seed=0,
            **QUICK,
        )

    first = run(20, PUSHES).transitions
    with (tmp_path / "transitions.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert {float(row["u0"]) for row in rows} <= set(PUSHES)
    again = run(30, PUSHES).transitions
    np.testing.assert_array_equal(again.inputs[:20], first.inputs)
    assert again.description == first.description
    for other in (None, [-2.0, 0.0, 2.0]):
        with pytest.raises(ValueError, match="holds another run, with"):
            run(40, other)


@pytest.mark.parametrize(
    ("make", "inputs", "message"),
    [
        (lambda: gym.make("MountainCar-v0"), [0, 1], "for each of the 3 actions"),
        (lambda: gym.make("MountainCar-v0"), "left", "inputs must be an array of"),
        (lambda: gym.make("MountainCar-v0"), [0, 1, np.nan], "finite real numbers"),
        (pendulum, [-1.0, 0.0, 1.0], "this one does: torque u, N m, got"),
    ],
)
def test_bad_inputs_get_one_clear_error(make: Any, inputs: Any, message: str) -> None:
    for record in (
        lambda: Transitions.record(make(), 20, inputs=inputs, seed=0),
        lambda: learn_from_plant(make(), interactions=20, inputs=inputs, **QUICK),
    ):
        with pytest.raises(ValueError, match=message):
            record()


def test_real_inputs_are_recorded_as_they_are() -> None:
    with pytest.raises(ValueError, match="inputs belong to numbered actions"):
        Transitions.record(gym.make("Pendulum-v1"), 20, inputs=[-1, 1], seed=0)
