"""How much pheromone an ant deposits for a solution of a given cost.

The thesis deposits 1 / J, which needs costs above 0. In most environments made for
reinforcement learning J = -(return) is negative or of either sign. The other deposits
are for those; they are not from the thesis.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from acl_gym.utils import validation
from acl_gym.utils.serialization import Savable, Unsaved, from_settings, make_plain
from acl_gym.utils.typing import FloatArray

Function = Callable[[FloatArray], FloatArray]


class UndefinedDepositError(ValueError):
    """A deposit is not defined for the cost of a solution.

    Attributes:
        deposit: which.
        cost: J of that solution.
        problem: what is wrong, without a remedy.
        remedy: what an agent may do that takes every deposit.
    """

    def __init__(
        self, deposit: Deposit, cost: float, problem: str, remedy: str
    ) -> None:
        super().__init__(deposit, cost, problem, remedy)  # what a pickle holds
        self.deposit, self.cost = deposit, cost
        self.problem, self.remedy = problem, remedy

    def __str__(self) -> str:
        return f"{self.problem}{self.remedy}"


class Deposit(Savable, ABC):
    """A function from the costs of a trial's solutions to their deposits."""

    @abstractmethod
    def __call__(self, costs: FloatArray, tau0: float) -> FloatArray:
        """Return the deposits, `(n_ants,)`.

        Args:
            costs: J of each ant, `(n_ants,)`, finite.
            tau0: the initial pheromone level; no deposit should be below it.

        Raises:
            UndefinedDepositError: the deposit is not defined for one of the costs; a
                `ValueError`.
        """


@dataclass(frozen=True)
class InverseCost(Deposit):
    """1 / (J + offset), the thesis's deposit (3.8) with its offset of 0.

    §3.2.1 notes that a constant may be added to any cost.

    Attributes:
        offset: added to every cost, so that all are above 0.
    """

    offset: float = 0.0

    def __post_init__(self) -> None:
        make_plain(self)
        validation.number("offset", self.offset)

    def __call__(self, costs: FloatArray, tau0: float) -> FloatArray:
        """See `Deposit`."""
        shifted = costs + self.offset
        with np.errstate(divide="ignore", over="ignore"):
            deposits = 1.0 / shifted
        valid = (shifted > 0.0) & np.isfinite(deposits) & (deposits > 0.0)
        if not valid.all():
            ant = int(np.argmin(valid))
            raise UndefinedDepositError(
                self,
                float(costs[ant]),
                "the cost of a solution must be > 0 and finite, because ants deposit "
                f"1 / cost; got {shifted[ant]:g} for ant {ant}",
                '. Where returns are never negative pass deposit="return", elsewhere '
                'deposit="rank" or deposit=InverseCost(offset=...) with an offset above '
                "the highest return; or add a constant to your own cost.",
            )
        return deposits


@dataclass(frozen=True)
class Return(Deposit):
    """tau0 + the return, for environments whose returns are never negative.

    A solution without any return deposits tau0, so that levels stay at or above it.
    """

    def __call__(self, costs: FloatArray, tau0: float) -> FloatArray:
        """See `Deposit`."""
        if (costs > 0.0).any():
            ant = int(np.argmax(costs))
            raise UndefinedDepositError(
                self,
                float(costs[ant]),
                'deposit="return" needs returns that are never negative, got '
                f"{-costs[ant]:g} for ant {ant}",
                '; pass deposit="rank", or "inverse_cost" where all returns are '
                "negative.",
            )
        return tau0 - costs


@dataclass(frozen=True)
class Rank(Deposit):
    """tau0 + the share of the other ants with a higher cost; ties count half.

    Only the order of the costs in a trial matters, so rewards of any kind will do. A
    colony of one ant learns nothing from it, and ants that started in hard states are
    compared with those that started in easy ones.

    Attributes:
        exponent: > 0; the share is raised to this power. The larger it is, the fewer
            ants deposit much.
    """

    exponent: float = 1.0

    def __post_init__(self) -> None:
        make_plain(self)
        validation.number("exponent", self.exponent, above=0)

    def __call__(self, costs: FloatArray, tau0: float) -> FloatArray:
        """See `Deposit`."""
        ordered = np.sort(costs)
        not_worse = np.searchsorted(ordered, costs, side="right") - 1
        better = np.searchsorted(ordered, costs, side="left")
        others = max(costs.size - 1, 1)
        outdone = 1.0 - 0.5 * (better + not_worse) / others
        return np.asarray(tau0 + outdone**self.exponent)


NAMED: dict[str, Deposit] = {
    "inverse_cost": InverseCost(),
    "return": Return(),
    "rank": Rank(),
}
"""The deposits that can be asked for by name."""


@dataclass(frozen=True)
class FunctionDeposit(Deposit):
    """A user's function of the costs of a trial.

    Attributes:
        function: takes the costs `(n_ants,)`, returns the deposits, > 0 each.
    """

    function: Function

    def __call__(self, costs: FloatArray, tau0: float) -> FloatArray:
        """See `Deposit`."""
        # A copy, which the function may do with as it likes.
        return checked_deposits(self.function(costs.copy()), costs.size)


def checked_deposits(deposits: Any, n_ants: int) -> FloatArray:
    """What a deposit of a user's own has returned, as an array of its own.

    Raises:
        ValueError: it is not a finite number > 0 for each ant.
    """
    array = validation.as_array(deposits)
    if (
        array is None
        or array.dtype.kind not in "iuf"
        or array.shape != (n_ants,)
        or not np.isfinite(array).all()
        or not (array > 0.0).all()
    ):
        raise ValueError(
            f"deposit must return a finite number > 0 for each of the {n_ants} ants, "
            f"got {validation.shown(deposits)}."
        )
    return array.astype(np.float64)


class MissingDeposit(Unsaved, Deposit):
    """Stands in for a user's own deposit in an agent read from a file."""


def as_deposit(deposit: str | Deposit | Function) -> Deposit:
    """Turn every accepted form of `deposit` into a `Deposit`.

    Raises:
        ValueError: there is no deposit of that name.
        TypeError: it is neither a name, a `Deposit` nor a function.
    """
    if isinstance(deposit, str):
        return NAMED[validation.one_of("deposit", deposit, NAMED)]
    if isinstance(deposit, Deposit):
        return deposit
    if callable(deposit) and not isinstance(deposit, type):
        return FunctionDeposit(deposit)
    raise TypeError(
        f"deposit must be one of {', '.join(map(repr, NAMED))}, a Deposit such as "
        "InverseCost(offset=20), or a function of the costs, got "
        f"{validation.shown(deposit)}."
    )


def deposit_from_settings(settings: Any) -> Deposit:
    """A deposit from the settings in a file.

    Raises:
        ValueError: they are not those of a deposit.
    """
    kinds = (InverseCost, Return, Rank, FunctionDeposit)
    deposit = from_settings("deposit", settings, kinds, MissingDeposit)
    if not isinstance(deposit, Deposit):
        raise ValueError(
            f"deposit must be a Deposit, got {validation.shown(settings)}."
        )
    return deposit
