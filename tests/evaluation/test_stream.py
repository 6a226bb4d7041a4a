"""Episodes one after the other in each slot, whatever the environment does with slots."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv, VectorEnv
from gymnasium.wrappers.vector import RecordEpisodeStatistics

import acl_gym  # noqa: F401
from acl_gym import WaitingVectorEnv
from acl_gym.evaluation.rollout import Rollout
from acl_gym.evaluation.stream import Stream
from tests.agents.reference_colony import Chain, chains

SLOTS, LONGEST, EPISODES = 6, 40, 40
PENDULUM = "acl_gym/Pendulum-v0"
SETTINGS = {"slip": 0.3, "first_action": 3}


class Foreign(VectorEnv):
    """Resets all slots whatever the mask says, as Gymnasium's own CartPole does."""

    def __init__(self, mode: str, limit: float, **parameters: Any) -> None:
        self.inner = chains(SLOTS, mode, limit=limit, **parameters)
        self.num_envs, self.metadata = SLOTS, self.inner.metadata
        for name in ("observation_space", "action_space"):
            setattr(self, name, getattr(self.inner, name))
            setattr(self, f"single_{name}", getattr(self.inner, f"single_{name}"))

    def reset(self, *, seed: Any = None, options: Any = None) -> Any:
        assert not options, "it would reset all slots"
        return self.inner.reset(seed=seed)

    def step(self, actions: Any) -> Any:
        return self.inner.step(actions)


ENVS: dict[str, Any] = {
    **{
        mode: lambda limit, mode=mode: chains(SLOTS, mode, limit=limit, **SETTINGS)
        for mode in ("NextStep", "SameStep", "Disabled")
    },
    "waiting": lambda limit: WaitingVectorEnv(
        [lambda: Chain(limit=limit, **SETTINGS)] * SLOTS
    ),
    "statistics": lambda limit: RecordEpisodeStatistics(
        chains(SLOTS, "NextStep", limit=limit, **SETTINGS)
    ),
    "statistics, disabled": lambda limit: RecordEpisodeStatistics(
        chains(SLOTS, "Disabled", limit=limit, **SETTINGS)
    ),
    "foreign, NextStep": lambda limit: Foreign("NextStep", limit, **SETTINGS),
    "foreign, SameStep": lambda limit: Foreign("SameStep", limit, **SETTINGS),
}


def planned_actions(seed: int = 0) -> np.ndarray:
    """What each slot does in each step of each of its episodes; mostly to the goal."""
    rng = np.random.default_rng(seed)
    return (rng.random((SLOTS, EPISODES, LONGEST)) < 0.7).astype(np.int64)


class Told:
    """What a stream tells of each slot: its episodes, one after the other."""

    def __init__(self, stream: Stream, seed: int, plan: np.ndarray) -> None:
        observation = stream.start(seed=seed, record=True)
        self.episodes: list[list[list[Any]]] = [[] for _ in range(SLOTS)]
        done = np.ones(SLOTS, dtype=np.bool_)
        self.steps = 0
        while stream.ants.size:
            ants = stream.ants.copy()
            actions = []
            for ant in ants:
                if done[ant]:
                    self.episodes[ant].append([observation[ant].copy()])
                    done[ant] = False
                made = len(self.episodes[ant][-1]) - 1
                actions.append(plan[ant, len(self.episodes[ant]) - 1, made])
            step = stream.step(np.array(actions))
            self.steps += ants.size
            np.testing.assert_array_equal(step.ants, ants)
            for j, ant in enumerate(ants):
                row = (step.observation[ant].copy(), step.cost[j], step.terminated[j])
                self.episodes[ant][-1].append(row)
            back = ants[step.finished]
            assert (stream.returned is None) == (back.size == 0)
            if back.size:
                np.testing.assert_array_equal(stream.returned, back)
            done[back] = True
            observation = stream.set_out(step.observation)
            assert stream.returned is None
        self.done = done


def assert_plain(
    told: Told, plan: np.ndarray, seed: int, limit: float, most: int
) -> None:
    """Each slot is a single environment that is stepped and reset by hand."""
    for slot, episodes in enumerate(told.episodes):
        env = Chain(limit=limit, **SETTINGS)
        first, _ = env.reset(seed=seed + slot)
        for number, (begin, *rows) in enumerate(episodes):
            assert begin == first
            over = False
            for made, (seen, cost, terminated) in enumerate(rows):
                assert not over
                action = plan[slot, number, made] + 3
                observation, reward, reached, truncated, _ = env.step(action)
                assert (seen, cost, terminated) == (observation, -reward, reached)
                over = reached or truncated or made + 1 == most
            assert over or number == len(episodes) - 1
            assert over == (told.done[slot] or number < len(episodes) - 1)
            first, _ = env.reset()


def assert_recorded(stream: Stream, told: Told, finished: list[list[Any]]) -> None:
    """The record holds the same episodes, in the order in which they ended."""
    recorded = stream.episodes()
    assert len(recorded) == len(finished)
    seen = [recorded[number] for number in range(len(recorded))]
    ours = [
        ([float(s[0]) for s in each.observations], each.stage_costs.tolist())
        for each in seen
    ]
    theirs = [
        (
            [float(begin[0]), *(float(row[0][0]) for row in rows)],
            [float(row[1]) for row in rows],
        )
        for begin, *rows in finished
    ]
    assert sorted(ours) == sorted(theirs)
    np.testing.assert_array_equal(
        stream.outcome().costs, [each.stage_costs.sum() for each in seen]
    )


@pytest.mark.parametrize("completes", [False, True])
@pytest.mark.parametrize(("limit", "max_steps"), [(9, 9), (12, 40), (np.inf, 7)])
@pytest.mark.parametrize("name", ENVS)
def test_every_slot_makes_plain_episodes(
    name: str, limit: float, max_steps: int, completes: bool
) -> None:
    """No step lost, none made twice, and what resets a slot is no step of the ant."""
    known = None if limit == np.inf else int(limit)
    if name.startswith("foreign") and known is None:
        limit = known = max_steps  # it cannot be stopped otherwise
    stream = Stream(ENVS[name](limit), max_steps, known, completes=completes)
    for seed in (10, 31):
        plan = planned_actions(seed)
        told = Told(stream, seed, plan)
        assert_plain(told, plan, seed, limit, max_steps)
        assert told.done.all() or not completes
        outcome = stream.outcome()
        finished = [
            episode
            for slot, episodes in enumerate(told.episodes)
            for episode in episodes[: len(episodes) - (not told.done[slot])]
        ]
        assert sorted(outcome.costs) == sorted(len(each) - 1 for each in finished)
        assert outcome.n_steps == told.steps
        assert outcome.costs.size >= SLOTS
        assert_recorded(stream, told, finished)


@pytest.mark.parametrize("limit", [9, np.inf])
def test_all_ways_of_resetting_a_slot_give_the_same_bits(limit: float) -> None:
    """Where a slot can be reset between two steps, also the order in time is the same."""
    plan, results = planned_actions(3), []
    for name, make in ENVS.items():
        if not name.startswith("foreign"):
            stream = Stream(make(limit), 9, completes=False)
            told = Told(stream, 5, plan)
            results.append((stream.outcome().costs.tolist(), told.episodes, told.steps))
    assert len(results) > 4
    assert all(each == results[0] for each in results[1:])


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_slots_in_processes_of_their_own_do_the_same(mode: str) -> None:
    processes = AsyncVectorEnv(
        [lambda: Chain(**SETTINGS)] * SLOTS, autoreset_mode=AutoresetMode(mode)
    )
    plan = planned_actions()
    one = Told(Stream(processes, 8, completes=True), 5, plan)
    processes.close()
    other = Told(Stream(ENVS[mode](np.inf), 8, completes=True), 5, plan)
    assert one.episodes == other.episodes


def test_the_trial_ends_when_every_ant_has_been_back() -> None:
    """Slot 0 takes 40 steps, the others 2; they set out again 19 times."""

    def made(length: int) -> Any:
        return lambda: Corridor(length)

    env = WaitingVectorEnv([made(40), made(2), made(2)])
    for completes in (False, True):
        stream = Stream(env, 100, completes=completes)
        observation, vector_steps = stream.start(seed=0), 0
        while stream.ants.size:
            assert stream.ants.size == 3  # none ever waits
            step = stream.step(np.ones(3, dtype=np.int64))
            observation = stream.set_out(step.observation)
            vector_steps += 1
        assert observation.shape[0] == 3
        assert vector_steps == 40
        outcome = stream.outcome()
        assert np.unique(outcome.costs, return_counts=True)[1].tolist() == [40, 1]
        assert outcome.n_steps == 120


class Corridor(gym.Env):
    """A way of a fixed number of steps, each of which costs 1."""

    action_space = spaces.Discrete(2)

    def __init__(self, length: int, success: bool = False) -> None:
        self.observation_space = spaces.Box(0.0, 100.0, (1,), np.float64)
        self.length, self.success, self.resets = length, success, 0

    def _seen(self) -> np.ndarray:
        return np.array([float(self.place)])

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        self.place = 0
        self.resets += 1
        return self._seen(), {"action_mask": self._mask()}

    def _mask(self) -> np.ndarray:
        return np.array([self.place == 0, True])

    def step(self, action: int) -> Any:
        self.place += 1
        over = self.place == self.length
        infos: dict[str, Any] = {"action_mask": self._mask()}
        if over:
            infos["is_success"] = self.success
        return self._seen(), -1.0, over, False, infos


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled", "waiting"])
def test_masks_are_those_of_where_an_ant_stands(mode: str) -> None:
    makers = [lambda n=n: Corridor(n) for n in (7, 2, 3)]
    env: Any = WaitingVectorEnv(makers)
    if mode != "waiting":
        env = SyncVectorEnv(makers, autoreset_mode=mode)
    stream = Stream(env, 5, completes=False)
    observation = stream.start(seed=0)
    while stream.ants.size:
        ants, allowed = stream.ants, stream.allowed()
        assert allowed is not None
        np.testing.assert_array_equal(allowed[:, 0], observation[ants, 0] == 0.0)
        assert allowed[:, 1].all()
        step = stream.step(np.ones(ants.size, dtype=np.int64))
        after = stream.allowed_after(ants)
        assert after is not None
        if mode != "SameStep":  # final infos are told of those that have finished only
            assert not after[:, 0].any()
        observation = stream.set_out(step.observation)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled", "waiting"])
def test_success_is_that_of_each_episode(mode: str) -> None:
    makers = [lambda: Corridor(8), lambda: Corridor(3, True), lambda: Corridor(2)]
    env: Any = WaitingVectorEnv(makers)
    if mode != "waiting":
        env = SyncVectorEnv(makers, autoreset_mode=mode)
    stream = Stream(env, 8, completes=True)
    observation = stream.start(seed=0)
    while stream.ants.size:
        step = stream.step(np.ones(stream.ants.size, dtype=np.int64))
        observation = stream.set_out(step.observation)
    assert observation is not None
    outcome = stream.outcome()
    assert outcome.success is not None
    np.testing.assert_array_equal(outcome.success, outcome.costs == 3.0)
    assert (
        outcome.success.sum() == 3
    )  # the last one is completed after the first is back


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_one_slot_that_resets_itself(mode: str) -> None:
    """With autoreset in the next step nobody walks meanwhile, and the stream goes on."""

    class Two(Foreign):
        def __init__(self) -> None:
            super().__init__(mode, 5)
            self.inner = SyncVectorEnv(
                [lambda: Corridor(5), lambda: Corridor(5)], autoreset_mode=mode
            )
            self.num_envs = 2

    stream = Stream(Two(), 5, 5, completes=True)
    stream.start(seed=0)
    while stream.ants.size:
        step = stream.step(np.ones(2, dtype=np.int64))
        stream.set_out(step.observation)
    assert stream.outcome().costs.tolist() == [5.0, 5.0]
    alone = Foreign(mode, 5)
    alone.inner = SyncVectorEnv([lambda: Corridor(2)], autoreset_mode=mode)
    alone.num_envs = 1
    stream = Stream(alone, 5, 5, completes=True)
    seen = [stream.start(seed=0)]
    stream._on_first = np.ones(2, dtype=np.bool_)  # as if another were still away
    while len(seen) < 7:
        assert stream.ants.tolist() == [0]
        step = stream.step(np.ones(1, dtype=np.int64))
        seen.append(stream.set_out(step.observation))
    assert [float(each[0, 0]) for each in seen] == [0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0]


def native(mode: str, slots: int = 40, **parameters: Any) -> VectorEnv:
    return gym.make_vec(PENDULUM, num_envs=slots, autoreset_mode=mode, **parameters)


def walked(env: VectorEnv, max_steps: int, completes: bool) -> tuple[Any, ...]:
    """A trial with actions drawn anew in each step."""
    rng = np.random.default_rng(0)
    stream = Stream(env, max_steps, completes=completes)
    observation = stream.start(seed=5, record=True)
    shown = [observation.tobytes()]
    while stream.ants.size:
        step = stream.step(rng.integers(3, size=stream.ants.size))
        observation = stream.set_out(step.observation)
        shown.append(observation.tobytes())
    outcome = stream.outcome()
    return shown, outcome.costs.tobytes(), outcome.n_steps, stream.episodes(), outcome


@pytest.mark.parametrize("completes", [False, True])
@pytest.mark.parametrize("limit", [None, 12])
def test_native_modes_are_bit_identical(limit: int | None, completes: bool) -> None:
    results = []
    for mode in ("NextStep", "SameStep", "Disabled"):
        for wrap in (lambda env: env, RecordEpisodeStatistics):
            env = native(mode, max_episode_steps=limit, goal_bounds=(1.0, 4.0))
            results.append(walked(wrap(env), 60, completes))
    first = results[0]
    assert 0 < first[4].success.sum() < first[4].costs.size
    assert first[4].costs.size > 40
    for other in results[1:]:
        assert other[:3] == first[:3]
        np.testing.assert_array_equal(other[4].success, first[4].success)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_recorded_episodes_are_those_that_finished(mode: str) -> None:
    env = native(mode, max_episode_steps=None, goal_bounds=(1.0, 4.0))
    *_, episodes, outcome = walked(env, 30, True)
    assert len(episodes) == outcome.costs.size
    single = gym.make(PENDULUM, goal_bounds=(1.0, 4.0), max_episode_steps=-1)
    for number in range(len(episodes)):
        episode = episodes[number]
        assert episode.stage_costs.sum() == pytest.approx(
            outcome.costs[number], rel=1e-12
        )
        assert episode.terminated == outcome.success[number]
        single.reset(options={"state": episode.observations[0]})
        for action, seen in zip(episode.actions, episode.observations[1:], strict=True):
            observation, *_ = single.step(int(action))
            np.testing.assert_allclose(observation, seen, rtol=1e-7, atol=1e-9)


def test_equal_lengths_are_one_synchronous_trial() -> None:
    actions = np.random.default_rng(0).integers(3, size=(40, 20))
    env = native("NextStep", goal_bounds=(1e-9, 1e-9))  # nobody gets there
    stream, rollout = Stream(env, 20, completes=True), Rollout(env, 20)
    for each in (stream, rollout):
        observation = each.start(seed=1)
        while each.ants.size:
            step = each.step(actions[each.ants, each.steps])
            observation = each.set_out(step.observation)
        assert observation.shape == (40, 2)
    assert stream.outcome().costs.tobytes() == rollout.outcome().costs.tobytes()


def test_a_trial_that_is_broken_off_counts_who_has_never_been_back() -> None:
    """As the synchronous one does; who has set out again counts with what it brought."""
    env = WaitingVectorEnv([lambda: Corridor(9), lambda: Corridor(3, success=True)])
    stream = Stream(env, 20, completes=False)
    observation = stream.start(seed=0)
    for _ in range(5):
        step = stream.step(np.ones(2, dtype=np.int64))
        observation = stream.set_out(step.observation)
        if stream.steps == 2:
            assert stream.outcome().costs.tolist() == [2.0, 2.0]
            assert stream.outcome().success is None
    assert observation[:, 0].tolist() == [5.0, 2.0]
    outcome = stream.outcome()
    assert outcome.costs.tolist() == [3.0, 5.0]
    assert outcome.success is not None
    assert outcome.success.tolist() == [True, False]
    assert outcome.n_steps == 10


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("limit", [None, 50])
def test_what_cannot_be_stopped_is_refused(mode: str, limit: int | None) -> None:
    has = "no time limit" if limit is None else "a time limit of 50 steps"
    with pytest.raises(ValueError, match=f"max_steps=20 steps, got Foreign, .* {has}"):
        Stream(Foreign(mode, 50), 20, limit, completes=True)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_a_limit_that_does_not_hold_is_refused(mode: str) -> None:
    stream = Stream(Foreign(mode, np.inf, slip=1.0), 4, 4, completes=True)
    stream.start(seed=0)
    for _ in range(3):
        stream.step(np.zeros(SLOTS, dtype=np.int64))
    with pytest.raises(ValueError, match="longer one in slot 0; check the environment"):
        stream.step(np.zeros(SLOTS, dtype=np.int64))


def test_observations_of_another_shape_after_a_reset_are_refused() -> None:
    class Bent(WaitingVectorEnv):
        def reset(self, *, seed: Any = None, options: Any = None) -> Any:
            observation, infos = super().reset(seed=seed, options=options)
            return (np.hstack([observation] * 2) if options else observation), infos

    env = Bent([lambda: Corridor(2), lambda: Corridor(9)])
    stream = Stream(env, 20, completes=True)
    stream.start(seed=0)
    stream.step(np.ones(2, dtype=np.int64))
    step = stream.step(np.ones(2, dtype=np.int64))
    with pytest.raises(ValueError, match=r"reset and step, got \(2,\) and \(1,\)"):
        stream.set_out(step.observation)
