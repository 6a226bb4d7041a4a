"""Q-learning against (3.44), on a chain with known values, and with bad input."""

from __future__ import annotations

import math
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acl_gym import Crisp, Fuzzy, QLearning
from acl_gym.colony.greedy import ALL
from acl_gym.colony.temporal_difference import update_values
from tests.agents import reference_colony as reference
from tests.agents.reference_colony import Chain, chains
from tests.colony.test_pheromone import degrees

MODES = ("NextStep", "SameStep", "Disabled")
ROW = Crisp([np.arange(6.0)])
# Undiscounted: to go right from cell q costs the 5 - q steps to the goal; to go left
# one step more, and then the way from the cell on the left.
VALUES = np.array(
    [[-(1 + 5 - max(q - 1, 0)), -(5 - q)] for q in range(5)] + [[0, 0]], dtype=float
)


def masks(
    rng: np.random.Generator, slots: int, n_actions: int, given: bool
) -> np.ndarray:
    """One allowed action a slot or more; an empty array if none are given."""
    allowed = rng.random((slots, n_actions)) < 0.5
    allowed[np.arange(slots), rng.integers(n_actions, size=slots)] = True
    return allowed if given else ALL


@st.composite
def transitions(draw: st.DrawFn) -> dict[str, Any]:
    """The arguments of the kernel: several slots at once, any number of cells."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1), label="seed"))
    k = draw(st.sampled_from([1, 2, 4]), label="k")
    n_cells = k + draw(st.integers(0, 4), label="more cells")
    n_actions = draw(st.integers(1, 4), label="actions")
    slots = draw(st.integers(1, 6), label="slots")
    cells = [rng.permutation(n_cells)[:k] for _ in range(2 * slots)]
    return {
        "values": rng.normal(scale=10.0, size=(n_cells, n_actions)),
        "index": np.array(cells[:slots], dtype=np.int32),
        "degree": degrees(rng, slots, k),
        "actions": rng.integers(n_actions, size=slots),
        "costs": rng.exponential(size=slots),
        "terminated": rng.random(slots) < 0.3,
        "next_index": np.array(cells[slots:], dtype=np.int32),
        "next_degree": degrees(rng, slots, k),
        "next_allowed": masks(
            rng, slots, n_actions, draw(st.booleans(), label="masks")
        ),
        "learning_rate": draw(st.sampled_from([0.3, 1.0]) | st.floats(0.001, 1.0)),
        "discount": draw(st.sampled_from([0.0, 0.98, 1.0]) | st.floats(0.0, 1.0)),
    }


@given(transitions())
@settings(max_examples=50)
def test_updates_are_those_of_the_slots_one_after_another(case: dict[str, Any]) -> None:
    expected = case["values"].copy()
    n_cells = len(expected)
    for j, action in enumerate(case["actions"]):
        next_beta = reference.dense(
            case["next_index"][j], case["next_degree"][j], n_cells
        )
        reference.q_update(
            expected,
            reference.dense(case["index"][j], case["degree"][j], n_cells),
            action,
            -case["costs"][j],
            None if case["terminated"][j] else next_beta,
            case["learning_rate"],
            case["discount"],
            case["next_allowed"][j] if case["next_allowed"].size else None,
        )
    plain = case["values"].copy()
    update_values(*case.values())
    np.testing.assert_allclose(case["values"], expected, rtol=1e-10, atol=1e-10)
    update_values.py_func(*{**case, "values": plain}.values())
    np.testing.assert_allclose(case["values"], plain, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("grid", [ROW, Fuzzy([np.arange(6.0)])], ids=["crisp", "fuzzy"])
def test_it_finds_the_values_of_the_chain(grid: Crisp | Fuzzy) -> None:
    """Deterministic, learning rate 1, undiscounted: the values are exact."""
    agent = QLearning(
        chains(8), grid, learning_rate=1.0, discount=1.0, epsilon=0.5, seed=0
    )
    agent.learn(trials=60)
    np.testing.assert_array_equal(agent.table, VALUES)
    assert agent.policy.best_actions()[:-1].tolist() == [1] * 5
    assert agent.history[-1]["policy_variation"] == 0.0


def test_discounted_values_are_geometric_sums() -> None:
    agent = QLearning(
        chains(8), ROW, learning_rate=1.0, discount=0.9, epsilon=0.5, seed=0
    ).learn(trials=60)
    np.testing.assert_allclose(agent.table, -(1 - 0.9**-VALUES) / (1 - 0.9), rtol=1e-12)


@pytest.mark.parametrize(
    ("limit", "max_steps"), [(3, 50), (math.inf, 3)], ids=["truncated", "timed out"]
)
@pytest.mark.parametrize("mode", MODES)
def test_an_episode_that_is_cut_off_is_no_end(
    mode: str, limit: float, max_steps: int
) -> None:
    """Only the goal is worth 0; the values are those of the endless chain.

    In the modes that reset slots this takes the last observation, not the next first.
    """
    agent = QLearning(
        chains(8, mode, limit=limit),
        ROW,
        learning_rate=1.0,
        discount=1.0,
        epsilon=0.5,
        max_steps=max_steps,
        seed=0,
    )
    agent.learn(trials=150)
    np.testing.assert_array_equal(agent.table, VALUES)


def test_autoreset_modes_do_not_matter() -> None:
    tables = []
    for mode in MODES:
        env = chains(8, mode, slip=0.3, limit=7)
        tables.append(QLearning(env, ROW, seed=4).learn(trials=20).table)
    assert tables[0].tobytes() == tables[1].tobytes() == tables[2].tobytes()
    assert (tables[0][:-1] < 0).all()


@pytest.mark.parametrize("kind", [Crisp, Fuzzy])
def test_a_trial_is_that_of_plain_loops(kind: type) -> None:
    """Two trials, five slots, the same random numbers, single environments."""
    goal = {"goal_bounds": (1.2, 6.0)}
    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=5, **goal)
    grid = kind.from_box(env.single_observation_space, (4, 5), circular=[0])
    parameters = {"learning_rate": 0.4, "discount": 0.9}
    agent = QLearning(env, grid, **parameters, epsilon=0.3, max_steps=25, seed=8)
    agent.learn(trials=2)

    turn = 2 * math.pi
    axes = [(turn * np.arange(4) / 4, turn), (np.linspace(-9, 9, 5), None)]
    rng = np.random.default_rng(np.random.SeedSequence(8).spawn(3)[0])
    envs = [gym.make("acl_gym/Pendulum-v0", **goal) for _ in range(5)]
    values = np.zeros((20, 3))
    for _ in range(2):
        states, _ = env.reset(seed=int(rng.integers(2**31)))
        betas = {}
        for slot, state in enumerate(states):
            first, _ = envs[slot].reset(options={"state": state})
            betas[slot] = reference.fuzzify(first, axes, kind is Crisp)
        for _ in range(25):
            numbers = rng.random((2, len(betas)))
            steps = []
            for (slot, beta), coin, choice in zip(betas.items(), *numbers, strict=True):
                action = reference.chosen(
                    "epsilon_greedy", values, beta, 1.0, 0.3, coin, choice
                )
                steps.append((slot, action, *envs[slot].step(action)[:3]))
            for slot, action, observation, reward, reached in steps:
                following = reference.fuzzify(observation, axes, kind is Crisp)
                reference.q_update(
                    values,
                    betas[slot],
                    action,
                    reward,
                    None if reached else following,
                    **parameters,
                )
                betas[slot] = following
                if reached:
                    del betas[slot]
            if not betas:
                break
    np.testing.assert_allclose(agent.table, values, rtol=1e-9, atol=1e-12)
    assert 0 < sum(row["ants_success_rate"] for row in agent.history) < 2


BAD: list[tuple[str, Any, type[Exception]]] = [
    *[("learning_rate", value, ValueError) for value in (0, -0.1, 1.1, math.nan)],
    *[("discount", value, ValueError) for value in (-0.1, 1.1, math.nan, math.inf)],
    *[("epsilon", value, ValueError) for value in (-0.1, 1.1, math.nan)],
    *[("max_steps", value, ValueError) for value in (0, -1)],
    *[("max_steps", value, TypeError) for value in (2.0, "2", True)],
    *[("seed", value, TypeError) for value in (1.5, "1", True)],
    ("seed", -1, ValueError),
    *[
        (name, value, TypeError)
        for name in ("learning_rate", "discount", "epsilon")
        for value in ("0.1", None, True, 1j)
    ],
]


@pytest.mark.parametrize(("name", "value", "error"), BAD)
def test_bad_parameters(name: str, value: Any, error: type[Exception]) -> None:
    with pytest.raises(error, match=name):
        QLearning(chains(2), ROW, **{name: value})


def test_bad_environments() -> None:
    with pytest.raises(TypeError, match="WaitingVectorEnv"):
        QLearning(Chain(), ROW)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="Discrete"):
        QLearning(gym.make_vec("Pendulum-v1", num_envs=2), ROW)
    with pytest.raises(ValueError, match="finite, got nan in slot 0"):
        QLearning(chains(2, reward=math.nan), ROW).learn(trials=1)


@pytest.mark.parametrize(
    "table", [np.ones((6, 3)), np.ones(12), np.full((6, 2), np.nan), np.ones((1, 2))]
)
def test_a_bad_table_is_refused_and_changes_nothing(table: np.ndarray) -> None:
    agent = QLearning(chains(2), ROW)
    with pytest.raises(ValueError, match="table must"):
        agent.set_table(table)
    assert (agent.table == 0).all()
    agent.set_table(VALUES)
    np.testing.assert_array_equal(agent.table, VALUES)


def test_rewards_of_either_sign_are_welcome() -> None:
    """Unlike a colony, which deposits 1 / J."""
    agent = QLearning(
        chains(8, reward=2.0),
        ROW,
        learning_rate=1.0,
        discount=0.5,
        epsilon=1.0,
        max_steps=30,
        seed=1,
    ).learn(trials=80)
    # Staying away from the goal is worth 2 / (1 - 0.5) from every cell but the last.
    np.testing.assert_allclose(agent.table[:4], 4.0, rtol=1e-6)
    np.testing.assert_allclose(agent.table[4], [4.0, 2.0], rtol=1e-6)


def test_values_that_overflow_are_refused() -> None:
    env = chains(6, reward=-1e308)
    agent = QLearning(env, ROW, learning_rate=1.0, discount=1.0, max_steps=9, seed=0)
    with pytest.raises(ValueError, match=r"must stay finite, .* in trial"):
        agent.learn(trials=20)
