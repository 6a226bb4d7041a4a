"""A file is written whole or not at all, wherever its name leads."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import acl_gym
from acl_gym import ACL, Crisp, CSVLog
from acl_gym.utils import files
from acl_gym.utils.files import remove_stale, write_atomically
from tests.agents.reference_colony import chains

ROW = Crisp([np.arange(6.0)])
LONGEST = 255
"""Bytes of a name on the file systems in use."""


def agent() -> ACL:
    return ACL(chains(2), ROW, tau0=1e-3, max_steps=5, seed=0)


def temporary(pid: int, machine: str | None = None) -> str:
    return f".acl-{machine or files._machine()}-{pid}-0123456789ab.tmp"


# --- names ---------------------------------------------------------------------


@pytest.mark.parametrize("length", [LONGEST - 20, LONGEST])
def test_long_names(length: int, tmp_path: Path) -> None:
    log = tmp_path / ("c" * (length - 4) + ".csv")
    path = (
        agent()
        .learn(trials=1, callback=CSVLog(log))
        .save(tmp_path / "m".ljust(length - 4, "m"))
    )
    assert len(path.name) == length
    assert ACL.load(path).trials == 1
    assert log.read_text().startswith("trial,")
    assert len(os.listdir(tmp_path)) == 2


def test_permissions_are_those_that_open_gives(tmp_path: Path) -> None:
    path, other = tmp_path / "a", tmp_path / "b"
    before = os.umask(0o027)
    try:
        write_atomically(path, b"1")
        with other.open("wb"):
            pass
        assert path.stat().st_mode == other.stat().st_mode
        path.chmod(0o604)
        write_atomically(path, b"2")
        assert path.stat().st_mode & 0o777 == 0o604
    finally:
        os.umask(before)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everything")
def test_a_file_that_is_read_only_stays(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"kept")
    path.chmod(0o444)
    with pytest.raises(PermissionError):
        write_atomically(path, b"2")
    assert path.read_bytes() == b"kept"


# --- links ---------------------------------------------------------------------


def test_a_link_stays_and_the_file_behind_it_is_written(tmp_path: Path) -> None:
    store = tmp_path / "store"
    store.mkdir()
    (tmp_path / "second").symlink_to(tmp_path / "first")
    (tmp_path / "first").symlink_to(Path("store") / "file")
    for content in (b"new", b"newer"):  # the first time, the file is not there
        write_atomically(tmp_path / "second", content)
        assert (store / "file").read_bytes() == content
    assert (tmp_path / "first").is_symlink()
    assert (tmp_path / "second").is_symlink()
    assert os.listdir(store) == ["file"]


def test_a_log_through_a_link(tmp_path: Path) -> None:
    (tmp_path / "a.csv").touch()
    (tmp_path / "log.csv").symlink_to(tmp_path / "a.csv")
    agent().learn(trials=2, callback=CSVLog(tmp_path / "log.csv"))
    assert (tmp_path / "log.csv").is_symlink()
    assert len((tmp_path / "a.csv").read_text().splitlines()) == 3


def test_a_circle_of_links_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    with pytest.raises(OSError, match="symbolic links"):
        write_atomically(tmp_path / "a", b"1")
    assert sorted(os.listdir(tmp_path)) == ["a", "b"]


def test_planted_links_are_not_followed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither under the name of a temporary file, could it be guessed."""
    victim = tmp_path / "victim"
    victim.write_bytes(b"kept")
    monkeypatch.setattr(files.secrets, "token_hex", lambda n: "0123456789ab")
    (tmp_path / temporary(os.getpid())).symlink_to(victim)
    with pytest.raises(FileExistsError):
        write_atomically(tmp_path / "a", b"1")
    assert victim.read_bytes() == b"kept"


def test_devices_and_pipes_are_written_not_replaced(tmp_path: Path) -> None:
    pipe, found = tmp_path / "pipe", []
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: found.append(pipe.read_bytes()))
    reader.start()
    write_atomically(pipe, b"content")
    reader.join(timeout=10)
    assert found == [b"content"]
    assert pipe.is_fifo()
    write_atomically("/dev/null", b"content")
    assert Path("/dev/null").is_char_device()
    with pytest.raises(IsADirectoryError):
        write_atomically(tmp_path, b"content")


# --- what killed processes leave -------------------------------------------------


@pytest.fixture
def dead() -> int:
    """The number of a process that is no more."""
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    return process.pid


def test_files_of_dead_processes_go(dead: int, tmp_path: Path) -> None:
    (tmp_path / temporary(dead)).write_text("half")
    write_atomically(tmp_path / "a", b"1")
    assert os.listdir(tmp_path) == ["a"]


@pytest.mark.parametrize(
    "name",
    [
        temporary(os.getpid()),
        temporary(os.getppid()),
        temporary(2**22 + 1, machine="00000000"),
        ".acl-notes.tmp",
        ".mine.123.tmp",
        "acl-00000000-1-0123456789ab.tmp",
    ],
    # Workers that share tests have numbers of their own.
    ids=["own", "parent", "elsewhere", "notes", "hidden", "visible"],
)
def test_other_files_stay(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text("kept")
    write_atomically(tmp_path / "a", b"1")
    assert (tmp_path / name).read_text() == "kept"


def test_files_of_other_machines_go_after_a_day(tmp_path: Path) -> None:
    path = tmp_path / temporary(1, machine="00000000")
    path.touch()
    remove_stale(tmp_path)
    assert path.exists()
    long_ago = time.time() - 2 * 24 * 3600
    os.utime(path, (long_ago, long_ago))
    remove_stale(tmp_path)
    assert not path.exists()


def test_folders_and_links_of_such_names_stay(dead: int, tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.touch()
    (tmp_path / temporary(dead)).symlink_to(victim)
    (tmp_path / temporary(dead + 2**24)).mkdir()
    remove_stale(tmp_path)
    remove_stale(tmp_path / "not there")
    assert len(os.listdir(tmp_path)) == 3


KILLED = """
import sys
from acl_gym.utils.files import write_atomically
print("ready", flush=True)
while True:
    for letter in b"abcdefgh":
        write_atomically(sys.argv[1], bytes([letter]) * 300_000)
"""


def test_killed_in_the_middle_a_writer_leaves_whole_files(tmp_path: Path) -> None:
    path = tmp_path / "file"
    for wait in (0.02, 0.05, 0.11):
        process = subprocess.Popen(
            [sys.executable, "-c", KILLED, path], stdout=subprocess.PIPE
        )
        assert process.stdout is not None
        assert process.stdout.readline() == b"ready\n"
        time.sleep(wait)
        process.kill()
        process.communicate()
        if path.exists():
            assert re.fullmatch(rb"(.)\1{299999}", path.read_bytes())
    write_atomically(path, b"end")
    assert os.listdir(tmp_path) == ["file"]


def test_threads_never_tear_a_file(tmp_path: Path) -> None:
    path, torn = tmp_path / "file", []
    write_atomically(path, b"a" * 200_000)
    stop = threading.Event()

    def write(letter: bytes) -> None:
        while not stop.is_set():
            write_atomically(path, letter * 200_000)

    writers = [threading.Thread(target=write, args=(each,)) for each in (b"a", b"b")]
    for writer in writers:
        writer.start()
    for _ in range(200):
        content = path.read_bytes()
        if len(content) != 200_000 or len(set(content)) != 1:
            torn.append(content[:10])
    stop.set()
    for writer in writers:
        writer.join()
    assert not torn
    assert os.listdir(tmp_path) == ["file"]


# --- everyone writes in this way -------------------------------------------------

WRITERS = re.compile(
    r"write_text\(|write_bytes\(|to_csv\(|np\.savez?\(|savez_compressed\((?!buffer)"
    r"|savefig\((?!buffer)|write_table\((?!content, buffer)|open\([^)]*[\"'][wx]b?[\"']"
)


def test_nothing_in_the_package_writes_otherwise() -> None:
    """A line that does anything like it stands in `write_atomically` alone."""
    root = Path(acl_gym.__file__).parent
    found = [
        f"{path.relative_to(root)}: {line.strip()}"
        for path in sorted(root.rglob("*.py"))
        for line in path.read_text(encoding="utf-8").splitlines()
        if WRITERS.search(line) and path != root / "utils" / "files.py"
    ]
    assert found == []


@pytest.mark.parametrize("fail", ["os.fsync", "os.replace"])
def test_a_failure_leaves_what_was_there(
    fail: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_atomically(tmp_path / "a", b"before")

    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(fail, full)
    for name in ("a", "b"):
        with pytest.raises(OSError, match="No space left"):
            write_atomically(tmp_path / name, b"after")
    assert os.listdir(tmp_path) == ["a"]
    assert (tmp_path / "a").read_bytes() == b"before"


# --- the look before the work ------------------------------------------------------


def test_a_folder_that_cannot_be_written_is_found_before_the_work(
    tmp_path: Path,
) -> None:
    """Not even root makes files in /proc/self, whatever the permissions say."""
    folder = Path("/proc/self")
    if not folder.is_dir():
        pytest.skip("there is no /proc here")
    with pytest.raises(
        OSError, match=r"a\.npz cannot be written in .*/proc.*; do it\."
    ):
        files.checked_target(folder / "a.npz", "do it")
    assert files.checked_target(tmp_path / "a.npz") == tmp_path / "a.npz"
    assert files.checked_target(Path("/dev/null")) == Path("/dev/null")
    assert os.listdir(tmp_path) == []


def test_an_error_names_the_file_and_not_the_temporary_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device", "temporary")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="No space left") as found:
        write_atomically(tmp_path / "a", b"1")
    assert found.value.filename == str(tmp_path / "a")
