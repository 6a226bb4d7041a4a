"""The throughput benchmark runs and prints what was promised; no time is judged."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).resolve().parents[1] / "benchmarks" / "throughput.py"


def test_quick_run_prints_json() -> None:
    done = subprocess.run(
        [sys.executable, str(SCRIPT), "--quick", "--json"],
        capture_output=True,
        text=True,
        check=True,
    )
    cases = json.loads(done.stdout)["cases"]
    names = [case["name"] for case in cases]
    assert len(set(names)) == len(names)
    for case in cases:
        assert case["n_ants"] >= 1
        assert case["steps_per_second"] > 0
        assert case["slowest"] <= case["steps_per_second"] <= case["fastest"]
        assert case["ratio_to_reference"] > 0
        assert case["reference"] in names
    assert any("DQN" in name for name in names)
    assert any("whole run" in name for name in names)
