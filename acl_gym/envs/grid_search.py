"""The grid searches of §3.6.2 and §3.6.6: their parameters and environments."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from acl_gym import validation
from acl_gym.envs.control_env import ControlEnv, ControlVectorEnv
from acl_gym.envs.grid_maps import FREE, GOAL, MAPS, checked_map, load_map
from acl_gym.envs.grid_system import EAST, NORTH, SOUTH, WEST, GridSearch


@dataclass(frozen=True, kw_only=True)
class GridSearch1D(GridSearch):
    """A row of states (§3.6.2); actions 0 west, 1 east; the goal is the last state.

    Attributes:
        n_states: the length of the row, goal included, >= 2.
        transition_probability: p, in (0, 1]: a move fails with probability 1 - p.
        mask_blocked: whether infos carry `"action_mask"`, U_q of (3.4), which leaves
            out the blocked move of the first state.
    """

    directions: ClassVar[tuple[tuple[int, int], ...]] = (WEST, EAST)

    n_states: int = 10
    transition_probability: float = 1.0
    mask_blocked: bool = False

    def __post_init__(self) -> None:
        n_states = validation.integer("n_states", self.n_states, at_least=2)
        object.__setattr__(self, "n_states", n_states)
        self._check_moves()

    @property
    def rows(self) -> tuple[str, ...]:
        """One row with the goal at its east end."""
        return (FREE * (self.n_states - 1) + GOAL,)


@dataclass(frozen=True, kw_only=True)
class GridSearch2D(GridSearch):
    """A world of walls (§3.6.6); actions 0 north, 1 south, 2 east, 3 west.

    Attributes:
        map_name: "11x11", "21x21" or "31x31", with 86, 278 and 640 free cells and the
            goal in the centre. A decision: the maps of the thesis are lost; `grid_maps`
            made these. The mean shortest way is 9.99, 19.85 and 19.97 steps.
        desc: a map of one's own, as text or as a sequence of rows, instead of
            `map_name`: `#` obstacle, `.` free, `G` goal, one or more.
        transition_probability: p, in (0, 1]: a move fails with probability 1 - p.
        mask_blocked: whether infos carry `"action_mask"`, U_q of (3.4), which leaves
            out the moves against obstacles and the border. The environment still
            takes such a move: the ant stays where it is.
    """

    directions: ClassVar[tuple[tuple[int, int], ...]] = (NORTH, SOUTH, EAST, WEST)

    map_name: str = "11x11"
    desc: str | tuple[str, ...] | None = None
    transition_probability: float = 1.0
    mask_blocked: bool = False

    def __post_init__(self) -> None:
        validation.one_of("map_name", self.map_name, tuple(MAPS))
        if self.desc is not None:
            object.__setattr__(self, "desc", checked_map(self.desc))
        self._check_moves()

    @property
    def rows(self) -> tuple[str, ...]:
        """The rows of `desc`, or of the map of that name."""
        return load_map(self.map_name) if self.desc is None else tuple(self.desc)


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
    -1 a step, also if the move was blocked or failed. The return is -J.

    ## Starting State
    Uniform over the states without the goal.

    ## Episode End
    Terminated in the goal. There is no time limit unless `max_episode_steps` sets one.

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


class GridSearch1DVectorEnv(ControlVectorEnv):
    """Many ants in one row, one a slot; see `GridSearch1DEnv`."""

    system_type = GridSearch1D


class GridSearch2DEnv(ControlEnv):
    """Find the goal in the centre of a world of walls.

    ## Description
    A square world of 11 by 11 cells (or 21 by 21, 31 by 31, or a map of one's own), of
    which some are obstacles (§3.6.6). They leave fewer ways that are equally short
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
    With `mask_blocked=True`, `info["action_mask"]` tells which moves are not blocked
    (bool; `env.action_space.sample(mask)` asks for `mask.astype(np.int8)`).

    ## Observation Space
    `Discrete(87)`: the number of the cell, counted from 0 row by row from the
    north-west corner, leaving out obstacles; the goal is among them.
    `env.unwrapped.system.cells` holds the row and column of each. 21x21 has 279
    states, 31x31 has 641.

    ## Rewards
    -1 a step, also if the move was blocked or failed. The return is -J.

    ## Starting State
    Uniform over the free cells without the goals.

    ## Episode End
    Terminated in a goal. There is no time limit unless `max_episode_steps` sets one.

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


class GridSearch2DVectorEnv(ControlVectorEnv):
    """Many ants in one world, one a slot; see `GridSearch2DEnv`."""

    system_type = GridSearch2D
