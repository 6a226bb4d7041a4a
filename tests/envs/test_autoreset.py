"""What becomes of finished slots: the three modes of Gymnasium, and standing still."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers import TimeLimit
from gymnasium.wrappers.vector import RecordEpisodeStatistics

from acl_gym.envs.pendulum import PendulumEnv, PendulumVectorEnv
from tests.envs.vector_helpers import (
    EASY,
    ENV_ID,
    MODES,
    UPRIGHT,
    assert_same_bits,
    assert_same_infos,
    assert_same_step,
    mask_of,
    random_states,
    step_and_reset,
)

N, LIMIT = 7, 9
WAIT = {"finished": "wait"}


def native_env(mode: str, num_envs: int = N, **parameters: Any) -> PendulumVectorEnv:
    return PendulumVectorEnv(
        num_envs, max_episode_steps=LIMIT, autoreset_mode=mode, **parameters
    )


def synchronous_env(mode: str, **parameters: Any) -> SyncVectorEnv:
    def make() -> TimeLimit:
        return TimeLimit(PendulumEnv(**parameters), LIMIT)

    return SyncVectorEnv([make] * N, autoreset_mode=AutoresetMode(mode))


def place_each(env: SyncVectorEnv, states: np.ndarray, slots: Any) -> np.ndarray:
    """Set the states of some slots; the options of one reset go to all of them."""
    for slot in slots:
        options = {"reset_mask": mask_of(N, slot), "state": states[slot]}
        observations, _ = env.reset(options=options)
    return observations


@pytest.mark.parametrize("parameters", [EASY, {**EASY, "substeps": 3}], ids=str)
@pytest.mark.parametrize("mode", MODES)
def test_native_is_the_synchronous_one(mode: str, parameters: dict[str, Any]) -> None:
    native, sync = native_env(mode, **parameters), synchronous_env(mode, **parameters)
    rng = np.random.default_rng(1)
    native.reset(seed=1)
    sync.reset(seed=1)
    states = random_states(N, rng)
    ours, _ = native.reset(options={"state": states})
    assert_same_bits(ours, place_each(sync, states, range(N)))

    waiting = np.zeros(N, dtype=np.bool_)
    seen = {"terminated": 0, "truncated": 0, "restarted": 0}
    for _ in range(150):
        actions = rng.integers(0, 3, N)
        ours, theirs = native.step(actions), sync.step(actions)
        finished = theirs[2] | theirs[3]
        restarted = {
            "NextStep": waiting,
            "SameStep": finished,
            "Disabled": np.zeros_like(finished),
        }[mode]
        assert_same_bits(ours[0][~restarted], theirs[0][~restarted])
        for mine, other in zip(ours[1:4], theirs[1:4], strict=True):
            assert_same_bits(mine, other)
        assert_same_infos(ours[4], theirs[4])
        assert native.observation_space.contains(ours[0])

        # Each draws its own initial states: bring ours to where theirs are.
        if restarted.any():
            options = {"reset_mask": restarted, "state": theirs[0]}
            assert_same_bits(native.reset(options=options)[0], theirs[0])
        if mode == "Disabled" and finished.any():
            states = random_states(N, rng)
            options = {"reset_mask": finished, "state": states}
            observations, _ = native.reset(options=options)
            slots = np.flatnonzero(finished)
            assert_same_bits(observations, place_each(sync, states, slots))
        waiting = finished
        seen["terminated"] += theirs[2].sum()
        seen["truncated"] += theirs[3].sum()
        seen["restarted"] += restarted.sum()
    assert seen["terminated"] > 10
    assert seen["truncated"] > 10
    assert seen["restarted"] > 10 or mode == "Disabled"


@pytest.mark.parametrize("mode", MODES)
def test_both_flags_on_the_last_step(mode: str) -> None:
    env = PendulumVectorEnv(3, max_episode_steps=1, autoreset_mode=mode)
    env.reset(options={"state": [UPRIGHT, (0.0, 0.0), UPRIGHT]})
    _, _, terminated, truncated, _ = env.step([1, 1, 1])
    assert terminated.tolist() == [True, False, True]
    assert truncated.tolist() == [True, True, True]


@pytest.mark.parametrize("mode", MODES)
def test_no_limit_unless_one_is_set(mode: str) -> None:
    env = gym.make_vec(ENV_ID, num_envs=2, autoreset_mode=mode)
    env.reset(options={"state": np.zeros((2, 2))})
    assert not any(env.step([1, 1])[3].any() for _ in range(1000))


def test_next_step_ignores_the_action_of_a_restart() -> None:
    envs = [native_env("NextStep", num_envs=2) for _ in range(3)]
    for env in envs:
        env.reset(seed=2, options={"state": [UPRIGHT, (1.0, 0.0)]})
        assert env.step([1, 2])[2].tolist() == [True, False]
    results = [env.step([action, 0]) for action, env in enumerate(envs)]
    for result in results:
        assert_same_step(result, results[0])
    observations, rewards, terminated, truncated, infos = results[0]
    assert rewards[0] == 0.0
    assert rewards[1] < 0.0
    assert not terminated.any()
    assert not truncated.any()
    assert infos == {}
    assert np.abs(observations[0] - UPRIGHT).max() > 0.1


def test_same_step_tells_how_the_episode_ended() -> None:
    env = native_env("SameStep", num_envs=3)
    env.reset(seed=3, options={"state": [(1.0, 0.0), UPRIGHT, (2.0, 0.0)]})
    observations, _, terminated, _, infos = env.step([1, 1, 1])
    assert terminated.tolist() == [False, True, False]
    assert infos["_final_obs"].tolist() == [False, True, False]
    assert infos["_final_info"].tolist() == [False, True, False]
    assert infos["final_obs"][0] is None
    assert infos["final_obs"][2] is None
    last = infos["final_obs"][1]
    np.testing.assert_allclose(last, UPRIGHT, atol=1e-9)
    assert env.single_observation_space.contains(last)
    assert np.abs(observations[1] - last).max() > 0.1
    assert env.step([1, 1, 1])[4] == {}


def test_disabled_refuses_to_step_a_finished_slot() -> None:
    env, twin = (native_env("Disabled", num_envs=3) for _ in range(2))
    for each in (env, twin):
        each.reset(seed=4, options={"state": [(1.0, 0.0), UPRIGHT, (2.0, 0.0)]})
        finished = each.step([2, 1, 0])[2]
    for _ in range(2):
        with pytest.raises(ResetNeeded, match=r"slots \[1\].*reset_mask"):
            env.step([0, 0, 0])
    # The refused steps left no trace: the same states, the same random stream.
    ours, theirs = (e.reset(options={"reset_mask": finished}) for e in (env, twin))
    assert_same_bits(ours[0], theirs[0])
    for _ in range(LIMIT - 1):
        result = env.step([0, 1, 2])
        assert_same_step(result, twin.step([0, 1, 2]))
    assert result[3].tolist() == [True, False, True]


@pytest.mark.parametrize("mode", MODES)
def test_waiting_slots_stand_still_and_the_others_walk_on(mode: str) -> None:
    env, guide = native_env(mode, **EASY), native_env("Disabled", **EASY)
    rng = np.random.default_rng(5)
    states = random_states(N, rng)
    observations, _ = env.reset(seed=5, options={"state": states, **WAIT})
    guide.reset(seed=5, options={"state": states})
    assert observations.shape == (N, 2)
    walking = np.ones(N, dtype=np.bool_)
    ends = {"terminated": 0, "truncated": 0}
    for _ in range(LIMIT + 5):
        actions = rng.integers(0, 3, N)
        previous, was_walking = observations, walking.copy()
        observations, rewards, terminated, truncated, infos = env.step(actions)
        expected = step_and_reset(guide, actions, rng)
        for mine, other in zip(
            (observations, rewards, terminated, truncated), expected[:4], strict=True
        ):
            assert_same_bits(mine[was_walking], other[was_walking])
        assert_same_bits(observations[~was_walking], previous[~was_walking])
        assert not rewards[~was_walking].any()
        assert not (terminated | truncated)[~was_walking].any()
        assert infos == {}
        walking &= ~(terminated | truncated)
        ends["terminated"] += terminated.sum()
        ends["truncated"] += (truncated & ~terminated).sum()
    assert not walking.any()
    assert min(ends.values()) > 0
    assert sum(ends.values()) == N


@pytest.mark.parametrize("mode", MODES)
def test_waiting_ends_with_the_next_full_reset(mode: str) -> None:
    env, twin = (native_env(mode, num_envs=2) for _ in range(2))
    states = np.array([UPRIGHT, (1.0, 0.0)])
    env.reset(seed=6, options={"state": states, **WAIT})
    for _ in range(4):
        env.step([1, 1])
    for each in (env, twin):
        each.reset(seed=7, options={"state": states})
        each.step([1, 1])
    if mode == "Disabled":
        with pytest.raises(ResetNeeded):
            env.step([1, 1])
        return
    for _ in range(3 * LIMIT):
        assert_same_step(env.step([0, 2]), twin.step([0, 2]))


@pytest.mark.parametrize("mode", MODES)
def test_waiting_slot_walks_again_after_a_masked_reset(mode: str) -> None:
    env = native_env(mode, num_envs=3)
    env.reset(options={"state": [UPRIGHT, UPRIGHT, (1.0, 0.0)], **WAIT})
    assert env.step([1, 1, 1])[2].tolist() == [True, True, False]
    options = {"reset_mask": mask_of(3, 1), "state": [UPRIGHT, (0.5, 0.0), UPRIGHT]}
    before, _ = env.reset(options=options)
    assert before[1].tolist() == [0.5, 0.0]
    for step in range(2, 3 * LIMIT):
        after, rewards, terminated, truncated, _ = env.step([0, 1, 2])
        assert not terminated.any()
        # Slot 2 began one step before slot 1; each reports its end once.
        assert truncated.tolist() == [False, step == LIMIT + 1, step == LIMIT]
        assert (rewards != 0.0).tolist() == [False, step <= LIMIT + 1, step <= LIMIT]
        assert_same_bits(after[0], before[0])


@pytest.mark.parametrize("mode", MODES)
def test_waiting_can_begin_with_a_masked_reset(mode: str) -> None:
    env = native_env(mode, num_envs=2)
    env.reset(options={"state": [UPRIGHT, (1.0, 0.0)]})
    states = np.array([UPRIGHT, UPRIGHT])
    env.reset(options={"reset_mask": mask_of(2, 1), "state": states, **WAIT})
    observations, _, terminated, _, infos = env.step([1, 1])
    assert terminated.all()
    assert infos == {}
    assert_same_bits(env.step([0, 2])[0], observations)


@pytest.mark.parametrize("value", ["stop", "", None, True, 1])
def test_only_waiting_is_offered(value: Any) -> None:
    with pytest.raises(
        ValueError, match=r"options\['finished'\] must be one of 'wait'"
    ):
        PendulumVectorEnv(2).reset(options={"finished": value})


@pytest.mark.parametrize("mode", MODES)
def test_statistics_of_episodes_are_recorded(mode: str) -> None:
    env = RecordEpisodeStatistics(native_env(mode, **EASY))
    rng = np.random.default_rng(8)
    env.reset(seed=8)
    total, length = np.zeros(N), np.zeros(N, dtype=np.int64)
    restarting = np.zeros(N, dtype=np.bool_)
    episodes = []
    for _ in range(100):
        _, rewards, terminated, truncated, infos = env.step(rng.integers(0, 3, N))
        finished = terminated | truncated
        total += np.where(restarting, 0.0, rewards)
        length += ~restarting
        assert ("episode" in infos) == finished.any()
        if finished.any():
            assert infos["_episode"].tolist() == finished.tolist()
            np.testing.assert_allclose(
                infos["episode"]["r"], np.where(finished, total, 0.0), rtol=1e-12
            )
            assert infos["episode"]["l"].tolist() == (length * finished).tolist()
            episodes += length[finished].tolist()
        total[finished], length[finished] = 0.0, 0
        restarting = finished & (mode == "NextStep")
        if mode == "Disabled" and finished.any():
            env.reset(options={"reset_mask": finished})
    assert len(episodes) > 30
    assert env.episode_count == len(episodes)
    assert list(env.length_queue) == episodes[-100:]
    assert max(episodes) == LIMIT
    assert min(episodes) < LIMIT
