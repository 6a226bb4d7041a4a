"""Resets of the native vector environment: states, masks, and the other slots."""

from typing import Any

import numpy as np
import pytest
from gymnasium.error import Error

from acl_gym.envs.pendulum import PendulumVectorEnv
from tests.envs.vector_helpers import (
    TINY,
    UPRIGHT,
    assert_same_bits,
    assert_walk_alike,
    mask_of,
    pair,
    random_states,
    step_and_reset,
)

NAN, INF = float("nan"), float("inf")


def test_state_option_sets_the_states(mode: str) -> None:
    env = PendulumVectorEnv(3, autoreset_mode=mode)
    states = np.array([[-1.0, 0.5], [7.0, -9.0], [0.0, 9.0]])
    options = {"state": states}
    observations, _ = env.reset(options=options)
    expected = np.stack([np.mod(states[:, 0], 2 * np.pi), states[:, 1]], axis=1)
    assert_same_bits(observations, expected)
    assert options["state"] is states
    assert states[0].tolist() == [-1.0, 0.5]
    assert_same_bits(env.reset(options={"state": states.tolist()})[0], expected)


BAD_STATES = {
    "one state": [0.0, 0.0],
    "too few": [[0.0, 0.0]] * 3,
    "too many": [[0.0, 0.0]] * 5,
    "three variables": [[0.0, 0.0, 0.0]] * 4,
    "number": 0.0,
    "nan": [[0.0, 0.0]] * 3 + [[NAN, 0.0]],
    "infinite": [[0.0, 0.0]] * 3 + [[0.0, INF]],
    "too fast": [[0.0, 0.0]] * 3 + [[0.0, -9.5]],
    "ragged": [[0.0, 0.0]] * 3 + [[0.0]],
    "words": [["up", "still"]] * 4,
    "digits as strings": [["0", "0"]] * 4,
    "complex": [[1j, 0.0]] * 4,
    "none": [[None, 0.0]] * 4,
}


@pytest.mark.parametrize("states", BAD_STATES.values(), ids=BAD_STATES)
@pytest.mark.parametrize("masked", [False, True])
def test_bad_states_are_refused_and_change_nothing(states: Any, masked: bool) -> None:
    env, twin = pair("NextStep")
    options = {"state": states, "finished": "wait"}
    if masked:
        options["reset_mask"] = mask_of(4, 0, 3)
    with pytest.raises(ValueError, match=r"state|omega"):
        env.reset(seed=2, options=options)
    assert_walk_alike(env, twin)


def test_message_names_the_slot_of_a_bad_state() -> None:
    env = pair("NextStep")[0]
    states = [[0.0, 0.0]] * 3 + [[NAN, 0.0]]
    with pytest.raises(ValueError, match=r"(row|slot) 3\b"):
        env.reset(options={"state": states, "reset_mask": mask_of(4, 0, 3)})


@pytest.mark.parametrize(
    ("mask", "error"),
    [
        ([True, False, False, False], TypeError),
        (True, TypeError),
        (np.ones(4), TypeError),
        (np.ones(4, dtype=np.int64), TypeError),
        (np.ones(3, dtype=np.bool_), ValueError),
        (np.ones((4, 1), dtype=np.bool_), ValueError),
        (np.array(True), ValueError),
        (np.zeros(4, dtype=np.bool_), ValueError),
    ],
)
def test_bad_mask_is_refused_and_changes_nothing(
    mask: Any, error: type[Exception]
) -> None:
    env, twin = pair("NextStep")
    with pytest.raises(error, match="reset_mask"):
        env.reset(seed=2, options={"reset_mask": mask, "finished": "wait"})
    assert_walk_alike(env, twin)


@pytest.mark.parametrize("options", [{"states": 1}, {"mask": None}, {"x": 1, "y": 2}])
def test_unknown_option_is_refused(options: dict[str, Any]) -> None:
    env, twin = pair("NextStep")
    with pytest.raises(ValueError, match=rf"options must be.*{sorted(options)[0]}"):
        env.reset(seed=2, options=options)
    assert_walk_alike(env, twin)


def test_bad_seed_changes_nothing() -> None:
    env, twin = pair("NextStep")
    with pytest.raises(Error):
        env.reset(seed=-1, options={"state": np.zeros((4, 2)), "finished": "wait"})
    assert_walk_alike(env, twin)


def test_options_stay_as_they_were(mode: str) -> None:
    env = pair(mode)[0]
    mask, states = mask_of(4, 1), np.zeros((4, 2))
    options = {"reset_mask": mask, "state": states, "finished": "wait"}
    kept = dict(options)
    env.reset(options=options)
    assert list(options) == list(kept)
    assert all(options[key] is kept[key] for key in kept)
    assert mask.tolist() == [False, True, False, False]
    assert not states.any()


@pytest.mark.parametrize("with_states", [False, True])
def test_mask_leaves_the_other_slots_alone(with_states: bool, mode: str) -> None:
    env = PendulumVectorEnv(4, autoreset_mode=mode, max_episode_steps=6, **TINY)
    env.reset(seed=2)
    rng = np.random.default_rng(2)
    for _ in range(3):
        before = env.step(rng.integers(0, 3, 4))[0]
    mask = mask_of(4, 0, 2)
    options: dict[str, Any] = {"reset_mask": mask}
    # Rows outside the mask are not looked at.
    states = np.array([[1.0, 1.0], [NAN, INF], [2.0, -2.0], [0.0, 99.0]])
    if with_states:
        options["state"] = states
    after, infos = env.reset(options=options)
    assert infos == {}
    assert_same_bits(after[~mask], before[~mask])
    assert not np.any(after[mask] == before[mask])
    if with_states:
        assert_same_bits(after[mask], states[mask])
    # The counters of the others run on.
    flags = [env.step([0, 1, 2, 1])[3].tolist() for _ in range(3)]
    assert flags == [[False] * 4, [False] * 4, (~mask).tolist()]


def test_mask_of_all_slots_is_a_full_reset_that_keeps_waiting(mode: str) -> None:
    env = PendulumVectorEnv(2, autoreset_mode=mode)
    env.reset(options={"state": np.zeros((2, 2)), "finished": "wait"})
    options = {"reset_mask": mask_of(2, 0, 1), "state": [UPRIGHT, (1.0, 0.0)]}
    env.reset(options=options)
    observations, _, terminated, _, _ = env.step([1, 1])
    assert terminated.tolist() == [True, False]
    assert_same_bits(env.step([2, 1])[0][0], observations[0])


def test_resets_of_one_slot_leave_the_others_alone(mode: str) -> None:
    env, free = (PendulumVectorEnv(5, autoreset_mode=mode, **TINY) for _ in range(2))
    rng = np.random.default_rng(3)
    states = random_states(5, rng)
    for each in (env, free):
        each.reset(seed=3, options={"state": states})
    others = np.arange(5) != 2
    finishes = 0
    for step in range(60):
        if step % 3 == 0:
            states = np.tile(UPRIGHT, (5, 1))
            env.reset(options={"reset_mask": ~others, "state": states})
        actions = rng.integers(0, 3, 5)
        actions[2] = 1
        ours, expected = step_and_reset(env, actions), free.step(actions)
        assert not expected[2].any()
        assert ours[2][2] == (step % 3 == 0)
        finishes += ours[2][2]
        for mine, other in zip(ours[:4], expected[:4], strict=True):
            assert_same_bits(mine[others], other[others])
    assert finishes == 20
