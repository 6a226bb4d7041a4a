"""Files are complete or absent, and harmless whatever is in them."""

from __future__ import annotations

import io
import json
import math
import os
import pickle
import struct
import time
import tracemalloc
import warnings
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


def test_a_name_that_no_file_can_have_is_that_of_none() -> None:
    with pytest.raises(FileNotFoundError, match="no agent file at xxx"):
        ACL.load("x" * 300)


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


# --- files that would fill the memory --------------------------------------------


def archive(*members: tuple[str, bytes], packing: int = zipfile.ZIP_DEFLATED) -> bytes:
    """A zip file of these members, in this order, though a name comes twice."""
    buffer = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(buffer, "w", packing) as file:
        warnings.simplefilter("ignore")
        for name, content in members:
            file.writestr(name, content)
    return buffer.getvalue()


def array(shape: Any, kind: str = "<f8", content: bytes = b"") -> bytes:
    """An `.npy` file that claims to be of some shape."""
    buffer = io.BytesIO()
    description = {"descr": kind, "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(buffer, description)
    return buffer.getvalue() + content


def members_of(content: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(content)) as file:
        return {name: file.read(name) for name in file.namelist()}


def with_header(saved: bytes, text: bytes) -> bytes:
    members = members_of(saved)
    members["header.npy"] = array((len(text),), "|u1", text)
    return archive(*members.items())


def loaded_in(path: Path, content: bytes) -> tuple[Exception | None, float]:
    """What loading raises, and how many bytes it has taken at most."""
    path.write_bytes(content)
    tracemalloc.start()
    try:
        ACL.load(path)
    except (TypeError, ValueError, OSError) as error:
        return error, tracemalloc.get_traced_memory()[1]
    else:
        return None, tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


MEGABYTE = 2**20


@pytest.mark.parametrize("name", ["more", "update_total", "heuristic"])
def test_an_array_nobody_asks_for_is_not_read(
    name: str, saved: bytes, tmp_path: Path
) -> None:
    """Those of a rule, or the heuristic, are read and count: zeros pack to nothing."""
    zeros = array((2**25,), "<f8", bytes(2**28))  # 256 MiB, the most a file may hold
    content = archive(*members_of(saved).items(), (f"{name}.npy", zeros))
    assert len(content) < MEGABYTE
    del zeros
    error, most = loaded_in(tmp_path / "a.npz", content)
    assert most < 20 * MEGABYTE
    if name == "more":
        assert error is None
    else:
        assert "holds " + name in str(error)
        assert "load(path, max_bytes=...)" in str(error)


@pytest.mark.parametrize("name", ["table", "ranks", "header"])
@pytest.mark.parametrize(
    "shape", [(2**40,), (6, 2**33), (2**62, 2**62), (-1, -1), (6, -2)]
)
def test_a_shape_alone_reserves_nothing(
    name: str, shape: Any, saved: bytes, tmp_path: Path
) -> None:
    members = members_of(saved) | {f"{name}.npy": array(shape)}
    error, most = loaded_in(tmp_path / "a.npz", archive(*members.items()))
    assert isinstance(error, ValueError)
    assert most < 20 * MEGABYTE


@pytest.mark.parametrize(
    "change",
    [
        {"n_actions": 10**12},
        {"n_actions": 2.5},
        {"partition": {"type": "Discrete", "sizes": [2**15] * 2, "starts": 0}},
        {"partition": {"type": "Crisp", "centres": [[0.0, 1.0]] * 30, "periods": None}},
        {
            "partition": {
                "type": "own",
                "name": "a",
                "n_cells": 10**12,
                "cells_per_state": 1,
                "state_ndim": 1,
                "settings": None,
            }
        },
        {"partition": {"type": "Fuzzy", "centres": [[0.0]] * 32, "periods": None}},
        {"trials": 10**400},
        {"history": {"a": 1}},
        {"history": [{"seconds": "1"}]},
        {"parameters": []},
        {"unsaved": 3},
    ],
    ids=lambda change: next(iter(change)),
)
def test_a_header_that_asks_for_much_or_nonsense(
    change: dict[str, Any], saved: bytes, tmp_path: Path
) -> None:
    content = rewrite(saved, lambda header: header.update(change))
    error, most = loaded_in(tmp_path / "a.npz", content)
    assert isinstance(error, ValueError)
    assert "a.npz" in str(error)
    assert most < 20 * MEGABYTE


@pytest.mark.parametrize(
    "text",
    [
        b"[" * 10**6,
        b'{"a":' * 10**6,
        b"[" + b"[]," * 5 * 10**6 + b"[]]",
        b'{"a": ' + b"9" * 10**6 + b"}",
        b"\xff" * 1000,
        b'{"format": "acl-gym agent", "version": 1}',
    ],
    ids=["lists", "dicts", "many", "digits", "no text", "nothing else"],
)
def test_json_that_is_deep_or_long(text: bytes, saved: bytes, tmp_path: Path) -> None:
    error, most = loaded_in(tmp_path / "a.npz", with_header(saved, text))
    assert isinstance(error, ValueError)
    assert most < 60 * MEGABYTE


def test_members_that_come_twice_or_are_no_arrays(saved: bytes, tmp_path: Path) -> None:
    members = list(members_of(saved).items())
    for content in (
        archive(*members, members[1]),
        archive(*members, ("notes.txt", b"hello")),
        archive(*members, ("objects.npy", array((1,), "|O", b"x"))),
        archive(*members, *((f"m{i}.npy", array((0,))) for i in range(1_100))),
        archive(*members, packing=zipfile.ZIP_LZMA),
        archive(*members, packing=zipfile.ZIP_BZIP2),
    ):
        error, _ = loaded_in(tmp_path / "a.npz", content)
        assert isinstance(error, ValueError)


def test_the_limit_can_be_raised(saved: bytes, tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    path.write_bytes(saved)
    with pytest.raises(ValueError, match=r"a\.npz holds .*max_bytes"):
        ACL.load(path, max_bytes=100)
    with pytest.raises(ValueError, match=r"the file holds an agent of .*max_bytes"):
        ACL.load(io.BytesIO(saved), max_bytes=100)
    assert ACL.load(path, max_bytes=10**9).trials == 2
    for wrong in (math.nan, 1.5, None, True):
        with pytest.raises(TypeError, match="max_bytes must be an integer"):
            ACL.load(path, max_bytes=wrong)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="max_bytes must be at least 1, got -1"):
        ACL.load(path, max_bytes=-1)


# --- hostile files ---------------------------------------------------------------

HOSTILE_FILES = int(os.environ.get("ACL_GYM_HOSTILE_FILES", "60"))
"""How many files the fuzz test makes; a thousand take a minute or two."""


def json_noise(rng: np.random.Generator, depth: int = 0) -> Any:
    """A value of JSON, often one that is nearly right."""
    words = ["type", "function", "Crisp", "own", "Sum", "__array__", "__tuple__", ""]
    numbers = [0, -1, 1, 2.5, 1e308, 10**30, math.nan, -math.inf, True, None, "1"]
    kind = rng.integers(6 if depth < 4 else 3)
    if kind < 2:
        return numbers[rng.integers(len(numbers))]
    if kind == 2:
        return words[rng.integers(len(words))]
    items = [json_noise(rng, depth + 1) for _ in range(rng.integers(4))]
    if kind == 3:
        return items
    return {words[rng.integers(len(words))]: each for each in items}


def changed_somewhere(value: Any, rng: np.random.Generator) -> Any:
    """The value with one part, at any depth, replaced, lost or doubled."""
    if not isinstance(value, (dict, list)) or not value or rng.random() < 0.15:
        return json_noise(rng)
    keys = list(value) if isinstance(value, dict) else range(len(value))
    key = keys[rng.integers(len(keys))]
    copy: Any = dict(value) if isinstance(value, dict) else list(value)
    if rng.random() < 0.1:
        del copy[key]
    elif rng.random() < 0.1 and isinstance(copy, list):
        copy.extend(copy * 50)
    else:
        copy[key] = changed_somewhere(value[key], rng)
    return copy


def hostile(saved: bytes, rng: np.random.Generator) -> bytes:
    """A file that a stranger may have made."""
    kind = rng.integers(5)
    if kind == 0:  # bytes, changed, cut or doubled
        content = bytearray(saved)
        for _ in range(rng.integers(1, 6)):
            start = rng.integers(len(content))
            noise = rng.integers(
                256, size=rng.integers(1, 20), dtype=np.uint8
            ).tobytes()
            content[start : start + rng.integers(20)] = noise
        return bytes(
            content[: rng.integers(len(content)) if rng.random() < 0.2 else None]
        )
    members = members_of(saved)
    if kind <= 2:  # a header with checksums that fit
        start = 128
        header = json.loads(members["header.npy"][start:])
        for _ in range(rng.integers(1, 4)):
            header = changed_somewhere(header, rng)
        return with_header(saved, json.dumps(header).encode())
    name = ["table.npy", "ranks.npy", "header.npy", "heuristic.npy", "update_a.npy"]
    shape = tuple(
        int(n) for n in rng.choice([0, 1, 2, 6, 12, 2**20, 2**40], rng.integers(4))
    )
    dtypes = [
        "<f8",
        ">f8",
        "<f4",
        "|u1",
        "<i4",
        "|b1",
        "<c16",
        "|O",
        "<U3",
        "|V8",
        "<m8",
    ]
    dtype = str(rng.choice(dtypes))
    size = rng.choice([0, 6, 12, 96, 1000])
    content = rng.integers(256, size=size, dtype=np.uint8).tobytes()
    if kind == 3:
        content = array(shape, dtype, content)
    members[str(rng.choice(name))] = content
    return archive(*members.items(), packing=int(rng.choice([0, 8, 12, 14])))


def test_hostile_files_are_refused_or_harmless(saved: bytes, tmp_path: Path) -> None:
    """No crash, no hang, nothing but ValueError, OSError and TypeError."""
    rng = np.random.default_rng(0)
    outcomes = dict.fromkeys(["refused", "loaded"], 0)
    for number in range(HOSTILE_FILES):
        content = hostile(saved, rng)
        path = tmp_path / "hostile.npz"
        path.write_bytes(content)
        began = time.monotonic()
        try:
            agent = ACL.load(path, chains(2))
            agent.predict(agent.partition.cell_states()[:5])
            agent.learn(total_timesteps=5)
        except (ValueError, TypeError, OSError):
            outcomes["refused"] += 1
        except Exception as error:
            pytest.fail(f"file {number}: {error!r:.200}")
        else:
            outcomes["loaded"] += 1
        assert time.monotonic() - began < 20, f"file {number}"
    assert outcomes["refused"] > HOSTILE_FILES / 4


@pytest.mark.parametrize("name", ["header", "more"])
def test_a_long_description_of_an_array_is_not_read(
    name: str, saved: bytes, tmp_path: Path
) -> None:
    """A few kilobytes that unpack to 64 MB of spaces."""
    length = 2**26
    bomb = b"\x93NUMPY\x02\x00" + struct.pack("<I", length) + b" " * length
    members = {**members_of(saved), f"{name}.npy": bomb}
    path = tmp_path / "a.npz"
    path.write_bytes(archive(*members.items()))
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match=r"is not an agent .* damaged"):
            ACL.load(path)
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert most < length / 16


def test_a_missing_file_is_named_as_it_was_typed(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"a\.npz, and none at .*a; give"):
        ACL.load(tmp_path / "a")
