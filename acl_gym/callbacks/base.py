"""The base class of callbacks, and the forms in which `learn` accepts them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import ArrayLike

from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray, Predictor, Row


class Agent(Predictor, Protocol):
    """What callbacks see of an agent; `TabularAgent` documents each member."""

    env: VectorEnv[Any, Any, Any] | None
    num_timesteps: int
    trials: int
    seconds: float
    history: list[Row]
    in_trial: bool
    metadata: dict[str, Any]

    @property
    def table(self) -> FloatArray:
        """The current table, `(n_cells, n_actions)`."""

    @property
    def policy(self) -> Predictor:
        """The current policy."""

    @property
    def max_steps(self) -> int:
        """T, the most steps of an episode."""

    def set_table(self, table: ArrayLike) -> None:
        """Replace the table."""

    def save(self, path: str | Path) -> Path:
        """Write the agent to one file and return its path."""


class Callback:
    """Base class of callbacks: override the methods you need."""

    def on_training_start(self, agent: Agent) -> None:
        """Called once before the first trial."""

    def on_trial_end(self, agent: Agent, row: Row) -> bool | None:
        """Called after every trial; may add measures to `row`.

        Returns:
            False to stop training; any other value continues it.
        """
        return True

    def on_training_end(self, agent: Agent) -> None:
        """Called once after the last trial, and after an exception."""


Function = Callable[[Agent, Row], Any]
Callbacks = None | Callback | Function | Iterable[Callback | Function]
"""What `learn` accepts: None, one callback or function, or several."""


class _FunctionCallback(Callback):
    def __init__(self, function: Function) -> None:
        self._function = function

    def on_trial_end(self, agent: Agent, row: Row) -> bool | None:
        return not is_stop(self._function(agent, row))


def is_stop(result: Any) -> bool:
    """Whether a callback returned False, Python's or NumPy's, in order to stop."""
    return isinstance(result, (bool, np.bool_)) and not result


_DEEPEST = 10  # lists within lists of callbacks; one that holds itself has no end


def as_callbacks(callback: Callbacks, depth: int = 0) -> list[Callback]:
    """Turn every accepted form of `callback` into a list of `Callback` objects.

    Args:
        callback: None, one callback or a collection of them.
        depth: number of collections around it.

    Raises:
        TypeError: an element is neither a `Callback` nor callable.
    """
    if callback is None:
        return []
    if isinstance(callback, Callback):
        return [callback]
    if callable(callback) and not isinstance(callback, type):
        return [_FunctionCallback(callback)]
    several = validation.elements(callback)
    if several is not None and depth < _DEEPEST:
        return [one for each in several for one in as_callbacks(each, depth + 1)]
    raise TypeError(
        "callback must be a Callback object, a function of (agent, row) or a list of "
        f"those, got {validation.shown(callback)}."
    )
