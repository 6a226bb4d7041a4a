"""Recorded data as a vector environment."""

from __future__ import annotations

import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.env_checker import check_env

from acl_gym import (
    ACL,
    LearnedVectorEnv,
    QLearning,
    ReturningACL,
    Transitions,
    VectorEnvAdapter,
    WaitingVectorEnv,
    evaluate_policy_cost,
)
from acl_gym.envs.learned import DataWarning, LearnedDynamics
from tests.envs.learned.recordings import TASK, line, model, pendulum

ACTIONS = np.random.default_rng(0).integers(0, 3, (100, 4))


def real(num_envs: int) -> Any:
    return gym.make_vec("acl_gym/Pendulum-v0", num_envs=num_envs, max_episode_steps=50)


def test_it_does_what_the_plant_does() -> None:
    """One step from anywhere: the next state, the cost, and whether it is the goal."""
    learned, plant = model(100), real(100)
    states = plant.unwrapped.system.evaluation_states()
    near = np.linspace(np.pi - 0.12, np.pi + 0.12, 10)
    states[:10] = np.stack([near, np.zeros(10)], axis=1)
    outcomes = []
    for env in (learned, plant):
        env.reset(options={"state": states})
        outcomes.append(env.step(np.arange(100) % 3))
    (found, gave, ends, *_), (expected, reward, goal, *_) = outcomes
    miss = np.abs(found - expected)
    miss[:, 0] = np.minimum(miss[:, 0], 2 * np.pi - miss[:, 0])
    assert miss[:, 0].max() < 0.05
    assert miss[:, 1].max() < 0.5
    assert np.abs(gave - reward).max() < 0.5
    assert goal.any()
    assert (ends == goal).mean() >= 0.99


def test_spaces_are_those_of_the_plant() -> None:
    learned, plant = model(), real(4)
    assert learned.single_action_space == plant.single_action_space
    assert learned.single_observation_space == plant.single_observation_space
    assert learned.system.signals.values == ((-0.8,), (0.0,), (0.8,))
    assert learned.system.sampling_time == 0.1


def test_a_policy_learned_in_the_model_swings_the_plant_up() -> None:
    colony = ReturningACL(model(50), seed=0).learn(total_timesteps=12_000)
    found = evaluate_policy_cost(colony, gym.make_vec("acl_gym/Pendulum-v0"))
    assert found.success_rate == 1.0
    assert found.cost < 1.25 * 38.4


@pytest.mark.parametrize("agent", [ACL, QLearning, ReturningACL])
def test_any_agent_walks_in_it(agent: Any) -> None:
    learner = agent(model(5), seed=0, max_steps=20).learn(trials=2)
    assert learner.num_timesteps > 0
    assert np.isfinite(evaluate_policy_cost(learner, model()).cost)


def test_agents_of_stable_baselines_walk_in_it() -> None:
    from stable_baselines3 import A2C

    agent = A2C("MlpPolicy", VectorEnvAdapter(model()), n_steps=8, device="cpu")
    agent.learn(64)
    assert agent.num_timesteps == 64


def test_a_single_environment_of_it_passes_the_check_of_others() -> None:
    """As what `gym.make` of a user's own would wrap."""

    class Single(gym.Env[Any, Any]):
        def __init__(self) -> None:
            self.many = model(1)
            space: Any = self.many.single_observation_space
            self.observation_space = spaces.Box(
                space.low.astype(np.float32), space.high.astype(np.float32)
            )
            self.action_space = self.many.single_action_space

        def reset(self, *, seed: Any = None, options: Any = None) -> Any:
            super().reset(seed=seed)
            seen, _ = self.many.reset(seed=seed)
            return seen[0].astype(np.float32), {}

        def step(self, action: Any) -> Any:
            seen, reward, ended, cut, _ = self.many.step(np.array([action]))
            return (
                seen[0].astype(np.float32),
                float(reward[0]),
                bool(ended[0]),
                bool(cut[0]),
                {},
            )

    check_env(Single(), warn=False)


def test_the_same_seed_gives_the_same_bits_for_any_number_of_slots_that_walk() -> None:
    one, two = model(), model()
    runs = []
    for env in (one, two):
        env.reset(seed=3)
        runs.append([env.step(actions)[0] for actions in ACTIONS])
    np.testing.assert_array_equal(*runs)
    # A slot that waits does not change what the others do.
    alone = model(1)
    states = one.states
    one.reset(options={"state": states, "finished": "wait"})
    for slot in range(4):
        alone.reset(options={"state": states[slot : slot + 1], "finished": "wait"})
        one.reset(options={"state": states, "finished": "wait"})
        for actions in ACTIONS[:30]:
            seen = one.step(actions)[0]
            single = alone.step(actions[slot : slot + 1])[0]
            np.testing.assert_array_equal(seen[slot], single[0])


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_every_mode_of_autoreset(mode: AutoresetMode) -> None:
    env = LearnedVectorEnv(
        pendulum(),
        4,
        max_episode_steps=5,
        autoreset_mode=mode,
        dynamics=model().dynamics,
        **TASK,
    )
    env.reset(seed=0)
    for step, actions in enumerate(ACTIONS[:12]):
        _, _, ended, cut, infos = env.step(actions)
        if mode is AutoresetMode.DISABLED and (ended | cut).any():
            env.reset(options={"reset_mask": ended | cut})
        if mode is AutoresetMode.SAME_STEP and step == 4:
            assert "final_obs" in infos


def test_resetting_a_slot_leaves_the_others_alone() -> None:
    env = model()
    env.reset(seed=0)
    env.step(ACTIONS[0])
    before = env.states
    env.reset(options={"reset_mask": np.array([True, False, False, False])})
    np.testing.assert_array_equal(env.states[1:], before[1:])


def test_nothing_is_learned_again_for_more_slots() -> None:
    env = model()
    more = env.with_slots(7)
    assert more.dynamics is env.dynamics
    assert more.transitions is env.transitions
    assert more.num_envs == 7


def test_it_can_be_sent_to_another_process() -> None:
    env = model()
    copied = pickle.loads(pickle.dumps(env))
    for each in (env, copied):
        each.reset(seed=1)
    np.testing.assert_array_equal(env.step(ACTIONS[0])[0], copied.step(ACTIONS[0])[0])


def test_episodes_begin_where_they_are_told_to() -> None:
    known: dict[str, Any] = {"dynamics": model().dynamics, **TASK}
    data = pendulum()
    rows = {tuple(row) for row in data.states}
    env = LearnedVectorEnv(data, 200, initial="data", **known)
    assert {tuple(row) for row in env.reset(seed=0)[0]} <= rows
    env = LearnedVectorEnv(data, 200, initial="starts", **known)
    assert {tuple(row) for row in env.reset(seed=0)[0]} == {
        tuple(r) for r in data.starts
    }
    env = LearnedVectorEnv(data, 200, initial="anywhere", **known)
    share = np.mean([tuple(row) in rows for row in env.reset(seed=0)[0]])
    assert 0.3 < share < 0.7
    box = spaces.Box(np.array([1.0, -1.0]), np.array([2.0, 1.0]), dtype=np.float64)
    seen, _ = LearnedVectorEnv(data, 200, initial=box, **known).reset(seed=0)
    assert ((seen >= box.low) & (seen <= box.high)).all()
    with pytest.raises(ValueError, match="initial must be one of"):
        LearnedVectorEnv(data, initial="somewhere", **known)


def test_what_is_seen_shows_angles_as_they_were_recorded() -> None:
    data = Transitions.record(gym.make("Pendulum-v1"), 100, seed=0)
    env = LearnedVectorEnv(data, 3, inputs=[-2.0, 0.0, 2.0], max_episode_steps=20)
    seen, _ = env.reset(seed=0)
    assert seen.shape == (3, 3)
    assert env.states.shape == (3, 2)
    for actions in ACTIONS[:10, :3]:
        seen, *_ = env.step(actions)
        np.testing.assert_allclose(seen[:, 0] ** 2 + seen[:, 1] ** 2, 1.0)
        assert env.single_observation_space.contains(seen[0])
    np.testing.assert_allclose(env.system.variables(seen), env.states)
    assert env.system.circular == ()
    assert ReturningACL(env, seed=0).partition.periods == (None, None, None)  # type: ignore[attr-defined]


def test_cost_and_goal_are_learned_where_none_are_given() -> None:
    data = Transitions.record(gym.make("CartPole-v1"), 400, seed=0)
    env = LearnedVectorEnv(data, 5, max_episode_steps=30)
    assert env.learned_goal is not None
    assert env.learned_cost is not None
    env.reset(seed=0)
    ended = np.zeros(5, np.bool_)
    for _ in range(60):
        _, rewards, ends, *_ = env.step(np.zeros(5, np.int64))
        ended |= ends
        np.testing.assert_allclose(rewards[~ends & (rewards != 0)], 1.0, atol=1e-3)
    assert ended.all()  # poles that are pushed to one side only fall
    given = LearnedVectorEnv(
        data, 5, cost="time", goal=[0, 0, 0, 0], dynamics=env.dynamics
    )
    assert (given.learned_goal, given.learned_cost) == (None, None)


def test_variables_stay_within_what_was_recorded() -> None:
    data = Transitions(**line())
    env = LearnedVectorEnv(data, 3, cost="time", max_episode_steps=50)
    space: Any = env.single_observation_space
    assert space.low[0] < data.next_states.min()
    assert space.high[0] < 1.2 * data.next_states.max()
    env.reset(seed=0)
    for _ in range(30):
        seen, *_ = env.step(np.full(3, 2))
    assert (seen == space.high).all()
    with pytest.warns(DataWarning, match=r"the goal begins at x\[0\]"):
        wide = LearnedVectorEnv(data, cost="time", low=[-9], high=[None], goal=[5.0])
    assert wide.single_observation_space.low[0] == -9  # type: ignore[attr-defined]
    assert wide.single_observation_space.high[0] > 5  # type: ignore[attr-defined]


def test_pessimism_makes_the_unknown_dear() -> None:
    data = pendulum()
    known: dict[str, Any] = {"dynamics": model().dynamics, **TASK}
    states = real(1).unwrapped.system.evaluation_states()[:4]
    rewards = []
    for pessimism in (0.0, 10.0):
        env = LearnedVectorEnv(data, 4, pessimism=pessimism, **known)
        env.reset(options={"state": states})
        rewards.append(env.step(np.zeros(4, np.int64))[1])
    spread = model().spread(states, 0)
    assert (spread > 0).all()
    np.testing.assert_allclose(rewards[0] - rewards[1], 10.0 * spread)


def test_each_slot_may_walk_in_its_own_function() -> None:
    env = LearnedVectorEnv(pendulum(), 50, uncertain=True, n_draws=5, **TASK)
    env.reset(seed=0)
    assert env.states.shape == (50, 3)
    members = env.states[:, 2].astype(int)
    assert set(members) == set(range(6))
    same = np.tile([3.0, 1.0], (50, 1))
    env.reset(options={"state": np.column_stack([same, env.states[:, 2]])})
    seen, *_ = env.step(np.zeros(50, np.int64))
    assert len(np.unique(seen, axis=0)) == 6
    for member in range(6):
        assert len(np.unique(seen[members == member], axis=0)) == 1
    env.reset(options={"state": same})  # nominal: the mean
    plain = model(50)
    plain.reset(options={"state": same})
    np.testing.assert_array_equal(
        env.step(np.zeros(50, np.int64))[0], plain.step(np.zeros(50, np.int64))[0]
    )


def test_doubts_are_warned_of() -> None:
    still = Transitions(**{**line(), "inputs": np.zeros((40, 1))})
    with pytest.warns(DataWarning, match="is always 0"):
        LearnedVectorEnv(still, cost="time", inputs=[-1.0, 1.0])


def test_a_goal_far_from_the_data_is_warned_of() -> None:
    """How far, in units of what was recorded; and not where the goal is near."""
    data = Transitions(**line(), state_names=["position, m"])
    both = np.concatenate([data.states, data.next_states])
    least, most = both.min(), both.max()
    known: dict[str, Any] = {"cost": "time", "dynamics": LearnedDynamics(data)}
    for goal in (most + 2.1 * (most - least), least - 2.1 * (most - least)):
        with pytest.warns(DataWarning) as caught:
            env = LearnedVectorEnv(
                data, goal=[goal], tolerance=0.1 * (most - least), **known
            )
        (said,) = (str(each.message) for each in caught)
        assert "position, m" in said
        assert "2 times the recorded range" in said
        assert f"({least:.4g} to {most:.4g})" in said
        assert "record on the way to the goal" in said
        space: Any = env.single_observation_space
        assert space.low[0] <= goal <= space.high[0]
    # No warning, which would be an error here.
    LearnedVectorEnv(data, goal=[most + 0.4 * (most - least)], **known)
    # All of a circle is near, whatever was recorded of it.
    half = pendulum(120)[np.cos(pendulum(120).states[:, 0]) > 0.5]
    LearnedVectorEnv(half, dynamics=model().dynamics, **TASK)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"cost": None}, ValueError, "a cost can be learned from rewards only"),
        ({"inputs": [[1.0, 2.0]]}, ValueError, "a row of 1 numbers for each action"),
        ({"low": [0.0, 1.0]}, ValueError, "low must hold a number or None for each"),
        ({"pessimism": -1.0}, ValueError, "pessimism must lie in"),
        ({"max_episode_steps": 0}, ValueError, "max_episode_steps must be"),
        ({"inputs": [1.0]}, ValueError, "two actions or more, got the one input"),
        (
            {"goal": [np.nan]},
            ValueError,
            "goal must be an array of finite real numbers",
        ),
        ({"goal": ["up"]}, ValueError, "goal must be an array of finite real numbers"),
        (
            {"goal": [0.0], "tolerance": [1, 2]},
            ValueError,
            "tolerance must be a number",
        ),
        ({"goal": [1.0, 2.0, 3.0]}, ValueError, "goal must be a state of 1 variables"),
        ({"regressor": "neural"}, ValueError, "regressor must be one of"),
        ({"seed": "a"}, TypeError, "seed must be an integer, got 'a'"),
        ({"seed": -1}, ValueError, "seed must be at least 0"),
        ({"uncertain": "yes"}, TypeError, "uncertain must be True or False, got 'yes'"),
        ({"per_action": 1}, TypeError, "per_action must be True or False, got 1"),
    ],
)
def test_bad_arguments_get_one_clear_error(
    arguments: dict[str, Any], error: type[Exception], message: str
) -> None:
    data = Transitions(**line())
    with pytest.raises(error, match=message):
        LearnedVectorEnv(data, **{"cost": "time", **arguments})


@pytest.mark.parametrize(
    ("initial", "words"),
    [
        (lambda rng, n: 1 / 0, r"but it raised ZeroDivisionError"),
        (lambda rng, n: np.full((n, 1), 99.0), "states must lie within low and high"),
        (lambda rng, n: "anywhere", "must be an array of real numbers"),
    ],
)
def test_a_function_of_initial_states_is_named(initial: Any, words: str) -> None:
    data = Transitions(**line())
    expected = rf"initial\(rng, n\) must return n states.*{words}"
    with pytest.raises(ValueError, match=expected) as caught:
        LearnedVectorEnv(data, cost="time", initial=initial)
    assert caught.value.__cause__ is not None
    with pytest.raises(ValueError, match="initial must lie within low and high"):
        LearnedVectorEnv(data, cost="time", initial=[[99.0]])


def test_what_is_no_recording_is_refused() -> None:
    with pytest.raises(TypeError, match=r"transitions must be acl_gym\.Transitions"):
        LearnedVectorEnv(np.zeros((5, 3)), cost="time")  # type: ignore[arg-type]


def test_dynamics_must_be_those_of_the_plant() -> None:
    how: dict[str, Any] = {"goal": [np.pi, 0.0], "cost": "time"}
    with pytest.raises(TypeError, match="dynamics must be a LearnedDynamics or None"):
        LearnedVectorEnv(pendulum(), dynamics=3, **how)  # type: ignore[arg-type]
    other = LearnedDynamics(Transitions(**line()))
    with pytest.raises(
        ValueError, match="learned from the plant of transitions, got st"
    ):
        LearnedVectorEnv(pendulum(), dynamics=other, **how)


def test_continuous_inputs_must_be_chosen_from() -> None:
    rng = np.random.default_rng(0)
    x, u = rng.uniform(-1, 1, 100), rng.uniform(-1, 1, 100)
    data = Transitions(x, u, 0.9 * x + u)
    with pytest.raises(ValueError, match="more than 50 different ones were recorded"):
        LearnedVectorEnv(data, cost="time")
    assert (
        LearnedVectorEnv(data, cost="time", inputs=[-1, 1]).single_action_space.n == 2
    )  # type: ignore[attr-defined]


def test_spread_checks_what_it_is_given() -> None:
    with pytest.raises(TypeError, match="actions must be integers"):
        model().spread(np.zeros((1, 2)), 0.5)
    with pytest.raises(ValueError, match="actions must be 0 to 2"):
        model().spread(np.zeros((1, 2)), 3)


def test_the_example_runs() -> None:
    """Fitted dynamics serve another environment of the same data."""
    dynamics = LearnedDynamics(pendulum())
    env = LearnedVectorEnv(pendulum(), 3, dynamics=dynamics, **TASK)
    assert env.dynamics is dynamics
    assert WaitingVectorEnv  # ours waits by itself; others are wrapped in it
