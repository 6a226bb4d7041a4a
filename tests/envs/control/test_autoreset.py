"""What becomes of finished slots: the three modes of Gymnasium, and standing still."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers import TimeLimit
from gymnasium.wrappers.vector import RecordEpisodeStatistics

from acl_gym.envs.control.environments import ControlVectorEnv
from tests.envs.systems import LASTING, SYSTEMS, SystemCase, by_id
from tests.envs.vector_helpers import (
    assert_same_bits,
    assert_same_infos,
    assert_same_step,
    beside_masks,
    mask_of,
    random_states,
    step_and_reset,
    success_at_ends,
)

N, LIMIT = 7, 9
WAIT = {"finished": "wait"}


def native_env(
    case: SystemCase, mode: str, num_envs: int = N, **parameters: Any
) -> ControlVectorEnv:
    return case.vector(
        num_envs, max_episode_steps=LIMIT, autoreset_mode=mode, **parameters
    )


def synchronous_env(case: SystemCase, mode: str, **parameters: Any) -> SyncVectorEnv:
    def make() -> TimeLimit:
        return TimeLimit(case.single(**parameters), LIMIT)

    return SyncVectorEnv([make] * N, autoreset_mode=AutoresetMode(mode))


def place_each(env: SyncVectorEnv, states: np.ndarray, slots: Any) -> np.ndarray:
    """Set the states of some slots; the options of one reset go to all of them."""
    for slot in slots:
        options = {"reset_mask": mask_of(N, slot), "state": states[slot]}
        observations, _ = env.reset(options=options)
    return observations


@pytest.mark.parametrize("varied", [False, True])
def test_native_is_the_synchronous_one(
    case: SystemCase, mode: str, varied: bool
) -> None:
    parameters = {**case.easy, **(case.variant if varied else {})}
    native = native_env(case, mode, **parameters)
    sync = synchronous_env(case, mode, **parameters)
    rng = np.random.default_rng(1)
    native.reset(seed=1)
    sync.reset(seed=1)
    states = random_states(native, rng)
    ours, _ = native.reset(options={"state": states})
    assert_same_bits(ours, place_each(sync, states, range(N)))

    waiting = np.zeros(N, dtype=np.bool_)
    seen = {"terminated": 0, "truncated": 0, "restarted": 0}
    for _ in range(150):
        actions = rng.integers(0, case.n_actions, N)
        ours, theirs = native.step(actions), success_at_ends(sync.step(actions))
        finished = theirs[2] | theirs[3]
        restarted = {
            "NextStep": waiting,
            "SameStep": finished,
            "Disabled": np.zeros_like(finished),
        }[mode]
        assert_same_bits(ours[0][~restarted], theirs[0][~restarted])
        for mine, other in zip(ours[1:4], theirs[1:4], strict=True):
            assert_same_bits(mine, other)
        if not restarted.any():
            assert_same_infos(ours[4], theirs[4])
        assert native.observation_space.contains(ours[0])

        # Each draws its own initial states: bring ours to where theirs are.
        if restarted.any():
            options = {"reset_mask": restarted, "state": theirs[0]}
            observations, infos = native.reset(options=options)
            assert_same_bits(observations, theirs[0])
            # What was said of the last states is the same, and of the new ones now.
            said = ("final", "is_success")
            last = {k: ours[4][k] for k in ours[4] if any(word in k for word in said)}
            assert_same_infos({**last, **infos}, theirs[4])
        if mode == "Disabled" and finished.any():
            states = random_states(native, rng)
            options = {"reset_mask": finished, "state": states}
            observations, _ = native.reset(options=options)
            slots = np.flatnonzero(finished)
            assert_same_bits(observations, place_each(sync, states, slots))
        waiting = finished
        seen["terminated"] += theirs[2].sum()
        seen["truncated"] += theirs[3].sum()
        seen["restarted"] += restarted.sum()
    assert seen["terminated"] > 10
    assert seen["truncated"] > 10 or not case.lasting
    assert seen["restarted"] > 10 or mode == "Disabled"


@pytest.mark.parametrize(
    "case", [c for c in SYSTEMS if c.draws], ids=lambda c: c.single.__name__
)
def test_one_slot_is_the_single_environment(case: SystemCase) -> None:
    # Also where steps are random: both take the same numbers from one seed.
    single, vector = case.single(**case.draws), case.vector(1, **case.draws)
    rng = np.random.default_rng(1)
    for seed in range(5):
        ours, theirs = vector.reset(seed=seed)[0], single.reset(seed=seed)[0]
        for _ in range(200):
            assert_same_bits(ours[0], theirs)
            action = int(rng.integers(case.n_actions))
            ours, *rewards_and_flags, _ = vector.step([action])
            theirs, *result, _ = single.step(action)
            assert [column[0] for column in rewards_and_flags] == result
            if result[1]:
                break
        assert result[1]


def test_both_flags_on_the_last_step(case: SystemCase, mode: str) -> None:
    env = case.vector(3, max_episode_steps=1, autoreset_mode=mode, **case.narrow)
    env.reset(options={"state": case.rows(case.near, case.away, case.near)})
    _, _, terminated, truncated, _ = env.step([case.near_action] * 3)
    assert terminated.tolist() == [True, False, True]
    assert truncated.tolist() == [True, True, True]


@pytest.mark.parametrize("case", LASTING, ids=by_id)
@pytest.mark.parametrize("none", [-1, None])
def test_a_limit_can_be_removed(case: SystemCase, mode: str, none: int | None) -> None:
    env = gym.make_vec(
        case.env_id,
        num_envs=2,
        autoreset_mode=mode,
        max_episode_steps=none,
        **case.narrow,
    )
    assert env.unwrapped.max_episode_steps is None
    env.reset(options={"state": case.rows(case.away, case.away)})
    assert not any(env.step([0, 0])[3].any() for _ in range(1000))


@pytest.mark.parametrize("case", LASTING, ids=by_id)
def test_next_step_ignores_the_action_of_a_restart(case: SystemCase) -> None:
    near = case.near_action
    envs = [
        native_env(case, "NextStep", num_envs=2, **case.narrow)
        for _ in range(case.n_actions)
    ]
    for env in envs:
        env.reset(seed=2, options={"state": case.rows(case.near, case.away)})
        last, _, terminated, _, _ = env.step([near, near])
        assert terminated.tolist() == [True, False]
    results = [env.step([action, 0]) for action, env in enumerate(envs)]
    for result in results:
        assert_same_step(result, results[0])
    observations, rewards, terminated, truncated, infos = results[0]
    assert rewards[0] == 0.0
    assert rewards[1] < 0.0
    assert not terminated.any()
    assert not truncated.any()
    assert beside_masks(infos) == {}
    assert np.any(observations[0] != last[0])


def test_same_step_reports_how_the_episode_ended(case: SystemCase) -> None:
    env = native_env(case, "SameStep", num_envs=3, **case.narrow)
    states = case.rows(case.away, case.near, case.away)
    env.reset(seed=3, options={"state": states})
    observations, _, terminated, _, infos = env.step([case.near_action] * 3)
    assert terminated.tolist() == [False, True, False]
    assert infos["_final_obs"].tolist() == [False, True, False]
    assert infos["_final_info"].tolist() == [False, True, False]
    assert infos["final_obs"][0] is None
    assert infos["final_obs"][2] is None
    last = infos["final_obs"][1]
    single = case.single(**case.narrow)
    single.reset(options={"state": case.near})
    assert_same_bits(last, single.step(case.near_action)[0])
    assert env.single_observation_space.contains(last)
    assert np.any(observations[1] != last)
    env.reset(options={"state": case.rows(*[case.away] * 3)})
    assert beside_masks(env.step([0, 0, 0])[4]) == {}


@pytest.mark.parametrize("case", LASTING, ids=by_id)
def test_disabled_refuses_to_step_a_finished_slot(case: SystemCase) -> None:
    env, twin = (
        native_env(case, "Disabled", num_envs=3, **case.narrow) for _ in range(2)
    )
    actions = np.arange(3) % case.n_actions
    states = case.rows(case.away, case.near, case.away)
    for each in (env, twin):
        each.reset(seed=4, options={"state": states})
        finished = each.step([case.near_action] * 3)[2]
    for _ in range(2):
        with pytest.raises(ResetNeeded, match=r"slots \[1\].*reset_mask"):
            env.step([0, 0, 0])
    # The refused steps left no trace: the same states, the same random stream.
    ours, theirs = (e.reset(options={"reset_mask": finished}) for e in (env, twin))
    assert_same_bits(ours[0], theirs[0])
    for each in (env, twin):
        each.reset(options={"reset_mask": finished, "state": states[[0, 0, 0]]})
    for _ in range(LIMIT - 1):
        result = env.step(actions)
        assert_same_step(result, twin.step(actions))
    assert result[3].tolist() == [True, False, True]


def test_waiting_slots_stand_still_and_the_others_walk_on(
    case: SystemCase, mode: str
) -> None:
    env = native_env(case, mode, **case.easy)
    guide = native_env(case, "Disabled", **case.easy)
    rng = np.random.default_rng(5)
    ends = {"terminated": 0, "truncated": 0}
    for seed in range(5):
        states = random_states(env, rng)
        observations, _ = env.reset(seed=seed, options={"state": states, **WAIT})
        guide.reset(seed=seed, options={"state": states})
        walking = np.ones(N, dtype=np.bool_)
        for _ in range(LIMIT + 5):
            actions = rng.integers(0, case.n_actions, N)
            previous, was_walking = observations, walking.copy()
            observations, rewards, terminated, truncated, infos = env.step(actions)
            expected = step_and_reset(guide, actions, rng)
            for mine, other in zip(
                (observations, rewards, terminated, truncated),
                expected[:4],
                strict=True,
            ):
                assert_same_bits(mine[was_walking], other[was_walking])
            assert_same_bits(observations[~was_walking], previous[~was_walking])
            assert not rewards[~was_walking].any()
            assert not (terminated | truncated)[~was_walking].any()
            told = beside_masks(infos)
            assert bool(told) == (terminated | truncated).any()
            if told:
                assert_same_bits(told.pop("is_success"), terminated)
                assert_same_bits(told.pop("_is_success"), terminated | truncated)
            assert not told
            walking &= ~(terminated | truncated)
            ends["terminated"] += terminated.sum()
            ends["truncated"] += (truncated & ~terminated).sum()
        assert not walking.any()
    assert ends["terminated"] > 0
    assert ends["truncated"] > 0 or not case.lasting
    assert sum(ends.values()) == 5 * N


def test_waiting_ends_with_the_next_full_reset(case: SystemCase, mode: str) -> None:
    env, twin = (native_env(case, mode, num_envs=2, **case.narrow) for _ in range(2))
    states = case.rows(case.near, case.away)
    actions = [case.near_action] * 2
    env.reset(seed=6, options={"state": states, **WAIT})
    for _ in range(4):
        env.step(actions)
    for each in (env, twin):
        each.reset(seed=7, options={"state": states})
        each.step(actions)
    if mode == "Disabled":
        with pytest.raises(ResetNeeded):
            env.step(actions)
        return
    for _ in range(3 * LIMIT):
        assert_same_step(env.step([0, 1]), twin.step([0, 1]))


@pytest.mark.parametrize("case", LASTING, ids=by_id)
def test_waiting_slot_walks_again_after_a_masked_reset(
    case: SystemCase, mode: str
) -> None:
    env = native_env(case, mode, num_envs=3, **case.narrow)
    near, away, actions = case.near, case.away, [case.near_action] * 3
    env.reset(options={"state": case.rows(near, near, away), **WAIT})
    assert env.step(actions)[2].tolist() == [True, True, False]
    options = {"reset_mask": mask_of(3, 1), "state": case.rows(near, away, near)}
    before, _ = env.reset(options=options)
    assert_same_bits(before[1:2], case.observed(away))
    for step in range(2, 3 * LIMIT):
        after, rewards, terminated, truncated, _ = env.step(actions)
        assert not terminated.any()
        # Slot 2 began one step before slot 1; each reports its end once.
        assert truncated.tolist() == [False, step == LIMIT + 1, step == LIMIT]
        assert (rewards != 0.0).tolist() == [False, step <= LIMIT + 1, step <= LIMIT]
        assert_same_bits(after[0], before[0])


def test_waiting_can_begin_with_a_masked_reset(case: SystemCase, mode: str) -> None:
    env = native_env(case, mode, num_envs=2, **case.narrow)
    env.reset(options={"state": case.rows(case.near, case.away)})
    states = case.rows(case.near, case.near)
    env.reset(options={"reset_mask": mask_of(2, 1), "state": states, **WAIT})
    observations, _, terminated, _, infos = env.step([case.near_action] * 2)
    assert terminated.all()
    assert set(beside_masks(infos)) == {"is_success", "_is_success"}
    assert_same_bits(env.step([0, 1])[0], observations)


@pytest.mark.parametrize("value", ["stop", "", None, True, 1])
def test_only_waiting_is_offered(case: SystemCase, value: Any) -> None:
    with pytest.raises(
        ValueError, match=r"options\['finished'\] must be one of 'wait'"
    ):
        case.vector(2).reset(options={"finished": value})


def test_statistics_of_episodes_are_recorded(case: SystemCase, mode: str) -> None:
    env = RecordEpisodeStatistics(native_env(case, mode, **case.easy))
    rng = np.random.default_rng(8)
    env.reset(seed=8)
    total, length = np.zeros(N), np.zeros(N, dtype=np.int64)
    restarting = np.zeros(N, dtype=np.bool_)
    episodes = []
    for _ in range(100):
        _, rewards, terminated, truncated, infos = env.step(
            rng.integers(0, case.n_actions, N)
        )
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
    assert max(episodes) == LIMIT or not case.lasting
    assert min(episodes) < LIMIT


def test_the_mode_can_be_changed(case: SystemCase, mode: str) -> None:
    """The episodes are those of an environment that was made with the mode."""
    made = native_env(case, mode, **case.easy)
    for old in AutoresetMode:
        env = native_env(case, old.value, **case.easy)
        env.reset(seed=1)  # the change holds in the midst of episodes, too
        env.set_autoreset_mode(mode)
        assert env.autoreset_mode.value == env.metadata["autoreset_mode"].value == mode
        assert type(env).metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
        rng = np.random.default_rng(2)
        made.reset(seed=1)
        for _ in range(2 * LIMIT):
            actions = rng.integers(0, case.n_actions, N)
            result = made.step(actions)
            assert_same_step(result, env.step(actions))
            finished = result[2] | result[3]
            if mode == "Disabled" and finished.any():
                for each in (made, env):
                    each.reset(options={"reset_mask": finished})
    with pytest.raises(ValueError, match=r"^autoreset_mode must be one of"):
        made.set_autoreset_mode("Sometimes")
