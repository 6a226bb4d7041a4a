"""Files are complete or absent, and harmless whatever is in them."""

from __future__ import annotations

import io
import json
import os
import pickle
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from acl_gym import ACL, Crisp, QLearning
from acl_gym.utils import archives
from tests.agents.reference_colony import chains

ROW = Crisp([np.arange(6.0)])
PATH = settings(
    suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=100
)


def agent_file(path: Path, kind: type = ACL) -> bytes:
    """A file of an agent that has learned for two trials."""
    parameters = {"tau0": 1e-3} if kind is ACL else {}
    agent = kind(chains(2), ROW, max_steps=5, seed=0, **parameters).learn(trials=2)
    return agent.save(path).read_bytes()


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The content of a file."""
    return agent_file(tmp_path_factory.mktemp("saved") / "a")


def refuse_or_load(path: Path, content: bytes) -> bool:
    """Whether the content loads; if not, that is a ValueError that names the file."""
    path.write_bytes(content)
    try:
        agent = ACL.load(path)
    except ValueError as error:
        message = str(error)
    else:
        assert agent.predict([[0.0], [4.0]])[0].shape == (2,)
        return True
    assert path.name in message
    return False


def opened(path: Any) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    archive = archives.Archive(path)
    return archive.header, dict(archive.arrays)


def unpacked(content: bytes) -> dict[str, np.ndarray]:
    with np.load(io.BytesIO(content)) as file:
        return {name: file[name] for name in file.files}


def packed(**arrays: Any) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def rewrite(content: bytes, change: Callable[[dict[str, Any]], None]) -> bytes:
    """The content of an agent's file with another header."""
    arrays = unpacked(content)
    header = json.loads(arrays.pop("header").tobytes())
    change(header)
    text = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
    return packed(header=text, **arrays)


# --- round trip ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("given_name", "written"),
    [("a", "a.npz"), ("a.npz", "a.npz"), ("a.b", "a.b.npz"), (".a", ".a.npz")],
)
def test_what_is_saved_is_loaded(given_name: str, written: str, tmp_path: Path) -> None:
    header = {"text": "τ0 <= ρ / J", "list": [1, 2.5, None, True], "nan": float("inf")}
    arrays = {"x": np.arange(6.0).reshape(2, 3), "y": np.zeros(0, dtype=np.int32)}
    for name in (tmp_path / given_name, str(tmp_path / given_name)):
        assert archives.save(name, header, arrays) == tmp_path / written
        loaded, values = opened(name)
        assert {key: loaded[key] for key in header} == header
        assert values.keys() == arrays.keys()
        for key, value in arrays.items():
            np.testing.assert_array_equal(values[key], value)
            assert values[key].dtype == value.dtype
    assert os.listdir(tmp_path) == [written]


@given(values=st.lists(st.floats()))
@settings(PATH, max_examples=25)
def test_numbers_survive_to_the_last_bit(values: list[float], tmp_path: Path) -> None:
    archives.save(tmp_path / "a", {"values": values}, {})
    loaded = opened(tmp_path / "a")[0]["values"]
    assert [repr(value) for value in loaded] == [repr(value) for value in values]


def test_saving_again_replaces(tmp_path: Path) -> None:
    archives.save(tmp_path / "a", {"x": 1}, {"y": np.ones(1000)})
    archives.save(tmp_path / "a", {"x": 2}, {})
    header, arrays = opened(tmp_path / "a")
    assert (header["x"], arrays) == (2, {})


def test_the_name_given_to_save_is_good_for_load(tmp_path: Path) -> None:
    """Also where something else has that name without the suffix."""
    (tmp_path / "a").write_text("my notes on a")
    archives.save(tmp_path / "a", {"x": 1}, {})
    assert opened(tmp_path / "a")[0]["x"] == 1
    (tmp_path / "b").mkdir()
    archives.save(tmp_path / "b", {"x": 2}, {})
    assert opened(tmp_path / "b")[0]["x"] == 2


# --- saving fails --------------------------------------------------------------


def test_a_missing_directory(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        archives.save(tmp_path / "missing" / "a", {}, {})
    assert os.listdir(tmp_path) == []


def test_a_file_where_the_directory_should_be(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("kept")
    with pytest.raises(OSError, match="file"):
        archives.save(tmp_path / "file" / "a", {}, {})
    assert (tmp_path / "file").read_text() == "kept"


@pytest.mark.parametrize("broken", ["os.fsync", "os.replace"])
@pytest.mark.parametrize("kind", [ACL, QLearning])
def test_a_disk_error_leaves_the_old_file_and_no_other(
    broken: str, kind: type, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = agent_file(tmp_path / "a", kind)
    agent = kind(None, ROW, n_actions=2)

    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(broken, full)
    with pytest.raises(OSError, match="No space left"):
        agent.save(tmp_path / "a")
    with pytest.raises(OSError, match="No space left"):
        agent.save(tmp_path / "new")
    assert os.listdir(tmp_path) == ["a.npz"]
    assert (tmp_path / "a.npz").read_bytes() == before


def test_what_json_does_not_know_is_refused_before_anything_is_written(
    tmp_path: Path,
) -> None:
    with pytest.raises((TypeError, ValueError)):
        archives.save(tmp_path / "a", {"x": object()}, {})
    assert os.listdir(tmp_path) == []


# --- loading what is not ours --------------------------------------------------


def test_a_missing_file(tmp_path: Path) -> None:
    for name in ("a", "a.npz"):
        with pytest.raises(FileNotFoundError, match=r"a\.npz"):
            ACL.load(tmp_path / name)
    with pytest.raises(FileNotFoundError):
        ACL.load(tmp_path)


def test_every_cut_is_refused(saved: bytes, tmp_path: Path) -> None:
    for length in [*range(0, len(saved), 7), *range(len(saved) - 30, len(saved))]:
        assert not refuse_or_load(tmp_path / "cut.npz", saved[:length])


def test_every_changed_byte_is_refused_or_harmless(
    saved: bytes, tmp_path: Path
) -> None:
    """Most changes meet a checksum; some are in fields of the zip that nobody reads."""
    refused = 0
    for position in range(len(saved)):
        changed = bytearray(saved)
        changed[position] ^= 0xFF if position % 2 else 1 << (position % 8)
        refused += not refuse_or_load(tmp_path / "b.npz", bytes(changed))
    assert refused > len(saved) / 2


@given(st.lists(st.tuples(st.integers(0, 10**6), st.binary(max_size=8)), min_size=1))
@PATH
def test_bytes_written_over_a_file(
    saved: bytes, tmp_path: Path, changes: list[tuple[int, bytes]]
) -> None:
    content = bytearray(saved)
    for position, patch in changes:
        start = position % len(content)
        content[start : start + len(patch)] = patch
    refuse_or_load(tmp_path / "a.npz", bytes(content))


@given(
    st.binary(max_size=300), st.sampled_from([b"", b"PK\x03\x04", b"\x93NUMPY\x01\0"])
)
@PATH
def test_random_bytes_are_refused(tmp_path: Path, content: bytes, magic: bytes) -> None:
    assert not refuse_or_load(tmp_path / "a.npz", magic + content)


class Malice:
    """What an untrusted pickle may do."""

    def __init__(self, target: Path) -> None:
        self.target = str(target)

    def __reduce__(self) -> tuple[Any, ...]:
        return (os.mkdir, (self.target,))


@pytest.mark.parametrize("name", ["header", "table", "ranks", "more", None])
def test_pickles_are_never_run(name: str | None, saved: bytes, tmp_path: Path) -> None:
    trap, path = tmp_path / "trapped", tmp_path / "a.npz"
    content = pickle.dumps(Malice(trap))
    if name is not None:
        malice = np.array([Malice(trap)], dtype=object)
        content = packed(**{**unpacked(saved), name: malice})
    assert not refuse_or_load(path, content)
    assert not trap.exists()


def foreign_files() -> dict[str, bytes]:
    """Valid files that are not agents."""
    files = {"empty": b"", "text": b"no agent", "null": b"\0" * 100}
    buffer = io.BytesIO()
    np.save(buffer, np.ones(3))
    files["npy"] = buffer.getvalue()
    archives: dict[str, dict[str, Any]] = {
        "other arrays": {"x": np.ones(3)},
        "no arrays": {},
        "header of numbers": {"header": np.ones(3)},
        "header without axis": {"header": np.uint8(3)},
    }
    for text in (
        "",
        "{",
        "[]",
        "3",
        "null",
        '"agent"',
        "{}",
        '{"format": 1}',
        "[" * 10**5,
    ):
        array = np.frombuffer(text.encode(), dtype=np.uint8)
        archives[f"header {text[:20]}"] = {"header": array}
    files |= {name: packed(**arrays) for name, arrays in archives.items()}
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as file:
        file.writestr("notes.txt", "a zip")
    files["zip"] = buffer.getvalue()
    return files


FOREIGN = foreign_files()


@pytest.mark.parametrize("name", FOREIGN)
def test_foreign_files_are_refused(name: str, tmp_path: Path) -> None:
    assert not refuse_or_load(tmp_path / "a.npz", FOREIGN[name])


@pytest.mark.parametrize(
    "version", [2, 0, "1", None, 1.5, [1], pytest.param(..., id="none")]
)
def test_other_versions_are_refused_by_number(
    version: Any, saved: bytes, tmp_path: Path
) -> None:
    content = rewrite(saved, lambda old: put(old, "version", version))
    (tmp_path / "a.npz").write_bytes(content)
    with pytest.raises(ValueError, match=r"a\.npz must be of format .* version 1, got"):
        ACL.load(tmp_path / "a")


NONSENSE = [None, True, -1, 2.5, 10**400, float("nan"), "text", [], [1], {}, {"a": 1}]
PLACES = [
    "agent",
    "parameters",
    "partition",
    "n_actions",
    "generators",
    "num_timesteps",
    "trials",
    "seconds",
    "history",
    "parameters/tau0",
    "parameters/alpha",
    "parameters/selection",
    "parameters/max_steps",
    "parameters/seed",
    "parameters/unknown",
    "partition/type",
    "partition/centres",
    "partition/periods",
    "generators/0",
    "generators/0/bit_generator",
    "generators/0/state",
    "generators/0/state/state",
    "generators/1/has_uint32",
    "generators/1/uinteger",
]


def put(header: dict[str, Any], place: str, value: Any) -> None:
    """Set one entry of the header; `...` takes it out."""
    *way, last = [int(key) if key.isdigit() else key for key in place.split("/")]
    inner: Any = header
    for key in way:
        inner = inner[key]
    if value is not ...:
        inner[last] = value
    elif last in inner or isinstance(inner, list):
        del inner[last]


@pytest.mark.parametrize("place", PLACES)
def test_nonsense_in_the_header_is_a_value_error_if_anything(
    place: str, saved: bytes, tmp_path: Path
) -> None:
    failures = []
    for value in [*NONSENSE, ...]:
        content = rewrite(saved, lambda old, v=value: put(old, place, v))
        (tmp_path / "b.npz").write_bytes(content)
        try:
            ACL.load(tmp_path / "b")
        except ValueError:
            pass
        except Exception as error:
            failures.append(f"{value!r:.20}: {error!r:.90}")
    assert not failures, "\n".join(failures)


@pytest.mark.parametrize("place", ["num_timesteps", "trials", "seconds", "history"])
@pytest.mark.parametrize("value", [None, "text", {}, -1], ids=repr)
def test_a_record_of_the_wrong_kind_is_refused(
    place: str, value: Any, saved: bytes, tmp_path: Path
) -> None:
    """Else it would be found out in the next `learn`, after a trial."""
    content = rewrite(saved, lambda old: put(old, place, value))
    assert not refuse_or_load(tmp_path / "b.npz", content)


@pytest.mark.parametrize("name", ["table", "ranks"])
@pytest.mark.parametrize("shape", [(1, 2), (6, 1), (), (12,), (6, 3), (0,)])
def test_arrays_of_another_shape_are_refused(
    name: str, shape: tuple[int, ...], saved: bytes, tmp_path: Path
) -> None:
    arrays = unpacked(saved)
    other = np.ones(shape, dtype=arrays.pop(name).dtype)
    for content in (packed(**arrays, **{name: other}), packed(**arrays)):
        assert not refuse_or_load(tmp_path / "a.npz", content)
