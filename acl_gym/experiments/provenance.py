"""What a run depends on beside its study, and where, when and with what it was made."""

from __future__ import annotations

import ast
import datetime
import hashlib
import os
import platform
import subprocess
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import acl_gym

ROOT = Path(acl_gym.__file__).parent

RUNS = "acl_gym.experiments.methods"
"""The module that makes runs."""

_PACKAGES = ("numpy", "numba", "scipy", "gymnasium", "stable-baselines3", "torch")

# They draw or say something while a run is made, and change nothing in its result.
_SILENT = ("compiling", "rendering", "painter")


@cache
def code_of_runs(root: Path = ROOT) -> str:
    """A hash over the code that runs depend on.

    That is the module that makes them, what it imports from this package, directly or
    not, and every environment with its maps, for environments are made by their ids.
    Figures, claims, comments and docstrings are excluded, and so is what only a type
    checker reads.

    Args:
        root: where the package lies.
    """
    digest = hashlib.sha256()
    if not root.is_dir():  # in a zip file, which counts as a whole
        archive = next(each for each in root.parents if each.is_file())
        return hashlib.sha256(archive.read_bytes()).hexdigest()
    for name, path in sorted(sources_of(RUNS, root).items()):
        digest.update(name.encode())
        digest.update(_read(path).executed.encode())
    for path in sorted(root.glob("envs/**/*.txt")):
        digest.update(path.name.encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


def sources_of(module: str, root: Path = ROOT) -> dict[str, Path]:
    """The files that a module runs on, by the names of their modules.

    Args:
        module: the name of a module.
        root: where the package lies.
    """
    files = {_module_name(path, root): path for path in root.rglob("*.py")}
    found: dict[str, Path] = {}
    waiting = [module, *(name for name in files if name.startswith("acl_gym.envs"))]
    while waiting:
        name = waiting.pop()
        if name in found or name not in files or name.endswith(_SILENT):
            continue
        found[name] = files[name]
        waiting += _imported(files[name], files)
    return found


def _module_name(path: Path, root: Path) -> str:
    parts = path.relative_to(root).with_suffix("").parts
    return ".".join(["acl_gym", *(p for p in parts if p != "__init__")])


def _imported(path: Path, files: dict[str, Path]) -> list[str]:
    """The modules of this package that a file imports when it is run."""
    return [
        each.module if each.name is None else _home(each.module, each.name, files)
        for each in _read(path).imports
    ]


def _home(package: str, name: str, files: dict[str, Path]) -> str:
    """The module in which an imported name is defined.

    What else a package's `__init__` offers beside the name does not count.
    """
    if f"{package}.{name}" in files:
        return f"{package}.{name}"
    path = files.get(package)
    if path is not None and path.name == "__init__.py":
        for each in _read(path).imports:
            if each.name is not None and (each.alias or each.name) == name:
                return _home(each.module, each.name, files)
    return package


class _Import(NamedTuple):
    """A module that is imported, or a name of it; and what the name is called then."""

    module: str
    name: str | None = None
    alias: str | None = None


class _Source(NamedTuple):
    """What runs when a file is imported and its functions called."""

    executed: str
    imports: tuple[_Import, ...]


def _read(path: Path) -> _Source:
    return _parse(path.read_bytes())


@cache
def _parse(content: bytes) -> _Source:
    """Read a file once: packages are asked for again and again."""
    visitor = _Executed()
    executed = ast.dump(visitor.visit(ast.parse(content)))
    return _Source(executed, tuple(visitor.imports))


class _Executed(ast.NodeTransformer):
    """Removes docstrings, and what only a type checker reads; collects imports."""

    def __init__(self) -> None:
        self.imports: list[_Import] = []

    def visit_Expr(self, node: ast.Expr) -> ast.AST | None:
        value = node.value
        if isinstance(value, ast.Constant) and isinstance(value.value, str):
            return None
        return self.generic_visit(node)

    def visit_If(self, node: ast.If) -> ast.AST | list[ast.AST]:
        name = getattr(node.test, "id", getattr(node.test, "attr", None))
        if name != "TYPE_CHECKING":
            return self.generic_visit(node)
        node.body = []  # not visited, so that none of its imports is collected
        self.generic_visit(node)
        return [*node.orelse]

    def visit_Import(self, node: ast.Import) -> ast.AST:
        self.imports += [_Import(each.name) for each in node.names]
        return node

    def visit_ImportFrom(self, node: ast.ImportFrom) -> ast.AST | None:
        node.names = [each for each in node.names if each.name != "TYPE_CHECKING"]
        if node.module:
            self.imports += [
                _Import(node.module, each.name, each.asname) for each in node.names
            ]
        return node if node.names else None


@cache
def versions() -> dict[str, str]:
    """The versions of what computes results."""
    installed = {name: version(name) for name in _PACKAGES}
    return {"acl-gym": acl_gym.__version__, **installed}


def circumstances(workers: int) -> dict[str, Any]:
    """Where, when and with what a run is made.

    Args:
        workers: how many processes work at the same time.
    """
    return {
        "date": datetime.date.today().isoformat(),
        "python": platform.python_version(),
        "cpu": _cpu_name(),
        "cores": os.cpu_count(),
        "processes": workers,
        "commit": _commit(),
        **versions(),
    }


@cache
def _commit() -> str | None:
    """The commit of a checkout, with a plus sign if files differ; None elsewhere."""
    try:
        _, found, changes = (
            subprocess.run(
                ["git", "-C", str(ROOT), *arguments],
                capture_output=True,
                text=True,
                check=True,
                timeout=10,
            ).stdout.strip()
            for arguments in (
                # First, whether it is this package's checkout, and not one around it.
                ("ls-files", "--error-unmatch", "__init__.py"),
                ("rev-parse", "HEAD"),
                ("status", "--porcelain", "."),  # new files count as changes
            )
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return f"{found}+" if changes else found


@cache
def _cpu_name() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or "unknown"
    names = (line.split(":", 1)[1].strip() for line in lines if "model name" in line)
    return next(names, platform.processor() or "unknown")
