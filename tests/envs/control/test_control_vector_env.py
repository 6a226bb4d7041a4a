"""The native vector environment: its face, actions, aliasing, determinism, copies."""

import copy
import pickle
from itertools import combinations
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from acl_gym.envs.control import bookkeeping, stepping
from acl_gym.envs.pendulum import PendulumVectorEnv
from tests.envs.systems import SystemCase
from tests.envs.vector_helpers import (
    arrays_in,
    assert_same_bits,
    assert_same_step,
    assert_walk_alike,
    beside_masks,
    pair,
    walk,
)

NAN = float("nan")


@pytest.mark.parametrize("num_envs", [1, 3])
def test_spaces(case: SystemCase, num_envs: int) -> None:
    env = case.vector(num_envs, **case.narrow)
    assert env.num_envs == num_envs
    assert env.single_observation_space == case.system.observation_space
    assert env.single_action_space == spaces.Discrete(case.n_actions)
    assert env.action_space == spaces.MultiDiscrete([case.n_actions] * num_envs)
    assert env.observation_space == batch_space(case.system.observation_space, num_envs)


def test_what_is_returned(case: SystemCase, mode: str) -> None:
    env = case.vector(5, autoreset_mode=mode, max_episode_steps=20, **case.easy)
    observations, infos = env.reset(seed=1)
    assert beside_masks(infos) == {}
    assert env.observation_space.contains(observations)
    for observations, rewards, terminated, truncated, infos in walk(env, 400, 1):
        assert env.observation_space.contains(observations)
        assert (rewards.shape, rewards.dtype) == ((5,), np.float64)
        assert np.all((rewards <= 0.0) & (rewards >= -env.system.max_stage_cost))
        for flags in (terminated, truncated):
            assert (flags.shape, flags.dtype) == ((5,), np.bool_)
        ended = (terminated | truncated).any()
        assert bool(beside_masks(infos)) == ended
        assert ("final_info" in infos) == (ended and mode == "SameStep")


def test_make_vec_takes_the_mode_as_a_string(case: SystemCase, mode: str) -> None:
    env = gym.make_vec(
        case.env_id, num_envs=2, autoreset_mode=mode, max_episode_steps=5
    )
    assert issubclass(case.vector, type(env.unwrapped))
    assert env.metadata["autoreset_mode"] is AutoresetMode(mode)
    assert env.unwrapped.max_episode_steps == 5
    assert mode in env.unwrapped.spec.to_json()
    # The mode of one environment is not that of the class.
    assert case.vector.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    default = gym.make_vec(case.env_id)
    assert default.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    assert not env.unwrapped.closed
    env.close()
    assert env.unwrapped.closed


def test_mode_may_be_an_enum_member(case: SystemCase, mode: str) -> None:
    env = case.vector(2, autoreset_mode=AutoresetMode(mode))
    assert env.metadata["autoreset_mode"] is AutoresetMode(mode)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("num_envs", 0),
        ("num_envs", 1.0),
        ("num_envs", "2"),
        ("num_envs", True),
        ("max_episode_steps", 0),
        ("max_episode_steps", -2),
        ("max_episode_steps", True),
        ("max_episode_steps", 10.0),
        ("autoreset_mode", "nextstep"),
        ("autoreset_mode", None),
        ("autoreset_mode", ["NextStep"]),
        ("render_mode", "human"),
    ],
)
def test_bad_argument_is_refused_by_name(
    case: SystemCase, name: str, value: Any
) -> None:
    with pytest.raises((TypeError, ValueError), match=rf"^{name} must"):
        case.vector(**{name: value})


BAD_ACTIONS = {
    "floats": ([0.0, 1.0, 2.0, 0.0], TypeError, "float64"),
    "nan": ([NAN, 0, 0, 0], TypeError, "float64"),
    "bools": ([True, False, True, True], TypeError, "bool"),
    "none": ([0, None, 0, 0], TypeError, "object"),
    "strings": (["0", "1", "2", "0"], TypeError, "<U1"),
    "too few": ([0, 1, 2], ValueError, r"\(3,\)"),
    "too many": ([0] * 5, ValueError, r"\(5,\)"),
    "one number": (1, ValueError, r"\(\)"),
    "column": ([[0], [1], [2], [0]], ValueError, r"\(4, 1\)"),
    "beyond": ([0, 1, 9, 0], ValueError, "got 9 in slot 2"),
    "negative": ([0, -1, 1, 0], ValueError, "got -1 in slot 1"),
    "huge": (np.array([0, 2**63, 0, 0], dtype=np.uint64), ValueError, "in slot 1"),
}


@pytest.mark.parametrize(
    ("actions", "error", "message"), BAD_ACTIONS.values(), ids=BAD_ACTIONS
)
def test_bad_actions_are_refused_and_change_nothing(
    case: SystemCase, actions: Any, error: type[Exception], message: str
) -> None:
    env, twin = pair(case, "NextStep")
    with pytest.raises(error, match=rf"^actions must.*{message}"):
        env.step(actions)
    assert_walk_alike(env, twin)


@pytest.mark.parametrize("kind", [list, tuple, np.int8, np.int32, np.int64, np.uint16])
def test_any_integers_are_actions(case: SystemCase, kind: Any) -> None:
    env, twin = pair(case, "NextStep")
    actions = np.array([0, 1, 0, 1])
    given = kind(actions.tolist())
    assert_same_step(env.step(given), twin.step(actions))
    assert np.array_equal(given, [0, 1, 0, 1])


def test_step_needs_a_reset(case: SystemCase, mode: str) -> None:
    env = case.vector(2, autoreset_mode=mode)
    with pytest.raises(ResetNeeded, match="reset"):
        env.step([1, 1])
    with pytest.raises(ResetNeeded, match="reset_mask"):
        env.reset(options={"reset_mask": np.array([True, True])})


@pytest.mark.parametrize("wait", [False, True])
def test_returned_arrays_belong_to_the_caller(
    case: SystemCase, wait: bool, mode: str
) -> None:
    env, twin = pair(case, mode)
    options = {"finished": "wait"} if wait else None
    returned = arrays_in(env.reset(options=options))
    assert_same_bits(returned[0], twin.reset(options=options)[0])
    rng = np.random.default_rng(4)
    for _ in range(40):
        # What the caller writes into the arrays does not come back.
        for array in returned:
            array[...] = 1
        actions = rng.integers(0, case.n_actions, 4)
        result = env.step(actions)
        assert_same_step(result, twin.step(actions))
        returned = arrays_in(result)
        finished = result[2] | result[3]
        if mode == "Disabled" and not wait and finished.any():
            mask = {"reset_mask": finished.copy()}
            new = arrays_in(env.reset(options=mask))
            assert_same_bits(new[0], twin.reset(options=mask)[0])
            returned += new


def test_states_are_copies(case: SystemCase, mode: str) -> None:
    env, twin = pair(case, mode)
    with pytest.raises(ResetNeeded):
        case.vector(2).states  # noqa: B018
    start = env.states
    for each in (env, twin):
        each.reset(options={"state": start})
    env.states[:] = 1.0
    actions = np.arange(4) % case.n_actions
    observations = env.step(actions)[0]
    assert_same_bits(observations, twin.step(actions)[0])
    assert_same_bits(env.system.observe(env.states.T), observations)


def test_later_steps_do_not_change_what_was_returned(
    case: SystemCase, mode: str
) -> None:
    env = pair(case, mode)[0]
    results = [(env.reset()[0], *step) for step in walk(env, 20, 5)]
    returned = [array for result in results for array in arrays_in(result)]
    kept = [array.copy() for array in returned]
    walk(env, 40, 6)
    env.reset(seed=9)
    for array, before in zip(returned, kept, strict=True):
        assert_same_bits(array, before)
    for one, other in combinations(returned, 2):
        assert not np.shares_memory(one, other)


def test_same_seed_same_bits(case: SystemCase, mode: str) -> None:
    env, twin = pair(case, mode, num_envs=30, seed=6)
    other = pair(case, mode, num_envs=30, seed=7)[0]
    start = env.reset(seed=6)[0]
    assert_same_bits(start, twin.reset(seed=6)[0])
    starts = len(np.unique(start, axis=0))
    assert starts == 1 if case.one_start else starts >= 4
    assert case.one_start or np.any(start != other.reset(seed=7)[0])
    assert_walk_alike(env, twin)
    # Without a seed the stream goes on instead of starting again.
    following = env.reset()[0]
    assert_same_bits(following, twin.reset()[0])
    assert case.one_start or np.any(following != start)


@pytest.mark.parametrize(
    "twin", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))]
)
def test_copy_continues_alike_and_apart(case: SystemCase, twin: Any, mode: str) -> None:
    env, untouched = pair(case, mode)
    for each in (env, untouched):
        walk(each, 7, 8)
    other = twin(env)
    assert_walk_alike(env, untouched)
    # The copy has not moved while the original walked.
    untouched.reset(seed=1)
    walk(untouched, 7, 8)
    assert_walk_alike(other, untouched)


def test_with_slots_keeps_all_but_the_number(case: SystemCase, mode: str) -> None:
    env = case.vector(3, max_episode_steps=5, autoreset_mode=mode, **case.narrow)
    other = env.with_slots(8)
    assert type(other) is case.vector
    assert (env.num_envs, other.num_envs) == (3, 8)
    assert other.system == env.system != case.vector(**case.easy).system
    assert other.max_episode_steps == 5
    assert other.metadata["autoreset_mode"] is AutoresetMode(mode)
    assert other.observation_space.shape[0] == 8
    with pytest.raises(ResetNeeded):
        other.step([0] * 8)


def test_with_slots_has_the_parameters_of_the_original() -> None:
    torques = [-1.0, 1.0]
    env = PendulumVectorEnv(3, torques=torques)
    torques.append(5.0)
    assert env.with_slots(2).system == env.system


def test_kernels_run_the_same_without_the_compiler() -> None:
    rng = np.random.default_rng(9)
    slots, actions = np.array([5, 0, 3]), rng.integers(0, 3, 6)
    rows = [rng.random((2, 6)) for _ in range(2)]
    results = []
    for name in ("__call__", "py_func"):
        part, part_actions = np.zeros((2, 3)), np.zeros(3, dtype=np.int64)
        gather = getattr(stepping.gather_slots, name)
        gather(slots, rows[0].copy(), actions, part, part_actions)
        for limit in (0, 7):
            outputs = [rows[1].copy(), np.full(6, 6), np.zeros(6)]
            outputs += [np.zeros(6, dtype=np.bool_) for _ in range(2)]
            flags = np.array([True, False, True])
            put_back = getattr(stepping.put_slots_back, name)
            put_back(slots, part, part[0], flags, limit, *outputs)
            results.append([part, part_actions, *outputs])
    for ours, plain in zip(results[:2], results[2:], strict=True):
        for one, other in zip(ours, plain, strict=True):
            assert_same_bits(one, other)
    part, part_actions, states, steps, rewards, terminated, truncated = results[1]
    assert_same_bits(part, rows[0][:, slots])
    assert_same_bits(part_actions, actions[slots])
    assert_same_bits(states[:, slots], part)
    assert_same_bits(states[:, [1, 2, 4]], rows[1][:, [1, 2, 4]])
    assert steps.tolist() == [7, 6, 6, 7, 6, 7]
    assert_same_bits(rewards[slots], part[0])
    assert np.flatnonzero(terminated).tolist() == [3, 5]
    assert np.flatnonzero(truncated).tolist() == [0, 3, 5]
    assert not results[0][-1].any()  # limit 0 is none


def test_slots_step_alike_however_many_are_idle(
    case: SystemCase, mode: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    options = {"finished": "wait"}
    seen = []
    for most in (0.0, 1.0):  # idle slots are put back, and left out
        monkeypatch.setattr(stepping, "RESTORE_ABOVE", most)
        env = case.vector(9, autoreset_mode=mode, max_episode_steps=30, **case.easy)
        first = env.reset(seed=3, options=options)
        seen.append([first, *walk(env, 60, 4)])
    for one, other in zip(*seen, strict=True):
        for ours, theirs in zip(arrays_in(one), arrays_in(other), strict=True):
            assert_same_bits(ours, theirs)


def test_idle_slots_are_put_back_the_same_without_the_compiler() -> None:
    idle = np.array([False, True, False, True])
    results = []
    for name in ("__call__", "py_func"):
        for limit in (0, 7):
            states, steps = np.arange(8.0).reshape(2, 4), np.array([6, 6, 3, 9])
            rewards, flags = np.full(4, -1.0), np.ones((2, 4), dtype=np.bool_)
            put_back = getattr(stepping.put_idle_back, name)
            count = put_back(
                idle, -states, limit, states, steps, rewards, flags[0], flags[1]
            )
            results.append([count, states, steps, rewards, flags])
    for ours, plain in zip(results[:2], results[2:], strict=True):
        for one, other in zip(ours, plain, strict=True):
            np.testing.assert_array_equal(one, other)
    count, states, steps, rewards, flags = results[1]
    assert count == 2
    assert states.tolist() == [[0.0, -1.0, 2.0, -3.0], [4.0, -5.0, 6.0, -7.0]]
    assert steps.tolist() == [7, 6, 4, 9]
    assert rewards.tolist() == [-1.0, 0.0, -1.0, 0.0]
    assert flags.tolist() == [[True, False] * 2, [True, False, False, False]]
    assert results[0][-1][1].tolist() == [False] * 4


def test_counting_kernels_run_the_same_without_the_compiler() -> None:
    terminated = np.array([False, True, False, False])
    results = []
    for name in ("__call__", "py_func"):
        count, finish = (
            getattr(kernel, name)
            for kernel in (bookkeeping.count_step, bookkeeping.finish)
        )
        steps, truncated = np.array([1, 2, 3, 4]), np.zeros(4, dtype=np.bool_)
        assert count(0, steps, terminated, truncated) == 1
        assert not truncated.any()
        assert count(5, steps, terminated, truncated) == 3
        finished = np.array([False, False, False, False])
        walking = np.zeros(4, dtype=np.int64)
        ended, success = np.ones((2, 4), dtype=np.bool_)
        n_walking = finish(terminated, truncated, finished, walking, ended, success)
        results.append(
            (steps, truncated, walking[:n_walking], finished, ended, success)
        )
    for ours, plain in zip(*results, strict=True):
        assert_same_bits(ours, plain)
    assert [array.tolist() for array in results[0]] == [
        [3, 4, 5, 6],
        [False, False, True, True],
        [0],
        [False, True, True, True],
        [False, True, True, True],
        [False, True, False, False],
    ]


@pytest.mark.parametrize(
    ("actions", "slot", "shown"),
    [
        ([0, 1, 3], 2, "3"),
        ([0, -1, 9], 1, "-1"),
        (np.array([2**64 - 1, 0, 0], np.uint64), 0, "18446744073709551615"),
        (np.array([0, 200, 0], np.uint8), 1, "200"),
    ],
)
def test_the_first_action_out_of_range_is_reported(
    actions: Any, slot: int, shown: str
) -> None:
    with pytest.raises(ValueError, match=rf"0\.\.2, got {shown} in slot {slot}\."):
        bookkeeping.checked_actions(actions, 3, 3)
    plain, copied = bookkeeping.copy_if_below.py_func, np.full(2, -7)
    assert not plain(np.array([5, 2]), 3, copied)
    assert plain(np.array([0, 2]), 3, copied)
    assert copied.tolist() == [0, 2]
