"""Parameters of agents that belong to their update rule."""

from __future__ import annotations

from typing import Any


class OfRule:
    """A parameter that the update rule of an agent holds and checks whenever it is set.

    The agent passes on what is read and set, so that it stands in one place. What is set
    takes effect in the next trial.

    Args:
        meaning: one line, without a full stop.
    """

    def __init__(self, meaning: str) -> None:
        self.meaning = meaning
        self.__doc__ = f"{meaning}."

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, instance: Any, owner: type | None = None) -> Any:
        if instance is None:
            return self
        return getattr(instance.update, self.name)

    def __set__(self, instance: Any, value: Any) -> None:
        instance.update.change(self.name, instance._chosen_for(self.name, value))
