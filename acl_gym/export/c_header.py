"""A greedy policy as one C99 header that allocates nothing."""

from __future__ import annotations

import math
import re
import textwrap
from importlib.metadata import version
from importlib.resources import files as resources
from pathlib import Path
from typing import Any

import numpy as np

from acl_gym.export.c_text import Number, integer_type, sanitised, table
from acl_gym.export.source import Source
from acl_gym.utils import files, validation

MOST_NUMBERS = 4_000_000
"""The most numbers in the tables of a header; compilers take minutes for more."""

LONGEST_NAME = 40  # C99 tells identifiers apart by their first 63 characters

_INT32 = 2**31 - 1


def checked_name(name: Any) -> str:
    """Return a prefix for C identifiers.

    Raises:
        ValueError: it is not a string of letters, digits and single underscores that
            begins with a letter, or is too long.
    """
    valid = isinstance(name, str) and re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name)
    if not valid or "__" in name or len(name) > LONGEST_NAME:
        raise ValueError(
            "name must be a C identifier of letters, digits and single underscores "
            f"that begins with a letter, of at most {LONGEST_NAME} characters, got "
            f"{name!r}; choose one such as 'swing_up'."
        )
    return str(name)


def write_c_header(
    path: str | Path, source: Source, name: str = "policy", precision: str = "float"
) -> Path:
    """Write a header; see `PartitionPolicy.to_c`."""
    target = validation.file_path("path", path)
    if not target.suffix:
        target = target.with_name(f"{target.name}.h")
    files.checked_target(target)
    text = c_header(source, name, precision, target.name)
    files.write_atomically(target, text.encode("ascii"))
    return target


def c_header(source: Source, name: str, precision: str, file_name: str) -> str:
    """Return the text of a header.

    Args:
        source: the policy.
        name: what every name in the header begins with.
        precision: "float" or "double".
        file_name: of the header, for the comment at its head.

    Raises:
        ValueError: `name` is no C identifier, the tables are too large, or numbers do
            not fit a float.
    """
    from jinja2 import Environment, StrictUndefined  # takes a while to import

    name, number = checked_name(name), Number(precision)
    _check_size(source)
    tables = _Tables(name, number)
    if source.kind == "discrete":
        state_type = _add_values(tables, source)
    else:
        state_type = number.type
        _add_axes(tables, source)
    order_type = ""
    if source.kind == "fuzzy":
        order_type = _add_levels(tables, source)
    else:
        _add_columns(tables, source)
    signals = source.signals
    if source.grid is not None:
        _add_neighbours(tables, source)
    if signals is not None:
        tables.add_inputs(np.array(signals.values), ", ".join(signals.inputs))
    dimensions = len(source.cells)
    template = Environment(
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=StrictUndefined,
    ).from_string(_template())
    return template.render(
        name=name,
        number=number,
        kind=source.kind,
        state_type=state_type,
        order_type=order_type,
        observed=source.angles.n_observed,
        dimensions=dimensions,
        columns=source.angles.columns,
        angles=dict(source.angles.pairs),
        variables="v" if source.angles.pairs else "x",
        atan2=number.atan2,
        corners=2**dimensions,
        n_actions=source.n_actions,
        first_action=source.first_action,
        circular=any(source.periods),
        inputs=signals is not None,
        between=source.grid is not None,
        n_inputs=0 if source.grid is None else source.grid.n_inputs,
        tables=tables.texts,
        bytes=f"{tables.bytes:,}",
        stack=_stack(source, number),
        work=_work(source, number),
        file_name=sanitised(file_name),
        version=version("acl-gym"),
        **_words(source, number),
    )


def _template() -> str:
    return resources("acl_gym.export").joinpath("policy.h.j2").read_text("ascii")


class _Tables:
    """The tables of a header and the memory that they take.

    Args:
        name: prefix of their names.
        number: how real numbers are written.
    """

    def __init__(self, name: str, number: Number) -> None:
        self._name, self.number = name, number
        self.texts: list[str] = []
        self.bytes = 0

    def add_reals(
        self, name: str, values: Any, comment: str, row: int | None = None
    ) -> None:
        """Add real numbers."""
        items = map(self.number.literal, values)
        self._add(self.number.type, name, len(values), items, comment, row)
        self.bytes += self.number.bytes * len(values)

    def add_integers(
        self,
        name: str,
        values: Any,
        comment: str,
        row: int | None = None,
        kind: tuple[str, int] | None = None,
    ) -> str:
        """Add integers; return their type, the smallest or the given one."""
        values = np.asarray(values)
        type_name, size = kind or integer_type(values)
        items = map(str, values.tolist())
        self._add(type_name, name, len(values), items, comment, row)
        self.bytes += size * len(values)
        return type_name

    def add_inputs(self, values: Any, comment: str) -> None:
        """Add the inputs of each action, a row each."""
        rows = ["{" + ", ".join(map(self.number.literal, row)) + "}" for row in values]
        dimensions = f"{len(rows)}][{values.shape[1]}"
        note = f"of each action: {sanitised(comment)}"
        self._add(self.number.type, "inputs", dimensions, rows, note, 1)
        self.bytes += self.number.bytes * values.size

    def _add(
        self, kind: str, name: str, size: Any, items: Any, comment: str, row: Any
    ) -> None:
        declaration = f"{kind} {self._name}_{name}[{size}]"
        self.texts.append(table(declaration, items, comment, row))


def _check_size(source: Source) -> None:
    size = source.table.size if source.kind == "fuzzy" else len(source.table)
    if source.grid is not None and source.kind != "fuzzy":
        size += len(source.table) * source.grid.n_inputs
    if source.kind != "discrete":
        size += sum(line.size for line in source.lines)
    if size > MOST_NUMBERS:
        raise ValueError(
            f"a header holds at most {MOST_NUMBERS:,} numbers, this policy needs "
            f"{size:,}; use fewer cells, Crisp cells (one number each), or to_numpy."
        )
    if abs(source.first_action) + source.n_actions > _INT32:
        raise ValueError(
            "actions must fit a C int to be exported, got first_action = "
            f"{source.first_action}."
        )


def _add_axes(tables: _Tables, source: Source) -> None:
    """What locates an observation on a grid."""
    lines = [tables.number.rounded(line) for line in source.lines]
    for axis, line in enumerate(lines):
        if not (np.isfinite(line).all() and (np.diff(line) > 0).all()):
            raise ValueError(
                f"the centres of variable {axis} must differ as floats, got "
                f"{source.lines[axis].tolist()!r:.200}; use precision='double'."
            )
    counts = [line.size for line in lines]
    strides = [math.prod(source.cells[a + 1 :]) for a in range(len(counts))]
    tables.add_reals(
        "centres",
        np.concatenate(lines),
        "the centres of all axes; a circular one repeats its first, a period on",
    )
    if any(source.periods):
        tables.add_reals("periods", source.periods, "of each axis, 0: not circular")
    first = np.cumsum(counts) - counts
    tables.add_integers("first", first, "where the centres of each axis begin")
    tables.add_integers("counts", counts, "how many they are")
    tables.add_integers("cells", source.cells, "cells along each axis")
    tables.add_integers(
        "strides", strides, "cells from one to the next along each axis", None,
        ("int32_t", 4),
    )  # fmt: skip


def _add_values(tables: _Tables, source: Source) -> str:
    """What numbers the cell of whole-numbered observations; the type of these."""
    low = np.array([line[0] for line in source.lines], dtype=np.int64)
    high = np.array([line[-1] for line in source.lines], dtype=np.int64)
    wide = max(-low.min(), high.max()) > _INT32
    kind = ("int64_t", 8) if wide else ("int32_t", 4)
    tables.add_integers("lowest", low, "the range of each variable", None, kind)
    tables.add_integers("highest", high, "its other end", None, kind)
    tables.add_integers(
        "cells", source.cells, "values of each variable", None, ("int32_t", 4)
    )
    return kind[0]


def _add_columns(tables: _Tables, source: Source) -> None:
    tables.add_integers(
        "columns", source.best_columns, "the best action of each cell, from 0"
    )


def _add_levels(tables: _Tables, source: Source) -> str:
    """The table of a fuzzy policy, and the order of its ties; the type of ranks."""
    n_actions = source.n_actions
    levels, note = source.table.ravel(), "of each cell and action"
    if tables.number.type == "float":
        # A power of two changes no comparison, and keeps the levels within range.
        exponent = -int(np.frexp(np.abs(levels).max())[1])
        levels = np.ldexp(levels, exponent)
        note += f", times 2^{exponent}"
    tables.add_reals("levels", tables.number.rounded(levels), note, n_actions)
    rows, which = source.orders
    tables.add_integers("order", which, "which row of ranks each cell has")
    return tables.add_integers(
        "ranks", rows.ravel(), "orders of the actions, lower is preferred", n_actions
    )


def _add_neighbours(tables: _Tables, source: Source) -> None:
    """What real inputs are found from: of each cell itself, or of neighbouring actions."""
    grid = source.grid
    if grid is None:
        return
    if source.kind == "fuzzy":
        own = np.arange(source.n_actions)[:, None]
        for name, other in (("below", grid.below), ("above", grid.above)):
            tables.add_integers(
                name,
                np.where(other < 0, own, other).ravel(),
                f"the action {name} along each input; the same where there is none",
                grid.n_inputs,
            )
    else:
        inputs = tables.number.rounded(source.cell_inputs.ravel())
        tables.add_reals(
            "cell_inputs", inputs, "the inputs of each cell", grid.n_inputs
        )


def _stack(source: Source, number: Number) -> int:
    """Bytes of the arrays and numbers that the functions declare."""
    d, n_actions = len(source.cells), source.n_actions
    locate = 2 * number.bytes + 20
    if source.angles.pairs:
        locate += d * number.bytes + 4  # the variables, and the number of one
    if source.kind == "discrete":
        return 8
    if source.kind == "crisp":
        return locate + number.bytes + 16
    if source.grid is not None:
        locate += 10 * number.bytes + 16  # the parabola
    return locate + d * (8 + number.bytes) + (n_actions + 2) * number.bytes + 32


def _work(source: Source, number: Number) -> str:
    """How many operations of real numbers a call takes at most."""
    d = len(source.cells)
    if source.kind == "discrete":
        return f"{2 * d} comparisons of integers"
    angles = source.angles.pairs
    searches = sum((line.size - 1).bit_length() + 4 for line in source.lines)
    searches += 2 * source.angles.n_observed if angles else 0
    divisions = d + sum(period > 0 for period in source.periods)
    multiplications = sum(period > 0 for period in source.periods)
    if source.kind == "fuzzy":
        multiplications += 2**d * (d + source.n_actions)
        if source.grid is not None:
            divisions += 3 * source.grid.n_inputs
            multiplications += 9 * source.grid.n_inputs
    calls = ""
    if angles:
        plural = "s" if len(angles) > 1 else ""
        calls = f", {len(angles)} call{plural} of {number.atan2}"
    return (
        f"at most {searches} comparisons of real numbers to locate x, {divisions} "
        f"divisions,\n * {multiplications:,} multiplications{calls}"
    )


def _meanings(source: Source) -> list[str]:
    """What each number of an observation is, and which values it takes."""
    meanings = [""] * source.angles.n_observed
    for axis, column in enumerate(source.angles.columns):
        line, period = source.lines[axis], source.periods[axis]
        ends = f"{line[0]:.10g} to {line[-1]:.10g}"
        meanings[column] = f"centres {ends}"
        if source.kind == "discrete":
            meanings[column] = f"whole numbers {ends}"
        elif period:
            meanings[column] = f"circular, period {period!r}, any value"
    for cosine, sine in source.angles.pairs:
        meanings[cosine] = f"cosine of an angle, its sine is x[{sine}]"
        meanings[sine] = f"sine of the angle with cosine x[{cosine}]"
    return meanings


def _words(source: Source, number: Number) -> dict[str, Any]:
    """What the comment at the head says in words."""
    discrete = source.kind == "discrete"
    names = source.signals.observations if source.signals else ()
    observations = [
        sanitised(f"x[{i}]{f': {names[i]}' if names else ''}; {what}")
        for i, what in enumerate(_meanings(source))
    ]
    actions = []
    for column in range(source.n_actions):
        meaning = ""
        if source.signals is not None:
            pairs = zip(
                source.signals.inputs, source.signals.values[column], strict=True
            )
            meaning = "; ".join(f"{name} = {value!r}" for name, value in pairs)
        text = f"{source.first_action + column}  {meaning}".rstrip()
        actions.append(sanitised(text))
    beyond = "Values beyond the centres belong to the outermost cells."
    if discrete:
        beyond = "Other values have no action."
    rounding = "rounding to float"
    if source.angles.pairs:
        rounding += ", or that of atan2f,"
    exactness = (
        f"The actions are those of the Python policy, except where {rounding} moves an "
        "observation across a border between actions."
    )
    if discrete:
        exactness = "The actions are those of the Python policy."
    elif number.type == "double":
        exactness = (
            "The actions are those of the Python policy to the bit, if the compiler "
            "keeps to IEEE 754: -std=c99, or -ffp-contract=off where it fuses "
            "multiplication and addition."
        )
        if source.angles.pairs:
            exactness = (
                "The actions are those of the Python policy, except where atan2 of the "
                "C library and that of NumPy, which may differ in the last place, put an "
                "observation on different sides of a border between actions; all else is "
                "the same to the bit, if the compiler keeps to IEEE 754: -std=c99, or "
                "-ffp-contract=off where it fuses multiplication and addition."
            )
    cells = " x ".join(map(str, source.cells))
    return {
        "observations": observations,
        "actions": actions,
        "beyond": beyond,
        "invalid": "a value out of range"
        if discrete
        else "a value that is NaN or infinite",
        "exactness": textwrap.fill(exactness, 82).replace("\n", "\n * "),
        "made_of": f"{source.kind} cells, {cells}, {source.n_actions} actions, "
        f"{number.type if not discrete else 'integers'}",
    }
