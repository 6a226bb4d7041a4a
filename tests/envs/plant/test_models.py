"""Models of python-control, the package itself, as plants."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import acl_gym
from tests.envs.plant import plants
from tests.envs.plant.plants import MASS, PENDULUM

control = pytest.importorskip("control")


def update(t: Any, x: Any, u: Any, params: Any) -> Any:
    return [x[1], 20 * u[0] - params.get("k", 19.62) * np.sin(x[0]) - 2 * x[1]]


def model(updfcn: Any = update, **settings: Any) -> Any:
    return control.nlsys(
        updfcn, None, inputs=["torque"], states=["theta", "omega"], **settings
    )


def test_a_nonlinear_system_is_the_function_itself() -> None:
    states = np.random.default_rng(0).uniform([0, -9], [2 * np.pi, 9], (50, 2))
    actions = np.arange(50) % 3
    results = []
    for dynamics in (model(), plants.pendulum):
        env = acl_gym.plant(dynamics, num_envs=50, **PENDULUM)
        env.reset(options={"state": states})
        results.append(env.step(actions)[:3])
    for own, wanted in zip(*results, strict=True):
        assert (own == wanted).all()
    names = acl_gym.plant(model(), **PENDULUM).unwrapped.system.signals
    assert names.observations == ("theta", "omega")
    assert names.inputs == ("torque",)


def test_its_parameters_and_an_exact_solution() -> None:
    env = acl_gym.plant(
        model(params={"k": 5.0}), num_envs=1, **{**PENDULUM, "substeps": 20}
    )
    env.reset(options={"state": [[1.0, 2.0]]})
    observed = env.step([2])[0][0]
    exact = solve_ivp(
        lambda t, x: update(t, x, [0.8], {"k": 5.0}),
        (0, 0.1),
        [1.0, 2.0],
        rtol=1e-11,
        atol=1e-11,
    ).y[:, -1]
    np.testing.assert_allclose(observed, exact, rtol=1e-8)


def test_an_update_that_takes_one_state_only() -> None:
    def one_by_one(t: Any, x: Any, u: Any, params: Any) -> Any:
        if x[0] > 7.0:  # of an array this would have no truth value
            return np.zeros(2)
        return np.array(update(t, x, u, params))

    env = acl_gym.plant(model(one_by_one), num_envs=3, **PENDULUM)
    reference = acl_gym.plant(plants.pendulum, num_envs=3, **PENDULUM)
    states = [[0.0, 0.0], [1.0, 1.0], [2.0, -3.0]]
    env.reset(options={"state": states})
    reference.reset(options={"state": states})
    np.testing.assert_allclose(env.step([0, 1, 2])[0], reference.step([0, 1, 2])[0])


@pytest.mark.parametrize("timebase", [0.1, True])
def test_discrete_time(timebase: Any) -> None:
    def step(t: Any, x: Any, u: Any, params: Any) -> Any:
        return [x[0] + 0.1 * x[1], x[1] + 0.1 * u[0]]

    env = acl_gym.plant(model(step, dt=timebase), num_envs=2, **MASS)
    env.reset(options={"state": [[0.5, 0.5], [-0.5, 0.0]]})
    np.testing.assert_allclose(env.step([2, 0])[0], [[0.55, 0.6], [-0.5, -0.1]])


def test_linear_systems() -> None:
    a, b = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]])
    linear = control.ss(a, b, np.eye(2), np.zeros((2, 1)))
    states = {"state": [[0.5, 0.5], [-0.5, 0.0]]}
    own = acl_gym.plant(linear, num_envs=2, **MASS)
    reference = plants.make_mass(num_envs=2)
    own.reset(options=states)
    reference.reset(options=states)
    np.testing.assert_allclose(own.step([2, 0])[0], reference.step([2, 0])[0])
    series = control.ss2tf(linear)
    with pytest.raises(TypeError, match=r"with a state, got TransferFunction; convert"):
        acl_gym.plant(series, **MASS)


def test_what_does_not_fit() -> None:
    def timed(t: Any, x: Any, u: Any, params: Any) -> Any:
        return [x[1], u[0] + np.sin(t)]

    with pytest.raises(ValueError, match="must not depend on time"):
        acl_gym.plant(model(timed), **MASS)
    with pytest.raises(
        ValueError, match="which has 2 states and 1 inputs, got 1 states"
    ):
        acl_gym.plant(model(), **{**MASS, "low": [-1], "high": [1], "goal": 0})
    with pytest.raises(
        ValueError, match=r"sampling_time must be that .*0\.2 s, got 0\.1"
    ):
        acl_gym.plant(model(dt=0.2), **MASS)


def test_the_package_is_not_imported_by_plants() -> None:
    import subprocess

    program = (
        "import sys; import tests.envs.plant.plants as p; p.make_mass(num_envs=2);"
        "sys.exit('control' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", program], check=True)
