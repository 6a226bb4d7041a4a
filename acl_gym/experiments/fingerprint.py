"""What code a result depends on: other code, other results."""

from __future__ import annotations

import ast
import hashlib
from functools import cache
from pathlib import Path

import acl_gym

ROOT = Path(acl_gym.__file__).parent

# They draw or say something while a task runs, and change nothing in its result.
_SILENT = frozenset(
    {
        "acl_gym.utils.compiling",
        "acl_gym.envs.grid_search.painter",
        "acl_gym.envs.navigation.painter",
        "acl_gym.envs.control.rendering",
    }
)


@cache
def code_fingerprint(module: str, root: Path = ROOT) -> str:
    """A hash over the source that a function depends on.

    That is its module, all of this package that it imports, directly or not, wherever
    in the file, and every environment, which is made by its id, with the maps. A page, a figure or a
    claim is none of it, so mending one leaves what has been run as it is.

    Args:
        module: where the function is; from another package it may use all of this one.
        root: where the package lies.
    """
    digest = hashlib.sha256()
    files = sources_of(module, root)
    files |= {path.name: path for path in root.glob("envs/grid_search/layouts/*.txt")}
    for name, path in sorted(files.items()):
        digest.update(name.encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


def sources_of(module: str, root: Path = ROOT) -> dict[str, Path]:
    """The files that `code_fingerprint` looks at, by the names of their modules."""
    everything = {_name_of(path, root): path for path in root.rglob("*.py")}
    if module not in everything:
        return everything
    found: dict[str, Path] = {}
    waiting = [module, *(n for n in everything if n.startswith("acl_gym.envs"))]
    while waiting:
        name = waiting.pop()
        if name in found or name not in everything or name in _SILENT:
            continue
        found[name] = everything[name]
        waiting += [name.rpartition(".")[0], *_imported(everything[name])]
    return found


def _name_of(path: Path, root: Path) -> str:
    parts = path.relative_to(root).with_suffix("").parts
    return ".".join(["acl_gym", *(p for p in parts if p != "__init__")])


def _imported(path: Path) -> list[str]:
    """Modules that a file imports, and names in them that may be modules as well."""
    names: list[str] = []
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Import):
            names += [each.name for each in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.append(node.module)
            names += [f"{node.module}.{each.name}" for each in node.names]
    return names
