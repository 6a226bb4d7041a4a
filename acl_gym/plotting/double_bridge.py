"""Pictures of colonies that cross a double bridge."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import PercentFormatter

from acl_gym.plotting import style
from acl_gym.theory import ranges
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray

_FIFTHS = np.linspace(0.0, 1.0, 6)
"""Bounds of the classes in which Goss et al. counted experiments."""

_COLOURS = (style.BLUE, style.BLACK, style.ORANGE, style.GREEN)
_LINES = ("-", "--", "-.", ":")


def plot_crossings(
    chosen: Any, record: Any, ax: Axes | None = None, *, branch: str = "branch A"
) -> Axes:
    """Draw how the share of a branch develops, a line for each colony.

    Args:
        chosen: how many of the first `record` ants chose the branch, a row for each
            colony, as `acl_gym.theory.simulate_crossings` returns it.
        record: after how many ants, increasing, `(m,)`.
        ax: where to draw; None makes a figure, see `plot_policy`.
        branch: what it is called.

    Returns:
        The axes.

    Raises:
        ValueError: the arrays do not fit together.
        TypeError: `ax` are not axes.
    """
    after = ranges.checked("record", record, at_least=1)
    counts = ranges.checked("chosen", chosen, at_least=0)
    if after.ndim != 1 or counts.ndim != 2 or counts.shape[1] != after.size:
        raise ValueError(
            "chosen must have a row for each colony and a column for each number of "
            f"ants in record, got the shapes {counts.shape} and {after.shape}."
        )
    if (counts > after).any():
        row, column = np.argwhere(counts > after)[0]
        raise ValueError(
            "chosen must not be more than the ants in record, got "
            f"{counts[row, column]:g} of {after[column]:g} ants for colony {row}."
        )
    shares = counts / after
    with style.axes_or_new(ax) as ax:
        # Both ends of the scale are equally good, so colours show who wins.
        for share in shares:
            colour = style.ORANGE if share[-1] > 0.5 else style.BLUE
            ax.plot(after, share, color=colour, linewidth=0.8, alpha=0.7)
        ax.set_xscale("log")
        style.plain_numbers(ax.xaxis)
        ax.xaxis.set_major_formatter(lambda value, _: f"{value:,.0f}")
        if after.size > 1:
            ax.set_xlim(after[0], after[-1])
        ax.set_xlabel("ants that have crossed")
        _share_axis(ax.yaxis)
        ax.set(ylim=(0.0, 1.0), ylabel=f"share of {branch}")
    return ax


def plot_crossing_law(
    laws: Mapping[str, Any],
    ax: Axes | None = None,
    *,
    simulated: Mapping[str, Any] | None = None,
    bins: int = 50,
) -> Axes:
    """Draw how likely each share of branch A is, exactly and in simulation.

    Args:
        laws: from names, for the legend, to laws of N_A, as
            `acl_gym.theory.crossing_law` returns them.
        ax: where to draw; None makes a figure, see `plot_policy`.
        simulated: from some of the names to how many ants of each colony chose branch
            A; drawn as points. None draws none.
        bins: classes of the share, >= 1; in each the density is the mean one. With at
            most one class for every two ants the curve is even.

    Returns:
        The axes.

    Raises:
        ValueError: there is no law, one is empty, or `simulated` has a name that `laws`
            lacks.
        TypeError: `laws` or `simulated` is not a dict, or `ax` are not axes.
    """
    bins = validation.integer("bins", bins, at_least=1)
    _check_named("laws", laws)
    simulated = {} if simulated is None else simulated
    _check_named("simulated", simulated)
    if not laws or not set(simulated) <= set(laws):
        raise ValueError(
            "laws must name one law or more, and simulated some of them, got "
            f"{list(laws)} and {list(simulated)}."
        )
    edges = np.linspace(0.0, 1.0, bins + 1)
    centres = (edges[1:] + edges[:-1]) / 2
    with style.axes_or_new(ax) as ax:
        for i, (name, given) in enumerate(laws.items()):
            law = ranges.checked(f"laws[{name!r}]", given, at_least=0)
            if law.ndim != 1 or law.size < 2:
                raise ValueError(
                    f"laws[{name!r}] must hold the probabilities of 0 to N crossings "
                    f"with N >= 1, got the shape {law.shape}."
                )
            colour = _COLOURS[i % len(_COLOURS)]
            dashes = _LINES[i // len(_COLOURS) % len(_LINES)]
            n_ants = law.size - 1
            exact = _density(np.arange(n_ants + 1), law, edges, n_ants)
            ax.plot(centres, exact, color=colour, linestyle=dashes, label=name)
            if name in simulated:
                counts = ranges.checked(
                    f"simulated[{name!r}]", simulated[name], at_least=0, at_most=n_ants
                )
                weights = np.full(counts.shape, 1.0 / counts.size)
                found = _density(counts, weights, edges, n_ants)
                ax.plot(centres, found, ".", color=colour, markersize=3.5)
        _share_axis(ax.xaxis)
        ax.set(xlim=(0.0, 1.0), xlabel="share of branch A")
        ax.set_ylim(bottom=0.0)
        ax.set_ylabel("probability density")
        if any(laws):
            ax.legend()
    return ax


def plot_branch_choice(
    shares: Mapping[str, Any], ax: Axes | None = None, *, branch: str = "short branch"
) -> Axes:
    """Draw in what share of the colonies so many ants take a branch, in fifths.

    As Goss et al. (1989) showed their experiments.

    Args:
        shares: from names to the share of the ants of each colony that took the branch,
            in [0, 1].
        ax: where to draw; None makes a figure, see `plot_policy`.
        branch: what it is called.

    Returns:
        The axes.

    Raises:
        ValueError: there are none, or a share is out of range.
        TypeError: `shares` is not a dict, or `ax` are not axes.
    """
    _check_named("shares", shares)
    if not shares:
        raise ValueError("shares must name one experiment or more, got none.")
    with style.axes_or_new(ax) as ax:
        width = 0.8 / len(shares)
        for i, (name, given) in enumerate(shares.items()):
            found = ranges.checked(f"shares[{name!r}]", given, at_least=0, at_most=1)
            counts, _ = np.histogram(found, _FIFTHS)
            places = np.arange(5) + (i - (len(shares) - 1) / 2) * width
            colour = _COLOURS[i % len(_COLOURS)]
            ax.bar(places, counts / found.size, 0.9 * width, color=colour, label=name)
        names = [f"{low}\N{EN DASH}{low + 20}%" for low in range(0, 100, 20)]
        ax.set_xticks(np.arange(5), names)
        ax.grid(visible=False, axis="x")
        _share_axis(ax.yaxis)
        ax.set(ylim=(0.0, 1.0), ylabel="share of the colonies")
        ax.set_xlabel(f"ants on the {branch}")
        if any(shares):
            ax.legend()
    return ax


def _check_named(name: str, given: Any) -> None:
    """Check that what is drawn has names.

    Raises:
        TypeError: it is not a dict.
    """
    if not isinstance(given, Mapping):
        raise TypeError(
            f"{name} must be a dict from names to arrays, such as {{'ants': values}}, got "
            f"{validation.shown(given)}."
        )


def _density(
    counts: Any, weights: FloatArray, edges: FloatArray, n_ants: int
) -> FloatArray:
    """The mean density of the share in each class.

    Args:
        counts: numbers of crossings.
        weights: probability of each.
        edges: of the classes.
        n_ants: of how many ants.
    """
    # Each number of crossings stands for an equal part of [0, 1].
    shares = (counts + 0.5) / (n_ants + 1)
    mass, _ = np.histogram(shares, edges, weights=weights)
    parts, _ = np.histogram((np.arange(n_ants + 1) + 0.5) / (n_ants + 1), edges)
    return np.asarray(mass * (n_ants + 1) / np.maximum(parts, 1))


def _share_axis(axis: Any) -> None:
    axis.set_major_formatter(PercentFormatter(1.0, decimals=0))
