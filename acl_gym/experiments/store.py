"""Runs as Parquet files: one a run, with all that it depends on inside."""

from __future__ import annotations

import hashlib
import io
import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from acl_gym.experiments.provenance import code_of_runs, versions
from acl_gym.experiments.results import Run
from acl_gym.experiments.study import AnyStudy
from acl_gym.utils.files import write_atomically
from acl_gym.utils.hashing import hashed
from acl_gym.utils.typing import FloatArray

_METADATA = b"acl_gym"
_TABLE = "table"

# A file that is not there, is cut short or damaged, or is not of this program.
_UNREADABLE = (
    ArithmeticError,
    AttributeError,
    LookupError,
    MemoryError,
    OSError,
    RecursionError,
    TypeError,
    ValueError,
    pa.ArrowException,
)


@dataclass(frozen=True)
class Job:
    """One run to be made: a study with a seed."""

    study: AnyStudy
    seed: int

    @property
    def name(self) -> str:
        """The file name, without extension."""
        study = self.study
        return f"{study.method}-{study.subject}-{study.key}-{self.seed}"

    @cached_property
    def key(self) -> str:
        """What must be equal for a kept run to be used: inputs, code and versions."""
        return hashed([self.study.inputs, self.seed, code_of_runs(), versions()])


class Store:
    """A folder with a Parquet file for each run.

    Its rows are the evaluations, its columns the measures; the last row holds the
    table as well. All else is JSON in the metadata of the schema, under `acl_gym`: the
    key, the study, the seed, seconds, failure, where and when the run was made, and a
    checksum over all of this, rows and table included.

    Attributes:
        directory: where they are.
    """

    def __init__(self, directory: Path) -> None:
        self.directory = directory

    def path(self, job: Job) -> Path:
        """The file of a run."""
        return self.directory / f"{job.name}.parquet"

    def has(self, job: Job) -> bool:
        """Whether a run is there, as far as the end of its file says."""
        try:
            metadata = pq.read_schema(self.path(job)).metadata or {}
            return bool(json.loads(metadata[_METADATA])["key"] == job.key)
        except _UNREADABLE:
            return False

    def read(self, job: Job) -> Run | None:
        """A run; None if it is not there, is damaged, or was made from something else."""
        try:
            content = pq.read_table(self.path(job))
            known = json.loads((content.schema.metadata or {})[_METADATA])
            if known["key"] != job.key:
                return None
            table = content.column(_TABLE)[-1].values.to_numpy()
            rows = pd.DataFrame(
                {
                    name: content.column(name).to_numpy().astype(np.float64)
                    for name in content.column_names
                    if name != _TABLE
                }
            )
            if known.pop("checksum") != _checksum(known, rows, table):
                return None
            return Run(
                rows,
                table,
                known["seconds"],
                known["failure"],
                job.seed,
                known["made"],
                known["partition"],
            )
        except _UNREADABLE:
            return None

    def write(self, job: Job, run: Run, made: dict[str, Any]) -> None:
        """Write a run atomically."""
        table = np.asarray(run.table)
        metadata = {
            "key": job.key,
            "study": job.study.inputs,
            "seed": job.seed,
            "seconds": run.seconds,
            "failure": run.failure,
            "partition": run.partition,
            "made": made,
        }
        metadata["checksum"] = _checksum(metadata, run.rows, table)
        columns: dict[str, Any] = {
            name: pa.array(run.rows[name].to_numpy()) for name in run.rows.columns
        }
        cells = [None] * (len(run.rows) - 1) + [table]
        columns[_TABLE] = pa.array(cells, type=pa.list_(pa.float64()))
        content = pa.table(columns).replace_schema_metadata(
            {_METADATA: json.dumps(metadata)}
        )
        buffer = io.BytesIO()
        pq.write_table(content, buffer, compression="zstd")
        write_atomically(self.path(job), buffer.getvalue())


def _checksum(metadata: dict[str, Any], rows: pd.DataFrame, table: FloatArray) -> str:
    """A checksum over all that a run consists of.

    Parquet has none of its own here: a flipped bit would be read as another number.
    """
    numbers = [rows[name].to_numpy().astype(np.float64) for name in rows.columns]
    numbers.append(table.astype(np.float64))
    digests = [hashlib.sha256(each.tobytes()).hexdigest() for each in numbers]
    return hashed([json.loads(json.dumps(metadata)), list(rows.columns), digests])
