"""What the claims measure on the pendulum."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from acl_gym.evaluation import Trajectory, record_trajectory
from acl_gym.experiments.claims import late_swing
from acl_gym.experiments.methods import restore_policy
from acl_gym.experiments.results import Results
from acl_gym.experiments.statistics import estimate
from acl_gym.experiments.study import Study
from acl_gym.experiments.thesis import common
from acl_gym.utils.typing import BoolArray, FloatArray

OPTIMUM = 38.5
"""J* on the evaluation states, by value iteration on fine cells (docs/comparison.md)."""

SETTLED = 0.25
"""A run has settled if its cost swings by at most this share in the last 20 trials."""

GOOD = 3.0
"""A run has learned something if its last policies cost at most this many times J*."""

UPRIGHT = 0.5
"""A pendulum within so many rad of upright has been swung up."""

CONVERGES = (
    f"in most runs the cost swings by at most {SETTLED:.0%} over the last 20 trials and "
    f"ends at {GOOD:g} J* or less"
)


def late_cost(results: Results, study: Study) -> FloatArray:
    """The mean policy cost over the last ten trials of each run, `(runs,)`."""
    return common.late_cost(results, study, 10)


def late_costs(results: Results, studies: Mapping[Any, Study]) -> dict[Any, FloatArray]:
    """`late_cost` of some studies, by their keys."""
    return {key: late_cost(results, study) for key, study in studies.items()}


def convergence(results: Results, study: Study) -> tuple[bool, str]:
    """Whether most runs have settled on a good policy, and the figures behind it."""
    costs = results.values(study)
    good = late_cost(results, study) <= GOOD * OPTIMUM
    share = float(((late_swing(costs) <= SETTLED) & good).mean())
    return share > 0.5, f"{share:.0%} of the runs, cost {estimate(costs[:, -1])}"


def trajectory(results: Results, study: Study, run: int) -> Trajectory:
    """From hanging at rest, by the last policy of a run."""
    policy = restore_policy(study, results.runs(study)[run])
    env = study.task.make_system_env(1)
    steps = study.task.longest_evaluation
    return record_trajectory(policy, env, np.zeros(2), max_steps=steps)


class SwingUp(NamedTuple):
    """How a pendulum that hangs at rest is swung up.

    Attributes:
        seconds: until it stays within `UPRIGHT` to the end; infinity if never.
        turns: how often its velocity changes sign before that.
    """

    seconds: float
    turns: int


def swing_ups(results: Results, study: Study) -> list[SwingUp]:
    """How the last policies of all runs swing the pendulum up."""
    return [_swing_up(results, study, run) for run in range(len(results.runs(study)))]


def best_swing_up(results: Results, study: Study) -> SwingUp:
    """The same for the run whose last policy is the cheapest."""
    return _swing_up(results, study, results.best_run(study))


def _swing_up(results: Results, study: Study, run: int) -> SwingUp:
    states = trajectory(results, study, run).states
    away = np.abs(states[:, 0] - np.pi) > UPRIGHT
    last = int(np.flatnonzero(away)[-1])
    seconds = 0.1 * (last + 1) if last + 1 < len(away) else float("inf")
    signs = np.sign(states[1 : last + 1, 1])
    return SwingUp(seconds, int(np.sum(np.diff(signs) != 0)))


class TorqueMap(NamedTuple):
    """What a policy does at the centres of its cells, arrays `(N_theta, N_omega)`.

    Attributes:
        along: -1, 0 or 1: torque against the motion, none, or along it.
        same: the share of neighbouring pairs of cells with the same action.
        near_hanging: the moving cells within 0.5 rad of hanging.
        leaving_upright: the cells within 0.5 rad of upright that move away from it.
        speed: in rad/s.
    """

    along: FloatArray
    same: float
    near_hanging: BoolArray
    leaving_upright: BoolArray
    speed: FloatArray

    @property
    def structure(self) -> tuple[float, float, float]:
        """Same action as the neighbour, drives near hanging, brakes near upright."""
        drives = (self.along > 0)[self.near_hanging].mean()
        brakes = (self.along < 0)[self.leaving_upright].mean()
        return self.same, float(drives), float(brakes)


def torque_maps(results: Results, study: Study) -> list[TorqueMap]:
    """The last policies of all runs."""
    maps = []
    for run in results.runs(study):
        policy = restore_policy(study, run)
        theta, omega = np.meshgrid(*policy.partition.centres, indexing="ij")
        action = policy.best_actions().reshape(theta.shape) - 1
        same_theta = action == np.roll(action, 1, axis=0)
        same_omega = action[:, 1:] == action[:, :-1]
        same = np.concatenate([same_theta.ravel(), same_omega.ravel()]).mean()
        from_hanging = (theta + np.pi) % (2 * np.pi) - np.pi
        off, moving = theta - np.pi, np.abs(omega) > 0.5
        hanging = moving & (np.abs(from_hanging) < 0.5)
        leaving = moving & (np.abs(off) < 0.5) & (off * omega > 0)
        along = action * np.sign(omega)
        maps.append(TorqueMap(along, float(same), hanging, leaving, np.abs(omega)))
    return maps
