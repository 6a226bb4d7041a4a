"""The two halves of a swarm of moving agents: their environment, and their minds."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from acl_gym.swarm.inbox import Inbox
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray


class Environment(ABC):
    """The particles of a swarm and the process, Definitions 6.1, 6.4 and 6.5.

    The channel, which the thesis counts among the environment's parts, is given to `run`
    on its own, so that it can be exchanged.

    A subclass keeps the states of all particles in `x` and the state psi of the process
    in attributes of its own. It draws random numbers from the generator that it is
    given, and from nowhere else.

    Attributes:
        x: the states x_i of the particles, `(n, d)`; there after the first `reset`.
    """

    x: FloatArray

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            kind = type(self).__name__
            message = f"{kind!r} object has no attribute {name!r}"
            if name == "x":
                message += (
                    "; agents have states after the first reset, which must set x, or "
                    "in a run"
                )
            # Python comes here as well where a property has raised an AttributeError,
            # and drops that one. Asked once more, the property says what it lacks.
            asked = getattr(type(self), name, None)
            if isinstance(asked, property) and asked.fget is not None:
                return asked.fget(self)
            raise AttributeError(message, name=name, obj=self)

    @property
    def n(self) -> int:
        """The number of agents N.

        Raises:
            ValueError: `x` does not have a row for each agent.
        """
        states = validation.as_array(self.x)
        if states is None or states.ndim == 0:
            raise ValueError(
                "x must be an array with a row for each agent, got "
                f"{validation.shown(self.x)}; let reset of {type(self).__name__} set it."
            )
        return len(states)

    @property
    def positions(self) -> FloatArray:
        """Where the agents are, `(n, dim)`, by which channels say who hears whom.

        By default `x`; to be overridden where that holds more than positions.
        """
        return self.x

    @property
    def done(self) -> bool:
        """Whether the run is over; by default never."""
        return False

    @abstractmethod
    def reset(self, rng: np.random.Generator) -> None:
        """Put all particles and the process into an initial state.

        Args:
            rng: the generator of the run.
        """

    @abstractmethod
    def observe(self) -> Any:
        """Return y_i of all agents: an array `(n, ...)`, or a dict of such arrays.

        Agents keep what they are given: return copies, or arrays that are replaced and
        not changed.
        """

    @abstractmethod
    def step(self, u: Any, rng: np.random.Generator) -> None:
        """Move the particles (g) and the process (f) by one time step.

        Args:
            u: u_i of all agents, as `DynamicAgents.decide` has returned it.
            rng: the generator of the run.
        """


class DynamicAgents(ABC):
    """The minds of all moving agents, Definition 6.2, as arrays with a row for each.

    The thesis has one transition z_i <- h_i(z_i, y_i, w_i). Here it has two parts with
    the message v_i = phi_i(z_i) between them, so that an agent sends what it has just
    observed: `observe`, `send`, `hear`. Then `decide` draws u_i from pi_i(z_i, y_i, .).

    A swarm is heterogeneous (Definition 6.8) if parameters are arrays with a value for
    each agent.
    """

    @abstractmethod
    def reset(self, n: int, rng: np.random.Generator) -> None:
        """Begin with n agents that know nothing.

        Args:
            n: the number of agents N.
            rng: the generator of the run, for initial states z_i that are drawn.
        """

    @abstractmethod
    def observe(self, y: Any) -> None:
        """Take in the observations y_i; the first part of h_i.

        Args:
            y: as `Environment.observe` has returned them.
        """

    def send(self) -> dict[str, NDArray[Any]]:
        """Return the messages v_i = phi_i(z_i), name -> `(n, ...)`; by default none."""
        return {}

    def hear(self, inbox: Inbox) -> None:  # noqa: B027
        """Take in the messages w_i; the second part of h_i, by default nothing.

        Args:
            inbox: what has arrived. Its arrays may be those that `send` has returned:
                copy what is to be changed, or the agents' own state changes with it.
        """

    @abstractmethod
    def decide(self, rng: np.random.Generator) -> Any:
        """Draw the inputs u_i, the only place where agents are random: pi_i.

        Args:
            rng: the generator of the run.

        Returns:
            An array `(n, ...)`, as the environment takes it.
        """
