"""What the claims measure on the pendulum, and what was tried to understand them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from acl_gym.evaluation import record_trajectory
from acl_gym.experiments.claims import Tried
from acl_gym.experiments.methods import restore_policy
from acl_gym.experiments.results import Results
from acl_gym.experiments.statistics import estimate, median
from acl_gym.experiments.study import Study
from acl_gym.experiments.systems import PENDULUM_OPTIMUM, pendulum
from acl_gym.experiments.thesis import chapter5, common
from acl_gym.experiments.thesis.common import (
    KINDS,
    LATE,
    Attempts,
    for_each,
    late_swing,
    listed,
    percentages,
    sweep,
)
from acl_gym.utils.typing import FloatArray

SETTLED = 0.25
"""A run has settled if its cost swings by at most this share in the last `LATE` trials."""

GOOD = 3.0
"""A run has learned something if its last policies cost at most this many times J*."""

UPRIGHT = 0.5
"""A pendulum within this many rad of upright has been swung up."""

CONVERGES = (
    f"in most runs the cost swings by at most {SETTLED:.0%} over the last {LATE} trials and "
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
    good = late_cost(results, study) <= GOOD * PENDULUM_OPTIMUM
    share = float(((late_swing(costs) <= SETTLED) & good).mean())
    return share > 0.5, f"{share:.0%} of the runs, cost {estimate(costs[:, -1])}"


class SwingUp(NamedTuple):
    """How a pendulum that hangs at rest is swung up."""

    seconds: float  # until it stays within `UPRIGHT` to the end; infinity if never
    turns: int  # changes of the sign of its velocity before that


def swing_ups(results: Results, study: Study) -> list[SwingUp]:
    """How the last policies of all runs swing the pendulum up."""
    return [_swing_up(results, study, run) for run in range(len(results.runs(study)))]


def best_swing_up(results: Results, study: Study) -> SwingUp:
    """The same for the run whose last policy is the cheapest."""
    return _swing_up(results, study, results.best_run(study))


def _swing_up(results: Results, study: Study, run: int) -> SwingUp:
    policy = restore_policy(study, results.runs(study)[run])
    env, steps = study.task.make_system_env(1), study.task.longest_evaluation
    states = record_trajectory(policy, env, np.zeros(2), max_steps=steps).states
    away = np.abs(states[:, 0] - np.pi) > UPRIGHT
    last = int(np.flatnonzero(away)[-1])
    seconds = 0.1 * (last + 1) if last + 1 < len(away) else float("inf")
    signs = np.sign(states[1 : last + 1, 1])
    return SwingUp(seconds, int(np.sum(np.diff(signs) != 0)))


def structure(results: Results, study: Study) -> FloatArray:
    """How structured the last policies are at the centres of their cells.

    Returns:
        Five shares of each run, `(5, runs)`: of neighbouring pairs of cells with the
        same action; of moving cells within 0.5 rad of hanging whose torque drives the
        motion; of cells that move away from upright within 0.5 rad of it, those that
        brake, those that brake or have no torque, and those that brake of the ones up
        to 3 rad/s.
    """
    shares = []
    for run in results.runs(study):
        policy = restore_policy(study, run)
        theta, omega = np.meshgrid(*policy.partition.centres, indexing="ij")
        action = policy.best_actions().reshape(theta.shape) - 1
        same_theta = action == np.roll(action, 1, axis=0)
        same_omega = action[:, 1:] == action[:, :-1]
        same = np.concatenate([same_theta.ravel(), same_omega.ravel()])
        from_hanging = (theta + np.pi) % (2 * np.pi) - np.pi
        off, moving = theta - np.pi, np.abs(omega) > 0.5
        hanging = moving & (np.abs(from_hanging) < 0.5)
        leaving = moving & (np.abs(off) < 0.5) & (off * omega > 0)
        along = action * np.sign(omega)
        drives, brakes, no_drive = along > 0, along < 0, along <= 0
        slow = leaving & (np.abs(omega) <= 3.0)
        where = (drives[hanging], brakes[leaving], no_drive[leaving], brakes[slow])
        shares.append([each.mean() for each in (same, *where)])
    return np.transpose(shares)


def _by_rho(kind: str, results: Results) -> dict[str, FloatArray]:
    studies = chapter5.varied(kind, "rho")
    positive = [rho for rho in studies if rho > 0]
    return sweep("rho", positive, lambda rho: results.values(studies[rho]))


def _longer(kind: str, results: Results) -> Tried:
    found = {
        f"{kind}, rho = {rho:g}": convergence(results, study)[1]
        for (partition, rho), study in chapter5.LONG.items()
        if partition == kind
    }
    what = "K = 300 instead of 100; the share that has settled"
    return Tried(what, listed(found, "; "))


def _spikes(kind: str, results: Results) -> Tried:
    found = {}
    for rho, costs in _by_rho(kind, results).items():
        late = costs[:, -LATE:]
        away = np.abs(late / median(late)[:, np.newaxis] - 1.0)
        steady = (away <= SETTLED / 2).mean(axis=1) >= 0.9
        found[rho] = f"{steady.mean():.0%}"
    return Tried(
        "without single trials (policies that hover beside the goal, docs/hovering.md): "
        "the share of runs that keep within 12.5% of their median in 18 of the last "
        f"{LATE} trials",
        listed(found),
    )


def _first_below(kind: str, results: Results) -> Tried:
    found = {}
    for rho, costs in _by_rho(kind, results).items():
        below = np.flatnonzero(costs.mean(axis=0) <= 3 * PENDULUM_OPTIMUM)
        found[rho] = str(below[0] + 1) if below.size else "never"
    what = "the trial at which the mean cost is first at most 3 J*"
    return Tried(what, listed(found))


def _gammas(kind: str, name: str, results: Results) -> Tried:
    small, large = (
        estimate(late_cost(results, chapter5.CHANGED[name][kind, gamma]))
        for gamma in chapter5.TWO_GAMMAS
    )
    better = "better" if large.high < small.low else "no better"
    found = f"gamma = 0.1 is {better}: cost {large} against {small} for gamma = 0.01"
    return Tried(name, found)


def _best_of_run(kind: str, results: Results) -> Tried:
    studies = chapter5.varied(kind, "gamma")
    found = {g: estimate(results.values(s).min(axis=1)) for g, s in studies.items()}
    return Tried("the cheapest policy of each run, by gamma", listed(found))


def _swung_with(name: str, results: Results) -> Tried:
    found = {}
    for gamma in chapter5.TWO_GAMMAS:
        best = best_swing_up(results, chapter5.CHANGED[name]["fuzzy", gamma])
        found[f"gamma = {gamma:g}"] = f"{best.seconds:.1f} s"
    return Tried(f"{name}: the best policy is upright after", listed(found))


def _all_turns(results: Results) -> Tried:
    found = {}
    for label, study in {**chapter5.CRISP_SWINGS, "fuzzy": pendulum("fuzzy")}.items():
        turns = [each.turns for each in swing_ups(results, study)]
        found[label] = f"{median(turns):g} [{min(turns)}, {max(turns)}]"
    what = "turns of all runs instead of the best one: median and range"
    return Tried(what, listed(found))


def _more_ants(results: Results) -> Tried:
    ends = late_costs(results, chapter5.MANY_ANTS)
    found = {f"N = {n}": estimate(costs) for n, costs in ends.items()}
    return Tried("624 fuzzy ants on every partition", listed(found))


def _median_trials(results: Results) -> Tried:
    found = {
        f"{kind}, N = {n}": estimate(median(results.values(s)[:, -10:]))
        for kind in KINDS
        for n, s in chapter5.partitions(kind).items()
    }
    what = "the median of the last ten trials instead of their mean"
    return Tried(what, listed(found))


def _structures(results: Results) -> Tried:
    found = {}
    for label, study in (
        ("fuzzy, gamma = 0.1", pendulum("fuzzy", local_decay=0.1)),
        ("crisp, gamma = 0.1", chapter5.CRISP_SWINGS["gamma = 0.1"]),
        ("crisp, M = 2000", chapter5.CRISP_SWINGS["M = 2000"]),
    ):
        shares = structure(results, study)[:3].mean(axis=1)
        found[label] = percentages(shares)
    return Tried(
        "same action as the neighbour, drives near hanging, brakes near upright, in "
        "other studies",
        listed(found, "; "),
    )


def _coasting(results: Results) -> Tried:
    idle, slow = structure(results, pendulum("fuzzy"))[3:]
    return Tried(
        "fuzzy, near upright and moving away: the share of cells that do not drive it "
        "on (torque against the motion, or none); the share that brakes among those up "
        "to 3 rad/s, which can be caught",
        f"{estimate(idle)}; {estimate(slow)}",
    )


def _gammas_of(kind: str) -> Attempts:
    return for_each(chapter5.CHANGED, partial(_gammas, kind))


TRIED_C13 = for_each(("crisp",), _longer, _first_below, _spikes)
TRIED_C14 = for_each(("fuzzy",), _spikes, _longer, _first_below)
TRIED_C15 = (*_gammas_of("crisp"), *for_each(("crisp",), _best_of_run))
TRIED_C16 = (*_gammas_of("fuzzy"), *for_each(("fuzzy",), _best_of_run))
TRIED_C18 = (*for_each(chapter5.CHANGED, _swung_with), _all_turns)
TRIED_C19 = (_more_ants, _median_trials)
TRIED_C20 = (_structures, _coasting)
