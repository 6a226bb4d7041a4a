"""A file from a stranger runs no code."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from acl_gym import ACL
from tests.cli.runner import MODULE, SMALL, figures, invoke, refused, run

PAYLOAD = "from pathlib import Path\nPath('ran').touch()\n" + MODULE


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> str:
    out = tmp_path_factory.mktemp("trained") / "x.npz"
    return str(figures(*SMALL, "--trials", "1", "--out", str(out))["file"])


@pytest.fixture
def file_with(trained: str) -> Callable[..., str]:
    def file_with(**metadata: Any) -> str:
        agent = ACL.load(trained)
        agent.metadata |= metadata
        return str(agent.save("stranger.npz"))

    return file_with


@pytest.fixture(autouse=True)
def payload(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A module that can be imported, and that says so when it is."""
    (tmp_path / "payload.py").write_text(PAYLOAD)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "payload", raising=False)


COMMANDS = [["evaluate"], ["train", "--trials", "1", "--resume"]]


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize(
    "metadata",
    [
        {"env_id": "payload:Corridor-v0"},
        {"env_id": "payload:acl_gym/Nothing-v0"},
        {"env_args": {"torques": "payload:Corridor"}},
        {"env_args": {"render_mode": "human"}},
        {"env_args": {"env_id": "payload:Corridor-v0"}},
        {"env_args": {"torques": {"a": object}}},
        {"env_args": [1]},
        {"discretize": ["5"]},
        {"discretize": [5], "end_to_end": "yes"},
        {"env_id": 5},
    ],
)
def test_no_module_is_imported_because_a_file_says_so(
    command: list[str],
    metadata: dict[str, Any],
    file_with: Callable[..., str],
    tmp_path: Path,
) -> None:
    if "object" in str(metadata):
        metadata = {"env_args": {"torques": [[[[[0.0]]]]]}}
    refused(2, *command, file_with(**metadata))
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize("command", COMMANDS)
def test_a_new_interpreter_imports_none_either(
    command: list[str], file_with: Callable[..., str], tmp_path: Path
) -> None:
    """There the present folder comes first among those of modules."""
    done = run(*command, file_with(env_id="payload:Corridor-v0"), cwd=tmp_path)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1, done.stderr
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize(
    "how",
    [{"episodes": 10**9}, {"max_steps": 10**12}, {"seed": -1}, {"episodes": "5"}, [1]],
)
def test_how_it_was_evaluated_is_checked(
    how: Any, file_with: Callable[..., str]
) -> None:
    assert "must hold evaluation" in refused(2, "evaluate", file_with(evaluation=how))


def test_a_registered_id_with_a_module_before_it_needs_no_import(
    file_with: Callable[..., str], tmp_path: Path
) -> None:
    file = file_with(env_id="payload:acl_gym/Pendulum-v0")
    assert invoke("evaluate", file).exit_code == 0
    assert not (tmp_path / "ran").exists()


def test_what_the_user_types_is_imported(tmp_path: Path) -> None:
    arguments = ["train", "payload:Corridor-v0", "--ants", "3", "--cells", "5"]
    done = run(
        *(*arguments, "--trials", "2", "--param", "tau0=0.001", "--out", "c"),
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    (tmp_path / "ran").unlink()
    again = run("train", "--resume", "c.npz", "--trials", "1", cwd=tmp_path)
    assert again.returncode == 2
    assert "name it yourself: add payload:Corridor-v0" in again.stderr
    assert not (tmp_path / "ran").exists()
    typed = run(
        *("train", "payload:Corridor-v0", "--resume", "c.npz", "--trials", "1"),
        cwd=tmp_path,
    )
    assert typed.returncode == 0, typed.stderr
    assert (tmp_path / "ran").exists()
