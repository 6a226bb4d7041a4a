"""The memory and the time of exported policies: C headers and NumPy files, and `predict`.

Each policy is compiled with gcc -O2 into a program that times its own calls on random
states. Every value is the median of several repetitions, in processor time. Only ratios can be compared
between machines; on a microcontroller a call takes longer, by the ratio of the clocks and
more where it has no floating-point unit.
"""

from __future__ import annotations

import argparse
import json
import re
import statistics
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from acl_gym import Crisp, Fuzzy
from acl_gym.export.numpy_file import NUMPY_CODE
from acl_gym.policies import TablePolicy

MAIN = """
#define _POSIX_C_SOURCE 199309L
#include "policy.h"
#include <stdio.h>
#include <time.h>

#define COUNT 1024
#define ROUNDS 200

int main(void)
{
    static TYPE x[COUNT][policy_OBSERVATIONS];
    struct timespec begin, end;
    long sum = 0;
    if (fread(x, sizeof x, 1, stdin) != 1) {
        return 1;
    }
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &begin);
    for (int round = 0; round < ROUNDS; round++) {
        for (int i = 0; i < COUNT; i++) {
            sum += policy_action(x[i]);
        }
    }
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &end);
    printf("%.9f %ld\\n", ((double)(end.tv_sec - begin.tv_sec)
        + 1e-9 * (double)(end.tv_nsec - begin.tv_nsec)) / COUNT / ROUNDS, sum);
    return 0;
}
"""
GRIDS = {2: (40, 41), 4: (15, 9, 15, 9)}


def policies() -> Iterator[tuple[str, TablePolicy]]:
    """Random policies over two and four variables, the first circular."""
    rng = np.random.default_rng(0)
    for sizes in GRIDS.values():
        centres = [np.linspace(-1, 1, size) for size in sizes]
        periods = [2.1, *[None] * (len(sizes) - 1)]
        for kind in (Fuzzy, Crisp):
            grid = kind(centres, periods)
            table = rng.random((grid.n_cells, 3))
            name = f"{kind.__name__.lower()}, {' x '.join(map(str, sizes))}"
            yield name, TablePolicy(grid, table)


def seconds_in_c(
    policy: TablePolicy, precision: str, states: Any, folder: Path, repetitions: int
) -> tuple[float, int, int, int]:
    """Seconds a call; bytes of the tables, of the code, and of the stack as stated."""
    header = policy.to_c(folder / "policy.h", precision=precision)
    (folder / "main.c").write_text(MAIN.replace("TYPE", precision))
    command = ["gcc", "-std=c99", "-O2", "main.c", "-o", "main"]
    subprocess.run(command, cwd=folder, check=True)
    # The code alone: one function that calls the policy.
    (folder / "code.c").write_text(
        '#include "policy.h"\n'
        f"int f(const {precision} *x);\n"
        f"int f(const {precision} *x) {{ return policy_action(x); }}\n"
    )
    subprocess.run(["gcc", "-std=c99", "-Os", "-c", "code.c"], cwd=folder, check=True)
    sizes = subprocess.run(
        ["size", "-A", "code.o"], cwd=folder, check=True, capture_output=True, text=True
    ).stdout
    code = sum(int(n) for n in re.findall(r"^\.text\S*\s+(\d+)", sizes, re.MULTILINE))
    rows = np.asarray(states, np.float32 if precision == "float" else np.float64)
    measured = []
    for _ in range(repetitions):
        done = subprocess.run(
            ["./main"],
            cwd=folder,
            check=True,
            input=rows.tobytes(),
            capture_output=True,
        )
        measured.append(float(done.stdout.split()[0]))
    text = header.read_text()
    tables = re.search(r"Memory: ([\d,]+) bytes", text)
    stack = re.search(r"(\d+) bytes of local", text)
    assert tables is not None  # noqa: S101
    assert stack is not None  # noqa: S101
    return (
        statistics.median(measured),
        int(tables[1].replace(",", "")),
        code,
        int(stack[1]),
    )


def seconds_of(act: Any, states: Any, repetitions: int) -> float:
    """Seconds of a call with one state."""
    measured = []
    act(states[0])
    for _ in range(repetitions):
        start = time.process_time()
        for state in states:
            act(state)
        measured.append((time.process_time() - start) / len(states))
    return statistics.median(measured)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repetitions", type=int, default=7)
    parser.add_argument("--json", action="store_true", help="print JSON")
    arguments = parser.parse_args()
    rows = []
    for name, policy in policies():
        dimensions = policy.partition.centres  # type: ignore[attr-defined]
        states = np.random.default_rng(1).uniform(-1.2, 1.2, (1024, len(dimensions)))
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            base = seconds_of(policy.predict, states, arguments.repetitions)
            space: dict[str, Any] = {}
            file = policy.to_numpy(folder / "policy.npz")
            exec(NUMPY_CODE.replace("policy.npz", str(file)), space)
            lines = seconds_of(space["act"], states, arguments.repetitions)
            row: dict[str, Any] = {"policy": name, "form": "predict", "seconds": base}
            rows.append(row | {"ratio_to_predict": 1.0})
            row = {"policy": name, "form": "NumPy lines", "seconds": lines}
            rows.append(row | {"ratio_to_predict": lines / base})
            for precision in ("double", "float"):
                seconds, tables, code, stack = seconds_in_c(
                    policy, precision, states, folder, arguments.repetitions
                )
                rows.append(
                    {
                        "policy": name,
                        "form": f"C, {precision}",
                        "seconds": seconds,
                        "ratio_to_predict": seconds / base,
                        "table_bytes": tables,
                        "code_bytes": code,
                        "stack_bytes": stack,
                    }
                )
    if arguments.json:
        print(json.dumps({"rows": rows}, indent=2))
        return
    table = Table("policy", "form", "ns a call", "x predict", "tables", "code", "stack")
    for row in rows:
        memory = [
            f"{row[key]:,}" if key in row else ""
            for key in ("table_bytes", "code_bytes", "stack_bytes")
        ]
        ratio = f"{row['ratio_to_predict']:.2g}"
        table.add_row(
            row["policy"], row["form"], f"{1e9 * row['seconds']:,.0f}", ratio, *memory
        )
    Console().print(table)


if __name__ == "__main__":
    main()
