"""Settings for all tests, including what NumPy, torch and Numba read on import."""

import os
from pathlib import Path

from hypothesis import settings

ROOT = Path(__file__).resolve().parent.parent

# Workers share the cores already, and results do not depend on the number of threads.
os.environ.setdefault("OMP_NUM_THREADS", "1")
# Figures and frames need no screen.
os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
# Numba's cache is not safe against two processes that compile one function for
# different types at the same time, so each worker keeps a cache of its own.
if worker := os.environ.get("PYTEST_XDIST_WORKER"):
    cache = Path(os.environ.get("NUMBA_CACHE_DIR", ROOT / ".numba_cache"))
    os.environ["NUMBA_CACHE_DIR"] = str(cache / worker)

# The first example of a test may wait for a kernel to compile: no deadline.
settings.register_profile("local", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True, print_blob=True)
settings.load_profile("ci" if os.environ.get("CI") else "local")
