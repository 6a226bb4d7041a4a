"""The grids' kernels, model, masks and states against plain Python."""

import copy
import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binomtest, chisquare

from acl_gym.envs.grid_search import (
    GridSearch1D,
    GridSearch1DEnv,
    GridSearch1DVectorEnv,
    GridSearch2D,
    GridSearch2DEnv,
    GridSearch2DVectorEnv,
    kernels,
)
from acl_gym.envs.grid_search.maps import MAPS
from acl_gym.envs.grid_search.system import GridSearch
from tests.envs.grid_search import reference_grid as reference
from tests.envs.vector_helpers import assert_same_bits, mask_of

NAN = float("nan")
TWO_GOALS = ("..#..G", ".##.#.", "G.....")
MODES = ["NextStep", "SameStep", "Disabled"]


def names_of(system: GridSearch) -> tuple[str, ...]:
    two = isinstance(system, GridSearch2D)
    return reference.NAMES_2D if two else reference.NAMES_1D


def systems(**fixed: Any) -> st.SearchStrategy[GridSearch]:
    p = st.sampled_from([1.0, 0.75, 0.1])
    more = {"transition_probability": p, **{k: st.just(v) for k, v in fixed.items()}}
    return st.one_of(
        st.builds(GridSearch1D, n_states=st.integers(2, 12), **more),
        st.builds(GridSearch2D, desc=reference.worlds(), **more),
    )


@given(systems(), st.integers(0, 2**32 - 1))
def test_a_step_is_that_of_the_reference(system: GridSearch, seed: int) -> None:
    rng = np.random.default_rng(seed)
    names, n = names_of(system), 20
    states = rng.integers(system.n_states, size=n)
    actions = rng.integers(len(names), size=n)
    uniforms = rng.random((1, n)) if system.draws_per_step else None
    moved = states[None].astype(np.float64)
    rewards, reached = np.full(n, NAN), np.zeros(n, dtype=np.bool_)
    system.advance(moved, actions, uniforms, rewards, reached)
    for slot in range(n):
        done = uniforms is None or uniforms[0, slot] < system.transition_probability
        name = names[actions[slot]]
        expected = reference.follow(system.rows, states[slot], name, done)
        assert (moved[0, slot], reached[slot]) == expected
    assert (rewards == -1.0).all()


@given(systems())
def test_outcomes_are_those_of_the_reference(system: GridSearch) -> None:
    names, p = names_of(system), system.transition_probability
    outcomes = system.outcomes()
    shape = (system.n_states, len(names), 1 if p == 1.0 else 2)
    assert [array.shape for array in outcomes] == [shape] * 4
    np.testing.assert_allclose(outcomes.probability.sum(axis=-1), 1.0, rtol=1e-15)
    for state, action, k in np.ndindex(shape):
        probability, follower, reward, terminated = (
            array[state, action, k] for array in outcomes
        )
        assert probability == (p if k == 0 else 1.0 - p)
        if state in system.goal_states:
            assert (follower, reward, terminated) == (state, 0.0, True)
        else:
            expected = reference.follow(system.rows, state, names[action], k == 0)
            assert ((follower, terminated), reward) == (expected, -1.0)


@given(systems())
def test_cells_and_goals(system: GridSearch) -> None:
    cells = reference.cells_of(system.rows)
    assert system.cells.tolist() == [list(cell) for cell in cells]
    goals = [s for s, (i, j) in enumerate(cells) if system.rows[i][j] == "G"]
    assert system.goal_states.tolist() == goals
    assert system.observation_space == spaces.Discrete(len(cells))
    assert system.action_space == spaces.Discrete(len(names_of(system)))
    starts = [[s] for s in range(len(cells)) if s not in goals]
    assert system.evaluation_states().tolist() == starts
    # What is handed out is the caller's.
    system.cells[:] = 0
    system.goal_states[:] = 0
    for array in system.outcomes():
        array[:] = 0
    assert system.cells.tolist() == [list(cell) for cell in cells]
    assert system.outcomes().probability.all()


@pytest.mark.parametrize("p", [1.0, 0.5])
@pytest.mark.parametrize("name", ["1-D", "11x11"])
def test_value_iteration_over_the_outcomes(name: str, p: float) -> None:
    system: GridSearch = (
        GridSearch1D(transition_probability=p)
        if name == "1-D"
        else GridSearch2D(map_name=name, transition_probability=p)
    )
    outcomes = system.outcomes()
    value = np.zeros(system.n_states)
    for _ in range(400):
        future = np.where(outcomes.terminated, 0.0, value[outcomes.next_state])
        value = (outcomes.probability * (outcomes.reward + future)).sum(-1).max(-1)
    steps = np.array(reference.distances(system.rows))
    np.testing.assert_allclose(-value, steps / p, rtol=1e-12)
    starts = system.evaluation_states()[:, 0].astype(int)
    expected = 5.0 if name == "1-D" else reference.mean_path(system.rows)
    assert -value[starts].mean() == pytest.approx(expected / p)


def test_actions_have_the_documented_directions() -> None:
    env = GridSearch2DEnv(desc=["...", "...", "..G"])
    for action, state in enumerate((1, 7, 5, 3)):  # north, south, east, west of 4
        env.reset(options={"state": 4})
        assert env.step(action)[0] == state
    row = GridSearch1DEnv()
    for action, state in enumerate((3, 5)):
        row.reset(options={"state": 4})
        assert row.step(action)[0] == state


@pytest.mark.parametrize("p", [0.9, 0.5, 0.05])
def test_moves_fail_as_often_as_they_should(p: float) -> None:
    n = 20_000
    env = GridSearch2DVectorEnv(n, transition_probability=p)
    state = int(env.system.evaluation_states()[0, 0])
    action = int(np.flatnonzero(env.system._offered[state])[0])
    env.reset(seed=1, options={"state": np.full(n, state)})
    observations, rewards, *_ = env.step(np.full(n, action))
    moves = int((observations != state).sum())
    assert binomtest(moves, n, p).pvalue > 1e-3
    assert set(rewards.tolist()) == {-1.0}


def test_random_numbers_are_drawn_only_where_moves_may_fail() -> None:
    assert GridSearch2D().draws_per_step == 0
    assert GridSearch1D(transition_probability=0.999).draws_per_step == 1


@pytest.mark.parametrize(
    "system",
    [GridSearch1D(), GridSearch2D(), GridSearch2D(desc=TWO_GOALS)],
    ids=["1-D", "11x11", "two goals"],
)
def test_samples_are_uniform_without_the_goals(system: GridSearch) -> None:
    states = system.sample_states(np.random.default_rng(2), 20_000)
    assert states.shape == (1, 20_000)
    counts = np.bincount(states[0].astype(int), minlength=system.n_states)
    assert not counts[system.goal_states].any()
    assert chisquare(np.delete(counts, system.goal_states)).pvalue > 1e-3


@pytest.mark.parametrize(
    ("system", "steps", "chance"),
    [
        (GridSearch1D(), 50, 0.57),
        (GridSearch2D(map_name="11x11"), 435, 0.50),
        (GridSearch2D(map_name="21x21"), 1395, 0.29),
        (GridSearch2D(map_name="31x31"), 3205, 0.45),
    ],
    ids=["1-D", *MAPS],
)
def test_a_random_walk_has_a_fair_chance(
    system: GridSearch, steps: int, chance: float
) -> None:
    assert system.evaluation_steps == steps
    found = np.zeros(system.n_states)
    found[system.goal_states] = 1.0
    follow = system.outcomes().next_state[..., 0]
    for _ in range(steps):
        found = found[follow].mean(axis=1)
    starts = np.delete(found, system.goal_states)
    assert starts.mean() == pytest.approx(chance, abs=0.005)


def test_failing_moves_leave_more_steps() -> None:
    assert GridSearch1D(transition_probability=0.4).evaluation_steps == 125
    assert GridSearch2D(transition_probability=0.5).evaluation_steps == 870


def test_kernels_run_the_same_without_the_compiler() -> None:
    system = GridSearch2D(desc=TWO_GOALS)
    rng = np.random.default_rng(3)
    states, actions = rng.integers(0, system.n_states, 60), rng.integers(0, 4, 60)
    uniforms = rng.random(60)
    for kernel, chance in (
        (kernels.move, ()),
        (kernels.move_or_fail, (uniforms, 0.5)),
    ):
        results = []
        for run in (kernel, kernel.py_func):
            arrays = [states.astype(float), np.empty(60), np.empty(60, dtype=np.bool_)]
            tables = (system._next_state, system._goal)
            run(arrays[0], actions, *chance, *tables, *arrays[1:])
            results.append(arrays)
        assert results[0][2].any()
        assert not results[0][2].all()
        for ours, plain in zip(*results, strict=True):
            assert_same_bits(ours, plain)


# --- states


@pytest.mark.parametrize("state", [7, np.int64(7), 7.0, [7], np.array([7])], ids=repr)
def test_one_state_is_a_number(state: Any) -> None:
    observation, _ = GridSearch2DEnv().reset(options={"state": state})
    assert observation == 7
    assert observation.dtype == np.int64


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("begun", [False, True])
def test_states_of_slots_are_numbers(mode: str, begun: bool) -> None:
    env = GridSearch2DVectorEnv(3, autoreset_mode=mode)
    if begun:
        env.reset(seed=1)
    for states in ([3, 1, 4], np.array([[3], [1], [4]]), np.array([3.0, 1.0, 4.0])):
        observations, _ = env.reset(options={"state": states})
        assert observations.tolist() == [3, 1, 4]
        assert observations.dtype == np.int64
        assert env.states.tolist() == [[3.0], [1.0], [4.0]]


@pytest.mark.parametrize("column", [False, True])
def test_rows_outside_the_mask_are_not_looked_at(column: bool) -> None:
    env = GridSearch2DVectorEnv(4)
    env.reset(options={"state": [0, 1, 2, 3]})
    states = np.array([NAN, 7.0, -5.0, 8.0])
    states = states[:, None] if column else states
    options = {"state": states, "reset_mask": mask_of(4, 1, 3)}
    assert env.reset(options=options)[0].tolist() == [0, 7, 2, 8]
    options["reset_mask"] = mask_of(4, 1, 2)
    with pytest.raises(ValueError, match=r"0\.\.86, got -5 in row 2"):
        env.reset(options=options)


@pytest.mark.parametrize(
    ("states", "message"),
    [
        ([0, 87], r"integers of 0\.\.86, got 87 in row 1"),
        ([0.5, 0], r"integers of 0\.\.86, got 0.5 in row 0"),
        ([0, -1], "got -1 in row 1"),
        ([NAN, 0], "got nan in row 0"),
        ([[0, 1], [1, 2]], r"shape \(n,\) or \(n, 1\), got \(2, 2\)"),
        (1, r"shape \(n,\) or \(n, 1\), got \(\)"),
        ([[[0]], [[1]]], r"got \(2, 1, 1\)"),
        ([True, False], "states must be an array of real numbers"),
    ],
)
def test_message_names_a_bad_state(states: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        GridSearch2D().checked_states(states)


def test_a_goal_is_an_initial_state_like_any_other() -> None:
    env = GridSearch2DEnv(desc=["..#", "G.."])
    assert env.reset(options={"state": 2})[0] == 2
    assert env.step(0)[:3] == (0, -1.0, False)
    env.reset(options={"state": 2})
    assert env.step(1)[:3] == (2, -1.0, True)  # blocked: it is in the goal still


# --- masks


@given(systems(mask_blocked=True))
def test_masks_leave_out_what_is_blocked(system: GridSearch) -> None:
    states = np.arange(system.n_states, dtype=np.float64)[None]
    mask = system.action_mask(states)
    names = names_of(system)
    expected = [
        [reference.follow(system.rows, s, name)[0] != s for name in names]
        for s in range(system.n_states)
    ]
    assert mask.tolist() == expected
    assert mask.any(axis=1).all()
    assert not np.shares_memory(mask, system.action_mask(states))


def test_mask_of_the_single_environment() -> None:
    env = gym.make("acl_gym/GridSearch2D-v0", mask_blocked=True, desc=["..", "G."])
    _, info = env.reset(options={"state": 0})
    assert info["action_mask"].dtype == np.bool_
    assert info["action_mask"].tolist() == [False, True, True, False]
    # The space samples with it, and the mask is the caller's.
    mask = info["action_mask"].astype(np.int8)
    assert {int(env.action_space.sample(mask)) for _ in range(50)} == {1, 2}
    info["action_mask"][:] = True
    _, *_, info = env.step(2)
    assert info["action_mask"].tolist() == [False, True, False, True]
    assert env.reset(options={"state": 0})[1]["action_mask"].sum() == 2


@pytest.mark.parametrize("mode", MODES)
def test_masks_of_all_slots(mode: str) -> None:
    env = GridSearch2DVectorEnv(
        5,
        desc=TWO_GOALS,
        mask_blocked=True,
        autoreset_mode=mode,
        max_episode_steps=7,
    )
    rng = np.random.default_rng(4)
    observations, infos = env.reset(seed=4)
    finals = 0
    for _ in range(200):
        mask = infos["action_mask"]
        assert_same_bits(mask, env.system._offered[observations])
        assert_same_bits(infos["_action_mask"], np.ones(5, dtype=np.bool_))
        actions = np.array([rng.choice(np.flatnonzero(row)) for row in mask])
        mask[:] = False
        observations, _, terminated, truncated, infos = env.step(actions)
        finished = terminated | truncated
        if mode == "SameStep" and finished.any():
            finals += 1
            last = infos["final_info"]
            assert_same_bits(last["_action_mask"], finished)
            for slot in range(5):
                expected = np.zeros(4, dtype=np.bool_)
                if finished[slot]:
                    expected = env.system._offered[infos["final_obs"][slot]]
                assert_same_bits(last["action_mask"][slot], expected)
        if mode == "Disabled" and finished.any():
            observations, infos = env.reset(options={"reset_mask": finished})
    assert (finals > 20) == (mode == "SameStep")


def test_no_masks_unless_asked_for() -> None:
    assert GridSearch2D().action_mask(np.zeros((1, 3))) is None
    assert GridSearch2DVectorEnv(2).reset()[1] == {}


# --- parameters


@pytest.mark.parametrize("make", [GridSearch1DEnv, GridSearch2DVectorEnv])
@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(
            ("transition_probability", v)
            for v in (0.0, 5e-324, -0.1, 1.1, NAN, "1", None, True)
        ),
        *(("mask_blocked", value) for value in (1, None, "yes")),
    ],
)
def test_bad_value_is_refused_by_name(make: Any, name: str, value: Any) -> None:
    with pytest.raises((TypeError, ValueError), match=rf"^{name} must"):
        make(**{name: value})


@pytest.mark.parametrize("value", [1, 0, -1, 2.0, "10", None, True])
def test_bad_length_is_refused(value: Any) -> None:
    with pytest.raises((TypeError, ValueError), match=r"^n_states must"):
        GridSearch1D(n_states=value)


@pytest.mark.parametrize("value", ["12x12", "", None, 11, ["11x11"]])
def test_unknown_map_is_refused(value: Any) -> None:
    with pytest.raises(ValueError, match=r"^map_name must be one of '11x11', '21x21'"):
        GridSearch2D(map_name=value)


def test_own_map_takes_precedence() -> None:
    desc = "...\n.G.\n..."
    systems = [GridSearch2D(desc=desc), GridSearch2D(desc=desc, map_name="31x31")]
    assert [system.n_states for system in systems] == [9, 9]
    assert systems[0] == GridSearch2D(desc=["...", ".G.", "..."])
    assert hash(systems[0]) == hash(GridSearch2D(desc=("...", ".G.", "...")))
    with pytest.raises(ValueError, match="no goal"):
        GridSearch2D(desc="")


@pytest.mark.parametrize("name", MAPS)
def test_number_of_states(name: str) -> None:
    free = {"11x11": 86, "21x21": 278, "31x31": 640}[name]
    system = GridSearch2D(map_name=name)
    assert system.n_states == free + 1
    assert system.evaluation_states().shape == (free, 1)
    assert system.max_stage_cost == 1.0


def test_parameters_do_not_change() -> None:
    desc = ["..", ".G"]
    env = GridSearch2DVectorEnv(2, desc=desc)
    desc[0] = "##"
    assert env.with_slots(3).system == env.system
    with pytest.raises(AttributeError):
        env.system.map_name = "31x31"
    for twin in (copy.deepcopy(env.system), pickle.loads(pickle.dumps(env.system))):
        assert twin == env.system
        assert twin.cells.tolist() == [[0, 0], [0, 1], [1, 0], [1, 1]]


def test_parameters_pass_through_the_registry() -> None:
    env = gym.make_vec("acl_gym/GridSearch1D-v0", num_envs=2, n_states=4)
    assert type(env.unwrapped) is GridSearch1DVectorEnv
    assert env.single_observation_space == spaces.Discrete(4)
    env = gym.make("acl_gym/GridSearch2D-v0", desc=["..", ".G"])
    assert gym.make(env.spec).observation_space == spaces.Discrete(4)
    assert '".G"' in env.spec.to_json()


@pytest.mark.parametrize("n_states", [1_000_001, 10**12])
def test_a_row_has_an_end(n_states: int) -> None:
    """Not by way of an empty MemoryError, or of none."""
    with pytest.raises(ValueError, match="n_states must be at most 1000000, got"):
        GridSearch1D(n_states=n_states)
