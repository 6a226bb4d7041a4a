"""The pendulum swing-up of §5.2 as environments, single and vector."""

from __future__ import annotations

from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.control.single import ControlEnv
from acl_gym.envs.pendulum.system import Pendulum


class PendulumEnv(ControlEnv):
    """Swing a pendulum up and bring it to rest upright with a weak motor.

    ## Description
    A pole hangs from a pivot on which a motor exerts a limited torque (§5.2). The
    torque cannot lift it in one movement: it must swing back and forth first, and must
    be slowed in time to stop upright.

    ## Action Space
    `Discrete(3)`, the torque u held for one sampling time.

    | Num | Torque (N m) |
    |-----|--------------|
    | 0   | -0.8         |
    | 1   | 0            |
    | 2   | 0.8          |

    With `continuous=True` it is `Box(-0.8, 0.8, (1,), float64)`, the torque itself, and
    what lies beyond is set to these bounds.

    ## Observation Space
    `Box` of shape `(2,)`, float64: the state itself.

    | Num | Observation                | Min    | Max    | Unit  |
    |-----|----------------------------|--------|--------|-------|
    | 0   | angle theta, 0 hangs down  | 0      | 2 pi   | rad   |
    | 1   | angular velocity omega     | -9     | 9      | rad/s |

    Stable-Baselines3 casts them to float32 by itself. For code that does not, such as a
    network fed from a replay buffer of the space's dtype, wrap the environment in
    `gymnasium.wrappers.DtypeObservation(env, np.float32)`, a vector environment in that
    of `gymnasium.wrappers.vector`.

    ## Rewards
    The reward is the negative stage cost (5.4), `-(e' Q e + R u^2)`, with the error
    e = [theta - pi, omega] taken after the step. The return is -J.

    ## Starting State
    Uniform over the state space without the goal region.

    ## Episode End
    Terminated when |theta - pi| <= 0.1 rad and |omega| <= 0.1 rad/s; truncated after
    300 steps, T of Table 5.2, unless `max_episode_steps` sets another limit (-1: none).
    `info["is_success"]` says whether the goal was reached.

    ## Arguments
    Every parameter of `Pendulum` is a keyword of `gym.make` and `gym.make_vec`:

    >>> import gymnasium as gym, acl_gym
    >>> env = gym.make("acl_gym/Pendulum-v0", max_episode_steps=300, substeps=2)
    >>> observation, info = env.reset(options={"state": [0.0, 0.0]})
    >>> observation.tolist()
    [0.0, 0.0]

    ## Version History
    - v0: first version.
    """

    system_type = Pendulum
    painter = "acl_gym.envs.pendulum.painter:PendulumPainter"


class PendulumVectorEnv(ControlVectorEnv):
    """Many pendulums, one a slot, advanced by one kernel; see `PendulumEnv`."""

    system_type = Pendulum
    painter = "acl_gym.envs.pendulum.painter:PendulumPainter"
