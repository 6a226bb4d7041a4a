"""Partitions from the settings that are saved with an agent."""

from __future__ import annotations

from typing import Any

from acl_gym.partitions.base import Partition
from acl_gym.partitions.discrete import Discrete
from acl_gym.partitions.grid import Crisp, Fuzzy


def partition_from_settings(settings: dict[str, Any]) -> Partition:
    """Build the partition that `settings` describes.

    Raises:
        ValueError: `settings` describe no partition of this package.
    """
    try:
        kind = settings["type"]
        if kind == "Discrete":
            return Discrete(settings["sizes"], settings["starts"])
        grids = {"Crisp": Crisp, "Fuzzy": Fuzzy}
        return grids[kind](settings["centres"], settings["periods"])
    except (KeyError, TypeError) as error:
        raise ValueError(
            "settings must describe one of ['Crisp', 'Discrete', 'Fuzzy'], got "
            f"{settings!r}."
        ) from error
