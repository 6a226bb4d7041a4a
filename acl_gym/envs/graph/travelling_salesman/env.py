"""The travelling salesman problem of §2.4.1 as environments, single and vector."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode

from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.control.single import ControlEnv
from acl_gym.envs.graph.instances import TravellingSalesmanInstance
from acl_gym.envs.graph.travelling_salesman.system import (
    TravellingSalesman,
    instance_of,
)
from acl_gym.envs.limits import RegisteredLimit
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray, IntArray

_PAINTER = "acl_gym.envs.graph.travelling_salesman.painter:TravellingSalesmanPainter"


class _WithInstance:
    """What both environments tell of their instance.

    Attributes:
        instance: the cities and the distances between them.
    """

    instance: TravellingSalesmanInstance

    @property
    def distances(self) -> FloatArray:
        """From each city (row) to each other (column), `(n, n)`, read-only."""
        return self.instance.distances

    @property
    def coordinates(self) -> FloatArray | None:
        """Of the cities, `(n, 2)`, read-only; None if unknown."""
        return self.instance.coordinates

    @property
    def optimum(self) -> float | None:
        """The length of a shortest tour; None if unknown."""
        return self.instance.optimum


class TravellingSalesmanEnv(_WithInstance, ControlEnv):
    """Visit all cities once and come back to the first, on a short way.

    ## Description
    The travelling salesman problem (§2.4.1), on which ant colony optimization began: the
    cities are the vertices of the construction graph, and an ant walks from one to the
    next until it is back in the first, having visited each once. The closing arc is a
    step like the others. Short tours are found by ants that share what they learn about
    arcs; what a single ant sees, the city where it is, does not tell where it has been.

    ## Action Space
    `Discrete(48)`: the next city, of those that have not been visited, in the last step
    the first city (`info["action_mask"]`, int8). Any other action is an error.

    ## Observation Space
    `Discrete(48)`: the city where the ant is, so that a table over observations and
    actions has an entry for each arc.

    ## Rewards
    Minus the distance. The return is minus the length of the tour.

    ## Starting State
    Uniform over the cities, or the city `start`.

    ## Episode End
    Terminated after n steps, back in the first city; `info["is_success"]` is then true.
    The registered limit of 100,000 steps is the largest number of cities; the vector
    environment replaces it by n + 1. `max_episode_steps` sets another (-1: none), which
    may truncate tours.

    ## Arguments
    Every parameter of `TravellingSalesman` is a keyword of `gym.make` and `gym.make_vec`:
    `instance="eil51"`, `distances=matrix`, `coordinates=points`, `tsplib="my.tsp"`,
    `start=0`. A state for `reset(options={"state": ...})` is the number of the first
    city, or a row of `env.unwrapped.states`.

    >>> import gymnasium as gym, acl_gym
    >>> distances = [[0, 1, 5], [1, 0, 2], [5, 2, 0]]
    >>> env = gym.make("acl_gym/TravellingSalesman-v0", distances=distances, start=0)
    >>> observation, info = env.reset(seed=0)
    >>> info["action_mask"].tolist()
    [0, 1, 1]
    >>> [env.step(city)[1:3] for city in (1, 2, 0)]
    [(-1.0, False), (-2.0, False), (-5.0, True)]

    ## Version History
    - v0: first version.
    """

    system_type = TravellingSalesman
    painter = _PAINTER

    def __init__(self, render_mode: str | None = None, **parameters: Any) -> None:
        super().__init__(render_mode, **parameters)
        self.instance = instance_of(self.system)


class TravellingSalesmanVectorEnv(_WithInstance, ControlVectorEnv):
    """Many ants on one graph, one a slot; see `TravellingSalesmanEnv`.

    A state takes 8 (n + 3) bytes a slot, the distances 8 n^2 bytes for all.
    """

    system_type = TravellingSalesman
    painter = _PAINTER

    def __init__(
        self,
        num_envs: int = 1,
        *,
        max_episode_steps: int | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        **parameters: Any,
    ) -> None:
        super().__init__(
            num_envs,
            max_episode_steps=max_episode_steps,
            autoreset_mode=autoreset_mode,
            render_mode=render_mode,
            **parameters,
        )
        self.instance = instance_of(self.system)
        # What `with_slots` makes others of: a file may change.
        start = parameters.get("start", TravellingSalesman.start)
        self.parameters = {"instance": self.instance, "start": start}
        if isinstance(self.max_episode_steps, RegisteredLimit):
            steps = min(self.max_episode_steps, self.instance.n_cities + 1)
            self.max_episode_steps = RegisteredLimit(steps)

    def _check_memory(self) -> None:
        n_cities = instance_of(self.system).n_cities
        validation.check_memory(
            f"tours of {self.num_envs:,} slots through {n_cities:,} cities",
            self.num_envs * (2 * 8 * (n_cities + 3) + n_cities),
            "use fewer ants or slots",
        )

    def _checked_states(self, given: Any, slots: IntArray) -> FloatArray:
        if self._state is not None:
            rows = validation.real_array("options['state']", given, finite=False)
            if rows.shape in ((self.num_envs,), (self.num_envs, 1)):
                # Rows of slots that are not reset may hold anything.
                given = rows.reshape(-1)
                others = np.ones(self.num_envs, np.bool_)
                others[slots] = False
                given[others] = 0.0
        return super()._checked_states(given, slots)
