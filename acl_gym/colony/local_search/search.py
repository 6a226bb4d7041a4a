"""Local searches for the travelling salesman: 2-opt, Or-opt and 3-opt.

They follow Bentley (1992), "Fast algorithms for geometric traveling salesman problems",
and Johnson and McGeoch (1997), "The traveling salesman problem: a case study in local
optimization": an arc that is added leads to one of the nearest neighbours, only partial
sums that gain are followed, and cities whose arcs have not changed since they were
looked at in vain have their don't-look bit set.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from acl_gym.colony.local_search.improve import (
    DONE,
    OR_OPT,
    THREE_OPT,
    TWO_OPT,
    improve,
)
from acl_gym.colony.local_search.neighbours import fill_nearby
from acl_gym.envs.graph.cities import TravellingSalesmanInstance, checked_instance
from acl_gym.utils import validation
from acl_gym.utils.typing import CellArray, FloatArray

_KERNELS = {"2-opt": TWO_OPT, "or-opt": OR_OPT, "3-opt": THREE_OPT}

METHODS = tuple(_KERNELS)


class LocalSearch:
    """A local search on one instance: checks and prepares it once, then serves at once.

    - `"2-opt"` replaces two arcs, so that a path is turned round.
    - `"or-opt"` does so too and moves segments of up to three cities elsewhere.
    - `"3-opt"` replaces two or three arcs in all ways that there are. It takes hardly
      longer than `"or-opt"` and its tours are much better, so that it is the one to
      take; `"2-opt"` takes half to a third of the time.

    Where distances are asymmetric, no path may be turned round: `"or-opt"` then moves
    segments only, and `"3-opt"` lets two neighbouring segments change places.

    The search draws no numbers: the same tours give the same results.

    Attributes:
        method: one of `METHODS`.
        symmetric: whether the distances are the same in both directions.

    Args:
        method: one of `METHODS`.
        instance: the cities.
        neighbours: candidates of each city, nearest first, int32 of shape `(n, k)`, as
            `nearest_neighbours(instance, k)` gives them; k from 8 to 20 is common.

    Raises:
        TypeError: `instance` is none.
        ValueError: an argument is not as said above, or distances are asymmetric with
            2-opt.
    """

    def __init__(
        self, method: str, instance: TravellingSalesmanInstance, neighbours: CellArray
    ) -> None:
        self.method = validation.one_of("method", method, METHODS)
        self._distances = checked_instance(instance).distances
        self._neighbours, self._nearby = self._checked_neighbours(neighbours)
        self.symmetric = instance.symmetric
        if method == "2-opt" and not self.symmetric:
            raise ValueError(
                "2-opt turns paths round, which needs distances that are the same in "
                "both directions; take '3-opt' or 'or-opt' here, which then keep all "
                "directions."
            )

    def improve(self, tours: CellArray) -> FloatArray:
        """Improve tours in place, each by itself.

        Args:
            tours: permutations of the cities, a C-contiguous array of int32, `(m, n)`.

        Returns:
            Lengths of the tours, arcs back to their first cities included, `(m,)`.

        Raises:
            ValueError: `tours` is no such array, or a row is no permutation; the rows
                before it have been improved.
        """
        n = len(self._distances)
        if not (
            isinstance(tours, np.ndarray)
            and tours.dtype == np.int32
            and tours.ndim == 2
            and tours.shape[1] == n
            and tours.flags.c_contiguous
            and tours.flags.writeable
        ):
            raise ValueError(
                f"tours must be a writable, C-contiguous array of int32 of shape (m, {n}"
                f"), as they are changed in place, got {_described(tours)}."
            )
        lengths = np.empty(len(tours))
        row = improve(
            tours,
            self._distances,
            self._neighbours,
            self._nearby,
            _KERNELS[self.method],
            self.symmetric,
            lengths,
        )
        if row != DONE:
            raise ValueError(
                f"tours[{row}] must hold each of the cities 0 to {n - 1} once, got "
                f"{validation.shown(tours[row])}."
            )
        return lengths

    def _checked_neighbours(self, neighbours: Any) -> tuple[CellArray, FloatArray]:
        n = len(self._distances)
        if not (
            isinstance(neighbours, np.ndarray)
            and neighbours.dtype == np.int32
            and neighbours.ndim == 2
            and len(neighbours) == n
        ):
            raise ValueError(
                f"neighbours must be an array of int32 of shape ({n}, k), got "
                f"{_described(neighbours)}; nearest_neighbours(instance, k) makes it."
            )
        # A copy: kernels rely on what has been checked.
        lists = np.array(neighbours, order="C")
        nearby = np.empty(lists.shape)
        city = fill_nearby(self._distances, lists, nearby)
        if city >= 0:
            raise ValueError(
                f"neighbours[{city}] must be other cities, 0 to {n - 1} without {city}"
                f", nearest first, got {validation.shown(lists[city])}; "
                "nearest_neighbours(instance, k) makes such an array."
            )
        return lists, nearby


def _described(array: Any) -> str:
    if not isinstance(array, np.ndarray):
        return validation.shown(array)
    return f"an array of {array.dtype} of shape {array.shape}"
