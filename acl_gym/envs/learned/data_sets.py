"""Recordings of others: Minari's data sets."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from acl_gym.utils import validation
from acl_gym.utils.boxes import declared_bounds
from acl_gym.utils.text import first_line


def arrays_of_minari(dataset: Any) -> dict[str, Any]:
    """Read a data set of Minari; see `Transitions.from_minari`.

    Returns:
        Arguments of `Transitions`.
    """
    if isinstance(dataset, str | Path):
        dataset = _of_minari_id(str(dataset))
    if not hasattr(dataset, "iterate_episodes"):
        raise TypeError(
            "dataset must be a minari.MinariDataset or the id of one, got "
            f"{validation.shown(dataset)}."
        )
    seen, acted = dataset.observation_space, dataset.action_space
    if not isinstance(seen, spaces.Box) or len(seen.shape) != 1:
        raise TypeError(
            "a data set needs observations that are a Box of one axis, got "
            f"{validation.shown(seen)}."
        )
    numbered = isinstance(acted, spaces.Discrete)
    if not numbered and not (isinstance(acted, spaces.Box) and len(acted.shape) == 1):
        raise TypeError(
            "a data set needs Discrete actions or a Box of one axis, got "
            f"{validation.shown(acted)}."
        )
    parts: dict[str, list[NDArray[Any]]] = {}
    for number, episode in enumerate(dataset.iterate_episodes()):
        steps = len(episode.actions)
        new = {
            "states": np.asarray(episode.observations, np.float64)[:steps],
            "inputs": np.asarray(episode.actions, np.float64).reshape(steps, -1),
            "next_states": np.asarray(episode.observations, np.float64)[1:],
            "rewards": np.asarray(episode.rewards, np.float64),
            "terminated": np.asarray(episode.terminations, np.bool_),
            "episodes": np.full(steps, number),
        }
        for name, array in new.items():
            parts.setdefault(name, []).append(array)
    if not parts:
        raise ValueError("dataset must hold one episode or more, got none.")
    facts: dict[str, Any] = {n: np.concatenate(kept) for n, kept in parts.items()}
    facts["low"], facts["high"] = declared_bounds(seen)
    if numbered:
        numbers = np.arange(int(acted.start), int(acted.start + acted.n))
        facts |= {"values": numbers[:, None].astype(np.float64), "numbered": True}
    return facts


def _of_minari_id(name: str) -> Any:
    """The data set of that id on this machine; see `Transitions.from_minari`."""
    try:
        import minari
    except ImportError as error:
        raise ImportError(
            "a data set is loaded by its id with Minari, which is not installed; "
            'run pip install "acl-gym[minari]".'
        ) from error
    try:
        return minari.load_dataset(name)
    except FileNotFoundError as error:
        there = list(minari.list_local_datasets())
        raise FileNotFoundError(
            f"dataset must be the id of a data set of Minari on this machine, got "
            f"{validation.shown(name)}; check the spelling, or download it with "
            f"minari.download_dataset({validation.shown(name)})."
            f"{validation.did_you_mean(name, there)}"
        ) from error
    except Exception as error:  # whatever Minari and HDF5 raise for a damaged one
        raise ValueError(
            f"the data set {validation.shown(name)} of Minari cannot be read: "
            f"{first_line(error)}; download or make it again."
        ) from error
