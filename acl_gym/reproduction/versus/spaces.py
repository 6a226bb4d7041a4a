"""What is searched for each method, as data, and the settings that the search begins at.

The first evaluation of a search is the method's settings in `experiments.courses`.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from acl_gym.reproduction.versus.arena import Arena

METHODS = {"acl": "ACL", "q": "Q-learning", "q-lambda": "Q(λ)", "dqn": "DQN"}
"""The methods and what they are called."""

LONG = "acl-long"
"""ACL with more interactions than the others: whether it is only these that it lacks."""

NAMES = {**METHODS, LONG: "ACL with 4 times the interactions"}
"""What there is in tables and figures, and what it is called."""

TABLES = ("acl", "q", "q-lambda")
"""Those that keep a table over a partition."""


@dataclass(frozen=True)
class Real:
    """A real parameter.

    Attributes:
        low: its least value.
        high: its largest.
        log: whether it is drawn evenly on a logarithmic scale.
    """

    low: float
    high: float
    log: bool = False


@dataclass(frozen=True)
class Integer:
    """A whole number, drawn evenly on a logarithmic scale.

    Attributes:
        low: its least value.
        high: its largest.
    """

    low: int
    high: int


@dataclass(frozen=True)
class Choice:
    """One of several values.

    Attributes:
        values: which.
    """

    values: tuple[Any, ...]


Dimension = Real | Integer | Choice
Space = dict[str, Dimension]

_DISCOUNTS = Choice((0.9, 0.95, 0.98, 0.99, 1.0))
_RATE = Real(0.03, 1.0, log=True)
_EPSILON = Real(0.0, 0.3)


def space_of(arena: Arena, method: str) -> Space:
    """The dimensions along which a method is searched in an arena.

    Args:
        arena: where.
        method: a key of `METHODS`.
    """
    if method == "dqn":
        return {
            "learning_rate": Real(2e-4, 4e-3, log=True),
            "discount": Choice((0.95, 0.98, 0.99, 1.0)),
            "reward_scale": Real(0.1, 2.0, log=True),
            "target_update_interval": Integer(50, 800),
            "exploration_fraction": Real(0.05, 0.5),
            "exploration_final": Real(0.01, 0.2),
            "max_episode_steps": Choice((50, 100, 300)),
        }
    return _of_runs(arena) | _of_learning(arena, method)


def _of_runs(arena: Arena) -> Space:
    """What the table-based methods have in common: slots, longest episode, kind."""
    slots = arena.course.slots
    longest = arena.max_steps
    space: Space = {
        "slots": Integer(max(2, slots // 5), 4 * slots),
        "max_steps": Choice((longest // 3, 2 * longest // 3, longest)),
    }
    if not arena.finite:
        space["kind"] = Choice(("fuzzy", "crisp"))
    return space


def _of_learning(arena: Arena, method: str) -> Space:
    if method == "acl":
        space: Space = {
            "global_decay": Real(1e-3, 1.0, log=True),
            "local_decay": Real(0.0, 0.2),
            "alpha": Real(1.0, 6.0),
            "epsilon": _EPSILON,
        }
        return space | ({"tabu": Choice((False, True))} if arena.finite else {})
    space = {"learning_rate": _RATE, "discount": _DISCOUNTS, "epsilon": _EPSILON}
    if method == "q-lambda":
        space["trace_decay"] = Real(0.1, 0.95)
    if arena.judged_by is not None:
        # No reward expresses the cost: the closest of those that there are.
        space["reward"] = Choice(("stage", "steps"))
    return space


def defaults_of(arena: Arena, method: str) -> dict[str, Any]:
    """The method's settings before any search, those that are not searched included."""
    course = arena.course
    if method == "dqn":
        from acl_gym.sb3.dqn import DQNSettings

        known = asdict(DQNSettings(**course.dqn_short))
        return {name: known[name] for name in space_of(arena, method)}
    kind = "crisp" if arena.finite else "fuzzy"
    settings = dict(course.settings(f"{method}-{kind}"))
    if method == "acl":
        # Boltzmann's rule is Max-Boltzmann's with epsilon = 0, which can be searched.
        if settings["selection"] == "boltzmann":
            settings |= {"selection": "max_boltzmann", "epsilon": 0.0}
        if arena.finite:
            settings.setdefault("tabu", False)
        if arena.judged_by is not None:
            settings["tau0"] = 1e-3  # these costs are a hundred times smaller
    elif arena.judged_by is not None:
        settings["reward"] = "stage"
    return {
        "slots": course.slots,
        "max_steps": arena.max_steps,
        "kind": kind,
        **settings,
    }
