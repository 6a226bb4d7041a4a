"""Replay moves the values one after the other, as the equation says, backwards."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acl_gym import Discrete
from acl_gym.colony.memory import Memory
from acl_gym.colony.replay import _replay, replay
from acl_gym.colony.walk import Walk
from tests.agents.reference_colony import q_lambda_update
from tests.colony.reference_walk_back import Path, value
from tests.colony.test_walking_back import SHAPES, Colony

Array = np.ndarray


def replayed(
    levels: Array, paths: list[Path], rate: float, discount: float, trace_decay: float
) -> Array:
    """The values after paths have been replayed, from the definition."""
    values = levels.copy()
    for states, actions, rewards, terminated, allowed in paths:
        best = 0.0 if terminated else value(values, states[-1], allowed[-1])
        target = best
        for t in reversed(range(len(actions))):
            mixed = (1 - trace_decay) * best + trace_decay * target
            target = rewards[t] + discount * mixed
            beta, u = states[t], actions[t]
            values[:, u] += rate * beta * (target - beta @ values[:, u])
            best = value(values, beta, allowed[t])
            if beta @ values[:, u] < best - 1e-12:
                target = best
    return values


def some_colony(rng: np.random.Generator, shape: Any, masked: bool) -> Colony:
    colony = Colony(rng, shape, masked)
    for _ in range(2):
        colony.walk(ants=3, longest=5)
    return colony


@given(
    seed=st.integers(0, 2**32 - 1),
    shape=st.sampled_from(SHAPES),
    masked=st.booleans(),
    rate=st.sampled_from([0.1, 1.0]),
    discount=st.sampled_from([0.0, 0.9, 1.0]),
    trace_decay=st.sampled_from([0.0, 0.6, 1.0]),
)
def test_values_are_those_of_the_equation(
    seed: int,
    shape: Any,
    masked: bool,
    rate: float,
    discount: float,
    trace_decay: float,
) -> None:
    rng = np.random.default_rng(seed)
    colony = some_colony(rng, shape, masked)
    before = rng.normal(scale=10.0, size=(colony.partition.n_cells, colony.n_actions))
    paths = rng.permutation(colony.memory.n_paths)[:4]
    how = {"rate": rate, "discount": discount, "trace_decay": trace_decay}
    values = before.copy()
    replay(colony.memory, paths, values, **how)
    expected = replayed(before, [colony.paths[path] for path in paths], **how)
    np.testing.assert_allclose(values, expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("shape", SHAPES)
def test_the_kernel_runs_the_same_without_the_compiler(shape: Any) -> None:
    rng = np.random.default_rng(4)
    colony = some_colony(rng, shape, masked=True)
    memory, paths = colony.memory, np.arange(colony.memory.n_paths)
    values = rng.normal(size=(colony.partition.n_cells, colony.n_actions))
    plain = values.copy()
    replay(memory, paths, values, rate=0.4, discount=0.9, trace_decay=0.5)
    _replay.py_func(
        *(memory.first, memory.last, memory.terminated, memory.index, memory.degree),
        *(memory.action, memory.reward, memory.allowed, plain, (), (), 0.4, 0.9, 0.5),
    )
    np.testing.assert_allclose(values, plain, rtol=1e-12, atol=1e-12)


@given(seed=st.integers(0, 2**32 - 1), masked=st.booleans())
def test_it_is_watkins_method_where_values_hardly_move(seed: int, masked: bool) -> None:
    """With a tiny rate, returns from the end and traces from the start agree.

    Divided by the rate, the change of the values is the sum of the errors; what the
    values move by in between changes it by the order of the rate, 1e-7.
    """
    rng = np.random.default_rng(seed)
    colony = some_colony(rng, SHAPES[1], masked)
    before = rng.normal(size=(colony.partition.n_cells, colony.n_actions))
    rate, discount, trace_decay = 1e-7, 0.9, 0.8
    path = int(rng.integers(colony.memory.n_paths))
    states, actions, rewards, terminated, allowed = colony.paths[path]
    for mask, u in zip(allowed, actions, strict=False):
        mask[u] = True  # what was done was allowed; the reference relies on it
    if masked:
        rows = slice(int(colony.memory.first[path]), int(colony.memory.last[path]))
        steps = np.arange(rows.start, rows.stop)
        colony.memory.allowed[steps, actions] = True
    values, traced = before.copy(), before.copy()
    trace = np.zeros_like(before)
    replay(
        colony.memory,
        np.array([path]),
        values,
        rate=rate,
        discount=discount,
        trace_decay=trace_decay,
    )
    for t, u in enumerate(actions):
        ended = terminated and t + 1 == len(actions)
        q_lambda_update(
            traced,
            trace,
            states[t],
            u,
            rewards[t],
            None if ended else states[t + 1],
            states[t] @ before[:, u] >= value(before, states[t], allowed[t]) - 1e-12,
            rate,
            discount,
            trace_decay,
            True,
            allowed[t + 1],
        )
    np.testing.assert_allclose(
        (values - before) / rate, (traced - before) / rate, rtol=1e-3, atol=1e-3
    )


def test_an_end_teaches_its_beginning_in_one_pass() -> None:
    """A way of five cells at rate 1: each step costs 1, whatever lambda is."""
    one = np.zeros(1, np.int64)
    for trace_decay in (0.0, 0.5, 1.0):
        walk = Walk(1)
        for cell in range(5):
            walk.append(one, np.array([cell]), one, -np.ones(1), None)
        walk.stop(one, np.array([5]), np.array([True]), None)
        memory = Memory(100, 1, Discrete(6))
        paths = memory.add(walk)
        values = np.zeros((6, 1))
        replay(memory, paths, values, rate=1.0, discount=1.0, trace_decay=trace_decay)
        assert values[:, 0].tolist() == [-5.0, -4.0, -3.0, -2.0, -1.0, 0.0]


def test_older_paths_are_drawn_before_the_newest() -> None:
    colony = some_colony(np.random.default_rng(1), SHAPES[0], masked=False)
    memory, rng = colony.memory, np.random.default_rng(2)
    newest = np.arange(memory.n_paths - 2, memory.n_paths)
    older = memory.n_paths - 2
    steps = int((memory.last - memory.first)[:older].sum())
    every = memory.with_older(newest, steps, rng)
    assert every.tolist() == list(range(memory.n_paths))
    some = memory.with_older(newest, 1, rng)  # one path may exceed what was asked
    assert some[-2:].tolist() == newest.tolist()
    assert some.size == 3
    assert memory.with_older(newest, 0, rng).tolist() == newest.tolist()
    sizes = memory.last - memory.first
    for most in range(1, steps):
        drawn = memory.with_older(newest, most, rng)[:-2]
        assert most <= sizes[drawn].sum() < most + sizes.max()
        assert (np.diff(drawn) > 0).all()
