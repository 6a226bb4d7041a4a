"""The agents that `--agent` selects, and their parameters, read without importing them."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import Any, NamedTuple

from acl_gym.cli.errors import BadArgumentError, bad_arguments
from acl_gym.cli.sources import class_node, module_tree
from acl_gym.utils.validation import Range

OWN_OPTIONS = (
    *("env", "partition", "max_steps", "seed", "n_actions"),
    *("heuristic", "initial", "workers", "executor"),
)
"""Keywords of the constructors that have an option of their own, or none at all."""


class AgentKind(NamedTuple):
    """An agent.

    Attributes:
        module: where its class is.
        name: of its class.
        deposits: whether its ants deposit by the costs of a trial: it then needs a
            deposit that suits the environment, and learns nothing from equal costs.
        grows: whether it chooses a partition for itself and lets it grow; it then
            learns from few ants.
        seeks_best: whether it looks for one best solution, through states that are
            cells; its ants deposit for each solution alone.
    """

    module: str
    name: str
    deposits: bool
    grows: bool = False
    seeks_best: bool = False

    def load(self) -> Any:
        """Import the class."""
        return getattr(import_module(self.module), self.name)


AGENTS = {
    "returning": AgentKind(
        "acl_gym.agents.returning", "ReturningACL", deposits=False, grows=True
    ),
    "acl": AgentKind("acl_gym.agents.acl", "ACL", deposits=True),
    "q-learning": AgentKind("acl_gym.agents.q_learning", "QLearning", deposits=False),
    "ant-system": AgentKind(
        "acl_gym.agents.ant_system", "AntSystem", deposits=False, seeks_best=True
    ),
    "ant-colony-system": AgentKind(
        "acl_gym.agents.ant_system", "AntColonySystem", deposits=False, seeks_best=True
    ),
    "max-min": AgentKind(
        "acl_gym.agents.ant_system", "MaxMinAntSystem", deposits=False, seeks_best=True
    ),
}
"""Value of `--agent` -> the agent; the first is the default, see `settings.agent_with`.
To add one, add an entry."""


CHOICES = {
    "schedule": ("synchronous", "asynchronous"),
    "selection": ("max_boltzmann", "boltzmann", "epsilon_greedy"),
    "traces": ("replacing", "accumulating"),
    "update": ("each_visit", "in_turn", "once_per_ant", "once_per_trial"),
}
"""Parameters that take one of some words; the modules that have them import Numba."""


@dataclass(frozen=True)
class Declared:
    """A parameter of an agent as its class declares it.

    Attributes:
        default: of the constructor.
        scheduled: whether a schedule may stand in for the number.
        words: what it is and its range, such as "Exploration probability, in [0, 1]".
        range: such as "in [0, 1]"; "" where it is no number.
    """

    default: Any
    scheduled: bool = False
    words: str = ""
    range: str = ""


@cache
def parameters(name: str) -> dict[str, Declared]:
    """What `--param` may set.

    Args:
        name: a key of `AGENTS`.
    """
    module = AGENTS[name].module
    node = class_node(module, AGENTS[name].name)
    numbers = dict(_numbers(node, module))
    constructor = next(
        each
        for each in node.body
        if isinstance(each, ast.FunctionDef) and each.name == "__init__"
    )
    keywords = zip(
        constructor.args.kwonlyargs, constructor.args.kw_defaults, strict=True
    )
    found = {}
    for keyword, default in keywords:
        if keyword.arg in OWN_OPTIONS:
            continue
        value = None if default is None else ast.literal_eval(default)
        choices = ", ".join(CHOICES.get(keyword.arg, ()))
        scheduled, words, within = numbers.get(keyword.arg, (False, choices, ""))
        found[keyword.arg] = Declared(value, scheduled, words, within)
    return found


def _numbers(node: ast.ClassDef, module: str) -> Any:
    """The attributes that declare a parameter, each with what it says of itself."""
    # A declaration that classes share is what a function of their module returns.
    shared = {
        each.name: each.body[-1].value
        for each in module_tree(module).body
        if isinstance(each, ast.FunctionDef) and isinstance(each.body[-1], ast.Return)
    }
    for each in node.body:
        if not (isinstance(each, ast.Assign) and isinstance(each.value, ast.Call)):
            continue
        call: Any = each.value
        call = shared.get(getattr(call.func, "id", ""), call)
        kind = getattr(getattr(call, "func", None), "id", "")
        if kind not in ("Parameter", "OfRule"):
            continue
        given = {k.arg: ast.literal_eval(k.value) for k in call.keywords}
        meaning, within = ast.literal_eval(call.args[0]), ""
        if kind == "Parameter":
            bounds = {n: given[n] for n in Range.__dataclass_fields__ if n in given}
            within = Range(**bounds).in_words()
        scheduled = bool(given.get("scheduled", False))
        words = f"{meaning}, {within}" if within else meaning
        for target in each.targets:
            if isinstance(target, ast.Name):
                yield target.id, (scheduled, words, within)


def load_agent(path: str) -> Any:
    """Load an agent of any kind from a file.

    Raises:
        BadArgumentError: there is no such file, or it holds no agent of this package.
    """
    from acl_gym.utils.archives import Archive

    with bad_arguments():
        name = str(Archive(path).header.get("agent"))
    for kind in AGENTS.values():
        if kind.name == name:
            with bad_arguments():
                return kind.load().load(path)
    names = ", ".join(kind.name for kind in AGENTS.values())
    raise BadArgumentError(f"{path} must hold one of {names}, got {name!r}.")


def name_of(agent: Any) -> str:
    """The value of `--agent` for an agent."""
    kind = type(agent).__name__
    return next(name for name, each in AGENTS.items() if each.name == kind)
