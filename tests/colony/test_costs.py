"""Episode costs, against loops over one solution at a time."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acl_gym.colony.costs import (
    Constant,
    Cost,
    FunctionCost,
    Overshoot,
    Quadratic,
    RiseTime,
    SettlingTime,
    StageCosts,
    Steps,
    Sum,
    as_cost,
    cost_from_settings,
    solution_costs,
)
from acl_gym.colony.episodes import Episode, Episodes
from acl_gym.utils.serialization import to_settings

Array = np.ndarray


def episodes(*responses: list[float], longest: int | None = None) -> Episodes:
    """One ant for each response of a single variable; beyond its end NaN."""
    longest = longest or max(len(response) - 1 for response in responses)
    observations = np.full((longest + 1, len(responses), 1), np.nan)
    for ant, response in enumerate(responses):
        observations[: len(response), ant, 0] = response
    shape = longest, len(responses)
    return Episodes(
        observations,
        np.zeros(shape, dtype=np.int64),
        np.ones(shape),
        np.array([len(response) - 1 for response in responses]),
        np.ones(len(responses), dtype=bool),
    )


@st.composite
def walks(draw: st.DrawFn) -> Episodes:
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n, longest, d = (draw(st.integers(1, 5)) for _ in range(3))
    lengths = rng.integers(1, longest + 1, size=n)
    observations = rng.normal(size=(longest + 1, n, d))
    return Episodes(
        observations,
        rng.integers(3, size=(longest, n)),
        rng.normal(size=(longest, n)),
        lengths,
        rng.random(n) < 0.5,
    )


@given(walks())
def test_stage_costs_and_steps(record: Episodes) -> None:
    np.testing.assert_allclose(
        StageCosts()(record),
        [record[ant].stage_costs.sum() for ant in range(len(record))],
    )
    np.testing.assert_array_equal(Steps()(record), record.lengths)


@given(walks(), st.data())
@settings(max_examples=50)
def test_the_quadratic_cost_is_that_of_the_equation(
    record: Episodes, data: st.DataObject
) -> None:
    """(3.2), ant by ant and step by step."""
    rng = np.random.default_rng(data.draw(st.integers(0, 99)))
    d = record.observations.shape[2]
    root = rng.normal(size=(d, d))
    state_weight, goal = root @ root.T, rng.normal(size=d)
    inputs, input_weight = rng.normal(size=(3, 2)), np.array([0.5, 2.0])
    cost = Quadratic(
        tuple(goal),
        tuple(map(tuple, state_weight)),
        tuple(map(tuple, inputs)),
        tuple(input_weight),
    )
    expected = []
    for ant in range(len(record)):
        solution, total = record[ant], 0.0
        for t in range(len(solution.actions)):
            error = solution.observations[t + 1] - goal
            u = inputs[solution.actions[t]]
            total += error @ state_weight @ error + u @ np.diag(input_weight) @ u
        expected.append(total)
    np.testing.assert_allclose(cost(record), expected, rtol=1e-10)
    assert cost_from_settings(to_settings(cost)) == cost


def test_the_quadratic_cost_of_an_angle_goes_the_short_way_round() -> None:
    record = episodes([0.0, 6.0, 0.5])
    cost = Quadratic((0.0,), (1.0,), periods=(2 * np.pi,))
    assert cost(record) == pytest.approx([(6.0 - 2 * np.pi) ** 2 + 0.25])


def test_rise_time_by_hand() -> None:
    """0 to 10: 10% at t = 0.5, 90% at 3 + 1/3; never there; at once; from above."""
    record = episodes(
        [0.0, 2.0, 5.0, 8.0, 11.0, 10.0],
        [0.0, 1.0, 2.0, 1.0],
        [10.0, 10.0],
        [20.0, 15.0, 10.5],
    )
    times = RiseTime(0, 10.0, sampling_time=0.5)(record)
    assert times == pytest.approx(
        [0.5 * (3 + 1 / 3 - 0.5), 0.5 * 3, 0.0, 0.5 * (1 + 4 / 4.5 - 0.2)]
    )


def test_settling_time_by_hand() -> None:
    record = episodes(
        [0.0, 2.0, 1.04, 0.9, 1.01, 1.0],  # leaves the band again at t = 3
        [0.0, 1.0, 1.0],
        [1.0, 1.0],  # never outside
        [0.0, 0.5, 0.2],  # never inside
    )
    times = SettlingTime(0, 1.0, tolerance=0.05, sampling_time=2.0)(record)
    assert times.tolist() == [8.0, 2.0, 0.0, 4.0]


def test_overshoot_by_hand() -> None:
    record = episodes([0.0, 1.5, 0.5], [3.0, 0.25, 2.0], [0.0, 0.5, 1.0], [1.0, 4.0])
    assert Overshoot(0, 1.0)(record).tolist() == [0.5, 0.75, 0.0, 0.0]


def test_an_angle_that_swings_through_its_end() -> None:
    """From 6.0 over 2 pi = 0 to pi: the way is up through 2 pi, not back."""
    turn = 2 * np.pi
    record = episodes([6.0, 0.5, 2.0, 3.3, 3.14])
    unwrapped = episodes([6.0, turn + 0.5, turn + 2.0, turn + 3.3, turn + 3.14])
    for kind in (RiseTime, SettlingTime, Overshoot):
        circular = kind(0, np.pi, period=turn)(record)
        plain = kind(0, turn + np.pi)(unwrapped)
        np.testing.assert_allclose(circular, plain)
    assert Overshoot(0, np.pi, period=turn)(record) == pytest.approx([3.3 - np.pi])


@given(walks())
@settings(max_examples=50)
def test_measures_of_the_response_against_a_loop(record: Episodes) -> None:
    """Each ant alone, with what lies beyond its end cut off."""
    costs: list[Cost] = [
        RiseTime(0, 0.3, low=0.2, high=0.7),
        SettlingTime(0, 0.3, tolerance=0.4),
        Overshoot(0, 0.3),
        StageCosts() + 2.0 * Steps() + 1.5,
    ]
    for cost in costs:
        together = cost(record)
        for ant in range(len(record)):
            one = record[ant]
            alone = Episodes(
                one.observations[:, None],
                one.actions[:, None],
                one.stage_costs[:, None],
                np.array([len(one.actions)]),
                np.array([one.terminated]),
            )
            np.testing.assert_allclose(together[ant], cost(alone)[0])


def test_costs_add_up() -> None:
    record = episodes([0.0, 1.5, 1.0], [0.0, 0.5, 1.0])
    cost = 0.5 * Steps() + 3 + Overshoot(0, 1.0) * 2.0
    assert isinstance(cost, Sum)
    assert cost(record).tolist() == [1 + 3 + 1, 1 + 3 + 0]
    assert cost_from_settings(to_settings(cost)) == cost
    assert (1.0 + Steps())(record).tolist() == [3.0, 3.0]


def test_a_function_of_one_solution_is_a_cost() -> None:
    record = episodes([0.0, 1.0, 5.0], [2.0, 2.0])

    def path_length(solution: Episode) -> float:
        return float(np.abs(np.diff(solution.observations[:, 0])).sum())

    cost = as_cost(path_length)
    assert cost is not None
    assert cost(record).tolist() == [5.0, 0.0]
    restored = cost_from_settings(to_settings(cost + 1.0))
    assert restored is not None
    with pytest.raises(ValueError, match=r"'.*path_length', which a file cannot hold"):
        restored(record)


def test_what_an_episode_hands_out_is_a_copy() -> None:
    record = episodes([0.0, 1.0])
    record[0].observations[:] = 7.0
    assert record.observations[:, 0, 0].tolist() == [0.0, 1.0]


@pytest.mark.parametrize("result", ["a", None, np.nan, [1.0]])
def test_a_function_that_gives_no_number_is_refused(result: object) -> None:
    with pytest.raises((TypeError, ValueError), match="the cost of ant 0 must"):
        FunctionCost(lambda _: result)(episodes([0.0, 1.0]))  # type: ignore[arg-type,return-value]


def test_an_older_file_names_a_function_otherwise() -> None:
    saved = to_settings(2.0 * as_cost(lambda _: 1.0))  # type: ignore[operator]
    text = json.dumps(saved)
    assert "FunctionCost" in text
    older = json.loads(text.replace("FunctionCost", "OwnCost"))
    assert to_settings(cost_from_settings(older)) == to_settings(
        cost_from_settings(saved)
    )


def test_a_cost_that_gives_no_costs_is_refused() -> None:
    class Wrong(Cost):
        def __call__(self, episodes: Episodes) -> Array:
            return np.array([np.inf])

    with pytest.raises(ValueError, match="one finite number for each of the 1 ants"):
        solution_costs(Wrong(), episodes([0.0, 1.0]))


BAD = [
    lambda: RiseTime(-1, 0.0),
    lambda: RiseTime(0, np.nan),
    lambda: RiseTime(0, 1.0, low=0.9, high=0.5),
    lambda: RiseTime(0, 1.0, sampling_time=0.0),
    lambda: SettlingTime(0, 1.0, tolerance=0.0),
    lambda: SettlingTime(0, 1.0, period=-1.0),
    lambda: Overshoot(0, 1.0, period=0.0),
    lambda: Constant(-1.0),
    lambda: Steps() * 0.0,
    lambda: Quadratic((0.0, 0.0), (1.0,)),
    lambda: Quadratic((0.0, 0.0), ((1.0, 2.0), (0.0, 1.0))),
    lambda: Quadratic((0.0,), (-1.0,)),
    lambda: Quadratic((0.0,), (1.0,), inputs=((1.0,),)),
    lambda: Quadratic((0.0,), (1.0,), periods=(None, 1.0)),
    lambda: as_cost("steps"),  # type: ignore[arg-type]
    lambda: as_cost(Steps),  # type: ignore[arg-type]
    lambda: cost_from_settings({"type": "Linear", "start": 1, "end": 2, "trials": 3}),
    lambda: cost_from_settings(3),
    lambda: episodes([0.0, 1.0]).variable(1),
]


@pytest.mark.parametrize("make", BAD)
def test_bad_costs(make: object) -> None:
    with pytest.raises((TypeError, ValueError), match=r"must|belong together"):
        make()  # type: ignore[operator]
