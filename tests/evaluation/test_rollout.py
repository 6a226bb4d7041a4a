"""One episode in each slot, whatever the vector environment does with its slots."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import (
    AsyncVectorEnv,
    AutoresetMode,
    SyncVectorEnv,
    VectorEnv,
    VectorWrapper,
)
from gymnasium.wrappers import DiscretizeAction
from gymnasium.wrappers.vector import RecordEpisodeStatistics

import acl_gym  # noqa: F401
from acl_gym import WaitingVectorEnv
from acl_gym.evaluation.rollout import Rollout
from acl_gym.evaluation.steps import account
from tests.agents.reference_colony import Chain, chains

MODES = ("NextStep", "SameStep", "Disabled")
PENDULUM = "acl_gym/Pendulum-v0"


def single_episode(
    env: gym.Env, seed: int, actions: np.ndarray
) -> tuple[float, int, bool, np.ndarray]:
    """Cost, length, success and last observation of one plain episode."""
    env.reset(seed=seed)
    cost, reached, length = 0.0, False, 0
    for action in actions:
        observation, reward, reached, truncated, _ = env.step(action)
        cost -= reward
        length += 1
        if reached or truncated:
            break
    return cost, length, reached, observation


def walk_through(
    rollout: Rollout, seed: int | None, actions: np.ndarray
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Walk with actions `(slots, steps)`; the last observations, and who walked."""
    last = rollout.start(seed=seed).copy()
    walkers = []
    while rollout.ants.size:
        walkers.append(rollout.ants.copy())
        step = rollout.step(actions[rollout.ants, rollout.steps])
        np.testing.assert_array_equal(step.ants, walkers[-1])
        last[step.ants] = step.observation[step.ants]
        np.testing.assert_array_equal(rollout.ants, step.ants[~step.finished])
    return last, walkers


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("limit", [np.inf, 4])
@pytest.mark.parametrize("max_steps", [1, 7, 30])
def test_every_mode_gives_plain_episodes(
    mode: str, limit: float, max_steps: int
) -> None:
    """Also the last observation, which some modes replace by that of a reset."""
    slots, parameters = 9, {"slip": 0.3, "limit": limit, "first_action": 3}
    rng = np.random.default_rng(max_steps)
    rollout = Rollout(chains(slots, mode, **parameters), max_steps)
    for seed in (10, 11):
        actions = (rng.random((slots, max_steps)) < 0.7).astype(np.int64)
        last, walkers = walk_through(rollout, seed, actions)
        for slot in range(slots):
            cost, length, reached, observation = single_episode(
                Chain(**parameters), seed + slot, actions[slot] + 3
            )
            assert rollout.cost[slot] == cost
            assert rollout.length[slot] == length
            assert rollout.terminated[slot] == reached
            assert last[slot] == observation
            assert [slot in ants for ants in walkers] == [
                t < length for t in range(len(walkers))
            ]


def test_there_are_episodes_of_each_kind() -> None:
    """What the test above rests on: goals, limits and time-outs all happen in it."""
    rollout = Rollout(chains(50, slip=0.3, limit=8), 20)
    walk_through(rollout, 0, np.ones((50, 20), dtype=np.int64))
    assert rollout.terminated.any()
    assert (~rollout.terminated & (rollout.length == 8)).any()
    assert (rollout.length < 8).any()


def native(mode: str, **parameters: Any) -> VectorEnv:
    return gym.make_vec(PENDULUM, num_envs=40, autoreset_mode=mode, **parameters)


@pytest.mark.parametrize("limit", [None, 12])
def test_native_modes_are_bit_identical(limit: int | None) -> None:
    actions = np.random.default_rng(0).integers(3, size=(40, 60))
    results = []
    for mode in MODES:
        env = native(mode, max_episode_steps=limit, goal_bounds=(1.0, 4.0))
        rollout = Rollout(env, 60)
        last, _ = walk_through(rollout, 5, actions)
        results.append((last, rollout.cost, rollout.length, rollout.terminated))
        assert 0 < rollout.terminated.sum() < 40
    for other in results[1:]:
        for one, two in zip(results[0], other, strict=True):
            np.testing.assert_array_equal(one, two)


def test_native_slots_are_single_environments() -> None:
    actions = np.random.default_rng(1).integers(3, size=(40, 30))
    rollout = Rollout(native("NextStep", goal_bounds=(1.0, 4.0)), 30)
    states = rollout.start(seed=3).copy()
    last, _ = walk_through(rollout, 3, actions)
    single = gym.make(PENDULUM, goal_bounds=(1.0, 4.0))
    for slot, state in enumerate(states):
        observation, _ = single.reset(options={"state": state})
        cost, reached, length = 0.0, False, 0
        while not reached and length < 30:
            observation, reward, reached, _, _ = single.step(actions[slot, length])
            cost -= reward
            length += 1
        assert rollout.cost[slot] == pytest.approx(cost, rel=1e-9)
        assert (rollout.length[slot], rollout.terminated[slot]) == (length, reached)
        np.testing.assert_allclose(last[slot], observation, rtol=1e-7)


@pytest.mark.parametrize("mode", MODES)
def test_a_wrapped_native_environment_walks_the_same(mode: str) -> None:
    actions = np.random.default_rng(2).integers(3, size=(40, 30))
    results = []
    for wrap in (lambda env: env, RecordEpisodeStatistics):
        rollout = Rollout(wrap(native(mode, goal_bounds=(1.0, 4.0))), 30)
        last, _ = walk_through(rollout, 3, actions)
        results.append((last, rollout.cost, rollout.length, rollout.terminated))
    for one, two in zip(*results, strict=True):
        np.testing.assert_array_equal(one, two)


class KeepsActions(VectorWrapper):
    """Keeps what it was given, as recorders do."""

    def __init__(self, env: VectorEnv) -> None:
        super().__init__(env)
        self.kept: list[np.ndarray] = []

    def step(self, actions: np.ndarray) -> Any:
        self.kept.append(actions)
        return super().step(actions)


def test_actions_that_a_wrapper_keeps_stay_as_they_were() -> None:
    env = KeepsActions(chains(3, "Disabled"))
    rollout = Rollout(env, 5)
    rollout.start(seed=0)
    rollout.step(np.array([0, 1, 1]))
    rollout.step(np.zeros(rollout.ants.size, dtype=np.int64))
    assert env.kept[0].tolist() == [0, 1, 1]


@pytest.mark.parametrize("mode", MODES)
def test_slots_in_processes_of_their_own_walk_the_same(mode: str) -> None:
    parameters = {"slip": 0.3, "limit": 6}
    processes = AsyncVectorEnv(
        [lambda: Chain(**parameters)] * 3, autoreset_mode=AutoresetMode(mode)
    )
    actions = np.ones((3, 9), dtype=np.int64)
    results = []
    for env in (processes, chains(3, mode, **parameters)):
        rollout = Rollout(env, 9)
        last, _ = walk_through(rollout, 4, actions)
        results.append((last, rollout.cost, rollout.length, rollout.terminated))
    processes.close()
    for one, two in zip(*results, strict=True):
        np.testing.assert_array_equal(one, two)


def test_initial_states_are_handed_on() -> None:
    states = np.random.default_rng(0).uniform([0, -9], [6, 9], (40, 2))
    observation = Rollout(native("Disabled"), 5).start(states=states)
    np.testing.assert_array_equal(observation, states)


@pytest.mark.parametrize("mode", MODES)
def test_without_a_seed_the_streams_go_on(mode: str) -> None:
    """And with one, what happened before does not matter."""
    rollout = Rollout(chains(20, mode), 3)
    actions = np.ones((20, 3), dtype=np.int64)
    first = rollout.start(seed=1).copy()
    walk_through(rollout, None, actions)
    assert (rollout.start() != first).any()
    np.testing.assert_array_equal(rollout.start(seed=1), first)
    assert (rollout.cost == 0).all()
    assert (rollout.length == 0).all()
    assert not rollout.terminated.any()
    assert rollout.ants.tolist() == list(range(20))


class Rewards(Chain):
    """A chain of which each slot has a fixed sequence of rewards."""

    def __init__(self, rewards: list[float], length: int = 6) -> None:
        super().__init__(length)
        self.rewards = rewards

    def step(self, action: int) -> tuple[np.ndarray, float, bool, bool, dict]:
        observation, _, reached, truncated, info = super().step(action)
        return observation, self.rewards[self.steps - 1], reached, truncated, info


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_reward_that_is_not_finite_is_refused(mode: str, bad: float) -> None:
    rewards = [[-1.0] * 9, [-1.0, bad] + [-1.0] * 7, [-1.0] * 9]
    env = SyncVectorEnv([lambda r=r: Rewards(r) for r in rewards], autoreset_mode=mode)
    rollout = Rollout(env, 9)
    rollout.start(seed=0)
    rollout.step(np.zeros(3, dtype=np.int64))
    with pytest.raises(ValueError, match=f"finite, got {bad} in slot 1; check"):
        rollout.step(np.zeros(3, dtype=np.int64))


def test_the_slot_is_named_also_when_others_have_finished() -> None:
    rewards = [[-1.0, -1.0], [-1.0, -1.0, np.nan], [-1.0] * 3]
    env = SyncVectorEnv([lambda r=r: Rewards(r, length=2) for r in rewards])
    rollout = Rollout(env, 9)
    rollout.start(seed=0)
    rollout.step(np.array([1, 0, 0]))
    rollout.step(np.array([0, 0]))
    with pytest.raises(ValueError, match="slot 1"):
        rollout.step(np.array([0, 0]))


@pytest.mark.parametrize("mode", MODES)
def test_the_rewards_of_finished_slots_are_not_looked_at(mode: str) -> None:
    """Slot 0 is at the goal after one step and walks on as a dummy, if at all."""
    rewards = [[-1.0] + [np.nan] * 9, [-2.0] * 10]
    env = SyncVectorEnv(
        [lambda r=r: Rewards(r, length=2) for r in rewards], autoreset_mode=mode
    )
    rollout = Rollout(env, 6)
    rollout.start(seed=0)
    rollout.step(np.array([1, 0]))
    while rollout.ants.size:
        rollout.step(np.zeros(1, dtype=np.int64))
    assert rollout.cost.tolist() == [1.0, 12.0]
    assert rollout.length.tolist() == [1, 6]
    assert rollout.terminated.tolist() == [True, False]


@pytest.mark.parametrize("bad", [-1, 2])
def test_the_kernel_agrees_with_itself_as_plain_python(bad: int) -> None:
    rng = np.random.default_rng(0)
    ants = np.array([1, 2, 5, 6])
    reward = rng.normal(size=8)
    if bad >= 0:
        reward[bad] = np.nan
    flags = rng.random((2, 8)) < 0.5
    results = []
    for kernel in (account, account.py_func):
        totals, length = np.zeros(8), np.zeros(8, dtype=np.int64)
        success = np.zeros(8, dtype=np.bool_)
        cost, reached, stopped = np.zeros(4), *np.zeros((2, 4), dtype=np.bool_)
        left = np.zeros(4, dtype=np.int64)
        arrays = totals, length, success, cost, reached, stopped, left
        counts = kernel(ants, reward, *flags, *arrays)
        assert counts[1] == bad
        results.append((counts, *arrays))
    for compiled, plain in zip(*results, strict=True):
        np.testing.assert_array_equal(compiled, plain)


def test_costs_are_summed_in_double_precision() -> None:
    """CartPole's native environment returns float32 rewards."""
    env = gym.make_vec("CartPole-v1", num_envs=3)
    rollout = Rollout(env, 20)
    rollout.start(seed=0)
    while rollout.ants.size:
        assert (
            rollout.step(np.zeros(rollout.ants.size, dtype=np.int64)).cost.dtype
            == float
        )
    np.testing.assert_array_equal(rollout.cost, -rollout.length)
    assert rollout.terminated.all()
    env.close()


def test_what_is_no_vector_environment_is_refused_with_the_remedy() -> None:
    with pytest.raises(TypeError, match=r"environment Chain; .*Env\(\[Chain\] \* 100"):
        Rollout(Chain(), 5)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match=r"id 'Pendulum-v1'; .*WaitingVectorEnv.make"):
        Rollout("Pendulum-v1", 5)  # type: ignore[arg-type]


def test_continuous_actions_are_refused() -> None:
    env = gym.make_vec("Pendulum-v1", num_envs=2)
    with pytest.raises(
        ValueError, match=r"Discrete actions, got Box\(.*DiscretizeAction"
    ):
        Rollout(env, 5)
    env.close()


@pytest.mark.parametrize(
    ("max_steps", "error"),
    [(0, ValueError), (-1, ValueError), (2.0, TypeError), (True, TypeError)],
)
def test_bad_max_steps(max_steps: Any, error: type[Exception]) -> None:
    with pytest.raises(error, match="max_steps"):
        Rollout(chains(2), max_steps)


def test_continuous_actions_lead_to_the_wrapper_that_makes_them_discrete() -> None:
    env = WaitingVectorEnv.make("Pendulum-v1", 2)
    with pytest.raises(
        ValueError, match=r"Discrete actions.*DiscretizeAction\(env, bins"
    ):
        Rollout(env, 10)
    wrapped = WaitingVectorEnv(
        [lambda: DiscretizeAction(gym.make("Pendulum-v1"), 5)] * 2
    )
    assert Rollout(wrapped, 10).n_actions == 5


class _TwoSteps(gym.Env):
    """Counts its steps in observations of several parts; an episode has two."""

    action_space = gym.spaces.Discrete(2)
    observation_space = gym.spaces.Tuple(
        (
            gym.spaces.Box(0.0, 9.0, (1,), np.float64),
            gym.spaces.Dict({"count": gym.spaces.Box(0.0, 9.0, (1,), np.float64)}),
        )
    )

    def _seen(self) -> Any:
        steps = np.array([float(self._steps)])
        return steps, {"count": steps.copy()}

    def reset(self, **_: Any) -> tuple[Any, dict[str, Any]]:
        self._steps = 0
        return self._seen(), {}

    def step(self, action: Any) -> Any:
        self._steps += 1
        return self._seen(), -1.0, self._steps == 2, False, {}


def test_last_observations_of_several_parts_are_recovered() -> None:
    env = SyncVectorEnv([_TwoSteps] * 2, autoreset_mode=AutoresetMode.SAME_STEP)
    rollout = Rollout(env, 5)
    rollout.start()
    rollout.step(np.zeros(2, np.int64))
    first, second = rollout.step(np.zeros(2, np.int64)).observation
    assert not rollout.ants.size
    assert first.ravel().tolist() == second["count"].ravel().tolist() == [2.0, 2.0]
