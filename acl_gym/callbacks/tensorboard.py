"""A log of scalars for TensorBoard."""

from __future__ import annotations

import time
from importlib import import_module
from numbers import Real
from pathlib import Path
from typing import Any

from acl_gym.callbacks.base import Agent, Callback
from acl_gym.utils import validation
from acl_gym.utils.typing import Row

# Column of a row -> tag; TensorBoard groups tags by the part before the slash.
_TAGS = {
    "ants_cost": "cost/ants",
    "policy_cost": "cost/policy",
    "ants_return": "return/ants",
    "policy_return": "return/policy",
    "ants_success_rate": "success/ants",
    "success_rate": "success/policy",
    "policy_variation": "policy/variation",
    "sensitivity": "policy/sensitivity",
    "trial": "time/trial",
    "seconds": "time/seconds",
}


class TensorBoardLog(Callback):
    """Writes the measures of each trial as scalars over environment steps.

    View them with `tensorboard --logdir DIRECTORY`. Tags are `cost/policy`, `cost/ants`,
    `return/policy`, `success/policy` and so on, and `other/NAME` for measures of your own.
    When a loaded agent continues learning, scalars of later steps from an earlier run
    are hidden. Place it after the callbacks that add measures.

    Args:
        directory: receives the event files; made if missing. Use one per run.

    Raises:
        TypeError: `directory` is not a path.
        ModuleNotFoundError: tensorboard is not installed.
    """

    def __init__(self, directory: str | Path) -> None:
        self.directory = validation.path("directory", directory)
        _tensorboard()  # if it is missing, that is said before learning
        self._writer: Any = None
        self._written: Row = {}

    def on_training_start(self, agent: Agent) -> None:
        """Open an event file."""
        self._written = dict(agent.history[-1]) if agent.history else {}
        self._writer = _ScalarWriter(
            str(self.directory), agent.num_timesteps + 1 if agent.history else None
        )

    def on_trial_end(self, agent: Agent, row: Row) -> bool | None:
        """Write the row."""
        self._write(row, row)
        return True

    def on_training_end(self, agent: Agent) -> None:
        """Write measures that were added to the last row later, and close the file."""
        if agent.history:
            row = agent.history[-1]
            self._write(
                row, {name: row[name] for name in row if name not in self._written}
            )
        self._writer.close()

    def _write(self, row: Row, values: Row) -> None:
        step = int(row["env_steps"])
        for name, value in values.items():
            if name != "env_steps" and isinstance(value, Real):  # notes have no curve
                tag = _TAGS.get(name, f"other/{name}")
                self._writer.add_scalar(tag, float(value), step)
        self._written = dict(row)


class _ScalarWriter:
    """Writes scalars to an event file, as torch's `SummaryWriter`, but without torch.

    Args:
        directory: receives the event file.
        purge_step: TensorBoard hides what earlier files hold from this step on; None
            hides nothing.

    Raises:
        ModuleNotFoundError: tensorboard is not installed.
    """

    def __init__(self, directory: str, purge_step: int | None) -> None:
        event, _, event_file_writer = _tensorboard()
        self._file = event_file_writer.EventFileWriter(directory, flush_secs=10)
        if purge_step is not None:
            start = event.SessionLog(status=event.SessionLog.START)
            self._add(purge_step, session_log=start)

    def add_scalar(self, tag: str, value: float, step: int) -> None:
        """Write a value of the scalar `tag`."""
        _, summary, _ = _tensorboard()
        scalar = summary.Summary.Value(tag=tag, simple_value=value)
        self._add(step, summary=summary.Summary(value=[scalar]))

    def close(self) -> None:
        """Write what is left and close the file."""
        self._file.close()

    def _add(self, step: int, **content: Any) -> None:
        event, _, _ = _tensorboard()
        self._file.add_event(event.Event(wall_time=time.time(), step=step, **content))


def _tensorboard() -> tuple[Any, Any, Any]:
    """The modules of events, of summaries and of the file writer."""
    names = ("compat.proto.event_pb2", "compat.proto.summary_pb2")
    try:
        event, summary, writer = (
            import_module(f"tensorboard.{name}")
            for name in (*names, "summary.writer.event_file_writer")
        )
    except ImportError as error:
        raise ModuleNotFoundError(
            "TensorBoardLog needs tensorboard, which is not installed; "
            'run `pip install "acl-gym[tensorboard]"`.'
        ) from error
    return event, summary, writer
