"""Run a swarm of moving agents: Figure 6.1, step by step."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acl_gym.swarm.channel import Channel
from acl_gym.swarm.inbox import checked_inbox
from acl_gym.swarm.protocols import DynamicAgents, Environment
from acl_gym.swarm.rows import check_messages, checked_positions
from acl_gym.swarm.topologies import Everyone
from acl_gym.utils import validation

Callback = Callable[[int, DynamicAgents, Environment], Any]
"""What `run` calls after each step: `(steps made, agents, environment)`. A function that
returns False, Python's or NumPy's, ends the run; with anything else, None as well, it goes
on. The callback of `minimize` is the other way round, as in SciPy: there True is the end."""


@dataclass
class History:
    """What a run came to.

    Attributes:
        steps: how many steps were made.
        done: whether the environment has ended the run.
        recorded: what was recorded, name -> `(steps + 1, ...)`: the initial value, and
            that after each step.
    """

    steps: int = 0
    done: bool = False
    recorded: dict[str, NDArray[Any]] = field(default_factory=dict)

    def __getitem__(self, name: str) -> NDArray[Any]:
        """What was recorded under a name.

        Raises:
            KeyError: nothing was.
        """
        try:
            return self.recorded[name]
        except (KeyError, TypeError):
            raise KeyError(
                f"{validation.shown(name)} must be among the recorded names, got "
                f"{sorted(self.recorded)}; pass record=(...) with it to run."
            ) from None


def run(
    agents: DynamicAgents,
    environment: Environment,
    steps: int,
    rng: np.random.Generator | int | None = None,
    channel: Channel | None = None,
    *,
    stale: bool = False,
    record: Collection[str] = (),
    callback: Callback | None = None,
) -> History:
    """Let a swarm of moving agents run from its initial state.

    In each step all agents observe the environment, send messages, hear what the channel
    delivers, and decide on their inputs, by which particles and process then move. What
    the last step leads to is not observed: of a particle swarm the last positions are not
    evaluated.

    Args:
        agents: the dynamic agents A_i.
        environment: their particles P_i and the process.
        steps: the most steps to make, >= 0; the environment may be done before.
        rng: the generator of all random numbers of the run, or its seed; None draws one.
        channel: the channel C; None takes `Everyone()`.
        stale: let messages be as old as in Definition 6.2: z_i(k + 1) = h_i(z_i(k),
            y_i(k), w_i(k)), where w_i(k) comes from v_j(k) = phi_j(z_j(k)). Agents then
            send before they observe, and so hear what others knew in the step before. In
            the first step, in which they know nothing before, they observe first. The
            rest of the definition is left out: it draws u_i(k) from pi_i(z_i(k), y_i(k)),
            so that an input, too, cannot depend on what was heard in its step. Here
            agents always decide last, by z_i(k + 1).
        record: names of arrays or numbers to record, which are attributes of the
            environment and keep their shape, such as `("x",)`.
        callback: called after each step; the run ends if it returns False, see
            `Callback`.

    Returns:
        How many steps were made, and what was recorded.

    Raises:
        TypeError: an argument is of the wrong kind.
        ValueError: an argument is out of range; a position is NaN, infinite or farther
            away than 1e150, which is an `acl_gym.swarm.pso.ExplosionError` in a
            `Landscape`; or the channel delivers to another number of agents.
    """
    steps = validation.integer("steps", steps, at_least=0)
    channel = Everyone() if channel is None else channel
    _check_kinds(agents, environment, channel, record, callback)
    stale = validation.boolean("stale", stale)
    if not isinstance(rng, np.random.Generator):
        rng = np.random.default_rng(validation.seed(rng, "rng"))

    environment.reset(rng)
    n = environment.n
    positions = checked_positions(environment.positions, n)
    agents.reset(n, rng)
    channel.reset(n)
    history = History(done=bool(environment.done))
    series: dict[str, list[NDArray[Any]]] = {name: [] for name in record}
    _record(environment, series)
    while history.steps < steps and not history.done:
        if stale and history.steps > 0:
            sent = _copied(agents.send(), n)  # observing may change the same arrays
            agents.observe(environment.observe())
        else:
            agents.observe(environment.observe())
            sent = agents.send()
        delivered = channel.deliver(sent, positions, rng)
        agents.hear(checked_inbox(delivered, channel, n))
        environment.step(agents.decide(rng), rng)
        positions = checked_positions(environment.positions, n)
        history.steps += 1
        history.done = bool(environment.done)
        _record(environment, series)
        if callback is not None and _ends(callback(history.steps, agents, environment)):
            break
        if callback is not None:  # which may have moved agents
            positions = checked_positions(environment.positions, n)
    history.recorded = {name: np.stack(rows) for name, rows in series.items()}
    return history


def _check_kinds(
    agents: Any, environment: Any, channel: Any, record: Any, callback: Any
) -> None:
    kinds = {
        "agents": (agents, DynamicAgents),
        "environment": (environment, Environment),
        "channel": (channel, Channel),
    }
    for name, (given, kind) in kinds.items():
        if not isinstance(given, kind):
            raise TypeError(
                f"{name} must be an object of a subclass of {kind.__name__}, got "
                f"{validation.shown(given)}."
            )
    names = validation.elements(record)
    if names is None or not all(isinstance(name, str) for name in names):
        raise TypeError(
            'record must be a collection of names, such as ("x",), got '
            f"{validation.shown(record)}."
        )
    if callback is not None and not callable(callback):
        raise TypeError(
            "callback must be a function of (step, agents, environment), got "
            f"{validation.shown(callback)}."
        )


def _record(environment: Environment, series: dict[str, list[NDArray[Any]]]) -> None:
    for name, rows in series.items():
        kind = type(environment).__name__
        try:
            value = getattr(environment, name)
        except AttributeError:
            raise ValueError(
                f"record must name attributes of {kind}, such as 'x', got {name!r}; use "
                "callback to look at anything else."
            ) from None
        array = validation.as_array(value)
        if array is None or array.dtype.kind == "O":
            raise ValueError(
                f"record must name arrays or numbers, such as 'x', got {name!r}, which is "
                f"{validation.shown(value)}; use callback to look at anything else."
            )
        if rows and array.shape != rows[0].shape:
            raise ValueError(
                f"record must name arrays that keep their shape, got {name!r}, whose "
                f"shape was {rows[0].shape} and is now {array.shape}; use callback to "
                "look at it."
            )
        rows.append(array.copy())


def _copied(messages: dict[str, NDArray[Any]], n: int) -> dict[str, NDArray[Any]]:
    check_messages(messages, n)
    return {name: np.array(rows) for name, rows in messages.items()}


def _ends(answer: Any) -> bool:
    """Whether a callback has returned False, Python's or NumPy's."""
    return isinstance(answer, (bool, np.bool_)) and not answer
