"""A plant, what was recorded of it before, and the actions of both."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from acl_gym import LearnedVectorEnv, QLearning, Transitions, learn_from_plant
from tests.model_based.plants import pendulum, quick

TASK: dict[str, Any] = {
    "goal": [0.0, 0.0],
    "tolerance": [0.2, 0.5],
    "cost": ([1.0, 0.1], 0.05),
    "model_steps": 400,
    "seed": 0,
}
PI = np.pi


class Arm(gym.Env[Any, Any]):
    """A pendulum of one's own, whose angle jumps from pi to -pi; keeps its inputs."""

    def __init__(self, ends: float = PI, fails_at: int = 10**9) -> None:
        high = np.array([ends, 12.0])
        self.observation_space = gym.spaces.Box(-high, high, dtype=np.float64)
        self.action_space = gym.spaces.Box(-2.0, 2.0, (1,), np.float64)
        self.given: list[float] = []
        self.fails_at = fails_at

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self.state = np.array([PI - 0.01, 0.0])
        self.steps = 0
        return self.state.copy(), {}

    def step(self, action: Any) -> Any:
        if len(self.given) == self.fails_at:
            raise ConnectionError("the fuse has blown")
        self.given.append(float(action[0]))
        angle, speed = self.state
        for _ in range(5):
            speed += 0.01 * (9 * np.sin(angle) - 0.4 * speed + 3 * float(action[0]))
            angle += 0.01 * speed
        angle = (angle + PI) % (2 * PI) - PI
        self.state, self.steps = (
            np.array([angle, np.clip(speed, -12, 12)]),
            self.steps + 1,
        )
        reward = -(angle**2 + 0.1 * speed**2)
        return self.state.copy(), reward, False, self.steps >= 60, {}


def measured(torques: Any, steps: int = 90, **described: Any) -> Transitions:
    """Random torques, each held for three steps."""
    env, rng = Arm(), np.random.default_rng(0)
    state, rows = env.reset()[0], []
    for step in range(steps):
        if step % 3 == 0:
            torque = rng.choice(torques)
        after, *_, ended, _ = env.step([torque])
        rows.append((state, torque, after))
        state = env.reset()[0] if ended else after
    states, inputs, after = map(np.array, zip(*rows, strict=True))
    return Transitions(states, inputs, after, **described)


def learn(env: Any, data: Any = None, interactions: int = 20, **more: Any) -> Any:
    return learn_from_plant(
        env, more.pop("agent", quick), interactions, rounds=1, data=data, **TASK | more
    )


def test_the_plant_gets_the_inputs_that_the_policy_chose_in_the_model() -> None:
    """Though others were recorded before: three torques, where the plant has five."""
    env, policies = Arm(), []

    def note(learning: Any, row: Any) -> None:
        policies.append((learning.policy, learning.model.system.inputs[:, 0]))

    data = measured([-2.0, 0.0, 2.0])
    learned = learn(env, data, explore=0.0, callback=note)
    policy, torques = policies[0]  # learned from the data, before the first interaction
    np.testing.assert_array_equal(torques, [-2, -1, 0, 1, 2])
    states = learned.transitions.states[len(data) :]
    np.testing.assert_array_equal(env.given, torques[policy.predict(states)[0]])
    assert len(learned.policy.table[0]) == 5


def test_what_was_recorded_with_any_inputs_is_learned_from() -> None:
    """As `record` draws them from a Box: 60 steps with 60 different torques."""
    data = Transitions.record(Arm(), 60, seed=0)
    learned = learn(Arm(), data, inputs=[-2, 2])
    assert len(learned.transitions) == 80
    np.testing.assert_array_equal(learned.model.system.inputs[:, 0], [-2, 2])


def test_names_are_those_of_the_data_where_the_plant_has_none() -> None:
    data = measured([-2.0, 2.0], state_names=["angle", "speed"], input_names=["torque"])
    learned = learn(Arm(), data)
    assert learned.transitions.state_names == ("angle", "speed")
    # The environment knows its own, and that the angle is circular.
    theirs = Transitions(
        *(getattr(Transitions.record(pendulum(), 40, seed=1), name) for name in
          ("states", "inputs", "next_states")),
        state_names=["th", "om"],
    )  # fmt: skip
    own = learn_from_plant(
        pendulum(), quick, 20, rounds=1, data=theirs, model_steps=400, seed=0
    )
    assert own.transitions.state_names == Transitions.record(pendulum(), 5).state_names
    assert own.transitions.description.circular == (0,)


@pytest.mark.parametrize("fails_at", [3, 17])
def test_a_run_goes_on_after_few_steps_of_an_angle(
    tmp_path: Path, fails_at: int
) -> None:
    """In 3 steps no angle is seen in cosine and sine; in all steps together it is."""

    class Failing(gym.Wrapper[Any, Any, Any, Any]):
        left = fails_at

        def step(self, action: Any) -> Any:
            self.left -= 1
            if self.left < 0:
                raise ConnectionError("the fuse has blown")
            return self.env.step(action)

    def run(env: Any) -> Any:
        return learn_from_plant(
            env, quick, 20, rounds=1, folder=tmp_path, model_steps=300, seed=0
        )

    with pytest.raises(ConnectionError):
        run(Failing(gym.make("Pendulum-v1")))
    learned = run(gym.make("Pendulum-v1"))
    assert len(learned.transitions) == 20
    assert learned.transitions.description.angles == ((0, 1),)


@pytest.mark.parametrize("circular", [[0], ["x[0]"], "x[0]"])
def test_an_angle_of_ones_own_environment_may_wrap_around(circular: Any) -> None:
    said = learn(Arm(), interactions=60, circular=circular)
    assert said.transitions.description.circular == (0,)
    assert said.transitions.description.low[0] == pytest.approx(-PI)
    unsaid = learn(Arm(), interactions=60)
    # A model in which the angle jumps is wrong by a tenth or more of a step.
    assert said.history[-1]["model_error"] < 0.01 < unsaid.history[-1]["model_error"]


def test_data_may_say_that_an_angle_wraps_around() -> None:
    data = measured([-2.0, 2.0], circular=[0])
    assert learn(Arm(), data).transitions.description.circular == (0,)


def test_a_run_in_a_folder_keeps_to_its_circular_variables(tmp_path: Path) -> None:
    learn(Arm(), circular=[0], folder=tmp_path)
    assert (
        len(
            learn(
                Arm(), interactions=25, circular=["x[0]"], folder=tmp_path
            ).transitions
        )
        == 25
    )
    with pytest.raises(ValueError, match=r"holds another run, with circular=\[0\]"):
        learn(Arm(), folder=tmp_path)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"data": Transitions(np.eye(9), np.arange(9) % 2, np.eye(9))},
         "data must have 2 variables, as the environment has, got 9"),
        ({"data": measured([-2.0, 2.0], numbered=True, values=[-2, 2])},
         "data must hold what actions set"),
        ({"data": measured([-2.0, 2.0], circular=[0], low=[-180, None],
                           high=[180, None])},
         r"x\[0\] must wrap around in data as in the environment, from -3.14"),
        ({"circular": [2]}, "circular must hold names or numbers of the variables"),
        ({"circular": 0}, "circular must hold names or numbers of the variables"),
        ({"model": {"inputs": [-2, 2]}}, "model must not hold inputs"),
        ({"agent": QLearning(gym.make_vec("acl_gym/Pendulum-v0", 2), seed=0)},
         "agent must have 5 actions, as the plant has, got 3"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused_before_the_plant_moves(
    more: dict[str, Any], message: str
) -> None:
    env = Arm()
    with pytest.raises(ValueError, match=message):
        learn(env, **more)
    assert not env.given


def test_data_of_another_plant_is_refused() -> None:
    recorded = Transitions.record(pendulum(), 40, seed=1)
    arrays = recorded.states, recorded.inputs, recorded.next_states
    names = recorded.state_names
    for described, message in (
        ({"state_names": names[::-1]}, "state_names in the order of the environment"),
        ({"sampling_time": 0.05}, "a sampling time of 0.1 s, as the environment has"),
        ({"circular": [1]}, "leave that out of circular= of the data"),
    ):
        data = Transitions(*arrays, **described)  # type: ignore[arg-type]
        with pytest.raises(ValueError, match=message):
            learn_from_plant(pendulum(), quick, 20, data=data, seed=0)
    # Nobody knows what the numbers of the mountain car's actions set.
    car = Transitions.record(gym.make("MountainCar-v0"), 30, inputs=[-1, 0, 1], seed=0)
    with pytest.raises(ValueError, match="data must hold numbers of actions"):
        learn_from_plant(gym.make("MountainCar-v0"), quick, 20, data=car, seed=0)


def test_bounds_are_the_wider_ones_that_are_known() -> None:
    data = measured([-2.0, 2.0], low=[-4.0, -9.0], high=[4.0, 20.0])
    known = learn(Arm(ends=np.inf), data).transitions.description
    assert known.low == (-4.0, -12.0)
    assert known.high == (4.0, 20.0)
    model: LearnedVectorEnv = learn(Arm(), data).model
    assert model.system.high.tolist() == [4.0, 20.0]
