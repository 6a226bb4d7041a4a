"""The 2-D navigation of §4.5 as environments, single and vector."""

from __future__ import annotations

from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.control.single import ControlEnv
from acl_gym.envs.navigation.system import Navigation


class NavigationEnv(ControlEnv):
    """Steer a vehicle to the origin of a plane on which the damping varies.

    ## Description
    A point mass on a square surface is pushed by a force along two axes (§4.5). Two
    regions brake it strongly; going round them can be faster than going through. The
    vehicle must come to rest at the origin.

    ## Action Space
    `Discrete(9)`, the force (u1, u2) held for one sampling time, in N.

    | Num | u1 | u2 | Num | u1 | u2 | Num | u1 | u2 |
    |-----|----|----|-----|----|----|-----|----|----|
    | 0   | -1 | -1 | 3   | 0  | -1 | 6   | 1  | -1 |
    | 1   | -1 | 0  | 4   | 0  | 0  | 7   | 1  | 0  |
    | 2   | -1 | 1  | 5   | 0  | 1  | 8   | 1  | 1  |

    ## Observation Space
    `Box` of shape `(4,)`, float64: the state itself.

    | Num | Observation                   | Min | Max | Unit |
    |-----|-------------------------------|-----|-----|------|
    | 0   | position c1, to the right     | -5  | 5   | m    |
    | 1   | velocity v1 along c1          | -2  | 2   | m/s  |
    | 2   | position c2, upwards          | -5  | 5   | m    |
    | 3   | velocity v2 along c2          | -2  | 2   | m/s  |

    Stable-Baselines3 casts them to float32 by itself. For code that does not, such as a
    network fed from a replay buffer of the space's dtype, wrap the environment in
    `gymnasium.wrappers.DtypeObservation(env, np.float32)`, a vector environment in that
    of `gymnasium.wrappers.vector`.

    ## Rewards
    The reward is the negative stage cost, after the step: `-(x' Q x + u' R u)` (3.2)
    with `cost="quadratic"`, -1 with `cost="time"` (§4.5.3). The return is -J.

    ## Starting State
    Uniform over the state space without the goal region.

    ## Episode End
    Terminated in the goal region: with `goal_rule="bounds"` when |c1|, |c2| <= 0.25 m
    and |v1|, |v2| <= 0.05 m/s; with `goal_rule="membership"` when the degree of the
    goal's membership function, `prod_i max(1 - |x_i| / spacing_i, 0)`, exceeds 0.5.
    Truncated after 150 steps, T of Table 4.1, unless `max_episode_steps` sets another
    limit (-1: none). `info["is_success"]` says whether the goal was reached.

    ## Arguments
    Every parameter of `Navigation` is a keyword of `gym.make` and `gym.make_vec`:

    >>> import gymnasium as gym, acl_gym
    >>> env = gym.make("acl_gym/Navigation-v0", max_episode_steps=150, cost="time")
    >>> observation, info = env.reset(options={"state": [3.0, 0.0, -2.0, 0.5]})
    >>> observation.tolist()
    [3.0, 0.0, -2.0, 0.5]

    ## Version History
    - v0: first version.
    """

    system_type = Navigation
    painter = "acl_gym.envs.navigation.painter:NavigationPainter"


class NavigationVectorEnv(ControlVectorEnv):
    """Many vehicles, one a slot, advanced by one kernel; see `NavigationEnv`."""

    system_type = Navigation
    painter = "acl_gym.envs.navigation.painter:NavigationPainter"
