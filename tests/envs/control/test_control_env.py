"""The single environment: what Gymnasium asks of it, resets, errors, copies."""

import copy
import pickle
from itertools import combinations
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import TimeLimit

from acl_gym.envs import ENVIRONMENTS, register_environments
from acl_gym.envs.control.single import ControlEnv
from acl_gym.envs.pendulum import PendulumEnv
from tests.envs.systems import LASTING, SYSTEMS, SystemCase, by_id
from tests.envs.vector_helpers import assert_same_bits, beside_masks

NAN = float("nan")
COPIES = [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))]


def walk(env: ControlEnv, actions: list[int]) -> list[tuple[bytes, float, bool]]:
    """Step through the actions, starting again at the goal; keep every bit."""
    rows = []
    for action in actions:
        observation, reward, terminated, truncated, _ = env.step(action)
        assert not truncated
        rows.append((observation.tobytes(), reward, terminated))
        if terminated:
            rows.append((env.reset()[0].tobytes(), 0.0, False))
    return rows


def random_actions(case: SystemCase, count: int, seed: int) -> list[int]:
    return np.random.default_rng(seed).integers(0, case.n_actions, count).tolist()


def test_gymnasium_accepts_it(case: SystemCase) -> None:
    env = gym.make(case.env_id).unwrapped
    env.action_space.seed(0)  # where an action may not be allowed
    check_env(env)
    if case.takes_any_action:
        check_env(gym.make(case.env_id, **case.easy, **case.variant).unwrapped)


def test_every_registered_system_is_tested() -> None:
    tested = {case.env_id for case in SYSTEMS}
    # Its slots are no copies of a system but one swarm: tests/envs/swarm_aggregation.
    assert tested | {"acl_gym/SwarmAggregation-v0"} == set(ENVIRONMENTS)


def test_registering_again_is_harmless() -> None:
    before = {env_id: gym.spec(env_id) for env_id in ENVIRONMENTS}
    register_environments()
    assert {env_id: gym.spec(env_id) for env_id in ENVIRONMENTS} == before


@pytest.mark.parametrize("case", LASTING, ids=by_id)
def test_time_limit_of_make(case: SystemCase) -> None:
    env = gym.make(case.env_id, max_episode_steps=3, **case.narrow)
    env.reset(options={"state": case.away})
    flags = [env.step(1)[2:4] for _ in range(3)]
    assert flags == [(False, False), (False, False), (False, True)]
    unlimited = gym.make(case.env_id, max_episode_steps=-1, **case.narrow)
    unlimited.reset(options={"state": case.away})
    assert not any(unlimited.step(0)[3] for _ in range(1000))


def test_both_flags_on_the_last_step(case: SystemCase) -> None:
    env = TimeLimit(case.single(**case.narrow), 1)
    env.reset(options={"state": case.near})
    assert env.step(case.near_action)[2:4] == (True, True)


def test_given_angle_becomes_canonical() -> None:
    env = PendulumEnv()
    state = np.array([-0.5, 9.0])
    options = {"state": state}
    observation, info = env.reset(options=options)
    assert observation.tolist() == [np.mod(-0.5, 2 * np.pi), 9.0]
    assert info == {}
    assert options["state"] is state
    assert state.tolist() == [-0.5, 9.0]
    expected = env.step(2)[0]
    # The array that was given and the one that came back belong to the caller.
    observation, _ = env.reset(options=options)
    observation[:] = 1.0
    state[:] = 2.0
    assert env.step(2)[0].tobytes() == expected.tobytes()


def test_state_option_sets_the_state(case: SystemCase) -> None:
    env = case.single(**case.narrow)
    observation, info = env.reset(options={"state": list(case.near)})
    assert_same_bits(np.asarray(observation), case.observed(case.near)[0])
    assert beside_masks(info) == {}


def test_no_state_means_a_random_one(case: SystemCase) -> None:
    env = case.single(**case.narrow)
    rows = [
        env.reset(seed=4, options=options)[0].tolist()
        for options in (None, {}, {"state": None})
    ]
    assert rows[0] == rows[1] == rows[2]
    assert case.one_start or rows[0] != env.reset()[0].tolist()


def test_given_state_draws_no_random_numbers(case: SystemCase) -> None:
    env, other = case.single(**case.narrow), case.single(**case.narrow)
    env.reset(seed=5)
    other.reset(seed=5)
    other.reset(options={"state": case.near})
    assert env.reset()[0].tobytes() == other.reset()[0].tobytes()


BAD_STATES = [
    pytest.param(case, bad, id=f"{case.single.__name__}-{name}")
    for case in SYSTEMS
    for name, bad in case.bad_states.items()
]


@pytest.mark.parametrize(("case", "state"), BAD_STATES)
def test_bad_state_is_refused_and_changes_nothing(case: SystemCase, state: Any) -> None:
    env, twin = case.single(), case.single()
    for each in (env, twin):
        each.reset(seed=6)
    with pytest.raises(ValueError, match=r"state|omega"):
        env.reset(seed=7, options={"state": state})
    actions = random_actions(case, 20, 1)
    assert walk(env, actions) == walk(twin, actions)
    assert env.reset()[0].tobytes() == twin.reset()[0].tobytes()


@pytest.mark.parametrize(
    "options",
    [{"states": [0.0, 0.0]}, {"reset_mask": np.array([True])}, {"state": None, "x": 1}],
)
def test_unknown_option_is_refused(case: SystemCase, options: dict[str, Any]) -> None:
    unknown = next(key for key in options if key != "state")
    with pytest.raises(ValueError, match=rf"among \['state'\], got \['{unknown}'\]"):
        case.single().reset(options=options)


@pytest.mark.parametrize("seed", [-1, 1.5, "1"])
def test_bad_seed_changes_nothing(case: SystemCase, seed: Any) -> None:
    env, twin = case.single(**case.narrow), case.single(**case.narrow)
    for each in (env, twin):
        each.reset(options={"state": case.away})
    with pytest.raises((TypeError, ValueError), match="seed must be"):
        env.reset(seed=seed, options={"state": case.near})
    assert env.step(1)[0].tobytes() == twin.step(1)[0].tobytes()


BAD_ACTIONS = {
    "float": (1.0, TypeError),
    "nan": (NAN, TypeError),
    "numpy float": (np.float32(1), TypeError),
    "bool": (True, TypeError),
    "none": (None, TypeError),
    "string": ("1", TypeError),
    "beyond": (9, ValueError),
    "negative": (-1, ValueError),
    "largest unsigned": (np.uint64(2**64 - 1), ValueError),
    "smallest": (np.iinfo(np.int64).min, ValueError),
    "list": ([1], ValueError),
    "array": (np.array([1]), ValueError),
    "two": (np.array([1, 1]), ValueError),
}


@pytest.mark.parametrize(("action", "error"), BAD_ACTIONS.values(), ids=BAD_ACTIONS)
def test_bad_action_is_refused_and_changes_nothing(
    case: SystemCase, action: Any, error: type[Exception]
) -> None:
    env, twin = case.single(**case.narrow), case.single(**case.narrow)
    for each in (env, twin):
        each.reset(options={"state": case.away})
    with pytest.raises(error, match=r"^actions must"):
        env.step(action)
    assert env.step(1)[0].tobytes() == twin.step(1)[0].tobytes()


@pytest.mark.parametrize("kind", [int, np.int8, np.int32, np.int64, np.uint8, np.array])
def test_any_integer_is_an_action(case: SystemCase, kind: Any) -> None:
    env, twin = case.single(**case.narrow), case.single(**case.narrow)
    for each in (env, twin):
        each.reset(options={"state": case.away})
    assert env.step(kind(1))[0].tobytes() == twin.step(1)[0].tobytes()


def test_step_needs_a_running_episode(case: SystemCase) -> None:
    env = case.single(**case.narrow)
    with pytest.raises(ResetNeeded, match="not begun"):
        env.step(1)
    env.reset(options={"state": case.near})
    assert env.step(case.near_action)[2]
    with pytest.raises(ResetNeeded, match="this one is over"):
        env.step(1)
    env.reset()
    env.step(1)


@pytest.mark.parametrize("varied", [False, True])
def test_observations_belong_to_the_space(case: SystemCase, varied: bool) -> None:
    env = case.single(**case.easy, **(case.variant if varied else {}))
    observation, info = env.reset(seed=8)
    keys = [*info, "is_success"]
    finishes = 0
    for action in random_actions(case, 4000, 2):
        assert env.observation_space.contains(observation)
        observation, reward, terminated, _, info = env.step(action)
        assert type(reward) is float
        assert type(terminated) is bool
        assert list(info) == keys
        assert info["is_success"] is terminated
        assert -env.system.max_stage_cost <= reward <= 0.0
        if terminated:
            finishes += 1
            observation, _ = env.reset()
    assert finishes > 3


def test_every_observation_is_a_new_array() -> None:
    env = PendulumEnv()
    seen = [env.reset(options={"state": [0.0, 0.0]})[0]]
    seen += [env.step(2)[0] for _ in range(5)]
    assert len({row.tobytes() for row in seen}) == 6
    assert not any(np.shares_memory(a, b) for a, b in combinations(seen, 2))
    kept = [row.copy() for row in seen]
    expected = copy.deepcopy(env).step(0)[0]
    for row in seen:
        np.add(row, 1.0, out=row)
    assert env.step(0)[0].tobytes() == expected.tobytes()
    assert all(np.array_equal(a, b + 1.0) for a, b in zip(seen, kept, strict=True))


def test_same_seed_same_bits(case: SystemCase) -> None:
    parameters = case.draws or case.easy
    envs = [case.single(**parameters) for _ in range(3)]
    for env, seed in zip(envs, (9, 9, 10), strict=True):
        env.reset(seed=seed)
    walks = [walk(env, random_actions(case, 500, 3)) for env in envs]
    assert sum(row[2] for row in walks[0]) > 1
    assert walks[0] == walks[1]
    # Without chance there is one start, and one way for each line of actions.
    assert case.one_start or walks[0] != walks[2]


@pytest.mark.parametrize("twin", COPIES)
def test_copy_continues_alike_and_apart(case: SystemCase, twin: Any) -> None:
    env = case.single(**(case.draws or {**case.easy, **case.variant}))
    env.reset(seed=11)
    walk(env, random_actions(case, 10, 4))
    other = twin(env)
    assert other.system == env.system
    actions = random_actions(case, 300, 5)
    walked = walk(env, actions)
    assert sum(row[2] for row in walked) > 1
    assert walk(other, actions) == walked


@pytest.mark.parametrize("twin", COPIES)
def test_environment_that_has_been_drawn_can_be_copied(
    case: SystemCase, twin: Any
) -> None:
    pytest.importorskip("pygame")
    env = case.single(render_mode="rgb_array")
    env.reset(seed=12)
    frame = env.render()
    assert np.array_equal(twin(env).render(), frame)


@pytest.mark.parametrize("mode", ["ascii", "", "RGB_ARRAY", 1, ["human"]])
def test_unknown_render_mode_is_refused(case: SystemCase, mode: Any) -> None:
    with pytest.raises(ValueError, match="render_mode must be None or one of"):
        case.single(render_mode=mode)
