"""A result is kept whole, with what it was made from, or not at all."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from acl_gym.experiments.runner import Task
from acl_gym.reproduction.reproduce import tasks_for
from acl_gym.reproduction.store import ParquetStore
from acl_gym.reproduction.systems import row
from acl_gym.reproduction.training import learn
from tests.reproduction.slices import shortened, silent


@pytest.fixture
def task() -> Task:
    return tasks_for([shortened(row())], [3])[0]


def test_what_is_read_is_what_was_written(tmp_path: Path, task: Task) -> None:
    store, result = ParquetStore(tmp_path), learn(*task.arguments, silent)
    assert store.read(task) is None
    store.write(task, {**result, "made": {"date": "today"}})
    found = store.read(task)
    assert found is not None
    assert found["rows"] == result["rows"]
    assert found["levels"].tobytes() == result["levels"].tobytes()
    assert (found["seconds"], found["made"]) == (result["seconds"], {"date": "today"})
    assert [path.name for path in tmp_path.iterdir()] == [f"{task.name}.parquet"]


def test_settings_and_seed_are_inside(tmp_path: Path, task: Task) -> None:
    store = ParquetStore(tmp_path)
    store.write(task, learn(*task.arguments, silent))
    metadata = pq.read_schema(store.path(task)).metadata
    about = json.loads(metadata[b"acl_gym"])
    assert about["settings"]["seed"] == 3
    assert about["settings"]["colony"]["global_decay"] == 0.1
    assert about["key"] == task.key


@pytest.mark.parametrize("damage", ["cut", "text", "empty", "foreign"])
def test_a_damaged_file_counts_as_none(tmp_path: Path, task: Task, damage: str) -> None:
    store = ParquetStore(tmp_path)
    store.write(task, learn(*task.arguments, silent))
    path = store.path(task)
    if damage == "foreign":
        table = pq.read_table(path).replace_schema_metadata(None)
        pq.write_table(table, path)
    else:
        content = path.read_bytes()
        path.write_bytes({"cut": content[:-50], "text": b"hello", "empty": b""}[damage])
    assert store.read(task) is None


def test_another_key_counts_as_none(tmp_path: Path, task: Task) -> None:
    store = ParquetStore(tmp_path)
    store.write(task, learn(*task.arguments, silent))
    other = Task(task.name, task.function, task.arguments, {**task.settings, "seed": 4})
    assert store.read(other) is None


def test_a_run_is_a_function_of_its_seed(task: Task) -> None:
    first, second = (learn(*task.arguments, silent) for _ in range(2))
    assert first["rows"] == second["rows"]
    assert np.array_equal(first["levels"], second["levels"])
