"""Classes as their source files declare them, read without importing them.

Importing an agent or an environment imports Numba, which takes a second. Names and
descriptions can be had from the source, also where the package lies in a zip file.
"""

from __future__ import annotations

import ast
from functools import cache
from importlib.resources import files


@cache
def module_tree(module: str) -> ast.Module:
    """The syntax tree of a module of this package.

    Args:
        module: such as "acl_gym.agents.acl".
    """
    package, *folders, last = module.split(".")
    file = files(package).joinpath(*folders, f"{last}.py")
    return ast.parse(file.read_text(encoding="utf-8"))


def class_node(module: str, name: str) -> ast.ClassDef:
    """The syntax tree of a class of this package.

    Args:
        module: its module, such as "acl_gym.agents.acl".
        name: its name.

    Raises:
        LookupError: there is no such class.
    """
    for node in module_tree(module).body:
        if isinstance(node, ast.ClassDef) and node.name == name:
            return node
    raise LookupError(f"{module} must have a class {name!r}, but has none.")
