"""The grid searches of §3.6.2 and §3.6.6 as environments, single and vector."""

from __future__ import annotations

from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.control.single import ControlEnv
from acl_gym.envs.grid_search.system import GridSearch1D, GridSearch2D


class GridSearch1DEnv(ControlEnv):
    """Walk to the east end of a row of cells.

    ## Description
    Ten states lie in a row; the goal is the one at the far east (§3.6.2). It is the
    smallest problem on which a colony can learn: a policy is optimal if it walks east
    in every state, and then costs 5 steps on average.

    ## Action Space
    `Discrete(2)`.

    | Num | Action |
    |-----|--------|
    | 0   | west   |
    | 1   | east   |

    A move to the west of the first state is blocked: the ant stays where it is. With
    a `transition_probability` p below 1, any move fails with probability 1 - p.

    ## Observation Space
    `Discrete(10)`: the number of the state, from 0 in the west to 9, the goal.

    ## Rewards
    -1 per step, even if the move was blocked or failed. The return is -J.

    ## Starting State
    Uniform over the states without the goal.

    ## Episode End
    Terminated in the goal; truncated after 50 steps, 5 times the number of states, unless
    `max_episode_steps` sets another limit (-1: none). `info["is_success"]` says whether
    the goal was reached.

    ## Arguments
    Every parameter of `GridSearch1D` is a keyword of `gym.make` and `gym.make_vec`:

    >>> import gymnasium as gym, acl_gym
    >>> env = gym.make("acl_gym/GridSearch1D-v0", max_episode_steps=50, n_states=5)
    >>> observation, info = env.reset(options={"state": 3})
    >>> observation, reward, terminated, truncated, info = env.step(1)
    >>> int(observation), reward, terminated
    (4, -1.0, True)

    ## Version History
    - v0: first version.
    """

    system_type = GridSearch1D
    painter = "acl_gym.envs.grid_search.painter:GridSearchPainter"


class GridSearch1DVectorEnv(ControlVectorEnv):
    """Many ants in one row, one a slot; see `GridSearch1DEnv`."""

    system_type = GridSearch1D
    painter = "acl_gym.envs.grid_search.painter:GridSearchPainter"


class GridSearch2DEnv(ControlEnv):
    """Find the goal in the centre of a world of walls.

    ## Description
    A square world of 11 by 11 cells (or 21 by 21, 31 by 31, or a map of your own), of
    which some are obstacles (§3.6.6). They leave fewer shortest paths of equal length
    than an open square would. The goal is in the centre.

    ## Action Space
    `Discrete(4)`.

    | Num | Action | Row | Column |
    |-----|--------|-----|--------|
    | 0   | north  | -1  | 0      |
    | 1   | south  | +1  | 0      |
    | 2   | east   | 0   | +1     |
    | 3   | west   | 0   | -1     |

    A move against an obstacle or the border is blocked: the ant stays where it is.
    With a `transition_probability` p below 1, any move fails with probability 1 - p.
    With `mask_blocked=True`, `info["action_mask"]` reports which moves are not blocked
    (bool; `env.action_space.sample(mask)` needs `mask.astype(np.int8)`).

    ## Observation Space
    `Discrete(87)`: the number of the cell, counted from 0 row by row from the
    north-west corner, leaving out obstacles; the goal is among them.
    `env.unwrapped.system.cells` holds the row and column of each. 21x21 has 279
    states, 31x31 has 641.

    ## Rewards
    -1 per step, even if the move was blocked or failed. The return is -J.

    ## Starting State
    Uniform over the free cells without the goals.

    ## Episode End
    Terminated in a goal; truncated after 435 steps, 5 times the states of the default map,
    unless `max_episode_steps` sets another limit (-1: none). On larger maps 435 steps are
    enough for a good policy, but few for a random walk: 1395 on 21x21 and 3205 on 31x31
    are in the same proportion. `info["is_success"]` says whether a goal was reached.

    ## Arguments
    Every parameter of `GridSearch2D` is a keyword of `gym.make` and `gym.make_vec`:

    >>> import gymnasium as gym, acl_gym
    >>> env = gym.make("acl_gym/GridSearch2D-v0", desc=["..#", "#.G"])
    >>> observation, info = env.reset(options={"state": 0})
    >>> for action in (2, 1, 2):
    ...     observation, reward, terminated, truncated, info = env.step(action)
    >>> int(observation), reward, terminated
    (3, -1.0, True)

    ## Version History
    - v0: first version.
    """

    system_type = GridSearch2D
    painter = "acl_gym.envs.grid_search.painter:GridSearchPainter"


class GridSearch2DVectorEnv(ControlVectorEnv):
    """Many ants in one world, one a slot; see `GridSearch2DEnv`."""

    system_type = GridSearch2D
    painter = "acl_gym.envs.grid_search.painter:GridSearchPainter"
