"""Models of python-control as functions of arrays; the package itself is not needed."""

from __future__ import annotations

from typing import Any

import numpy as np

from acl_gym.utils.typing import FloatArray


def is_model(dynamics: Any) -> bool:
    """Whether this is an input/output system of python-control with a state."""
    return all(
        hasattr(dynamics, name) for name in ("dynamics", "nstates", "ninputs", "dt")
    )


class Model:
    """x' = f(x, u), or x(t+1) = f(x, u), of a python-control system.

    Args:
        system: a `NonlinearIOSystem` (`control.nlsys`), a `StateSpace` (`control.ss`),
            or an interconnection of such systems.
        one_by_one: ask for one state after the other, because the update function of
            the system does not take arrays of states.

    Attributes:
        discrete_time: whether the system is one of discrete time.
        sampling_time: its own, s; None if it has none.
    """

    def __init__(self, system: Any, one_by_one: bool = False) -> None:
        self.system, self.one_by_one = system, one_by_one
        timebase = system.dt
        # 0 and None are continuous time, True is discrete without a sampling time.
        self.discrete_time = timebase is True or bool(timebase)
        self.sampling_time = (
            float(timebase) if timebase and timebase is not True else None
        )
        self.state_names = tuple(map(str, system.state_labels))
        self.input_names = tuple(map(str, system.input_labels))

    def __call__(self, x: FloatArray, u: FloatArray) -> Any:
        """Evaluate `(state_size, n)` states with `(n_inputs, n)` inputs."""
        return self.at(0.0, x, u)

    def at(self, time: float, x: FloatArray, u: FloatArray) -> Any:
        """The same at a time; a system that depends on it is refused."""
        system = self.system
        if self.one_by_one:
            columns = [
                np.asarray(system.dynamics(time, x[:, j], u[:, j]), dtype=np.float64)
                for j in range(x.shape[1])
            ]
            return np.stack(columns, axis=1)
        if hasattr(system, "A") and hasattr(system, "B"):
            return np.asarray(system.A) @ x + np.asarray(system.B) @ u
        return system.updfcn(time, x, u, system.params)
