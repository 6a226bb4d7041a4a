"""Where the workers of a `WorkersVectorEnv` run: here, in processes, or on a cluster."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import pickle
import signal
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Protocol

from acl_gym.envs.wrappers.hosting import (
    Host,
    Request,
    packed_answer,
    packed_env_fns,
    packed_message,
    unpacked_env_fns,
)
from acl_gym.utils.processes import serve_parent
from acl_gym.utils.ray_cluster import connected_ray

EXECUTORS = ("processes", "ray", "serial")

_LOOK_EVERY = 1.0
"""Seconds between looks at whether a silent process is still alive."""

GRACE = 5.0
"""Seconds in which a worker that is dismissed, or whose parent has died, may close its
environments."""


_TOO_LATE = "gave no answer in time"


class WorkerLostError(Exception):
    """A worker has died, or does not answer."""


class Worker(Protocol):
    """Environments of some slots in some process; it takes one request at a time."""

    def send(self, request: Request) -> None:
        """Ask something."""

    def receive(self, timeout: float | None) -> Any:
        """Wait for the answer, at most `timeout` seconds; None waits for ever.

        Raises:
            WorkerLostError: there will be none.
        """

    def dismiss(self) -> None:
        """Ask it to close its environments and to end."""

    def stop(self, grace: float = 0.0) -> None:
        """See that it ends, by force if it has not after `grace` seconds."""


Hire = Callable[[int], Worker]
"""Returns a new worker for a block of slots, by the number of the block."""


def hiring(executor: str, env_fns: Sequence[Any], blocks: Sequence[range]) -> Hire:
    """Return what makes workers.

    Args:
        executor: one of `EXECUTORS`.
        env_fns: functions that make the environments, one for each slot.
        blocks: the slots of each worker.

    Raises:
        TypeError: a function cannot be sent to another process.
        ModuleNotFoundError: Ray is needed and not installed.
        ConnectionError: Ray is needed and there is no cluster.
    """
    own = [env_fns[block.start : block.stop] for block in blocks]
    if executor == "serial":
        return lambda number: _Serial(blocks[number].start, own[number])
    packed = [
        packed_env_fns(functions, block.start)
        for functions, block in zip(own, blocks, strict=True)
    ]
    if executor == "processes":
        return lambda number: _Process(blocks[number].start, packed[number])
    ray, _ = connected_ray()
    # Once to the cluster, however often workers are to be replaced.
    stored = [ray.put(each) for each in packed]
    return lambda number: _RayActor(ray, blocks[number].start, stored[number])


class _Serial:
    """A worker that is this process."""

    def __init__(self, first: int, env_fns: Sequence[Any]) -> None:
        self._host = Host(first, lambda: env_fns)

    def send(self, request: Request) -> None:
        self._request = request

    def receive(self, timeout: float | None) -> Any:
        return self._host.answer(self._request)

    def dismiss(self) -> None:
        self._host.close()

    def stop(self, grace: float = 0.0) -> None:
        self._host.close()


class _Process:
    """A process of this machine.

    It is one of loky's, which begins with an empty `__main__`, so that scripts need no
    `if __name__ == "__main__"`.
    """

    def __init__(self, first: int, env_fns: bytes) -> None:
        from loky.backend import get_context

        context: Any = get_context("loky")
        self._connection, other = context.Pipe()
        self._process = context.Process(
            target=_serve, args=(other, os.getpid(), first, env_fns)
        )
        self._process.start()
        other.close()  # so that the connection ends with the process

    def send(self, request: Request) -> None:
        packed = packed_message(request)
        with contextlib.suppress(OSError):  # `receive` finds the reason
            self._connection.send_bytes(packed)

    def receive(self, timeout: float | None) -> Any:
        deadline = None if timeout is None else time.monotonic() + timeout
        try:
            while not self._connection.poll(_pause(deadline)):
                # What the process has started may still hold the connection open.
                if not (self._process.is_alive() or self._connection.poll()):
                    raise EOFError
                if deadline is not None and time.monotonic() >= deadline:
                    raise WorkerLostError(_TOO_LATE)
            return pickle.loads(self._connection.recv_bytes())
        except (EOFError, OSError):
            self._process.join(_LOOK_EVERY)
            raise WorkerLostError(_how_it_ended(self._process.exitcode)) from None

    def dismiss(self) -> None:
        self._connection.close()

    def stop(self, grace: float = 0.0) -> None:
        self._connection.close()
        self._process.join(grace)
        if self._process.is_alive():
            if sys.platform == "win32":
                self._process.terminate()
            else:
                os.kill(self._process.pid, signal.SIGKILL)
            self._process.join()


def _pause(deadline: float | None) -> float:
    if deadline is None:
        return _LOOK_EVERY
    return min(_LOOK_EVERY, max(0.0, deadline - time.monotonic()))


def _how_it_ended(code: int | None) -> str:
    if code is None:
        return "has broken the connection"
    if code < 0:
        try:
            name = signal.Signals(-code).name
        except ValueError:
            name = f"signal {-code}"
        memory = ", as happens when memory runs out" if name == "SIGKILL" else ""
        return f"was killed by {name}{memory}"
    return f"ended with exit code {code}"


def _serve(connection: Any, parent: int, first: int, env_fns: bytes) -> None:
    """The life of a process that is a worker."""
    serve_parent(parent, GRACE)
    # For environments with processes of their own: those of the system, not loky's.
    multiprocessing.set_start_method(None, force=True)
    host = Host(first, partial(unpacked_env_fns, env_fns))
    # The connection ends with the parent, or when it has no more requests.
    with contextlib.suppress(EOFError, OSError):
        while True:
            request = pickle.loads(connection.recv_bytes())
            connection.send_bytes(packed_answer(host.answer(request), first))
    with contextlib.suppress(Exception):  # there is nobody left to tell
        host.close()


class _RayActor:
    """An actor on a Ray cluster, each node of which needs this version of acl_gym."""

    def __init__(self, ray: Any, first: int, env_fns: Any) -> None:
        self._ray = ray
        # By default an actor needs a processor only where it is placed, not to run, so
        # that it need not wait for others to end.
        kind = ray.remote(max_restarts=0)(_Actor)
        self._actor = kind.options(scheduling_strategy="SPREAD").remote(first, env_fns)
        self._answer: Any = None

    def send(self, request: Request) -> None:
        with self._losses():
            self._answer = self._actor.answer.remote(packed_message(request))

    def receive(self, timeout: float | None) -> Any:
        with self._losses():
            return pickle.loads(self._ray.get(self._answer, timeout=timeout))

    @contextlib.contextmanager
    def _losses(self) -> Any:
        try:
            yield
        except self._ray.exceptions.GetTimeoutError:
            raise WorkerLostError(_TOO_LATE) from None
        except self._ray.exceptions.RayError as error:
            reason = str(error).strip().splitlines()[-1].partition(". ")[0]
            raise WorkerLostError(f"was lost by Ray ({reason})") from error

    def dismiss(self) -> None:
        if self._ray.is_initialized():
            with contextlib.suppress(self._ray.exceptions.RayError):
                self._answer = self._actor.close.remote()

    def stop(self, grace: float = 0.0) -> None:
        if self._ray.is_initialized():
            if grace and self._answer is not None:
                self._ray.wait([self._answer], timeout=grace)
            self._ray.kill(self._actor, no_restart=True)


class _Actor:
    """What runs on the cluster."""

    def __init__(self, first: int, env_fns: bytes) -> None:
        self._first = first
        self._host = Host(first, partial(unpacked_env_fns, env_fns))

    def answer(self, request: bytes) -> bytes:
        return packed_answer(self._host.answer(pickle.loads(request)), self._first)

    def close(self) -> None:
        self._host.close()
