"""The systems that the common tests run on: one entry of `SYSTEMS` each."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.control.single import ControlEnv
from acl_gym.envs.graph.travelling_salesman.kernels import UNVISITED
from acl_gym.envs.grid_search import (
    GridSearch1DEnv,
    GridSearch1DVectorEnv,
    GridSearch2DEnv,
    GridSearch2DVectorEnv,
)
from acl_gym.envs.navigation import NavigationEnv, NavigationVectorEnv
from acl_gym.envs.pendulum import PendulumEnv, PendulumVectorEnv
from acl_gym.envs.two_state import TwoStateEnv, TwoStateVectorEnv
from tests.envs.obedient import ObedientSalesmanEnv, ObedientSalesmanVectorEnv

NAN, INF = float("nan"), float("inf")
State = tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class SystemCase:
    """What a test must know of a system that it has not looked into.

    Attributes:
        env_id: as registered.
        single: class of the single environment, which takes any action.
        vector: class of the vector environment, which takes any action.
        easy: parameters with which some walks of nine random actions from random
            states reach the goal, and some do not.
        variant: more parameters to be tried on top of `easy`, deterministic ones.
        narrow: parameters for `near` and `away`.
        near: a state from which `near_action` leads to the goal of `narrow`.
        near_action: that action.
        away: a state from which no 100 actions lead to the goal of `narrow`; where
            walks do not last, one from which no single action does.
        lasting: whether there are long walks; False where each ends after an action
            or two.
        one_start: whether every ant begins in the same state.
        draws: parameters under which steps are random; None if there are none.
        bad_states: states that `reset` must refuse, each with a name.
    """

    env_id: str
    single: type[ControlEnv]
    vector: type[ControlVectorEnv]
    easy: dict[str, Any]
    variant: dict[str, Any]
    narrow: dict[str, Any]
    near: State
    near_action: int
    away: State
    draws: dict[str, Any] | None = None
    bad_states: dict[str, Any] = field(default_factory=dict)
    lasting: bool = True
    one_start: bool = False

    @property
    def takes_any_action(self) -> bool:
        """Whether those of `single` and `vector` are the ones that are registered."""
        return self.single is not ObedientSalesmanEnv

    @property
    def n_actions(self) -> int:
        """How many actions there are."""
        return int(self.system.action_space.n)

    @property
    def system(self) -> Any:
        """The system of `narrow`."""
        return self.single(**self.narrow).system

    def rows(self, *states: State) -> np.ndarray:
        """States one under the other, `(n, state_size)`."""
        return np.array(states, dtype=np.float64)

    def observed(self, *states: State) -> np.ndarray:
        """What is seen of states."""
        return self.system.observe(self.rows(*states).T.copy())


_GRID_BAD = {
    "half": 1.5,
    "negative": -1,
    "far beyond": 10_000,
    "two numbers": [0, 1],
    "deep": [[0]],
    "empty": [],
    "nan": NAN,
    "infinite": INF,
    "word": "one",
    "digit as string": "0",
    "complex": 1j,
    "bool": True,
    "dict": {"cell": 0},
}

# Five cities each, so that tours end soon and all have the same actions.
_LINE = [[float(i), 0.0] for i in range(5)]
_FIVE = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.3, 0.4]]


def tour_state(*visited: int, n_cities: int) -> State:
    """The state of an ant that has visited these cities in this order."""
    ranks = [UNVISITED] * n_cities
    for rank, city in enumerate(visited):
        ranks[city] = float(rank)
    return (visited[-1], visited[0], len(visited) - 1.0, *ranks)


SYSTEMS = [
    SystemCase(
        env_id="acl_gym/Pendulum-v0",
        single=PendulumEnv,
        vector=PendulumVectorEnv,
        easy={"goal_bounds": (2.5, 7.0)},
        variant={"substeps": 3},
        # A slot that starts upright stands in this tiny goal after one step without
        # torque; no other slot ever comes there.
        narrow={"goal_bounds": (1e-9, 1e-9)},
        near=(np.pi, 0.0),
        near_action=1,
        away=(1.0, 0.0),
        bad_states={
            "batch": [[0.0, 0.0]],
            "one number": 0.0,
            "three numbers": [0.0, 0.0, 0.0],
            "empty": [],
            "nan": [NAN, 0.0],
            "infinite": [0.0, -INF],
            "too fast": [0.0, np.nextafter(9.0, 10.0)],
            "words": ["up", "still"],
            "digits as strings": ["0", "0"],
            "complex": [1j, 0.0],
            "complex array": np.array([1j, 0.0]),
            "none": [0.0, None],
            "dict": {"theta": 0.0},
        },
    ),
    SystemCase(
        env_id="acl_gym/GridSearch1D-v0",
        single=GridSearch1DEnv,
        vector=GridSearch1DVectorEnv,
        easy={"n_states": 6},
        variant={"mask_blocked": True},
        narrow={"n_states": 200},
        near=(198,),
        near_action=1,
        away=(0,),
        draws={"n_states": 6, "transition_probability": 0.6},
        bad_states=_GRID_BAD,
    ),
    SystemCase(
        env_id="acl_gym/GridSearch2D-v0",
        single=GridSearch2DEnv,
        vector=GridSearch2DVectorEnv,
        easy={"desc": ("....", ".G#.", "....")},
        variant={"mask_blocked": True},
        # One long way from west to east, along a wall with a gap.
        narrow={"desc": ("." * 150 + "G", "#" * 149 + ".#", "." * 151)},
        near=(149,),
        near_action=2,
        away=(0,),
        draws={"transition_probability": 0.6, "desc": (".G..", "..#.", "....")},
        bad_states=_GRID_BAD,
    ),
    SystemCase(
        env_id="acl_gym/Navigation-v0",
        single=NavigationEnv,
        vector=NavigationVectorEnv,
        easy={"goal_bounds": (4.2, 1.7)},
        variant={"substeps": 3},
        # A vehicle at rest at the origin stays in this tiny goal without force.
        narrow={"goal_bounds": (1e-9, 1e-9)},
        near=(0.0, 0.0, 0.0, 0.0),
        near_action=4,
        away=(3.0, 0.0, 3.0, 0.0),
        bad_states={
            "batch": [[0.0, 0.0, 0.0, 0.0]],
            "one number": 0.0,
            "three numbers": [0.0, 0.0, 0.0],
            "empty": [],
            "nan": [NAN, 0.0, 0.0, 0.0],
            "infinite": [0.0, 0.0, -INF, 0.0],
            "too far": [np.nextafter(5.0, 6.0), 0.0, 0.0, 0.0],
            "too fast": [0.0, 0.0, 0.0, 2.1],
            "words": ["a", "b", "c", "d"],
            "complex": [1j, 0.0, 0.0, 0.0],
            "dict": {"c1": 0.0},
        },
    ),
    SystemCase(
        env_id="acl_gym/TwoState-v0",
        single=TwoStateEnv,
        vector=TwoStateVectorEnv,
        easy={"costs": (0.5, 1.5, 6.0)},
        variant={},
        narrow={},
        near=(1,),
        near_action=0,
        away=(0,),
        bad_states=_GRID_BAD,
        lasting=False,
        one_start=True,
    ),
    SystemCase(
        env_id="acl_gym/TravellingSalesman-v0",
        single=ObedientSalesmanEnv,
        vector=ObedientSalesmanVectorEnv,
        easy={"coordinates": _FIVE},
        variant={"start": 2},
        narrow={"coordinates": _LINE},
        near=tour_state(*range(5), n_cities=5),
        near_action=0,
        away=tour_state(0, n_cities=5),
        bad_states={
            **{name: bad for name, bad in _GRID_BAD.items() if name != "two numbers"},
            "deep": [[[0]]],
            "too short": [0.0] * 10,
            "rank twice": (1.0, 0.0, 1.0, 0.0, 1.0, 1.0, *[UNVISITED] * 45),
            "rank missing": (1.0, 0.0, 2.0, 0.0, 2.0, *[UNVISITED] * 46),
            "elsewhere": (2.0, 0.0, 1.0, 0.0, 1.0, *[UNVISITED] * 46),
            "another first": (1.0, 1.0, 1.0, 0.0, 1.0, *[UNVISITED] * 46),
            "too many arcs": (0.0, 0.0, 49.0, *map(float, range(48))),
            "half an arc": (0.0, 0.0, 0.5, 0.0, *[UNVISITED] * 47),
            "rank nan": (0.0, 0.0, 0.0, 0.0, NAN, *[UNVISITED] * 46),
            "city infinite": (INF, 0.0, 0.0, 0.0, *[UNVISITED] * 47),
        },
        # Each tour ends after as many steps as there are cities.
        lasting=False,
    ),
]

LASTING = [case for case in SYSTEMS if case.lasting]
"""For tests of what happens on a long walk."""


def by_id(case: SystemCase) -> str:
    """A name for a parameter of pytest."""
    return case.single.__name__
