"""A run is kept whole, with all that it was made from, or not at all."""

from __future__ import annotations

import json
import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from acl_gym.experiments import methods
from acl_gym.experiments.store import Job, Store
from acl_gym.experiments.systems import grid_1d

JOB = Job(replace(grid_1d(), trials=2), 3)


@pytest.fixture
def store(tmp_path: Path) -> Store:
    """A store with one run."""
    store = Store(tmp_path)
    store.write(JOB, methods.run(JOB.study, JOB.seed), {"date": "today"})
    return store


def test_what_is_read_is_what_was_written(store: Store) -> None:
    found, made = store.read(JOB), methods.run(JOB.study, JOB.seed)
    assert found is not None
    timeless = made.rows.drop(columns="seconds")
    assert found.rows.drop(columns="seconds").equals(timeless)
    assert found.table.tobytes() == made.table.tobytes()
    assert (found.seed, found.made) == (3, {"date": "today"})
    assert found.failure == ""
    assert [path.name for path in store.directory.iterdir()] == [f"{JOB.name}.parquet"]


def test_study_and_seed_are_inside(store: Store) -> None:
    metadata = json.loads(pq.read_schema(store.path(JOB)).metadata[b"acl_gym"])
    assert metadata["seed"] == 3
    assert metadata["study"]["settings"]["global_decay"] == 0.1
    assert metadata["key"] == JOB.key


@pytest.mark.parametrize("damage", ["cut", "text", "empty", "foreign"])
def test_a_damaged_file_counts_as_none(store: Store, damage: str) -> None:
    path = store.path(JOB)
    if damage == "foreign":
        table = pq.read_table(path).replace_schema_metadata(None)
        pq.write_table(table, path)
    else:
        content = path.read_bytes()
        path.write_bytes({"cut": content[:-50], "text": b"hello", "empty": b""}[damage])
    assert store.read(JOB) is None
    assert not store.has(JOB)


def test_another_seed_or_study_counts_as_none(store: Store) -> None:
    for other in (Job(JOB.study, 4), Job(JOB.study.with_settings(alpha=2.0), 3)):
        store.path(JOB).rename(store.path(other))
        assert store.read(other) is None
        assert not store.has(other)
        store.path(other).rename(store.path(JOB))
    assert store.has(JOB)


class _Trap:
    def __init__(self, path: str) -> None:
        self.path = path

    def __reduce__(self) -> Any:
        return (Path.touch, (Path(self.path),))


def test_nothing_in_a_file_is_code(tmp_path: Path) -> None:
    """A stranger's Parquet file with a pickle in every place that could hold one."""
    trap, store = tmp_path / "trap", Store(tmp_path)
    payload = pickle.dumps(_Trap(str(trap)))
    table = pa.table({"table": [payload], "policy_cost": [payload]})
    table = table.replace_schema_metadata(
        {
            b"acl_gym": json.dumps({"key": JOB.key, "made": {}}),
            b"pandas": payload,
            b"ARROW:schema": payload,
        }
    )
    pq.write_table(table, store.path(JOB))
    assert store.read(JOB) is None
    store.path(JOB).write_bytes(payload)
    assert store.read(JOB) is None
    assert not trap.exists()
    pickle.loads(payload)
    assert trap.exists(), "it would have been seen"
