"""The time limits of the ids, and who they hold for."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import SyncVectorEnv
from gymnasium.wrappers import TimeLimit

from acl_gym import ACL, WaitingVectorEnv, evaluate_policy_cost
from acl_gym.envs import ENVIRONMENTS
from acl_gym.envs.limits import (
    RegisteredLimit,
    checked_limit,
    time_limit,
    trial_limit,
    usual_max_steps,
)
from acl_gym.evaluation.rollout import Rollout

LIMITS = {
    "acl_gym/GridSearch1D-v0": 50,
    "acl_gym/GridSearch2D-v0": 435,
    "acl_gym/Pendulum-v0": 300,
    "acl_gym/Navigation-v0": 150,
    "acl_gym/TwoState-v0": 2,
    "acl_gym/DoubleBridge-v0": 100,
}
PENDULUM = "acl_gym/Pendulum-v0"
TOUR = "acl_gym/TravellingSalesman-v0"  # see tests/envs/graph
SWARM = "acl_gym/SwarmAggregation-v0"  # whose slots share an episode, see tests/envs
ROW = "acl_gym/GridSearch1D-v0"
WEST = 0  # never reaches the goal, in the east

ids = pytest.mark.parametrize("env_id", LIMITS)


def test_every_id_has_a_limit() -> None:
    assert {*LIMITS, TOUR, SWARM} == set(ENVIRONMENTS)
    assert gym.spec(TOUR).max_episode_steps == 100_000
    assert gym.spec(SWARM).max_episode_steps == 100


@ids
def test_the_limit_is_t_of_the_experiments(env_id: str) -> None:
    assert gym.spec(env_id).max_episode_steps == LIMITS[env_id]
    assert gym.make(env_id).spec.max_episode_steps == LIMITS[env_id]
    env = gym.make_vec(env_id, num_envs=2)
    assert env.unwrapped.max_episode_steps == LIMITS[env_id]
    assert env.unwrapped.system.evaluation_steps == LIMITS[env_id]
    assert gym.spec(env_id).to_json().count(f'"max_episode_steps": {LIMITS[env_id]}')


@ids
@pytest.mark.parametrize("form", ["native", "sync", "single"])
def test_no_episode_lasts_longer(env_id: str, form: str) -> None:
    if form == "single":
        env = gym.make(env_id)
        action: Any = WEST
    else:
        mode = {} if form == "native" else {"vectorization_mode": "sync"}
        env = gym.make_vec(env_id, num_envs=1, **mode)
        action = np.array([WEST])
    env.reset(seed=0)
    for step in range(1, LIMITS[env_id] + 1):
        _, _, terminated, truncated, _ = env.step(action)
        if np.any(terminated) or step == LIMITS[env_id]:
            break
        assert not np.any(truncated)
    assert np.any(truncated) or np.any(terminated)
    env.close()


@pytest.mark.parametrize(("steps", "limit"), [(7, 7), (np.int64(7), 7), (None, None)])
def test_a_limit_that_is_given_replaces_it(steps: Any, limit: int | None) -> None:
    env = gym.make_vec(ROW, num_envs=1, max_episode_steps=steps)
    assert env.unwrapped.max_episode_steps == limit
    assert env.unwrapped.with_slots(3).max_episode_steps == limit


@pytest.mark.parametrize(
    ("steps", "error", "message"),
    [
        (0, ValueError, "at least 1, or -1 or None for no limit, got 0"),
        (-2, ValueError, "at least -1, got -2"),
        (1.0, TypeError, "must be an integer, got 1.0"),
        (True, TypeError, "must be an integer, got True"),
        ("9", TypeError, "must be an integer, got '9'"),
    ],
)
def test_what_is_no_limit_is_refused(
    steps: Any, error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=f"max_episode_steps must be .*{message[-8:]}"):
        checked_limit(steps)
    with pytest.raises(error, match=message):
        gym.make_vec(ROW, num_envs=1, max_episode_steps=steps)


@pytest.mark.parametrize(
    ("own", "trial", "limit"),
    [
        (None, None, 0),
        (5, None, 5),
        (None, 5, 5),
        (5, 9, 5),
        (9, 5, 5),
        (RegisteredLimit(5), None, 5),
        (RegisteredLimit(5), 9, 9),
        (RegisteredLimit(9), 5, 5),
    ],
)
def test_which_limit_holds_in_a_trial(
    own: int | None, trial: int | None, limit: int
) -> None:
    found = trial_limit(own, trial)
    assert (found, type(found)) == (limit, int)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
@pytest.mark.parametrize(("own", "steps"), [({}, 70), ({"max_episode_steps": 60}, 60)])
def test_a_trial_walks_to_its_own_t_but_not_beyond_a_chosen_limit(
    own: dict[str, int], steps: int, mode: str
) -> None:
    env = gym.make_vec(ROW, num_envs=2, autoreset_mode=mode, **own)
    rollout = Rollout(env, 70)
    rollout.start(seed=0)
    while rollout.ants.size:
        rollout.step(np.zeros(rollout.ants.size, dtype=np.int64))
    assert rollout.length.tolist() == [steps, steps]
    # The next full reset brings the limit back that the environment was made with.
    rollout.release()
    length, limit = 0, own.get("max_episode_steps", 50)
    while length < 80:
        length += 1
        if env.step(np.zeros(2, dtype=np.int64))[3].any():
            break
    assert length == limit


def test_a_trial_of_fewer_steps_ends_every_walk_in_the_environment_too() -> None:
    env = gym.make_vec(ROW, num_envs=2)
    env.reset(options={"max_steps": 4, "state": [0, 0]})
    cut = [env.step(np.array([WEST, WEST]))[3].tolist() for _ in range(4)]
    assert cut == [[False, False]] * 3 + [[True, True]]


@pytest.mark.parametrize("steps", [0, -1, 2.0, True, "4"])
def test_bad_t_of_a_trial(steps: Any) -> None:
    env = gym.make_vec(ROW, num_envs=2)
    with pytest.raises(
        (TypeError, ValueError), match=r"options\['max_steps'\] must be"
    ):
        env.reset(options={"max_steps": steps})


def test_t_is_for_full_resets() -> None:
    env = gym.make_vec(ROW, num_envs=2)
    env.reset()
    options = {"max_steps": 4, "reset_mask": np.array([True, False])}
    with pytest.raises(ValueError, match="is for a full reset"):
        env.reset(options=options)


def test_the_limit_can_be_changed_under_way() -> None:
    env = gym.make_vec(ROW, num_envs=2, autoreset_mode="Disabled").unwrapped
    env.reset(options={"state": [0, 8]})
    env.step(np.array([WEST, 1]))  # slot 1 has arrived
    env.reset(options={"reset_mask": np.array([False, True]), "state": [0, 0]})
    env.max_episode_steps = 3
    assert not env.step(np.array([WEST, WEST]))[3].any()
    assert env.step(np.array([WEST, WEST]))[3].tolist() == [True, False]


def test_agents_take_the_limit_unless_they_are_given_t() -> None:
    for env_id, limit in LIMITS.items():
        native = gym.make_vec(env_id, num_envs=1)
        assert time_limit(native) == limit
        assert time_limit(WaitingVectorEnv.make(env_id, 1)) == limit
    assert ACL(gym.make_vec(ROW)).max_steps == 50
    unlimited = gym.make_vec(ROW, num_envs=1, max_episode_steps=-1)
    assert time_limit(unlimited) is None
    assert ACL(unlimited).max_steps == 300


def test_the_limit_is_found_wherever_it_was_set() -> None:
    single = gym.make("MountainCar-v0", max_episode_steps=50)
    assert usual_max_steps(single) == 50
    assert usual_max_steps(SyncVectorEnv([lambda: single])) == 50
    assert usual_max_steps(gym.make_vec(PENDULUM, max_episode_steps=50)) == 50
    sync = {"vectorization_mode": "sync", "max_episode_steps": 50}
    assert usual_max_steps(gym.make_vec(PENDULUM, **sync)) == 50
    # Without a spec, as a plant of a user's own, the wrapper alone knows it.
    bare = TimeLimit(single.unwrapped, 70)
    bare.unwrapped.spec = None
    assert usual_max_steps(bare) == 70
    assert usual_max_steps(SyncVectorEnv([lambda: bare])) == 70
    assert usual_max_steps(bare.unwrapped) == 300


def test_an_evaluation_is_as_long_as_asked() -> None:
    class West:
        def predict(self, observation: np.ndarray, **_: Any) -> tuple[Any, None]:
            return np.full(len(observation), WEST), None

    env = gym.make_vec(ROW, num_envs=4)
    assert evaluate_policy_cost(West(), env).lengths.max() == 50
    assert evaluate_policy_cost(West(), env, max_steps=80).lengths.max() == 80
    chosen = gym.make_vec(ROW, num_envs=4, max_episode_steps=60)
    assert evaluate_policy_cost(West(), chosen, max_steps=80).lengths.max() == 60
    # Single environments are cut by TimeLimit, which only -1 removes.
    single = SyncVectorEnv([lambda: gym.make(ROW)] * 2)
    assert evaluate_policy_cost(West(), single, max_steps=80).lengths.max() == 50
