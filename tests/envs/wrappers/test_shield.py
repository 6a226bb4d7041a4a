"""The shield: what is replaced, what is counted, and what learners are told."""

from __future__ import annotations

import math
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import SyncVectorEnv
from hypothesis import given
from hypothesis import strategies as st

from acl_gym import (
    InnerLoop,
    QLearning,
    ReturningACL,
    Shield,
    WaitingVectorEnv,
    evaluate_policy_cost,
    plant,
)
from acl_gym.envs.control.system import SlotError
from acl_gym.envs.wrappers import StateFeedback
from acl_gym.envs.wrappers.perturbations import ActionNoise
from tests.envs.vector_helpers import MODES, arrays_in, mask_of
from tests.envs.wrappers.wanderers import MAKERS

TORQUES = np.array([-0.8, 0.0, 0.8])
HOLD = StateFeedback([2.5, 0.3], [math.pi, 0.0], circular=[0])
LIMIT = 17


def upright(seen: np.ndarray, most: float = 0.5) -> np.ndarray:
    return np.abs(seen[:, 0] - math.pi) <= most


def baseline_of(row: np.ndarray) -> int:
    return int(np.argmin(np.abs(TORQUES - HOLD(row[None])[0, 0])))


def pendulums(slots: int, **keywords: Any) -> Any:
    keywords = {"max_episode_steps": LIMIT, "goal_bounds": (0.05, 0.4), **keywords}
    return gym.make_vec("acl_gym/Pendulum-v0", slots, **keywords)


def near_upright(slots: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.stack(
        [math.pi + rng.uniform(-0.7, 0.7, slots), rng.uniform(-2, 2, slots)], axis=1
    )


ONE: Any = gym.make(
    "acl_gym/Pendulum-v0", max_episode_steps=-1, goal_bounds=(0.05, 0.4)
)


def next_of(row: np.ndarray, action: int) -> tuple[np.ndarray, bool]:
    """The next observation of one pendulum, and whether it is the goal."""
    ONE.reset(options={"state": row})
    seen, _, terminated, _, _ = ONE.step(action)
    return seen, terminated


def permitted(row: np.ndarray, action: int, look_ahead: int) -> bool:
    """Whether the shield lets an action through, from its definition."""
    if not upright(row[None])[0]:
        return False
    for _ in range(look_ahead):
        row, terminated = next_of(row, action)
        if not upright(row[None])[0]:
            return False
        if terminated:
            return True
        action = baseline_of(row)
    return True


@given(
    st.integers(0, 2**31),
    st.sampled_from(MODES),
    st.sampled_from([0, 1, 4]),
    st.booleans(),
    st.booleans(),
)
def test_every_step_by_its_definition(
    seed: int, mode: str, look_ahead: int, masks: bool, waits: bool
) -> None:
    model = {"predict": True, "look_ahead": look_ahead} if look_ahead else {}
    env = Shield(
        pendulums(3, autoreset_mode=mode), HOLD, upright, mask_actions=masks, **model
    )
    rng = np.random.default_rng(seed)
    options: Any = {"state": near_upright(3, seed)}
    seen, infos = env.reset(
        seed=seed, options=options | ({"finished": "wait"} if waits else {})
    )
    interventions, violations = np.zeros(3, int), np.zeros(3, int)
    idle = np.zeros(3, bool)
    for _ in range(10):
        actions = rng.integers(3, size=3)
        mask = infos.get("action_mask")
        assert (mask is not None) == masks
        now, _, terminated, truncated, infos = env.step(actions)
        done = terminated | truncated
        np.testing.assert_array_equal(infos["_shielded"], ~idle)
        for i in np.flatnonzero(~idle):
            good = permitted(seen[i], actions[i], look_ahead)
            expected = actions[i] if good else baseline_of(seen[i])
            assert infos["executed_action"][i] == expected
            assert infos["shielded"][i] == (expected != actions[i])
            last = now[i]
            if mode == "SameStep" and done[i] and not waits:
                last = infos["final_obs"][i]
            np.testing.assert_allclose(last, next_of(seen[i], expected)[0], rtol=1e-12)
            assert infos["violation"][i] == (not upright(last[None])[0])
            if masks:
                for action in range(3):
                    assert mask[i, action] == (
                        action == baseline_of(seen[i])
                        or permitted(seen[i], action, look_ahead)
                    )
        assert not infos["shielded"][idle].any()
        assert not infos["violation"][idle].any()
        interventions += infos["shielded"]
        violations += infos["violation"]
        if waits:
            idle |= done
        else:
            idle = done if mode == "NextStep" else idle & False
            if mode == "Disabled" and done.any():
                now, infos = env.reset(options={"reset_mask": done})
        seen = now
    np.testing.assert_array_equal(env.interventions, interventions)
    np.testing.assert_array_equal(env.violations, violations)
    env.reset_counters()
    assert env.interventions.sum() == env.violations.sum() == 0


def test_a_slot_that_is_reset_leaves_the_others_alone(mode: str) -> None:
    envs = [Shield(pendulums(4, autoreset_mode=mode), HOLD, upright) for _ in range(2)]
    for env in envs:
        env.reset(seed=1, options={"state": near_upright(4, 1)})
    before = envs[0].step([2, 2, 2, 2])[0]
    envs[1].step([2, 2, 2, 2])
    shown, _ = envs[1].reset(options={"reset_mask": mask_of(4, 2)})
    kept = [0, 1, 3]
    assert shown[kept].tobytes() == before[kept].tobytes()
    ours, theirs = envs[0].step([0, 0, 2, 1]), envs[1].step([0, 0, 2, 1])
    for a, b in zip(ours[:4], theirs[:4], strict=True):
        assert a[kept].tobytes() == b[kept].tobytes()
    for name in ("shielded", "violation", "executed_action"):
        np.testing.assert_array_equal(ours[4][name][kept], theirs[4][name][kept])


@pytest.mark.parametrize("masks", [False, True])
def test_what_is_returned_belongs_to_the_caller(mode: str, masks: bool) -> None:
    def walk(spoil: bool) -> list[bytes]:
        env = Shield(
            pendulums(4, autoreset_mode=mode), HOLD, upright, predict=True, mask_actions=masks
        )  # fmt: skip
        rng, found = np.random.default_rng(3), []
        env.reset(seed=9, options={"state": near_upright(4, 2)})
        for _ in range(20):
            result = env.step(rng.integers(3, size=4))
            found += [part.tobytes() for part in result[:4]]
            done = result[2] | result[3]
            if mode == "Disabled" and done.any():
                env.reset(options={"reset_mask": done})
            if spoil:
                for array in arrays_in(result):
                    array[...] = 1
                env.violations[:] = 7
        assert (env.violations < 20).all()
        return found

    assert walk(spoil=False) == walk(spoil=True)


def test_looking_ahead_keeps_what_the_baseline_can_keep() -> None:
    """Random torques under the shield: with a model there is no violation, without one
    the baseline comes too late."""
    counts = {}
    for name, model in (
        ("none", {}),
        ("model", {"predict": True, "look_ahead": 10}),
    ):
        env = Shield(
            pendulums(50, max_episode_steps=-1, goal_bounds=(1e-3, 1e-3)), HOLD, upright, **model
        )  # fmt: skip
        env.reset(options={"state": np.tile([math.pi, 0.1], (50, 1))})
        rng = np.random.default_rng(0)
        for _ in range(100):
            env.step(rng.integers(3, size=50))
        counts[name] = env.violations.sum()
        assert env.interventions.sum() > 0
    assert counts["none"] > 0
    assert counts["model"] == 0


def test_a_function_as_model_is_asked_as_the_system_is() -> None:
    def predicted(seen: np.ndarray, actions: np.ndarray) -> np.ndarray:
        return np.stack([next_of(*pair)[0] for pair in zip(seen, actions, strict=True)])

    by_system = Shield(pendulums(3), HOLD, upright, predict=True, look_ahead=2)
    by_function = Shield(pendulums(3), HOLD, upright, predict=predicted, look_ahead=2)
    states = near_upright(3, 4)
    for env in (by_system, by_function):
        env.reset(options={"state": states})
    rng = np.random.default_rng(0)
    for _ in range(5):
        actions = rng.integers(3, size=3)
        ours, theirs = by_system.step(actions)[4], by_function.step(actions)[4]
        for name in ("shielded", "violation", "executed_action"):
            np.testing.assert_array_equal(ours[name], theirs[name])


def test_without_a_baseline_violations_are_only_counted() -> None:
    env, plain = Shield(pendulums(3), None, upright), pendulums(3)
    states = near_upright(3, 1)
    for each in (env, plain):
        each.reset(options={"state": states})
    unsafe = 0
    for _ in range(8):
        ours, theirs = env.step([2, 2, 0]), plain.step([2, 2, 0])
        np.testing.assert_array_equal(ours[0], theirs[0])
        unsafe += int((~upright(theirs[0])).sum())
    assert env.violations.sum() == unsafe > 0
    assert env.interventions.sum() == 0


def test_waiting_slots_below_are_counted_once() -> None:
    slots = WaitingVectorEnv.make("acl_gym/Pendulum-v0", 3, max_episode_steps=4)
    env = Shield(slots, HOLD, lambda seen: seen[:, 0] > 10.0)  # nothing is safe
    env.reset(seed=0)
    for _ in range(9):
        env.step([0, 0, 0])
    assert env.violations.tolist() == [4, 4, 4]
    env.reset(options={"reset_mask": mask_of(3, 1)})
    env.step([0, 0, 0])
    assert env.violations.tolist() == [4, 5, 4]


def test_real_inputs_of_a_box() -> None:
    def made() -> Any:
        return gym.make_vec("Pendulum-v1", 2, vectorization_mode="sync")

    half = np.array([[0.5], [0.5]], np.float32)
    env = Shield(
        made(), lambda seen: np.full(len(seen), -1.0), lambda seen: seen[:, 1] > 0
    )
    first, _ = env.reset(seed=3)
    infos = env.step(half)[4]
    expected = np.where(first[:, 1:2] > 0, half, -1.0)
    np.testing.assert_array_equal(infos["executed_action"], expected)
    assert infos["shielded"].tolist() == (first[:, 1] <= 0).tolist()
    with pytest.raises(ValueError, match="mask_actions=True needs Discrete actions"):
        Shield(made(), env.baseline, env.safe, mask_actions=True)


def test_masks_of_the_environment_hold_beside_those_of_the_shield() -> None:
    """The first action of these is always allowed, the others here and there."""
    plain, told = WaitingVectorEnv(MAKERS).reset(seed=1)
    shield = Shield(
        WaitingVectorEnv(MAKERS),
        lambda seen: np.zeros(len(seen), int),
        lambda seen: np.arange(len(seen)) % 2 == 0,
        mask_actions=True,
    )
    seen, infos = shield.reset(seed=1)
    np.testing.assert_array_equal(seen, plain)
    theirs, mask = told["action_mask"], infos["action_mask"]
    np.testing.assert_array_equal(mask[::2], theirs[::2])
    assert mask[1::2].tolist() == [[True, False, False]] * 2
    assert 0 < theirs[::2, 1:].sum() < theirs[::2, 1:].size


@pytest.mark.parametrize("masks", [False, True])
@pytest.mark.parametrize("kind", [ReturningACL, QLearning])
def test_agents_learn_under_it(kind: Any, masks: bool) -> None:
    def shielded(slots: int) -> Shield:
        held = gym.make_vec("acl_gym/Pendulum-v0", slots, max_episode_steps=40)
        model: Any = {"predict": True, "look_ahead": 5}
        return Shield(
            held, HOLD, lambda x: upright(x, 1.0), mask_actions=masks, **model
        )

    env = shielded(5)
    agent = kind(env, seed=0, **({} if kind is ReturningACL else {"grows": True}))
    agent.learn(total_timesteps=2_000)
    if masks:
        assert env.interventions.sum() == 0  # agents heed masks
    else:
        assert env.interventions.sum() > 0
    judge = shielded(2)
    starts = np.array([[math.pi + 0.3, 0.0], [math.pi - 0.3, 0.0]])
    assert np.isfinite(evaluate_policy_cost(agent, judge, starts).cost)
    assert judge.violations.sum() == 0


def test_choices_of_an_inner_loop_are_shielded() -> None:
    controller = StateFeedback(set_point=[math.pi, 0.0], circular=[0])
    loop = InnerLoop(pendulums(2), controller, [[-3.0, 0.0], [2.5, 0.3]], period=2)
    env = Shield(loop, lambda seen: np.ones(len(seen), int), upright)
    env.reset(options={"state": [[math.pi + 0.7, 0.0], [math.pi + 0.2, 0.0]]})
    infos = env.step([0, 0])[4]
    assert infos["executed_action"].tolist() == [1, 0]
    assert infos["shielded"].tolist() == [True, False]


def test_an_inner_loop_around_a_shield_passes_on_what_it_tells() -> None:
    shield = Shield(pendulums(2), HOLD, upright, predict=True, look_ahead=5)
    env = InnerLoop(
        shield, StateFeedback(set_point=[math.pi, 0.0]), [[-3.0, 0.0]], period=3
    )
    env.reset(options={"state": [[math.pi + 0.3, 0.0], [math.pi + 0.2, 0.0]]})
    infos = env.step([0, 0])[4]
    assert {"shielded", "violation", "executed_action"} <= set(infos)
    assert shield.interventions.sum() > 0


def test_stable_baselines_walks_under_it() -> None:
    dqn = pytest.importorskip("stable_baselines3").DQN
    from acl_gym import VectorEnvAdapter

    env = VectorEnvAdapter(
        Shield(pendulums(3, autoreset_mode="Disabled"), HOLD, upright)
    )
    model = dqn("MlpPolicy", env, learning_starts=20, seed=0).learn(90)
    assert model.predict(env.reset())[0].shape == (3,)


@pytest.mark.parametrize(
    ("keywords", "error", "words"),
    [
        ({"safe": None}, TypeError, "safe must be a function"),
        ({"baseline": 3}, TypeError, "baseline must be a function"),
        ({"predict": 3}, TypeError, "predict must be True, None or a function"),
        ({"look_ahead": 2}, ValueError, "look_ahead=2 needs a model"),
        ({"look_ahead": 0}, ValueError, "look_ahead must be at least 1"),
        ({"baseline": None, "predict": True}, ValueError, "baseline must be given"),
        (
            {"baseline": None, "mask_actions": True},
            ValueError,
            "baseline must be given",
        ),
    ],
)
def test_bad_arguments(keywords: Any, error: Any, words: str) -> None:
    given: Any = {"baseline": HOLD, "safe": upright, **keywords}
    with pytest.raises(error, match=words):
        Shield(pendulums(2), given.pop("baseline"), given.pop("safe"), **given)


@pytest.mark.parametrize(
    "env",
    [
        ActionNoise(gym.make_vec("acl_gym/Pendulum-v0", 2), 0.1),
        gym.make_vec("CartPole-v1", 2),
        SyncVectorEnv([lambda: gym.make("acl_gym/Pendulum-v0")] * 2),
    ],
)
def test_environments_that_are_no_model_of_themselves(env: Any) -> None:
    with pytest.raises(ValueError, match=r"predict=True needs .* give a function"):
        Shield(env, HOLD, upright, predict=True)


@pytest.mark.parametrize(
    ("safe", "words"),
    [
        (lambda seen: seen[:, 0], "safe must return a bool for each of 2"),
        (lambda seen: True, "safe must return a bool for each of 2"),
        (lambda seen: np.ones(3, bool), "safe must return a bool for each of 2"),
        (lambda seen: None, "safe must return a bool for each of 2"),
    ],
)
def test_bad_safe_sets(safe: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Shield(pendulums(2), HOLD, safe).reset(seed=0)


def test_bad_baselines_and_models() -> None:
    states = {"state": [[math.pi, 0.0], [0.0, 0.0]]}
    env = Shield(pendulums(2), lambda seen: [math.nan] * len(seen), upright)
    env.reset(options=states)
    with pytest.raises(ValueError, match="what baseline returns must be finite"):
        env.step([0, 0])
    for predict, words in (
        (lambda seen, actions: seen[:, :1], r"predict must return .* shape \(1, 2\)"),
        (lambda seen, actions: seen * math.nan, "predict must return finite"),
        (lambda seen, actions: None, "predict must return the next observations"),
    ):
        env = Shield(pendulums(2), HOLD, upright, predict=predict)
        env.reset(options=states)
        with pytest.raises(ValueError, match=words):
            env.step([0, 0])


def test_a_prediction_that_fails_names_the_slot() -> None:
    bursting = []

    def grows(x: np.ndarray, u: np.ndarray) -> Any:
        return [np.where(bool(bursting) & (x[0] > 2.0), np.inf, u[0])]

    plants = plant(
        grows,
        low=[-5],
        high=[5],
        inputs=[0.0, 1.0],
        sampling_time=0.1,
        goal=None,
        max_episode_steps=9,
        num_envs=3,
    )
    env = Shield(
        plants,
        lambda seen: np.zeros(len(seen), int),
        lambda seen: seen[:, 0] > 0.0,
        predict=True,
    )
    env.reset(options={"state": [-1.0, 1.0, 3.0]})  # slot 0 is not safe and not asked
    bursting.append(True)
    with pytest.raises(SlotError, match="in slot 2"):
        env.step([0, 0, 0])


def test_bad_actions_and_steps_before_a_reset() -> None:
    env = Shield(pendulums(2), HOLD, upright)
    with pytest.raises(ResetNeeded, match="call reset"):
        env.step([0, 0])
    env.reset(seed=0)
    for actions in ([0, 3], [0], [0.0, 1.0], "ab"):
        with pytest.raises((TypeError, ValueError), match="actions must be 2 integers"):
            env.step(actions)
