"""What a notebook shows of an agent: its parameters, how far it is, its policy."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acl_gym.envs.control.lookup import signals_of
from acl_gym.partitions import Discrete, Grid, Partition
from acl_gym.utils import pictures
from acl_gym.utils.parameters import parameters_of
from acl_gym.utils.text import short, signed
from acl_gym.utils.typing import IntArray

_GREEK = {
    **{"alpha": "α", "beta": "β", "gamma": "γ", "epsilon": "ε"},
    **{"lambda": "λ", "rho": "ρ", "tau": "τ"},
}

_MOST_CELLS = 400
"""Cells along an axis of the picture at most: larger pictures would fill the file."""

_MOST_NAMED = 9
"""Actions that are named below the picture at most."""

_WIDTH = 180
"""Pixels of the picture."""


def name_of(env: Any) -> str:
    """What an environment is called, without its namespace."""
    spec = getattr(env, "spec", None) or getattr(env.unwrapped, "spec", None)
    name = getattr(spec, "id", None) or type(env.unwrapped).__name__
    return str(name).rpartition("/")[2]


def page_of(agent: Any, policy: IntArray, facts: Iterable[Sequence[Any]]) -> str:
    """HTML of an agent: its parameters, facts and policy; all texts are escaped.

    Args:
        agent: whose parameters are shown.
        policy: the best action of each cell, `(n_cells,)`.
        facts: names with values.
    """
    parameters = pictures.table(
        (
            [
                name,
                pictures.Markup(_symbol(each.symbol)),
                _value(agent, name),
                each.meaning,
            ]
            for name, each in parameters_of(type(agent)).items()
        ),
        heads=("parameter", "", "value", "meaning"),
    )
    try:
        picture = _picture(agent, policy)
    except Exception:  # a picture is not worth an error
        picture = ""
    blocks = [picture, pictures.table(facts), parameters]
    inside = "".join(f"<div>{block}</div>" for block in blocks if block)
    return (
        f"<div><strong>{html.escape(type(agent).__name__)}</strong>"
        '<div style="display:flex;flex-wrap:wrap;gap:8px 24px;align-items:flex-start">'
        f"{inside}</div></div>"
    )


def _value(agent: Any, name: str) -> str:
    value = getattr(agent, name)
    return f"{value:g}" if isinstance(value, float) else short(repr(value))


def _symbol(symbol: str) -> str:
    letter, _, index = symbol.partition("_")
    text = html.escape(_GREEK.get(letter, letter))
    return f"<i>{text}</i>{f'<sub>{html.escape(index)}</sub>' if index else ''}"


def _picture(agent: Any, policy: IntArray) -> str:
    """The best action of each cell, with the colours below."""
    sizes = _sizes(agent.partition)
    # Of more than two variables those with one cell change nothing.
    wide = sorted(range(len(sizes)), key=lambda axis: sizes[axis] == 1)[:2]
    if not wide or max(sizes[axis] for axis in wide) > _MOST_CELLS:
        return ""
    cells = _cells(policy, sizes, wide)
    where = ""
    if len(sizes) > 2:
        across, up = sorted(wide)
        both = f"{_number(agent.partition, across)} and {_number(agent.partition, up)}"
        where = f", variables {both}, others in the middle"
    names, values = _actions(agent)
    colours = pictures.action_colours(agent.n_actions, values)
    pixels = np.array([pictures.rgb(colour) for colour in colours], dtype=np.uint8)
    rows, columns = cells.shape
    height = max(12, min(_WIDTH, round(_WIDTH * rows / columns)))
    style = f"width:{_WIDTH}px;height:{height}px;image-rendering:pixelated"
    image = pictures.inline_png(
        pictures.png(pixels[cells[::-1]]), "the best action of each cell", style
    )
    patch = "display:inline-block;width:9px;height:9px;border:1px solid #999"
    named = "".join(
        f'<span style="white-space:nowrap;margin-right:8px"><span style="{patch};'
        f'background:{colour}"></span> {html.escape(name)}</span>'
        for colour, name in zip(colours, names, strict=True)
        if len(names) <= _MOST_NAMED
    )
    return (
        f'{image}<div style="max-width:{_WIDTH}px;font-size:80%">best action of each '
        f"cell{where}<br>{named}</div>"
    )


def _actions(agent: Any) -> tuple[list[str], list[float] | None]:
    """The names of actions, and their values if these are numbers on one scale."""
    signals = None if agent.env is None else signals_of(agent.env)
    if signals is None or len(signals.inputs) != 1:
        first = agent.first_action
        return [f"action {first + u}" for u in range(agent.n_actions)], None
    values = [row[0] for row in signals.values]
    unit = signals.inputs[0].split(", ")[1:2]
    return [" ".join([signed(value), *unit]) for value in values], values


def _number(partition: Partition, axis: int) -> str:
    """Which variable it is, from 1, and whether it is an angle."""
    if isinstance(partition, Grid):
        cosines = [cosine for cosine, _ in partition.angles]
        if partition.columns[axis] in cosines:
            return f"{axis + 1} (angle)"
    return f"{axis + 1}"


def _sizes(partition: Partition) -> list[int]:
    """The cells along each variable; none of a partition of another kind."""
    if isinstance(partition, Grid):
        return [axis.size for axis in partition.centres]
    if isinstance(partition, Discrete):
        return [int(size) for size in partition.sizes.ravel()]
    return []


def _cells(policy: IntArray, sizes: list[int], wide: list[int]) -> NDArray[np.int64]:
    """The policy over two variables, the first to the right; others in the middle."""
    place = tuple(
        slice(None) if axis in wide else size // 2 for axis, size in enumerate(sizes)
    )
    shown = policy.reshape(sizes)[place]
    return shown[None, :] if shown.ndim == 1 else shown.T
