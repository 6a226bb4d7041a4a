"""Names of files, and the one way in which this package writes them."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import platform
import re
import secrets
import stat
import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import BinaryIO

from acl_gym.utils import validation

_TEMPORARY = re.compile(r"\.acl-([0-9a-f]{8})-(\d+)-[0-9a-f]{12}\.tmp")
"""Machine, process and a random number: short, whatever the file is called."""

_OLD = 24 * 3600.0
"""Seconds after which a temporary file of another machine is taken for left behind."""


def with_suffix(path: str | os.PathLike[str]) -> Path:
    """Add `.npz` to a path that lacks it."""
    path = validation.file_path("path", path)
    return path if path.suffix == ".npz" else path.with_name(path.name + ".npz")


def checked_target(
    path: Path, remedy: str = "give the name of a file in another folder"
) -> Path:
    """Return the path of a file to be written if `write_atomically` can write it now.

    That is tried: permissions alone do not tell of file systems that cannot be written.

    Args:
        path: the file.
        remedy: what to do where the folder cannot be written, an imperative.

    Raises:
        FileNotFoundError: the folder of the file does not exist.
        IsADirectoryError: the path is a folder.
        OSError: the folder, or the file that is there, cannot be written.
    """
    try:
        has_folder, is_folder = path.parent.is_dir(), path.is_dir()
    except OSError as error:  # such as a name that is too long
        raise type(error)(
            f"{validation.shown(str(path))} cannot be the name of a file "
            f"({error.strerror}); give another name."
        ) from error
    if not has_folder:
        raise FileNotFoundError(
            f"there is no folder {path.parent} to save {path.name} in; make it first."
        )
    if is_folder:
        raise IsADirectoryError(f"{path} is a folder; give the name of a file.")
    try:
        target, before = _resolved(path)
        if before is None or stat.S_ISREG(before.st_mode):
            with _temporary_beside(target) as file:
                file.close()
    except OSError as error:
        raise type(error)(
            f"{path.name} cannot be written in the folder {path.parent.absolute()} "
            f"({error.strerror}); {remedy}."
        ) from error
    return path


def write_atomically(path: str | os.PathLike[str], content: bytes) -> None:
    """Write a file so that it appears complete or not at all.

    The content goes to a file with a name of its own beside the target, which then takes
    the target's place: readers, and writers of the same path in other threads or
    processes, see whole files only. As with `open`, a symbolic link
    stays and the file that it points to is written, a new file gets the permissions that
    the umask leaves, an existing one keeps its own, and devices and pipes are written
    directly. Files left behind by processes that were killed while they wrote into the
    same folder are removed.

    Raises:
        OSError: it cannot be written, with `path` as its `filename`; what was there
            before is still there.
    """
    try:
        _write(path, content)
        _Written.any = True
    except OSError as error:
        if error.errno is None:
            raise
        # Not the name of the temporary file, which says nothing to the user.
        raise OSError(error.errno, error.strerror, os.fspath(path)) from error


def has_written() -> bool:
    """Whether `write_atomically` has written anything in this process."""
    return _Written.any


class _Written:
    any = False


def _write(path: str | os.PathLike[str], content: bytes) -> None:
    target, before = _resolved(path)
    if before is not None and not stat.S_ISREG(before.st_mode):
        with target.open("wb") as file:
            file.write(content)
        return
    remove_stale(target.parent)
    with _temporary_beside(target) as file:
        if before is not None:
            with contextlib.suppress(PermissionError):
                os.chmod(file.name, stat.S_IMODE(before.st_mode))
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
        file.close()  # Windows replaces no open file
        os.replace(file.name, target)


def _resolved(path: str | os.PathLike[str]) -> tuple[Path, os.stat_result | None]:
    """Where a path leads, and what is there; None if nothing is.

    Raises:
        OSError: the path leads nowhere, or to a file that cannot be written.
    """
    target = Path(os.path.realpath(path))
    if target.is_symlink():  # a circle of links
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), str(path))
    try:
        before = target.stat()
    except FileNotFoundError:
        return target, None
    if not os.access(target, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(target))
    return target, before


@contextlib.contextmanager
def _temporary_beside(target: Path) -> Iterator[BinaryIO]:
    """A new file in the same folder, which is removed unless it was renamed."""
    temporary = target.with_name(
        f".acl-{_machine()}-{os.getpid()}-{secrets.token_hex(6)}.tmp"
    )
    try:
        # Unlike tempfile.mkstemp, "x" gives the permissions that open() gives; like it,
        # it follows no link and takes no file that is there already.
        with temporary.open("xb") as file:
            yield file
    finally:
        temporary.unlink(missing_ok=True)


def remove_stale(directory: Path) -> None:
    """Remove temporary files of `write_atomically` whose process is gone.

    Files of other machines, for whose processes one cannot ask, go after a day.
    """
    with contextlib.suppress(OSError), os.scandir(directory) as entries:
        for entry in entries:
            match = _TEMPORARY.fullmatch(entry.name)
            if match is None:
                continue
            with contextlib.suppress(OSError):  # another process may remove it first
                if entry.is_file(follow_symlinks=False) and _is_left(entry, match):
                    os.unlink(entry.path)


def _is_left(entry: os.DirEntry[str], match: re.Match[str]) -> bool:
    # On Windows a signal of 0 is no question but Ctrl-C.
    if match[1] == _machine() and os.name == "posix":
        try:
            os.kill(int(match[2]), 0)
        except (ProcessLookupError, OverflowError):
            return True
        except PermissionError:
            return False
    age = time.time() - entry.stat(follow_symlinks=False).st_mtime
    return age > _OLD


@cache
def _machine() -> str:
    """Eight digits for the machine, or container, within which process numbers count."""
    try:
        namespace = os.readlink("/proc/self/ns/pid")
    except OSError:
        namespace = ""
    name = f"{platform.node()} {namespace}"
    return hashlib.blake2b(name.encode(), digest_size=4).hexdigest()
