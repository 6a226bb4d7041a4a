"""The travelling salesman's environment: tours, masks, refusals, limits, agents.

What it has in common with the control systems is tested in tests/envs/control.
"""

from __future__ import annotations

import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import SyncVectorEnv

from acl_gym import (
    ACL,
    QLearning,
    ReturningACL,
    automatic_partition,
    evaluate_policy_cost,
    fuzzy_q_iteration,
)
from acl_gym.envs.graph import (
    TravellingSalesmanInstance,
    load_instance,
    optimal_tour,
)
from acl_gym.envs.graph.travelling_salesman import (
    TravellingSalesman,
    TravellingSalesmanEnv,
    TravellingSalesmanVectorEnv,
    kernels,
)
from acl_gym.envs.limits import RegisteredLimit, time_limit
from acl_gym.planning.model import TabularModel
from tests.envs.systems import tour_state

TOUR = "acl_gym/TravellingSalesman-v0"
ASYMMETRIC = [[0, 1, 9, 2], [2, 0, 3, 7], [4, 8, 0, 5], [6, 1, 1, 0]]
MODES = ("NextStep", "SameStep", "Disabled")


def walk(env: Any, tours: np.ndarray) -> tuple[np.ndarray, list[np.ndarray], Any]:
    """Let each slot walk its tour; return the lengths, the masks and the last step."""
    _, infos = env.reset(options={"state": tours[:, 0]})
    lengths, masks = np.zeros(len(tours)), [infos["action_mask"]]
    for cities in (*tours.T[1:], tours[:, 0]):
        step = env.step(cities)
        lengths -= step[1]
        masks.append(step[4]["action_mask"])
    return lengths, masks, step


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("n_cities", [2, 3, 4, 7])
def test_tours_have_their_length_and_masks_leave_the_rest(
    n_cities: int, mode: str
) -> None:
    rng = np.random.default_rng(n_cities)
    instance = TravellingSalesmanInstance.from_distances(
        rng.uniform(1, 2, (n_cities, n_cities))
    )
    env = gym.make_vec(TOUR, num_envs=6, instance=instance, autoreset_mode=mode)
    tours = np.array([rng.permutation(n_cities) for _ in range(6)])
    lengths, masks, last = walk(env, tours)
    np.testing.assert_allclose(lengths, instance.length(tours), rtol=1e-14)
    for arcs, mask in enumerate(masks[:-1]):
        assert mask.dtype == np.int8
        assert mask.shape == (6, n_cities)
        for row, tour in zip(mask, tours, strict=True):
            left = tour[arcs + 1 :] if arcs < n_cities - 1 else tour[:1]
            assert np.flatnonzero(row).tolist() == sorted(left)
    observations, _, terminated, truncated, infos = last
    assert terminated.all()
    assert not truncated.any()
    if mode != "SameStep":
        assert observations.tolist() == tours[:, 0].tolist()
        assert infos["is_success"].all()
    # No row is empty, also where nobody will walk on: a choice can always be made.
    assert masks[-1].any(axis=1).all()


@pytest.mark.parametrize("form", ["single", "vector"])
def test_a_tour_ends_neither_earlier_nor_later(form: str) -> None:
    tour = optimal_tour("att48")
    if form == "single":
        env: Any = gym.make(TOUR)
        env.reset(options={"state": int(tour[0])})
    else:
        env = gym.make_vec(TOUR, num_envs=1)
        env.reset(options={"state": tour[:1]})
    total = 0.0
    for arc, city in enumerate((*tour[1:], tour[0]), start=1):
        action = city if form == "single" else np.array([city])
        observation, reward, terminated, truncated, _ = env.step(action)
        assert observation == city
        assert np.all(terminated) == (arc == 48)
        assert not np.any(truncated)
        total -= float(np.squeeze(reward))
    assert total == 10_628.0


def test_every_reward_is_minus_the_distance_of_the_arc() -> None:
    env = gym.make(TOUR, distances=ASYMMETRIC, start=1)
    here, _ = env.reset(seed=0)
    assert here == 1
    for city in (3, 0, 2, 1):
        _, reward, *_ = env.step(city)
        assert reward == -ASYMMETRIC[here][city]
        here = city


@pytest.mark.parametrize(
    ("walked", "city", "message"),
    [
        ((), 0, "a city that the ant has not visited, got city 0 after 0 arcs"),
        ((1,), 0, "a city that the ant has not visited, got city 0 after 1 arcs"),
        ((1,), 1, "a city that the ant has not visited, got city 1 after 1 arcs"),
        ((1, 2, 3), 3, "the first city, 0, to close the tour, got city 3 after 3 arcs"),
        ((1, 2, 3), 2, "the first city, 0, to close the tour, got city 2 after 3 arcs"),
        ((), 4, r"actions must lie in 0\.\.3, got 4"),
        ((), -1, r"actions must lie in 0\.\.3, got -1"),
    ],
)
def test_illegal_actions_are_errors_that_change_nothing(
    walked: tuple[int, ...], city: int, message: str
) -> None:
    single = TravellingSalesmanEnv(distances=ASYMMETRIC, start=0)
    vector = TravellingSalesmanVectorEnv(3, distances=ASYMMETRIC, start=0)
    single.reset()
    vector.reset()
    for each in walked:
        single.step(each)
        vector.step([each] * 3)
    legal = [1, 2, 3, 0][len(walked)]
    states = vector.states
    with pytest.raises(ValueError, match=f"{message}.*slot 0"):
        single.step(city)
    with pytest.raises(ValueError, match=f"{message}.*slot 1"):
        vector.step([legal, city, legal])
    np.testing.assert_array_equal(vector.states, states)
    assert single.step(legal)[0] == legal
    assert vector.step([legal] * 3)[0].tolist() == [legal] * 3


@pytest.mark.parametrize("mode", MODES)
def test_an_illegal_action_is_named_by_its_slot_beside_idle_ones(mode: str) -> None:
    env = TravellingSalesmanVectorEnv(5, distances=ASYMMETRIC, autoreset_mode=mode)
    done, begun = tour_state(1, 2, 3, 0, n_cities=4), tour_state(0, n_cities=4)
    env.reset(options={"state": [begun, done, begun, begun, begun], "finished": "wait"})
    env.step([1, 1, 1, 1, 1])  # slot 1 closes its tour
    with pytest.raises(ValueError, match="got city 1 after 1 arcs in slot 3"):
        env.step([2, 1, 2, 1, 2])
    # What an idle slot is told does not matter.
    assert env.step([2, 1, 2, 2, 2])[0].tolist() == [2, 1, 2, 2, 2]


def test_legal_random_walks_end_in_any_mode() -> None:
    for mode in MODES:
        env = gym.make_vec(TOUR, num_envs=4, instance="eil51", autoreset_mode=mode)
        rng = np.random.default_rng(0)
        _, infos = env.reset(seed=1)
        ended = 0
        for _ in range(2 * 51 + 2):
            chances = np.where(infos["action_mask"], rng.random((4, 51)), -1.0)
            _, _, terminated, _, infos = env.step(chances.argmax(axis=1))
            ended += terminated.sum()
            if mode == "Disabled" and terminated.any():
                _, infos = env.reset(options={"reset_mask": terminated})
        assert ended == 8


@pytest.mark.parametrize(
    ("given", "name", "cities"),
    [
        ({}, "att48", 48),
        ({"instance": "eil51"}, "eil51", 51),
        ({"instance": load_instance("eil51")}, "eil51", 51),
        ({"distances": ASYMMETRIC}, "distances", 4),
        ({"distances": np.array(ASYMMETRIC)}, "distances", 4),
        ({"coordinates": [[0, 0], [0, 3], [4, 0]]}, "coordinates", 3),
        (
            {"distances": ASYMMETRIC, "coordinates": np.zeros((4, 2))},
            "distances",
            4,
        ),
    ],
)
@pytest.mark.parametrize("form", ["single", "vector"])
def test_where_the_cities_come_from(
    given: dict[str, Any], name: str, cities: int, form: str
) -> None:
    made = gym.make(TOUR, **given) if form == "single" else gym.make_vec(TOUR, **given)
    env: Any = made.unwrapped
    assert env.instance.name == name
    assert env.distances is env.instance.distances
    assert env.coordinates is env.instance.coordinates
    assert env.optimum == env.instance.optimum
    space = "observation_space" if form == "single" else "single_observation_space"
    assert getattr(env, space) == gym.spaces.Discrete(cities)


def test_cities_of_a_file(tmp_path: Any) -> None:
    file = tmp_path / "three.tsp"
    lines = ("NAME: three", "TYPE: TSP", "DIMENSION: 3", "EDGE_WEIGHT_TYPE: EUC_2D")
    places = ("NODE_COORD_SECTION", "1 0 0", "2 3 4", "3 0 8", "EOF")
    file.write_text("\n".join((*lines, *places)))
    env: Any = gym.make_vec(TOUR, num_envs=2, tsplib=str(file)).unwrapped
    assert env.instance.name == "three"
    file.unlink()  # more slots need the file no more
    assert env.with_slots(3).instance == env.instance
    with pytest.raises(FileNotFoundError):
        gym.make(TOUR, tsplib=str(file))


def test_metrics_of_coordinates() -> None:
    given: dict[str, Any] = {"coordinates": [[0, 0], [1, 1]]}
    assert TravellingSalesman(**given).cities.distances[0, 1] == np.sqrt(2)
    assert TravellingSalesman(**given, metric="ceil_2d").cities.distances[0, 1] == 2.0


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"instance": "eil51", "distances": ASYMMETRIC}, "got instance and distances"),
        ({"instance": "eil51", "tsplib": "x"}, "got instance and tsplib"),
        ({"coordinates": [[0, 0], [1, 1]], "tsplib": "x"}, "coordinates and tsplib"),
        ({"instance": "eil5"}, "Did you mean 'eil51'"),
        ({"instance": 3}, "instance must be one of"),
        ({"metric": "att"}, "metric is for coordinates alone, got 'att' with none"),
        ({"start": "first"}, "start must be 'random' or the number of a city"),
        ({"start": 48}, "start must be at most 47, got 48"),
        ({"start": -1}, "start must be at least 0, got -1"),
        ({"distances": [[0, -1], [1, 0]]}, "distances must be finite, >= 0"),
        ({"tsplib": ""}, "path must be the name of a file"),
    ],
)
def test_bad_parameters_have_one_clear_error(
    given: dict[str, Any], message: str
) -> None:
    for make in (gym.make, gym.make_vec):
        with pytest.raises(ValueError, match=message):
            make(TOUR, **given)


def test_types_of_start() -> None:
    assert TravellingSalesmanEnv(start=np.int64(3)).reset()[0] == 3
    for bad in (1.0, True, None):
        with pytest.raises(TypeError, match="start must be an integer"):
            TravellingSalesmanEnv(start=bad)


def test_first_cities_are_random_or_fixed() -> None:
    env = gym.make_vec(TOUR, num_envs=4_800)
    first = env.reset(seed=0)[0]
    counts = np.bincount(first, minlength=48)
    # Each of 48 cities is expected 100 times, with a standard deviation of 9.9.
    assert 60 < counts.min() <= counts.max() < 140
    fixed = gym.make_vec(TOUR, num_envs=5, start=7)
    assert fixed.reset(seed=0)[0].tolist() == [7] * 5
    # An action space with the same seed does not sample the cities where ants are.
    single = gym.make(TOUR)
    single.action_space.seed(0)
    same = [single.reset(seed=0)[0] == single.action_space.sample()]
    same += [single.reset()[0] == single.action_space.sample() for _ in range(199)]
    assert sum(same) < 20  # 4.2 of 200 are expected


def test_states_given_as_first_cities() -> None:
    env = TravellingSalesmanVectorEnv(3, distances=ASYMMETRIC)
    for given in ([2, 0, 1], np.array([[2.0], [0.0], [1.0]])):
        assert env.reset(options={"state": given})[0].tolist() == [2, 0, 1]
    # Rows of slots that are not reset may hold anything.
    mask = np.array([False, True, False])
    options = {"state": [np.nan, 3, -9], "reset_mask": mask}
    assert env.reset(options=options)[0].tolist() == [2, 3, 1]
    with pytest.raises(ValueError, match=r"integers of 0\.\.3, got 4 in row 1"):
        env.reset(options={"state": [0, 4, 0]})
    single = TravellingSalesmanEnv(distances=ASYMMETRIC)
    assert single.reset(options={"state": 3})[0] == 3
    assert single.reset(options={"state": [2]})[0] == 2


def test_tours_can_be_continued_from_any_state() -> None:
    env = TravellingSalesmanVectorEnv(2, distances=ASYMMETRIC)
    env.reset(options={"state": [0, 1]})
    env.step([2, 3])
    kept = env.states
    later = env.with_slots(2)
    _, infos = later.reset(options={"state": kept})
    assert infos["action_mask"].tolist() == [[0, 1, 0, 1], [1, 0, 1, 0]]
    for actions in ([1, 0], [3, 2], [0, 1]):
        for mine, other in zip(
            env.step(actions)[:4], later.step(actions)[:4], strict=True
        ):
            np.testing.assert_array_equal(mine, other)
    # A closed tour is a state as well, from which a new one begins.
    closed = env.states
    _, infos = later.reset(options={"state": closed})
    assert infos["action_mask"].tolist() == [[0, 1, 1, 1], [1, 0, 1, 1]]
    _, rewards, terminated, *_ = later.step([3, 0])
    assert rewards.tolist() == [-2.0, -2.0]
    assert not terminated.any()
    assert later.states[0].tolist() == list(tour_state(0, 3, n_cities=4))


def test_the_limit_of_the_id_never_cuts_a_tour() -> None:
    assert gym.spec(TOUR).max_episode_steps == 100_000
    env: Any = gym.make_vec(TOUR, num_envs=1, instance="lin318").unwrapped
    assert env.max_episode_steps == 319
    assert isinstance(env.max_episode_steps, RegisteredLimit)
    assert isinstance(env.with_slots(2).max_episode_steps, RegisteredLimit)
    assert env.system.evaluation_steps == 319
    assert time_limit(env) == 319
    chosen: Any = gym.make_vec(TOUR, num_envs=1, max_episode_steps=20).unwrapped
    assert chosen.max_episode_steps == 20
    assert gym.make_vec(TOUR, max_episode_steps=-1).unwrapped.max_episode_steps is None


def test_a_chosen_limit_truncates() -> None:
    env = TravellingSalesmanVectorEnv(1, distances=ASYMMETRIC, max_episode_steps=2)
    env.reset(options={"state": [0]})
    assert not env.step([1])[3].any()
    _, _, terminated, truncated, infos = env.step([2])
    assert (terminated.tolist(), truncated.tolist()) == ([False], [True])
    assert infos["is_success"].tolist() == [False]


def test_what_agents_know_of_the_system() -> None:
    system = TravellingSalesman(distances=ASYMMETRIC)
    assert system.max_stage_cost == 9.0
    assert system.n_cities == 4
    assert system.evaluation_states()[:, 0].tolist() == [0, 1, 2, 3]
    large = TravellingSalesman(instance="lin318").evaluation_states()
    assert len(np.unique(large[:, 0])) == 100
    assert large[:, 0].max() > 310
    fixed = TravellingSalesman(distances=ASYMMETRIC, start=2).evaluation_states()
    assert fixed[:, :3].tolist() == [[2, 2, 0]]
    assert system == TravellingSalesman(distances=np.array(ASYMMETRIC))
    assert hash(system) == hash(TravellingSalesman(distances=ASYMMETRIC))
    # The city alone does not tell which cities are left: no model of a finite MDP.
    with pytest.raises(TypeError, match="must publish its model"):
        TabularModel.from_env(TravellingSalesmanEnv())
    env = gym.make_vec(TOUR, distances=ASYMMETRIC)
    with pytest.raises(TypeError, match="must show its state"):
        fuzzy_q_iteration(env, automatic_partition(env))


def test_native_is_the_synchronous_one_with_masks() -> None:
    native = gym.make_vec(TOUR, num_envs=3, distances=ASYMMETRIC)
    sync = SyncVectorEnv([lambda: gym.make(TOUR, distances=ASYMMETRIC)] * 3)
    rng = np.random.default_rng(0)
    native.reset(options={"state": [0, 1, 2]})
    sync.reset(seed=[1, 2, 3])
    for slot, env in enumerate(sync.envs):
        env.reset(options={"state": slot})
    infos = native.unwrapped._infos()
    for _ in range(4):
        chances = np.where(infos["action_mask"], rng.random((3, 4)), -1.0)
        actions = chances.argmax(axis=1)
        mine, other = native.step(actions), sync.step(actions)
        for ours, theirs in zip(mine[:4], other[:4], strict=True):
            np.testing.assert_array_equal(ours, theirs)
        infos = mine[4]
        for key in ("action_mask", "_action_mask"):
            assert infos[key].dtype == other[4][key].dtype
            np.testing.assert_array_equal(infos[key], other[4][key])


def test_same_seed_same_bits() -> None:
    def returns(seed: int) -> bytes:
        env = gym.make_vec(TOUR, num_envs=8, instance="eil51")
        rng = np.random.default_rng(3)
        _, infos = env.reset(seed=seed)
        rows = []
        for _ in range(110):
            chances = np.where(infos["action_mask"], rng.random((8, 51)), -1.0)
            observations, rewards, *_, infos = env.step(chances.argmax(axis=1))
            rows += [observations.tobytes(), rewards.tobytes()]
        return b"".join(rows)

    assert returns(0) == returns(0)
    assert returns(0) != returns(1)


def test_environments_survive_a_pickle() -> None:
    env = TravellingSalesmanVectorEnv(2, instance="att48")
    env.reset(seed=0)
    twin = pickle.loads(pickle.dumps(env))
    assert twin.instance == env.instance
    np.testing.assert_array_equal(twin.reset()[0], env.reset()[0])


def test_too_many_slots_are_refused_before_memory_is_taken() -> None:
    with pytest.raises(
        ValueError, match=r"tours of .* slots through 48 cities must fit"
    ):
        TravellingSalesmanVectorEnv(200_000_000)


def test_kernels_run_the_same_without_the_compiler() -> None:
    rng = np.random.default_rng(0)
    system = TravellingSalesman(distances=ASYMMETRIC)
    tours = np.array([rng.permutation(4) for _ in range(20)])
    runs = []
    for plain in (False, True):
        start, illegal, advance, allowed = (
            kernel.py_func if plain else kernel
            for kernel in (
                kernels.start,
                kernels.first_illegal,
                kernels.advance,
                kernels.allowed,
            )
        )
        states = np.empty((7, 20))
        start(states, tours[:, 0])
        seen = []
        for cities in (*tours.T[1:], tours[:, 0], tours[:, 1]):
            mask = np.empty((20, 4), np.int8)
            allowed(states, mask)
            assert mask[np.arange(20), cities].all()
            wrong = np.array([np.argmin(row) for row in mask])
            assert illegal(states, wrong) == 0
            assert illegal(states, cities) == -1
            rewards, reached = np.empty(20), np.empty(20, np.bool_)
            advance(states, cities, system.cities.distances, rewards, reached)
            seen += [
                states.tobytes(),
                mask.tobytes(),
                rewards.tobytes(),
                reached.tobytes(),
            ]
        runs.append(seen)
    assert runs[0] == runs[1]


@pytest.mark.parametrize("kind", [ACL, QLearning, ReturningACL])
def test_tabular_agents_learn_tours(kind: Any) -> None:
    # Ten cities on a circle: the shortest tour goes around.
    angles = 2 * np.pi * np.arange(10) / 10
    places = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    settings = {ACL: {"tau0": 1e-3}}.get(kind, {})
    env = gym.make_vec(TOUR, num_envs=10, coordinates=places)
    agent = kind(env, seed=0, **settings)
    first = evaluate_policy_cost(agent, env)
    agent.learn(trials=60)
    last = evaluate_policy_cost(agent, env)
    assert last.success_rate == 1.0
    assert set(last.lengths.tolist()) == {10}
    around = 10 * 2 * np.sin(np.pi / 10)
    assert around - 1e-9 <= last.cost < first.cost


def test_what_idle_masks_do_to_agents_through_gymnasium() -> None:
    env = SyncVectorEnv([lambda: gym.make(TOUR, distances=ASYMMETRIC)] * 3)
    agent = QLearning(env, seed=0, max_steps=5)
    agent.learn(trials=30)
    result = evaluate_policy_cost(agent, env, max_steps=5)
    assert result.lengths.tolist() == [4, 4, 4]
