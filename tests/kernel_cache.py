"""Kernels that one worker of pytest has compiled are not compiled by the others."""

from __future__ import annotations

import itertools
import pickle
import time
from pathlib import Path

from numba.core.caching import IndexDataCacheFile

PAUSE = 0.5
"""Seconds, which most kernels take to compile; looking for files takes half a
millisecond, and there are thousands of tests."""


class KernelCache:
    """Numba's cache of one worker, beside those of the other workers.

    Numba's cache is not safe against two processes that compile one function for
    different types at the same time. So each worker writes to a folder of its own, and
    copies what is new in the others', for itself and for the processes that it starts.
    Numba replaces files as a whole: what is read there is never half written.

    Args:
        folder: where Numba keeps the kernels of this worker; those of the others lie
            beside it.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._copied: dict[Path, int] = {}
        self._looked = -PAUSE

    def copy_now_and_then(self) -> None:
        """Copy from the others unless that was tried less than `PAUSE` seconds ago."""
        if time.monotonic() - self._looked >= PAUSE:
            self.copy_from_others()
            self._looked = time.monotonic()

    def copy_from_others(self) -> None:
        """Copy the kernels that other workers have compiled since the last call."""
        for theirs in self.folder.parent.glob("*/*"):
            if theirs.parent != self.folder and self._changed(theirs):
                for index in filter(self._changed, theirs.glob("*.nbi")):
                    if not self._copy(index):
                        del self._copied[index], self._copied[theirs]

    def _changed(self, path: Path) -> bool:
        now = path.stat().st_mtime_ns
        before, self._copied[path] = self._copied.get(path), now
        return before != now

    def _copy(self, index: Path) -> bool:
        """Copy the kernels of one function; whether all were there."""
        with index.open("rb") as file:
            pickle.load(file)  # Numba's version
            stamp, overloads = pickle.load(file)
        mine = self.folder / index.parent.name
        mine.mkdir(parents=True, exist_ok=True)
        cache = IndexDataCacheFile(mine, index.stem, stamp)
        known, complete = cache._load_index(), True
        for key in overloads.keys() - known.keys():
            numbers = map(cache._data_name, itertools.count(1))
            name = next(each for each in numbers if each not in known.values())
            try:
                kernel = (index.parent / overloads[key]).read_bytes()
            except FileNotFoundError:  # Numba writes it after the index
                complete = False
                continue
            with cache._open_for_write(cache._data_path(name)) as copied:
                copied.write(kernel)
            known[key] = name
            cache._save_index(known)
        return complete
