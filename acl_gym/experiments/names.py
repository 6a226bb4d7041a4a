"""The names that the command line knows, without importing what they stand for.

To look up a name in the modules that use it takes seconds, for they import Numba.
"""

from __future__ import annotations

from typing import NamedTuple


class Method(NamedTuple):
    """A method: its label, and the key of `methods.METHODS` that runs it."""

    label: str
    key: str


METHODS = {
    "acl": Method("ACL", "acl"),
    "q": Method("Q-learning", "q-learning"),
    "q-lambda": Method("Q(λ)", "q-learning"),
    "dqn": Method("DQN", "dqn"),
}
"""The methods by the names that commands and files have for them."""

TABLE_METHODS = tuple(name for name, each in METHODS.items() if each.key != "dqn")
"""Those that keep a table over a partition."""

PRESETS = {"smoke": 1, "quick": 3, "full": 10}
"""How many runs of each method `acl-gym compare` makes; a system has its budgets."""


def agent_names(finite: bool) -> list[str]:
    """What `acl-gym compare` runs, by name, in order.

    Args:
        finite: whether a state is a cell, so that nothing is fuzzy.
    """
    kinds = ("crisp",) if finite else ("fuzzy", "crisp")
    return [*(f"{name}-{kind}" for name in TABLE_METHODS for kind in kinds), "dqn"]


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
