"""The two-state system of Figure 3.2 as environments, single and vector."""

from __future__ import annotations

from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.control.single import ControlEnv
from acl_gym.envs.two_state.system import TwoState


class TwoStateEnv(ControlEnv):
    """The smallest system with a choice: after a single action, one of several.

    ## Description
    Figure 3.2: every ant starts in q, where a single action leads to q'. There it
    chooses one of N actions, which all lead to the goal at different costs. On this
    system §3.4 derives how the expected pheromone in q depends on what is chosen in q';
    `acl_gym.theory` has its formulas.

    ## Action Space
    `Discrete(3)`: in q' the ways to the goal, best first. In q only action 0 is
    available (`infos["action_mask"]`); any other has the same effect.

    ## Observation Space
    `Discrete(3)`: 0 is q, 1 is q', 2 the goal.

    ## Rewards
    0 for the step to q' (as in the text, where its deposit does not matter), minus the
    cost of the action chosen in q' for the step to the goal. The return is -J.

    ## Starting State
    q.

    ## Episode End
    Terminated in the goal, after two steps, which are also the registered limit;
    `max_episode_steps` sets another (-1: none). `info["is_success"]` says whether the
    goal was reached.

    ## Arguments
    >>> import gymnasium as gym, acl_gym
    >>> env = gym.make("acl_gym/TwoState-v0", costs=(1.0, 3.0))
    >>> observation, info = env.reset()
    >>> info["action_mask"].tolist()
    [True, False]
    >>> env.step(0)[1:3], env.step(1)[1:3]
    ((0.0, False), (-3.0, True))

    ## Version History
    - v0: first version.
    """

    system_type = TwoState
    painter = "acl_gym.envs.two_state.painter:TwoStatePainter"


class TwoStateVectorEnv(ControlVectorEnv):
    """Many ants, one a slot; see `TwoStateEnv`."""

    system_type = TwoState
    painter = "acl_gym.envs.two_state.painter:TwoStatePainter"
