"""Parameters of agents, declared once: for checks, the command line and documentation."""

from __future__ import annotations

import inspect
from typing import Any, ClassVar

from acl_gym.utils.validation import Range, integer, number, shown


class Parameter:
    """An attribute that is a number in a range, checked whenever it is set.

    Read on an instance it gives the number, read on the class itself it gives this
    declaration. The default stands in the signature of the class only.

    Only agents declare their parameters in this way. Costs, deposits, schedules, update
    rules and environments check the arguments of their constructors themselves.

    Args:
        meaning: one line, without a full stop.
        symbol: what the literature calls it, such as "rho".
        unit: such as "s"; empty for a pure number.
        scheduled: a function of the trial number k = 0, 1, ... may stand in for the
            number; what it returns is checked in each trial.
        fixed: it can be set only once, by the constructor.
        whole: it is an integer >= 0, with inclusive bounds.
        **bounds: the range, the attributes of `Range`.

    Example:
        >>> from acl_gym import ACL
        >>> ACL.global_decay.range.in_words(), ACL.global_decay.default
        ('in [0, 1]', 0.1)
    """

    def __init__(
        self,
        meaning: str,
        symbol: str = "",
        *,
        unit: str = "",
        scheduled: bool = False,
        fixed: bool = False,
        whole: bool = False,
        **bounds: float,
    ) -> None:
        self.meaning, self.symbol, self.unit = meaning, symbol, unit
        self.whole = whole
        self.scheduled, self.fixed = scheduled, fixed
        self.range = Range(**bounds)

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name
        self._owner = owner
        self.__doc__ = f"{self.meaning}; {self.kind()}."

    @property
    def default(self) -> Any:
        """The default in the constructor of the class that declares the parameter."""
        return default_of(self._owner, self.name)

    def kind(self) -> str:
        """Symbol, kind of number, unit and range in words."""
        kind = "a number or a schedule" if self.scheduled else "a number"
        if self.whole:
            kind = "an integer"
        parts = [self.symbol, f"{kind} {self.range.in_words()}"]
        if self.unit:
            parts.append(f"in {self.unit}")
        if self.fixed:
            parts.append("fixed once the agent is made")
        return ", ".join(part for part in parts if part)

    def __get__(self, instance: Any, owner: type | None = None) -> Any:
        if instance is None:
            return self
        return instance.__dict__[self.name]

    def __set__(self, instance: Any, value: Any) -> None:
        if self.fixed and self.name in instance.__dict__:
            raise fixed(self.name, value)
        function = callable(value) and not isinstance(value, type)
        if self.whole:
            low, high = self.range.at_least, self.range.at_most
            value = integer(
                self.name,
                value,
                at_least=int(low or 0),
                at_most=None if high is None else int(high),
            )
        elif not (self.scheduled and function):
            value = number(self.name, value, self.range)
        instance.__dict__[self.name] = value

    def at(self, instance: Any, trial: int) -> float:
        """The number in trial k = 0, 1, ...

        Raises:
            ValueError: the schedule gives a number out of range.
        """
        setting = self.__get__(instance)
        if not callable(setting):
            return float(setting)
        return number(f"{self.name} in trial {trial}", setting(trial), self.range)


class Fixed:
    """Base of classes some of whose attributes cannot be set again.

    Kernels rely on them, or on arrays that were derived from them.
    """

    _fixed: ClassVar[tuple[str, ...]] = ()

    def __setattr__(self, name: str, value: Any) -> None:
        if name in self._fixed and name in self.__dict__:
            raise AttributeError(
                f"{name} of a {type(self).__name__} is fixed once it is made, got "
                f"{shown(value)}; make a new one."
            )
        super().__setattr__(name, value)


def fixed(name: str, value: Any) -> AttributeError:
    """The error for setting what only the constructor of an agent sets."""
    return AttributeError(
        f"{name} is fixed once the agent is made, got {shown(value)}; make a new agent "
        f"with {name}={shown(value)}."
    )


def parameters_of(kind: type) -> dict[str, Parameter]:
    """The parameters that a class and its bases declare, in the order of declaration."""
    return {
        name: value
        for base in reversed(kind.__mro__)
        for name, value in vars(base).items()
        if isinstance(value, Parameter)
    }


def default_of(kind: type, name: str) -> Any:
    """The default of a keyword of the constructor; None where it has none."""
    parameter = inspect.signature(kind).parameters.get(name)
    if parameter is None or parameter.default is inspect.Parameter.empty:
        return None
    return parameter.default
