"""What an evaluation says of success, returns and costs, and what it leaves behind."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv
from gymnasium.wrappers.vector import RecordEpisodeStatistics

from acl_gym import ACL, QLearning, WaitingVectorEnv, evaluate_policy_cost
from acl_gym.callbacks import PolicyEvaluation
from acl_gym.evaluation import (
    actions_in,
    policy_measures,
    record_trajectory,
    reports_returns,
    with_slots_for,
)
from acl_gym.evaluation.rollout import Rollout
from tests.agents.reference_colony import chains

PENDULUM, ROW = "acl_gym/Pendulum-v0", "acl_gym/GridSearch1D-v0"


class Always:
    def __init__(self, action: int) -> None:
        self.action = action

    def predict(self, observation: Any, *_: Any, **__: Any) -> tuple[Any, None]:
        return np.full(len(observation), self.action), None


class Judged(gym.Env[Any, Any]):
    """Ends after `length` steps, as a success or not; says so only at its end or always.

    A success may end in no terminal state, and a failure in one.
    """

    observation_space, action_space = spaces.Discrete(20), spaces.Discrete(2)

    def __init__(self, length: int, success: bool, always: bool) -> None:
        self.length, self.success, self.always = length, success, always

    def reset(self, *, seed: Any = None, options: Any = None) -> tuple[int, Any]:
        super().reset(seed=seed)
        self.t = 0
        return 0, {}

    def step(self, action: Any) -> tuple[int, float, bool, bool, dict[str, Any]]:
        self.t += 1
        over = self.t >= self.length
        info = {"is_success": over and self.success} if over or self.always else {}
        return self.t, 2.0, over and not self.success, over and self.success, info


def judged(mode: str, always: bool) -> VectorEnv[Any, Any, Any]:
    slots = [
        lambda n=n, good=good: Judged(n, good, always)
        for n, good in ((3, True), (5, False), (2, True), (15, True))
    ]
    if mode == "waiting":
        return WaitingVectorEnv(slots)
    return SyncVectorEnv(slots, autoreset_mode=AutoresetMode(mode))


MODES = ("NextStep", "SameStep", "Disabled", "waiting")


@pytest.mark.parametrize("always", [False, True])
@pytest.mark.parametrize("mode", MODES)
def test_success_is_what_the_infos_say(mode: str, always: bool) -> None:
    result = evaluate_policy_cost(Always(0), judged(mode, always), max_steps=9)
    # The last episode is cut at T, which is no success.
    assert result.success is not None
    assert result.success.tolist() == [True, False, True, False]
    assert result.success_rate == 0.5
    assert result.lengths.tolist() == [3, 5, 2, 9]
    assert result.returns.tolist() == [6.0, 10.0, 4.0, 18.0]
    assert result.mean_return == -result.cost == 9.5


@pytest.mark.parametrize("kind", [ACL, QLearning])
def test_the_history_of_a_judged_environment(kind: Any) -> None:
    parameters = {"deposit": "return"} if kind is ACL else {}
    agent = kind(judged("NextStep", False), max_steps=9, seed=0, **parameters)
    agent.learn(trials=2, callback=PolicyEvaluation(judged("SameStep", True)))
    for row in agent.history:
        assert row["ants_success_rate"] == 0.5
        assert row["success_rate"] == 0.75  # T is 300 there, so all four end
        assert row["ants_return"] == -row["ants_cost"] == 9.5
        assert row["policy_return"] == -row["policy_cost"] == 12.5


def test_a_cost_of_its_own_does_not_change_the_return() -> None:
    result = evaluate_policy_cost(
        Always(0), judged("NextStep", False), cost=lambda episode: 7.0
    )
    assert result.costs.tolist() == [7.0] * 4
    assert result.mean_return == 12.5


@pytest.mark.parametrize("mode", MODES)
def test_where_nobody_says_what_success_is_it_is_not_known(mode: str) -> None:
    env = WaitingVectorEnv.make("CliffWalking-v1", 2) if mode == "waiting" else None
    env = env or chains(2, AutoresetMode(mode))
    result = evaluate_policy_cost(Always(0), env, max_steps=5)
    assert result.success is result.success_rate is None
    assert set(policy_measures(result, env)) == {"policy_cost", "policy_return"}


def test_our_systems_report_costs_in_either_form() -> None:
    native = gym.make_vec(ROW, num_envs=2)
    for env, states in (
        (native, None),
        (RecordEpisodeStatistics(native), [[0], [8]]),
        (SyncVectorEnv([lambda: gym.make(ROW)] * 2), None),
        (WaitingVectorEnv.make(ROW, 2), None),
    ):
        assert not reports_returns(env)
        result = evaluate_policy_cost(Always(1), env, states)
        assert result.success_rate == 1.0
        assert set(policy_measures(result, env)) == {"policy_cost", "success_rate"}
    assert reports_returns(chains(2))
    assert not reports_returns(chains(2), lambda episode: 1.0)


# --- what is left behind -------------------------------------------------------------


@pytest.mark.parametrize("slots", [1, 99, 100, 101])
@pytest.mark.parametrize(
    "look",
    [
        lambda env: evaluate_policy_cost(Always(1), env, max_steps=3),
        lambda env: evaluate_policy_cost(Always(1), env, max_steps=3, seed=5),
        lambda env: evaluate_policy_cost(Always(1), env, env.states, max_steps=3),
        lambda env: actions_in(Always(1), env, env.states),
        lambda env: PolicyEvaluation(env, max_steps=3)._evaluate(
            ACL(with_slots_for(env), seed=0), {"trial": 1}
        ),
        lambda env: (
            record_trajectory(Always(1), env, env.states[0])
            if env.num_envs == 1
            else None
        ),
    ],
)
def test_an_evaluation_does_not_touch_the_environment(look: Any, slots: int) -> None:
    mine, twin = (
        gym.make_vec(PENDULUM, num_envs=slots, max_episode_steps=20).unwrapped
        for _ in range(2)
    )
    for env in (mine, twin):
        env.reset(seed=1)
        for _ in range(5):
            env.step(np.ones(slots, dtype=np.int64))
    look(mine)
    for _ in range(45):
        ours, theirs = (
            env.step(np.ones(slots, dtype=np.int64)) for env in (mine, twin)
        )
        for a, b in zip(ours[:4], theirs[:4], strict=True):
            np.testing.assert_array_equal(a, b)


def test_an_environment_made_for_evaluations_is_not_copied_again() -> None:
    env = gym.make_vec(PENDULUM, num_envs=100)
    copied = with_slots_for(env)
    assert copied is not env
    assert with_slots_for(copied) is copied
    assert with_slots_for(copied, np.zeros((3, 2))).num_envs == 3


def test_without_a_seed_a_copy_of_the_stream_is_used() -> None:
    env = gym.make_vec(ROW, num_envs=9, transition_probability=0.5)
    env.reset(seed=3)
    first, again = (evaluate_policy_cost(Always(1), env).costs for _ in range(2))
    np.testing.assert_array_equal(first, again)
    env.reset()  # the stream has moved on
    assert (evaluate_policy_cost(Always(1), env).costs != first).any()


@pytest.mark.parametrize("mode", MODES)
def test_a_wrapped_environment_can_be_stepped_afterwards(mode: str) -> None:
    if mode == "waiting":
        env: Any = WaitingVectorEnv.make(ROW, 9)
    else:
        env = gym.make_vec(ROW, num_envs=9, autoreset_mode=mode)
    env = RecordEpisodeStatistics(env)
    evaluate_policy_cost(Always(1), env)
    rewards = env.step(np.zeros(9, dtype=np.int64))[1]
    # No slot stands still, no slot waits for a reset.
    assert rewards.tolist() == [-1.0] * 9


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
@pytest.mark.parametrize("steps", [4, 60])
def test_every_walk_of_a_colony_is_counted(mode: str, steps: int) -> None:
    recorder = RecordEpisodeStatistics(
        gym.make_vec(ROW, num_envs=5, autoreset_mode=mode), buffer_length=1_000
    )
    colony = ACL(recorder, max_steps=steps, tau0=1e-3, seed=0)
    lengths = []
    colony.learn(
        trials=6, callback=lambda agent, _: lengths.extend(agent.rollout.length)
    )
    assert recorder.episode_count == 6 * 5
    assert sorted(recorder.length_queue) == sorted(lengths)
    assert sum(recorder.return_queue) == -sum(lengths)


# --- seeds ---------------------------------------------------------------------------

PLACES = {
    "native": lambda: gym.make_vec(ROW, num_envs=9),
    "sync": lambda: SyncVectorEnv([lambda: gym.make(ROW)] * 9),
    "waiting": lambda: WaitingVectorEnv.make(ROW, 9),
}
BAD_SEEDS = [-1, np.int64(-1), 1.0, np.float64(2), True, "1"]


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("kind", [np.int64, np.uint8, np.int32])
def test_seeds_of_numpy_do_what_the_same_int_does(place: str, kind: Any) -> None:
    env = PLACES[place]()
    first = Rollout(env, 5).start(seed=7)
    np.testing.assert_array_equal(Rollout(env, 5).start(seed=kind(7)), first)
    if place != "sync":  # Gymnasium's own takes only int
        np.testing.assert_array_equal(env.reset(seed=kind(7))[0], env.reset(seed=7)[0])


def test_single_environments_take_seeds_of_numpy() -> None:
    env = gym.make(PENDULUM)
    np.testing.assert_array_equal(
        env.unwrapped.reset(seed=np.int64(7))[0], env.unwrapped.reset(seed=7)[0]
    )


@pytest.mark.parametrize("seed", BAD_SEEDS)
def test_bad_seeds_are_refused_in_one_way(seed: Any) -> None:
    refused = pytest.raises((TypeError, ValueError), match=r"^seed must be")
    for make in PLACES.values():
        with refused:
            evaluate_policy_cost(Always(1), make(), seed=seed)
    for make in (PLACES["native"], PLACES["waiting"], lambda: gym.make(ROW).unwrapped):
        with refused:
            make().reset(seed=seed)
    with refused:
        PolicyEvaluation(chains(2), seed=seed)
    with refused:
        ACL(chains(2), seed=seed)
