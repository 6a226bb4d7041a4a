"""Files that earlier versions saved can still be loaded, and learning goes on from them."""

from __future__ import annotations

from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from acl_gym import ACL, QLearning, ReturningACL, Transitions

SAVED = Path(__file__).resolve().parents[1] / "data" / "saved"
OBSERVATIONS = np.random.default_rng(0).uniform([-np.pi, -9.0], [np.pi, 9.0], (20, 2))

# What the version that saved the file computed: the actions for OBSERVATIONS, and after
# two more trials the number of steps and the table added up with weights.
KNOWN: dict[str, tuple[type[ACL | QLearning | ReturningACL], str, int, float]] = {
    "acl_0.1": (ACL, "20010002010002002221", 3000, -0.0020796964575596176),
    "q_learning_0.1": (QLearning, "01122110220201210222", 2951, -57.4981528363207),
    "returning_acl_0.2": (
        ReturningACL,
        "01022202221200201022",
        982,
        -160.35841383251164,
    ),
}


@pytest.mark.parametrize("name", KNOWN)
def test_an_agent_goes_on_where_it_stopped(name: str) -> None:
    kind, actions, steps, total = KNOWN[name]
    n_slots = 5 if kind is ReturningACL else 10
    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=n_slots)
    agent = kind.load(SAVED / f"{name}.npz", env)
    assert "".join(map(str, agent.predict(OBSERVATIONS)[0])) == actions
    agent.learn(trials=2)
    weights = np.cos(np.arange(agent.table.size)).reshape(agent.table.shape)
    assert agent.num_timesteps == steps
    assert float((agent.table * weights).sum()) == pytest.approx(total, rel=1e-9)


def test_recorded_transitions() -> None:
    recorded = Transitions.load(SAVED / "transitions_0.2.npz")
    assert recorded.states.shape == (20, 2)
    assert recorded.inputs.shape == (20, 1)
    assert recorded.states.sum() == pytest.approx(17.91866986896257)
    assert recorded.rewards.sum() == pytest.approx(-70.79568322478852)
    assert recorded.state_names[1] == "angular velocity omega, rad/s"


def test_every_file_is_loaded_by_a_test() -> None:
    names = {path.stem for path in SAVED.glob("*.npz")}
    assert names == {*KNOWN, "transitions_0.2"}
