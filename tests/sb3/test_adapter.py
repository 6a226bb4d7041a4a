"""The adapter: what Stable-Baselines3 expects of a `VecEnv`, checked piece by piece."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import SyncVectorEnv
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv

from acl_gym.sb3.adapter import VectorEnvAdapter
from tests.sb3.vector_envs import (
    COASTING,
    DICT_SPACE,
    MODES,
    PENDULUM,
    Countdown,
    countdowns,
    pendulums,
    step,
)

# --- what comes out --------------------------------------------------------------


@pytest.mark.parametrize("mode", MODES)
def test_types_and_shapes(mode: str) -> None:
    env = VectorEnvAdapter(pendulums(4, mode, max_episode_steps=3))
    env.seed(1)
    observations = env.reset()
    assert isinstance(observations, np.ndarray)
    assert observations.shape == (4, 2)
    assert observations.dtype == env.observation_space.dtype
    for _ in range(7):
        observations, rewards, dones, infos = step(env)
        assert observations.shape == (4, 2)
        assert all(env.observation_space.contains(row) for row in observations)
        assert rewards.shape == (4,)
        assert rewards.dtype == np.float32
        assert dones.shape == (4,)
        assert dones.dtype == np.bool_
        assert isinstance(infos, list)
        assert [type(info) for info in infos] == [dict] * 4
        for info, done in zip(infos, dones, strict=True):
            assert isinstance(info["TimeLimit.truncated"], bool)
            assert ("terminal_observation" in info) == done


@pytest.mark.parametrize("mode", MODES)
def test_a_crafted_truncation(mode: str) -> None:
    env = VectorEnvAdapter(pendulums(2, mode, max_episode_steps=2))
    twin = gym.make(PENDULUM)
    env.set_options({"state": np.array([[1.0, 0.5], [2.0, -0.5]])})
    env.reset()
    _, _, dones, infos = step(env, 2)
    assert not dones.any()
    assert not any(info["TimeLimit.truncated"] for info in infos)
    observations, _, dones, infos = step(env, 2)
    assert dones.all()
    for slot, state in enumerate(([1.0, 0.5], [2.0, -0.5])):
        twin.reset(options={"state": state})
        twin.step(2)
        last, *_ = twin.step(2)
        assert infos[slot]["TimeLimit.truncated"] is True
        np.testing.assert_allclose(infos[slot]["terminal_observation"], last)
        assert not np.allclose(observations[slot], last)  # already the next episode


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("limit", [None, 1], ids=["no limit", "at the limit as well"])
def test_a_crafted_termination(mode: str, limit: int | None) -> None:
    env = VectorEnvAdapter(pendulums(2, mode, max_episode_steps=limit))
    # Slot 0 coasts into the goal region, slot 1 hangs at rest.
    env.set_options({"state": np.array([COASTING, [0.0, 0.0]])})
    env.reset()
    observations, rewards, dones, infos = step(env, 1)
    assert dones.tolist() == [True, limit == 1]
    # Terminated wins where an episode also ran out of time.
    assert infos[0]["TimeLimit.truncated"] is False
    assert infos[1]["TimeLimit.truncated"] is (limit == 1)
    theta, omega = infos[0]["terminal_observation"]
    assert abs(theta - np.pi) <= 0.1
    assert abs(omega) <= 0.1
    assert not np.allclose(observations[0], infos[0]["terminal_observation"])
    cost = (theta - np.pi) ** 2 + 0.1 * omega**2
    np.testing.assert_allclose(rewards, [-cost, -(np.pi**2)], rtol=1e-6)
    if limit is None:  # the other slot was left alone
        np.testing.assert_allclose(observations[1], [0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("mode", MODES)
def test_slots_that_go_on_are_not_disturbed(mode: str) -> None:
    states = np.array([COASTING, [1.0, 0.5]])
    env = VectorEnvAdapter(pendulums(2, mode))
    twin = gym.make(PENDULUM)
    env.set_options({"state": states})
    env.reset()
    twin.reset(options={"state": states[1]})
    for _ in range(10):
        observations, rewards, _, _ = step(env, 1)
        expected, reward, *_ = twin.step(1)
        np.testing.assert_allclose(observations[1], expected)
        assert rewards[1] == np.float32(reward)


@pytest.mark.parametrize("mode", MODES)
def test_infos_are_taken_apart(mode: str) -> None:
    env = VectorEnvAdapter(countdowns(2, 3, mode=mode))
    env.seed(5)
    env.reset()
    begun = [info["begun"] for info in env.reset_infos]
    assert begun == [np.random.default_rng(5 + i).integers(2**31) for i in range(2)]
    *_, infos = step(env)
    assert infos == [{"t": 1, "TimeLimit.truncated": False}] * 2
    *_, dones, infos = step(env)
    assert dones.tolist() == [True, False]
    assert infos[1] == {"TimeLimit.truncated": False}
    assert infos[0]["terminal_observation"].tolist() == [2, 2]
    assert env.reset_infos[0]["begun"] != begun[0]
    assert env.reset_infos[1]["begun"] == begun[1]
    observations, *_, infos = step(env)
    assert observations.tolist() == [[1, 1], [0, 0]]
    assert infos[1]["t"] == 3
    assert infos[1]["terminal_observation"].tolist() == [3, 3]


@pytest.mark.parametrize("mode", MODES)
def test_the_same_as_sb3s_own_vector_environment(mode: str) -> None:
    """Step for step what `DummyVecEnv` gives for the same single environments."""
    ours = VectorEnvAdapter(countdowns(2, 3, 5, mode=mode))
    theirs = DummyVecEnv([lambda n=n: Monitor(Countdown(n)) for n in (2, 3, 5)])  # type: ignore[misc]
    for env in (ours, theirs):
        env.seed(11)
    np.testing.assert_array_equal(ours.reset(), theirs.reset())
    for _ in range(12):
        assert ours.reset_infos == theirs.reset_infos
        for mine, other in zip(step(ours)[:3], step(theirs)[:3], strict=True):
            np.testing.assert_array_equal(mine, other)
            assert mine.dtype == other.dtype
    for _ in range(12):
        for mine, other in zip(step(ours)[3], step(theirs)[3], strict=True):
            last = mine.pop("terminal_observation", None)
            np.testing.assert_array_equal(last, other.pop("terminal_observation", None))
            # With SAME_STEP, Gymnasium adds the info of the reset.
            assert ("begun" in mine) == (mode == "SameStep" and last is not None)
            mine.pop("begun", None)
            episode, counted = mine.pop("episode", None), other.pop("episode", None)
            assert (episode is None) == (counted is None) == (last is None)
            if episode is not None:
                assert episode["r"] == pytest.approx(counted["r"])
                assert episode["l"] == counted["l"]
            assert mine == other


@pytest.mark.parametrize("mode", MODES)
def test_observations_may_be_a_dict(mode: str) -> None:
    env = VectorEnvAdapter(countdowns(2, 3, mode=mode, space=DICT_SPACE))
    observations = env.reset()
    assert observations["place"].shape == (2, 2)
    step(env)
    observations, _, dones, infos = step(env)
    assert dones.tolist() == [True, False]
    assert observations["place"].tolist() == [[0, 0], [2, 2]]
    assert observations["flag"].tolist() == [0, 0]
    assert infos[0]["terminal_observation"]["place"].tolist() == [2, 2]
    assert DICT_SPACE.contains(
        {**infos[0]["terminal_observation"], "flag": np.int64(0)}
    )


@pytest.mark.parametrize("copy", [True, False])
@pytest.mark.parametrize("mode", MODES)
def test_nothing_handed_out_is_used_again(mode: str, copy: bool) -> None:
    env = VectorEnvAdapter(countdowns(2, 3, mode=mode, copy=copy))
    results = [(env.reset(),)]
    for _ in range(8):
        observations, rewards, dones, infos = step(env)
        last = [info.get("terminal_observation", np.empty(0)) for info in infos]
        results.append((observations, rewards, dones, *last))
    arrays = [array for result in results for array in result]
    for i, one in enumerate(arrays):
        assert not any(np.shares_memory(one, other) for other in arrays[:i])
    # The countdown shows that no array was overwritten later.
    assert [r[0][1, 0] for r in results] == [0, 1, 2, 0, 1, 2, 0, 1, 2]


def test_actions_are_copied() -> None:
    env = VectorEnvAdapter(pendulums(2))
    env.set_options({"state": np.zeros((2, 2))})
    env.reset()
    actions = np.array([0, 2])
    env.step_async(actions)
    actions[:] = 1
    observations, *_ = env.step_wait()
    assert observations[0, 1] < 0 < observations[1, 1]


def test_step_wait_needs_actions() -> None:
    env = VectorEnvAdapter(pendulums(2))
    env.reset()
    with pytest.raises(RuntimeError, match="step_async"):
        env.step_wait()
    step(env)
    with pytest.raises(RuntimeError, match="step_async"):
        env.step_wait()


# --- seeds and options -----------------------------------------------------------


@pytest.mark.parametrize("mode", MODES)
def test_a_seed_gives_one_run(mode: str) -> None:
    def run(seed: int) -> np.ndarray:
        env = VectorEnvAdapter(pendulums(3, mode, max_episode_steps=4))
        assert env.seed(seed) == [seed, seed + 1, seed + 2]
        rows = [env.reset()] + [step(env, 2)[0] for _ in range(9)]
        return np.array(rows)

    np.testing.assert_array_equal(run(3), run(3))
    assert not np.array_equal(run(3)[0], run(4)[0])


def test_seed_and_options_are_used_once() -> None:
    env = VectorEnvAdapter(countdowns(2, 3))
    env.seed(7)
    env.set_options({"colour": "red"})
    env.reset()
    given = env.get_attr("given")
    assert [g["seed"] for g in given] == [7, 8]
    assert [g["options"] for g in given] == [{"colour": "red"}] * 2
    env.reset()
    assert env.get_attr("given") == [{"seed": None, "options": {}}] * 2


def test_options_for_single_slots_are_refused() -> None:
    env = VectorEnvAdapter(pendulums(2))
    with pytest.raises(TypeError, match="one dict for all slots"):
        env.set_options([{}, {}])


# --- frames and the end -------------------------------------------------------


def test_frames() -> None:
    env = VectorEnvAdapter(countdowns(2, 3, 5, 7))
    assert env.render_mode == "rgb_array"
    assert env.metadata == {"render_modes": ["human", "rgb_array"]}
    env.reset()
    assert [frame[0, 0, 0] for frame in env.get_images()] == [2, 3, 5, 7]
    assert env.render().shape == (8, 12, 3)
    without = VectorEnvAdapter(
        SyncVectorEnv([lambda: Countdown(render_mode=None)], autoreset_mode="Disabled")
    )
    assert without.render_mode is None


def test_close_twice() -> None:
    env = VectorEnvAdapter(pendulums(2))
    env.close()
    env.close()
    assert env.env.closed
