"""The vector environment: one episode and one world for all slots."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode

from acl_gym import Fuzzy, ReturningACL, VectorEnvAdapter, WorkersVectorEnv
from acl_gym.envs.swarm_aggregation import SwarmAggregationVectorEnv
from acl_gym.envs.wrappers.workers import spread_over_workers
from tests.envs.vector_helpers import MODES, arrays_in, mask_of

ID = "acl_gym/SwarmAggregation-v0"
EVERY_MODE = pytest.mark.parametrize("mode", MODES)


def make(mode: str = "NextStep", n: int = 6, limit: int = 4, **more: Any) -> Any:
    return SwarmAggregationVectorEnv(
        n, max_episode_steps=limit, autoreset_mode=mode, **more
    )


def actions(rng: np.random.Generator, n: int = 6) -> np.ndarray:
    return rng.integers(0, 5, n)


def test_a_slot_is_an_agent_of_one_world() -> None:
    env = gym.make_vec(ID, num_envs=100)
    assert isinstance(env.unwrapped, SwarmAggregationVectorEnv)
    seen, infos = env.reset(seed=0)
    assert seen.shape == (100, 6)
    assert infos == {}
    assert env.observation_space.contains(seen)
    assert env.unwrapped.states.shape == (100, 2)
    assert gym.make_vec(ID, num_envs=3, followers=5).reset(seed=0)[0].shape == (3, 6)
    # Each sees the others: the means of all add up.
    np.testing.assert_allclose(seen[:, 2:4].sum(axis=0), 0.0, atol=1e-10)
    assert np.hypot(*seen[:, 4:].T).max() < 3.0


@EVERY_MODE
def test_all_slots_share_one_episode(mode: str) -> None:
    env, rng = make(mode), np.random.default_rng(0)
    first, _ = env.reset(seed=1)
    for episode in range(3):
        for step in range(1, 5):
            seen, rewards, terminated, truncated, infos = env.step(actions(rng))
            assert not terminated.any()
            assert truncated.tolist() == [step == 4] * 6
            assert (rewards < 0).all()
        if mode == "SameStep":
            last = np.stack(infos["final_obs"])
            assert infos["_final_obs"].all()
            assert infos["final_info"]["distance"].shape == (6,)
            assert not np.array_equal(last, seen)
            assert "distance" not in infos
        elif mode == "NextStep":
            assert "distance" in infos
            seen, rewards, terminated, truncated, infos = env.step(actions(rng))
            assert not rewards.any()
            assert not (terminated | truncated).any()
            assert infos == {}
        else:
            with pytest.raises(ResetNeeded, match="all slots has ended"):
                env.step(actions(rng))
            seen, _ = env.reset(options={"reset_mask": np.ones(6, np.bool_)})
        assert not np.array_equal(seen, first), episode
        assert env.observation_space.contains(seen)


def test_the_modes_differ_in_nothing_else() -> None:
    """The same walks from the same seed, but for the steps that only reset."""
    walks = []
    for mode in MODES:
        env, rng = make(mode, followers=3), np.random.default_rng(0)
        env.reset(seed=1)
        rows = []
        for _ in range(12):
            seen, rewards, _, truncated, infos = env.step(actions(rng))
            if mode == "SameStep" and truncated.any():
                seen = np.stack(infos["final_obs"])
            rows.append((seen.tobytes(), rewards.tobytes()))
            if truncated.any() and mode == "NextStep":
                env.step(np.zeros(6, dtype=np.int64))
            elif truncated.any() and mode == "Disabled":
                env.reset()
        walks.append(rows)
    assert walks[0] == walks[1] == walks[2]


def test_some_agents_elsewhere_leave_the_others_to_the_last_bit() -> None:
    env, twin = make("Disabled", limit=9), make("Disabled", limit=9)
    for each in (env, twin):
        each.reset(seed=2)
        each.step(np.arange(6) % 5)
    moved = mask_of(6, 1, 4)
    env.reset(options={"reset_mask": moved})
    assert env.states[~moved].tobytes() == twin.states[~moved].tobytes()
    assert (env.states[moved] != twin.states[moved]).all()
    # What they do next is theirs alone, and the time goes on for all.
    assert env.step(np.ones(6, int))[3].sum() == twin.step(np.ones(6, int))[3].sum()
    assert env.states[~moved].tobytes() == twin.states[~moved].tobytes()
    flags = [env.step(np.zeros(6, int))[3].all() for _ in range(7)]
    assert flags == [False] * 6 + [True]


def test_states_by_mask() -> None:
    env = make("Disabled", followers=2)
    states = np.full((6, 2), np.nan)
    with pytest.raises(ValueError, match="states"):
        env.reset(options={"state": states})
    env.reset(seed=0)
    before = env.states
    states[3] = [1.0, 2.0]
    given = states.copy()
    seen, _ = env.reset(options={"state": states, "reset_mask": mask_of(6, 3)})
    np.testing.assert_array_equal(states, given)
    wanted = before.copy()
    wanted[3] = [1.0, 2.0]
    np.testing.assert_array_equal(env.states, wanted)
    np.testing.assert_array_equal(seen[:, :2], wanted[:6])
    # Those of all agents of the world, followers too.
    every = np.linspace(-2, 2, 16).reshape(8, 2)
    env.reset(options={"state": every})
    np.testing.assert_array_equal(env.states, every)
    env.reset(options={"state": every[:6]})
    np.testing.assert_array_equal(env.states[:6], every[:6])
    assert (env.states[6:] != every[6:]).all()


def test_masks_that_are_refused_change_nothing() -> None:
    env = make("Disabled", limit=1)
    with pytest.raises(ResetNeeded, match="first reset"):
        env.reset(options={"reset_mask": np.ones(6, np.bool_)})
    env.reset(seed=0)
    before = env.states
    for mask, error in (([True] * 6, TypeError), (np.zeros(6, np.bool_), ValueError)):
        with pytest.raises(error, match="reset_mask"):
            env.reset(options={"reset_mask": mask})
    env.step(np.zeros(6, int))
    with pytest.raises(ValueError, match="must hold all slots where the episode has"):
        env.reset(options={"reset_mask": mask_of(6, 0)})
    assert env.states.tobytes() == before.tobytes()
    with pytest.raises(ValueError, match="among"):
        env.reset(options={"max_steps": 3})
    with pytest.raises(TypeError, match="seed must be an integer"):
        env.reset(seed=1.5)


@EVERY_MODE
def test_what_is_returned_is_new(mode: str) -> None:
    env, rng = make(mode), np.random.default_rng(0)
    kept = [(each, each.copy()) for each in arrays_in(env.reset(seed=0))]
    for _ in range(11):
        if env._ended and mode == "Disabled":
            env.reset()
        kept += [(each, each.copy()) for each in arrays_in(env.step(actions(rng)))]
    addresses = [each.__array_interface__["data"][0] for each, _ in kept if each.size]
    assert len(set(addresses)) == len(addresses)
    for array, copied in kept:
        np.testing.assert_array_equal(array, copied)


def test_types_and_masks_of_what_is_returned() -> None:
    env = make()
    env.reset(seed=0)
    seen, rewards, terminated, truncated, infos = env.step(np.zeros(6, np.int32))
    assert seen.dtype == rewards.dtype == np.float64
    assert terminated.dtype == truncated.dtype == np.bool_
    assert set(infos) == {"distance", "_distance", "collisions", "_collisions"}
    for name in ("distance", "collisions"):
        assert infos[name].shape == infos[f"_{name}"].shape == (6,)
        assert infos[f"_{name}"].dtype == np.bool_
        assert infos[f"_{name}"].all()


@pytest.mark.parametrize("more", [{}, {"continuous": True, "point_mass": True}])
def test_the_seed_decides_every_bit(more: dict[str, Any]) -> None:
    walks = []
    for _ in range(2):
        env = make("SameStep", **more)
        env.action_space.seed(4)
        rows = [env.reset(seed=8)[0].tobytes()]
        rows += [env.step(env.action_space.sample())[0].tobytes() for _ in range(11)]
        walks.append(rows)
    assert walks[0] == walks[1]


@pytest.mark.parametrize(
    "duplicate", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))]
)
def test_copies_go_on_apart(duplicate: Callable[[Any], Any]) -> None:
    env = make(n=4, render_mode="rgb_array", followers=2)
    env.reset(seed=0)
    env.step(np.ones(4, int))
    twin = duplicate(env)
    for _ in range(6):
        mine, other = (each.step(np.full(4, 2)) for each in (env, twin))
        assert mine[0].tobytes() == other[0].tobytes()
    env.step(np.full(4, 1))
    assert env.states.tobytes() != twin.states.tobytes()


def test_bad_actions_and_arguments() -> None:
    env = make()
    with pytest.raises(ResetNeeded, match="call reset"):
        env.step(np.zeros(6, int))
    env.reset(seed=0)
    before = env.states
    for bad in (np.zeros(5, int), np.full(6, 5), np.zeros(6), np.full(6, -1), "left"):
        with pytest.raises((TypeError, ValueError), match="actions must"):
            env.step(bad)
    assert env.states.tobytes() == before.tobytes()
    with pytest.raises(ValueError, match="num_envs must be at least 1"):
        SwarmAggregationVectorEnv(0)
    with pytest.raises(ValueError, match="autoreset_mode must be one of"):
        make("Sometimes")
    with pytest.raises(ValueError, match="at least 1, or -1 or None"):
        make(limit=0)
    with pytest.raises(ValueError, match=r"agents with .* must fit into"):
        SwarmAggregationVectorEnv(10**12)
    assert SwarmAggregationVectorEnv(2, max_episode_steps=-1).max_episode_steps is None


def test_no_limit() -> None:
    env = make(limit=-1)
    env.reset(seed=0)
    assert not any(env.step(np.zeros(6, int))[3].any() for _ in range(300))


def test_two_agents_walk_together() -> None:
    env = make(n=2, limit=20)
    env.reset(options={"state": [[-2.0, 0.0], [2.0, 0.0]]})
    distances = [env.step([1, 3])[4]["distance"][0] for _ in range(9)]
    np.testing.assert_allclose(distances, 2.0 - 0.2 * np.arange(1, 10))
    _, rewards, _, _, infos = env.step([1, 3])  # where both are in one place
    assert infos["collisions"].tolist() == [1, 1]
    np.testing.assert_allclose(rewards, [-1.0, -1.0])


def test_one_agent_alone_pays_nothing() -> None:
    env = make(n=1)
    env.reset(seed=0)
    assert env.step([1])[1].tolist() == [0.0]
    assert not np.signbit(env.step([0])[1]).any()


def test_a_window() -> None:
    pytest.importorskip("pygame")
    env = gym.make_vec(ID, num_envs=20, render_mode="human")
    env.reset(seed=0)
    env.step(np.ones(20, int))
    assert env.render() is None
    env.close()
    quiet = make()
    quiet.reset()
    with pytest.warns(UserWarning, match="render"):
        assert quiet.render() is None


# --- around it --------------------------------------------------------------------------


def test_workers_do_not_take_a_world_apart() -> None:
    env = gym.make_vec(ID, num_envs=4)
    with pytest.raises(ValueError, match="slots that do not meet"):
        spread_over_workers(env, 2)
    apart = WorkersVectorEnv([lambda: gym.make(ID)] * 2, 1, "serial")
    assert apart.reset(seed=0)[0].shape == (2, 6)
    apart.close()


def test_the_adapter_settles_the_mode() -> None:
    env = gym.make_vec(ID, num_envs=4, max_episode_steps=3)
    vec_env = VectorEnvAdapter(env)
    assert env.autoreset_mode is AutoresetMode.DISABLED
    vec_env.seed(0)
    vec_env.reset()
    for _ in range(3):
        seen, rewards, dones, infos = vec_env.step(np.zeros(4, int))
    assert dones.all()
    assert all(info["TimeLimit.truncated"] for info in infos)
    assert infos[0]["terminal_observation"].shape == (6,)
    assert seen.shape == (4, 6)
    assert (rewards < 0).all()


@EVERY_MODE
def test_a_colony_learns_to_follow_the_field(mode: str) -> None:
    """On a table of 9 x 9 cells: who walks at random pays 366 in an episode."""
    env = gym.make_vec(ID, num_envs=10, observe="potential", autoreset_mode=mode)
    grid = Fuzzy.from_box(env.single_observation_space, (9, 9))
    colony = ReturningACL(env, grid, seed=0, max_steps=100)
    colony.learn(trials=30)
    assert np.mean([row["ants_cost"] for row in colony.history[-10:]]) < 180.0


@pytest.mark.parametrize("rows", [3, 5])
def test_rows_of_agents_that_are_not_reset_may_be_anything(rows: int) -> None:
    """With a row for each slot, and with one for each agent of the world."""
    env = gym.make_vec("acl_gym/SwarmAggregation-v0", num_envs=3, followers=2)
    env.reset(seed=0)
    before = env.unwrapped.states
    given = np.full((rows, 2), np.nan)
    given[1] = [1.0, 2.0]
    mask = np.array([False, True, False])
    env.reset(options={"state": given, "reset_mask": mask})
    after = env.unwrapped.states
    assert after[1].tolist() == [1.0, 2.0]
    np.testing.assert_array_equal(np.delete(after, 1, 0), np.delete(before, 1, 0))
    with pytest.raises(ValueError, match="must lie within"):
        env.reset(options={"state": given, "reset_mask": ~mask})
    env.close()


@pytest.mark.parametrize(
    ("followers", "message"),
    [
        (0, r"must hold 4 rows, one for each agent, got shape \(3, 2\)"),
        (5, "must hold 4 rows, one for each agent that takes actions, or 9, one for"),
    ],
)
def test_too_few_states_for_a_reset(followers: int, message: str) -> None:
    env = SwarmAggregationVectorEnv(4, followers=followers)
    with pytest.raises(ValueError, match=message):
        env.reset(options={"state": np.zeros((3, 2))})
