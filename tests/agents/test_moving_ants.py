"""Ant Colony Learning in the framework of chapter 6 learns what `ACL` learns, to the bit."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from acl_gym import ACL, Fuzzy, Linear, Steps, UpdateRule
from acl_gym.agents.moving_ants import Ants, Inputs, Observations, StigmergyEnvironment
from acl_gym.swarm import (
    Channel,
    Delayed,
    Environment,
    Everyone,
    History,
    Links,
    Ring,
    Topology,
    run,
)

GRID, PENDULUM = "acl_gym/GridSearch2D-v0", "acl_gym/Pendulum-v0"
ALWAYS = 10**9  # more steps than any of these runs takes


def colony(name: str, n: int = 20, **settings: Any) -> ACL:
    env = gym.make_vec(name, num_envs=n)
    partition = None
    if name == PENDULUM:
        box = env.single_observation_space
        partition = Fuzzy.from_box(box, (8, 9), circular=[0])
    return ACL(env, partition, **{"seed": 0, **settings})


def run_as_swarm(
    source: ACL, trials: int, channel: Channel | None = None, **options: Any
) -> tuple[StigmergyEnvironment, History]:
    environment = StigmergyEnvironment(source, trials)
    history = run(Ants(source), environment, ALWAYS, source.rng, channel, **options)
    return environment, history


def assert_same(learned: ACL, swarm: StigmergyEnvironment, source: ACL) -> None:
    """The same pheromone, costs, and numbers drawn."""
    np.testing.assert_array_equal(swarm.pheromone.levels, learned.table)
    assert (learned.table != learned.tau0).any()
    costs = [row["ants_cost"] for row in learned.history]
    assert [each.mean() for each in swarm.costs] == costs[-len(swarm.costs) :]
    assert source.rng.bit_generator.state == learned.rng.bit_generator.state


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("local_decay", [0.0, 0.05])
@pytest.mark.parametrize("epsilon", [0.0, 0.2, 1.0])
@pytest.mark.parametrize("name", [GRID, PENDULUM])
def test_the_same_bits_with_and_without_exploration_and_local_update(
    name: str, epsilon: float, local_decay: float, seed: int
) -> None:
    settings = {"epsilon": epsilon, "local_decay": local_decay, "seed": seed}
    settings["max_steps"] = 200 if name == GRID else 120
    learned = colony(name, **settings).learn(trials=4)
    source = colony(name, **settings)
    swarm, history = run_as_swarm(source, 4)
    assert history.done
    assert_same(learned, swarm, source)


@pytest.mark.parametrize("max_steps", [1, 30, 5000])
def test_time_outs(max_steps: int) -> None:
    """Most ants run out of time, some, or none."""
    learned = colony(GRID, max_steps=max_steps, alpha=1.0).learn(trials=5)
    source = colony(GRID, max_steps=max_steps, alpha=1.0)
    swarm, history = run_as_swarm(source, 5)
    assert_same(learned, swarm, source)
    rates = [row["ants_success_rate"] for row in learned.history]
    as_intended = {1: max(rates) < 0.2, 30: 0 < max(rates) < 1, 5000: min(rates) == 1}
    assert as_intended[max_steps]
    if max_steps < 5000:  # a step for each move, and one for the global update
        assert history.steps == 5 * (max_steps + 1)


class Forgetful(UpdateRule):
    """A user's own rule: every deposit is a small constant."""

    needs_episodes = True

    def local_update(self, pheromone, index, degree, actions, local_decay) -> None:
        pheromone.levels[index[:, 0], actions] *= 0.99
        pheromone.stale[index[:, 0]] = True

    def global_update(self, pheromone, result, local_decay, global_decay) -> None:
        for block in result.solutions.blocks():
            cells = block.index[:, 0]
            pheromone.levels[cells, block.action] += result.episodes.lengths.mean()
            pheromone.stale[cells] = True


def favour_the_first(env: Any, partition: Any) -> Any:
    return np.tile([4.0, 1.0, 1.0, 1.0, 1.0][: env.single_action_space.n], (87, 1))


@pytest.mark.parametrize(
    "settings",
    [
        {"selection": "boltzmann"},
        {"selection": "epsilon_greedy"},
        {"alpha": Linear(1.0, 3.0, trials=3), "epsilon": Linear(0.5, 0.0, trials=3)},
        {"cost": Steps(), "deposit": "rank"},
        {"update": "once_per_ant"},
        {"update": "once_per_trial"},
        {"update": Forgetful()},
        {"tabu": True},
        {"heuristic": favour_the_first, "beta": Linear(2.0, 0.0, trials=3)},
        {"initial": favour_the_first},
        {"global_decay": 0.0, "initial": favour_the_first},
    ],
    ids="-".join,
)
def test_the_same_bits_with_any_settings(settings: dict[str, Any]) -> None:
    settings = {"max_steps": 100, **settings}
    learned = colony(GRID, **settings).learn(trials=4)
    source = colony(GRID, **settings)
    swarm, _ = run_as_swarm(source, 4)
    assert_same(learned, swarm, source)


def test_the_same_bits_where_not_all_actions_are_allowed() -> None:
    tours = {"name": "acl_gym/TravellingSalesman-v0", "n": 5, "tau0": 1e-6}
    learned = colony(**tours).learn(trials=4)
    source = colony(**tours)
    swarm, _ = run_as_swarm(source, 4)
    assert_same(learned, swarm, source)


def test_a_colony_that_has_learned_goes_on() -> None:
    settings = {"epsilon": Linear(0.5, 0.0, trials=4), "max_steps": 100}
    learned = colony(GRID, **settings).learn(trials=5)
    source = colony(GRID, **settings).learn(trials=2)
    before = source.table.copy()
    swarm, _ = run_as_swarm(source, 3)
    assert_same(learned, swarm, source)
    np.testing.assert_array_equal(source.table, before)
    assert source.trials == 2


def test_a_run_begins_anew() -> None:
    source = colony(PENDULUM, max_steps=50)
    ants, environment = Ants(source), StigmergyEnvironment(source, 3)
    tables = []
    for _ in range(2):
        run(ants, environment, ALWAYS, 5)
        tables.append(environment.pheromone.levels.copy())
    np.testing.assert_array_equal(*tables)


def lengths(source: ACL, trials: int, channel: Channel | None, **options: Any) -> Any:
    """The pheromone, and how many steps the run took."""
    swarm, history = run_as_swarm(source, trials, channel, **options)
    return swarm.pheromone.levels, history.steps


def test_late_messages_end_trials_later_and_change_nothing_else() -> None:
    """Ants that wait draw no numbers, and no flag of an earlier trial is taken for new."""
    settings = {"max_steps": 5000, "alpha": 1.0}
    levels, steps = lengths(colony(GRID, **settings), 6, None)
    for delay in (1, 3):
        late, more = lengths(colony(GRID, **settings), 6, Delayed(Everyone(), delay))
        np.testing.assert_array_equal(late, levels)
        assert more == steps + 6 * delay
    strict, more = lengths(colony(GRID, **settings), 6, None, stale=True)
    np.testing.assert_array_equal(strict, levels)
    assert more == steps + 6


class Silence(Topology):
    """Nobody hears anybody."""

    def links(self, x: Any) -> Links:
        return Links.from_lists([[]] * len(x))


class OneHears(Topology):
    """Ant 0 hears all, the others nobody."""

    def links(self, x: Any) -> Links:
        return Links.from_lists([range(len(x)), *[[]] * (len(x) - 1)])


@pytest.mark.parametrize("channel", [Ring(), Silence(), OneHears()])
def test_ants_that_do_not_hear_from_all_wait_for_their_clock(channel: Channel) -> None:
    settings = {"max_steps": 5000, "alpha": 1.0}
    levels, steps = lengths(colony(GRID, **settings), 3, None)
    waited, longer = lengths(colony(GRID, **settings), 3, channel)
    np.testing.assert_array_equal(waited, levels)
    assert steps < longer
    assert longer == 3 * 5001


def test_particles_are_the_states_of_the_system() -> None:
    source = colony(PENDULUM, n=4, max_steps=10)
    environment = StigmergyEnvironment(source, 1)
    history = run(Ants(source), environment, 10, 3, record=("x",))
    env = gym.make_vec(PENDULUM, num_envs=4)
    seed = int(np.random.default_rng(3).integers(2**31))
    first, _ = env.reset(seed=seed)
    np.testing.assert_array_equal(history["x"][0], first)
    assert history["x"].shape == (11, 4, 2)


def test_only_the_process_changes_the_pheromone() -> None:
    """All that ants do is observe, send, hear and decide."""
    source = colony(GRID, max_steps=20, initial=favour_the_first)
    environment, ants = StigmergyEnvironment(source, 1), Ants(source)
    rng = np.random.default_rng(0)
    environment.reset(rng)
    ants.reset(environment.n, rng)
    for _ in range(21):
        before = environment.pheromone.levels.copy()
        y = environment.observe()
        assert isinstance(y, Observations)
        ants.observe(y)
        inbox = Everyone().deliver(ants.send(), environment.positions, rng)
        ants.hear(inbox)
        u = ants.decide(rng)
        assert isinstance(u, Inputs)
        np.testing.assert_array_equal(environment.pheromone.levels, before)
        environment.step(u, rng)
        assert (environment.pheromone.levels != before).any()
    assert environment.done


def test_colonies_that_the_framework_does_not_have_are_refused() -> None:
    with pytest.raises(ValueError, match="colony must be synchronous"):
        StigmergyEnvironment(colony(GRID, schedule="asynchronous"), 3)
    with pytest.raises(ValueError, match=r"choose on the same observation.*InTurn"):
        StigmergyEnvironment(colony(GRID, update="in_turn"), 3)
    with pytest.raises(ValueError, match="trials must be at least 1"):
        StigmergyEnvironment(colony(GRID), 0)
    without = ACL(None, colony(GRID).partition, n_actions=5)
    for make in (Ants, lambda each: StigmergyEnvironment(each, 1)):
        with pytest.raises(TypeError, match="colony must be an ACL"):
            make(3)
        with pytest.raises(ValueError, match="has no environment"):
            make(without)


def test_ants_and_environments_of_different_colonies_are_refused() -> None:
    """Kernels would address cells and actions that are not there."""
    small, large = (
        colony(PENDULUM, n=4),
        ACL(
            gym.make_vec(PENDULUM, num_envs=4),
            Fuzzy.from_box(
                gym.make_vec(PENDULUM, num_envs=1).single_observation_space,
                (80, 90),
                circular=[0],
            ),
        ),
    )
    shifted = ACL(
        gym.make_vec(PENDULUM, num_envs=4),
        Fuzzy.from_box(
            gym.make_vec(PENDULUM, num_envs=1).single_observation_space,
            (9, 8),
            circular=[0],
        ),
    )
    for ants, there, words in (
        (large, small, "with other cells; make both from the same colony"),
        (small, large, "with other cells"),
        (shifted, small, "with other cells"),
        (colony(GRID, n=4), small, "got 4 and 3 actions"),
    ):
        with pytest.raises(ValueError, match=words):
            run(Ants(ants), StigmergyEnvironment(there, 1), 3, 0)


def test_colonies_with_equal_cells_may_be_mixed() -> None:
    one, other = colony(PENDULUM, n=4, max_steps=5), colony(PENDULUM, n=4, max_steps=5)
    assert run(Ants(one), StigmergyEnvironment(other, 1), 99, 0).done


class Elsewhere(Environment):
    """No environment of ants."""

    def reset(self, rng: np.random.Generator) -> None:
        self.x = np.zeros((4, 2))

    def observe(self) -> Any:
        return self.x

    def step(self, u: Any, rng: np.random.Generator) -> None:
        raise AssertionError


def test_halves_of_other_kinds_are_refused() -> None:
    source = colony(GRID, n=4)
    with pytest.raises(TypeError, match="Observations of a StigmergyEnvironment, got"):
        run(Ants(source), Elsewhere(), 3, 0)
    environment = StigmergyEnvironment(source, 1)
    environment.reset(np.random.default_rng(0))
    with pytest.raises(TypeError, match=r"u must be the Inputs of Ants, got None"):
        environment.step(None, np.random.default_rng(0))


def test_an_ant_need_not_hear_itself() -> None:
    """It knows of itself that it is done."""
    settings = {"max_steps": 5000, "alpha": 1.0}
    for n in (20, 1):
        levels, steps = lengths(colony(GRID, n, **settings), 3, None)
        for channel in (Everyone(include_self=False), OthersOnly()):
            alike, as_many = lengths(colony(GRID, n, **settings), 3, channel)
            np.testing.assert_array_equal(alike, levels)
            assert as_many == steps


class OthersOnly(Topology):
    """All others, written out."""

    def links(self, x: Any) -> Links:
        n = len(x)
        return Links.from_lists([[j for j in range(n) if j != i] for i in range(n)])


@pytest.mark.parametrize(
    "wrong",
    [
        {"cells": np.full((4, 1), 10**9)},
        {"cells": np.full((4, 1), -1)},
        {"cells": None},
        {"actions": np.full(4, 99)},
        {"actions": np.zeros(4)},
        {"degrees": np.ones((4, 2))},
        {"degrees": np.ones((4, 1), int)},
        {"ants": np.array([0, 1, 2, 7])},
        {"asks": np.zeros(3, bool)},
        {"asks": None},
        {"solutions": None},
    ],
    ids=lambda wrong: next(iter(wrong)),
)
def test_inputs_that_point_elsewhere_are_refused(wrong: dict[str, Any]) -> None:
    source = colony(GRID, n=4)
    ants, environment = Ants(source), StigmergyEnvironment(source, 1)
    rng = np.random.default_rng(0)
    environment.reset(rng)
    ants.reset(4, rng)
    ants.observe(environment.observe())
    good = ants.decide(rng)
    with pytest.raises(ValueError, match="u must hold actions from 0 to"):
        environment.step(good._replace(**wrong), rng)
    environment.step(good, rng)
