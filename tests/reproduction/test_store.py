"""A result is kept whole, with what it was made from, or not at all."""

from __future__ import annotations

import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from acl_gym.experiments.runner import Task, run_tasks
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
    if damage != "foreign":
        assert not store.has(task)


def test_a_damaged_run_is_made_again_with_a_word(
    tmp_path: Path, task: Task, caplog: pytest.LogCaptureFixture
) -> None:
    store = ParquetStore(tmp_path)

    def run() -> dict[str, Any]:
        caplog.clear()
        (found,) = run_tasks([task], tmp_path, workers=1, store=store)
        return found

    first = run()
    assert not caplog.messages
    path = store.path(task)
    path.write_bytes(path.read_bytes()[:-50])
    again = run()
    assert ["1 of 1 results" in text for text in caplog.messages] == [True]
    assert "are made again" in caplog.text
    assert again["rows"] == first["rows"]
    assert store.has(task)
    run()
    assert not caplog.messages


def test_nothing_in_a_file_is_code(tmp_path: Path, task: Task) -> None:
    """A stranger's Parquet file with a pickle in every place that could hold one."""
    trap, store = tmp_path / "trap", ParquetStore(tmp_path)
    payload = pickle.dumps(_Trap(str(trap)))
    about = {"key": task.key, "settings": task.settings, "result": {}}
    table = pa.table({"levels": [payload], "policy_cost": [payload]})
    table = table.replace_schema_metadata(
        {b"acl_gym": json.dumps(about), b"pandas": payload, b"ARROW:schema": payload}
    )
    pq.write_table(table, store.path(task))
    assert store.read(task) is None
    store.path(task).write_bytes(payload)
    assert store.read(task) is None
    assert not trap.exists()
    pickle.loads(payload)
    assert trap.exists(), "it would have told"


class _Trap:
    def __init__(self, path: str) -> None:
        self.path = path

    def __reduce__(self) -> Any:
        return (Path.touch, (Path(self.path),))


def test_another_key_counts_as_none(tmp_path: Path, task: Task) -> None:
    store = ParquetStore(tmp_path)
    store.write(task, learn(*task.arguments, silent))
    other = Task(task.name, task.function, task.arguments, {**task.settings, "seed": 4})
    assert store.read(other) is None


def test_a_run_is_a_function_of_its_seed(task: Task) -> None:
    first, second = (learn(*task.arguments, silent) for _ in range(2))
    assert first["rows"] == second["rows"]
    assert np.array_equal(first["levels"], second["levels"])
