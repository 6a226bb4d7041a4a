"""What users hand in reaches no kernel unchecked, and is never silently wrong."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from acl_gym import ACL, Discrete, Fuzzy, QLearning, SoftPolicy, evaluate_policy_cost
from acl_gym.colony.costs import Quadratic
from acl_gym.envs.grid_search.env import GridSearch1DVectorEnv
from acl_gym.envs.grid_search.system import GridSearch1D
from acl_gym.policies import TablePolicy
from tests.fuzz import liars, values


def colony(env: Any = None, **settings: Any) -> ACL:
    env = liars.Liar(False, AutoresetMode.DISABLED) if env is None else env
    return ACL(env, Discrete(7), seed=0, max_steps=9, **settings)


@pytest.mark.parametrize("kind", [ACL, QLearning])
@pytest.mark.parametrize("deed", ["set_env", "learn"])
def test_nothing_is_exchanged_in_the_middle_of_a_trial(kind: Any, deed: str) -> None:
    env = liars.Liar(False, AutoresetMode.DISABLED)
    agent = kind(env, Discrete(7), seed=0, max_steps=9)
    other = liars.Liar(False, AutoresetMode.DISABLED)
    env.mischief = lambda: (
        agent.set_env(other) if deed == "set_env" else agent.learn(trials=1)
    )
    with pytest.raises(RuntimeError, match=rf"{deed} must not be called while a trial"):
        agent.learn(trials=1)
    env.mischief = None
    agent.set_env(other)  # the trial is over, though it was interrupted
    assert agent.learn(trials=1).trials == 1


def test_a_callback_may_exchange_the_environment() -> None:
    agent, other = colony(), liars.Liar(False, AutoresetMode.DISABLED)
    agent.learn(trials=2, callback=lambda *_: agent.set_env(other))
    assert agent.env is other


@pytest.mark.parametrize("what", ["observations", "rewards", "terminated", "truncated"])
@pytest.mark.parametrize("form", ["first row only", "a row more", "complex", "None"])
def test_an_environment_that_returns_too_little_is_refused(
    what: str, form: str
) -> None:
    env = liars.Liar(False, AutoresetMode.NEXT_STEP, what, values.WRONG[form], when=2)
    words = r"real|whole" if (what, form) == ("observations", "complex") else what
    with pytest.raises(ValueError, match=words):
        colony(env).learn(trials=1)


@pytest.mark.parametrize("form", values.SAME)
@pytest.mark.parametrize("boxes", [True, False])
def test_other_forms_of_the_same_numbers_teach_the_same(form: str, boxes: bool) -> None:
    partition: Any = Fuzzy([[-1, 0, 1], [-1, 1]]) if boxes else Discrete(7)
    tables = []
    for change in (values.SAME["as it is"], values.SAME[form]):
        for what in ("observations", "rewards", "terminated"):
            env = liars.Liar(boxes, AutoresetMode.SAME_STEP, what, change)
            agent = ACL(env, partition, seed=0, max_steps=9).learn(trials=1)
            tables.append(agent.table.copy())
    for table in tables[1:]:
        np.testing.assert_array_equal(table, tables[0])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda actions: actions + 1.9, r"integers as actions, got dtype float64"),
        (lambda actions: actions * np.nan, r"integers as actions"),
        (lambda actions: actions + 98, r"actions in 0\.\.2, got 99 in slot 0"),
        (lambda actions: -actions, r"actions in 0\.\.2, got -1 in slot 0"),
        (lambda actions: actions[:1], r"one action for each of the 4 .* shape \(1,\)"),
        (lambda actions: actions[0], r"one action for each of the 4 .* shape \(\)"),
    ],
)
def test_actions_of_a_model_are_checked(change: Any, message: str) -> None:
    env = liars.Liar(True, AutoresetMode.DISABLED)
    with pytest.raises(ValueError, match=message):
        evaluate_policy_cost(liars.Model(change), env, max_steps=3)


def test_predict_must_return_a_pair() -> None:
    class Alone:
        def predict(self, observation: Any, deterministic: bool = True) -> Any:
            return np.zeros(len(observation), int)

    env = liars.Liar(True, AutoresetMode.DISABLED)
    with pytest.raises(ValueError, match=r"must return \(actions, state\)"):
        evaluate_policy_cost(Alone(), env, max_steps=3)


class _Two(gym.Env[Any, Any]):
    observation_space = spaces.Dict(
        {"a": spaces.Box(-1, 1, (2,)), "n": spaces.Discrete(9)}
    )
    action_space = spaces.Discrete(3)

    def reset(self, *, seed: Any = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self.t = 0
        return {"a": np.zeros(2, np.float32), "n": 0}, {}

    def step(self, action: Any) -> Any:
        self.t += 1
        return {"a": np.zeros(2, np.float32), "n": self.t}, -1.0, self.t >= 5, False, {}


class _Counts:
    """A model of Dict observations that notes what it sees."""

    def __init__(self) -> None:
        self.seen: list[list[int]] = []

    def predict(self, observation: Any, deterministic: bool = True) -> Any:
        self.seen.append(observation["n"].tolist())
        return np.ones(len(observation["n"]), int), None


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_dict_observations_are_evaluated(mode: AutoresetMode) -> None:
    env, model = SyncVectorEnv([_Two] * 2, autoreset_mode=mode), _Counts()
    assert evaluate_policy_cost(model, env, max_steps=9).costs.tolist() == [5.0, 5.0]
    assert model.seen == [[t, t] for t in range(5)]
    with pytest.raises(ValueError, match=r"observations must be arrays .*FlattenObs"):
        ACL(env, Discrete(7))


class _Count(gym.Env[Any, Any]):
    """Observes 1, 2, 3, 4, 5 and ends."""

    observation_space = spaces.Box(0, 100, (1,), np.float64)
    action_space = spaces.Discrete(2)

    def reset(self, *, seed: Any = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self.t = 0
        return np.zeros(1), {}

    def step(self, action: Any) -> Any:
        self.t += 1
        return np.array([float(self.t)]), -1.0, self.t >= 5, False, {}


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_a_buffer_that_is_reused_is_copied(mode: AutoresetMode) -> None:
    env = SyncVectorEnv([_Count] * 3, copy=False, autoreset_mode=mode)
    cost = Quadratic(goal=(0.0,), state_weight=(1.0,))
    found = evaluate_policy_cost(liars.Model(), env, max_steps=10, cost=cost)
    assert found.costs.tolist() == [55.0] * 3  # 1 + 4 + 9 + 16 + 25


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda actions: actions[:1],
            r"Rule.choose must return an integer for each of",
        ),
        (lambda actions: actions * 1.5, r"Rule.choose must return an integer for each"),
        (lambda actions: actions + 98, r"Rule.choose must return allowed actions in"),
        (lambda actions: -1 - actions, r"Rule.choose must return allowed actions in"),
    ],
)
def test_a_rule_of_ones_own_must_choose_actions(change: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        colony(update=liars.Rule(choice=change)).learn(trials=1)


def test_a_rule_may_spoil_its_own_cells_only() -> None:
    def scribble(index: Any) -> None:
        index[:] = 2**31 - 1

    rule, index = liars.Rule(), np.full((1, 1), 2**31 - 1, np.int32)
    pair = index, np.ones((1, 1)), np.zeros(1, int)
    with pytest.raises(ValueError, match=r"local_update needs a cell of the table"):
        rule.local_update(colony().pheromone, *pair, 0.1)
    spoiled = colony(update=liars.Rule(scribble=scribble)).learn(trials=2)
    np.testing.assert_array_equal(spoiled.table, colony().learn(trials=2).table)


@pytest.mark.parametrize("value", [np.nan, np.inf, 0.0, -1.0])
def test_levels_must_stay_positive(value: float) -> None:
    def spoil(levels: Any) -> None:
        levels[2, 1] = value

    with pytest.raises(ValueError, match=r"levels must stay > 0 .* action 1 in cell 2"):
        colony(update=liars.Rule(levels=spoil)).learn(trials=1)


@pytest.mark.parametrize(
    "name", ["levels", "stale", "probabilities", "n_actions", "tau0"]
)
def test_what_kernels_rely_on_cannot_be_replaced(name: str) -> None:
    agent = colony()
    with pytest.raises(AttributeError, match=rf"{name} of a Pheromone is fixed"):
        setattr(agent.pheromone, name, np.ones((1, 1)))
    for owner, other in (
        (agent, "partition"),
        (agent, "pheromone"),
        (agent.policy, "table"),
    ):
        with pytest.raises(AttributeError, match=rf"{other} of a \w+ is fixed"):
            setattr(owner, other, None)


@pytest.mark.parametrize(
    "deposit", [lambda costs: np.ones(1), lambda costs: costs * 1j]
)
def test_deposits_are_one_number_for_each_ant(deposit: Any) -> None:
    with pytest.raises(ValueError, match=r"deposit must return a finite number > 0"):
        colony(deposit=deposit).learn(trials=1)


def test_tables_must_have_a_row_for_each_cell() -> None:
    for make in (
        lambda: SoftPolicy(Discrete(7), np.ones((6, 3))),
        lambda: TablePolicy(Discrete(7), np.ones((6, 3))),
    ):
        with pytest.raises(ValueError, match=r"must have shape \(7, n_actions\)"):
            make()
    table = np.ones((7, 3))
    table[2, 1] = np.nan
    with pytest.raises(ValueError, match=r"table must not hold NaN.* in cell 2"):
        TablePolicy(Discrete(7), table)


def test_an_absurd_number_of_actions_is_refused_before_memory_is_reserved() -> None:
    with pytest.raises(ValueError, match=r"must fit into [\d,]+ bytes.* fewer cells"):
        ACL(None, Discrete(7), n_actions=10**12)


def test_an_environment_that_loses_slots_is_refused() -> None:
    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=4)
    with pytest.raises(AttributeError, match="num_envs"):
        env.unwrapped.num_envs = 2


@pytest.mark.parametrize("value", [None, 1, "yes", np.ones(2)])
def test_the_progress_bar_is_a_switch(value: Any) -> None:
    with pytest.raises(TypeError, match=r"progress_bar must be True or False"):
        colony().learn(trials=1, progress_bar=value)


class _Lost(GridSearch1D):
    """A system of a user's own that starts where there is no state."""

    def sample_states(self, rng: np.random.Generator, count: int) -> Any:
        return np.full((1, count), 1e9)


class _LostEnv(GridSearch1DVectorEnv):
    system_type = _Lost


def test_states_that_a_system_draws_are_checked() -> None:
    with pytest.raises(ValueError, match=r"state"):
        _LostEnv(3).reset(seed=0)
