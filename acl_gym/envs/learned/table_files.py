"""Files of measurements: CSV and Parquet."""

from __future__ import annotations

import codecs
from pathlib import Path
from typing import Any

from acl_gym.envs.learned.reading import arrays_of_frames
from acl_gym.utils import validation
from acl_gym.utils.text import first_line


def arrays_of_files(
    path: Any,
    kind: str,
    *,
    state: Any = None,
    input: Any = None,
    next_state: Any = None,
    **columns: Any,
) -> dict[str, Any]:
    """Read one or several tables; see `Transitions.from_csv`.

    Args:
        path: a path, or a list of them.
        kind: "csv" or "parquet".
        state: see there.
        input: see there.
        next_state: see there.
        **columns: see there.

    Returns:
        Arguments of `Transitions`.
    """
    import pandas as pd

    read = _read_csv if kind == "csv" else pd.read_parquet
    several = isinstance(path, list | tuple)
    paths = [
        validation.file_path("path", each) for each in (path if several else [path])
    ]
    if not paths:
        raise ValueError("path must be a file or several, got an empty list.")
    frames = []
    for each in paths:
        if not each.is_file():
            raise FileNotFoundError(
                f"there is no file {each}; check the name and the folder."
            )
        try:
            frames.append(read(each))
        except Exception as error:  # whatever pandas raises for a file of another kind
            raise ValueError(
                f"{each} must be a {kind} file with names of columns in its first row, "
                f"but cannot be read: {first_line(error)}."
            ) from error
    return arrays_of_frames(
        frames,
        names=[str(each) for each in paths],
        state=state,
        input=input,
        next_state=next_state,
        **columns,
    )


def _read_csv(path: Path) -> Any:
    """A frame from a CSV file, whatever separates its columns."""
    import pandas as pd

    encoding = _encoding(path)
    with path.open(encoding=encoding, errors="replace") as file:
        head, first = file.readline(), file.readline()
    separator = max((",", ";", "\t"), key=head.count)
    comma = separator != "," and "," in first and "." not in first
    frame = pd.read_csv(
        path,
        sep=separator,
        decimal="," if comma else ".",
        skipinitialspace=True,
        encoding=encoding,
    )
    return frame.rename(columns=lambda name: str(name).strip())


def _encoding(path: Path) -> str:
    """UTF-8, or what older programs on Windows write where a file is not that."""
    content = path.read_bytes()
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    try:
        content.decode("utf-8")
    except UnicodeDecodeError:
        return "latin-1"  # where names are misread, the list of columns shows it
    return "utf-8"
