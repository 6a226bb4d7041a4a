"""Results as Parquet files: one a task, with its settings, versions and seed inside."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from acl_gym.experiments.runner import Result, Task
from acl_gym.utils.files import write_atomically

_ABOUT = b"acl_gym"
_LEVELS = "levels"

# A file that is not there, is cut short, or is somebody else's.
_UNREADABLE = (OSError, KeyError, ValueError, TypeError, pa.ArrowException)


class ParquetStore:
    """A Parquet file a task.

    Its rows are the trials, its columns the measures; the last row holds the pheromone
    too. All else is JSON in the metadata of the schema, under the key `acl_gym`: key,
    settings (the seed among them), versions, and when and where it was made.

    Attributes:
        directory: where they are.
    """

    def __init__(self, directory: Path) -> None:
        self.directory = directory

    def path(self, task: Task) -> Path:
        """The file of a task."""
        return self.directory / f"{task.name}.parquet"

    def has(self, task: Task) -> bool:
        """Whether the result of a task is there, as far as the end of its file says."""
        try:
            metadata = pq.read_schema(self.path(task)).metadata or {}
            return bool(json.loads(metadata[_ABOUT])["key"] == task.key)
        except _UNREADABLE:
            return False

    def read(self, task: Task) -> Result | None:
        """See `Store.read`."""
        try:
            table = pq.read_table(self.path(task))
            about = json.loads((table.schema.metadata or {})[_ABOUT])
            if about["key"] != task.key:
                return None
            return _result(table, about)
        except _UNREADABLE:
            return None  # damaged, or somebody else's: it is made again

    def write(self, task: Task, result: Result) -> None:
        """See `Store.write`."""
        rest = {k: v for k, v in result.items() if k not in ("rows", _LEVELS)}
        about = {"key": task.key, "settings": task.settings, "result": rest}
        columns = {name: pa.array(values) for name, values in result["rows"].items()}
        count = len(next(iter(columns.values())))
        levels = [None] * (count - 1) + [np.asarray(result[_LEVELS])]
        columns[_LEVELS] = pa.array(levels, type=pa.list_(pa.float64()))
        table = pa.table(columns).replace_schema_metadata({_ABOUT: json.dumps(about)})
        buffer = io.BytesIO()
        pq.write_table(table, buffer, compression="zstd")
        write_atomically(self.path(task), buffer.getvalue())


def _result(table: Any, about: dict[str, Any]) -> Result:
    rows = {
        name: table.column(name).to_pylist()
        for name in table.column_names
        if name != _LEVELS
    }
    levels = table.column(_LEVELS)[-1].values.to_numpy()
    return {**about["result"], "rows": rows, _LEVELS: levels}
