"""The systems and graphs that ants walk through, as Gymnasium environments.

The table of all environment ids, which are registered when `acl_gym` is imported.

Each id has a time limit, so that a loop which waits for the end of an episode comes to
one. It is T, the longest episode, of the experiments on the system; Gymnasium's
`TimeLimit` applies it to the single environment, the native vector environment applies
it itself. `max_episode_steps=` of `gym.make` and `gym.make_vec` changes it, -1 removes
it.

| Id | T | Where it comes from |
| --- | --- | --- |
| DoubleBridge-v0 | 100 | ten times the longer branch |
| GridSearch1D-v0 | 50 | 5 times the 10 states, see `GridSearch.evaluation_steps` |
| GridSearch2D-v0 | 435 | 5 times the 87 states of the default map |
| Navigation-v0 | 150 | Table 4.1 |
| Pendulum-v0 | 300 | Table 5.2 |
| SwarmAggregation-v0 | 100 | twice what an agent needs through the world |
| TwoState-v0 | 2 | every episode ends after two steps |
| TravellingSalesman-v0 | 100,000 | the most cities that an instance may have |

A tour ends after as many steps as there are cities. The native vector environment
replaces the limit by one step more than its instance needs, so that agents which walk
as far as the limit says know where tours end.

An id has one number, whatever map or parameters are passed with it. No start of the
maps 11x11, 21x21 and 31x31 is more than 40 steps from the goal, so 435 is ten times what
a good policy needs on each; a random walk needs more on the larger ones: make them with
`max_episode_steps=1395` and `3205`, their `system.evaluation_steps`.

The ids were registered without a limit at first. They keep their version, because the
limit does not change what an agent of this package learns from a given T: it walks as
far as its own T says, in learning and in evaluation, also beyond a registered limit
(`RegisteredLimit`). An agent that was given no T takes that of the environment, which is
the number that it took before on the pendulum, and makes no difference on the two-state
system; on the navigation and on the grids it took 300.
"""

from __future__ import annotations

from typing import NamedTuple

import gymnasium as gym

from acl_gym.envs.limits import RegisteredLimit


class Entry(NamedTuple):
    """What is registered under an id.

    Attributes:
        single: "module:class" of the single environment.
        vector: that of the native vector environment.
        max_episode_steps: T of the system's experiments.
    """

    single: str
    vector: str
    max_episode_steps: int


ENVIRONMENTS = {
    "acl_gym/GridSearch1D-v0": Entry(
        "acl_gym.envs.grid_search:GridSearch1DEnv",
        "acl_gym.envs.grid_search:GridSearch1DVectorEnv",
        50,
    ),
    "acl_gym/GridSearch2D-v0": Entry(
        "acl_gym.envs.grid_search:GridSearch2DEnv",
        "acl_gym.envs.grid_search:GridSearch2DVectorEnv",
        435,
    ),
    "acl_gym/Pendulum-v0": Entry(
        "acl_gym.envs.pendulum:PendulumEnv",
        "acl_gym.envs.pendulum:PendulumVectorEnv",
        300,
    ),
    "acl_gym/Navigation-v0": Entry(
        "acl_gym.envs.navigation:NavigationEnv",
        "acl_gym.envs.navigation:NavigationVectorEnv",
        150,
    ),
    "acl_gym/TwoState-v0": Entry(
        "acl_gym.envs.two_state:TwoStateEnv",
        "acl_gym.envs.two_state:TwoStateVectorEnv",
        2,
    ),
    "acl_gym/DoubleBridge-v0": Entry(
        "acl_gym.envs.graph.double_bridge:DoubleBridgeEnv",
        "acl_gym.envs.graph.double_bridge:DoubleBridgeVectorEnv",
        100,
    ),
    "acl_gym/TravellingSalesman-v0": Entry(
        "acl_gym.envs.graph.travelling_salesman:TravellingSalesmanEnv",
        "acl_gym.envs.graph.travelling_salesman:TravellingSalesmanVectorEnv",
        100_000,
    ),
    "acl_gym/SwarmAggregation-v0": Entry(
        "acl_gym.envs.swarm_aggregation:SwarmAggregationEnv",
        "acl_gym.envs.swarm_aggregation:SwarmAggregationVectorEnv",
        100,
    ),
}


def register_environments() -> None:
    """Register every id of the table with Gymnasium; calling it again is harmless."""
    for env_id, entry in ENVIRONMENTS.items():
        if env_id not in gym.registry:
            gym.register(
                env_id,
                entry_point=entry.single,
                vector_entry_point=entry.vector,
                max_episode_steps=RegisteredLimit(entry.max_episode_steps),
            )
