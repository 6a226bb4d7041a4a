"""The figures of a comparison, each a function of it.

Colours are those of Okabe and Ito, which people who are colour-blind tell apart: a
warm hue is a colony, a blue one Q-learning; a dashed line is a crisp partition.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator, MultipleLocator, NullFormatter

from acl_gym.experiments import statistics, wording
from acl_gym.storage import write_atomically

Comparison = dict[str, Any]
Run = dict[str, Any]

DPI = 300
WIDTH = 7.2  # inches, the text width of a page in two columns
OPTIMUM = "Optimum"


class Style(NamedTuple):
    """How an agent is drawn, in every figure alike."""

    color: str
    dashes: Any = "-"
    marker: str = "o"


STYLES = {
    "acl-fuzzy": Style("#D55E00", "-", "o"),
    "acl-crisp": Style("#E69F00", (0, (4, 1.5)), "s"),
    "q-fuzzy": Style("#0072B2", "-", "^"),
    "q-crisp": Style("#56B4E9", (0, (4, 1.5)), "v"),
    "dqn": Style("#009E73", (0, (5, 1.2, 1, 1.2)), "D"),
}
_OTHER = Style("#CC79A7", (0, (1, 1)), "P")
_OPTIMUM = Style("#000000", (0, (1, 1)), "")

_FONT = {"font.size": 8, "axes.titlesize": 8}
_GRID = {"color": "0.88", "linewidth": 0.5}
_GOAL = "#CC79A7"


def style(agent: str) -> Style:
    """How to draw an agent; one that is not of the comparison has a style too."""
    return STYLES.get(agent, _OTHER)


def save_figures(comparison: Comparison, directory: Path) -> dict[str, Path]:
    """Draw every figure and write it as a PNG, whole or not at all.

    Args:
        comparison: all of it.
        directory: exists.

    Returns:
        The path of each figure, in the order in which to show them.
    """
    paths = {}
    for name, draw in FIGURES.items():
        figure = draw(comparison)
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png", dpi=DPI)
        paths[name] = directory / f"{name}.png"
        write_atomically(paths[name], buffer.getvalue())
    return paths
