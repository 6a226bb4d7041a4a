"""Workers that are asked together, and replaced when they die."""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from gymnasium.error import ClosedEnvironmentError

from acl_gym.envs.wrappers.executors import GRACE, Hire, Worker, WorkerLostError
from acl_gym.envs.wrappers.hosting import Failure, Repeat, Request

logger = logging.getLogger("acl_gym")

MOST_LOSSES = 3
"""How often in a row a worker may be lost at the same request."""

STARTING_TIME = 60.0
"""Seconds in which a new worker must have made its environments, if there is a timeout."""

Question = tuple[str, tuple[Any, ...]]
"""The name of a method of `Host`, and its arguments."""


class WorkerDiedError(RuntimeError):
    """A worker has died again and again while it did the same."""


class _Member:
    """A place in the crew.

    Attributes:
        slots: whose environments its worker has.
        worker: None until it is needed, and after a loss.
        behind: whether the worker has left the episodes as they stand, so that they
            must be repeated.
        losses: workers lost in a row.
    """

    def __init__(self, slots: range) -> None:
        self.slots = slots
        self.worker: Worker | None = None
        self.behind = False
        self.losses = 0
        self._requests: list[tuple[Request, float | None]] = []
        self._deadline: float | None = None

    def put(self, worker: Worker, requests: list[tuple[Request, float | None]]) -> None:
        """Ask the first of some requests; each has so many seconds, or any time."""
        self.worker, self._requests = worker, requests
        self._send_next()

    def receive(self) -> tuple[Any, bool]:
        """An answer, and whether it is the last one; if not, the next is asked."""
        if self.worker is None:
            raise WorkerLostError("was stopped")
        left = None
        if self._deadline is not None:
            left = max(0.0, self._deadline - time.monotonic())
        answer = self.worker.receive(left)
        last = isinstance(answer, Failure) or not self._requests
        if not last:
            self._send_next()
        return answer, last

    def _send_next(self) -> None:
        request, seconds = self._requests.pop(0)
        self._deadline = None if seconds is None else time.monotonic() + seconds
        if self.worker is not None:
            self.worker.send(request)

    def stop(self) -> None:
        if self.worker is not None:
            self.worker.stop()
            self.worker = None


class Crew:
    """One worker for each block of slots.

    Args:
        hire: see `Hire`.
        blocks: the slots of each worker.
        timeout: seconds that a worker may take for one step or reset of its slots,
            > 0; None: any time.
    """

    def __init__(
        self, hire: Hire, blocks: Sequence[range], timeout: float | None
    ) -> None:
        self._hire = hire
        self._members = [_Member(block) for block in blocks]
        self._timeout = timeout
        self._dismissed = False
        self._told = False  # of a worker that was lost

    def ask(
        self,
        questions: Mapping[int, Question],
        repeats: Callable[[range], list[Repeat]],
    ) -> dict[int, Any]:
        """Ask some workers, all at once, and wait for their answers.

        Where a worker dies, a new one repeats its episodes and is asked the same.
        Whatever exception comes, at the next call everything is as before this one.

        Args:
            questions: what to ask which worker, by the number of its block.
            repeats: returns the episodes of a block that are under way and do not end
                by the question.

        Returns:
            The answers of the workers.

        Raises:
            ClosedEnvironmentError: the workers were dismissed.
            WorkerDiedError: a worker has died several times in a row.
            Exception: whatever an environment has raised; of several that of the first
                slot.
        """
        if self._dismissed:
            raise ClosedEnvironmentError(
                "the environment was closed, and its workers with it; make a new one."
            )
        waiting, answers = deque(questions), {}
        try:
            for number in questions:
                self._put(number, questions[number], repeats)
            while waiting:
                number = waiting[0]
                try:
                    answers[number], last = self._members[number].receive()
                except WorkerLostError as loss:
                    self._note_loss(number, loss)
                    self._put(number, questions[number], repeats)
                    last = False
                waiting.rotate(-1)
                if last:
                    waiting.remove(number)
        except BaseException:
            # Those that have not answered would answer later, to another question.
            for number in waiting:
                self._members[number].stop()
            for number in questions:
                self._members[number].behind = True
            raise
        for number in questions:
            self._members[number].losses = 0
        failures = [answers[each] for each in sorted(answers)]
        failures = [each for each in failures if isinstance(each, Failure)]
        for number in questions:
            self._members[number].behind = bool(failures)
        if failures:
            raise failures[0].raised()
        return answers

    def dismiss(self) -> None:
        """Let all workers end; calling it again is harmless."""
        self._dismissed = True
        working = [each.worker for each in self._members if each.worker is not None]
        for member in self._members:
            member.worker = None
        for worker in working:
            worker.dismiss()
        end = time.monotonic() + GRACE
        for worker in working:
            worker.stop(max(0.0, end - time.monotonic()))

    def _put(
        self,
        number: int,
        question: Question,
        repeats: Callable[[range], list[Repeat]],
    ) -> None:
        """Ask a worker. A new one, or one that is behind, first repeats its episodes."""
        member, limit = self._members[number], self._timeout
        worker = member.worker
        missing = worker is None or member.behind
        before = repeats(member.slots) if missing else []
        steps = 1 + max((1 + len(each.actions) for each in before), default=0)
        requests = [
            (Request(before, *question), None if limit is None else steps * limit)
        ]
        if worker is None:
            worker = self._hire(number)
            start = None if limit is None else max(limit, STARTING_TIME)
            requests.insert(0, (Request([], "ready", ()), start))
        member.put(worker, requests)

    def _note_loss(self, number: int, loss: WorkerLostError) -> None:
        """Put away a worker that was lost.

        Raises:
            WorkerDiedError: it was not the first.
        """
        member = self._members[number]
        member.stop()
        member.losses += 1
        first, last = member.slots[0], member.slots[-1]
        slots = f"slot {first}" if first == last else f"slots {first} to {last}"
        name = f"worker {number}, which has {slots},"
        if member.losses >= MOST_LOSSES:
            member.losses = 0
            raise WorkerDiedError(
                f"{name} {loss}; so did the workers before it at the same step, "
                f"{MOST_LOSSES} in a row. To see where, let the environments run in this "
                "process with executor='serial'."
            ) from loss
        level = logging.INFO if self._told else logging.WARNING
        self._told = True
        logger.log(level, "%s %s; a new one repeats its episodes.", name, loss)
