"""The files that `acl-gym train` writes: their names, and whether they can be written."""

from __future__ import annotations

from pathlib import Path

from acl_gym.cli.errors import BadArgumentError, bad_arguments


def checked_file(path: Path) -> Path:
    """A file that can be written when learning is over, checked before it begins."""
    from acl_gym.utils import files

    folder = path.name in ("", "..")
    with bad_arguments():
        target = (
            path
            if folder
            else files.checked_target(
                files.with_suffix(path), "name a file elsewhere with --out FILE.npz"
            )
        )
    if folder or target.is_dir():
        raise BadArgumentError(f"{target} is a folder; give the name of a file.")
    return target


def free_name(env_id: str) -> Path:
    """A file name that is not taken in this folder: Pendulum-v0.npz, -2, -3, ..."""
    stem = env_id.rpartition("/")[2]
    path, number = Path(f"{stem}.npz"), 1
    while path.exists() or path.with_name(f"{path.stem}-best.npz").exists():
        number += 1
        path = Path(f"{stem}-{number}.npz")
    return path


def name_after(resumed: Path, env_id: str) -> Path:
    """The file that was resumed; but never a best policy, which others would replace."""
    return free_name(env_id) if resumed.stem.endswith("-best") else resumed
