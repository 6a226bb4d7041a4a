"""A log of scalars for TensorBoard."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from acl_gym.callbacks.base import Agent, Callback
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
        ModuleNotFoundError: tensorboard is not installed.
    """

    def __init__(self, directory: str | Path) -> None:
        self.directory = Path(directory)
        self._writer_type = _import_writer()
        self._writer: Any = None
        self._written: Row = {}

    def on_training_start(self, agent: Agent) -> None:
        """Open an event file."""
        self._written = dict(agent.history[-1]) if agent.history else {}
        self._writer = self._writer_type(
            str(self.directory),
            purge_step=agent.num_timesteps + 1 if agent.history else None,
            flush_secs=10,
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
            if name != "env_steps":
                tag = _TAGS.get(name, f"other/{name}")
                self._writer.add_scalar(tag, float(value), step)
        self._written = dict(row)


def _import_writer() -> Any:
    # Imported here because torch takes seconds to import.
    try:
        from torch.utils.tensorboard import SummaryWriter
    except ImportError as error:
        raise ModuleNotFoundError(
            "TensorBoardLog needs tensorboard, which is not installed; "
            'run `pip install "acl-gym[tensorboard]"`.'
        ) from error
    return SummaryWriter
