"""The minds of a particle swarm: personal bests, messages, attraction."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acl_gym.swarm.inbox import Inbox
from acl_gym.swarm.protocols import DynamicAgents
from acl_gym.swarm.pso import kernels
from acl_gym.swarm.pso.coefficients import ACCELERATION, of_each_particle
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray


class ParticleSwarm(DynamicAgents):
    """The dynamic agents A_i of particle swarm optimization, §6.3.2.

    Each remembers the best point that it has found, tells it to those who hear it, and
    is attracted by it and by the best of those that it hears of:

        u_i = c1 r1 (theta_pbest - theta_i) + c2 r2 (theta_lbest - theta_i)      (6.3)

    - y_i = [F(theta_i), theta_i], from `Landscape.observe`.
    - z_i: theta_pbest, its value, and theta_lbest. The personal best is over all time.
      The text says so as well, but its formula compares the last two steps only.
    - v_i: theta_pbest and its value. The thesis sends F(theta_i) with it, the value of
      the present point, which says nothing about theta_pbest.
    - theta_lbest is the best point in the messages w_i of this step, so the channel
      decides whether the particle's own is among them. It is theta_pbest where nothing
      was heard.
    - r1 and r2 are uniform on [0, 1), drawn for each particle and each variable.

    The lower a value, the better, where the thesis maximizes a fitness.

    Args:
        cognitive: c1, >= 0, the attraction by the personal best; a number, or one for
            each particle.
        social: c2, >= 0, the attraction by the local best; likewise.

    Attributes:
        best_values: F(theta_pbest), `(n,)`; infinite until a point was observed.
        best_positions: theta_pbest, `(n, d)`.

    Raises:
        ValueError: an argument is out of range.
    """

    def __init__(
        self, cognitive: ArrayLike = ACCELERATION, social: ArrayLike = ACCELERATION
    ) -> None:
        self.cognitive = cognitive
        self.social = social
        for name, value in (("cognitive", cognitive), ("social", social)):
            of_each_particle(name, value, np.size(value), at_least=0)

    def reset(self, n: int, rng: np.random.Generator) -> None:
        """Forget all bests; see `DynamicAgents.reset`. Nothing is drawn."""
        self._c1 = of_each_particle("cognitive", self.cognitive, n, at_least=0)
        self._c2 = of_each_particle("social", self.social, n, at_least=0)
        self.best_values = np.full(n, np.inf)
        self.best_positions = np.empty((n, 0))
        self._position = self._heard = self.best_positions
        self._uniforms = np.empty((n, 2, 0))
        self._chosen = np.full(n, -1)

    def observe(self, y: dict[str, FloatArray]) -> None:
        """Replace personal bests by present points that are better.

        Args:
            y: see `Landscape.observe`.

        Raises:
            TypeError: it is no dict.
            ValueError: it does not hold a value and a position of each particle.
        """
        n, d = self.best_positions.shape
        value, position = _observed(y, n, d or None)
        self._position = position
        if d == 0:  # the first observation
            self.best_positions = position.copy()
            self._heard = self.best_positions
            self._uniforms = np.empty((n, 2, position.shape[1]))
        kernels.remember_best(value, position, self.best_values, self.best_positions)

    def remember(self, rows: slice, y: dict[str, FloatArray]) -> None:
        """Replace the personal bests of some particles, see `observe`.

        Args:
            rows: which.
            y: what they observe, a row for each.

        Raises:
            TypeError: it is no dict.
            ValueError: it does not hold a value and a position of each of them.
        """
        values, positions = self.best_values[rows], self.best_positions[rows]
        kernels.remember_best(*_observed(y, *positions.shape), values, positions)

    def send(self) -> dict[str, NDArray[Any]]:
        """The personal bests: `value`, `(n,)`, and `position`, `(n, d)`."""
        return {"value": self.best_values, "position": self.best_positions}

    def hear(self, inbox: Inbox) -> None:
        """Find the local bests.

        Raises:
            ValueError: the messages are not those of `send` of as many particles.
        """
        best = inbox.best("value")
        position = _rows("message 'position'", inbox.message("position"))
        if position.shape != self.best_positions.shape or best.shape != (
            len(position),
        ):
            raise ValueError(
                "message 'position' must have the shape "
                f"{self.best_positions.shape}, a point from each particle, got "
                f"{position.shape} from {inbox.links.n}; let the channel deliver what "
                "was sent."
            )
        kernels.choose_local_best(best, inbox.messages["value"], self._chosen)
        self._heard = position

    def decide(self, rng: np.random.Generator) -> FloatArray:
        """Draw r1 and r2, and return u, `(n, d)`."""
        u = np.empty(self._position.shape)
        # All shapes were checked when these arrays were taken in.
        kernels.attract(
            self._position,
            self.best_positions,
            self._chosen,
            self._heard,
            self._c1,
            self._c2,
            self.draw(rng),
            u,
        )
        return u

    def draw(self, rng: np.random.Generator) -> FloatArray:
        """Draw r1 and r2 of an iteration, `(n, 2, d)`, valid until the next call."""
        rng.random(out=self._uniforms)
        return self._uniforms

    def attract(
        self, rows: slice, position: FloatArray, uniforms: FloatArray, u: FloatArray
    ) -> None:
        """Write into `u` what the bests add to the velocities of some particles.

        Args:
            rows: which.
            position: where they are, a row for each.
            uniforms: r1 and r2 of all particles, `(n, 2, d)`.
            u: a row for each.

        Raises:
            ValueError: the arrays do not have these shapes.
        """
        shape = position.shape
        n, d = self.best_positions.shape
        if (
            self.best_positions[rows].shape != shape
            or u.shape != shape
            or uniforms.shape != (n, 2, d)
        ):
            raise ValueError(
                "position and u must have the shape "
                f"{self.best_positions[rows].shape}, and uniforms {(n, 2, d)}, got "
                f"{shape}, {u.shape} and {uniforms.shape}."
            )
        kernels.attract(
            position,
            self.best_positions[rows],
            self._chosen[rows],
            self._heard,
            self._c1[rows],
            self._c2[rows],
            uniforms[rows],
            u,
        )


def _observed(y: Any, n: int, d: int | None) -> tuple[FloatArray, FloatArray]:
    """The values and positions that n particles observe, checked, for kernels.

    Args:
        y: see `Landscape.observe`.
        n: how many particles.
        d: how many variables; None: any number >= 1.

    Raises:
        TypeError: it is no dict.
        ValueError: it does not hold such arrays.
    """
    if not isinstance(y, dict) or "value" not in y or "position" not in y:
        got = sorted(map(str, y)) if isinstance(y, dict) else validation.shown(y)
        kind = ValueError if isinstance(y, dict) else TypeError
        raise kind(
            "particles must observe a dict with 'value' and 'position', as of a "
            f"Landscape, got {got}; use a Landscape as environment, or let yours return "
            "both."
        )
    value, position = _rows("'value'", y["value"]), _rows("'position'", y["position"])
    columns = position.shape[-1] if d is None else d
    if value.shape != (n,) or position.shape != (n, columns) or columns == 0:
        raise ValueError(
            f"particles must observe 'value' of shape ({n},) and 'position' of shape "
            f"({n}, {'d' if d is None else d}), a row for each, got shapes {value.shape} and "
            f"{position.shape}."
        )
    return value, position


def _rows(name: str, rows: Any) -> FloatArray:
    """An array of numbers as kernels take it, not copied if it is one already."""
    if type(rows) is np.ndarray and rows.dtype.kind == "f" and rows.ndim:
        return validation.float64(rows)
    array = validation.as_array(rows)
    if array is None or array.dtype.kind not in "biuf" or array.ndim == 0:
        raise ValueError(
            f"{name} must be real numbers with a row for each particle, got "
            f"{validation.shown(rows)}."
        )
    return validation.float64(array)
