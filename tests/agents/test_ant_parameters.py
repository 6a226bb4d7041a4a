"""Parameters of the ant agents: read, changed, refused, and given to `load`."""

from __future__ import annotations

import inspect
import io
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from acl_gym import (
    ACL,
    AntColonySystem,
    AntSystem,
    Crisp,
    Discrete,
    MaxMinAntSystem,
)
from acl_gym.agents.ant_optimizer import AntOptimizer
from acl_gym.colony.schedules import Linear
from tests.agents.reference_colony import chains

KINDS: list[type[Any]] = [AntSystem, AntColonySystem, MaxMinAntSystem]

OWN: dict[type[Any], dict[str, Any]] = {
    AntSystem: {"update_set": "trial-best", "elitists": 3.0, "global_decay": 0.4},
    AntColonySystem: {"q0": 0.5, "update_set": "trial-best", "local_decay": 0.3},
    MaxMinAntSystem: {
        "update_set": "best-so-far",
        "p_best": 0.2,
        "smoothing": 0.5,
        "patience": 3,
        "global_decay": 0.3,
    },
}
"""Values other than the defaults, of what may change while the colony learns."""


def salesman(ants: int = 6, **parameters: Any) -> Any:
    return gym.make_vec("acl_gym/TravellingSalesman-v0", num_envs=ants, **parameters)


def roads(n: int = 12, seed: int = 0) -> np.ndarray:
    distances = np.random.default_rng(seed).integers(1, 30, (n, n)).astype(float)
    return distances + distances.T


def saved(colony: AntOptimizer) -> io.BytesIO:
    file = io.BytesIO()
    colony.save(file)
    file.seek(0)
    return file


@pytest.mark.parametrize("kind", KINDS)
def test_every_parameter_can_be_read_and_none_is_set_in_vain(kind: type[Any]) -> None:
    """What is set is read again, or refused with what to do; of other names see below."""
    colony = kind(salesman(distances=roads()), seed=3)
    for name in inspect.signature(kind).parameters:
        value = getattr(colony, name)
        if name in ("env", *OWN[kind], "alpha", "beta", "global_decay", "ranks"):
            continue
        with pytest.raises(AttributeError, match=rf"{name} .*(make a new|call set_r)"):
            setattr(colony, name, value)


@pytest.mark.parametrize("kind", KINDS)
def test_what_may_change_takes_effect(kind: type[Any]) -> None:
    """The colony goes on as one that had these values from the beginning."""
    env = salesman(distances=roads())
    changed = kind(env, seed=3, tau0=0.01)
    made = kind(env, seed=3, tau0=0.01, **OWN[kind])
    as_before = kind(env, seed=3, tau0=0.01).learn(trials=12).table
    for name, value in OWN[kind].items():
        setattr(changed, name, value)
        assert getattr(changed, name) == value == changed.parameters()[name]
    np.testing.assert_array_equal(
        changed.learn(trials=12).table, made.learn(trials=12).table
    )
    assert not np.array_equal(changed.table, as_before)
    again = kind.load(saved(changed), env)
    assert again.parameters() == changed.parameters()


@pytest.mark.parametrize(
    ("kind", "name", "value", "error", "message"),
    [
        (AntSystem, "update_set", "mixed", ValueError, "update_set must be one of"),
        (AntSystem, "elitists", -1, ValueError, "elitists must lie in"),
        (AntSystem, "elitists", "many", TypeError, "elitists must be a real number"),
        (AntSystem, "ranks", 1.5, TypeError, "ranks must be an integer"),
        (AntColonySystem, "q0", 1.1, ValueError, r"q0 must lie in \[0, 1\]"),
        (AntColonySystem, "update_set", "trial", ValueError, "update_set must be one"),
        (MaxMinAntSystem, "p_best", 1.0, ValueError, r"p_best must lie in \(0, 1\)"),
        (MaxMinAntSystem, "smoothing", 2, ValueError, "smoothing must lie in"),
        (MaxMinAntSystem, "patience", -1, ValueError, "patience must be at least 0"),
    ],
)
def test_what_is_set_is_checked_as_in_the_constructor(
    kind: type[Any], name: str, value: Any, error: type[Exception], message: str
) -> None:
    colony = kind(salesman(distances=roads()), seed=0)
    before = getattr(colony, name)
    with pytest.raises(error, match=message):
        setattr(colony, name, value)
    assert getattr(colony, name) == before
    with pytest.raises(error, match=message):
        kind(salesman(distances=roads()), **{name: value})


def test_ranks_stand_alone_also_when_they_are_set() -> None:
    colony = AntSystem(salesman(distances=roads()), elitists=2.0, seed=0)
    with pytest.raises(
        ValueError, match="ranks must stand alone, got ranks=6 with eli"
    ) as e:
        colony.ranks = 6
    assert "update_set" not in str(e.value)  # which nobody has set
    with pytest.raises(ValueError, match="with update_set='best-so-far'; leave update"):
        AntSystem(salesman(distances=roads()), ranks=6, update_set="best-so-far")
    colony.elitists = 0
    colony.ranks = 6
    assert (colony.ranks, colony.update.ranks) == (6, 6)


def test_what_max_min_chooses_can_be_left_to_it_again() -> None:
    alone = MaxMinAntSystem(salesman(distances=roads()), update_set="best-so-far")
    alone.update_set, alone.p_best = None, "usual"
    assert (alone.update_set, alone.p_best) == ("mostly-trial-best", 0.05)
    helped = MaxMinAntSystem(
        salesman(distances=roads()), update_set="best-so-far", local_search="3-opt"
    )
    helped.update_set, helped.p_best = None, "usual"
    assert (helped.update_set, helped.p_best) == ("mixed", None)


@pytest.mark.parametrize("kind", KINDS)
def test_schedules_can_be_set(kind: type[Any]) -> None:
    colony = kind(salesman(distances=roads()), seed=0)
    colony.alpha = Linear(1, 2, 10)
    colony.learn(trials=6)
    assert colony.pheromone.alpha == 1.5


@pytest.mark.parametrize("kind", [AntSystem, ACL])
def test_the_seed_is_set_by_a_method(kind: type[Any]) -> None:
    colony = kind(None, Crisp([[0.0, 1.0]]), n_actions=2, seed=4)
    with pytest.raises(AttributeError, match=r"call set_random_seed\(5\)"):
        colony.seed = 5
    first = colony.rng.random()
    colony.set_random_seed(4)
    assert (colony.seed, colony.rng.random()) == (4, first)


@pytest.mark.parametrize("kind", KINDS)
def test_load_honours_another_initial_level(kind: type[Any]) -> None:
    """It is what components decay to; what has been learned stays."""
    env = salesman(distances=roads())
    colony = kind(env, seed=3, tau0=0.5).learn(trials=4)
    loaded = kind.load(saved(colony), env, tau0=0.125)
    assert loaded.tau0 == loaded.pheromone.tau0 == 0.125
    np.testing.assert_array_equal(loaded.table, colony.table)
    formula = kind.load(saved(colony), env, tau0=None)
    assert formula.pheromone.tau0 == kind(env).pheromone.tau0
    np.testing.assert_array_equal(formula.table, colony.table)
    # Before the first trial the levels are the initial ones.
    new = kind.load(saved(kind(env, seed=3, tau0=0.5)), env, tau0=0.125)
    assert (new.table == 0.125).all()
    assert kind.load(saved(colony), env).pheromone.tau0 == 0.5


def test_the_initial_level_that_load_was_given_is_where_components_decay_to() -> None:
    env = salesman(distances=roads())
    colony = AntColonySystem(env, seed=3).learn(trials=4)
    high = AntColonySystem.load(saved(colony), env, tau0=10.0).learn(trials=1)
    same = AntColonySystem.load(saved(colony), env).learn(trials=1)
    assert high.table.max() >= 0.1 * 10.0 > same.table.max()


def test_load_chooses_what_it_is_told_to_choose() -> None:
    env = salesman(distances=roads(30), start=0)
    colony = AntSystem(env, candidates=None, symmetric=False, seed=1)
    loaded = AntSystem.load(saved(colony), env, candidates="usual", symmetric=None)
    assert (loaded.candidates, loaded.symmetric) == (20, True)
    assert loaded.update.candidates.shape == (30, 20)
    kept = AntSystem.load(saved(colony), env)
    assert (kept.candidates, kept.symmetric) == (None, False)


@pytest.mark.parametrize("kind", KINDS)
def test_another_deposit_counts_for_the_best_solution_too(kind: type[Any]) -> None:
    """Fitness by two deposits could not be compared."""
    env = salesman(distances=roads())
    colony = kind(env, seed=1).learn(trials=3)
    loaded = kind.load(saved(colony), env, deposit=lambda costs: 5.0 / costs)
    best = loaded.update.best
    assert best.fitness == pytest.approx(5.0 / colony.best_cost, rel=1e-12)
    same = kind.load(saved(colony), env).update.best
    assert same.fitness == colony.update.best.fitness


def test_an_agent_made_without_an_environment_chooses_when_it_has_one() -> None:
    env = salesman(distances=roads(30))
    late = AntSystem(None, Discrete(30), n_actions=30, max_steps=31, seed=1)
    assert (late.heuristic, late.candidates, late.symmetric) == (None, None, False)
    late.set_env(env)
    at_once = AntSystem(env, seed=1)
    assert (late.candidates, late.symmetric) == (20, True)
    np.testing.assert_array_equal(late.heuristic, at_once.heuristic)
    np.testing.assert_array_equal(
        late.learn(trials=3).table, at_once.learn(trials=3).table
    )


def test_elsewhere_nothing_is_symmetric_and_nothing_listed() -> None:
    late = AntSystem(None, Crisp([np.arange(6.0)]), n_actions=2, seed=1)
    late.set_env(chains(3))
    assert (late.heuristic, late.candidates, late.symmetric) == (None, None, False)
