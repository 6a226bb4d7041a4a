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
        # 0 and None mean continuous time; True means discrete time without a sampling
        # time.
        self.discrete_time = timebase is True or bool(timebase)
        self.sampling_time = (
            float(timebase) if timebase and timebase is not True else None
        )
        self.state_names = tuple(map(str, system.state_labels))
        self.input_names = tuple(map(str, system.input_labels))

    def check_names(self, names: tuple[str, ...]) -> None:
        """Check that the system has parameters of these names.

        Raises:
            ValueError: it lacks one of them.
        """
        known = () if self._is_linear else tuple(getattr(self.system, "params", ()))
        unknown = [name for name in names if name not in known]
        if unknown:
            remedy = "give it params={...} in control.nlsys"
            if self._is_linear:
                remedy = "make a control.nlsys with params={...} of it"
            raise ValueError(
                f"parameters and uncertain must be among the params {list(known)} of "
                f"the system {self.system.name}, got {unknown[0]!r}; {remedy}."
            )

    @property
    def _is_linear(self) -> bool:
        return hasattr(self.system, "A") and hasattr(self.system, "B")

    def __call__(self, x: FloatArray, u: FloatArray, p: Any = None) -> Any:
        """Evaluate `(state_size, n)` states with `(n_inputs, n)` inputs.

        Args:
            x: the states.
            u: the inputs.
            p: parameters as a named tuple, which replace those of the system; None
                leaves these.
        """
        return self.at(0.0, x, u, p)

    def at(self, time: float, x: FloatArray, u: FloatArray, p: Any = None) -> Any:
        """Evaluate as `__call__` does, at some time; `Equations` refuses systems that depend on it."""
        system = self.system
        own = {} if p is None else p._asdict()
        if self.one_by_one:
            columns = []
            for j in range(x.shape[1]):
                one = {
                    name: np.atleast_1d(v)[j % np.size(v)] for name, v in own.items()
                }
                params = {**system.params, **one} if own else None
                found = system.dynamics(time, x[:, j], u[:, j], params)
                columns.append(np.asarray(found, dtype=np.float64))
            return np.stack(columns, axis=1)
        if self._is_linear:
            return np.asarray(system.A) @ x + np.asarray(system.B) @ u
        return system.updfcn(time, x, u, {**system.params, **own})
