"""A cost of complete solutions: the interface, and how costs are added and weighed."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np

from acl_gym.colony.episodes import Episodes
from acl_gym.utils import validation
from acl_gym.utils.serialization import Savable, make_plain
from acl_gym.utils.typing import FloatArray


class Cost(Savable, ABC):
    """A cost of complete solutions; lower is better."""

    @abstractmethod
    def __call__(self, episodes: Episodes) -> FloatArray:
        """Return J of each ant, `(n,)`."""

    def __add__(self, other: Cost | float) -> Cost:
        """The sum of two costs, or of a cost and a constant."""
        term = other if isinstance(other, Cost) else Constant(other)
        # One sum of many terms, not sums in sums, which Python limits.
        return Sum((*self.terms, term) if type(self) is Sum else (self, term))

    __radd__ = __add__

    def __mul__(self, factor: float) -> Cost:
        """The cost times a factor > 0."""
        return Weighted(factor, self)

    __rmul__ = __mul__


@dataclass(frozen=True)
class Constant(Cost):
    """The same for every solution.

    Attributes:
        value: >= 0.
    """

    value: float

    def __post_init__(self) -> None:
        make_plain(self)
        validation.number("value", self.value, at_least=0)

    def __call__(self, episodes: Episodes) -> FloatArray:
        """See `Cost`."""
        return np.full(len(episodes), float(self.value))


@dataclass(frozen=True)
class Sum(Cost):
    """The sum of costs.

    Attributes:
        terms: the costs.
    """

    terms: tuple[Cost, ...]

    def __post_init__(self) -> None:
        make_plain(self)
        if not isinstance(self.terms, (tuple, list)) or not self.terms:
            raise TypeError(f"terms must be Costs, got {validation.shown(self.terms)}.")
        _check_costs("terms", self.terms)

    def __call__(self, episodes: Episodes) -> FloatArray:
        """See `Cost`."""
        return np.asarray(sum(term(episodes) for term in self.terms))


@dataclass(frozen=True)
class Weighted(Cost):
    """A cost times a factor.

    Attributes:
        factor: > 0.
        cost: the cost.
    """

    factor: float
    cost: Cost

    def __post_init__(self) -> None:
        make_plain(self)
        validation.number("factor", self.factor, above=0)
        _check_costs("cost", (self.cost,))

    def __call__(self, episodes: Episodes) -> FloatArray:
        """See `Cost`."""
        return self.factor * self.cost(episodes)


def _check_costs(name: str, costs: Any) -> None:
    for cost in costs if isinstance(costs, (tuple, list)) else (costs,):
        if not isinstance(cost, Cost):
            raise TypeError(
                f"{name} must be made of Costs such as Steps(), got "
                f"{validation.shown(cost)}; make "
                "a Cost of a function with FunctionCost(function)."
            )
