"""Partitions for an environment: those of the thesis, and one for any environment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.vector import VectorWrapper

from acl_gym.envs.control.lookup import system_of
from acl_gym.envs.control.system import ControlSystem
from acl_gym.envs.wrappers.perturbations import HiddenVariables
from acl_gym.partitions.base import Partition
from acl_gym.partitions.bounds import Env, complete_bounds, observation_space, real_box
from acl_gym.partitions.discrete import FINITE_SPACES, Discrete
from acl_gym.partitions.grid import Fuzzy, Grid, checked_kind
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray

CENTRES = {1: 101, 2: 41, 3: 15, 4: 7, 5: 5, 6: 3}
"""Number of variables -> centres of each."""


def thesis_partition(
    env: Env, cells: Any = None, *, kind: type[Grid] = Fuzzy
) -> Partition:
    """Build the partition that the thesis uses for an environment of this package.

    Args:
        env: a single or a vector environment of this package. Wrappers may perturb or
            hide variables (`HiddenVariables`), but not transform them.
        cells: which centres: what the system's `thesis_centres` takes, such as
            (40, 41) for the pendulum and "regular" or "damping" for the navigation, or
            the centres themselves, one increasing sequence for each variable that is
            observed. None takes the default of the system.
        kind: `Fuzzy` or `Crisp`; for observations that are not cells already.

    Returns:
        `Discrete` where a state is a cell, otherwise a partition of that kind; the
        circular variables are those of the system.

    Raises:
        TypeError: `env` is not an environment of this package, or `kind` or a number
            in `cells` has the wrong type.
        ValueError: there are no such centres, or a wrapper transforms the variables.
    """
    space = observation_space(env)
    checked_kind(kind)
    system = system_of(env)
    if system is None:
        raise TypeError(
            "env must be a control environment of this package, got "
            f"{validation.shown(env)}; use "
            "automatic_partition(env) for others."
        )
    if isinstance(space, FINITE_SPACES):
        if cells is not None:
            raise ValueError(
                "cells must be None where observations are cells already, got "
                f"{validation.shown(cells)} for {space}."
            )
        return Discrete.from_space(space)
    shown = _shown_variables(env, system)
    if _are_centres(cells):
        centres = list(cells)
        if len(centres) != len(shown):
            raise ValueError(
                f"cells must hold the centres of {len(shown)} variables, got "
                f"{len(centres)} sequences."
            )
    else:
        named = system.thesis_centres(cells)
        if named is None:
            raise ValueError(
                f"the thesis has no centres for {type(system).__name__}; give them in "
                "cells, one sequence for each variable, or use "
                "automatic_partition(env)."
            )
        centres = [named[variable] for variable in shown]
    full = real_box(system.observation_space)
    periods = [
        float(full.high[variable] - full.low[variable])
        if variable in system.circular
        else None
        for variable in shown
    ]
    return kind(centres, periods)


def automatic_partition(
    env: Env,
    *,
    kind: type[Grid] = Fuzzy,
    cells: int | Sequence[int] | None = None,
    bounds: Mapping[int, tuple[float, float]] | None = None,
    random_steps: int | None = None,
    seed: int = 0,
) -> Partition:
    """Choose a partition for the observations of an environment.

    - `Discrete`, `MultiDiscrete` and `MultiBinary` observations are cells already.
    - The systems of the thesis get its centres, see `thesis_partition`, if these reach
      to the bounds of the variables.
    - Other Boxes of one axis get evenly spaced centres, both ends included. The more
      variables, the fewer for each (a decision): 101 for one variable, 41 for
      two, as in (5.3), 15 for three, 7 for four, 5 for five, 3 for six. This limits
      partitions to a few thousand cells. The numbers are odd, so that the middle of the
      range is a centre. A variable that this package's environments declare circular
      has one centre more, so that each centre has an opposite one.

    The system behind an `AsyncVectorEnv`, or behind a wrapper that changes the
    observations, is unknown here; no variable of such an environment is circular.

    This is a start, not the best partition for a task: give `cells` where a variable
    needs more of them, and `refine` it around a narrow goal.

    Args:
        env: a vector environment or a single one.
        kind: `Fuzzy` or `Crisp`; for observations that are not cells already.
        cells: number of centres, for all variables or for each; None follows the
            rule above.
        bounds: variable -> (low, high), in place of the bounds of the space; for
            variables that have none, or to leave out regions that are never visited.
            States beyond the bounds belong to the outermost cells.
        random_steps: estimate the bounds of variables that have none from this many
            random steps, see `estimate_bounds`. The environment is reset and stepped,
            unless all variables have bounds.
        seed: of those steps.

    Raises:
        TypeError: `env` is not an environment, or its observations are of a kind that
            has no cells, such as Dict, Tuple or Text.
        ValueError: a variable has no bounds, there are more than six variables or
            more than one axis, or an argument does not fit the observations.
    """
    space = observation_space(env)
    checked_kind(kind)
    if isinstance(space, FINITE_SPACES):
        if cells is not None or bounds is not None:
            raise ValueError(
                "cells and bounds must be None where observations are cells already, "
                "got cells="
                f"{validation.shown(cells)} and bounds={validation.shown(bounds)} "
                f"for {space}."
            )
        return Discrete.from_space(space)
    box = real_box(space)
    system = system_of(env)
    if system is not None and system.observation_space != space:
        system = None  # a wrapper has changed what is observed
    if cells is None and bounds is None and system is not None:
        centres = system.thesis_centres()
        if centres is not None and _span(centres, system.circular, box):
            return thesis_partition(env, kind=kind)
    circular = () if system is None else system.circular
    number = centres_for(CENTRES, box.low.size) if cells is None else 0
    low, high = complete_bounds(env, box, bounds, circular, random_steps, seed)
    if cells is None:
        # One centre is enough for a variable that cannot change.
        cells = [
            number + (axis in circular) if low[axis] < high[axis] else 1
            for axis in range(low.size)
        ]
    return kind.from_box(spaces.Box(low, high, dtype=np.float64), cells, circular)


def centres_for(table: Mapping[int, int], dimensions: int) -> int:
    """The number of centres of each variable.

    Args:
        table: number of variables -> number of centres.
        dimensions: how many variables there are.

    Raises:
        ValueError: there are more than in the table.
    """
    if dimensions not in table:
        raise ValueError(
            f"observations must have 1 to {max(table)} variables for an automatic "
            f"partition, got {dimensions}: cells grow as n^d, and a fuzzy state "
            f"belongs to 2^d = {2**dimensions} of them; choose a few features with "
            "gymnasium.wrappers.TransformObservation, or give cells, such as 1 for "
            "each variable that does not matter."
        )
    return table[dimensions]


def _shown_variables(env: Any, system: ControlSystem) -> list[int]:
    """The variables of a system that are observed through its wrappers, in order."""
    full = real_box(system.observation_space)
    shown = list(range(full.low.size))
    wrappers = []
    while isinstance(env, (gym.Wrapper, VectorWrapper)):
        wrappers.append(env)
        env = env.env
    for wrapper in reversed(wrappers):
        if isinstance(wrapper, HiddenVariables):
            shown = [shown[i] for i in wrapper.shown]
    space = observation_space(wrappers[0] if wrappers else env)
    if space != spaces.Box(full.low[shown], full.high[shown], dtype=full.dtype.type):
        raise ValueError(
            "env must show variables of its system as they are, got observations "
            f"from {space} of the system's {full}; use automatic_partition(env), or "
            "leave out the wrapper that transforms them."
        )
    return shown


def _are_centres(cells: Any) -> bool:
    """Whether `cells` are sequences of centres rather than their numbers or a name."""

    def is_list(value: Any) -> bool:
        return isinstance(value, Sequence | np.ndarray) and not isinstance(value, str)

    return is_list(cells) and len(cells) > 0 and all(map(is_list, cells))


def _span(
    centres: Sequence[FloatArray], circular: Sequence[int], box: spaces.Box
) -> bool:
    """Whether the outermost centres are the bounds of `box`."""
    return all(
        axis in circular or (line[0] == box.low[axis] and line[-1] == box.high[axis])
        for axis, line in enumerate(centres)
    )
