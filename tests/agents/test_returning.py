"""The colony that remembers: the algorithm in one loop, resumed, masked, growing."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from acl_gym import (
    Discrete,
    Fuzzy,
    PolicyEvaluation,
    ReturningACL,
    WaitingVectorEnv,
    evaluate_policy_cost,
)
from acl_gym.colony.starts import ENOUGH
from tests.agents.remembering import (
    J_STAR,
    assert_same,
    crisp,
    gymnasium_env,
    pendulum,
)

SETTINGS: dict[str, tuple[Callable[[], Any], dict[str, Any]]] = {
    "pendulum": (pendulum, {}),
    "crisp": (pendulum, {"partition": crisp()}),
    "cart-pole": (lambda: gymnasium_env("CartPole-v1"), {}),
    "taxi": (lambda: gymnasium_env("Taxi-v4"), {}),
    "lake": (lambda: gymnasium_env("FrozenLake-v1"), {"trust": 0.5, "mix": 0.1}),
    "small memory": (pendulum, {"memory_size": 700, "older_steps": 3}),
}
EACH = pytest.mark.parametrize("name", SETTINGS)


def make(name: str, seed: int = 3, **more: Any) -> ReturningACL:
    env, keywords = SETTINGS[name]
    return ReturningACL(env(), seed=seed, **(keywords | more))


@EACH
def test_the_same_seed_gives_the_same_bits(name: str) -> None:
    assert_same(make(name).learn(trials=4), make(name).learn(trials=4))


def test_another_seed_gives_another_run() -> None:
    one, other = (make("pendulum", seed=seed).learn(trials=2) for seed in (3, 4))
    assert one.table.shape != other.table.shape or (one.table != other.table).any()


@EACH
def test_two_parts_are_one_run_also_through_a_file(name: str, tmp_path: Path) -> None:
    whole = make(name).learn(trials=5)
    make(name).learn(trials=2).save(tmp_path / "part")
    part = ReturningACL.load(tmp_path / "part", SETTINGS[name][0]())
    assert_same(part.learn(trials=3), whole)


@EACH
def test_what_has_learned_nothing_goes_through_a_file(
    name: str, tmp_path: Path
) -> None:
    make(name).save(tmp_path / "new")
    loaded = ReturningACL.load(tmp_path / "new", SETTINGS[name][0]())
    assert_same(loaded.learn(trials=1), make(name).learn(trials=1))


@EACH
def test_a_trial_can_be_taken_back(name: str) -> None:
    colony = make(name).learn(trials=2)
    kept = colony.snapshot()
    colony.learn(trials=2)
    for _ in range(2):  # twice from the same snapshot
        colony.take_back(kept)
        assert_same(colony.learn(trials=3), make(name).learn(trials=5))


@EACH
def test_going_on_from_one_snapshot_leaves_others_alone(name: str) -> None:
    """The later one holds rows that stand behind those of the earlier one."""
    colony = make(name).learn(trials=2)
    early = colony.snapshot()
    late = colony.learn(trials=2).snapshot()
    colony.take_back(early)
    colony.epsilon = 1.0
    colony.learn(trials=3)
    colony.take_back(late)
    colony.epsilon = make(name).epsilon
    uninterrupted = make(name).learn(trials=5)
    assert colony.learn(trials=1).table.tobytes() == uninterrupted.table.tobytes()
    assert np.array_equal(colony._memory.evidence, uninterrupted._memory.evidence)


def test_a_second_call_goes_on_for_as_many_steps() -> None:
    colony = make("pendulum").learn(total_timesteps=600)
    first = colony.num_timesteps
    colony.learn(total_timesteps=600)
    assert first >= 600
    assert colony.num_timesteps >= first + 600


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_every_autoreset_mode_teaches_the_same(mode: AutoresetMode) -> None:
    """The single environments begin each trial with the same seeds."""
    made = [lambda: gym.make("CliffWalking-v1", max_episode_steps=50)] * 3
    env = SyncVectorEnv(made, autoreset_mode=mode)
    colony = ReturningACL(env, seed=0, epsilon=0.0).learn(trials=1)
    waiting = ReturningACL(WaitingVectorEnv(made), seed=0, epsilon=0.0).learn(trials=1)
    assert colony.table.tobytes() == waiting.table.tobytes()


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_what_was_seen_is_remembered_where_arrays_are_used_again(
    mode: AutoresetMode,
) -> None:
    """Some environments write each observation over the one before."""
    tables = []
    for fresh in (True, False):
        made = [lambda: gym.make("MountainCar-v0", max_episode_steps=40)] * 3
        env = SyncVectorEnv(made, copy=fresh, autoreset_mode=mode)
        tables.append(ReturningACL(env, seed=0).learn(trials=2).table.tobytes())
    assert tables[0] == tables[1]


def test_the_pendulum_is_near_the_optimum_after_ten_thousand_steps() -> None:
    """Eight seeds took 1,870 to 4,810 steps; the thesis's colony takes a million."""
    colony = ReturningACL(pendulum(), seed=0)
    evaluation = PolicyEvaluation(pendulum(100))
    colony.learn(total_timesteps=10_000, callback=evaluation)
    assert min(row["policy_cost"] for row in colony.history) < 1.25 * J_STAR


def test_the_slippery_lake_is_crossed() -> None:
    """Where luck decides, levels are means: 0.74 is the best there is."""
    colony = make("lake", trust=1.0, mix=0.0).learn(total_timesteps=8_000)
    env = gymnasium_env("FrozenLake-v1", 200)
    found = evaluate_policy_cost(colony, env, seed=1, max_steps=100)
    # Six seeds: 0.59 to 0.78; a policy that follows the latest walks has 0.05 to 0.45.
    assert found.mean_return > 0.5


def test_the_cliff_is_passed_on_the_shortest_way() -> None:
    env = gymnasium_env("CliffWalking-v1", max_episode_steps=200)
    colony = ReturningACL(env, seed=0).learn(total_timesteps=6_000)
    one = gymnasium_env("CliffWalking-v1", 1, max_episode_steps=200)
    assert evaluate_policy_cost(colony, one).mean_return == -13.0


class Corridor(gym.Env):
    """A walk of ten steps to the right; a forbidden action would pay at once."""

    observation_space, action_space = spaces.Discrete(11), spaces.Discrete(3)

    def _seen(self) -> tuple[int, dict[str, Any]]:
        return self.place, {"action_mask": np.array([True, True, False])}

    def reset(self, **kwargs: Any) -> Any:
        super().reset(**{k: v for k, v in kwargs.items() if k == "seed"})
        self.place = 0
        return self._seen()

    def step(self, action: int) -> Any:
        assert action != 2, "forbidden"
        self.place = max(0, self.place + (1 if action == 1 else -1))
        seen, infos = self._seen()
        return seen, -1.0, self.place == 10, False, infos


def test_what_is_masked_is_neither_done_nor_promised() -> None:
    env = WaitingVectorEnv([Corridor] * 3)
    colony = ReturningACL(env, seed=0, max_steps=60, discount=1.0)
    # So good that it would be taken, and count in V, wherever masks did not hold.
    colony._table[:, 2] = 1_000.0
    colony._walk_back.known[:, 2] = True
    colony.learn(trials=30)
    assert (colony.table[:, 2] == 1_000.0).all()
    way = colony.table[:10, :2]
    assert (way.argmax(axis=1) == 1).all()
    assert np.allclose(way[:, 1], -np.arange(10.0, 0.0, -1.0), atol=0.5)


class Treadmill(gym.Env):
    """Each step gives 1, and episodes never end but by their limit."""

    observation_space = spaces.Discrete(1)
    action_space = spaces.Discrete(1)

    def reset(self, **kwargs: Any) -> tuple[int, dict[str, Any]]:
        super().reset(**kwargs)
        return 0, {}

    def step(self, action: int) -> tuple[int, float, bool, bool, dict[str, Any]]:
        return 0, 1.0, False, False, {}


@pytest.mark.parametrize("mode", list(AutoresetMode))
@pytest.mark.parametrize("schedule", ["synchronous", "asynchronous"])
def test_a_time_limit_is_no_terminal_state(mode: AutoresetMode, schedule: str) -> None:
    """With a discount of a half all of it is worth 2; an end after 3 steps, 1.75."""

    def limited() -> gym.Env[Any, Any]:
        return gym.wrappers.TimeLimit(Treadmill(), 3)

    env: Any = SyncVectorEnv([limited] * 2, autoreset_mode=mode)
    if schedule == "asynchronous":
        env = WaitingVectorEnv([limited] * 2)
    keywords = {"discount": 0.5, "schedule": schedule, "optimism": 0.0, "max_steps": 3}
    colony = ReturningACL(env, seed=0, **keywords).learn(trials=40)
    assert not colony._memory.terminated.any()
    assert colony.table.ravel() == pytest.approx([2.0], abs=0.01)


@pytest.mark.parametrize("reward", [1.0, -1.0])
def test_without_discounting_levels_are_bounded_by_an_episode(reward: float) -> None:
    """What ends by a limit promises what comes after, which would add up for ever."""
    paid = gym.wrappers.TransformReward(Treadmill(), lambda _: reward)
    env = WaitingVectorEnv([lambda: gym.wrappers.TimeLimit(paid, 7)])
    colony = ReturningACL(env, seed=0, discount=1.0, max_steps=7).learn(trials=200)
    assert np.abs(colony.table).max() <= 7.0


def test_a_time_out_promises_what_the_last_state_promises() -> None:
    """Ants that are stopped after each step know the way of six."""
    env = WaitingVectorEnv([lambda: gym.make("FrozenLake-v1", is_slippery=False)] * 4)
    colony = ReturningACL(env, seed=0, steps_per_walk=4).learn(total_timesteps=4_000)
    one = WaitingVectorEnv([lambda: gym.make("FrozenLake-v1", is_slippery=False)])
    result = evaluate_policy_cost(colony, one, max_steps=100)
    assert (result.mean_return, result.lengths[0]) == (1.0, 6)


def test_the_partition_grows_with_what_is_seen() -> None:
    colony = make("cart-pole", visits_to_grow=0.1)
    begun = colony.partition
    assert begun.n_cells == 1
    colony.learn(trials=1)
    seen = colony._memory._rows["seen"][: int(colony._memory.last[-1]) + 1]
    for axis, line in enumerate(colony.partition.centres):
        assert line[0] <= seen[:, axis].min() <= seen[:, axis].max() <= line[-1]
    before = colony.partition.n_cells
    colony.learn(total_timesteps=5_000)
    assert before < colony.partition.n_cells <= colony.max_cells
    assert all(
        row["cells"] <= later["cells"]
        for row, later in zip(colony.history, colony.history[1:], strict=False)
    )


def test_the_range_that_was_taken_is_told(caplog: Any) -> None:
    with caplog.at_level("INFO", "acl_gym"):
        colony = make("cart-pole").learn(trials=1)
    told = [
        each.getMessage() for each in caplog.records if "range" in each.getMessage()
    ]
    assert told
    assert repr(colony.partition) in told[-1]


def test_the_limit_on_cells_is_kept() -> None:
    colony = make("pendulum", max_cells=200, visits_to_grow=0.1)
    assert colony.learn(total_timesteps=3_000).partition.n_cells <= 200
    few = make("pendulum", max_cells=10).learn(total_timesteps=1_000)
    assert few.partition.n_cells <= 10
    assert make("cart-pole", max_cells=100).learn(trials=2).partition.n_cells == 3**4


def test_a_partition_that_is_given_stays() -> None:
    partition = crisp()
    colony = ReturningACL(pendulum(), partition, seed=0).learn(trials=3)
    assert colony.partition is partition
    grown = ReturningACL(pendulum(), crisp(), seed=0, grows=True, visits_to_grow=0.5)
    assert grown.learn(trials=3).partition.n_cells > partition.n_cells


def test_callbacks_evaluate_a_growing_policy() -> None:
    colony = make("pendulum")
    colony.learn(trials=3, callback=PolicyEvaluation(pendulum(100)))
    assert all(row["policy_cost"] > 0 for row in colony.history)
    assert all(0.0 <= row["policy_variation"] <= 1.0 for row in colony.history)


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ({"discount": 1.5}, r"discount must lie in \[0, 1\]"),
        ({"mix": -0.1}, r"mix must lie in"),
        ({"learning_rate": 0}, r"learning_rate must lie in \(0, 1\]"),
        ({"walks_back": 0}, "walks_back must be at least 1"),
        ({"older_steps": -1}, "older_steps must be at least 0"),
        ({"steps_per_walk": 0}, "steps_per_walk must be at least 1"),
        ({"memory_size": 10**9}, "memory_size must be at most"),
        ({"max_cells": 0}, "max_cells must be at least 1"),
        ({"optimism": np.nan}, "optimism must"),
    ],
)
def test_bad_parameters_are_refused(keywords: dict[str, Any], words: str) -> None:
    with pytest.raises((TypeError, ValueError), match=words):
        ReturningACL(pendulum(), **keywords)


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("memory_first", lambda a: a + 10**6),
        ("memory_last", lambda a: -a),
        ("memory_action", lambda a: a + 200),
        ("memory_reward", lambda a: a * np.nan),
        ("memory_seen", lambda a: a[1:]),
        ("memory_seen", lambda a: a[:, :1]),
        ("memory_seen", lambda a: a * np.inf),
        ("memory_terminated", lambda a: a[1:]),
        ("known", lambda a: a[1:]),
        ("growth_turn", lambda a: a - 10),
    ],
)
def test_memories_from_strangers_are_checked(
    name: str, change: Callable[[Any], Any], tmp_path: Path, monkeypatch: Any
) -> None:
    colony = make("pendulum").learn(trials=1)
    arrays = colony._arrays()
    with np.errstate(invalid="ignore"):
        arrays[name] = change(arrays[name])
    monkeypatch.setattr(colony, "_arrays", lambda: arrays)
    colony.save(tmp_path / "strange")
    with pytest.raises(ValueError, match="is damaged"):
        ReturningACL.load(tmp_path / "strange")


def test_cells_from_strangers_are_checked(tmp_path: Path, monkeypatch: Any) -> None:
    colony = make("lake").learn(trials=1)
    arrays = colony._arrays()
    for change in (
        {"memory_index": arrays["memory_index"] + 10**6},
        {"memory_degree": arrays["memory_degree"] * 5},
    ):
        monkeypatch.setattr(colony, "_arrays", lambda change=change: arrays | change)
        colony.save(tmp_path / "strange")
        with pytest.raises(ValueError, match="is damaged"):
            ReturningACL.load(tmp_path / "strange")


def test_discrete_states_are_cells_from_the_start() -> None:
    assert isinstance(make("taxi").partition, Discrete)
    assert make("taxi").mix == 0.0
    assert isinstance(make("pendulum").partition, Fuzzy)
    assert make("pendulum").mix > 0.0


class Broken(gym.Env):
    """After some steps it shows what is no number."""

    observation_space = spaces.Box(-np.inf, np.inf, (2,))
    action_space = spaces.Discrete(2)

    def reset(self, **kwargs: Any) -> Any:
        self.steps = 0
        return np.zeros(2, np.float32), {}

    def step(self, action: int) -> Any:
        self.steps += 1
        shown = np.array([np.inf if self.steps > 5 else 1.0, 0.0], np.float32)
        return shown, -1.0, self.steps > 5, False, {}


def test_observations_that_are_no_numbers_are_refused() -> None:
    colony = ReturningACL(WaitingVectorEnv([Broken] * 2), seed=0)
    with pytest.raises(ValueError, match="states must be finite, got"):
        colony.learn(trials=2)


class Given(gym.Env):
    """Six steps, of which the reward and what is seen are given."""

    observation_space = spaces.Box(-np.inf, np.inf, (1,), np.float64)
    action_space = spaces.Discrete(2)

    def __init__(self, reward: Any = 1.0, scale: float = 1.0) -> None:
        self.reward, self.scale, self.steps = reward, scale, 0

    def reset(self, **kwargs: Any) -> tuple[Any, dict[str, Any]]:
        super().reset(**kwargs)
        self.steps = 0
        return np.array([self.scale]), {}

    def step(self, action: int) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        self.steps += 1
        seen = np.array([self.scale * (-1) ** self.steps])
        return seen, self.reward, self.steps == 6, False, {}


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ({"reward": "a"}, r"step must return a number as reward, .*'a'.* in slot 0"),
        ({"reward": np.ones(2)}, r"step must return a number as reward, .* in slot 0"),
        ({"reward": 10**400}, r"step must return a number as reward, .* in slot 0"),
        ({"reward": -1e306}, r"levels and rewards must be numbers that can be added"),
        ({"scale": 1.7e308}, r"observations must have ranges that can be divided"),
        ({"scale": 1e-310}, r"observations must have ranges that can be divided"),
    ],
)
def test_what_cannot_be_reckoned_with_is_refused(
    keywords: dict[str, Any], words: str
) -> None:
    env = WaitingVectorEnv([lambda: Given(**keywords)] * 2)
    with pytest.raises(ValueError, match=words) as caught:
        ReturningACL(env, seed=0).learn(trials=2)
    assert caught.value.__cause__ is None


def test_what_is_forgotten_is_gone_and_what_was_learned_stays() -> None:
    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=5)
    colony = ReturningACL(env, seed=0).learn(total_timesteps=3_000)
    before, remembered = colony.table.copy(), colony.remembered_steps
    colony.forget(1_000)
    assert 0 < colony.remembered_steps < 1_000 < remembered
    colony.forget()
    assert colony.remembered_steps == 0
    assert not colony._memory.evidence.any()  # forgetting undoes adding exactly
    np.testing.assert_array_equal(colony.table, before)
    colony.learn(total_timesteps=600)
    assert 0 < colony.remembered_steps <= 900  # whole trials
    assert colony.num_timesteps > 3_000


def test_starts_are_compared_once_something_is_remembered_again() -> None:
    """Enough starts have been seen when the colony forgets all states."""
    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=ENOUGH)
    colony = ReturningACL(env, seed=0).learn(trials=1)
    colony.forget()
    colony.learn(trials=1)  # nothing to compare with
    assert colony._starts.wide is None
    colony.learn(trials=1)
    assert colony._starts.wide is not None


@pytest.mark.parametrize(("keep", "error"), [(-1, ValueError), (1.5, TypeError)])
def test_no_other_number_is_kept(keep: Any, error: type[Exception]) -> None:
    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=2)
    with pytest.raises(error, match="keep must be"):
        ReturningACL(env, seed=0).forget(keep)
