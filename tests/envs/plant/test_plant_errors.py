"""What `plant` refuses, and what it says."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from gymnasium import spaces
from numba import njit

import acl_gym
from tests.envs.plant.plants import MASS, make_mass, mass


@njit
def compiled_wrong_length(x, u):  # type: ignore[no-untyped-def]
    return (x[1],)


@njit
def compiled_untypable(x, u):  # type: ignore[no-untyped-def]
    return x.nothing


@njit
def compiled_nan(x, u):  # type: ignore[no-untyped-def]
    return (x[1], x[0] / 0.0 - np.inf)


def with_if(x: Any, u: Any) -> Any:
    return [x[1], u[0] if x[0] > 0 else -u[0]]


def rows_first(x: Any, u: Any) -> Any:
    return np.stack([x[:, 1], u[:, 0]], axis=1)


def changes_x(x: Any, u: Any) -> Any:
    x[0] = 0.0
    return [x[1], u[0]]


@pytest.mark.parametrize(
    ("dynamics", "words"),
    [
        (lambda x, u: [x[1]], r"got shape \(1, 7\) of float64 for 7 states"),
        (lambda x, u: x.T, r"got shape \(7, 2\) for 7 states"),
        (lambda x, u: 3.0, r"got 3\.0 for 7 states"),
        (lambda x, u: [x[1], "a"], "of <U"),
        (lambda x, u: [x[1], 1j * u[0]], "complex128"),
        (lambda x, u: [x[1], math.sin(x[0])], "raised TypeError: only"),
        (with_if, r"raised ValueError.*np\.where chooses for each state"),
        (rows_first, r"raised|got shape"),
        (changes_x, "read-only; it must not change x and u"),
        (lambda x, u: [x[1], np.log(x[0])], "must be finite within low and high, got"),
        (lambda x, u: [x[1], x[0].mean() + u[0]], "treat each column of x and u by"),
        (lambda x: x, "raised TypeError"),
        (compiled_wrong_length, r"return 2 finite numbers.*got \("),
        (compiled_untypable, "it failed: TypingError"),
        (compiled_nan, "compiled by Numba must take a state x of shape"),
    ],
)
def test_dynamics(dynamics: Any, words: str) -> None:
    with pytest.raises(ValueError, match=rf"(?s){words}"):
        make_mass(dynamics=dynamics)


def test_dynamics_that_is_nothing_to_call() -> None:
    with pytest.raises(TypeError, match="dynamics must be a function of"):
        acl_gym.plant(5, **MASS)


NARROW = spaces.Box(-0.1, 0.1, (2,), np.float64)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"low": [1.0, -1.0]}, "low < high"),
        ({"low": [-1.0]}, "low < high"),
        ({"low": [-1e308, -1.0], "high": [1e308, 1.0]}, "high - low must be a finite"),
        (
            {"cost": (1.0, 1e308), "inputs": [-9.0, 9.0]},
            "R of cost=.* finite cost u' R u",
        ),
        ({"cost": b"ab"}, 'cost must be "time", a pair'),
        ({"autoreset_mode": "", "num_envs": 2}, "autoreset_mode must be"),
        ({"low": [-np.inf, -1.0]}, "low must be an array of finite real numbers"),
        ({"inputs": [[[1.0]]]}, "inputs must hold the input of each action"),
        ({"inputs": []}, "inputs must be an array"),
        ({"sampling_time": 0.0}, "sampling_time must lie in"),
        ({"substeps": 10**12}, "substeps must be at most 10000"),
        ({"circular": [2]}, r"circular must hold variables of 0\.\.1"),
        ({"circular": 0}, r"circular must hold variables of 0\.\.1"),
        ({"goal": [0.0, 0.0, 0.0]}, "goal must be a state of 2 variables"),
        ({"goal": "up"}, "goal must be an array"),
        ({"goal": [0.0, 1e6]}, "variable 1 lies in .*widen the bounds"),
        ({"goal": None}, "tolerance belongs to a goal that is a state"),
        ({"goal": ([-1, -1], [1, 1])}, "tolerance belongs to a goal that is a state"),
        ({"goal": ([1, -1], [-1, 1]), "tolerance": None}, "low <= high in every"),
        ({"tolerance": -1.0}, "tolerance must be a number >= 0"),
        ({"tolerance": 5.0}, "must leave 1% or more of the initial states"),
        ({"initial": NARROW}, "must leave 1% or more of the initial states"),
        ({"initial": [[2.0, 0.0]]}, "initial must lie within low and high"),
        ({"initial": spaces.Box(-9, 9, (2,))}, "initial must lie within low and high"),
        (
            {"evaluation_states": [[0.0]]},
            "evaluation_states must be rows of 2 variables",
        ),
        ({"cost": "energy"}, "cost must be one of 'time'"),
        ({"cost": 1.0}, 'cost must be "time", a pair'),
        ({"cost": ([1, 1, 1], 0)}, r"Q of cost=\(Q, R\) must be"),
        ({"cost": ([1, 1], -1)}, r"R of cost=\(Q, R\) must be"),
        ({"cost": ([1, 1], 0), "goal": None, "tolerance": None}, "weighs the error"),
        ({"cost": lambda x, u: [1.0]}, r"cost\(x, u\) must return finite numbers"),
        ({"cost": lambda x, u: x[0] / 0}, r"got (-?inf|nan) for x"),
        ({"cost": lambda x, u: x[5]}, "it raised IndexError"),
        (
            {"goal": lambda x: x[0] > 0 and x[1] > 0, "tolerance": None},
            r"goal\(x\) must return booleans",
        ),
        ({"goal": lambda x: x, "tolerance": None}, "combine conditions with &"),
        ({"state_names": ["a"]}, "state_names must be 2 strings"),
        ({"input_names": "u"}, "input_names must be 1 strings"),
        ({"autoreset_mode": "SameStep"}, "belongs to a vector environment"),
        ({"max_episode_steps": 0}, "max_episode_steps must be at least 1"),
        ({"num_envs": 0}, "num_envs must be at least 1"),
        ({"render_mode": "text"}, "render_mode must be None or one of"),
    ],
)
def test_parameters(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        make_mass(**changes)


@pytest.mark.parametrize(
    "name", ["sampling_time", "max_episode_steps", "num_envs", "substeps"]
)
def test_types(name: str) -> None:
    with pytest.raises(TypeError, match=f"{name} must be"):
        make_mass(**{name: "many"})


def fails(rng: Any, n: int) -> Any:
    raise KeyError("speed")


RUBBISH = [
    (fails, r"but it raised KeyError\('speed'\) for n = \d"),
    (lambda rng: [[0.0, 0.0]], "but it raised TypeError"),
    (lambda rng, n: None, "must be an array of real numbers, got None"),
    (lambda rng, n: [["a", "b"]] * n, "must be an array of real numbers"),
    (lambda rng, n: [[0.5, 0.5]], "got 1 rows for n = "),
    (lambda rng, n: np.zeros((n, 3)), r"rows of 2 variables, shape \(n, 2\), got"),
    (lambda rng, n: np.full((n, 2), np.nan), r"must be finite, got \[nan, nan\]"),
    (lambda rng, n: np.full((n, 2), 5.0), r"variable 0 in \[-1, 1\], got 5 in row 0"),
]
"""Functions `initial`, and what is said of what they do."""


@pytest.mark.parametrize(("initial", "words"), RUBBISH)
def test_what_initial_does_is_told_of_initial(initial: Any, words: str) -> None:
    """Also where it fails only later, in the middle of learning."""
    expected = rf"initial\(rng, n\) must return n states.*{words}"
    with pytest.raises(ValueError, match=expected) as caught:
        make_mass(initial=initial)
    assert caught.value.__cause__ is not None or "rows for n" in words
    begun = []
    env = make_mass(
        initial=lambda rng, n: initial(rng, n) if begun else np.zeros((n, 2)),
        num_envs=4,
    )
    env.reset()
    begun.append(True)
    with pytest.raises(ValueError, match=expected):
        env.reset()


def test_states_of_a_reset() -> None:
    env = make_mass()
    for state, words in [
        ([0.0], "rows of 2 variables"),
        ([0.0, np.nan], "states must be finite"),
        ([0.0, 1.5], r"variable 1 in \[-1, 1\], got 1\.5 in row 0"),
    ]:
        with pytest.raises(ValueError, match=words):
            env.reset(options={"state": state})
    assert mass(np.ones(2), [3.0]) == [1.0, 3.0]
