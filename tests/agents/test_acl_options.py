"""Options of the colony: costs, deposits, schedules, tabu lists, action masks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces

from acl_gym import ACL, Crisp, Fuzzy, PolicyEvaluation, evaluate_policy_cost
from acl_gym.colony.costs import Overshoot, SettlingTime, StageCosts, Steps
from acl_gym.colony.deposits import InverseCost, Rank
from acl_gym.colony.episodes import Episode
from acl_gym.colony.schedules import Exponential, Harmonic, Linear
from acl_gym.evaluation.rollout import Rollout
from tests.agents.reference_colony import Chain, chains

ROW = Crisp([np.arange(6.0)])
PENDULUM = "acl_gym/Pendulum-v0"


def colony(env: gym.vector.VectorEnv | None = None, **parameters: Any) -> ACL:
    parameters = {"tau0": 1e-3, "max_steps": 30, "seed": 3, **parameters}
    return ACL(chains(8) if env is None else env, ROW, **parameters)


def test_the_sum_of_stage_costs_as_an_object_changes_nothing() -> None:
    plain, as_object = colony(), colony(cost=StageCosts())
    for agent in (plain, as_object):
        agent.learn(trials=10)
    np.testing.assert_array_equal(plain.table, as_object.table)
    timeless = [{**row, "seconds": 0.0} for row in plain.history]
    assert timeless == [{**row, "seconds": 0.0} for row in as_object.history]


def test_a_cost_replaces_the_rewards() -> None:
    """Rewards that say nothing, and a cost that looks at the whole way."""

    def way(solution: Episode) -> float:
        assert len(solution.observations) == len(solution.actions) + 1
        assert solution.terminated == (solution.observations[-1, 0] == 5.0)
        return 1.0 + float(np.abs(np.diff(solution.observations[:, 0])).sum())

    agent = colony(chains(8, reward=0.0), cost=way).learn(trials=40)
    states = np.arange(5.0)[:, None]
    assert agent.predict(states)[0].tolist() == [1] * 5
    result = evaluate_policy_cost(agent, chains(50), seed=1, cost=way)
    np.testing.assert_array_equal(result.costs, 1.0 + result.lengths)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_steps_are_counted_in_every_autoreset_mode(mode: str) -> None:
    rows = colony(chains(8, mode), cost=Steps()).learn(trials=5).history
    plain = colony(chains(8, mode)).learn(trials=5).history
    assert [row["ants_cost"] for row in rows] == [row["ants_cost"] for row in plain]


def test_episodes_end_where_the_ants_do() -> None:
    for mode in ("NextStep", "SameStep", "Disabled"):
        rollout = Rollout(chains(6, mode), max_steps=12)
        rng = np.random.default_rng(0)
        rollout.start(seed=5, record=True)
        while rollout.ants.size:
            rollout.step(rng.integers(2, size=rollout.ants.size))
        episodes = rollout.episodes()
        np.testing.assert_array_equal(episodes.lengths, rollout.length)
        for ant in range(6):
            episode = episodes[ant]
            assert (episode.observations[-1, 0] == 5.0) == episode.terminated
            moves = np.diff(episode.observations[:, 0])
            wall = episode.observations[:-1, 0] == 0.0
            expected = np.where(episode.actions == 1, 1.0, np.where(wall, 0.0, -1.0))
            np.testing.assert_array_equal(moves, expected)
            assert episode.stage_costs.sum() == rollout.cost[ant]


def test_nothing_was_recorded() -> None:
    rollout = Rollout(chains(2), max_steps=3)
    rollout.start()
    with pytest.raises(ValueError, match=r"call start\(record=True\)"):
        rollout.episodes()


def test_the_pendulum_learns_to_settle_soon() -> None:
    """A cost that no stage reward expresses: settle soon, and do not overshoot."""
    env = gym.make_vec(PENDULUM, num_envs=250)
    grid = Fuzzy.from_box(env.single_observation_space, (40, 41), circular=[0])
    turn = 2 * np.pi
    cost = SettlingTime(0, np.pi, 0.3, sampling_time=0.1, period=turn)
    cost = cost + 0.5 * Overshoot(0, np.pi, period=turn) + 0.1
    agent = ACL(env, grid, tau0=1e-3, cost=cost, seed=0)
    before = evaluate_policy_cost(agent, env, cost=cost).cost
    evaluation = PolicyEvaluation(env, every=10)
    agent.learn(trials=50, callback=evaluation)
    costs = [row["policy_cost"] for row in agent.history if "policy_cost" in row]
    assert before > 20.0
    assert min(costs) < 3.0
    again = evaluate_policy_cost(agent, env, cost=cost)
    assert again.cost == costs[-1]  # evaluation is by the agent's own cost


@pytest.mark.parametrize("deposit", ["rank", Rank(2.0), InverseCost(offset=40.0)])
def test_other_deposits_learn_from_returns_of_any_sign(deposit: Any) -> None:
    env = chains(8)
    env = gym.wrappers.vector.TransformReward(env, lambda reward: reward + 0.5)
    if isinstance(deposit, InverseCost):
        env = gym.wrappers.vector.TransformReward(env, lambda reward: reward - 0.75)
    agent = colony(env, deposit=deposit).learn(trials=60)
    assert agent.predict(np.arange(5.0)[:, None])[0].tolist() == [1] * 5


def test_the_return_is_a_deposit_where_it_is_never_negative() -> None:
    """The goal alone is rewarded, by 1: the deposit tells arrival from none."""

    class Rewarding(Chain):
        def step(self, action: int) -> tuple[Any, float, bool, bool, dict[str, Any]]:
            observation, _, reached, cut, info = super().step(action)
            return observation, float(reached), reached, cut, info

    env = gym.vector.SyncVectorEnv([Rewarding] * 8)
    with pytest.raises(ValueError, match='pass deposit="return"'):
        colony(env, max_steps=8).learn(trials=5)
    agent = colony(env, max_steps=8, deposit="return").learn(trials=60)
    assert agent.predict(np.arange(5.0)[:, None])[0].tolist() == [1] * 5
    assert agent.table.min() >= agent.tau0 * (1 - 1e-12)


def test_schedules_follow_the_trials() -> None:
    seen = []
    agent = colony(alpha=Linear(1.0, 3.0, 4), epsilon=Harmonic(0.5, 2))
    agent.learn(trials=6, callback=lambda agent, _: seen.append(agent.pheromone.alpha))
    assert seen == [1.0, 1.5, 2.0, 2.5, 3.0, 3.0]


def test_a_schedule_in_two_parts_is_that_in_one(tmp_path: Path) -> None:
    parameters = {
        "alpha": Linear(1.0, 3.0, 8),
        "epsilon": Exponential(0.5, 0.8, end=0.05),
        "cost": Steps() + 1.0,
        "deposit": InverseCost(0.5),
        "tabu": True,
    }
    whole = colony(**parameters).learn(trials=10)
    path = colony(**parameters).learn(trials=4).save(tmp_path / "colony")
    parts = ACL.load(path, chains(8)).learn(trials=6)
    np.testing.assert_array_equal(whole.table, parts.table)
    assert parts.parameters() == whole.parameters()
    states = np.arange(5.0)[:, None].repeat(20, axis=0)
    np.testing.assert_array_equal(
        *(agent.predict(states, deterministic=False)[0] for agent in (whole, parts))
    )


def test_functions_are_missed_only_when_they_are_needed(tmp_path: Path) -> None:
    agent = colony(
        cost=lambda solution: float(len(solution.actions)), epsilon=lambda trial: 0.1
    ).learn(trials=30)
    restored = ACL.load(agent.save(tmp_path / "colony"), chains(8))
    states = np.arange(5.0)[:, None]
    np.testing.assert_array_equal(restored.predict(states)[0], agent.predict(states)[0])
    with pytest.raises(ValueError, match=r"set agent\.epsilon to it"):
        restored.learn(trials=1)
    restored.epsilon = 0.1
    with pytest.raises(ValueError, match=r"set agent\.cost to it"):
        restored.learn(trials=1)
    restored.cost = Steps()
    assert restored.learn(trials=1).trials == 31


def test_a_schedule_out_of_range_is_found_in_its_trial() -> None:
    agent = colony(epsilon=Linear(0.5, 1.5, 4))
    with pytest.raises(ValueError, match=r"epsilon in trial 3 must lie in \[0, 1\]"):
        agent.learn(trials=9)
    assert agent.trials == 3


def test_with_a_tabu_list_no_pair_is_chosen_twice_before_all_were() -> None:
    """Two actions: each ant alternates in every cell, whatever the pheromone says."""
    agent = colony(chains(8, slip=0.5), tabu=True, max_steps=20)
    agent.pheromone.set_levels(np.tile([1.0, 1e-9], (6, 1)))
    agent.learn(trials=1)
    solutions = agent._solutions
    assert solutions is not None
    (block,) = solutions.blocks()
    rows = np.split(np.arange(block.ends[-1]), block.ends[:-1])
    assert len(rows) == 8
    for own in rows:
        taken: dict[int, list[int]] = {}
        for cell, action in zip(block.index[own, 0], block.action[own], strict=True):
            taken.setdefault(int(cell), []).append(int(action))
        for actions in taken.values():
            for first, second in zip(actions[::2], actions[1::2], strict=False):
                assert {first, second} == {0, 1}


def test_a_tabu_list_needs_one_cell_a_state() -> None:
    with pytest.raises(ValueError, match=r"tabu needs .* one cell per state"):
        ACL(chains(2), Fuzzy([np.arange(6.0)]), tabu=True)


class Masked(Chain):
    """In even cells only action 1 is allowed; the info says so."""

    def _info(self) -> dict[str, Any]:
        return {"action_mask": np.array([self.cell % 2, 1], dtype=np.int8)}

    def reset(self, **keywords: Any) -> tuple[Any, dict[str, Any]]:
        observation, _ = super().reset(**keywords)
        return observation, self._info()

    def step(self, action: int) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        assert action == 1 or self.cell % 2, "a forbidden action was taken"
        observation, reward, reached, cut, _ = super().step(action)
        return observation, reward, reached, cut, self._info()


@pytest.mark.parametrize("rule", ["boltzmann", "epsilon_greedy", "max_boltzmann"])
@pytest.mark.parametrize("tabu", [False, True])
def test_ants_choose_from_what_the_environment_allows(rule: str, tabu: bool) -> None:
    # Idle slots of a foreign environment walk on as dummies, so let it not end.
    env = gym.vector.SyncVectorEnv([lambda: Masked(200)] * 6, autoreset_mode="Disabled")
    grid = Crisp([np.arange(200.0)])
    agent = ACL(env, grid, tau0=1e-3, selection=rule, tabu=tabu, max_steps=40, seed=1)
    agent.learn(trials=3)
    forbidden = agent.table[::2, 0]
    assert (forbidden == agent.tau0).all()
    best = np.asarray(agent.predict(np.arange(0.0, 200.0, 2)[:, None])[0])
    masks = np.tile([0, 1], (100, 1))
    allowed, _ = agent.predict(np.arange(0.0, 200.0, 2)[:, None], action_masks=masks)
    assert allowed.tolist() == [1] * 100
    assert (best != 1).any()  # where nobody has been, ties are broken at random
    result = evaluate_policy_cost(agent, env, seed=2, max_steps=20)
    assert (result.lengths > 0).all()


def test_masks_are_held_to_their_shape() -> None:
    class Wrong(Masked):
        def _info(self) -> dict[str, Any]:
            return {"action_mask": np.ones(3, dtype=np.int8)}

    with pytest.raises(ValueError, match=r"action_mask'\] must have shape \(2, 2\)"):
        colony(gym.vector.SyncVectorEnv([Wrong] * 2)).learn(trials=1)

    class Nothing(Masked):
        def _info(self) -> dict[str, Any]:
            return {"action_mask": np.zeros(2, dtype=np.int8)}

    with pytest.raises(ValueError, match="an allowed action, got none in slot 0"):
        colony(gym.vector.SyncVectorEnv([Nothing] * 2)).learn(trials=1)
    agent = colony()
    for masks in ([1, 1, 1], [0, 0], [[1, 0], [0, 1]]):
        with pytest.raises(ValueError, match=r"action_masks must have shape \(1, 2\)"):
            agent.predict(np.array([0.0]), action_masks=masks)


def test_the_time_limit_of_the_environment_is_t() -> None:
    env = gym.make_vec("CartPole-v1", num_envs=2)
    grid = Fuzzy([np.linspace(-2, 2, 3)] * 4)
    assert ACL(env, grid).max_steps == 500
    assert ACL(env, grid, max_steps=7).max_steps == 7
    assert ACL(chains(2), ROW).max_steps == 300
    assert ACL(None, ROW, n_actions=2).max_steps == 300
    taxis = gym.vector.SyncVectorEnv([lambda: gym.make("Taxi-v4")] * 2)
    assert ACL(taxis).max_steps == 200
    limited = gym.make_vec(PENDULUM, num_envs=2, max_episode_steps=120)
    pendulum_grid = Fuzzy.from_box(spaces.Box(0.0, 1.0, (2,), np.float64), 3)
    assert ACL(limited, pendulum_grid).max_steps == 120
    env.close()


@pytest.mark.parametrize("mode", ["sync", "async"])
def test_the_limit_of_the_caller_goes_before_that_of_the_id(mode: str) -> None:
    """Which is 100 for the lake."""
    for given, steps in ((40, 40), (None, 100)):
        more = {} if given is None else {"max_episode_steps": given}
        env = gym.make_vec("FrozenLake-v1", num_envs=2, vectorization_mode=mode, **more)
        assert ACL(env, deposit="return").max_steps == steps
        env.close()
