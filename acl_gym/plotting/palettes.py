"""Colours of actions and levels, and the bars that explain them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colorbar import Colorbar
from matplotlib.colors import BoundaryNorm, ListedColormap, LogNorm, Normalize
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, MaxNLocator

from acl_gym.plotting import style
from acl_gym.plotting.subject import Subject
from acl_gym.utils import validation
from acl_gym.utils.pictures import action_colours, direction_colours, rgb
from acl_gym.utils.text import signed
from acl_gym.utils.typing import FloatArray

LEVELS = "cividis"
"""The colours of levels."""

_SHADES = 256
"""Colours of a range of inputs."""

_PALE = 200
"""Of 255: a colour whose channels are all above it is hardly seen as a line."""

_NARROW = 100.0
"""Times the lowest level: below it, levels stand as plain numbers."""


class Palette(NamedTuple):
    """Colours of actions.

    Attributes:
        place: of each action in the bar.
        colours: of the places.
        names: of the places.
        title: of the bar.
    """

    place: Any
    colours: list[str]
    names: list[str]
    title: str

    def ink(self, place: int) -> str:
        """The colour of a line; a pale one is darkened to be seen on white."""
        colour = self.colours[place]
        return colour if min(rgb(colour)) < _PALE else "#7A7A7A"

    def mapping(self) -> tuple[ListedColormap, BoundaryNorm]:
        """Of places to colours."""
        count = len(self.colours)
        return ListedColormap(self.colours), BoundaryNorm(
            np.arange(count + 1) - 0.5, count
        )


def of_names(names: Sequence[str]) -> Palette:
    """A colour for each name, in the order of the actions."""
    count = len(names)
    return Palette(np.arange(count), action_colours(count), list(names), "action")


def of_inputs(subject: Subject) -> Palette:
    """Physical inputs in their order, or names in the order of the actions."""
    inputs, count = subject.inputs, subject.n_actions
    if inputs is None:
        return of_names(subject.actions)
    names = [style.symbol(name) for name in subject.input_names]
    if inputs.shape[1] == 1:
        order = np.argsort(inputs[:, 0], kind="stable")
        values = inputs[order, 0]
        colours = action_colours(count, values.tolist())
        labels = [signed(float(value)) for value in values]
        return Palette(
            np.argsort(order), colours, labels, names[0] if names else "input"
        )
    labels = [f"({', '.join(map(signed, row))})" for row in inputs]
    title = ", ".join(names) or "inputs"
    colours = action_colours(count)
    if inputs.shape[1] == 2:
        colours = direction_colours(inputs)
    return Palette(np.arange(count), colours, labels, title)


def of_range(low: float, high: float) -> tuple[ListedColormap, Normalize]:
    """Colours of all inputs in a range, those of `of_inputs` at its ends and at 0."""
    if low == high:  # an input that no action changes
        low, high = low - 1.0, high + 1.0
    values = np.linspace(low, high, _SHADES)
    return ListedColormap(action_colours(_SHADES, values.tolist())), Normalize(
        low, high
    )


def norm_of(values: FloatArray, limits: tuple[float, float] | None = None) -> Normalize:
    """The scale of levels: logarithmic where all are positive.

    Raises:
        ValueError: `limits` are not two increasing numbers.
    """
    low, high = float(values.min()), float(values.max())
    if limits is not None:
        given = validation.real_array("limits", limits, ndim=1)
        if given.size != 2 or not given[0] < given[1]:
            raise ValueError(
                "limits must be the lowest and the highest level, got "
                f"{validation.shown(limits)}."
            )
        low, high = given.tolist()
    if low > 0.0:
        return LogNorm(low, high if high > low else 10.0 * low)
    return Normalize(low, high if high > low else low + 1.0)


def levels(norm: Normalize) -> ScalarMappable:
    """Colours of levels on a scale."""
    return ScalarMappable(norm, LEVELS)


def add_bar(
    ax: Axes, colours: Palette, *, below: bool = False, slim: bool = False
) -> None:
    """A bar beside `ax` with a name beside each colour; below it, patches.

    Args:
        ax: the picture.
        colours: what is explained.
        below: whether patches stand below the figure instead.
        slim: whether the name of the bar stands above it, or below one that is as high
            as the picture.
    """
    if below:
        handles = [
            Patch(color=colour, label=name)
            for colour, name in zip(colours.colours, colours.names, strict=True)
        ]
        figure: Any = ax.figure
        style.legend(figure, handles, ncols=6)
        return
    cmap, norm = colours.mapping()
    count = len(colours.colours)
    height = min(1.0, 0.2 + 0.1 * count)
    place = (1.03, 0.5 * (1.0 - height), 0.045, height)
    bar = _bar(ax, ScalarMappable(norm, cmap), "" if slim else colours.title, place)
    if slim:
        if height < 1.0:
            bar.ax.set_title(colours.title.replace(" (", "\n("), size="small")
        else:  # above it the title of the picture may stand
            names = colours.title.replace(", ", ",\n")
            bar.ax.set_xlabel(names, size="small", loc="left")
    bar.set_ticks(list(range(count)), labels=colours.names)
    bar.ax.tick_params(length=0)


def add_level_bar(
    ax: Axes, mappable: Any, name: str, *, below: bool = False, extend: str = "neither"
) -> None:
    """A bar of levels beside `ax`, or below a picture that is wide and low.

    Args:
        ax: the picture.
        mappable: what maps levels to colours.
        name: of the bar.
        below: whether it lies below.
        extend: `"max"` if levels may lie above the scale.
    """
    place = None if below else (1.03, 0.0, 0.045, 1.0)
    bar = _bar(ax, mappable, name, place, extend=extend)
    norm = mappable.norm
    if isinstance(norm, LogNorm):
        vmin, vmax = float(norm.vmin or 0.0), float(norm.vmax or 0.0)
        axis = bar.ax.xaxis if below else bar.ax.yaxis
        if vmax < _NARROW * vmin:
            few = LogLocator(subs=(1.0, 2.0, 5.0))
            axis.set_major_locator(few if vmax > 4 * vmin else MaxNLocator(4))
            style.plain_numbers(axis)
        bar.ax.minorticks_off()


def _bar(
    ax: Axes, mappable: ScalarMappable, name: str, place: Any, extend: str = "neither"
) -> Colorbar:
    """A bar in a place of the axes, as high as the picture; without a place, below."""
    figure: Any = ax.figure
    options: dict[str, Any] = {"ax": ax, "location": "bottom", "aspect": 40}
    if place is not None:
        options = {"cax": ax.inset_axes(place)}
    bar: Colorbar = figure.colorbar(mappable, label=name, extend=extend, **options)
    bar.outline.set_visible(False)
    return bar
