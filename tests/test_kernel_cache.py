"""Workers of pytest load each other's kernels, each with the types it was made for."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import Any

import numba
import pytest

from tests.kernel_cache import KernelCache


@pytest.fixture
def compiled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The kernel of a worker, as it is after a new start."""
    (tmp_path / "halved_by_a_kernel.py").write_text("def half(x):\n    return x // 2\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "halved_by_a_kernel", raising=False)
    module = importlib.import_module("halved_by_a_kernel")

    def kernel_of(worker: str) -> Any:
        monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / worker))
        return numba.njit(cache=True)(module.half)

    return kernel_of


def times_compiled(kernel: Any) -> int:
    return sum(kernel.stats.cache_misses.values())


def test_what_another_worker_has_compiled_is_loaded(
    compiled: Any, tmp_path: Path
) -> None:
    """Numba gives the first types of each worker the same file name."""
    assert compiled("gw0")(5) == 2
    assert compiled("gw1")(5.0) == 2.0
    cache = KernelCache(tmp_path / "gw1")
    cache.copy_from_others()
    again = compiled("gw1")
    for x, half in ((5, int), (5.0, float)):
        assert type(again(x)) is half
    assert times_compiled(again) == 0
    # What is new since the last time comes as well.
    assert compiled("gw0")(True) == 0
    fresh = compiled("gw1")
    cache.copy_from_others()
    assert fresh(True) == 0
    assert times_compiled(fresh) == 0


def test_a_kernel_that_is_still_being_written_comes_later(
    compiled: Any, tmp_path: Path
) -> None:
    assert compiled("gw0")(5) == 2
    (file,) = (tmp_path / "gw0").rglob("*.nbc")
    content = file.read_bytes()
    file.unlink()
    cache = KernelCache(tmp_path / "gw1")
    cache.copy_now_and_then()
    assert not list((tmp_path / "gw1").rglob("*.nbc"))
    file.write_bytes(content)
    cache.copy_from_others()
    loaded = compiled("gw1")
    assert loaded(5) == 2
    assert times_compiled(loaded) == 0
