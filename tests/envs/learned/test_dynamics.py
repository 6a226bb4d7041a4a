"""Dynamics learned from recordings."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from sklearn.linear_model import Ridge

from acl_gym import Transitions
from acl_gym.envs.learned import LearnedDynamics
from acl_gym.envs.learned.regression import KINDS, Fit, folds_of
from tests.envs.learned.recordings import line, pendulum


def predicted(dynamics: LearnedDynamics, data: Transitions, **how: Any) -> Any:
    angles = data.description.shown_angles
    x = np.ascontiguousarray(angles.variables(data.states).T)
    return dynamics.next_variables(x, np.ascontiguousarray(data.inputs.T), **how).T


def missed(dynamics: LearnedDynamics, data: Transitions) -> Any:
    angles = data.description.shown_angles
    found = predicted(dynamics, data) - angles.variables(data.next_states)
    found[:, 0] = (found[:, 0] + np.pi) % (2 * np.pi) - np.pi
    return np.sqrt((found**2).mean(axis=0))


def other(steps: int = 300) -> Transitions:
    env = gym.make("acl_gym/Pendulum-v0", max_episode_steps=10)
    return Transitions.record(env, steps, hold=3, seed=9)


def test_sixty_steps_tell_the_dynamics_of_the_pendulum() -> None:
    """A step of the pendulum changes the angle by up to 0.9, the velocity by 3."""
    dynamics = LearnedDynamics(pendulum())
    assert dynamics.regressor == "gaussian process"
    assert all(error < 0.02 for error in dynamics.errors.values())
    angle, velocity = missed(dynamics, other())
    assert angle < 0.01
    assert velocity < 0.1
    assert "gaussian process; errors: angle theta" in repr(dynamics)


@pytest.mark.parametrize("unit", [1e-10, 1e10])
def test_the_unit_of_a_variable_does_not_matter(unit: float) -> None:
    data = line()
    x, y = data["states"], data["next_states"]
    usual = LearnedDynamics(Transitions(**data), "gaussian process")
    scaled = {**data, "states": unit * x, "next_states": unit * y}
    dynamics = LearnedDynamics(Transitions(**scaled), "gaussian process")
    u, far = np.array([[1.0]]), np.array([[1e3]])
    np.testing.assert_allclose(
        dynamics.next_variables(unit * far, u), unit * usual.next_variables(far, u)
    )
    np.testing.assert_allclose(
        dynamics.spread(unit * far, u), usual.spread(far, u), rtol=1e-4
    )
    assert dynamics.errors == pytest.approx(usual.errors, rel=1e-3)


def test_a_variable_that_only_rounding_changes_counts_as_constant() -> None:
    data = line()
    dust = 5.0 + 1e-15 * np.random.default_rng(1).standard_normal((40, 1))
    states = np.hstack([data["states"], dust])
    after = np.hstack([data["next_states"], dust[::-1]])
    dynamics = LearnedDynamics(Transitions(states, data["inputs"], after))
    assert dynamics.features.change_scale[1] == 1.0


def test_what_a_limit_holds_is_not_learned_from() -> None:
    """A tank that overflows at 1: full, its level no longer tells what flows in."""
    rng = np.random.default_rng(0)
    x, u = rng.uniform(0, 1, 200), rng.uniform(0, 0.5, 200)
    after = np.minimum(x + u * np.sqrt(x + 0.1), 1.0)
    assert (after == 1.0).sum() > 20
    free = after < 1.0
    errors = []
    for high in ([1.0], None):
        dynamics = LearnedDynamics(Transitions(x, u, after, low=[0.0], high=high))
        found = dynamics.next_variables(x[None], u[None])[0]
        errors.append(np.abs(found - after)[free].max())
    knowing, unknowing = errors
    assert knowing < 1e-3
    assert 5 * knowing < unknowing


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_learns_a_line(kind: str) -> None:
    data = Transitions(**line(400))
    dynamics = LearnedDynamics(data, kind)
    assert dynamics.regressor == kind
    assert dynamics.errors["x[0]"] < 0.1
    x, u = np.array([[0.3, -0.6]]), np.array([[1.0, 0.0]])
    np.testing.assert_allclose(
        dynamics.next_variables(x, u), 0.9 * x + 0.5 * u, atol=0.02
    )


def test_any_regressor_of_the_library_will_do() -> None:
    dynamics = LearnedDynamics(Transitions(**line()), Ridge(alpha=1e-6))
    assert dynamics.regressor == "Ridge"
    assert dynamics.errors["x[0]"] < 1e-2
    assert dynamics.n_members == 6


class Constant:
    """Of no library, but with its two methods."""

    def fit(self, rows: Any, targets: Any) -> None:
        self.value = float(np.mean(targets))

    def predict(self, rows: Any) -> Any:
        return np.full(len(rows), self.value)


def test_an_object_with_fit_and_predict_will_do() -> None:
    assert LearnedDynamics(Transitions(**line()), Constant()).regressor == "Constant"


@pytest.mark.parametrize(
    "predict",
    [
        lambda rows: 0.0,
        lambda rows: None,
        lambda rows: np.zeros(3),
        lambda rows: np.full(len(rows), np.nan),
        lambda rows: np.array(["a"] * len(rows)),
    ],
)
def test_what_a_regressor_predicts_is_checked(predict: Any) -> None:
    """Nothing else may reach the kernels, which write where they are told to."""
    regressor = Constant()
    regressor.predict = predict  # type: ignore[method-assign]
    with pytest.raises(
        ValueError, match="predict of the regressor Constant must return"
    ):
        LearnedDynamics(Transitions(**line()), regressor)


def test_columns_of_one_are_numbers_and_classes_are_no_regressors() -> None:
    regressor = Constant()
    regressor.predict = lambda rows: np.zeros((len(rows), 1))  # type: ignore[method-assign]
    LearnedDynamics(Transitions(**line()), regressor)
    with pytest.raises(TypeError, match="of a class pass an instance"):
        LearnedDynamics(Transitions(**line()), Ridge)


def test_the_kind_with_the_smallest_error_is_taken() -> None:
    """A jump is no work for a smooth process, but for trees."""
    rng = np.random.default_rng(0)
    x = rng.uniform(-1, 1, (400, 2))
    side = np.sign(x[:, 0] - 0.1) * np.sign(x[:, 1] + 0.2)
    data = Transitions(x, rng.choice([-1.0, 1.0], 400), x + side[:, None], angles=())
    dynamics = LearnedDynamics(data)
    assert len(dynamics.tried) == 3
    assert dynamics.regressor == min(dynamics.tried, key=dynamics.tried.__getitem__)
    assert dynamics.regressor == "gradient boosting"


def test_one_regression_for_each_action() -> None:
    data = pendulum(120)
    dynamics = LearnedDynamics(data, per_action=True)
    assert missed(dynamics, other())[1] < 0.5
    with pytest.raises(ValueError, match=r"the inputs of its data only, got \[0\.5\]"):
        dynamics.next_variables(np.zeros((2, 1)), np.full((1, 1), 0.5))
    few = data[(data.inputs[:, 0] != 0.8) | (np.arange(120) < 12)]
    with pytest.raises(ValueError, match=r"per_action needs 5 steps or more"):
        LearnedDynamics(few, per_action=True)


def test_any_seed_draws_and_no_seed_draws_anew() -> None:
    """Also one that is too large for the generators of scikit-learn."""
    data = pendulum(30)
    x, u = np.array([[1.0], [5.0]]), np.array([[0.4]])

    def drawn(seed: int | None, kind: str) -> float:
        dynamics = LearnedDynamics(data, kind, n_draws=1, seed=seed)
        return float(dynamics.next_variables(x, u, np.array([1]))[1, 0])

    for kind in ("gaussian process", "random features"):
        assert drawn(2**40 + 1, kind) == drawn(2**40 + 1, kind)
        assert len({drawn(seed, kind) for seed in (0, 1, None, None)}) == 4


def test_numbers_of_actions_have_no_order() -> None:
    rng = np.random.default_rng(0)
    x, u = rng.uniform(-1, 1, 60), rng.integers(0, 3, 60)
    effect = np.array([0.5, -1.0, 0.2])
    data = Transitions(
        x, u, x + effect[u], numbered=True, values=[[0], [1], [2]], low=[-9], high=[9]
    )
    dynamics = LearnedDynamics(data)
    found = dynamics.next_variables(np.zeros((1, 3)), np.array([[0.0, 1.0, 2.0]]))
    np.testing.assert_allclose(found[0], effect, atol=0.01)


def test_what_is_not_known_is_shown() -> None:
    """Hanging was recorded; upright was not."""
    data = pendulum(200)
    low = data[np.cos(data.states[:, 0]) > 0.3]
    dynamics = LearnedDynamics(low)
    angles = np.array([0.0, np.pi])
    near, far = dynamics.spread(np.stack([angles, np.zeros(2)]), np.zeros((1, 2)))
    assert far > 5 * near
    errors = np.abs(predicted(dynamics, other()) - other().next_states)
    errors[:, 0] = np.minimum(errors[:, 0], 2 * np.pi - errors[:, 0])
    spread = dynamics.spread(
        np.ascontiguousarray(other().states.T), np.ascontiguousarray(other().inputs.T)
    )
    free = np.abs(other().next_states[:, 1]) < 9.0
    sure = spread <= np.median(spread)
    # Where the model is surer than on the average it is better, by a factor.
    assert 2 * errors[sure & free, 1].mean() < errors[~sure & free, 1].mean()


def test_the_nearest_recorded_step_is_told() -> None:
    data = pendulum()
    dynamics = LearnedDynamics(data)
    x, u = np.ascontiguousarray(data.states.T), np.ascontiguousarray(data.inputs.T)
    np.testing.assert_allclose(dynamics.distance(x, u), 0.0, atol=1e-12)
    rows = dynamics.features.rows(x, u)
    away = x + np.array([[0.3], [0.5]])
    found = dynamics.distance(away, u)
    for i, row in enumerate(dynamics.features.rows(away, u)):
        assert found[i] == pytest.approx(np.sqrt(((rows - row) ** 2).sum(axis=1)).min())


def test_the_deviation_counts_what_the_line_does_not_know() -> None:
    """From the equation, where nothing but a line was seen from close by."""
    rng = np.random.default_rng(0)
    rows = rng.normal(0.0, 0.1, (20, 2))
    targets = (rows @ [1.0, -2.0] + 0.01 * rng.standard_normal(20))[:, None]
    fit = Fit(rows, targets, "gaussian process")
    wide = np.column_stack([rows, np.ones(20)])
    normal = wide.T @ wide + 1e-3 * np.eye(3)
    left = targets[:, 0] - wide @ np.linalg.solve(normal, wide.T @ targets[:, 0])
    at = np.array([3.0, -1.0, 1.0])
    expected = left.std() * np.sqrt(at @ np.linalg.inv(normal) @ at)
    found = fit.deviation(at[None, :2])[0, 0]
    # And what the process does not know, at most its own deviation.
    most = np.hypot(expected, left.std() * np.sqrt(fit.scales[0].amplitude))
    assert 0.99 * expected <= found <= 1.01 * most


def test_other_functions_differ_where_little_is_known() -> None:
    dynamics = LearnedDynamics(pendulum(), n_draws=20)
    assert dynamics.n_members == 21
    x = np.array([[3.0], [0.0]]).repeat(21, axis=1)
    found = dynamics.next_variables(x, np.zeros((1, 21)), np.arange(21))
    np.testing.assert_array_equal(
        found[:, :1], dynamics.next_variables(x[:, :1], np.zeros((1, 1)))
    )
    assert 0 < found[1].std() < 0.5


def test_the_same_data_give_the_same_bits() -> None:
    one, two = LearnedDynamics(pendulum()), LearnedDynamics(pendulum())
    np.testing.assert_array_equal(predicted(one, other()), predicted(two, other()))


def test_a_regressor_that_is_named_is_taken_wherever_the_search_begins() -> None:
    first, own = LearnedDynamics(pendulum(60)), LearnedDynamics(pendulum(60), Ridge())
    for begin in (first, own):
        found = LearnedDynamics(pendulum(70), "nearest neighbours", begin=begin)
        assert found.regressor == "nearest neighbours"
    # What is somebody's own cannot be made again by its name.
    assert LearnedDynamics(pendulum(70), begin=own).regressor in KINDS


def test_dynamics_check_what_they_are_made_of() -> None:
    with pytest.raises(TypeError, match=r"transitions must be acl_gym\.Transitions"):
        LearnedDynamics(3)  # type: ignore[arg-type]
    with pytest.raises(
        TypeError, match="begin must be a LearnedDynamics or None, got 3"
    ):
        LearnedDynamics(pendulum(), begin=3)  # type: ignore[arg-type]


def test_a_search_begins_with_what_was_found() -> None:
    first = LearnedDynamics(pendulum())
    more = LearnedDynamics(pendulum(70), begin=first)
    assert more._fits[0].searched_at == 60
    many = LearnedDynamics(pendulum(120), begin=first)
    assert many._fits[0].searched_at == 120
    assert missed(many, other())[1] < 0.1


def test_constant_columns_do_no_harm() -> None:
    data = {**line(), "inputs": np.zeros((40, 2))}
    found = LearnedDynamics(Transitions(**data)).next_variables(
        np.zeros((1, 1)), np.zeros((2, 1))
    )
    assert np.isfinite(found).all()


def test_folds_keep_neighbours_together() -> None:
    assert folds_of(100)[:20].tolist() == [0] * 10 + [1] * 10
    assert set(folds_of(12)) == set(range(5))


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"regressor": "neural"}, ValueError, "regressor must be one of 'auto'"),
        ({"regressor": 3}, TypeError, "a name or an object with fit"),
        ({"n_draws": -1}, ValueError, "n_draws must"),
    ],
)
def test_bad_arguments_get_one_clear_error(
    arguments: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        LearnedDynamics(Transitions(**line()), **arguments)


def test_four_steps_are_too_few() -> None:
    with pytest.raises(ValueError, match="a model needs 5 steps or more, got 4"):
        LearnedDynamics(Transitions(**line(4)))


def test_a_fit_of_one_row_repeated_is_finite() -> None:
    rows, targets = np.ones((8, 2)), np.ones((8, 1))
    assert np.isfinite(Fit(rows, targets, "auto").mean(rows)).all()
