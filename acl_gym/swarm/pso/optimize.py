"""Minimize a function with a particle swarm."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import OptimizeResult

from acl_gym.swarm.channel import Channel
from acl_gym.swarm.inbox import Inbox, checked_inbox
from acl_gym.swarm.pso.agents import ParticleSwarm
from acl_gym.swarm.pso.coefficients import ACCELERATION, INERTIA, Inertia
from acl_gym.swarm.pso.landscape import ExplosionError, Landscape
from acl_gym.swarm.topologies import Everyone, Ring, VonNeumann
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray

TOPOLOGIES: dict[str, type[Channel]] = {
    "global": Everyone,
    "ring": Ring,
    "von_neumann": VonNeumann,
}
"""Channels that have a name, see `minimize`."""

UPDATES = ("synchronous", "asynchronous")

ITERATIONS = 1_000
"""As many are made where nothing else is asked for."""

Callback = Callable[[OptimizeResult], Any]


def minimize(
    function: Callable[..., Any],
    bounds: Any,
    *,
    n_particles: int = 40,
    max_iterations: int | None = None,
    max_evaluations: int | None = None,
    target: float | None = None,
    tolerance: float | None = None,
    seed: int | np.random.Generator | None = None,
    x0: ArrayLike | None = None,
    inertia: Inertia = INERTIA,
    cognitive: ArrayLike = ACCELERATION,
    social: ArrayLike = ACCELERATION,
    topology: str | Channel = "von_neumann",
    boundary: str = "reflect",
    velocity_limit: ArrayLike | None = None,
    order: str = "standard",
    update: str = "synchronous",
    vectorized: bool = True,
    callback: Callback | None = None,
    history: bool = False,
) -> OptimizeResult:
    """Minimize a function of d variables by particle swarm optimization, §6.3.2.

    Particles move through the range of the variables. Each is attracted by the best point
    that it has found itself and by the best that its neighbors have found. No derivative
    is needed. Inertia and accelerations are by default those of Clerc and Kennedy (2002),
    see `constriction_coefficients`.

    `run(ParticleSwarm(..), Landscape(..), steps, seed, channel)` makes the same moves with
    the same bits, iteration by iteration. Agents of `run` observe at the beginning of a
    step, and the positions after the last one are not evaluated: K steps find what K - 1
    iterations find. Where a position gets farther away than 1e150, `run` ends with an
    `ExplosionError`, and a search as one that has exploded.

    Args:
        function: of an array of points `(n, d)`; returns their values, `(n,)`. Infinity is
            worse than every number, and NaN counts as infinity, with one warning.
        bounds: a pair (lower, upper) for each variable, or `scipy.optimize.Bounds`, see
            `Landscape`.
        n_particles: N, >= 1.
        max_iterations: how often the particles move, >= 0; `ITERATIONS` if neither this
            nor `max_evaluations` is given.
        max_evaluations: how many points are evaluated at most, >= `n_particles`. Whole
            iterations are made only, with `n_particles` evaluations each. Where there are
            as many particles as variables, the first call of a vectorized function has
            one point more, which is not counted, see `Landscape`.
        target: a value to reach, with which the search ends.
        tolerance: >= 0. The search ends when the values of all personal bests lie within
            so much of each other: the swarm has agreed. Infinite values agree about
            nothing. It needs two particles or more. None: the search goes on.
        seed: of the random numbers, or a generator; None draws one.
        x0: where the first particle or the first m particles begin, `(d,)` or `(m, d)`.
        inertia: w: a number, one for each particle, or a function of the iteration, see
            `Landscape`.
        cognitive: c1, >= 0, see `ParticleSwarm`.
        social: c2, >= 0, see `ParticleSwarm`.
        topology: who hears of whose best point: `"global"`, everyone of everyone's, which
            is fast and settles soon; `"ring"`, each of the two beside it, which takes
            longest and looks at most minima; `"von_neumann"`, each of the four beside it
            on a grid (a ring if `n_particles` is prime), between the two; or any
            `Channel`, such as `Radius(0.5)` or `Lossy(Ring(), 0.3)`.
        boundary: `"reflect"`, `"absorb"`, `"clip"` or `"none"`, see `Landscape`.
        velocity_limit: the largest absolute velocity, see `Landscape`.
        order: `"standard"`, or `"literal"` as (6.1) is printed. With the usual
            coefficients a swarm then explodes if `boundary="none"`, and within bounds it
            does not converge, see `Landscape`.
        update: `"synchronous"`, all particles move at once, or `"asynchronous"`, one after
            the other, each knowing what those before it have just found. `function` is
            then called with one point at a time, an array `(1, d)` if it is vectorized.
        vectorized: whether `function` takes many points at once. If not, it is called
            with one point `(d,)` at a time and returns a number.
        callback: called after each iteration with an `OptimizeResult` of `x`, `fun`,
            `nfev` and `nit` so far; the search ends if it returns True, Python's or
            NumPy's, or raises StopIteration, as in SciPy. (The callback of `run` is the
            other way round: that ends on False.)
        history: whether the result has a history.

    Returns:
        `x`, the best point, `(d,)`; `fun`, its value; `nfev`, the number of evaluations;
        `nit`, of iterations; `message`, why the search has ended; `success`: whether
        `fun` is finite, and at most `target` if there is one, and the swarm has not
        exploded. With `history=True` also `history`, a dict of arrays `(nit + 1,)`:
        `nfev` and `fun` so far, and `spread`, the root mean square distance of the
        particles from their centre.

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: an argument is out of range, or the function returns anything but a
            number for each point.

    Example:
        >>> result = minimize(lambda x: (x**2).sum(axis=1), [(-5, 5)] * 3, seed=0)
        >>> bool(result.fun < 1e-20)
        True
    """
    landscape = Landscape(
        function,
        bounds,
        n_particles=n_particles,
        x0=x0,
        inertia=inertia,
        boundary=boundary,
        velocity_limit=velocity_limit,
        order=order,
        vectorized=vectorized,
    )
    search = _Search(landscape, ParticleSwarm(cognitive, social), _channel_of(topology))
    search.asynchronous = validation.one_of("update", update, UPDATES) == "asynchronous"
    iterations = _iterations(max_iterations, max_evaluations, landscape.n_particles)
    if target is not None:
        target = validation.number("target", target)
    if tolerance is not None:
        tolerance = validation.number("tolerance", tolerance, at_least=0)
        if landscape.n_particles == 1:
            raise ValueError(
                "n_particles must be at least 2 with a tolerance, got 1, which always "
                "agrees with itself; use more particles, or target."
            )
    if callback is not None and not callable(callback):
        raise TypeError(
            "callback must be a function of an OptimizeResult, got "
            f"{validation.shown(callback)}."
        )
    history = validation.boolean("history", history)
    if not isinstance(seed, np.random.Generator):
        seed = np.random.default_rng(validation.seed(seed))

    search.begin(seed)
    rows = [search.row()] if history else []
    exploded = False
    while not (message := search.end(iterations, target, tolerance)):
        try:
            search.iterate(seed)
        except ExplosionError as error:
            message, exploded = str(error), True
            break
        if history:
            rows.append(search.row())
        if callback is not None and _stops(callback, search.result()):
            message = "The callback has ended the search."
            break
    result = search.result()
    found = math.isfinite(result.fun)
    if not found:
        message += f" {_why_not_finite(result)}"
    result.message = message
    result.success = found and not exploded and (target is None or result.fun <= target)
    if history:
        names = ("nfev", "fun", "spread")
        result.history = {
            name: np.array(column)
            for name, column in zip(names, zip(*rows, strict=True), strict=True)
        }
    return result


def _why_not_finite(result: OptimizeResult) -> str:
    """What a message says of a least value that is infinite."""
    if result.fun > 0:
        return (
            "The function must be finite at some point, got inf or NaN at all "
            f"{result.nfev} points; change the bounds, or give an x0 where it is finite."
        )
    return (
        f"The least value must be finite, got -inf at x = {validation.shown(result.x)}; "
        "change the bounds so that the function has a minimum, or let it return inf "
        "where it is not defined."
    )


class _Search:
    """A swarm in its landscape, iteration by iteration: `run` with an end in sight."""

    asynchronous = False

    def __init__(
        self, landscape: Landscape, agents: ParticleSwarm, channel: Channel
    ) -> None:
        self.landscape, self.agents, self.channel = landscape, agents, channel
        self.nit = 0

    def begin(self, rng: np.random.Generator) -> None:
        """Evaluate the initial positions."""
        self.landscape.reset(rng)
        self.agents.reset(self.landscape.n, rng)
        self.channel.reset(self.landscape.n)
        self.agents.observe(self.landscape.observe())

    def iterate(self, rng: np.random.Generator) -> None:
        """Move all particles, and evaluate where they are."""
        agents, landscape = self.agents, self.landscape
        delivered = self.channel.deliver(agents.send(), landscape.positions, rng)
        inbox = checked_inbox(delivered, self.channel, landscape.n)
        if self.asynchronous:
            self._move_in_turn(inbox, rng)
        else:
            agents.hear(inbox)
            landscape.begin_iteration()
            landscape.move(slice(None), agents.decide(rng))
            agents.observe(landscape.observe())
        self.nit += 1

    def _move_in_turn(self, inbox: Inbox, rng: np.random.Generator) -> None:
        """Let the particles hear, move and evaluate one after the other.

        The inbox holds the arrays in which the agents keep their bests, so that what one
        has found is there for the next one, unless the channel delays it.
        """
        agents, landscape = self.agents, self.landscape
        uniforms = agents.draw(rng)
        landscape.begin_iteration()
        u = np.empty((1, landscape.space.d))
        for i in range(landscape.n):
            rows = slice(i, i + 1)
            agents.hear(inbox)
            agents.attract(rows, landscape.positions[rows], uniforms, u)
            landscape.move(rows, u)
            agents.remember(rows, landscape.evaluate(rows))

    def end(
        self, iterations: int, target: float | None, tolerance: float | None
    ) -> str:
        """Say why the search is over, or nothing."""
        values = self.agents.best_values
        if target is not None and values.min() <= target:
            return "The target was reached."
        if (
            tolerance is not None
            and math.isfinite(values.min())
            and values.max() <= values.min() + tolerance < math.inf
        ):
            return "All personal bests lie within the tolerance."
        if self.nit == iterations:
            return f"All {iterations} iterations were made."
        return ""

    def result(self) -> OptimizeResult:
        """The best point so far."""
        best = int(self.agents.best_values.argmin())
        return OptimizeResult(
            x=self.agents.best_positions[best].copy(),
            fun=float(self.agents.best_values[best]),
            nfev=self.landscape.objective.evaluations,
            nit=self.nit,
        )

    def row(self) -> tuple[int, float, float]:
        """What the history holds of an iteration."""
        return (
            self.landscape.objective.evaluations,
            float(self.agents.best_values.min()),
            _spread(self.landscape.positions),
        )


def _spread(positions: FloatArray) -> float:
    """The root mean square distance of points from their centre."""
    # Scaled, because squares overflow long before positions do.
    scale = float(np.abs(positions).max())
    if scale == 0.0:
        return 0.0
    scaled = positions / scale
    squares = (scaled - scaled.mean(axis=0)) ** 2
    return scale * math.sqrt(squares.sum(axis=1).mean())


def _channel_of(topology: Any) -> Channel:
    if isinstance(topology, Channel):
        return topology
    if isinstance(topology, str):
        return TOPOLOGIES[validation.one_of("topology", topology, TOPOLOGIES)]()
    raise TypeError(
        f"topology must be one of {', '.join(map(repr, TOPOLOGIES))}, or a Channel, such "
        f"as Radius(0.5), got {validation.shown(topology)}."
    )


def _iterations(
    max_iterations: int | None, max_evaluations: int | None, n_particles: int
) -> int:
    """How many iterations may be made."""
    allowed = []
    if max_iterations is not None:
        allowed.append(validation.integer("max_iterations", max_iterations, at_least=0))
    if max_evaluations is not None:
        most = validation.integer("max_evaluations", max_evaluations, at_least=1)
        if most < n_particles:
            raise ValueError(
                "max_evaluations must be at least n_particles, because the first "
                f"positions are evaluated, got {most} for {n_particles} particles; pass "
                "more evaluations or fewer particles."
            )
        allowed.append(most // n_particles - 1)
    return min(allowed, default=ITERATIONS)


def _stops(callback: Callback, result: OptimizeResult) -> bool:
    try:
        answer = callback(result)
    except StopIteration:
        return True
    return isinstance(answer, (bool, np.bool_)) and bool(answer)
