"""Recorded transitions: checked, joined, chosen from, saved and read again."""

from __future__ import annotations

import io
import json
import re
import zipfile
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorWrapper

from acl_gym import Transitions
from tests.envs.learned.recordings import line, pendulum


def same(one: Transitions, other: Transitions) -> bool:
    return one.description == other.description and all(
        np.array_equal(getattr(one, name), getattr(other, name))
        for name in (
            "states",
            "inputs",
            "next_states",
            "rewards",
            "terminated",
            "episodes",
        )
    )


def test_a_run_is_recorded_as_it_was() -> None:
    data = pendulum()
    assert len(data) == 60
    env = gym.make("acl_gym/Pendulum-v0")
    torques = env.unwrapped.system.torques  # type: ignore[attr-defined]
    assert data.rewards is not None
    for x, u, y, reward in zip(
        data.states, data.inputs, data.next_states, data.rewards, strict=True
    ):
        env.reset(options={"state": x})
        found, gave, *_ = env.step(torques.index(u[0]))
        np.testing.assert_array_equal(found, y)
        assert gave == reward


def test_what_the_environment_tells_is_kept() -> None:
    data = pendulum()
    assert data.state_names[0].startswith("angle theta")
    assert data.input_names == ("torque u, N m",)
    assert data.sampling_time == 0.1
    assert data.description.circular == (0,)
    assert data.description.values == ((-0.8,), (0.0,), (0.8,))
    assert "60 steps in 6 runs" in repr(data)


def test_runs_are_numbered_and_their_first_states_are_starts() -> None:
    data = pendulum()
    assert data.episodes.tolist() == [run for run in range(6) for _ in range(10)]
    np.testing.assert_array_equal(data.starts, data.states[::10])
    inside = data.episodes[1:] == data.episodes[:-1]
    np.testing.assert_array_equal(
        data.states[1:][inside], data.next_states[:-1][inside]
    )


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_a_vector_environment_is_recorded_in_every_mode_of_autoreset(
    mode: AutoresetMode,
) -> None:
    """No step leads over a reset: CartPole starts within 0.05 of upright."""
    env = SyncVectorEnv([lambda: gym.make("CartPole-v1")] * 3, autoreset_mode=mode)
    data = Transitions.record(env, 200, seed=1)
    assert 200 <= len(data) <= 202
    ends = np.asarray(data.terminated)
    # A pole that falls moves by less than this in a step, and starts upright.
    assert np.abs(data.next_states - data.states)[:, 2].max() < 0.1
    assert (np.abs(data.next_states[ends, 2]) > 0.2).all()
    assert len(data.starts) >= ends.sum()
    assert (np.abs(data.starts) <= 0.05).all()
    assert data.description.numbered


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_a_native_environment_is_recorded_in_every_mode_of_autoreset(
    mode: AutoresetMode,
) -> None:
    env = gym.make_vec(
        "acl_gym/Pendulum-v0", num_envs=3, max_episode_steps=7, autoreset_mode=mode
    )
    data = Transitions.record(env, 90, seed=1)
    assert np.bincount(data.episodes).max() == 7
    single = gym.make_vec("acl_gym/Pendulum-v0", num_envs=len(data))
    single.reset(options={"state": data.states})
    torques = list(single.unwrapped.system.torques)  # type: ignore[attr-defined]
    found, *_ = single.step(np.array([torques.index(u) for u in data.inputs[:, 0]]))
    np.testing.assert_array_equal(found, data.next_states)


def test_a_policy_may_choose() -> None:
    env = gym.make("acl_gym/Pendulum-v0")
    data = Transitions.record(env, 20, lambda seen: np.full(len(seen), 2), seed=0)
    assert (data.inputs == 0.8).all()


def test_the_same_seed_records_the_same_bits() -> None:
    env = gym.make("acl_gym/Pendulum-v0", max_episode_steps=10)
    assert same(pendulum(), Transitions.record(env, 60, hold=3, seed=0))


def test_random_actions_are_held() -> None:
    inputs = pendulum().inputs[:, 0].reshape(-1, 3)
    assert (inputs == inputs[:, :1]).all()


def test_cosine_and_sine_are_found() -> None:
    data = Transitions.record(gym.make("Pendulum-v1"), 50, seed=0)
    assert data.description.angles == ((0, 1),)
    assert data.inputs.shape == (50, 1)
    assert data.description.values is None
    assert Transitions(**line(), angles=()).description.angles == ()


def test_circular_variables_are_brought_back() -> None:
    turned = Transitions([[7.0], [-4.0]], [0.0, 0.0], [[7.1], [-4.1]], circular=[0])
    np.testing.assert_allclose(turned.states[:, 0], [7 - 2 * np.pi, 2 * np.pi - 4])
    ends = Transitions(
        [[370.0]], [0.0], [[-10.0]], circular=[0], low=[0.0], high=[360.0]
    )
    assert (ends.states[0, 0], ends.next_states[0, 0]) == (10.0, 350.0)


def test_files_hold_everything(tmp_path: Path) -> None:
    data = pendulum()
    path = data.save(tmp_path / "run")
    assert path == tmp_path / "run.npz"
    assert same(data, Transitions.load(path))
    bare = Transitions(**line())
    buffer = io.BytesIO()
    bare.save(buffer)
    buffer.seek(0)
    found = Transitions.load(buffer)
    assert found.rewards is None
    assert found.terminated is None
    np.testing.assert_array_equal(found.states, bare.states)


def test_files_of_strangers_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    pendulum().save(path)
    content = path.read_bytes()
    path.write_bytes(content[:-100])
    with pytest.raises(
        ValueError, match="is not a file of transitions saved by acl-gym"
    ):
        Transitions.load(path)
    with zipfile.ZipFile(path, "w") as file:
        header = {"format": "acl-gym transitions", "version": 1}
        packed = io.BytesIO()
        np.save(packed, np.frombuffer(json.dumps(header).encode(), np.uint8))
        file.writestr("header.npy", packed.getvalue())
    with pytest.raises(ValueError, match="is not a complete file of transitions"):
        Transitions.load(path)
    with pytest.raises(FileNotFoundError):
        Transitions.load(tmp_path / "none.npz")


def test_a_file_with_nan_is_refused(tmp_path: Path) -> None:
    data = Transitions(**line())
    spoiled = data.states.copy()
    spoiled[3] = np.nan
    data._arrays["states"] = spoiled
    data.save(tmp_path / "run")
    with pytest.raises(ValueError, match="states must be finite"):
        Transitions.load(tmp_path / "run")


def test_an_agent_is_no_recording(tmp_path: Path) -> None:
    from acl_gym import ReturningACL

    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=2)
    ReturningACL(env, seed=0).save(tmp_path / "agent")
    with pytest.raises(ValueError, match="format 'acl-gym transitions'"):
        Transitions.load(tmp_path / "agent")


def test_recordings_of_one_plant_are_joined() -> None:
    data = pendulum()
    both = data + data[:20]
    assert len(both) == 80
    assert (np.diff(both.episodes) >= 0).all()
    assert both.episodes[60] == data.episodes[-1] + 1
    np.testing.assert_array_equal(both.rewards[60:], data.rewards[:20])  # type: ignore[index]
    bare = Transitions(**line())
    known = Transitions(**line(), rewards=np.zeros(40))
    assert (bare + known).rewards is None


def test_recordings_of_different_plants_are_not() -> None:
    one = Transitions(**line(), state_names=["level"])
    other = Transitions(**line(), state_names=["height"])
    with pytest.raises(ValueError, match="of the same plant, got state_names"):
        one + other
    slow = Transitions(**line(), sampling_time=1.0)
    fast = Transitions(**line(), sampling_time=0.1)
    with pytest.raises(ValueError, match=r"sampling_time 1 s and 0\.1 s"):
        slow + fast
    with pytest.raises(TypeError):
        one + 1  # type: ignore[operator]


def test_steps_are_chosen_by_slices_and_masks() -> None:
    data = pendulum()
    assert same(data[10:20], data[(data.episodes == 1)])
    with pytest.raises(ValueError, match="at least one step"):
        data[60:]
    with pytest.raises(TypeError, match="a slice or a mask"):
        data[3]
    with pytest.raises(ValueError, match=r"shape \(60,\)"):
        data[np.array([True])]


@pytest.mark.parametrize(
    ("rows", "starts", "episodes"),
    [
        (slice(None, None, 2), [0, 2, 4], [0, 1, 2]),
        (slice(None, None, -1), [5, 4, 3, 2, 1, 0], [0, 1, 2, 3, 4, 5]),
        (np.array([1, 0, 1, 1, 0, 1], bool), [0, 2, 3, 5], [0, 1, 2, 3]),
        (np.array([0, 0, 0, 1, 1, 1], bool), [3], [7, 7, 7]),
        (slice(2, 5), [2, 3], [4, 7, 7]),
    ],
)
def test_runs_that_are_torn_apart_are_several(
    rows: Any, starts: list[int], episodes: list[int]
) -> None:
    """Steps 0 to 2 of run 4 and 3 to 5 of run 7, each to the next whole number."""
    x = np.arange(6.0)
    data = Transitions(x, x % 2, x + 1, episodes=[4, 4, 4, 7, 7, 7])[rows]
    assert data.starts[:, 0].tolist() == starts
    assert np.unique(data.episodes).tolist() == np.unique(episodes).tolist()
    assert len(np.unique(data.episodes)) == len(data.starts)


def test_actions_of_joined_recordings() -> None:
    x = np.arange(12.0)

    def made(values: Any, numbered: bool = False) -> Transitions:
        return Transitions(
            x, np.resize(values or [0, 1], 12), x + 1, values=values, numbered=numbered
        )

    with pytest.raises(ValueError, match="got the numbers of actions"):
        made([0, 1], numbered=True) + made([0, 1, 2], numbered=True)
    # What actions set may differ: then nobody knows what the actions are.
    assert (made([-1, 1]) + made([-2, 0, 2])).description.values is None
    assert (made([-1, 1]) + made(None)).description.values == ((-1.0,), (1.0,))
    assert (made(None) + made([-1, 1])).description.values == ((-1.0,), (1.0,))
    assert (made([-1, 1]) + made([-1, 1])).description.values == ((-1.0,), (1.0,))


def test_a_step_is_not_chosen_by_its_number() -> None:
    with pytest.raises(
        TypeError, match=r"got \[1, \[2\]\]; for step i use \[i : i \+ 1\]"
    ):
        pendulum()[[1, [2]]]


def test_arrays_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="read-only"):
        pendulum().states[0] = 0.0


NAN = np.where(np.arange(40)[:, None] == 7, np.nan, 0.0)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"states": NAN}, r"states must be finite, got \[nan\] in row 7"),
        ({"inputs": np.full((40, 1), np.inf)}, r"inputs must be finite"),
        ({"inputs": np.zeros(39)}, r"inputs must have a row for each step, shape \(40"),
        ({"next_states": np.zeros((40, 2))}, "the 1 variables of states, got 2"),
        ({"states": np.zeros((40, 1, 1))}, "states must have a row for each step"),
        ({"states": [["a"]] * 40}, "states must be an array of real numbers"),
        ({"rewards": np.zeros(3)}, r"rewards must have shape \(40,\)"),
        ({"rewards": np.full(40, np.nan)}, "rewards must be finite"),
        ({"terminated": np.full(40, 2)}, "terminated must be 40 booleans"),
        ({"episodes": np.arange(40)[::-1]}, "episodes must be 40 integers that do not"),
        # The difference of these two is 1 where it overflows.
        ({"episodes": [2**63 - 1] * 39 + [-(2**63)]}, "40 integers that do not fall"),
        (
            {"episodes": [0] * 39 + [2**60]},
            r"integers in \[-2\^53, 2\^53\], got 0 to 115",
        ),
        # Their squares overflow, so that a deviation is infinite and features vanish.
        ({"states": np.full(40, 1e200)}, r"states must be at most 1e\+100 in size"),
        ({"inputs": np.full(40, -1e200)}, r"inputs must be at most 1e\+100 in size"),
        ({"rewards": np.full(40, 1e200)}, r"rewards must be at most .* in row 0 \(40"),
        ({"state_names": ["a", "b"]}, "state_names must be 1 strings"),
        ({"circular": ["theta"]}, "circular must hold names or numbers"),
        ({"circular": [0], "low": [0.0]}, "must both be given, or neither"),
        ({"low": [1.0], "high": [1.0]}, "low must be below high"),
        ({"low": [np.nan]}, "low must hold a number or None"),
        ({"sampling_time": 0.0}, "sampling_time must lie in"),
        ({"values": [[1.0, 2.0]]}, "values must hold a row of 1 numbers"),
        ({"angles": [(0, 1)]}, "angles must be pairs of different numbers"),
    ],
)
def test_bad_arguments_get_one_clear_error(
    changed: dict[str, Any], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        Transitions(**{**line(), **changed})


def test_environments_without_vectors_are_refused() -> None:
    with pytest.raises(TypeError, match="observations that are a Box of one axis"):
        Transitions.record(gym.make("FrozenLake-v1"), 10)
    env = SyncVectorEnv([lambda: gym.make("Taxi-v4")])
    with pytest.raises(TypeError, match="observations that are a Box of one axis"):
        Transitions.record(env, 10)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"inputs": np.zeros((40, 1))}, ["the input u[0] is always 0"]),
        (
            {"states": np.ones((40, 1)), "next_states": np.ones((40, 1))},
            ["the variable x[0] is always 1"],
        ),
    ],
)
def test_doubts_are_told(changed: dict[str, Any], words: list[str]) -> None:
    found = Transitions(**{**line(), **changed}).doubts()
    for each in words:
        assert any(each in doubt for doubt in found), found


def test_good_data_is_not_doubted() -> None:
    assert pendulum().doubts() == []
    assert Transitions(**line()).doubts() == []


def test_few_steps_and_copies_are_doubted() -> None:
    assert "only 10 steps" in Transitions(**line(10)).doubts()[0]
    data = pendulum()
    assert "60 of 120 steps are copies" in (data + data).doubts()[0]


def test_mixed_units_are_noticed() -> None:
    """An angle in degrees beside its rate in radians per second."""
    rng = np.random.default_rng(0)
    rate, angle = rng.uniform(-2, 2, 100), rng.uniform(-100, 100, 100)
    states = np.stack([angle, rate], axis=1)
    after = np.stack([angle + np.degrees(rate * 0.1), rate], axis=1)
    u = rng.choice([-1.0, 1.0], 100)
    found = Transitions(states, u, after, sampling_time=0.1).doubts()
    assert any("degrees instead of radians" in doubt for doubt in found), found
    states[:, 0], after[:, 0] = np.radians(states[:, 0]), np.radians(after[:, 0])
    assert Transitions(states, u, after, sampling_time=0.1).doubts() == []


def test_degrees_of_an_angle_are_noticed_though_it_wraps_around() -> None:
    rng = np.random.default_rng(0)
    rate, angle = rng.uniform(-2, 2, 100), rng.uniform(-100, 100, 100)
    states = np.stack([angle, rate], axis=1)
    after = np.stack([angle + np.degrees(rate * 0.1), rate], axis=1)
    u = rng.choice([-1.0, 1.0], 100)
    data = Transitions(states, u, after, sampling_time=0.1, circular=[0])
    (turns, unit) = data.doubts()
    assert "turns of 6.283; if it is in degrees" in turns
    assert "degrees instead of radians" in unit
    assert data[:50].doubts() == [turns, unit]
    right = Transitions(
        states,
        u,
        after,
        sampling_time=0.1,
        circular=[0],
        low=[-180, None],
        high=[180, None],
    )
    # Nothing is wrong with a rate in radians: the ends say that the angle is in degrees.
    assert right.doubts() == []


def pendulum_in_units(degrees_from: int, degrees_to: int, noise: float) -> Transitions:
    """A pendulum whose angular velocity is in degrees per second in some steps."""
    rng, x, states = np.random.default_rng(0), np.array([3.0, 0.0]), []
    u = np.repeat(rng.integers(-1, 2, 80), 5).astype(float)
    for each in u:
        states.append(x)
        for _ in range(20):
            speed = 10.0 * np.sin(x[0]) - 0.5 * x[1] + 8.0 * each
            x = x + 0.0025 * np.array([x[1], speed])
    rows = np.array(states)
    rows = rows + noise * rng.standard_normal(rows.shape)
    rows[degrees_from:degrees_to, 1] *= 180.0 / np.pi
    return Transitions(rows[:-1], u[:-1], rows[1:], circular=[0], sampling_time=0.05)


@pytest.mark.parametrize("noise", [0.0, 0.005])
@pytest.mark.parametrize("first", [100, 200, 333])
def test_units_that_change_within_a_recording_are_noticed(
    first: int, noise: float, tmp_path: Path
) -> None:
    assert pendulum_in_units(0, 0, noise).doubts() == []
    data = pendulum_in_units(first, 400, noise)
    (doubt,) = data.doubts()
    assert "degrees instead of radians in a part of the recording" in doubt
    (step,) = re.findall(r"from about step (\d+) on", doubt)
    assert abs(int(step) - first) <= 80  # two parts of ten
    # The doubt is kept by a file; a file that was written before it was, has none.
    assert Transitions.load(data.save(tmp_path / "run")).doubts() == [doubt]


def test_doubts_about_an_angle_are_kept_by_files(tmp_path: Path) -> None:
    """Its turns are no longer in the file, since angles are brought back."""
    angle = np.linspace(0.0, 36_000.0, 200)
    u = np.arange(200.0) % 2
    data = Transitions(angle, u, angle + 10.0, circular=[0])
    assert "turns of 6.283; if it is in degrees" in data.doubts()[0]
    assert Transitions.load(data.save(tmp_path / "run")).doubts() == data.doubts()


def test_inputs_must_be_numbers_of_actions() -> None:
    with pytest.raises(ValueError, match="inputs must be numbers of actions"):
        Transitions(**line(), numbered=True, values=[[0.0], [1.0]])


@pytest.mark.parametrize(
    ("observation", "reward", "message"),
    [
        ([np.nan, 0.0], 0.0, r"finite numbers, got \[nan, 0\.0\]"),
        ([0.0, 0.0], np.inf, "with reward inf"),
        ([0.0], 0.0, r"observations of shape \(1, 2\)"),
        ([0.0, 0.0], np.zeros(2), "rewards with one number for each of 1 slots"),
        ([0.0, 0.0], "0", "rewards with one number for each of 1 slots"),
        ([0.0, 0.0], None, "rewards with one number for each of 1 slots"),
    ],
)
def test_what_a_plant_returns_is_checked(
    observation: Any, reward: Any, message: str
) -> None:
    class Broken(gym.Wrapper[Any, Any, Any, Any]):
        def step(self, action: Any) -> Any:
            return np.array(observation), reward, False, False, {}

    with pytest.raises(ValueError, match=message):
        Transitions.record(Broken(gym.make("acl_gym/Pendulum-v0")), 5, seed=0)


@pytest.mark.parametrize(
    "policy",
    [
        lambda seen: None,
        lambda seen: 1,
        lambda seen: np.array([1.0]),
        lambda seen: np.array([1, 2]),
        lambda seen: np.array([[1]]),
        lambda seen: np.array([-1]),
        lambda seen: np.array([3]),
        lambda seen: (np.array([3]), None),
    ],
)
def test_what_a_policy_chooses_is_checked(policy: Any) -> None:
    """In CartPole-v1 an action of 1.5 is a step like any other."""
    for env in (gym.make("acl_gym/Pendulum-v0"), gym.make("CartPole-v1")):
        with pytest.raises(ValueError, match=r"actions must be .*; check the policy\."):
            Transitions.record(env, 5, policy, seed=0)


@pytest.mark.parametrize("chosen", [[[np.nan]], [[1.0, 2.0]], [1.0], [["a"]]])
def test_real_inputs_of_a_policy_are_checked(chosen: Any) -> None:
    """Pendulum-v1 takes a second number, and passes it by."""
    with pytest.raises(ValueError, match=r"actions must be .*; check the policy\."):
        Transitions.record(gym.make("Pendulum-v1"), 5, lambda seen: chosen, seed=0)


def test_what_cannot_be_run_is_refused() -> None:
    with pytest.raises(TypeError, match="env must be an environment of Gymnasium"):
        Transitions.record("CartPole-v1", 5)
    with pytest.raises(TypeError, match=r"policy must have predict\(observations\)"):
        Transitions.record(gym.make("CartPole-v1"), 5, 3)  # type: ignore[arg-type]


@pytest.mark.parametrize("final", [None, np.array([None, None]), np.zeros((2, 3))])
def test_last_observations_are_checked(final: Any) -> None:
    class Forgetful(VectorWrapper[Any, Any, Any]):
        def step(self, actions: Any) -> Any:
            *found, infos = self.env.step(actions)
            infos = {**infos, "final_obs": final}
            return *found, {key: v for key, v in infos.items() if v is not None}

    env = SyncVectorEnv(
        [lambda: gym.make("CartPole-v1")] * 2, autoreset_mode=AutoresetMode.SAME_STEP
    )
    with pytest.raises(
        ValueError, match=r"final_obs'\] must hold the last observation"
    ):
        Transitions.record(Forgetful(env), 200, seed=0)


def test_the_mode_of_autoreset_may_be_text() -> None:
    def made() -> SyncVectorEnv:
        cars = [lambda: gym.make("CartPole-v1")] * 2
        return SyncVectorEnv(cars, autoreset_mode=AutoresetMode.SAME_STEP)

    env = made()
    env.metadata = {**env.metadata, "autoreset_mode": "SameStep"}
    found = Transitions.record(env, 200, seed=0)
    assert same(found, Transitions.record(made(), 200, seed=0))


def test_a_reward_may_be_an_array_of_one_number() -> None:
    class Boxed(gym.Wrapper[Any, Any, Any, Any]):
        def step(self, action: Any) -> Any:
            found, reward, terminated, truncated, info = super().step(action)
            return found, np.array([reward]), np.array([terminated]), truncated, info

    env = gym.make("acl_gym/Pendulum-v0", max_episode_steps=10)
    boxed = Transitions.record(Boxed(env), 30, hold=3, seed=0)
    assert same(boxed, Transitions.record(env, 30, hold=3, seed=0))
    assert boxed.rewards is not None
    assert boxed.rewards.shape == (30,)
