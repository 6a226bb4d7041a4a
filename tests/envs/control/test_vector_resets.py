"""Resets of the native vector environment: states, masks, and the other slots."""

from typing import Any

import numpy as np
import pytest

from acl_gym.envs.pendulum import PendulumVectorEnv
from tests.envs.systems import LASTING, SystemCase, by_id
from tests.envs.vector_helpers import (
    assert_same_bits,
    assert_walk_alike,
    mask_of,
    pair,
    step_and_reset,
)

NAN, INF = float("nan"), float("inf")


def test_given_angles_become_canonical(mode: str) -> None:
    env = PendulumVectorEnv(3, autoreset_mode=mode)
    states = np.array([[-1.0, 0.5], [7.0, -9.0], [0.0, 9.0]])
    options = {"state": states}
    observations, _ = env.reset(options=options)
    expected = np.stack([np.mod(states[:, 0], 2 * np.pi), states[:, 1]], axis=1)
    assert_same_bits(observations, expected)
    assert options["state"] is states
    assert states[0].tolist() == [-1.0, 0.5]
    assert_same_bits(env.reset(options={"state": states.tolist()})[0], expected)


@pytest.mark.parametrize("masked", [False, True])
def test_bad_states_are_refused_and_change_nothing(
    case: SystemCase, masked: bool
) -> None:
    env, twin = pair(case, "NextStep")
    good = env.states[0].tolist()
    # A bool among numbers is a number to NumPy; a wrong shape is tried below.
    bad_rows = [
        bad if isinstance(bad, list) else [bad]
        for bad in case.bad_states.values()
        if not isinstance(bad, np.ndarray | dict | bool)
    ]
    bad_batches = [[good, good, good, row] for row in bad_rows]
    bad_batches += [[good] * 3, [good] * 5, [[good]] * 4, 0.0, [[None]] * 4]
    for states in bad_batches:
        options = {"state": states, "finished": "wait"}
        if masked:
            options["reset_mask"] = mask_of(4, 0, 3)
        with pytest.raises(ValueError, match=r"state|omega"):
            env.reset(seed=2, options=options)
    assert_walk_alike(env, twin)


def test_message_names_the_slot_of_a_bad_state(case: SystemCase) -> None:
    env = pair(case, "NextStep")[0]
    states = env.states
    states[3] = NAN
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
    case: SystemCase, mask: Any, error: type[Exception]
) -> None:
    env, twin = pair(case, "NextStep")
    with pytest.raises(error, match="reset_mask"):
        env.reset(seed=2, options={"reset_mask": mask, "finished": "wait"})
    assert_walk_alike(env, twin)


@pytest.mark.parametrize("options", [{"states": 1}, {"mask": None}, {"x": 1, "y": 2}])
def test_unknown_option_is_refused(case: SystemCase, options: dict[str, Any]) -> None:
    env, twin = pair(case, "NextStep")
    with pytest.raises(ValueError, match=rf"options must be.*{sorted(options)[0]}"):
        env.reset(seed=2, options=options)
    assert_walk_alike(env, twin)


def test_bad_seed_changes_nothing(case: SystemCase) -> None:
    env, twin = pair(case, "NextStep")
    with pytest.raises(ValueError, match="seed must be at least 0, got -1"):
        env.reset(seed=-1, options={"state": env.states, "finished": "wait"})
    assert_walk_alike(env, twin)


def test_options_stay_as_they_were(case: SystemCase, mode: str) -> None:
    env = pair(case, mode)[0]
    mask, states = mask_of(4, 1), env.states
    before = states.copy()
    options = {"reset_mask": mask, "state": states, "finished": "wait"}
    kept = dict(options)
    env.reset(options=options)
    assert list(options) == list(kept)
    assert all(options[key] is kept[key] for key in kept)
    assert mask.tolist() == [False, True, False, False]
    np.testing.assert_array_equal(states, before)


@pytest.mark.parametrize("case", LASTING, ids=by_id)
@pytest.mark.parametrize("with_states", [False, True])
def test_mask_leaves_the_other_slots_alone(
    case: SystemCase, with_states: bool, mode: str
) -> None:
    env = case.vector(4, autoreset_mode=mode, max_episode_steps=6, **case.narrow)
    env.reset(seed=2, options={"state": case.rows(*[case.away] * 4)})
    rng = np.random.default_rng(2)
    for _ in range(3):
        before = env.step(rng.integers(0, case.n_actions, 4))[0]
    mask = mask_of(4, 0, 2)
    options: dict[str, Any] = {"reset_mask": mask}
    # Rows outside the mask are not looked at.
    states = case.rows(*[case.near] * 4)
    states[1], states[3] = NAN, INF
    if with_states:
        options["state"] = states
    after, infos = env.reset(options=options)
    assert infos == {}
    assert_same_bits(after[~mask], before[~mask])
    assert not np.any(after[mask] == before[mask])
    if with_states:
        assert_same_bits(after[mask], case.observed(case.near, case.near))
    away = case.rows(*[case.away] * 4)
    env.reset(options={"reset_mask": mask, "state": away})
    # The counters of the others run on.
    actions = np.arange(4) % case.n_actions
    flags = [env.step(actions)[3].tolist() for _ in range(3)]
    assert flags == [[False] * 4, [False] * 4, (~mask).tolist()]


def test_mask_of_all_slots_is_a_full_reset_that_keeps_waiting(
    case: SystemCase, mode: str
) -> None:
    env = case.vector(2, autoreset_mode=mode, **case.narrow)
    away = case.rows(case.away, case.away)
    env.reset(options={"state": away, "finished": "wait"})
    states = case.rows(case.near, case.away)
    env.reset(options={"reset_mask": mask_of(2, 0, 1), "state": states})
    actions = [case.near_action] * 2
    observations, _, terminated, _, _ = env.step(actions)
    assert terminated.tolist() == [True, False]
    assert_same_bits(env.step([0, 0])[0][0], observations[0])


@pytest.mark.parametrize("case", LASTING, ids=by_id)
def test_resets_of_one_slot_leave_the_others_alone(case: SystemCase, mode: str) -> None:
    env, free = (case.vector(5, autoreset_mode=mode, **case.narrow) for _ in range(2))
    rng = np.random.default_rng(3)
    for each in (env, free):
        each.reset(seed=3, options={"state": case.rows(*[case.away] * 5)})
    others = np.arange(5) != 2
    finishes = 0
    for step in range(60):
        if step % 3 == 0:
            states = case.rows(*[case.near] * 5)
            env.reset(options={"reset_mask": ~others, "state": states})
        actions = rng.integers(0, case.n_actions, 5)
        actions[2] = case.near_action
        ours, expected = step_and_reset(env, actions), free.step(actions)
        assert not expected[2].any()
        # Only the first step from `near` must end; later ones may, elsewhere.
        assert ours[2][2] or step % 3
        finishes += ours[2][2]
        for mine, other in zip(ours[:4], expected[:4], strict=True):
            assert_same_bits(mine[others], other[others])
    assert finishes >= 20
