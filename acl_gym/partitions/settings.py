"""Partitions as the settings that are saved with an agent."""

from __future__ import annotations

from typing import Any, NoReturn

from numpy.typing import NDArray

from acl_gym.partitions.base import Partition
from acl_gym.partitions.discrete import Discrete
from acl_gym.partitions.grid import Crisp, Fuzzy
from acl_gym.utils import validation
from acl_gym.utils.serialization import Missing, own_name, to_json
from acl_gym.utils.typing import CellArray, FloatArray, IntArray

_KINDS = (Crisp, Discrete, Fuzzy)
_OWN = "own"

_MOST_VARIABLES = 20
"""The most variables of a fuzzy partition in a file: a state then has 2^20 cells, which
take 12 MB. A file of a few bytes must not ask for more, as axes of one cell each would."""


class MissingPartition(Missing, Partition):
    """Stands in for a user's own partition in an agent read from a file.

    Args:
        name: of its class.
        n_cells: how many cells it has.
        cells_per_state: k.
        state_ndim: axes of a state.
        own: what its `settings` gave; None if a file could not hold that.
    """

    def __init__(
        self, name: str, n_cells: int, cells_per_state: int, state_ndim: int, own: Any
    ) -> None:
        super().__init__("partition", name)
        self.n_cells = validation.integer("n_cells", n_cells, at_least=1)
        self.cells_per_state = validation.integer(
            "cells_per_state", cells_per_state, at_least=1, at_most=2**_MOST_VARIABLES
        )
        self.state_ndim = validation.integer(
            "state_ndim", state_ndim, at_least=0, at_most=64
        )
        self.own = own

    def error(self) -> ValueError:
        """See `Missing.error`; the table is of this partition, so it is not set later."""
        return ValueError(
            f"the partition was a {self.name!r}, which a file cannot hold; load the "
            "agent with load(path, env, partition=...)."
        )

    def locate(
        self,
        states: NDArray[Any],
        slots: IntArray,
        index: CellArray,
        degree: FloatArray,
    ) -> NoReturn:
        """Report that the partition is missing.

        Raises:
            ValueError: always.
        """
        raise self.error()

    def cell_states(self) -> NoReturn:
        """Report that the partition is missing.

        Raises:
            ValueError: always.
        """
        raise self.error()

    def settings(self) -> dict[str, Any]:
        """What a file holds of the partition that is missing."""
        return {
            "type": _OWN,
            "name": self.name,
            "n_cells": self.n_cells,
            "cells_per_state": self.cells_per_state,
            "state_ndim": self.state_ndim,
            "settings": self.own,
        }

    def __repr__(self) -> str:
        """Name and cells of what is missing."""
        return f"MissingPartition({self.name!r}, {self.n_cells} cells)"

    def replaced_by(self, partition: Partition) -> None:
        """Check that `partition` can be the one that is missing.

        Raises:
            ValueError: it is of the same class, but was made from other settings.
        """
        now = _saved(partition)
        if now["name"].rpartition(":")[2] == self.name.rpartition(":")[2] and (
            now["settings"] != self.own
        ):
            raise ValueError(
                f"partition must be the {self.name!r} of the settings {self.own!r:.200} "
                f"that the agent was saved with, got {now['settings']!r:.200}."
            )


def partition_to_settings(partition: Partition) -> dict[str, Any]:
    """What `partition_from_settings` turns into the partition, or a stand-in for it."""
    if type(partition) in (*_KINDS, MissingPartition):
        return partition.settings()
    return _saved(partition)


def _saved(partition: Partition) -> dict[str, Any]:
    """The saved form of a user's own partition."""
    try:
        settings = to_json(partition.settings(), "settings")
    except Exception:  # of a user's code: the table is worth more than the settings
        settings = None
    return MissingPartition(
        own_name(partition),
        partition.n_cells,
        partition.cells_per_state,
        partition.state_ndim,
        settings,
    ).settings()


def partition_from_settings(settings: dict[str, Any]) -> Partition:
    """Build the partition that `settings` describes; a user's own gives a stand-in.

    Raises:
        ValueError: `settings` describe no partition.
    """
    try:
        kind = settings["type"]
        if kind == _OWN:
            return MissingPartition(
                str(settings["name"]),
                settings["n_cells"],
                settings["cells_per_state"],
                settings["state_ndim"],
                settings["settings"],
            )
        if kind == "Discrete":
            return Discrete(settings["sizes"], settings["starts"])
        grids = {"Crisp": Crisp, "Fuzzy": Fuzzy}
        if kind == "Fuzzy" and len(settings["centres"]) > _MOST_VARIABLES:
            raise ValueError(
                f"a fuzzy partition must have at most {_MOST_VARIABLES} variables, got "
                f"{len(settings['centres'])}."
            )
        angles = settings.get("angles", ())
        return grids[kind](settings["centres"], settings["periods"], angles)
    except (KeyError, TypeError) as error:
        raise ValueError(
            "settings must describe one of ['Crisp', 'Discrete', 'Fuzzy'], got "
            f"{settings!r:.200}."
        ) from error


def given_partition(partition: Any, saved: Partition) -> Partition:
    """Check a partition that is to stand in the place of a saved one.

    Raises:
        TypeError: it is no partition.
        ValueError: it does not fit the table.
    """
    if not isinstance(partition, Partition):
        raise TypeError(
            "partition must be a Partition such as Crisp or Fuzzy, got "
            f"{validation.shown(partition)}."
        )
    if partition.n_cells != saved.n_cells:
        raise ValueError(
            f"partition must have {saved.n_cells} cells as the table has, got "
            f"{partition.n_cells}; make it as it was when the agent was saved."
        )
    if isinstance(saved, MissingPartition):
        saved.replaced_by(partition)
    return partition
