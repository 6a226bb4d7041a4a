"""The PID controller against its equation, slot by slot, and in an inner loop."""

from __future__ import annotations

import math
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acl_gym import InnerLoop, plant
from acl_gym.envs.wrappers import PID
from tests.envs.vector_helpers import MODES, mask_of


class ByHand:
    """One slot."""

    def __init__(
        self, time: float, period: float | None, low: float, high: float
    ) -> None:
        self.time, self.period, self.low, self.high = time, period, low, high
        self.total, self.before = 0.0, None

    def __call__(self, y: float, gains: Any, set_point: float) -> float:
        error = set_point - y
        if self.period is not None:
            error = (error + self.period / 2) % self.period - self.period / 2
        total = self.total + self.time * error
        slope = 0.0 if self.before is None else (error - self.before) / self.time
        wanted = gains[0] * error + gains[1] * total + gains[2] * slope
        applied = min(max(wanted, self.low), self.high)
        pushes_on = wanted != applied and (wanted > applied) == (gains[1] * error > 0)
        if not pushes_on or gains[1] * error == 0:
            self.total = total
        self.before = error
        return applied


@given(st.integers(0, 2**32), st.integers(1, 4), st.sampled_from([None, 1.5]))
def test_it_is_its_equation(seed: int, n: int, period: float | None) -> None:
    rng = np.random.default_rng(seed)
    limits = {"low": -1.0, "high": 0.8}
    controller = PID(1, 0.2, period=period, **limits)
    slots = [ByHand(0.2, period, **limits) for _ in range(n)]
    controller.restart(np.ones(n, bool))
    for _ in range(6):
        seen, rows = rng.normal(size=(n, 2)), rng.normal(size=(n, 4))
        expected = [
            slot(y, row[:3], row[3]) for slot, y, row in zip(slots, seen[:, 1], rows, strict=True)
        ]  # fmt: skip
        np.testing.assert_allclose(
            controller(seen, rows), expected, rtol=1e-9, atol=1e-9
        )
        again = rng.random(n) < 0.3
        controller.restart(again)
        for i in np.flatnonzero(again):
            slots[i] = ByHand(0.2, period, **limits)


def drifting(x: np.ndarray, u: np.ndarray) -> Any:
    """A level with a leak, which a controller without an integral leaves too low."""
    return [u[0] - 0.5 - 0.2 * x[0]]


def levels(slots: int, **keywords: Any) -> Any:
    return plant(
        drifting,
        low=[-5.0],
        high=[5.0],
        inputs=np.linspace(-2.0, 2.0, 41),
        sampling_time=0.1,
        goal=None,
        max_episode_steps=200,
        num_envs=slots,
        **keywords,
    )


def test_the_integral_removes_the_error_that_remains() -> None:
    env = InnerLoop(levels(2), PID(0, 0.1, set_point=1.0), [[2.0, 0, 0], [2.0, 1.0, 0]])
    env.reset(options={"state": [0.0, 0.0]})
    for _ in range(150):
        seen = env.step([0, 1])[0][:, 0]
    # 2 (1 - x) = 0.5 + 0.2 x without an integral; inputs are multiples of 0.1.
    assert seen[0] == pytest.approx(1.5 / 2.2, abs=0.05)
    assert seen[1] == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("period", [1, 3])
@pytest.mark.parametrize("mode", MODES)
def test_what_is_remembered_begins_anew_with_each_episode(
    mode: str, period: int
) -> None:
    """A controller that counts its steps is a clock of the episode."""

    class Clock:
        def __init__(self) -> None:
            self.time = np.zeros(3, int)

        def restart(self, slots: np.ndarray) -> None:
            self.time[slots] = 0

        def __call__(self, seen: np.ndarray, parameters: np.ndarray) -> np.ndarray:
            self.time += 1
            return np.ones(3, int)

    made = gym.make_vec(
        "acl_gym/Pendulum-v0", 3, max_episode_steps=7, autoreset_mode=mode
    )
    env = InnerLoop(made, Clock(), [0.0], period=period)
    clock: Any = env.controller
    env.reset(seed=0)
    ends = 0
    for _ in range(40):
        done = np.logical_or(*env.step([0, 0, 0])[2:4])
        ends += done.any()
        if mode == "SameStep":
            assert (clock.time[done] == 0).all()
        if mode == "Disabled" and done.any():
            env.reset(options={"reset_mask": done})
            assert (clock.time[done] == 0).all()
        assert (clock.time <= 7 + period).all()
    assert ends > 3


def test_a_slot_that_restarts_leaves_the_others_alone() -> None:
    both = [PID(0, 0.1, gains=[1.0, 1.0, 1.0], set_point=1.0) for _ in range(2)]
    for each in both:
        each.restart(np.ones(3, bool))
        each([[0.0], [0.5], [2.0]])
    both[1].restart(mask_of(3, 1))
    ours, theirs = (each([[0.1], [0.2], [0.3]]) for each in both)
    assert ours[[0, 2]].tobytes() == theirs[[0, 2]].tobytes()
    assert ours[1] != theirs[1]


def test_two_inner_loops_do_not_share_what_is_remembered() -> None:
    """As an evaluation on the way, in an environment of its own."""
    controller = PID(0, 0.1, set_point=1.0)
    envs = [InnerLoop(levels(2), controller, [[0.5, 1.0, 0.0]]) for _ in range(3)]
    for env in envs:
        env.reset(options={"state": [0.0, 0.5]})
        for _ in range(5):
            env.step([0, 0])
    envs[0].reset()
    ours, theirs = (env.step([0, 0]) for env in envs[1:])
    np.testing.assert_array_equal(ours[0], theirs[0])


def test_equal_settings_are_equal() -> None:
    one, same = (PID(0, 0.1, gains=[1, 2, 3], low=-1) for _ in range(2))
    one.restart(np.ones(2, bool))
    assert one == same
    assert hash(one) == hash(same)
    assert one != PID(0, 0.1, gains=[1, 2, 4], low=-1)
    assert one != 3


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"variable": -1}, ValueError, "variable must be at least 0"),
        ({"sampling_time": 0}, ValueError, "sampling_time must lie in"),
        ({"gains": [1, 2]}, ValueError, "three numbers, K_p, K_i and K_d, got 2"),
        ({"gains": [1, 2, math.nan]}, ValueError, "gains must be an array of 1 axes"),
        ({"set_point": "a"}, TypeError, "set_point must be a real number"),
        ({"period": 0.0}, ValueError, "period must lie in"),
        ({"low": 1, "high": 0}, ValueError, "low must not exceed high"),
        ({"high": math.inf}, ValueError, "high must lie in"),
    ],
)
def test_bad_arguments(arguments: Any, error: Any, words: str) -> None:
    with pytest.raises(error, match=words):
        PID(**{"variable": 0, "sampling_time": 0.1, **arguments})


def test_what_does_not_fit() -> None:
    controller = PID(1, 0.1, gains=[1, 1, 1])
    controller.restart(np.ones(2, bool))
    with pytest.raises(ValueError, match=r"rows of more than 1 variables.*2 slots"):
        controller(np.zeros((2, 1)), np.zeros((2, 1)))
    with pytest.raises(ValueError, match=r"2 slots that restart began, got \(3, 2\)"):
        controller(np.zeros((3, 2)), np.zeros((3, 1)))
    with pytest.raises(ValueError, match="parameters must be rows of 1 numbers"):
        controller(np.zeros((2, 2)))
