"""What a callback is, and the forms that `learn` takes it in."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from acl_gym.agents.tabular import TabularAgent

Row = dict[str, float]
"""The measures of one trial, see `TabularAgent.history`."""


class Callback:
    """Base class: override what you need."""

    def on_training_start(self, agent: TabularAgent) -> None:
        """Called once before the first trial."""

    def on_trial_end(self, agent: TabularAgent, row: Row) -> bool | None:
        """Called after every trial; it may add measures to `row`.

        Returns:
            False to stop training; anything else goes on.
        """
        return True

    def on_training_end(self, agent: TabularAgent) -> None:
        """Called once after the last trial, also after an exception."""


Function = Callable[["TabularAgent", Row], Any]
Callbacks = None | Callback | Function | Iterable[Callback | Function]
"""What `learn` takes: nothing, one of these, or several."""


class _FunctionCallback(Callback):
    def __init__(self, function: Function) -> None:
        self._function = function

    def on_trial_end(self, agent: TabularAgent, row: Row) -> bool | None:
        return not is_stop(self._function(agent, row))


def is_stop(result: Any) -> bool:
    """Whether what a callback returned means to stop: False, Python's or NumPy's."""
    return isinstance(result, (bool, np.bool_)) and not result


def as_callbacks(callback: Callbacks) -> list[Callback]:
    """Bring every accepted form of `callback` into a list of objects.

    Raises:
        TypeError: something in it is neither a `Callback` nor callable.
    """
    if callback is None:
        return []
    if isinstance(callback, Callback):
        return [callback]
    if callable(callback) and not isinstance(callback, type):
        return [_FunctionCallback(callback)]
    if isinstance(callback, Iterable) and not isinstance(callback, str):
        return [one for each in callback for one in as_callbacks(each)]
    raise TypeError(
        "callback must be a Callback object, a function of (agent, row) or a list of "
        f"those, got {callback!r}."
    )
