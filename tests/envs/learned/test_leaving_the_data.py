"""Episodes that end, in failure, where the model is not sure enough."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from hypothesis import given, settings
from hypothesis import strategies as st

from acl_gym import (
    LearnedVectorEnv,
    QLearning,
    ReturningACL,
    Transitions,
    VectorEnvAdapter,
    evaluate_policy_cost,
)
from acl_gym.envs.wrappers.foresight import OwnModel
from tests.envs.learned.recordings import TASK, model, pendulum

J_STAR = 38.4  # of the pendulum, by value iteration on a fine grid
LIMIT = 0.053
"""A spread that about a tenth of all pairs of state and action exceed."""


def careful(num_envs: int, most_spread: float = LIMIT, **others: Any) -> Any:
    """A model of the pendulum whose episodes end outside the data."""
    return LearnedVectorEnv(
        pendulum(),
        num_envs,
        dynamics=model().dynamics,
        most_spread=most_spread,
        **{"max_episode_steps": 50, **TASK, **others},
    )


def anywhere(count: int, seed: int) -> Any:
    system = model().system
    return np.random.default_rng(seed).uniform(system.low, system.high, (count, 2))


def dearest(env: Any) -> float:
    """The largest cost of the pendulum: at the fastest, as far from upright as can be."""
    error, speed, torque = np.pi, 9.0, 0.8
    return error**2 + 0.1 * speed**2 + 0.05 * torque**2 + env.system.pessimism * LIMIT


@settings(deadline=None, max_examples=25)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 40),
    st.sampled_from([0.0, 5.0]),
    st.sampled_from([30, 40]),
)
def test_each_step_is_that_of_the_reference(
    seed: int, slots: int, pessimism: float, limit: int
) -> None:
    """What the model does without an end, and what the words above say of leaving it."""
    env = careful(slots, pessimism=pessimism, max_episode_steps=limit)
    free = careful(slots, 1e9, pessimism=pessimism, max_episode_steps=limit)
    states, rng = anywhere(slots, seed), np.random.default_rng(seed)
    for each in (env, free):
        each.reset(options={"state": states, "finished": "wait"})
    over = np.zeros(slots, np.bool_)
    for step in range(limit):
        before, actions = free.states, rng.integers(0, 3, slots)
        _, reward, ended, cut, infos = env.step(actions)
        _, usual, goal, last, _ = free.step(actions)
        leaves = (env.spread(before, actions) > LIMIT) & ~over
        pays = dearest(env) * (limit - step)
        usual = np.where(leaves, -pays, np.where(over, 0.0, usual))
        np.testing.assert_allclose(reward, usual, rtol=1e-9, atol=1e-12)
        np.testing.assert_array_equal(ended, (goal & ~over) | leaves)
        np.testing.assert_array_equal(cut, last & ~over)
        assert (-reward[~leaves] <= dearest(env)).all()
        if (ended | cut).any():
            np.testing.assert_array_equal(infos["_is_success"], ended | cut)
            np.testing.assert_array_equal(infos["is_success"], goal & ~over & ~leaves)
        over |= ended
        if (over | goal | last).all():
            break


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1), st.integers(1, 60))
def test_no_path_gains_by_leaving(seed: int, limit: int) -> None:
    """It costs at least what the same actions cost in a model that never ends them."""
    costs = []
    for most_spread in (LIMIT, 1e9):
        env = careful(40, most_spread, max_episode_steps=limit)
        env.reset(options={"state": anywhere(40, seed), "finished": "wait"})
        rng, total = np.random.default_rng(seed), np.zeros(40)
        for _ in range(limit):
            total -= env.step(rng.integers(0, 3, 40))[1]
        costs.append(total)
    leaving, staying = costs
    assert (leaving >= staying - 1e-9).all()
    if limit > 30:
        assert (leaving > staying + 1.0).any()


def test_nor_where_rewards_are_good_and_learned() -> None:
    """Each step of the cart-pole is rewarded: an early end must not look like a late one."""
    data = Transitions.record(gym.make("CartPole-v1"), 150, seed=0)
    free = LearnedVectorEnv(
        data, 30, max_episode_steps=60, regressor="gaussian process"
    )
    start = free.reset(seed=0)[0]
    middle = float(np.median(free.spread(start, 0)))
    env = LearnedVectorEnv(
        data,
        30,
        max_episode_steps=60,
        regressor="gaussian process",
        most_spread=middle,
        dynamics=free.dynamics,
    )
    returns = []
    for each in (env, free):
        rng, total = np.random.default_rng(0), np.zeros(30)
        each.reset(options={"state": start, "finished": "wait"})
        for _ in range(60):
            total += each.step(rng.integers(0, 2, 30))[1]
        returns.append(total)
    assert (returns[0] <= returns[1] + 1e-9).all()
    assert (returns[0] < returns[1] - 1.0).any()


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_every_mode_of_autoreset(mode: AutoresetMode) -> None:
    """A failure is reported once, as such, and the slot begins anew."""
    upright = np.tile([np.pi, 0.0], (50, 1))
    starts = np.concatenate([anywhere(150, 1), upright])
    env = careful(30, autoreset_mode=mode, initial=starts)
    env.reset(seed=0)
    rng, failures, successes = np.random.default_rng(0), 0, 0
    for _ in range(60):
        before, actions = env.states, rng.integers(0, 3, 30)
        leaves = env.spread(before, actions) > LIMIT
        _, reward, ended, cut, infos = env.step(actions)
        told = infos.get("final_info", infos)
        if not (ended | cut).any():
            continue
        success = told["is_success"]
        assert not (success & ~ended).any()
        failed = ended & ~success
        failures += int(failed.sum())
        successes += int(success.sum())
        assert leaves[failed].all()
        assert (reward[failed] <= -dearest(env) + 1e-9).all()
        if mode is AutoresetMode.DISABLED:
            env.reset(options={"reset_mask": ended | cut})
    assert failures > 20
    assert successes > 0


@pytest.mark.parametrize("agent", [QLearning, ReturningACL])
def test_agents_learn_the_pendulum_within_the_data(agent: Any) -> None:
    budget = 30_000 if agent is ReturningACL else 150_000
    learner = agent(careful(50, initial="anywhere"), seed=0)
    learner.learn(total_timesteps=budget)
    found = evaluate_policy_cost(learner, gym.make_vec("acl_gym/Pendulum-v0"))
    assert found.success_rate == 1.0
    assert found.cost < 1.25 * J_STAR


def test_a_policy_that_was_taught_so_leaves_the_data_less_often() -> None:
    env, free = (careful(50, limit, initial="anywhere") for limit in (LIMIT, 1e9))
    taught, careless = (
        evaluate_policy_cost(
            ReturningACL(each, seed=0).learn(total_timesteps=30_000), env
        )
        for each in (env, free)
    )
    assert taught.success_rate is not None
    assert careless.success_rate is not None
    assert taught.success_rate > careless.success_rate + 0.05
    assert taught.cost < 0.5 * careless.cost


def test_a_failure_is_no_success_in_evaluations_and_for_others() -> None:
    env = careful(20, max_episode_steps=30)

    class Right:
        def predict(self, observation: Any, **how: Any) -> Any:
            return np.full(len(observation), 2), None

    states = anywhere(20, 3)
    found = evaluate_policy_cost(Right(), env, states)
    assert found.success is not None
    left = (found.lengths < 30) & ~found.success
    assert left.any()
    assert (found.costs[left] > dearest(env)).all()
    adapter = VectorEnvAdapter(careful(20, autoreset_mode=AutoresetMode.DISABLED))
    adapter.seed(0)
    adapter.reset()
    said = set()
    for _ in range(50):
        _, rewards, done, infos = adapter.step(np.full(20, 2))
        for slot in np.flatnonzero(done & (rewards < -dearest(env))):
            said.add(bool(infos[slot]["is_success"]))
    assert said == {False}


def test_slots_that_wait_change_nothing() -> None:
    """Few or most of the slots walking: the same steps as with one slot alone."""
    states, rng = anywhere(12, 5), np.random.default_rng(5)
    many, alone = careful(12), careful(1)
    script = rng.integers(0, 3, (50, 12))
    many.reset(options={"state": states, "finished": "wait"})
    steps = [many.step(actions)[1:4] for actions in script]
    for slot in range(12):
        alone.reset(options={"state": states[slot : slot + 1], "finished": "wait"})
        for actions, expected in zip(script, steps, strict=True):
            given = alone.step(actions[slot : slot + 1])[1:4]
            for one, all_of_them in zip(given, expected, strict=True):
                assert one[0] == all_of_them[slot]


def test_more_slots_end_where_the_first_did() -> None:
    env = careful(5).with_slots(40)
    env.reset(options={"state": anywhere(40, 0), "finished": "wait"})
    assert env.step(np.full(40, 2))[2].any()
    assert env.system.most_spread == LIMIT


def test_a_shield_does_not_take_a_failure_for_a_safe_end() -> None:
    env = careful(40)
    env.reset(options={"state": anywhere(40, 0)})
    actions = np.full(40, 2)
    leaves = env.spread(env.states, actions) > LIMIT
    plan = OwnModel(env)
    plan.begin(np.arange(40), env.states)
    assert leaves.any()
    assert not plan.step(actions)[1][leaves].any()


@pytest.mark.parametrize(
    ("value", "error"), [(0.0, ValueError), (-1, ValueError), ("much", TypeError)]
)
def test_it_must_be_a_spread(value: Any, error: type[Exception]) -> None:
    with pytest.raises(error, match="most_spread must"):
        careful(1, value)
