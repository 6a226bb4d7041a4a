"""A controller that remembers: proportional, integral and derivative action."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from acl_gym.utils import validation
from acl_gym.utils.typing import BoolArray, FloatArray


class PID:
    """A PID controller of one measured variable and one input, with its state for each slot.

    In each step, with the error e = r - y of the measured variable y from the set point r,

        u = K_p e + K_i T sum(e) + K_d (e - e_before) / T,

    clipped to the limits. The sum goes on only where the input is not at its limit, or
    where the error leads away from it, so that it does not wind up. The sum includes the
    error of the present step, and there is no derivative in the first step of an episode.
    The sum is not among the observations: what a learner sees does not tell it all.

    Args:
        variable: which variable of an observation is measured.
        sampling_time: T, s, > 0.
        gains: (K_p, K_i, K_d); None: parameters, which `InnerLoop` lets the learner
            choose.
        set_point: r; None: a parameter, after the gains if these are parameters too.
        period: of a variable that wraps around, > 0, such as 2 pi; None: it does not.
        low: the least input; None: no limit.
        high: the greatest input, not less than `low`; None: no limit.

    Attributes:
        settings: the arguments, in their order, as plain numbers.

    Raises:
        TypeError: an argument is not a number.
        ValueError: it is out of range or not finite.

    Example:
        >>> hold = PID(0, 0.1, gains=[2.0, 1.0, 0.0], set_point=1.0)
        >>> hold.restart(np.array([True]))
        >>> [round(float(hold([[y]])[0]), 3) for y in (0.0, 0.5)]
        [2.1, 1.15]
    """

    def __init__(
        self,
        variable: int,
        sampling_time: float,
        *,
        gains: Any = None,
        set_point: float | None = None,
        period: float | None = None,
        low: float | None = None,
        high: float | None = None,
    ) -> None:
        self._variable = validation.integer("variable", variable, at_least=0)
        self._time = validation.number("sampling_time", sampling_time, above=0)
        self._gains: tuple[float, ...] | None = None
        if gains is not None:
            array = validation.real_array("gains", gains, ndim=1)
            if array.size != 3:
                raise ValueError(
                    f"gains must be three numbers, K_p, K_i and K_d, got {array.size}."
                )
            self._gains = tuple(array.tolist())
        self._set_point = _number_or_none("set_point", set_point)
        self._period = _number_or_none("period", period, above=0)
        least, most = _number_or_none("low", low), _number_or_none("high", high)
        self._low = -math.inf if least is None else least
        self._high = math.inf if most is None else most
        if self._low > self._high:
            raise ValueError(f"low must not exceed high, got {low} and {high}.")
        self._sum: FloatArray = np.empty(0)
        self._before: FloatArray = np.empty(0)

    @property
    def settings(self) -> tuple[Any, ...]:
        """What was given, in the order of the arguments."""
        return (
            self._variable,
            self._time,
            self._gains,
            self._set_point,
            self._period,
            self._low,
            self._high,
        )

    def __eq__(self, other: object) -> bool:
        """Whether both have the same settings; what they remember does not count."""
        return type(other) is type(self) and self.settings == other.settings

    def __hash__(self) -> int:
        """Of the settings."""
        return hash(self.settings)

    def restart(self, slots: BoolArray) -> None:
        """Forget what was in some slots, in which an episode begins.

        Args:
            slots: `(n,)`. With another n than before, all slots begin anew.
        """
        if slots.size != self._sum.size:
            self._sum = np.zeros(slots.size)
            self._before = np.full(slots.size, np.nan)
        self._sum[slots], self._before[slots] = 0.0, np.nan

    def __call__(self, observations: Any, parameters: Any = None) -> FloatArray:
        """The inputs `(n,)` of a step, in all slots.

        Args:
            observations: `(n, d)`.
            parameters: `(n, p)`, what the constructor was not given; None: nothing.

        Raises:
            ValueError: the shapes do not fit, or there are not as many slots as in
                `restart`.
        """
        seen = validation.real_array("observations", observations, finite=False)
        if (
            seen.ndim != 2
            or seen.shape[1] <= self._variable
            or len(seen) != self._sum.size
        ):
            raise ValueError(
                f"observations must be rows of more than {self._variable} variables, one "
                f"for each of the {self._sum.size} slots that restart began, got "
                f"{seen.shape}."
            )
        gains, set_point = self._parameters(len(seen), parameters)
        error = set_point - seen[:, self._variable]
        if self._period is not None:
            error = (
                np.mod(error + 0.5 * self._period, self._period) - 0.5 * self._period
            )
        slope = np.where(np.isnan(self._before), 0.0, error - self._before) / self._time
        total = self._sum + self._time * error
        # The terms one by one: a product of matrices may depend on how many rows there are.
        wanted = gains[0] * error + gains[1] * total + gains[2] * slope
        inputs = np.clip(wanted, self._low, self._high)
        winds_up = (wanted - inputs) * (gains[1] * error) > 0.0
        self._sum = np.where(winds_up, self._sum, total)
        self._before = error
        return np.asarray(inputs)

    def _parameters(self, n: int, parameters: Any) -> tuple[Any, Any]:
        """The gains, one row for each, and the set point."""
        width = 3 * (self._gains is None) + (self._set_point is None)
        rows: FloatArray = np.zeros((n, 0))
        if parameters is not None and np.shape(parameters) != (n, 0):
            rows = validation.real_array("parameters", parameters, finite=False)
        if rows.shape != (n, width):
            raise ValueError(
                f"parameters must be rows of {width} numbers, those of K_p, K_i, K_d and "
                f"the set point that were not given, shape {(n, width)}, got {rows.shape}."
            )
        gains = rows[:, :3].T if self._gains is None else self._gains
        return gains, rows[:, -1] if self._set_point is None else self._set_point


def _number_or_none(name: str, value: Any, **bounds: Any) -> float | None:
    return None if value is None else validation.number(name, value, **bounds)
