"""What the claims on the pendulum measure of its runs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from acl_gym.evaluation import record_trajectory
from acl_gym.reproduction.catalogue.common import GAMMAS, number
from acl_gym.reproduction.evidence import Evidence
from acl_gym.reproduction.settings import Setting
from acl_gym.reproduction.systems import swing
from acl_gym.reproduction.verdicts import digits, interval, swing_at_the_end
from acl_gym.utils.typing import FloatArray

OPTIMUM = 38.5
"""J* on the evaluation set, by value iteration on fine cells (docs/comparison.md)."""

SETTLED = 0.25
"""A run has settled if its cost swings by less than this in the last 20 trials."""

GOOD = 3.0
"""A run has come to something if its last policies cost less than so many J*."""


def late_cost(evidence: Evidence, setting: Setting) -> FloatArray:
    """The mean cost of the policy over the last ten trials of each run."""
    return np.asarray(evidence.rows(setting)[:, -10:].mean(axis=1))


def convergence(evidence: Evidence, setting: Setting) -> tuple[bool, str]:
    """Whether most runs have settled, and on a policy that is some good."""
    costs = evidence.rows(setting)
    settled = swing_at_the_end(costs) <= SETTLED
    good = late_cost(evidence, setting) <= GOOD * OPTIMUM
    share = float((settled & good).mean())
    return share > 0.5, f"{share:.0%} of the runs, cost {interval(costs[:, -1])}"


def listed(costs: Mapping[Any, float]) -> str:
    """Costs under what was varied, in a line."""
    return ", ".join(
        f"{number(value)}: {digits(cost)}" for value, cost in costs.items()
    )


CONVERGES = (
    f"in most runs the cost swings by less than {SETTLED:.0%} over the last 20 trials "
    f"and ends below {GOOD:g} J*"
)


def trajectory(evidence: Evidence, setting: Setting, run: int) -> Any:
    """From hanging at rest, by the last policy of a run."""
    policy = evidence.policy(setting, run)
    return record_trajectory(policy, setting.make_env(1), np.zeros(2), max_steps=300)


UPRIGHT = 0.5
"""A pendulum within so many rad of upright has been swung up."""


def swing_up(path: Any) -> tuple[float, int]:
    """When it is up to stay (infinity if never), and how often it has turned by then.

    Returns:
        Seconds until it stays within `UPRIGHT` to the end, and the changes of the sign
        of its velocity before that.
    """
    away = np.abs(path.states[:, 0] - np.pi) > UPRIGHT
    last = int(np.flatnonzero(away)[-1])
    seconds = 0.1 * (last + 1) if last + 1 < len(away) else float("inf")
    omega = path.states[1 : last + 1, 1]
    return seconds, int(np.sum(np.diff(np.sign(omega)) != 0))


def structure(policy: Any, setting: Setting) -> tuple[float, float, float]:
    """How structured a policy is, at the centres of its cells.

    Returns:
        The share of neighbouring pairs of cells with the same action; of cells within
        0.5 rad of hanging whose torque drives the motion; of cells within 0.5 rad of
        upright and moving away whose torque brakes it.
    """
    n_theta, n_omega = setting.cells
    action = policy.best_actions().reshape(n_theta, n_omega) - 1  # -1, 0, 1
    same_theta = action == np.roll(action, 1, axis=0)
    same_omega = action[:, 1:] == action[:, :-1]
    smooth = np.concatenate([same_theta.ravel(), same_omega.ravel()]).mean()
    theta, omega = np.meshgrid(*policy.partition.centres, indexing="ij")
    from_hanging = (theta + np.pi) % (2 * np.pi) - np.pi
    from_upright = theta - np.pi
    moving = np.abs(omega) > 0.5
    low = moving & (np.abs(from_hanging) < 0.5)
    away = moving & (np.abs(from_upright) < 0.5) & (from_upright * omega > 0)
    drives = (action * np.sign(omega) > 0)[low].mean()
    brakes = (action * np.sign(omega) < 0)[away].mean()
    return float(smooth), float(drives), float(brakes)


def by_gamma(evidence: Evidence, kind: str) -> dict[float, FloatArray]:
    """`late_cost` for each gamma of Figures 5.7 and 5.9."""
    return {g: late_cost(evidence, swing(kind, local_decay=g)) for g in GAMMAS}
