"""The wait for the compiler is announced once, and only when there is one."""

from __future__ import annotations

import logging
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from acl_gym.utils import compiling

TRIAL = """
import gymnasium as gym
from acl_gym import ACL
env = gym.make_vec("acl_gym/GridSearch1D-v0", num_envs=2)
ACL(env, seed=0, max_steps=2).learn(trials=1)
"""
"""The environment that needs the fewest kernels, a few seconds of compilation."""


def event(module: str) -> SimpleNamespace:
    kernel = SimpleNamespace(__module__=module)
    return SimpleNamespace(data={"dispatcher": kernel})


def wait_until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + 10.0
    while not condition() and time.monotonic() < end:
        time.sleep(0.005)


def compile_for(
    announcer: compiling.Announcer,
    clock: list[float],
    seconds: float,
    module: str = "acl_gym.partitions.kernels",
) -> None:
    announcer.on_start(event(module))
    announcer.on_start(event(module))  # a kernel within a kernel counts once
    clock[0] += seconds
    announcer.on_end(event(module))
    announcer.on_end(event(module))


def test_many_short_compilations_are_announced_once(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    clock = [0.0]
    monkeypatch.setattr(
        compiling, "time", SimpleNamespace(perf_counter=lambda: clock[0])
    )
    announcer = compiling.Announcer()
    with caplog.at_level(logging.WARNING, logger="acl_gym"):
        compile_for(announcer, clock, 50.0, "elsewhere.kernels")
        for _ in range(3):
            compile_for(announcer, clock, 0.3)
        assert caplog.messages == []
        for _ in range(3):
            announcer.on_start(event("acl_gym.partitions.kernels"))
            clock[0] += 0.4
            if announcer.seconds > compiling.PATIENCE:  # no patience is left
                wait_until(lambda: bool(caplog.messages))
            announcer.on_end(event("acl_gym.partitions.kernels"))
    assert len(caplog.messages) == 1
    assert "first use" in caplog.messages[0]
    assert announcer.seconds == pytest.approx(3 * 0.3 + 3 * 0.4)


def test_one_long_compilation_is_announced_while_it_goes_on(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(compiling, "PATIENCE", 0.05)
    announcer = compiling.Announcer()
    with caplog.at_level(logging.WARNING, logger="acl_gym"):
        announcer.on_start(event("acl_gym.partitions.kernels"))
        wait_until(lambda: bool(caplog.messages))
        assert len(caplog.messages) == 1
        announcer.on_end(event("acl_gym.partitions.kernels"))
        compile_for(announcer, [0.0], 0.0)
    assert len(caplog.messages) == 1


@pytest.mark.slow
def test_the_first_run_says_what_the_wait_is_for_and_the_second_nothing(
    tmp_path: Path,
) -> None:
    said = []
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, "-W", "error", "-c", TRIAL],
            capture_output=True,
            text=True,
            check=True,
            env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)},
        )
        said.append(done.stderr)
    assert "compiling its kernels for their first use" in said[0]
    assert said[1] == ""


def test_without_a_folder_for_the_cache_kernels_are_compiled_without_it(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def refuse(**options: Any) -> Any:
        def compiled(function: Any) -> Any:
            if "cache" in options:
                raise RuntimeError(f"cannot cache function {function!r}: no locator")
            return options, function

        return compiled

    monkeypatch.setattr(compiling.numba, "njit", refuse)
    monkeypatch.setattr(compiling, "announcer", compiling.Announcer())
    with caplog.at_level(logging.WARNING, logger="acl_gym"):
        assert compiling.njit(len) == ({}, len)
        assert compiling.njit(parallel=True)(len) == ({"parallel": True}, len)
    assert len(caplog.messages) == 1
    assert "NUMBA_CACHE_DIR" in caplog.messages[0]


def test_other_faults_of_compilation_are_not_hidden(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(function: Any) -> Any:
        raise RuntimeError("no memory")

    monkeypatch.setattr(compiling.numba, "njit", lambda **_: fail)
    with pytest.raises(RuntimeError, match="no memory"):
        compiling.njit(len)


@pytest.mark.slow
def test_an_installation_that_may_not_be_written_works(tmp_path: Path) -> None:
    """A file in the place of every __pycache__ keeps even root from writing there."""
    package = tmp_path / "site" / "acl_gym"
    source = Path(compiling.__file__).parents[1]
    shutil.copytree(source, package, ignore=shutil.ignore_patterns("__pycache__"))
    for folder in (package, *(path for path in package.rglob("*") if path.is_dir())):
        (folder / "__pycache__").touch(mode=0o444)
    nowhere = "/dev/null/home"
    kept = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA")}
    done = subprocess.run(
        [sys.executable, "-B", "-c", TRIAL],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env={
            **kept,
            "HOME": nowhere,
            "XDG_CACHE_HOME": nowhere,
            "PYTHONPATH": str(package.parent),
        },
        check=True,
    )
    assert done.stderr.count("NUMBA_CACHE_DIR") == 1


def test_a_function_of_no_module_is_compiled() -> None:
    """As one that a program defines in `exec`; it is not one of this package."""
    names: dict[str, Any] = {}
    exec("import numba\n@numba.njit\ndef twice(x):\n    return 2 * x", names)
    assert names["twice"].__module__ is None
    assert names["twice"](3) == 6
