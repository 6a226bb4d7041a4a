"""Real inputs between the best action of a table and its neighbours on a grid."""

from __future__ import annotations

import numpy as np

from acl_gym.colony.greedy import weighted_value
from acl_gym.utils.compiling import njit
from acl_gym.utils.input_grid import InputGrid
from acl_gym.utils.typing import CellArray, FloatArray, IntArray


def interpolated_inputs(
    table: FloatArray,
    index: CellArray,
    degree: FloatArray,
    best: IntArray,
    grid: InputGrid,
) -> FloatArray:
    """The inputs between the best action of each state and its neighbours.

    Args:
        table: `(n_cells, n_actions)`, levels or values.
        index: cells of the states, `(n, k)`, of the table.
        degree: their degrees, `(n, k)`.
        best: the best action of each state, as `greedy_actions` gives it, `(n,)`.
        grid: the inputs of the actions.

    Returns:
        `(n, n_inputs)`, see `acl_gym.policies.InterpolatedPolicy`.
    """
    inputs = np.empty((len(index), grid.n_inputs))
    _interpolate(
        table, index, degree, best, grid.values, grid.below, grid.above, inputs
    )
    return inputs


@njit
def vertex(
    lower: float, middle: float, upper: float, low: float, best: float, high: float
) -> float:
    """Where the parabola through three points is highest, if the middle one is.

    Args:
        lower: the input below.
        middle: the input whose value is the largest.
        upper: the input above.
        low: the value of the input below.
        best: the largest value.
        high: the value of the input above.

    Returns:
        An input between the middles of the two intervals; `middle` where all values are
        alike, or one is not finite.
    """
    # Halved, so that no difference of finite numbers overflows.
    fall_below = 0.5 * best - 0.5 * low
    fall_above = 0.5 * best - 0.5 * high
    largest = max(fall_below, fall_above)
    if not (np.isfinite(fall_below) and np.isfinite(fall_above) and largest > 0.0):
        return middle
    down, up = middle - lower, upper - middle
    towards_upper = fall_below / largest * up
    towards_lower = fall_above / largest * down
    share = towards_upper / (towards_upper + towards_lower)
    return middle + 0.5 * (share * up - (1.0 - share) * down)


@njit
def _interpolate(
    table: FloatArray,
    index: CellArray,
    degree: FloatArray,
    best: IntArray,
    values: FloatArray,
    below: IntArray,
    above: IntArray,
    inputs: FloatArray,
) -> None:
    """Write the input between the best action of each state and its neighbours.

    Args:
        table: `(n_cells, n_actions)`.
        index: cells of the states, `(n, k)`.
        degree: their degrees, `(n, k)`.
        best: the best action of each state, `(n,)`.
        values: inputs of the actions, `(n_actions, n_inputs)`.
        below: see `InputGrid`.
        above: see `InputGrid`.
        inputs: receives the result, `(n, n_inputs)`.
    """
    for j in range(index.shape[0]):
        u = best[j]
        top = weighted_value(table, index[j], degree[j], u)
        for i in range(values.shape[1]):
            middle, lower, upper = values[u, i], below[u, i], above[u, i]
            inputs[j, i] = middle
            if lower >= 0 and upper >= 0:
                inputs[j, i] = vertex(
                    values[lower, i],
                    middle,
                    values[upper, i],
                    weighted_value(table, index[j], degree[j], lower),
                    top,
                    weighted_value(table, index[j], degree[j], upper),
                )
