"""What colonies are told beforehand: used, carried over by growth, saved, forgotten."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from acl_gym import (
    ACL,
    Crisp,
    Exponential,
    Fuzzy,
    PolicyPrior,
    ReturningACL,
    WaitingVectorEnv,
)
from acl_gym.colony.heuristic import checked_heuristic
from acl_gym.partitions import Partition
from acl_gym.partitions.growing import carried_over
from tests.agents.reference_colony import chains

Array = np.ndarray
ROW = Crisp([np.arange(6.0)])
SMALL: dict[str, Any] = {"steps_per_walk": 100, "walks_back": 3, "visits_to_grow": 0.5}


def pendulum(ants: int = 5) -> Any:
    return gym.make_vec("acl_gym/Pendulum-v0", num_envs=ants)


def grid() -> Partition:
    return Fuzzy([np.linspace(0, 5.5, 6), np.linspace(-9, 9, 5)], [2 * np.pi, None])


def lean(env: Any, partition: Partition) -> Array:
    """Other numbers in each centre."""
    states = np.asarray(partition.cell_states())
    return 1.5 + np.sin(states.sum(axis=1, keepdims=True) + np.arange(3.0))


def cost(env: Any, partition: Partition) -> Array:
    return -10.0 * lean(env, partition)


TOLD: dict[str, dict[str, Any]] = {
    "functions": {"heuristic": lean, "initial": cost, "grows": True},
    "arrays": {
        "heuristic": lean(None, grid()),
        "initial": cost(None, grid()),
        "grows": True,
    },
    "fixed cells": {"heuristic": lean, "initial": cost},
    "schedule": {"heuristic": lean, "beta": Exponential(2.0, 0.5), "grows": True},
}
EACH = pytest.mark.parametrize("name", TOLD)


def make(name: str, **more: Any) -> ReturningACL:
    keywords = {**SMALL, **TOLD[name], **more}
    return ReturningACL(pendulum(), grid(), seed=3, **keywords)


def again(name: str) -> dict[str, Any]:
    """What must be given to `load` again: functions of a user's own."""
    told = TOLD[name]
    return {n: told[n] for n in ("heuristic", "initial") if callable(told.get(n))}


def assert_same(one: ReturningACL, other: ReturningACL) -> None:
    assert one.table.tobytes() == other.table.tobytes()
    for name in ("heuristic", "initial"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert one.rng.bit_generator.state == other.rng.bit_generator.state


@EACH
def test_two_parts_are_one_run_also_through_a_file(name: str, tmp_path: Path) -> None:
    whole = make(name).learn(trials=5)
    make(name).learn(trials=2).save(tmp_path / "part")
    part = ReturningACL.load(tmp_path / "part", pendulum(), **again(name))
    assert_same(part.learn(trials=3), whole)


@EACH
def test_a_trial_can_be_taken_back(name: str) -> None:
    whole = make(name).learn(trials=4)
    colony = make(name).learn(trials=1)
    kept = colony.snapshot()
    colony.learn(trials=2).take_back(kept)
    assert_same(colony.learn(trials=3), whole)


def test_functions_are_asked_again_when_the_partition_has_grown() -> None:
    colony = make("functions").learn(trials=4)
    assert colony.partition.n_cells > grid().n_cells
    np.testing.assert_array_equal(colony.heuristic, lean(None, colony.partition))
    np.testing.assert_array_equal(colony.initial, cost(None, colony.partition))


def test_arrays_are_interpolated_when_the_partition_has_grown() -> None:
    colony = make("arrays").learn(trials=4)
    assert colony.partition.n_cells > grid().n_cells
    for found, function in ((colony.heuristic, lean), (colony.initial, cost)):
        wanted = carried_over(function(None, grid()), grid(), colony.partition)
        # Halved several times, so rounded several times.
        np.testing.assert_allclose(found, wanted, rtol=1e-12)
    checked_heuristic(colony.heuristic, colony.table.shape)


@pytest.mark.parametrize("name", ["functions", "arrays"])
def test_what_was_never_tried_promises_what_was_told(name: str) -> None:
    colony = make(name)
    np.testing.assert_array_equal(colony.table, cost(None, grid()))
    colony.learn(trials=2)
    unknown, initial = ~colony._known, colony.initial
    colony._promise(1.0)  # what the next walk begins with
    assert unknown.any()
    assert not unknown.all()
    assert initial is not None
    np.testing.assert_array_equal(colony.table[unknown], initial[unknown])
    assert (colony.table[~unknown] != initial[~unknown]).mean() > 0.9


def test_ants_try_first_what_was_told() -> None:
    """Nothing promises more than anything else, so that eta decides all steps."""
    right = np.tile([0.0, 1.0], (6, 1))
    env = chains(8)
    colony = ReturningACL(env, ROW, seed=0, heuristic=right, max_steps=5)
    colony.learn(trials=1)
    assert colony.rollout.terminated.all()
    # All other pairs were never tried.
    assert not colony._known[:, 0].any()
    plain = ReturningACL(chains(8), ROW, seed=0, max_steps=5).learn(trials=1)
    assert plain._known[:, 0].any()


def test_masks_count_for_more_than_what_was_told() -> None:
    """The heuristic knows forbidden actions only; Taxi forbids most of them."""
    made = [lambda: gym.make("Taxi-v4", max_episode_steps=30)] * 3
    eta = np.zeros((500, 6))
    eta[:, 5] = 1.0  # to drop a passenger who is seldom there
    env = WaitingVectorEnv(made)
    colony = ReturningACL(env, seed=0, heuristic=eta, epsilon=1.0).learn(trials=2)
    tried = colony._known.any(axis=0)
    assert tried[:4].all()


def test_a_controller_of_one_line_leads_a_growing_colony() -> None:
    brake = PolicyPrior(lambda states: -0.5 * states[:, 1])
    colony = ReturningACL(pendulum(), heuristic=brake, seed=0)
    colony.learn(total_timesteps=600)
    np.testing.assert_array_equal(colony.heuristic, brake(pendulum(), colony.partition))


def test_exploring_predictions_are_led_as_well() -> None:
    eta = np.tile([0.0, 1.0, 0.0], (grid().n_cells, 1))
    colony = ReturningACL(pendulum(), grid(), seed=0, heuristic=eta, epsilon=1.0)
    seen = np.random.default_rng(0).uniform(0.0, 6.0, (50, 2))
    actions, _ = colony.predict(seen, deterministic=False)
    assert (actions == 1).all()


def test_an_exponent_that_decays_comes_to_that_of_the_trial() -> None:
    colony = make("schedule").learn(trials=3)
    eta = np.asarray(colony.heuristic)
    expected = eta ** (2.0 * 0.5**3)
    expected /= expected.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(colony._proposals(), expected, rtol=1e-12)
    colony.beta = 0.0
    np.testing.assert_allclose(colony._proposals(), 1 / 3, rtol=1e-12)


def test_a_file_predicts_without_the_functions_and_says_what_it_needs(
    tmp_path: Path,
) -> None:
    colony = make("functions").learn(trials=2)
    colony.save(tmp_path / "colony")
    loaded = ReturningACL.load(tmp_path / "colony", pendulum())
    np.testing.assert_array_equal(loaded.heuristic, colony.heuristic)
    assert loaded.predict([[0.0, 0.0]])[0] == colony.predict([[0.0, 0.0]])[0]
    assert loaded.predict([[0.0, 0.0]], deterministic=False)[0] in (0, 1, 2)
    words = r"heuristic was 'tests.agents.test_informed:lean', which a file cannot hold"
    with pytest.raises(ValueError, match=words):
        loaded.learn(trials=1)
    loaded.grows = False  # then nobody asks again
    loaded.learn(trials=1)
    loaded.grows = True
    loaded.heuristic, loaded.initial = lean, cost
    loaded.learn(trials=1)
    # What stands in for a function is saved as such again.
    half = ReturningACL.load(tmp_path / "colony", heuristic=lean)
    half.save(tmp_path / "half")
    with pytest.raises(
        ValueError, match=r"initial was 'tests\.agents\.test_informed:cos"
    ):
        ReturningACL.load(tmp_path / "half", pendulum(), heuristic=lean).learn(trials=1)


def test_what_is_known_may_be_replaced_when_a_file_is_read(tmp_path: Path) -> None:
    colony = ReturningACL(pendulum(), grid(), seed=0).learn(trials=1)
    colony.save(tmp_path / "colony")
    ones = np.ones((grid().n_cells, 3))
    for given in (ones, lambda env, partition: ones):
        loaded = ReturningACL.load(tmp_path / "colony", pendulum(), heuristic=given)
        np.testing.assert_array_equal(loaded.heuristic, ones)
        assert loaded.initial is None
    file = ACL(chains(2), ROW, seed=0, tau0=1e-3).save(tmp_path / "acl")
    with pytest.raises(
        TypeError, match=r"ACL except env, executor, heuristic, initial"
    ):
        ACL.load(file, heuristic=ones)


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("heuristic", lambda a: a[1:]),
        ("heuristic", lambda a: -a),
        ("initial", lambda a: a * np.nan),
        ("initial", lambda a: a[:, :1]),
    ],
)
def test_what_is_known_is_checked_in_files_of_strangers(
    name: str, change: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    colony = make("arrays").learn(trials=1)
    arrays = colony._arrays()
    arrays[name] = change(arrays[name])
    monkeypatch.setattr(colony, "_arrays", lambda: arrays)
    colony.save(tmp_path / "strange")
    with pytest.raises(ValueError, match=f"is damaged: {name} must"):
        ReturningACL.load(tmp_path / "strange")
    del arrays[name]
    colony.heuristic, colony.initial = lean, cost
    colony.save(tmp_path / "strange")
    with pytest.raises(ValueError, match=f"is damaged: the array {name} is missing"):
        ReturningACL.load(tmp_path / "strange")


@pytest.mark.parametrize("name", ["heuristic", "initial"])
@pytest.mark.parametrize(
    ("value", "message"),
    [
        (np.ones((30, 2)), r"shape \(30, 3\)"),
        (np.full((30, 3), np.nan), "finite"),
        ("x", "real numbers, got 'x'"),
        (lambda env, partition: np.ones((1, 3)), r"shape \(30, 3\)"),
    ],
)
def test_bad_knowledge_is_refused(name: str, value: Any, message: str) -> None:
    with pytest.raises(ValueError, match=f"{name} must .*{message}"):
        ReturningACL(pendulum(), grid(), **{name: value})
    colony = ReturningACL(pendulum(), grid())
    with pytest.raises(ValueError, match=f"{name} must .*{message}"):
        setattr(colony, name, value)
    assert getattr(colony, name) is None


def test_a_function_that_fails_while_the_partition_grows_spoils_nothing() -> None:
    cells = grid().n_cells

    def fails(env: Any, partition: Partition) -> Array:
        if partition.n_cells > cells:
            raise RuntimeError("no answer")
        return lean(env, partition)

    colony = make("functions", heuristic=fails)
    with pytest.raises(RuntimeError, match="no answer"):
        colony.learn(trials=4)
    assert colony.partition.n_cells == len(colony.table) == cells
    assert np.shape(colony.heuristic) == np.shape(colony.initial) == (cells, 3)


def test_acl_begins_with_the_levels_that_it_is_told(tmp_path: Path) -> None:
    levels = np.tile([1e-3, 1e-2], (6, 1))
    parameters: dict[str, Any] = {"tau0": 1e-3, "seed": 1, "max_steps": 20}
    for given in (levels, lambda env, partition: levels):
        colony = ACL(chains(8), ROW, initial=given, **parameters)
        np.testing.assert_array_equal(colony.table, levels)
    whole = ACL(chains(8, slip=0.3), ROW, initial=levels, **parameters).learn(trials=4)
    half = ACL(chains(8, slip=0.3), ROW, initial=levels, **parameters).learn(trials=2)
    file = half.save(tmp_path / "colony")
    resumed = ACL.load(file, chains(8, slip=0.3)).learn(trials=2)
    np.testing.assert_array_equal(resumed.table, whole.table)
    plain = ACL(chains(8, slip=0.3), ROW, **parameters).learn(trials=4)
    same = np.full((6, 2), 1e-3)
    told = ACL(chains(8, slip=0.3), ROW, initial=same, **parameters).learn(trials=4)
    assert told.table.tobytes() == plain.table.tobytes()
    assert whole.table.tobytes() != plain.table.tobytes()


def test_acl_forgets_levels_where_ants_pass() -> None:
    """Without deposits all levels that are visited decay to tau0, and to nothing less."""
    levels = np.full((6, 2), 0.5)
    colony = ACL(
        chains(8),
        ROW,
        initial=levels,
        tau0=1e-3,
        global_decay=0.0,
        local_decay=0.3,
        seed=0,
        max_steps=20,
    ).learn(trials=20)
    assert (colony.table >= 1e-3).all()
    assert colony.table[:5].max() < 2e-3


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (np.full((6, 2), 9e-4), r"at least tau0 = 0\.001, .* got 0\.0009 for action 0"),
        (-np.ones((6, 2)), r"at least tau0"),
        (np.ones((5, 2)), r"shape \(6, 2\)"),
        (np.full((6, 2), np.inf), "finite"),
        (lambda env, partition: None, "real numbers, got None"),
    ],
)
def test_acl_refuses_levels_that_are_none(value: Any, message: str) -> None:
    with pytest.raises(ValueError, match=f"initial must .*{message}"):
        ACL(chains(2), ROW, initial=value, tau0=1e-3)
