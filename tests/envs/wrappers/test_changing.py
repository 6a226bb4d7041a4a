"""Parameters that drift or jump while an agent learns."""

from __future__ import annotations

import copy
import pickle
from fractions import Fraction
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers.vector import RecordEpisodeStatistics
from hypothesis import given, settings
from hypothesis import strategies as st

from acl_gym import ACL, ReturningACL, evaluate_policy_cost
from acl_gym.envs.wrappers import ChangingVectorEnv, Drift, Jump
from acl_gym.envs.wrappers.perturbations import ActionNoise
from tests.envs.plant.plants import (
    PENDULUM,
    compiled_pendulum_with,
    make_uncertain,
    pendulum_with,
)

MODES = pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
PARAMETERS = {"gain": 0.1, "damping": 0.01, "mass": 0.1}


def pendulums(n: int = 4, **settings: Any) -> Any:
    return gym.make_vec("acl_gym/Pendulum-v0", num_envs=n, **settings)


@settings(max_examples=60)
@given(
    st.integers(0, 50),
    st.integers(1, 60),
    st.integers(1, 30),
    st.fractions(-4, 4),
    st.fractions(-4, 4),
)
def test_stages_of_a_drift(
    start: int, length: int, stages: int, first: Fraction, last: Fraction
) -> None:
    """A staircase of equal steps below the straight line, which ends on it."""
    drift = Drift(start, start + length, float(last), stages)
    used = min(stages, length)
    env_times = drift.times
    assert len(env_times) == used == len(set(env_times))
    for steps in range(env_times[0], start + length + 3):
        share = min(Fraction(steps - start, length), Fraction(1))
        over = Fraction(share * used // 1, used)
        wanted = first + (last - first) * over
        assert drift.value(steps, float(first)) == pytest.approx(
            float(wanted), abs=1e-12
        )
        changed = over != Fraction(
            min(Fraction(steps - 1 - start, length), Fraction(1)) * used // 1, used
        )
        assert changed == (steps in env_times)


@MODES
def test_each_step_has_the_parameters_of_its_time(mode: str) -> None:
    """Held against environments that were made with them."""
    schedules = {
        "mass": Jump(at=10, to=0.15),
        "motor_gain": Drift(4, 24, 0.05, stages=4),
    }
    env = ChangingVectorEnv(pendulums(autoreset_mode=mode), schedules)
    assert env.values == {"mass": 0.1, "motor_gain": 0.1}
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    # Four slots: before the k-th step 4 k steps were made.
    gains = [0.1, 0.1, 0.1, 0.0875, 0.075, 0.0625, 0.05, 0.05]
    for k, gain in enumerate(gains):
        mass = 0.15 if 4 * k >= 10 else 0.1
        known = pendulums(mass=mass, motor_gain=gain)
        known.reset(options={"state": env.unwrapped.states})
        actions = rng.integers(0, 3, 4)
        wanted, given_ = known.step(actions), env.step(actions)
        assert env.values["motor_gain"] == pytest.approx(gain)
        for own, other in zip(given_[:4], wanted[:4], strict=True):
            np.testing.assert_allclose(own, other, rtol=1e-12)
        assert env.steps == 4 * (k + 1)
        assert env.at(4 * k).system.mass == mass
    assert env.at(0).system.motor_gain == 0.1
    assert env.at(10**9).system.motor_gain == 0.05


@pytest.mark.parametrize("dynamics", [pendulum_with, compiled_pendulum_with])
def test_plants_change_in_the_same_way(dynamics: Any) -> None:
    import acl_gym

    plant = acl_gym.plant(dynamics, parameters=PARAMETERS, num_envs=3, **PENDULUM)
    own = ChangingVectorEnv(plant, {"mass": Drift(6, 30, 0.2), "gain": Jump(9, 0.08)})
    thesis = ChangingVectorEnv(
        pendulums(3), {"mass": Drift(6, 30, 0.2), "motor_gain": Jump(9, 0.08)}
    )
    state = [[1.0, 0.0], [2.0, -1.0], [0.5, 3.0]]
    for env in (own, thesis):
        env.reset(options={"state": state})
    rng = np.random.default_rng(0)
    for _ in range(14):
        actions = rng.integers(0, 3, 3)
        np.testing.assert_allclose(
            own.step(actions)[0], thesis.step(actions)[0], rtol=1e-10
        )
    assert own.now().system.parameter("mass") == 0.2


@MODES
def test_only_what_moves_counts(mode: str) -> None:
    env = ChangingVectorEnv(
        pendulums(3, autoreset_mode=mode, max_episode_steps=2), {"mass": Jump(3, 0.2)}
    )
    env.reset(seed=0, options={"finished": "wait"})
    for _ in range(4):
        env.step([0, 0, 0])
    assert env.steps == 6  # two steps each, then they wait
    env.reset(seed=0)
    env.step([0, 0, 0])
    _, _, terminated, truncated, _ = env.step([0, 0, 0])
    if mode == "Disabled":
        env.reset(options={"reset_mask": terminated | truncated})
    env.step([0, 0, 0])
    # In mode "NextStep" the third step resets.
    assert env.steps == 12 + (0 if mode == "NextStep" else 3)


def run(env: ChangingVectorEnv) -> list[np.ndarray]:
    env.steps = 0
    rng = np.random.default_rng(1)
    seen = [env.reset(seed=7)[0]]
    seen += [env.step(rng.integers(0, 3, 4))[0] for _ in range(12)]
    return seen


def test_a_run_is_repeated_bit_for_bit_and_goes_on_across_resets() -> None:
    env = ChangingVectorEnv(pendulums(), {"mass": Drift(5, 40, 0.3)})
    first, second = run(env), run(env)
    assert np.array_equal(first, second)
    env.reset(seed=7)
    assert env.steps == 48
    assert env.values["mass"] == 0.3
    fresh = ChangingVectorEnv(pendulums(), {"mass": Drift(5, 40, 0.3)}, steps=48)
    assert fresh.values == env.values
    actions = [0, 1, 2, 0]
    for each in (env, fresh):
        each.reset(seed=1)
    for other in (fresh, copy.deepcopy(env), pickle.loads(pickle.dumps(env))):
        again = copy.deepcopy(env)
        assert (again.step(actions)[0] == other.step(actions)[0]).all()


def test_a_plant_of_now_stays_as_it_is() -> None:
    env = ChangingVectorEnv(pendulums(2), {"mass": Jump(at=4, to=0.2)})
    env.reset(seed=0)
    before = env.now()
    for _ in range(3):
        env.step([0, 0])
    assert before.system.mass == 0.1
    assert env.now().system.mass == env.unwrapped.system.mass == 0.2
    assert env.unwrapped.with_slots(3).system.mass == 0.2
    ahead = env.at(0)
    assert ahead.system.mass == 0.1
    assert env.unwrapped.system.mass == 0.2


def test_agents_learn_in_it_and_are_evaluated_as_it_is_now() -> None:
    tables = []
    for _ in range(2):
        env = ChangingVectorEnv(
            RecordEpisodeStatistics(ActionNoise(pendulums(5), 0.1)),
            {"mass": Jump(at=400, to=0.2)},
        )
        colony = ReturningACL(env, seed=0).learn(total_timesteps=300)
        assert env.steps == colony.num_timesteps
        before = evaluate_policy_cost(colony, env.now()).cost
        assert before == evaluate_policy_cost(colony, pendulums(1)).cost
        colony.learn(total_timesteps=300)
        after = evaluate_policy_cost(colony, env.now()).cost
        assert after == evaluate_policy_cost(colony, pendulums(1, mass=0.2)).cost
        tables.append(colony.table)
    assert np.array_equal(*tables)
    env = ChangingVectorEnv(pendulums(20), {"mass": Jump(at=400, to=0.2)})
    ACL(env, seed=0).learn(trials=1)


def test_a_picture_is_of_the_plant_as_it_is_now() -> None:
    pytest.importorskip("pygame")
    env = ChangingVectorEnv(
        gym.make_vec("acl_gym/Navigation-v0", num_envs=1, render_mode="rgb_array"),
        {"base_damping": Jump(at=0, to=3.0)},
    )
    env.reset(options={"state": [[3.0, 0.0, 0.0, 0.0]]})
    steady = gym.make_vec(
        "acl_gym/Navigation-v0", num_envs=1, render_mode="rgb_array", base_damping=3.0
    )
    steady.reset(options={"state": [[3.0, 0.0, 0.0, 0.0]]})
    assert (env.render()[0] == steady.render()[0]).all()


GOOD = Jump(3, 0.2)


@pytest.mark.parametrize(
    ("schedules", "error", "words"),
    [
        ({}, TypeError, "must be a dict from parameters to changes"),
        ([GOOD], TypeError, "must be a dict from parameters to changes"),
        ({"mass": 0.2}, TypeError, r"\['mass'\] must be a Jump or a Drift, or a list"),
        ({"mass": []}, TypeError, "must be a Jump or a Drift"),
        ({"mas": GOOD}, TypeError, "got 'mas'. Did you mean 'mass'"),
        ({3: GOOD}, TypeError, "got 3"),
        ({"substeps": GOOD}, TypeError, "that are real numbers .* got 'substeps'"),
        ({"mass": Jump(3, -1.0)}, ValueError, "after 3 steps: mass must lie in"),
        ({"mass": Drift(0, 9, -1.0)}, ValueError, "valid at all times, got .* after"),
        ({"omega_max": Jump(3, 5.0)}, ValueError, "observation space must stay"),
        (
            {"mass": [Jump(5, 0.2), Jump(5, 0.3)]},
            ValueError,
            "must follow each other.*sort them",
        ),
        ({"mass": [Jump(5, 0.2), Drift(4, 9, 0.3)]}, ValueError, "follow each other"),
        ({"mass": [Drift(4, 9, 0.3), Jump(8, 0.2)]}, ValueError, "follow each other"),
    ],
)
def test_schedules_that_are_refused(
    schedules: Any, error: type[Exception], words: str
) -> None:
    inside = pendulums()
    with pytest.raises(error, match=rf"(?s){words}"):
        ChangingVectorEnv(inside, schedules)
    assert inside.unwrapped.system.mass == 0.1


def test_too_many_stages() -> None:
    drift = [Drift(1000 * i, 1000 * (i + 1), 0.2, stages=1000) for i in range(11)]
    with pytest.raises(ValueError, match="at most 10,000 stages in all, got 11,000"):
        ChangingVectorEnv(pendulums(), {"mass": drift})


def test_environments_that_are_refused() -> None:
    with pytest.raises(TypeError, match="env must be a vector environment of acl_gym"):
        ChangingVectorEnv(gym.make_vec("CartPole-v1", num_envs=2), {"mass": GOOD})
    with pytest.raises(TypeError, match="env must be a vector environment of acl_gym"):
        ChangingVectorEnv(3, {"mass": GOOD})  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="got 'mass', which each episode draws anew"):
        ChangingVectorEnv(make_uncertain(num_envs=2), {"mass": GOOD})
    env = ChangingVectorEnv(make_uncertain(num_envs=2), {"gain": Jump(0, 0.05)})
    env.reset(seed=0)
    assert env.unwrapped.system.parameter("gain") == 0.05
    assert env.unwrapped.states.shape == (2, 4)


@pytest.mark.parametrize(
    ("make", "error", "words"),
    [
        (lambda: Jump(-1, 0.2), ValueError, "at must be at least 0"),
        (lambda: Jump(1.5, 0.2), TypeError, "at must be an integer"),
        (lambda: Jump(1, np.nan), ValueError, "to must lie in"),
        (lambda: Jump(1, "a"), TypeError, "to must be a real number"),
        (lambda: Drift(5, 5, 0.2), ValueError, "end must be greater than start"),
        (lambda: Drift(-1, 5, 0.2), ValueError, "start must be at least 0"),
        (lambda: Drift(0, 5, np.inf), ValueError, "to must lie in"),
        (lambda: Drift(0, 5, 0.2, 0), ValueError, "stages must be at least 1"),
    ],
)
def test_changes_that_are_refused(
    make: Any, error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        make()


@pytest.mark.parametrize(("steps", "error"), [(-1, ValueError), (1.5, TypeError)])
def test_steps_that_are_refused(steps: Any, error: type[Exception]) -> None:
    env = ChangingVectorEnv(pendulums(), {"mass": GOOD})
    with pytest.raises(error, match="steps must be"):
        env.steps = steps
    with pytest.raises(error, match="steps must be"):
        env.at(steps)
