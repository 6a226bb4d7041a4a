"""The double bridge of §2.3.2 as environments, single and vector."""

from __future__ import annotations

from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.control.single import ControlEnv
from acl_gym.envs.graph.double_bridge.system import DoubleBridge


class DoubleBridgeEnv(ControlEnv):
    """The bridge on which real ants find the shorter way without seeing it.

    ## Description
    §2.3.2 of the thesis, after Deneubourg et al. (1990) and Goss et al. (1989): a nest
    and a food source are joined by a bridge that forks into two branches, of equal or of
    unequal length. An ant walks from the nest to the food, chooses a branch where the
    bridge forks, and then walks on along it. What other ants have left on the branches
    is not part of the environment but of the colony, as in every environment of this
    package: a slot is one ant. What (2.1) makes of colonies of real ants is in
    `acl_gym.theory`, `simulate_crossings` and `crossing_law`.

    ## Action Space
    `Discrete(2)`: 0 is left, 1 is right. In the first module, the branch of
    `lengths[0]` is on the left; in the second, if there is one, on the right. On a
    branch only action 0 is available (`infos["action_mask"]`); the other has the same
    effect.

    ## Observation Space
    `Discrete(15)`, in general modules (lengths[0] + lengths[1] - 1) + 1: 0 is the nest,
    then come the places on the branch of `lengths[0]`, those on the other one and the
    end of the module, which is the food, or where the next module forks.

    ## Rewards
    -1 a step, so that the return is minus the length of the way.

    ## Starting State
    The nest.

    ## Episode End
    Terminated at the food. The registered limit is 100 steps, ten times the longer
    branch; `max_episode_steps` sets another (-1: none). `info["is_success"]` says
    whether the food was reached.

    ## Arguments
    `lengths`, `modules` and `closed`, see `DoubleBridge`. An ant that tries a closed
    branch, which is not available, finds out and turns back: it stays where it is, for
    the cost of a step.

    >>> import gymnasium as gym, acl_gym
    >>> env = gym.make("acl_gym/DoubleBridge-v0", lengths=(2, 3))
    >>> observation, info = env.reset()
    >>> info["action_mask"].tolist()
    [True, True]
    >>> [int(env.step(action)[0]) for action in (1, 0, 0)]
    [2, 3, 4]

    ## Version History
    - v0: first version.
    """

    system_type = DoubleBridge
    painter = "acl_gym.envs.graph.double_bridge.painter:DoubleBridgePainter"


class DoubleBridgeVectorEnv(ControlVectorEnv):
    """Many ants, one a slot; see `DoubleBridgeEnv`."""

    system_type = DoubleBridge
    painter = "acl_gym.envs.graph.double_bridge.painter:DoubleBridgePainter"
