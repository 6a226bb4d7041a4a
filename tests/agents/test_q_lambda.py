"""Watkins's Q(lambda) against (3.45)-(3.46), by hand and by full tables."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acl_gym import Crisp, Fuzzy, QLearning
from acl_gym.colony import greedy
from acl_gym.colony import traces as traces_module
from acl_gym.colony.greedy import ALL
from acl_gym.colony.temporal_difference import update_values
from acl_gym.colony.traces import TRACES, Traces, update_traced
from acl_gym.planning.value_iteration import value_iteration
from tests.agents import reference_colony as reference
from tests.agents.reference_colony import chains
from tests.agents.test_q_learning import ROW, VALUES, masks
from tests.colony.test_pheromone import degrees
from tests.planning.chains import Table, corridor, model, vector

KINDS = pytest.mark.parametrize("traces", TRACES)
WALL: Table = {0: {0: [(1.0, 0, -1.0, False)]}, 1: {0: [(1.0, 1, 0.0, True)]}}
"""One cell that cannot be left, one action."""


# --- the kernel ----------------------------------------------------------------


@st.composite
def walks(draw: st.DrawFn) -> dict[str, Any]:
    """Several slots, several steps; slots leave one after the other."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1), label="seed"))
    return {
        "rng": rng,
        "k": draw(st.sampled_from([1, 2, 4]), label="k"),
        "more": draw(st.integers(0, 3), label="more cells"),
        "n_actions": draw(st.integers(1, 3), label="actions"),
        "slots": draw(st.integers(1, 4), label="slots"),
        "steps": draw(st.integers(1, 9), label="steps"),
        "masked": draw(st.booleans(), label="masks"),
        "learning_rate": draw(st.sampled_from([0.3, 1.0]) | st.floats(0.001, 1.0)),
        "discount": draw(st.sampled_from([0.0, 0.98, 1.0]) | st.floats(0.0, 1.0)),
        "trace_decay": draw(st.sampled_from([0.0, 0.9, 1.0]) | st.floats(0.0, 1.0)),
        "accumulate": draw(st.booleans(), label="accumulate"),
    }


def follow(
    update: Any, greedy_of: Any, case: dict[str, Any]
) -> tuple[np.ndarray, np.ndarray]:
    """Values by `update` and by the reference, after the same walks."""
    rng = np.random.default_rng(case["rng"].integers(2**32))
    k, slots, n_actions = case["k"], case["slots"], case["n_actions"]
    n_cells = k + case["more"]
    values = rng.normal(size=(n_cells, n_actions))
    expected = values.copy()
    full = np.zeros((slots, n_cells, n_actions))
    memory = Traces(slots, values.size, case["steps"] * k)
    ants = np.arange(slots)
    for _ in range(case["steps"]):
        m = ants.size
        index, next_index = (
            np.array([rng.permutation(n_cells)[:k] for _ in ants], dtype=np.int32)
            for _ in range(2)
        )
        degree, next_degree = degrees(rng, m, k), degrees(rng, m, k)
        actions = rng.integers(n_actions, size=m)
        costs, terminated = rng.exponential(size=m), rng.random(m) < 0.2
        allowed, next_allowed = (
            masks(rng, m, n_actions, case["masked"]) for _ in range(2)
        )
        if case["masked"]:
            allowed[np.arange(m), actions] = True
        betas = [
            [
                reference.dense(i, d, n_cells)
                for i, d in zip(cells, weights, strict=True)
            ]
            for cells, weights in ((index, degree), (next_index, next_degree))
        ]
        # All have chosen before any learns.
        greedy_of(values, index, degree, actions, allowed, memory.greedy)
        for j, u in enumerate(actions):
            offered = [expected[:, v] @ betas[0][j] for v in range(n_actions)]
            if case["masked"]:
                offered = [v for v, a in zip(offered, allowed[j], strict=True) if a]
            close = expected[:, u] @ betas[0][j] - max(offered)
            assert memory.greedy[j] == (close >= -1e-12)
        for j, u in enumerate(actions):
            reference.q_lambda_update(
                expected,
                full[ants[j]],
                betas[0][j],
                u,
                -costs[j],
                None if terminated[j] else betas[1][j],
                bool(memory.greedy[j]),
                case["learning_rate"],
                case["discount"],
                case["trace_decay"],
                case["accumulate"],
                next_allowed[j] if case["masked"] else None,
            )
        update(
            values,
            index,
            degree,
            actions,
            costs,
            terminated,
            next_index,
            next_degree,
            next_allowed,
            case["learning_rate"],
            case["discount"],
            case["discount"] * case["trace_decay"],
            case["accumulate"],
            0.0,
            ants,
            *memory.with_room(k),
        )
        stays = ~terminated
        stays[rng.random(m) < 0.1] = False
        ants = ants[stays]
        if not ants.size:
            break
    assert not memory.with_room(0)[-1].any()  # the marks are wiped
    return values, expected


@given(walks())
@settings(max_examples=60)
def test_updates_are_those_of_full_tables(case: dict[str, Any]) -> None:
    update, mark = update_traced, greedy.mark_greedy
    state = case["rng"].bit_generator.state
    values, expected = follow(update, mark, case)
    np.testing.assert_allclose(values, expected, rtol=1e-9, atol=1e-9)
    case["rng"].bit_generator.state = state
    plain, _ = follow(update.py_func, mark.py_func, case)
    np.testing.assert_allclose(values, plain, rtol=1e-12, atol=1e-12)


@given(st.integers(0, 2**32 - 1), st.integers(1, 6), st.sampled_from([1, 2, 4]))
@settings(max_examples=25)
def test_traces_that_fade_at_once_are_no_traces(seed: int, slots: int, k: int) -> None:
    """lambda = 0, to the last bit: the fast path is the same method."""
    rng = np.random.default_rng(seed)
    one, other = np.tile(rng.normal(size=(7, 3)), (2, 1, 1))
    memory = Traces(slots, one.size, 5 * k)
    for _ in range(5):
        cells = [rng.permutation(7)[:k] for _ in range(2 * slots)]
        index, next_index = np.array(cells, dtype=np.int32).reshape(2, slots, k)
        step = (
            index,
            degrees(rng, slots, k),
            rng.integers(3, size=slots),
            rng.exponential(size=slots),
            rng.random(slots) < 0.3,
            next_index,
            degrees(rng, slots, k),
            ALL,
            0.3,
            0.98,
        )
        memory.greedy[:] = True
        update_values(one, *step)
        update_traced(
            other, *step, 0.0, False, 1e-4, np.arange(slots), *memory.with_room(k)
        )
    assert one.tobytes() == other.tobytes()


def test_traces_below_the_cutoff_are_dropped() -> None:
    """Eleven cells one after another, each trace a tenth of the next."""
    values = np.zeros((12, 1))
    memory = Traces(1, 12, 11)
    memory.greedy[:] = True
    for cell in range(11):
        state, following = (
            np.array([[cell]], np.int32),
            np.array([[cell + 1]], np.int32),
        )
        one, action = np.ones((1, 1)), np.zeros(1, dtype=np.int64)
        update_traced(
            *(values, state, one, action, np.ones(1), np.zeros(1, dtype=np.bool_)),
            *(following, one, ALL, 0.5, 1.0, 0.1, False, 1e-4, np.zeros(1, np.int64)),
            *memory.with_room(1),
        )
    _, pair, trace, count, _ = memory.with_room(0)
    # 1, 0.1, 0.01, 0.001; the next has come to 1e-4, give or take a rounding.
    assert count[0] in (4, 5)
    assert pair[0, : count[0]].tolist() == list(range(11))[-count[0] :]
    np.testing.assert_allclose(trace[0, : count[0]][::-1][:4], 0.1 ** np.arange(4))


# --- the agent -----------------------------------------------------------------


@KINDS
def test_an_episode_by_hand(traces: str) -> None:
    """Two steps from cell 0 of three, to the goal; alpha 0.5, gamma 0.9, lambda 0.8.

    Step 1: delta = -1 + 0.9 * 0 - 0 = -1. Q(0) = 0.5 * -1 * 1 = -0.5.
    Step 2: e(0) = 0.9 * 0.8 = 0.72, e(1) = 1, delta = -1 - 0 = -1.
    Q(0) = -0.5 - 0.5 * 0.72 = -0.86, Q(1) = -0.5.
    """
    agent = QLearning(
        vector(corridor(3), 1, start=0),
        Crisp([np.arange(3.0)]),
        learning_rate=0.5,
        discount=0.9,
        epsilon=0.0,
        trace_decay=0.8,
        traces=traces,
        seed=0,
    ).learn(trials=1)
    np.testing.assert_allclose(agent.table[:, 0], [-0.86, -0.5, 0.0], rtol=1e-15)
    # The next episode begins without traces: delta = -1 + 0.9 * -0.5 + 0.86 = -0.59,
    # Q(0) = -0.86 - 0.295 = -1.155; delta = -1 + 0.5 = -0.5, Q(1) = -0.75,
    # Q(0) = -1.155 - 0.5 * 0.72 * 0.5 = -1.335.
    agent.learn(trials=1)
    np.testing.assert_allclose(agent.table[:, 0], [-1.335, -0.75, 0.0], rtol=1e-15)


@pytest.mark.parametrize(("traces", "value"), [("replacing", -2), ("accumulating", -3)])
def test_standing_still(traces: str, value: float) -> None:
    """Against a wall for two steps, one action, alpha = gamma = lambda = 1.

    delta = -1 both times. A replacing trace stays 1: Q = -1 - 1. An accumulating one
    is 1 and then 2: Q = -1 - 2, twice as far as the error went.
    """
    agent = QLearning(
        vector(WALL, 1, start=0),
        Crisp([np.arange(2.0)]),
        learning_rate=1.0,
        discount=1.0,
        trace_decay=1.0,
        traces=traces,
        max_steps=2,
        seed=0,
    ).learn(trials=1)
    assert agent.table[0, 0] == value


def test_an_action_that_is_not_greedy_cuts_the_trace() -> None:
    """From cell 0 action 1 jumps to cell 2; values say that action 0 is better.

    epsilon = 1 makes actions random. The trace of the first step reaches the second
    only if the second was greedy, so that Q of the first tells which it was.
    """
    seen = set()
    for seed in range(20):
        agent = QLearning(
            vector(corridor(4, jump=2), 1, start=0),
            Crisp([np.arange(4.0)]),
            learning_rate=0.5,
            discount=1.0,
            epsilon=1.0,
            trace_decay=1.0,
            max_steps=2,
            seed=seed,
        )
        # In cell 1, action 1 (stay) looks worse than action 0 (on).
        agent.set_table([[0, 0], [0, -5], [0, 0], [0, 0]])
        agent.learn(trials=1)
        table = agent.table
        if table[0, 0] == 0:
            continue  # jumped
        if table[1, 0] != 0:  # went on, greedily: -0.5, and -0.5 through the trace
            assert table[0].tolist() == [-1.0, 0.0]
            seen.add("greedy")
        else:  # stayed: the trace was cut
            assert table[0].tolist() == [-0.5, 0.0]
            assert table[1].tolist() == [0.0, -5 + 0.5 * (-1 + 0 + 5)]
            seen.add("cut")
    assert seen == {"greedy", "cut"}


@KINDS
@pytest.mark.parametrize("grid", [ROW, Fuzzy([np.arange(6.0)])], ids=["crisp", "fuzzy"])
def test_it_finds_the_values_of_the_chain(traces: str, grid: Any) -> None:
    """Accumulating traces need a smaller rate at the wall."""
    agent = QLearning(
        chains(8),
        grid,
        learning_rate=1.0 if traces == "replacing" else 0.3,
        discount=1.0,
        epsilon=0.5,
        trace_decay=0.7,
        traces=traces,
        seed=0,
    ).learn(trials=200)
    np.testing.assert_allclose(agent.table, VALUES, atol=1e-9)


def test_traces_carry_a_reward_back_in_one_episode() -> None:
    """With lambda = 1 the first episode prices the whole way, without only its end."""
    costs = {}
    for trace_decay in (0.0, 1.0):
        agent = QLearning(
            vector(corridor(11), 1, start=0),
            Crisp([np.arange(11.0)]),
            learning_rate=1.0,
            discount=1.0,
            epsilon=0.0,
            trace_decay=trace_decay,
            seed=0,
        ).learn(trials=1)
        costs[trace_decay] = agent.table[:, 0].tolist()
    assert costs[0.0] == [-1.0] * 10 + [0.0]
    assert costs[1.0] == [float(q - 10) for q in range(11)]


@KINDS
@pytest.mark.parametrize("kind", [Crisp, Fuzzy])
def test_a_trial_is_that_of_plain_loops(
    kind: type, traces: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two trials, five slots, the same random numbers, single environments."""
    monkeypatch.setattr(traces_module, "TRACE_CUTOFF", 0.0)
    goal = {"goal_bounds": (1.2, 6.0)}
    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=5, **goal)
    grid = kind.from_box(env.single_observation_space, (4, 5), circular=[0])
    parameters = {"learning_rate": 0.2, "discount": 0.95, "trace_decay": 0.9}
    agent = QLearning(
        env, grid, **parameters, traces=traces, epsilon=0.3, max_steps=25, seed=8
    ).learn(trials=2)

    turn = 2 * math.pi
    axes = [(turn * np.arange(4) / 4, turn), (np.linspace(-9, 9, 5), None)]
    rng = np.random.default_rng(np.random.SeedSequence(8).spawn(3)[0])
    envs = [gym.make("acl_gym/Pendulum-v0", **goal) for _ in range(5)]
    values, cuts = np.zeros((20, 3)), 0
    for _ in range(2):
        states, _ = env.reset(seed=int(rng.integers(2**31)))
        trace = np.zeros((5, 20, 3))
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
                greedy = action in reference.maximisers(values, beta)
                steps.append((slot, action, greedy, *envs[slot].step(action)[:3]))
                cuts += not greedy
            for slot, action, greedy, observation, reward, reached in steps:
                following = reference.fuzzify(observation, axes, kind is Crisp)
                reference.q_lambda_update(
                    values,
                    trace[slot],
                    betas[slot],
                    action,
                    reward,
                    None if reached else following,
                    greedy,
                    **parameters,
                    accumulate=traces == "accumulating",
                )
                betas[slot] = following
                if reached:
                    del betas[slot]
            if not betas:
                break
    assert cuts > 5
    np.testing.assert_allclose(agent.table, values, rtol=1e-8, atol=1e-10)


def on_chain(**parameters: Any) -> QLearning:
    keywords = {"trace_decay": 0.9, "max_steps": 20, "seed": 3, **parameters}
    return QLearning(chains(4, slip=0.2), Fuzzy([np.arange(0.0, 6.0, 0.5)]), **keywords)


@KINDS
def test_a_loaded_agent_learns_on_as_if_nothing_had_happened(
    traces: str, tmp_path: Path
) -> None:
    whole, first = (on_chain(traces=traces) for _ in range(2))
    whole.learn(trials=30)
    first.learn(trials=12).save(tmp_path / "agent")
    second = QLearning.load(tmp_path / "agent", env=on_chain().env)
    assert second.parameters() == whole.parameters()
    assert (second.trace_decay, second.traces) == (0.9, traces)
    assert second.learn(trials=18).table.tobytes() == whole.table.tobytes()


def test_another_number_of_slots_and_no_traces_any_more() -> None:
    agent = on_chain().learn(trials=2)
    agent.set_env(chains(9))
    agent.learn(trials=2)
    agent.trace_decay = 0.0
    plain = on_chain(trace_decay=0.0)
    plain.set_env(chains(9))
    plain.set_table(agent.table)
    plain.rng.bit_generator.state = agent.rng.bit_generator.state
    assert (
        agent.learn(trials=2).table.tobytes() == plain.learn(trials=2).table.tobytes()
    )


@pytest.mark.parametrize("value", [-0.1, 1.1, math.nan])
def test_bad_trace_decay(value: float) -> None:
    with pytest.raises(ValueError, match="trace_decay"):
        QLearning(chains(2), ROW, trace_decay=value)


def test_bad_traces() -> None:
    with pytest.raises(ValueError, match="traces must be one of 'replacing'"):
        QLearning(chains(2), ROW, traces="dutch")
    with pytest.raises(AttributeError, match="make a new agent with traces="):
        on_chain().traces = "accumulating"


# --- with and without traces, against dynamic programming ----------------------


@pytest.mark.parametrize("trace_decay", [0.0, 0.6])
@pytest.mark.parametrize("discount", [1.0, 0.9])
def test_deterministic_values_are_those_of_value_iteration(
    trace_decay: float, discount: float
) -> None:
    table = corridor(7, jump=4)
    exact = value_iteration(model(table), discount=discount)
    agent = QLearning(
        vector(table, 6),
        Crisp([np.arange(7.0)]),
        learning_rate=1.0,
        discount=discount,
        epsilon=0.5,
        trace_decay=trace_decay,
        seed=0,
    ).learn(trials=150)
    np.testing.assert_allclose(agent.table, exact.action_values, rtol=1e-12)
    if discount == 1:
        assert agent.table.tobytes() == exact.action_values.tobytes()


@pytest.mark.parametrize("trace_decay", [0.0, 0.8])
def test_moves_that_fail_with_a_falling_rate(trace_decay: float) -> None:
    """V(q) = -(6 - q) / 0.7: each cell takes 1 / 0.7 steps on average."""
    agent = QLearning(
        vector(corridor(7, success=0.7), 10),
        Crisp([np.arange(7.0)]),
        discount=1.0,
        trace_decay=trace_decay,
        seed=0,
    )
    for trial in range(250):
        agent.learning_rate = 1 / (1 + 0.2 * trial)
        agent.learn(trials=1)
    np.testing.assert_allclose(agent.table[:, 0], -(6 - np.arange(7)) / 0.7, rtol=0.1)


@pytest.mark.parametrize("traces", TRACES)
def test_memory_that_grows_changes_nothing(
    traces: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From room for one trace on, to the last bit; and none is made beforehand."""
    whole = on_chain(traces=traces).learn(trials=5)
    monkeypatch.setattr(traces_module, "FIRST_TRACES", 1)
    grown = on_chain(traces=traces)
    grown._max_steps = 10**12
    grown.set_env(grown.env)
    grown.rollout.max_steps = whole.max_steps
    grown.learn(trials=5)
    assert grown.table.tobytes() == whole.table.tobytes()
    memory = grown._traces
    assert memory is not None
    assert memory.with_room(0)[1].shape[1] <= grown.table.size
