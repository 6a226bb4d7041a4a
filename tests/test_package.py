"""The package from outside: its import, its metadata, its ids in a bare interpreter."""

import ast
import importlib
import importlib.metadata
import subprocess
import sys
from pathlib import Path

import pytest

import acl_gym

CITATION = Path(__file__).resolve().parents[1] / "CITATION.cff"
PUBLIC_MODULES = ("costs", "deposits", "schedules")
HEAVY = ("matplotlib", "numba", "pygame", "stable_baselines3", "torch")


def run_python(code: str, directory: Path) -> str:
    """Run code in a new interpreter, away from the checkout, warnings as errors."""
    result = subprocess.run(
        [sys.executable, "-I", "-W", "error", "-c", code],
        cwd=directory,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    return result.stdout.strip()


def test_import_is_light(tmp_path: Path) -> None:
    code = f"import sys, acl_gym; print(*sorted(set({HEAVY!r}) & set(sys.modules)))"
    assert run_python(code, tmp_path) == ""


def test_version_is_that_of_the_metadata() -> None:
    assert acl_gym.__version__ == importlib.metadata.version("acl-gym")


def test_types_are_announced() -> None:
    assert Path(acl_gym.__file__).with_name("py.typed").is_file()


def test_every_public_name_is_there() -> None:
    missing = [name for name in acl_gym.__all__ if not hasattr(acl_gym, name)]
    assert missing == []
    assert set(acl_gym.__all__) <= set(dir(acl_gym))


def names_imported_for_types() -> set[str]:
    tree = ast.parse(Path(acl_gym.__file__).read_text(encoding="utf-8"))
    (block,) = (
        node
        for node in tree.body
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
    )
    return {
        alias.name
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }


def test_the_table_of_public_names_is_complete() -> None:
    """For the interpreter, for `import *`, and for type checkers."""
    table = set(acl_gym._PUBLIC)
    assert set(acl_gym.__all__) == table | {"__version__"}
    assert names_imported_for_types() == table
    modules = [importlib.import_module(f"acl_gym.{name}") for name in PUBLIC_MODULES]
    for module in modules:
        assert set(module.__all__) - {"Episode", "Episodes"} <= table
    for name in table:
        module = importlib.import_module(acl_gym._PUBLIC[name])
        assert getattr(acl_gym, name) is getattr(module, name)


@pytest.mark.parametrize("name", PUBLIC_MODULES)
def test_public_modules_lack_nothing(name: str) -> None:
    """What is a cost, deposit or schedule in `colony`, except what stands in for one."""
    public = importlib.import_module(f"acl_gym.{name}")
    inside = importlib.import_module(f"acl_gym.colony.{name}")
    base = getattr(
        public, {"costs": "Cost", "deposits": "Deposit"}.get(name, "Schedule")
    )
    kinds = {
        kind.__name__
        for kind in vars(inside).values()
        if isinstance(kind, type) and issubclass(kind, base)
    }
    hidden = {each for each in kinds if each.startswith(("_", "Missing"))}
    assert kinds - hidden <= set(public.__all__)
    assert base.__name__ in public.__all__


def test_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no_such_name"):
        acl_gym.no_such_name  # noqa: B018


@pytest.mark.parametrize(
    ("imports", "env_id"),
    [
        ("import gymnasium as gym, acl_gym", "acl_gym/Pendulum-v0"),
        ("import gymnasium as gym", "acl_gym:acl_gym/Pendulum-v0"),
    ],
    ids=["imported", "bare"],
)
@pytest.mark.parametrize(
    ("make", "shape"),
    [("gym.make({!r})", (2,)), ("gym.make_vec({!r}, num_envs=3)", (3, 2))],
    ids=["make", "make_vec"],
)
def test_ids_work_in_a_new_interpreter(
    imports: str, env_id: str, make: str, shape: tuple[int, ...], tmp_path: Path
) -> None:
    code = f"""{imports}
env = {make.format(env_id)}
env.action_space.seed(1)
observation, info = env.reset(seed=1)
assert env.observation_space.contains(observation), observation
observation, *_ = env.step(env.action_space.sample())
assert env.observation_space.contains(observation), observation
print(observation.shape)
env.close()
"""
    assert run_python(code, tmp_path) == str(shape)


@pytest.mark.skipif(not CITATION.exists(), reason="not in the checkout")
def test_the_citation_names_this_version_and_the_thesis() -> None:
    text = CITATION.read_text()
    assert f"version: {acl_gym.__version__}\n" in text
    assert "Ant Colony Optimization for Control" in text
