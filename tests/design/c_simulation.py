"""Simulates the examples in C, with their equations written anew, under a policy in C."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np

from tests.export.compiled import STRICT

# x' of each example, in the notation of C. What stops a plant is part of it: a tank is
# never emptier than empty, and the cart stands at the ends of its rail.
EQUATIONS = {
    "pendulum": """
    dx[0] = x[1];
    dx[1] = (0.1 * 9.81 * 0.1 * sin(x[0]) - 0.01 * x[1] + 0.1 * u) / 0.005;
""",
    "dc_motor": """
    const double current = (u - 0.5 * x[1]) / 4.0;
    dx[0] = x[1];
    dx[1] = (0.5 * current - 0.01 * x[1] - 0.1 * tanh(x[1] / 0.2)) / 0.02;
""",
    "two_tanks": """
    const double first = 0.178 * sqrt(2.0 * 981.0 * fmax(x[0], 0.0));
    const double second = 0.178 * sqrt(2.0 * 981.0 * fmax(x[1], 0.0));
    dx[0] = (3.3 * u - first) / 15.5;
    dx[1] = (first - second) / 15.5;
""",
    "cart_pole": """
    const double s = sin(x[2]), c = cos(x[2]), m = 0.1, l = 0.5, all = 1.1;
    const double a = (u + m * l * x[3] * x[3] * s) / all;
    dx[0] = x[1];
    dx[2] = x[3];
    dx[3] = (9.81 * s - c * a) / (l * (4.0 / 3.0 - m * c * c / all));
    dx[1] = a - m * l * dx[3] * c / all;
""",
}

PROGRAM = """
#include <math.h>
#include <stdio.h>
#include "{header}"

enum {{ N = policy_OBSERVATIONS, SUBSTEPS = 10 }};

static void derivative(const double *x, double u, double *dx)
{{{equations}}}

static void advance(double *x, double u, double h)
{{
    double k[4][N], y[N];
    const double part[4] = {{0.0, 0.5, 0.5, 1.0}};
    for (int j = 0; j < 4; j++) {{
        for (int i = 0; i < N; i++) {{
            y[i] = x[i] + (j ? part[j] * h * k[j - 1][i] : 0.0);
        }}
        derivative(y, u, k[j]);
    }}
    for (int i = 0; i < N; i++) {{
        x[i] += h / 6.0 * (k[0][i] + 2.0 * k[1][i] + 2.0 * k[2][i] + k[3][i]);
    }}
}}

int main(void)
{{
    const double centre[N] = {{{centre}}}, half[N] = {{{half}}}, period[N] = {{{period}}};
    const double low[N] = {{{low}}}, high[N] = {{{high}}};
    double x[N];
    while (fread(x, sizeof x, 1, stdin) == 1) {{
        int steps = 0, inside = 0;
        while (!inside && steps < {limit}) {{
            float measured[N];
            for (int i = 0; i < N; i++) {{
                measured[i] = (float)x[i];
            }}
            const int action = policy_action(measured);
            if (action == policy_INVALID) {{
                return 1;
            }}
            const double u = (double)policy_inputs[action - policy_FIRST_ACTION][0];
            for (int j = 0; j < SUBSTEPS; j++) {{
                advance(x, u, {sampling_time} / SUBSTEPS);
                for (int i = 0; i < N; i++) {{
                    if (!(period[i] > 0.0)) {{
                        x[i] = fmin(fmax(x[i], low[i]), high[i]);
                    }}
                }}
            }}
            steps++;
            inside = 1;
            for (int i = 0; i < N; i++) {{
                double error = x[i] - centre[i];
                if (period[i] > 0.0) {{
                    error = remainder(error, period[i]);
                }}
                inside = inside && fabs(error) <= half[i];
            }}
        }}
        printf("%d\\n", inside ? steps : -1);
    }}
    return 0;
}}
"""


def steps_in_c(
    name: str, header: Path, plant: object, starts: np.ndarray
) -> np.ndarray:
    """Steps to the goal from each start, -1 where it is not reached in time.

    Args:
        name: of the example.
        header: the policy, `policy.h`.
        plant: its system, of which only numbers are taken, not the equations.
        starts: `(n, state_size)`.
    """
    box, low, high = plant.goal_box, plant.low, plant.high
    rounds = [i in plant.circular for i in range(low.size)]

    def row(values: np.ndarray) -> str:
        return ", ".join(repr(float(value)) for value in values)

    text = PROGRAM.format(
        header=header.name,
        equations=EQUATIONS[name],
        centre=row(box.mean(axis=0)),
        half=row((box[1] - box[0]) / 2),
        period=row(np.where(rounds, high - low, 0.0)),
        low=row(low),
        high=row(high),
        limit=plant.evaluation_steps,
        sampling_time=repr(plant.sampling_time),
    )
    source, program = header.with_suffix(".main.c"), header.with_suffix(".program")
    source.write_text(text)
    command = ["cc", "-std=c99", "-O2", *STRICT, str(source), "-o", str(program), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    ran = subprocess.run(
        [str(program)], input=starts.tobytes(), capture_output=True, check=True
    )
    return np.array(ran.stdout.split(), dtype=np.int64)
