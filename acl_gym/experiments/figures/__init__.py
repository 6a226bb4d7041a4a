"""The figures of a comparison, each a function of it.

Every system has those of `common`; how its policies are drawn depends on it.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from acl_gym.experiments.figures import common, grid, navigation, pendulum
from acl_gym.utils.files import write_atomically

Comparison = dict[str, Any]
Draw = Callable[[Comparison], Figure]

DPI = 300


def save_figures(comparison: Comparison, directory: Path) -> dict[str, Path]:
    """Draw every figure and write it as a PNG, whole or not at all.

    A figure that this system does not have, left by another one, is removed.

    Args:
        comparison: all of it.
        directory: exists.

    Returns:
        The path of each figure, in the order in which to show them.
    """
    paths = {}
    for name, draw in figures_of(comparison).items():
        buffer = io.BytesIO()
        draw(comparison).savefig(buffer, format="png", dpi=DPI)
        paths[name] = directory / f"{name}.png"
        write_atomically(paths[name], buffer.getvalue())
    for name in {name for own in OF_SYSTEM.values() for name in own} - set(paths):
        (directory / f"{name}.png").unlink(missing_ok=True)
    return paths


def figures_of(comparison: Comparison) -> dict[str, Draw]:
    """Name and function of each figure of a comparison, in order."""
    return {**COMMON, **OF_SYSTEM[comparison["pictures"]]}


COMMON: dict[str, Draw] = {
    "summary": common.summary_dots,
    "learning_curves": common.learning_curves,
}
OF_SYSTEM: dict[str, dict[str, Draw]] = {
    "pendulum": {
        "policy_maps": pendulum.policy_maps,
        "trajectories": pendulum.trajectories,
    },
    "navigation": {
        "policy_maps": navigation.policy_maps,
        "trajectories": navigation.trajectories,
    },
    "grid": {"policy_maps": grid.policy_maps},
}
"""The figures of each kind of `pictures.PICTURES`."""
