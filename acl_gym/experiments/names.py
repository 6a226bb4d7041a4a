"""The names that the command line knows, without importing what they stand for.

To look up a name in the modules that use it takes seconds, for they import Numba.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple


class Method(NamedTuple):
    """A method: its label, and the key of `methods.METHODS` that runs it."""

    label: str
    key: str


METHODS = {
    "acl": Method("ACL", "acl"),
    "returning": Method("Returning ACL", "returning"),
    "q": Method("Q-learning", "q-learning"),
    "q-lambda": Method("Q(λ)", "q-learning"),
    "q-replay": Method("Q-learning, replay", "q-learning"),
    "dqn": Method("DQN", "dqn"),
    "ppo": Method("PPO", "ppo"),
    "a2c": Method("A2C", "a2c"),
}
"""The methods by the names that commands and files have for them."""

NETWORKS = ("dqn", "ppo", "a2c")
"""Those of Stable-Baselines3; a method's key in `methods.METHODS` is the same."""

TABLE_METHODS = tuple(name for name in METHODS if name not in NETWORKS)
"""Those that keep a table over a partition."""

REMEMBERING = ("returning", "q-replay")
"""Of these, those that remember what was done, and whose partition may grow."""

FORGETTING = tuple(name for name in TABLE_METHODS if name not in REMEMBERING)
"""Of these, the others."""

GROWING = "growing"
"""The kind of a partition that a method chooses for itself and that becomes finer."""

PRESETS = {"smoke": 1, "quick": 3, "full": 10}
"""How many runs of each method `acl-gym compare` makes; a system has its budgets."""


def agent_names(finite: bool) -> list[str]:
    """What `acl-gym compare` runs, by name, in order.

    An agent is called after its method and its kind of partition. One that has the name of
    a method with a table has a partition that grows.

    Args:
        finite: whether a state is a cell, so that nothing is fuzzy.
    """
    if finite:
        return [*(f"{name}-crisp" for name in TABLE_METHODS), *NETWORKS]
    found = []
    for name in TABLE_METHODS:
        found += [name] * (name in REMEMBERING)
        if name != "q-replay":  # a rival of the colony whose partition grows
            found += [f"{name}-fuzzy", f"{name}-crisp"]
    return [*found, *NETWORKS]


def agents_called(name: str, names: Iterable[str]) -> list[str]:
    """The agents for which a name stands.

    Args:
        name: of an agent, or of a method, which stands for all its kinds of partition.
        names: of the agents that there are.
    """
    known = list(names)
    if name in known:
        return [name]
    return [each for each in known if each in (f"{name}-fuzzy", f"{name}-crisp")]


EXECUTORS = ("local", "ray")
"""Who makes the runs of `acl-gym reproduce`."""

EXPERIMENTS: tuple[str, ...] = (
    "fig3.3",
    "fig3.4",
    "fig3.6",
    "fig3.7",
    "fig3.8",
    "fig3.9",
    "fig3.11",
    "fig3.12",
    "fig3.13",
    "fig3.14",
    "row-choices",
    "row-orders",
    "world-choices",
    "fig4.6",
    "fig4.7",
    "fig4.8",
    "fig4.9",
    "fig4.10",
    "fig4.11",
    "fig4.12",
    "fig4.13",
    "fig4.14",
    "navigation-rules",
    "navigation-long",
    "fig5.2",
    "fig5.3",
    "fig5.4",
    "fig5.5",
    "fig5.6",
    "fig5.7",
    "fig5.8",
    "fig5.9",
    "fig5.10",
    "fig5.11",
    "fig5.12",
    "fig5.13",
    "fig5.14",
    "fig5.15",
    "fig5.16",
    "fig5.17",
    "omega-max",
    "local-update",
    "pendulum-long",
    "fuzzy-ants",
    "fig6.centre",
    "fig6.delays",
    "fig6.foraging",
    "fig6.optimum",
    "fig6.order",
    "fig6.colony",
    "versus",
    "versus-row",
    "versus-grid",
    "versus-navigation",
    "versus-pendulum",
    "versus-cells",
    "versus-noise",
    "versus-partial",
    "versus-episode-costs",
    "versus-slots",
    "versus-order",
)
"""What `acl-gym reproduce` runs, in the order of the thesis."""

GROUPS = ("all", "claims", "comparison")
"""Names that stand for all of them, for those that decide a claim of the thesis, and for
those that hold methods against each other."""
