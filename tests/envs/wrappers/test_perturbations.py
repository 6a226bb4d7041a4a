"""Perturbations: what learners observe, and what is carried out."""

from __future__ import annotations

import math
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from acl_gym.envs.wrappers.perturbations import (
    ActionNoise,
    HiddenVariables,
    ObservationNoise,
    ReversedDraws,
    ReversedSlots,
    RoundedObservation,
    perturbed,
)


def pendulums(slots: int, **parameters: Any) -> Any:
    return gym.make_vec("acl_gym/Pendulum-v0", slots, **parameters)


def vehicles(slots: int) -> Any:
    return gym.make_vec("acl_gym/Navigation-v0", slots)


def test_an_unknown_perturbation_is_refused() -> None:
    with pytest.raises(ValueError, match=r"must be among \['slips', .* got \['fog'\]"):
        perturbed(pendulums(2), {"fog": 1, "slips": 0.1})


def test_perturbations_are_applied_in_their_order() -> None:
    env = pendulums(2)
    assert perturbed(env, {}) is env
    everything = {"hidden": [0], "rounded": [0, 3], "noise": [0.1, 0.1], "slips": 0.5}
    wrapper: Any = perturbed(env, everything)
    order = []
    while wrapper is not env:
        order.append(type(wrapper))
        wrapper = wrapper.env
    assert order == [HiddenVariables, RoundedObservation, ObservationNoise, ActionNoise]


def test_noise_is_that_of_the_seed_and_stays_in_the_space() -> None:
    env = perturbed(pendulums(500), {"noise": [0.5, 3.0]})
    first, _ = env.reset(seed=3)
    again, _ = env.reset(seed=3)
    other, _ = env.reset(seed=4)
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
    true = env.unwrapped.states  # type: ignore[attr-defined]
    env.reset(seed=4)
    assert all(env.single_observation_space.contains(each) for each in first)
    turn = 2 * math.pi
    apart = (other[:, 0] - true[:, 0] + turn / 2) % turn - turn / 2
    assert 0.4 < apart.std() < 0.6


def test_noise_is_drawn_anew_in_every_step_and_without_a_seed() -> None:
    env = ObservationNoise(vehicles(3), [0.1, 0.1, 0.1, 0.1])
    states = np.zeros((3, 4))
    seen = [env.reset(seed=1, options={"state": states})[0]]
    seen.append(env.reset(options={"state": states})[0])
    seen.append(env.step(np.full(3, 4))[0])
    assert not np.array_equal(seen[0], seen[1])
    assert not np.array_equal(seen[1], seen[2])


def test_action_noise_replaces_as_many_actions_as_it_says() -> None:
    env, plain = ActionNoise(pendulums(4_000), 0.3), pendulums(4_000)
    env.reset(seed=1)
    plain.reset(seed=1)
    chosen = np.zeros(4_000, dtype=np.int64)
    differ = env.step(chosen)[0][:, 1] != plain.step(chosen)[0][:, 1]
    assert 0.17 < differ.mean() < 0.23  # two of three draws are another action
    env.reset(seed=2)
    first = env.actions(chosen)
    env.reset(seed=2)
    assert np.array_equal(env.actions(chosen), first)


def test_rounded_variables_take_evenly_spaced_values() -> None:
    env = RoundedObservation(pendulums(50), [0, 2])
    seen, _ = env.reset(seed=0)
    true = env.unwrapped.states  # type: ignore[attr-defined]
    assert np.array_equal(seen[:, 0], true[:, 0])
    assert np.array_equal(seen[:, 1], np.where(true[:, 1] > 0, 9.0, -9.0))


def test_hidden_variables_are_left_out() -> None:
    env = HiddenVariables(vehicles(7), [3])
    seen, _ = env.reset(seed=0)
    true = env.unwrapped.states  # type: ignore[attr-defined]
    assert np.array_equal(seen, true[:, :3])
    assert env.single_observation_space.shape == (3,)
    assert env.observation_space.shape == (7, 3)
    assert env.shown == (0, 1, 2)
    assert env.step(np.zeros(7, dtype=np.int64))[0].shape == (7, 3)


@pytest.mark.parametrize(
    "wrap",
    [
        lambda env: ObservationNoise(env, [0.1, 0.1]),
        lambda env: RoundedObservation(env, [2, 2]),
        lambda env: HiddenVariables(env, [0]),
    ],
)
def test_observations_that_a_wrapper_does_not_reach_are_refused(wrap: Any) -> None:
    with pytest.raises(ValueError, match="NEXT_STEP or DISABLED"):
        wrap(pendulums(2, autoreset_mode="SameStep"))


def test_reversed_slots_give_each_slot_what_it_had() -> None:
    plain, env = pendulums(6), ReversedSlots(pendulums(6))
    first, second = plain.reset(seed=2)[0], env.reset(seed=2)[0]
    assert np.array_equal(first[::-1], second)
    actions = np.array([2, 1, 2, 2, 1, 0])
    forth, back = plain.step(actions), env.step(actions[::-1])
    for one, other in zip(forth[:4], back[:4], strict=True):
        assert np.array_equal(one[::-1], other)
    states = plain.states
    env.reset(options={"state": states[::-1]})
    assert np.array_equal(env.unwrapped.states, states)  # type: ignore[attr-defined]


def test_reversed_draws_are_those_of_the_generator() -> None:
    reverse, plain = ReversedDraws(np.random.default_rng(5)), np.random.default_rng(5)
    assert np.array_equal(reverse.random((2, 4))[:, ::-1], plain.random((2, 4)))
    assert reverse.integers(1_000) == plain.integers(1_000)


@pytest.mark.parametrize(
    ("wrap", "error", "message"),
    [
        (
            lambda: ActionNoise(pendulums(2, continuous=True), 0.1),
            ValueError,
            "Discrete",
        ),
        (lambda: ActionNoise(gym.make("CartPole-v1"), 0.1), TypeError, "env must be a"),
        (
            lambda: ObservationNoise(pendulums(2), [0, 0], [2]),
            ValueError,
            r"0\.\.1, got",
        ),
        (
            lambda: ObservationNoise(pendulums(2), [0, 0], "a"),
            TypeError,
            "circular must",
        ),
        # A circle without ends would turn every observation into NaN.
        (
            lambda: ObservationNoise(carts(), [0.1] * 4, [1]),
            ValueError,
            "finite bounds",
        ),
        (
            lambda: RoundedObservation(carts(), [0, 3, 0, 0]),
            ValueError,
            "of variable 1",
        ),
        (
            lambda: HiddenVariables(gym.make("CartPole-v1"), [0]),
            TypeError,
            "env must be",
        ),
    ],
)
def test_what_cannot_be_perturbed_is_refused(
    wrap: Any, error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        wrap()


def carts() -> Any:
    """Two of the four variables of an observation have no bounds."""
    return gym.make_vec("CartPole-v1", num_envs=2, vectorization_mode="sync")


def test_variables_that_are_not_rounded_need_no_bounds() -> None:
    env = RoundedObservation(carts(), [3, 0, 0, 0])
    seen, _ = env.reset(seed=0)
    assert np.isfinite(seen).all()


@pytest.mark.parametrize("actions", [[1], 1, [0, 3], [0.0, 1.0]])
def test_actions_are_checked_before_they_are_replaced(actions: Any) -> None:
    """One action would otherwise be that of all slots."""
    env = ActionNoise(pendulums(2), 0.5)
    env.reset(seed=0)
    with pytest.raises((ValueError, TypeError), match="actions must"):
        env.step(actions)


def test_actions_may_be_counted_from_another_number() -> None:
    env = pendulums(500)
    env.single_action_space = gym.spaces.Discrete(3, start=4)
    noisy = ActionNoise(env, 0.5)
    noisy.reset(seed=0)
    assert set(noisy.actions(np.full(500, 6)).tolist()) == {4, 5, 6}


def test_reversed_slots_are_reset_where_they_are_told_to() -> None:
    env = ReversedSlots(pendulums(3, autoreset_mode="Disabled"))
    before, _ = env.reset(seed=0)
    after, _ = env.reset(options={"reset_mask": np.array([True, False, False])})
    assert (before != after).any(axis=1).tolist() == [True, False, False]
