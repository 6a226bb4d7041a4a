"""The inner loop against plants stepped one by one, and agents that walk in it."""

from __future__ import annotations

import math
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import SyncVectorEnv
from gymnasium.wrappers.vector import RecordEpisodeStatistics
from hypothesis import given
from hypothesis import strategies as st

from acl_gym import (
    ACL,
    Fuzzy,
    InnerLoop,
    QLearning,
    ReturningACL,
    Shield,
    WaitingVectorEnv,
    evaluate_policy_cost,
    fuzzy_q_iteration,
)
from acl_gym.agents.same_task import is_same_task
from acl_gym.envs.control.lookup import signals_of
from acl_gym.envs.wrappers import StateFeedback
from acl_gym.envs.wrappers.holding import merged_infos
from acl_gym.plotting.subject import subject_of
from acl_gym.plotting.trajectories import run
from tests.envs.obedient import ObedientSalesmanVectorEnv
from tests.envs.vector_helpers import MODES, arrays_in, assert_same_step, mask_of

HOLD = StateFeedback(set_point=[math.pi, 0.0], circular=[0], low=-0.8, high=0.8)
GAINS = [[0.5, 0.1], [2.5, 0.3], [-0.5, 0.0]]
LIMIT = 17  # steps, so that episodes end within choices
EASY = {"goal_bounds": (0.6, 2.0)}  # a goal that random walks reach


def pendulums(slots: int, **keywords: Any) -> Any:
    return gym.make_vec(
        "acl_gym/Pendulum-v0", slots, max_episode_steps=LIMIT, **keywords
    )


def loop(slots: int, period: int = 1, **keywords: Any) -> InnerLoop:
    return InnerLoop(pendulums(slots, **keywords), HOLD, GAINS, period=period)


ONE: Any = gym.make("acl_gym/Pendulum-v0", max_episode_steps=-1, **EASY)


def one_by_one(
    state: np.ndarray, choice: int, steps: int, period: int
) -> tuple[np.ndarray, float, bool, bool, int]:
    """A choice in one pendulum, from its definition; `steps` so far in the episode."""
    ONE.reset(options={"state": state})
    total, terminated, truncated = 0.0, False, False
    for _ in range(period):
        torque = HOLD(state[None], [GAINS[choice]])[0, 0]
        action = int(np.argmin(np.abs(np.array([-0.8, 0.0, 0.8]) - torque)))
        state, reward, terminated, _, _ = ONE.step(action)
        total, steps = total + reward, steps + 1
        truncated = steps >= LIMIT
        if terminated or truncated:
            break
    return state, total, terminated, truncated, steps


@given(
    st.integers(0, 2**31),
    st.sampled_from(MODES),
    st.integers(1, 4),
    st.sampled_from([1, 2, 3, 5, 25]),
    st.booleans(),
)
def test_every_choice_is_what_a_single_plant_does(
    seed: int, mode: str, slots: int, period: int, waits: bool
) -> None:
    env = loop(slots, period, autoreset_mode=mode, **EASY)
    rng = np.random.default_rng(seed)
    options = {"finished": "wait"} if waits else None
    seen, _ = env.reset(seed=seed, options=options)
    steps, idle = np.zeros(slots, int), np.zeros(slots, bool)
    for _ in range(12):
        actions = rng.integers(3, size=slots)
        now, reward, terminated, truncated, infos = env.step(actions)
        done = terminated | truncated
        for i in range(slots):
            if idle[i]:
                assert (reward[i], done[i]) == (0.0, False)
                if waits:
                    np.testing.assert_array_equal(now[i], seen[i])
                continue
            state, total, goal, late, steps[i] = one_by_one(
                seen[i], actions[i], steps[i], period
            )
            last = now[i]
            if mode == "SameStep" and done[i] and not waits:
                last = infos["final_obs"][i]
            np.testing.assert_allclose(last, state, rtol=1e-9, atol=1e-9)
            assert reward[i] == pytest.approx(total, rel=1e-9)
            assert (terminated[i], truncated[i]) == (goal, late)
            if done[i]:
                told = infos.get("final_info", infos)
                assert told["_is_success"][i]
                assert told["is_success"][i] == goal
        if waits:
            idle |= done
        else:
            steps[done] = 0
            idle = done if mode == "NextStep" else idle & False
            if mode == "Disabled" and done.any():
                now, _ = env.reset(options={"reset_mask": done})
        seen = now


def test_a_single_step_is_that_of_the_plant_to_the_bit(mode: str) -> None:
    """With actions for choices, the inner loop changes nothing but the masks."""

    def as_chosen(seen: np.ndarray, chosen: np.ndarray) -> np.ndarray:
        return chosen[:, 0].astype(np.int64)

    plain = pendulums(6, autoreset_mode=mode, **EASY)
    env = InnerLoop(pendulums(6, autoreset_mode=mode, **EASY), as_chosen, [0, 1, 2])
    np.testing.assert_array_equal(env.reset(seed=2)[0], plain.reset(seed=2)[0])
    rng = np.random.default_rng(0)
    for _ in range(40):
        actions = rng.integers(3, size=6)
        ours, theirs = env.step(actions), plain.step(actions)
        assert_same_step(ours, theirs)
        done = ours[2] | ours[3]
        if mode == "Disabled" and done.any():
            for each in (env, plain):
                each.reset(options={"reset_mask": done})


@pytest.mark.parametrize("period", [1, 3])
def test_a_slot_that_is_reset_leaves_the_others_alone(mode: str, period: int) -> None:
    envs = [loop(4, period, autoreset_mode=mode) for _ in range(2)]
    for env in envs:
        env.reset(seed=1)
        env.step([0, 1, 2, 1])
    before = envs[0].step([1, 1, 1, 1])[0]
    envs[1].step([1, 1, 1, 1])
    shown, _ = envs[1].reset(options={"reset_mask": mask_of(4, 2)})
    kept = [0, 1, 3]
    assert shown[kept].tobytes() == before[kept].tobytes()
    assert (shown[2] != before[2]).any()
    ours, theirs = envs[0].step([0, 0, 2, 1]), envs[1].step([0, 0, 2, 1])
    for a, b in zip(ours[:4], theirs[:4], strict=True):
        assert a[kept].tobytes() == b[kept].tobytes()


@pytest.mark.parametrize("period", [1, 4])
def test_the_same_seed_gives_the_same_bits_and_new_arrays(
    mode: str, period: int
) -> None:
    def walk(spoil: bool) -> list[bytes]:
        env, rng, found = (
            loop(5, period, autoreset_mode=mode),
            np.random.default_rng(3),
            [],
        )
        env.reset(seed=9)
        for _ in range(20):
            result = env.step(rng.integers(3, size=5))
            found += [part.tobytes() for part in result[:4]]
            done = result[2] | result[3]
            if mode == "Disabled" and done.any():
                env.reset(options={"reset_mask": done})
            if spoil:  # what is returned belongs to the caller
                for array in arrays_in(result):
                    array[...] = 1
        return found

    assert walk(spoil=False) == walk(spoil=True)


@pytest.mark.parametrize("period", [1, 3])
def test_a_waiting_vector_env_below(period: int) -> None:
    slots = WaitingVectorEnv.make("acl_gym/Pendulum-v0", 3, max_episode_steps=7)
    env = InnerLoop(slots, HOLD, GAINS, period=period)
    native = InnerLoop(
        gym.make_vec("acl_gym/Pendulum-v0", 3, max_episode_steps=7),
        HOLD,
        GAINS,
        period=period,
    )
    states = env.reset(seed=0)[0]
    native.reset(options={"state": states, "finished": "wait"})
    for _ in range(9):
        ours, theirs = env.step([0, 1, 2]), native.step([0, 1, 2])
        for a, b in zip(ours[:4], theirs[:4], strict=True):
            np.testing.assert_array_equal(a, b)
    seen, _ = env.reset(options={"reset_mask": mask_of(3, 1)})
    assert (seen[1] != ours[0][1]).any()
    assert env.step([0, 0, 0])[1][1] < 0.0


def test_a_held_choice_needs_slots_that_wait() -> None:
    slots = SyncVectorEnv([lambda: gym.make("CartPole-v1")] * 2)
    InnerLoop(slots, lambda x, p: p[:, 0].astype(int), [0, 1])
    with pytest.raises(
        ValueError, match=r"SyncVectorEnv; make it with .*WaitingVectorEnv"
    ):
        InnerLoop(slots, lambda x, p: p[:, 0].astype(int), [0, 1], period=2)


def test_time_limits_count_choices_but_never_exceed_that_of_the_plant() -> None:
    def length(limit: int | None, period: int, asked: int | None) -> int:
        made = gym.make_vec("acl_gym/Navigation-v0", 1, max_episode_steps=limit)
        env = InnerLoop(
            made, lambda x, p: p[:, :1].astype(int)[:, 0], [4], period=period
        )
        options: Any = {"state": [[4.0, 0.0, 4.0, 0.0]]}
        env.reset(options=options if asked is None else {**options, "max_steps": asked})
        for count in range(1, 200):
            if env.step([0])[3][0]:
                return count
        return 200

    assert length(40, 1, None) == 40
    assert length(40, 5, None) == 8
    assert length(40, 5, 3) == 3
    assert length(40, 5, 100) == 8
    assert length(41, 5, 100) == 9  # the last choice is held for one step


def test_a_disabled_autoreset_asks_for_a_reset() -> None:
    env = loop(2, period=LIMIT, autoreset_mode="Disabled")
    with pytest.raises(ResetNeeded, match="call reset"):
        env.step([0, 0])
    env.reset(seed=0)
    env.step([0, 0])
    with pytest.raises(ResetNeeded, match=r"slots \[0, 1\] have finished"):
        env.step([0, 0])
    env.reset(options={"reset_mask": mask_of(2, 0, 1)})
    env.step([0, 0])


def test_statistics_of_episodes_below_a_held_choice() -> None:
    env = InnerLoop(RecordEpisodeStatistics(pendulums(3)), HOLD, GAINS, period=5)
    env.reset(seed=0)
    for _ in range(4):
        infos = env.step([0, 1, 2])[4]
    assert infos["episode"]["l"].tolist() == [LIMIT] * 3
    assert infos["_episode"].all()


def test_infos_of_two_steps_together() -> None:
    first = {
        "a": np.array([1, 2]),
        "_a": np.array([True, False]),
        "b": {"c": np.ones(2)},
    }
    first["_b"] = np.array([True, True])
    second = {"a": np.array([3, 4]), "_a": np.array([False, True])}
    both = merged_infos(first, second)
    assert both["a"].tolist() == [1, 4]
    assert both["_a"].all()
    assert both["b"]["c"].tolist() == [1.0, 1.0]
    third = {"b": {"c": np.zeros(2)}, "_b": np.array([False, True])}
    assert merged_infos(both, third)["b"]["c"].tolist() == [1.0, 0.0]


@pytest.mark.parametrize("period", [1, 4])
@pytest.mark.parametrize("kind", [ACL, ReturningACL, QLearning])
def test_agents_learn_in_it(kind: Any, period: int) -> None:
    """Every row but the last is a controller that the pendulum falls away from."""
    env = InnerLoop(
        gym.make_vec("acl_gym/Pendulum-v0", 5), HOLD, [*GAINS[2:], [0.0, 0.0], GAINS[1]],
        period=period,
    )  # fmt: skip
    more = {"tau0": 1e-5} if kind is ACL else {}
    agent = kind(env, seed=0, **more).learn(total_timesteps=3_000)
    starts = np.array([[math.pi + 0.3, 0.0], [math.pi - 0.3, 0.0]])
    judge = InnerLoop(
        gym.make_vec("acl_gym/Pendulum-v0", 2), HOLD, env.choices, period=period
    )
    result = evaluate_policy_cost(agent, judge, starts)
    assert np.isfinite(result.cost)
    assert (result.lengths <= math.ceil(300 / period)).all()
    if kind is ReturningACL:
        assert result.success_rate == 1.0


def test_stable_baselines_walks_in_it() -> None:
    dqn = pytest.importorskip("stable_baselines3").DQN
    from acl_gym import VectorEnvAdapter

    env = VectorEnvAdapter(loop(3, 4, autoreset_mode="Disabled"))
    model = dqn("MlpPolicy", env, learning_starts=20, seed=0).learn(90)
    assert model.predict(env.reset())[0].shape == (3,)


def test_real_inputs_of_a_box() -> None:
    env = gym.make_vec("Pendulum-v1", 2, vectorization_mode="sync")
    seen: list[np.ndarray] = []

    def push(observations: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        seen.append(observations)
        return parameters

    wrapped = InnerLoop(env, push, [-2.0, 0.5])
    first, _ = wrapped.reset(seed=0)
    wrapped.step([1, 0])
    np.testing.assert_array_equal(seen[0], first)
    plain = gym.make_vec("Pendulum-v1", 2, vectorization_mode="sync")
    plain.reset(seed=0)
    expected = plain.step(np.array([[0.5], [-2.0]], np.float32))
    np.testing.assert_array_equal(wrapped.reset(seed=0)[0], first)
    np.testing.assert_array_equal(wrapped.step([1, 0])[0], expected[0])


def test_masks_of_the_inputs_are_not_those_of_the_choices(mode: str) -> None:
    tours = ObedientSalesmanVectorEnv(
        2, coordinates=np.eye(3)[:, :2].tolist(), autoreset_mode=mode
    )
    env = InnerLoop(tours, lambda seen, chosen: chosen[:, 0].astype(int), [0, 1])
    assert env.reset(seed=0)[1] == {}
    ends = 0
    for _ in range(3):
        *_, terminated, _, infos = env.step([0, 1])
        assert not {"action_mask", "_action_mask"} & {
            *infos,
            *infos.get("final_info", ()),
        }
        ends += terminated.any()
    assert ends == 1


def test_what_choices_mean_is_known_to_policies() -> None:
    env = loop(2)  # as many choices as the pendulum has torques
    signals = signals_of(env)
    assert signals is not None
    assert signals.inputs == ("parameter p[0]", "parameter p[1]")
    assert signals.values == tuple(map(tuple, GAINS))
    assert signals.observations == signals_of(env.env).observations  # type: ignore[union-attr]
    colony = ReturningACL(env, seed=0).learn(trials=1)
    assert colony.policy.signals == signals


def test_what_knows_the_plant_only_does_not_take_choices_for_inputs() -> None:
    """A trajectory is run behind the wrapper, and the model of the plant is refused."""

    class First:
        def predict(self, observation: Any, **_: Any) -> Any:
            return np.zeros(len(observation), int), None

    pushing = InnerLoop(pendulums(1), lambda seen, chosen: chosen, [0.8, 0.0, 0.0])
    for env in (
        pushing,
        Shield(pendulums(1), lambda seen: np.full(len(seen), 0.8), never),
    ):
        path = run(subject_of(First(), env), None, 1, 0)
        plain = pendulums(1)
        plain.reset(options={"state": path.states[:1]})
        np.testing.assert_array_equal(path.states[1:], plain.step([2])[0])
        with pytest.raises(TypeError, match="a wrapper that replaces them"):
            fuzzy_q_iteration(env, Fuzzy.from_box(env.single_observation_space, (3, 3)))


def never(seen: np.ndarray) -> np.ndarray:
    return np.zeros(len(seen), bool)


def test_two_of_them_pose_the_same_task() -> None:
    assert is_same_task(loop(2), loop(3))
    assert not is_same_task(loop(2), loop(2, period=2))
    assert not is_same_task(loop(2), pendulums(2))


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ((None, HOLD, GAINS), TypeError, "env must be a gymnasium.vector.VectorEnv"),
        ((..., "hold", GAINS), TypeError, "controller must be a function"),
        ((..., HOLD, []), ValueError, "choices must be an array"),
        ((..., HOLD, [[math.nan]]), ValueError, "choices must be an array of finite"),
        ((..., HOLD, [[[1.0]]]), ValueError, "choices must hold a row"),
        ((..., HOLD, 1.0), ValueError, "choices must hold a row"),
    ],
)
def test_bad_arguments(arguments: Any, error: Any, words: str) -> None:
    given = [pendulums(2) if each is ... else each for each in arguments]
    with pytest.raises(error, match=words):
        InnerLoop(*given)


@pytest.mark.parametrize("period", [0, -1, 1.5, True])
def test_bad_periods(period: Any) -> None:
    with pytest.raises((TypeError, ValueError), match="period must be"):
        loop(2, period)


@pytest.mark.parametrize(
    ("returned", "words"),
    [
        ([math.nan, 0.0], "what controller returns must be finite, got nan in slot 0"),
        ([0.0], r"what controller returns must have shape \(2, 1\)"),
        ([0, 3], "what controller returns must be 2 integers in 0..2"),
        (None, "what controller returns must be 2 integers in 0..2"),
    ],
)
def test_bad_controllers(returned: Any, words: str) -> None:
    env = InnerLoop(pendulums(2), lambda seen, parameters: returned, GAINS)
    env.reset(seed=0)
    with pytest.raises((TypeError, ValueError), match=words):
        env.step([0, 0])


def test_a_controller_cannot_change_what_it_is_given() -> None:
    def spoil(seen: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        parameters[:] = 0.0
        return seen

    env = InnerLoop(pendulums(2), spoil, GAINS)
    env.reset(seed=0)
    with pytest.raises(ValueError, match="read-only"):
        env.step([0, 0])


@pytest.mark.parametrize("actions", [[0, 3], [0], [0.0, 1.0], "ab"])
def test_bad_actions(actions: Any) -> None:
    env = loop(2)
    env.reset(seed=0)
    with pytest.raises((TypeError, ValueError), match="actions must"):
        env.step(actions)


def test_dict_observations_are_refused() -> None:
    class Parts(gym.Env):
        observation_space = gym.spaces.Dict(a=gym.spaces.Discrete(2))
        action_space = gym.spaces.Discrete(2)

    with pytest.raises(ValueError, match=r"must be arrays.*FlattenObservation"):
        InnerLoop(SyncVectorEnv([Parts]), lambda x, p: p, [0.0])


@pytest.mark.parametrize("options", [{"finished": "go"}, {"max_steps": 0}, {"fog": 1}])
def test_bad_options(options: Any) -> None:
    with pytest.raises(ValueError, match="options"):
        loop(2, 3).reset(options=options)
