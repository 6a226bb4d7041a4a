"""Policies with many ties, and observations that are hard to locate."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acl_gym.partitions import Crisp, Fuzzy, Grid
from acl_gym.policies import TablePolicy
from acl_gym.utils.angles import Angles


def random_policy(
    kind: type[Grid],
    sizes: tuple[int, ...],
    circular: tuple[bool, ...],
    n_actions: int,
    seed: int,
    regular: bool = True,
    angles: Sequence[tuple[int, int]] = (),
) -> TablePolicy:
    """A policy over a grid of which a third of the levels are alike, as in unvisited cells.

    A variable that is one of `angles` is circular, its centres spread over the circle.
    """
    around = Angles(angles, len(sizes)).circular
    rng = np.random.default_rng(seed)
    centres, periods = [], []
    for axis, (size, is_round) in enumerate(zip(sizes, circular, strict=True)):
        gaps = np.full(size, 0.3) if regular else rng.uniform(0.1, 0.7, size)
        line = rng.normal() + np.cumsum(gaps)
        period = float(np.ptp(line) + gaps[0]) if is_round else None
        if axis in around:
            line, period = line * (2 * np.pi / gaps.sum()), None
        centres.append(line)
        periods.append(period)
    partition = kind(centres, periods, angles)
    table = rng.exponential(1e-4, (partition.n_cells, n_actions))
    table[rng.random(len(table)) < 1 / 3] = 1e-4
    return TablePolicy(partition, table, first_action=int(rng.integers(-3, 4)))


def hard_observations(policy: TablePolicy, count: int, seed: int) -> np.ndarray:
    """Random states inside and outside, on centres, halfway between them, next to both.

    A twelfth of them are multiples of a period away, a few are huge. Half of what shows
    an angle is on the circle, half not.
    """
    rng = np.random.default_rng(seed)
    grid = policy.partition
    assert isinstance(grid, (Crisp, Fuzzy))
    columns = []
    for centres, period in zip(grid.centres, grid.periods, strict=True):
        span = np.ptp(centres) + 0.5
        x = rng.uniform(centres[0] - 0.3 * span, centres[-1] + 0.3 * span, count)
        middle = np.append(centres, (centres[1:] + centres[:-1]) / 2)
        kind = rng.integers(0, 12, count)
        special = rng.choice(middle, count)
        x = np.where(kind < 2, special, x)
        x = np.where(kind == 2, np.nextafter(special, np.inf), x)
        x = np.where(kind == 3, np.nextafter(special, -np.inf), x)
        x = np.where(kind == 4, x + (period or 1.0) * rng.integers(-50, 50, count), x)
        x[:3] = 1e300, -1e300, np.finfo(np.float64).max
        columns.append(x)
    states = grid.observations(np.stack(columns, axis=1))
    for pair in grid.angles:
        states[: count // 2, pair] *= rng.lognormal(0.0, 3.0, (count // 2, 1))
        states[3:6, pair] = (0.0, 0.0), (1e308, 1.7e308), (-0.0, 0.0)
    return states
