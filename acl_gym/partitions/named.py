"""The partitions of the thesis's experiments, by name."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces

from acl_gym.partitions.grid import Crisp, Fuzzy, Grid
from acl_gym.utils import validation

TWO_PI = 2.0 * np.pi

_VELOCITY = (-2.0, 0.0, 2.0)
_REGULAR = (-5.0, -2.0, -0.3, -0.1, 0.0, 0.1, 0.3, 2.0, 5.0)
# Around the two regions of damping there are more of them.
_DAMPING_1 = (-5.0, -3.75, -2.0, -0.3, 0.0, 0.3, 2.0, 2.45, 3.5, 3.75, 4.7, 5.0)
_DAMPING_2 = (
    *(-5.0, -4.55, -3.5, -2.3, -2.0, -1.1, -0.6, -0.3),
    *(0.0, 0.3, 1.0, 2.6, 4.0, 5.0),
)

_NAVIGATION = {
    "regular": (_REGULAR, _VELOCITY, _REGULAR, _VELOCITY),
    "damping": (_DAMPING_1, _VELOCITY, _DAMPING_2, _VELOCITY),
}
"""Name -> centres of (c_1, v_1, c_2, v_2), in m and m/s."""


def pendulum(
    n_theta: int = 40,
    n_omega: int = 41,
    *,
    kind: type[Grid] = Fuzzy,
    omega_max: float = 9.0,
) -> Grid:
    """The evenly spread centres of the pendulum, (5.2) and (5.3).

    For a crisp partition take an even `n_theta` and an odd `n_omega`: both
    equilibria are then centres, and not the border of two bins, where the cell of a
    resting pendulum would chatter (§5.2.2).

    Args:
        n_theta: N_theta, centres of the angle in [0, 2 pi), >= 3; they go round.
        n_omega: N_omega, centres of the angular velocity, both ends included, >= 3.
        kind: `Crisp` or `Fuzzy`.
        omega_max: rad/s, > 0, as that of the environment.

    Returns:
        A partition of the states (theta, omega).

    Raises:
        TypeError: `kind` is not a kind of grid, or a number is no number.
        ValueError: a number is out of range.
    """
    checked_kind(kind)
    cells = [
        validation.integer("n_theta", n_theta, at_least=3),
        validation.integer("n_omega", n_omega, at_least=3),
    ]
    omega_max = validation.number("omega_max", omega_max, above=0)
    high = np.array([TWO_PI, omega_max])
    space = spaces.Box(np.array([0.0, -omega_max]), high, dtype=np.float64)
    return kind.from_box(space, cells, circular=[0])


def navigation(name: str, *, kind: type[Grid] = Fuzzy) -> Grid:
    """The centres of the two-dimensional navigation task with variable damping.

    With its 9 actions, `"regular"` (§4.5.2) has 729 cells and 6,561 pairs, and
    `"damping"` (§4.5.3), which is finer around the two regions of stronger damping,
    1,512 cells and 13,608 pairs.

    Args:
        name: `"regular"` or `"damping"`.
        kind: `Crisp` or `Fuzzy`.

    Returns:
        A partition of the states (c_1, v_1, c_2, v_2), in m and m/s.

    Raises:
        TypeError: `kind` is not a kind of grid.
        ValueError: there is no partition of that name.
    """
    checked_kind(kind)
    return kind(_NAVIGATION[validation.one_of("name", name, tuple(_NAVIGATION))])


def checked_kind(kind: Any) -> None:
    """Refuse what is not a kind of grid.

    Raises:
        TypeError: `kind` is not `Crisp`, `Fuzzy` or a class made from them.
    """
    if not (isinstance(kind, type) and issubclass(kind, (Crisp, Fuzzy))):
        raise TypeError(f"kind must be the class Crisp or Fuzzy, got {kind!r}.")
