"""The wait for the compiler is announced once, and only when there is one."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from acl_gym.utils import compiling

TRIAL = """
import gymnasium as gym
from acl_gym import ACL
from acl_gym.partitions.automatic import thesis_partition
env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=2)
ACL(env, thesis_partition(env), seed=0, max_steps=2).learn(trials=1)
"""


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
