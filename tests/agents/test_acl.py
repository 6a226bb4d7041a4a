"""The colony as a whole: against a slow colony, on a chain, and on any environment."""

from __future__ import annotations

import math
import warnings
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers.vector import TransformReward

from acl_gym import ACL, Crisp, Fuzzy
from acl_gym.agents.acl import PheromoneBoundWarning
from acl_gym.colony.selection import RULES
from tests.agents import reference_colony as reference
from tests.agents.reference_colony import Chain, chains

MODES = ("NextStep", "SameStep", "Disabled")
PENDULUM = "acl_gym/Pendulum-v0"
ROW = Crisp([np.arange(6.0)])


def pendulums(num_envs: int, **parameters: Any) -> gym.vector.VectorEnv:
    return gym.make_vec(PENDULUM, num_envs=num_envs, **parameters)


def pendulum_grid(env: gym.vector.VectorEnv, kind: type = Fuzzy) -> Crisp | Fuzzy:
    return kind.from_box(env.single_observation_space, (6, 7), circular=[0])


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("kind", [Crisp, Fuzzy])
@pytest.mark.parametrize("native", [True, False], ids=["native", "sync"])
def test_trials_are_those_of_the_slow_colony(
    rule: str, kind: type, native: bool
) -> None:
    """The same random numbers through Algorithm 4.2 in plain Python, three trials.

    The goal is wide, so that some ants arrive and some time out.
    """
    goal = {"goal_bounds": (0.8, 4.0)}
    mode = None if native else "sync"
    env = gym.make_vec(PENDULUM, num_envs=7, vectorization_mode=mode, **goal)
    parameters: dict[str, Any] = {"alpha": 2.5, "epsilon": 0.2, "tau0": 1e-6}
    colony = ACL(
        env,
        pendulum_grid(env, kind),
        **parameters,
        local_decay=0.05,
        global_decay=0.3,
        selection=rule,
        max_steps=40,
        seed=11,
    )
    turn = 2 * math.pi
    axes = [(turn * np.arange(6) / 6, turn), (-9 + 3.0 * np.arange(7), None)]
    slow = reference.Colony(
        [gym.make(PENDULUM, **goal) for _ in range(7)],
        lambda state: reference.fuzzify(state, axes, kind is Crisp),
        6 * 7,
        np.random.default_rng(np.random.SeedSequence(11).spawn(3)[0]),
        **parameters,
        gamma=0.05,
        rho=0.3,
        rule=rule,
        max_steps=40,
    )
    arrived = 0.0
    for _ in range(3):
        colony.learn(trials=1)
        states, _ = env.reset(seed=int(slow.rng.integers(2**31)))
        starts = [
            one.reset(options={"state": state})[0]
            for one, state in zip(slow.envs, states, strict=True)
        ]
        costs, success = slow.trial(starts)
        np.testing.assert_allclose(colony.table, slow.tau, rtol=1e-9)
        assert colony.history[-1]["ants_cost"] == pytest.approx(costs.mean(), rel=1e-9)
        assert colony.history[-1]["ants_success_rate"] == success.mean()
        arrived += success.mean()
    assert 0 < arrived < 3
    assert (colony.table > 1e-3).any()


@pytest.mark.parametrize("slip", [0.0, 0.3])
@pytest.mark.parametrize("rule", RULES)
def test_it_learns_a_chain_and_autoreset_modes_do_not_matter(
    rule: str, slip: float
) -> None:
    """Slots have generators of their own, so each mode sees the same episodes."""
    tables, histories = [], []
    for mode in MODES:
        colony = ACL(
            chains(12, mode, slip=slip, limit=40),
            ROW,
            tau0=1e-3,
            epsilon=0.2,
            selection=rule,
            max_steps=50,
            seed=2,
        ).learn(trials=40)
        assert colony.policy.best_actions()[:-1].tolist() == [1] * 5
        tables.append(colony.table.copy())
        histories.append([{**row, "seconds": 0.0} for row in colony.history])
    assert tables[0].tobytes() == tables[1].tobytes() == tables[2].tobytes()
    assert histories[0] == histories[1] == histories[2]


@pytest.mark.parametrize("rule", RULES)
def test_a_fuzzy_colony_whose_states_are_centres_is_a_crisp_one(rule: str) -> None:
    colonies = [
        ACL(chains(8), grid, tau0=1e-3, selection=rule, max_steps=30, seed=5)
        for grid in (ROW, Fuzzy([np.arange(6.0)]))
    ]
    for colony in colonies:
        colony.learn(trials=15)
    crisp, fuzzy = colonies
    np.testing.assert_array_equal(crisp.table, fuzzy.table)
    assert (crisp.table != 1e-3).sum() > 5


def test_pheromone_of_the_goal_is_never_touched() -> None:
    """An ant in the goal neither chooses nor decays: the last cell has no pair."""
    colony = ACL(chains(8), ROW, tau0=1e-3, max_steps=30, seed=5).learn(trials=9)
    assert (colony.table[-1] == 1e-3).all()
    assert (colony.table[:-1] != 1e-3).any(axis=1).all()


@pytest.mark.parametrize("kind", [Crisp, Fuzzy])
@pytest.mark.parametrize("global_decay", [0.1, 1.0])
def test_levels_stay_above_tau0_for_a_whole_run(
    kind: type, global_decay: float
) -> None:
    """Proposition 4.3, with tau0 at its bound: then there is no warning either."""
    env = pendulums(20)
    tau0 = global_decay / (60 * env.unwrapped.system.max_stage_cost)
    lowest: list[float] = []
    colony = ACL(
        env,
        pendulum_grid(env, kind),
        tau0=tau0,
        local_decay=0.1,
        global_decay=global_decay,
        max_steps=60,
        seed=0,
    )
    colony.learn(trials=20, callback=lambda agent, _: lowest.append(agent.table.min()))
    assert min(lowest) >= tau0 * (1 - 1e-12)
    assert colony.table.max() > 2 * tau0


def test_a_tau0_above_the_bound_warns_with_both_figures() -> None:
    env = pendulums(3)
    highest = 300 * env.unwrapped.system.max_stage_cost
    with pytest.warns(PheromoneBoundWarning, match="tau0 = 0.01 exceeds") as record:
        colony = ACL(env, pendulum_grid(env), tau0=0.01, seed=0)
    assert f"{1 / highest:.3g}" in str(record[0].message)
    assert record[0].filename == __file__
    with pytest.warns(PheromoneBoundWarning):
        colony.set_env(pendulums(2))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        colony.set_env(gym.make_vec(PENDULUM, 2, vectorization_mode="sync"))
        ACL(env, pendulum_grid(env), tau0=0.01, global_decay=0.0)


@pytest.mark.parametrize("global_decay", [0.001, 0.07, 0.1, 1.0])
@pytest.mark.parametrize("max_steps", [1, 77, 300, 1000])
def test_the_remedy_of_the_warning_works(global_decay: float, max_steps: int) -> None:
    env = pendulums(3)
    parameters: dict[str, Any] = {"global_decay": global_decay, "max_steps": max_steps}
    with pytest.warns(PheromoneBoundWarning) as record:
        ACL(env, pendulum_grid(env), tau0=0.9, **parameters)
    remedy = str(record[0].message).split("a tau0 of at most ")[1].split(" ")[0]
    ACL(env, pendulum_grid(env), tau0=float(remedy), **parameters)


def test_zero_decays_leave_the_pheromone() -> None:
    colony = ACL(chains(5), ROW, local_decay=0.0, global_decay=0.0, max_steps=9, seed=1)
    colony.set_table(np.arange(1.0, 13.0).reshape(6, 2))
    colony.learn(trials=3)
    np.testing.assert_array_equal(colony.table, np.arange(1.0, 13.0).reshape(6, 2))


def test_positive_rewards_are_refused_with_ant_cost_and_remedy() -> None:
    """CartPole's native vector environment runs, but its rewards are no costs."""
    env = gym.make_vec("CartPole-v1", num_envs=4)
    grid = Fuzzy([np.linspace(-2, 2, 3)] * 4)
    colony = ACL(env, grid, max_steps=50, seed=0)
    message = r"must be > 0 and finite.* got -\d+ for ant 0\. .*pass deposit=\"return\""
    with pytest.raises(ValueError, match=message):
        colony.learn(trials=2)
    assert colony.trials == 0
    assert colony.history == []
    shifted = TransformReward(env, lambda reward: reward - 3.0)
    ACL(shifted, grid, tau0=1e-4, max_steps=50, seed=0).learn(trials=2)
    env.close()


def test_rewards_that_are_not_numbers_are_refused() -> None:
    colony = ACL(chains(3, reward=math.nan), ROW, max_steps=9)
    with pytest.raises(ValueError, match="finite, got nan in slot 0"):
        colony.learn(trials=1)


def test_actions_may_start_anywhere() -> None:
    """The same colony, whether the two actions are called 0, 1 or 5, 6."""
    colonies = [
        ACL(chains(8, first_action=first), ROW, tau0=1e-3, max_steps=30, seed=5)
        for first in (0, 5, -3)
    ]
    for colony in colonies:
        colony.learn(trials=20)
        np.testing.assert_array_equal(colony.table, colonies[0].table)
    state = np.array([[0.0], [3.0]])
    for colony, right in zip(colonies, (1, 6, -2), strict=True):
        assert colony.predict(state)[0].tolist() == [right, right]
        for deterministic in (True, False):
            action, _ = colony.predict(state[0], deterministic=deterministic)
            assert colony.env is not None
            assert colony.env.single_action_space.contains(action)


BAD: list[tuple[str, Any, type[Exception]]] = [
    *[("tau0", value, ValueError) for value in (0, -1e-4, math.nan, math.inf)],
    *[("local_decay", value, ValueError) for value in (-0.1, 1.0, 1.5, math.nan)],
    *[("global_decay", value, ValueError) for value in (-0.1, 1.1, math.nan)],
    *[("alpha", value, ValueError) for value in (0, -3, math.nan, math.inf)],
    *[("epsilon", value, ValueError) for value in (-0.01, 1.01, math.nan)],
    *[("max_steps", value, ValueError) for value in (0, -5)],
    *[("max_steps", value, TypeError) for value in (3.0, "3", True, math.nan)],
    *[("seed", value, TypeError) for value in (1.5, "1", True, math.nan)],
    ("seed", -1, ValueError),
    *[("tabu", value, TypeError) for value in ("no", 1, None)],
    *[("cost", value, TypeError) for value in ("steps", 3)],
    ("deposit", "reward", ValueError),
    ("deposit", None, TypeError),
    *[
        ("selection", value, ValueError)
        for value in ("greedy", "", None, 3, "Boltzmann")
    ],
    *[
        (name, value, TypeError)
        for name in ("tau0", "local_decay", "global_decay", "alpha", "epsilon")
        for value in ("0.1", None, True, 1j, [0.1])
    ],
    *[(name, 10**400, ValueError) for name in ("tau0", "alpha", "epsilon")],
]


@pytest.mark.parametrize(
    ("name", "value", "error"), BAD, ids=lambda part: str(part)[:12]
)
def test_bad_parameters(name: str, value: Any, error: type[Exception]) -> None:
    with pytest.raises(error, match=name):
        ACL(chains(2), ROW, **{name: value})


@pytest.mark.parametrize(
    ("n_actions", "error"),
    [(0, ValueError), (-2, ValueError), (2.0, TypeError), ("2", TypeError)],
)
def test_bad_number_of_actions(n_actions: Any, error: type[Exception]) -> None:
    with pytest.raises(error, match="n_actions"):
        ACL(None, ROW, n_actions=n_actions)


def test_without_environment_the_number_of_actions_is_asked_for() -> None:
    with pytest.raises(ValueError, match="n_actions"):
        ACL(None, ROW)
    with pytest.raises(ValueError, match="3 actions as the table has, got 2"):
        ACL(chains(2), ROW, n_actions=3)


def test_bad_environments_and_partitions() -> None:
    with pytest.raises(TypeError, match="VectorEnv"):
        ACL(Chain(), ROW)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="Discrete"):
        ACL(gym.make_vec("Pendulum-v1", num_envs=2), ROW)
    with pytest.raises(TypeError, match=r"Partition such as Crisp .*got list; build"):
        ACL(chains(2), [np.arange(6.0)])  # type: ignore[arg-type]
    wrong = Fuzzy([np.arange(3.0), np.arange(3.0)])
    with pytest.raises(ValueError, match=r"Box of shape \(2,\), got"):
        ACL(chains(2), wrong)


@pytest.mark.parametrize(
    "table",
    [
        np.ones((6, 3)),
        np.ones(12),
        np.zeros((6, 2)),
        np.full((6, 2), -1.0),
        np.full((6, 2), np.nan),
        np.full((6, 2), np.inf),
    ],
)
def test_a_bad_table_is_refused_and_changes_nothing(table: np.ndarray) -> None:
    colony = ACL(chains(2), ROW, tau0=0.5)
    with pytest.raises(ValueError, match="table must"):
        colony.set_table(table)
    assert (colony.table == 0.5).all()


def test_a_new_table_is_what_the_ants_choose_by() -> None:
    """Also after a run, when the probabilities of the old levels are remembered."""
    colony = ACL(
        chains(6), ROW, selection="boltzmann", global_decay=0.0, local_decay=0.0, seed=0
    )
    left, right = np.full((2, 6, 2), 1e-9)
    left[:, 0] = right[:, 1] = 1e9
    colony.set_table(right)
    colony.learn(trials=2)
    assert colony.rollout.terminated.all()
    colony.set_table(left)
    colony.learn(trials=2)
    assert not colony.rollout.terminated.any()


def test_the_live_table_cannot_be_written_to() -> None:
    colony = ACL(chains(6), ROW, tau0=0.5, seed=0)
    table = colony.table
    with pytest.raises(ValueError, match="read-only"):
        table[:] = 1.0
    colony.learn(trials=2)
    assert (table != 0.5).any()  # it follows learning


def test_an_exponent_changed_later_counts() -> None:
    """What `save` writes and `load` would build must be what the run obeyed."""
    changed = ACL(chains(6, slip=0.9), ROW, max_steps=10, tau0=1e-3, seed=3)
    changed.alpha = 9.0
    expected = ACL(chains(6, slip=0.9), ROW, max_steps=10, tau0=1e-3, seed=3, alpha=9.0)
    for colony in (changed, expected):
        colony.learn(trials=5)
    np.testing.assert_array_equal(changed.table, expected.table)


@pytest.mark.parametrize(
    ("name", "value"),
    [("max_steps", 20), ("tau0", 0.1), ("selection", "boltzmann"), ("heuristic", 1)],
)
def test_what_is_fixed_cannot_be_changed_later(name: str, value: Any) -> None:
    colony = ACL(chains(2), ROW, seed=3)
    before = getattr(colony, name)
    with pytest.raises(AttributeError, match=f"make a new agent with {name}={value!r}"):
        setattr(colony, name, value)
    assert getattr(colony, name) == before
