"""Compiles an exported header and asks it for actions."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np

STRICT = ["-Wall", "-Wextra", "-Wpedantic", "-Werror", "-Wshadow", "-Wconversion"]

# Reads observations in binary from stdin, writes an action each as int32.
MAIN = """
#include "{header}"
#include <stdio.h>
#include <string.h>

int main(void)
{{
    {type} x[{name}_OBSERVATIONS];
    while (fread(x, sizeof x, 1, stdin) == 1) {{
        const int32_t action = (int32_t){name}_action(x);
        if (fwrite(&action, sizeof action, 1, stdout) != 1) {{
            return 1;
        }}
    }}
    return 0;
}}
"""
DTYPES = {"double": np.float64, "float": np.float32}
DTYPES |= {"int32_t": np.int32, "int64_t": np.int64}


def compiled(
    header: Path,
    number: str,
    name: str = "policy",
    compiler: tuple[str, ...] = ("gcc", "-std=c99", "-O2"),
    libraries: tuple[str, ...] = (),
) -> Path:
    """Compile a program around the header, every warning being an error.

    Without a library, unless there is an angle: that needs ("-lm",).
    """
    source, program = header.with_suffix(".main.c"), header.with_suffix(".program")
    source.write_text(MAIN.format(header=header.name, type=number, name=name))
    command = [*compiler, *STRICT, str(source), "-o", str(program), *libraries]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return program


def actions_of(program: Path, number: str, observations: np.ndarray) -> np.ndarray:
    """The program's action for each observation."""
    rows = np.ascontiguousarray(observations, dtype=DTYPES[number])
    done = subprocess.run(
        [str(program)], input=rows.tobytes(), capture_output=True, check=True
    )
    return np.frombuffer(done.stdout, dtype=np.int32)
