"""Rows that are there more than once are noticed, and what a plant repeats is not."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import pandas as pd
import pytest

import acl_gym
from acl_gym import Transitions
from acl_gym.envs.learned.copies import copied_steps, levels, stalled_steps
from acl_gym.utils.typing import FloatArray
from tests.envs.learned.recordings import line, pendulum


def table(rows: int = 200, decimals: int = 12) -> pd.DataFrame:
    """A pendulum under random inputs held for three rows, as a data logger writes it."""
    rng, x, lines = np.random.default_rng(0), np.array([3.0, 0.0]), []
    for row in range(rows):
        if row % 3 == 0:
            u = rng.integers(-1, 2)
        lines.append([*np.round(x, decimals), u])
        x = x + 0.05 * np.array([x[1], 10.0 * np.sin(x[0]) - 0.5 * x[1] + 8.0 * u])
    return pd.DataFrame(lines, columns=["theta", "omega", "u"])


def read(frame: pd.DataFrame) -> Transitions:
    return Transitions.from_frame(
        frame, state=["theta", "omega"], input="u", sampling_time=0.05
    )


@pytest.mark.parametrize("decimals", [12, 3])
@pytest.mark.parametrize(
    "times",
    [
        np.full(200, 2),
        np.full(200, 3),
        1 + (np.arange(200) % 10 == 5),
        np.random.default_rng(0).integers(1, 3, 200),
    ],
    ids=["all", "three", "tenth", "some"],
)
def test_rows_that_are_there_twice_are_noticed(times: Any, decimals: int) -> None:
    frame = table(decimals=decimals)
    assert read(frame).doubts() == []
    (doubt,) = read(frame.loc[frame.index.repeat(times)]).doubts()
    assert "nothing moves" in doubt
    assert "remove rows that are there twice" in doubt


def test_files_that_are_read_twice_are_noticed() -> None:
    frame = table()
    for data in (read(frame) + read(frame), read(pd.concat([frame, frame]))):
        (doubt,) = data.doubts()
        assert "copies of others; check that no file was read twice" in doubt
    assert "60 of 120 steps are copies" in (pendulum() + pendulum()).doubts()[0]


class FromRest(gym.Wrapper[Any, Any, Any, Any]):
    """A pendulum that always begins hanging at rest."""

    def reset(self, **how: Any) -> Any:
        return self.env.reset(**{**how, "options": {"state": [0.0, 0.0]}})


def from_rest(steps: int, hold: int) -> Transitions:
    env = FromRest(gym.make("acl_gym/Pendulum-v0", max_episode_steps=steps))
    return Transitions.record(env, 300, hold=hold, seed=0)


def held_at_stops() -> Transitions:
    """A slide between two stops, pushed for ten steps at a time."""
    env = acl_gym.plant(
        lambda x, u: [x[1], u[0]],
        low=[-0.3, -1.0],
        high=[0.3, 1.0],
        inputs=[-1.0, 0.0, 1.0],
        sampling_time=0.1,
        goal=[0.0, 0.0],
        max_episode_steps=100,
        num_envs=2,
    )
    return Transitions.record(env, 400, hold=10, seed=0)


def coming_to_rest() -> Transitions:
    """A positioning stage that stands in its goal, exactly, until the next set-point."""
    rng, x, lines = np.random.default_rng(0), np.array([0.0, 0.0]), []
    for row in range(400):
        if row % 25 == 0:
            u = rng.integers(-5, 6)
        lines.append([*x, u])
        step = np.clip(u - x[0], -0.7, 0.7)
        x = np.array([x[0] + step, step])
    return read(pd.DataFrame(lines, columns=["theta", "omega", "u"]))


def seen_by_coarse_sensors(level: float) -> Callable[[], Transitions]:
    def recorded() -> Transitions:
        frame = table(600)
        for name in ("theta", "omega"):
            frame[name] = level * np.round(frame[name] / level)
        return read(frame)

    return recorded


def slow_tank() -> Transitions:
    """A level that a sensor with ten bits sees change in every second row or so."""
    rng, x, lines = np.random.default_rng(0), 0.5, []
    for row in range(600):
        if row % 40 == 0:
            u = rng.uniform(0.0, 1.0)
        lines.append([np.round(x * 1023) / 1023, u])
        x += 0.002 * (u - 0.7 * np.sqrt(max(x, 0.0)))
    frame = pd.DataFrame(lines, columns=["level", "u"])
    return Transitions.from_frame(frame, state="level", input="u", sampling_time=0.1)


def shaken_at_a_stop() -> Transitions:
    """Noise moves a cart away from the stop that it is pushed against."""
    rng, x, v, rows = np.random.default_rng(0), 0.0, 0.0, []
    for row in range(400):
        if row % 20 == 0:
            u = rng.choice([-1.0, 1.0])
        rows.append([x, v, u])
        v = 0.9 * v + 0.1 * u + 0.3 * rng.standard_normal()
        x += 0.1 * v
        if abs(x) >= 0.3:
            x, v = np.sign(x) * 0.3, 0.0
    return read(pd.DataFrame(rows, columns=["theta", "omega", "u"]))


def of_gymnasium(name: str, hold: int) -> Callable[[], Transitions]:
    return lambda: Transitions.record(gym.make(name), 400, hold=hold, seed=0)


@pytest.mark.parametrize(
    "recorded",
    [
        lambda: from_rest(10, 1),
        lambda: from_rest(10, 3),
        lambda: from_rest(10, 10),
        lambda: from_rest(40, 5),
        held_at_stops,
        coming_to_rest,
        seen_by_coarse_sensors(0.02),
        seen_by_coarse_sensors(0.2),
        slow_tank,
        shaken_at_a_stop,
        of_gymnasium("Pendulum-v1", 5),
        of_gymnasium("CartPole-v1", 3),
        of_gymnasium("MountainCar-v0", 10),
        of_gymnasium("MountainCarContinuous-v0", 20),
        of_gymnasium("acl_gym/Navigation-v0", 10),
    ],
)
def test_what_a_plant_repeats_is_no_copy(recorded: Callable[[], Transitions]) -> None:
    assert recorded().doubts() == []


@pytest.mark.parametrize("name", ["dc_motor", "two_tanks", "cart_pole"])
def test_recordings_of_the_examples_are_not_doubted(name: str) -> None:
    from importlib.resources import files

    from acl_gym.design.plants import load_plant

    env = load_plant(files("acl_gym") / "examples" / f"{name}.py").with_slots(2)
    assert Transitions.record(env, 400, hold=5, seed=0).doubts() == []


def test_what_stands_still_is_not_counted_where_the_input_explains_it() -> None:
    """x(t+1) = x + u: with u = 0 nothing moves, with 0.31 and 0.17 all does."""
    rng = np.random.default_rng(0)
    u = rng.choice([0.0, 0.31, 0.17], 300)
    x = np.concatenate([[0.0], np.cumsum(u)])[:, None]
    episodes = np.zeros(300, np.int64)
    assert stalled_steps(x[:-1], u[:, None], x[1:], episodes) == 0


def test_copies_are_counted() -> None:
    data = line()
    x, u, y = data["states"], data["inputs"], data["next_states"]
    rows = np.r_[0:40, 3:10]
    assert copied_steps(x[rows], u[rows], y[rows], np.zeros(47, np.int64)) == 7
    # A run that begins as another does, and a copy of it from end to end.
    runs = np.repeat([0, 1], [40, 7])
    assert copied_steps(x[rows], u[rows], y[rows], runs) == 7
    begun = np.r_[0:40, 0:7, 20:22]
    runs = np.repeat([0, 1], [40, 9])
    assert copied_steps(x[begun], u[begun], y[begun], runs) == 2


@pytest.mark.parametrize(
    ("column", "level"),
    [([0.0, 0.3, 0.1, 0.7], 0.1), ([0.0, 1.0, 2.5, 3.1], 0.0), ([2.0, 2.0], 0.0)],
)
def test_levels_of_a_sensor(column: list[float], level: float) -> None:
    states: FloatArray = np.array(column)[:, None]
    np.testing.assert_allclose(levels(states), [level])
