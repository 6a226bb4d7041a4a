"""What was tried to understand the claims C13 to C20 where they do not hold."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from acl_gym.experiments.claims import Tried
from acl_gym.experiments.results import Results
from acl_gym.experiments.statistics import estimate
from acl_gym.experiments.systems import pendulum
from acl_gym.experiments.thesis import chapter5
from acl_gym.experiments.thesis import chapter5_measures as measures
from acl_gym.experiments.thesis.common import KINDS, Attempt, listed, sweep
from acl_gym.utils.typing import FloatArray


def _by_rho(kind: str, results: Results) -> dict[str, FloatArray]:
    studies = chapter5.varied(kind, "rho")
    positive = [rho for rho in studies if rho > 0]
    return sweep("rho", positive, lambda rho: results.values(studies[rho]))


def _longer(kind: str, results: Results) -> Tried:
    found = {
        f"{kind}, rho = {rho:g}": measures.convergence(results, study)[1]
        for (partition, rho), study in chapter5.LONG.items()
        if partition == kind
    }
    what = "K = 300 instead of 100; the share that has settled"
    return Tried(what, listed(found, "; "))


def _spikes(kind: str, results: Results) -> Tried:
    found = {}
    for rho, costs in _by_rho(kind, results).items():
        late = costs[:, -20:]
        away = np.abs(late / np.median(late, axis=1, keepdims=True) - 1.0)
        steady = (away <= measures.SETTLED / 2).mean(axis=1) >= 0.9
        found[rho] = f"{steady.mean():.0%}"
    return Tried(
        "without single trials (policies that hover beside the goal, docs/hovering.md): "
        "the share of runs that keep within 12.5% of their median in 18 of the last 20 "
        "trials",
        listed(found),
    )


def _first_below(kind: str, results: Results) -> Tried:
    found = {}
    for rho, costs in _by_rho(kind, results).items():
        below = np.flatnonzero(costs.mean(axis=0) <= 3 * measures.OPTIMUM)
        found[rho] = str(below[0] + 1) if below.size else "never"
    return Tried(
        "the trial at which the mean cost is first at most 3 J*", listed(found)
    )


def _gammas(kind: str, name: str, results: Results) -> Tried:
    small, large = (
        estimate(measures.late_cost(results, chapter5.CHANGED[name][kind, gamma]))
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
    ups = {
        g: measures.best_swing_up(results, chapter5.CHANGED[name]["fuzzy", g])
        for g in chapter5.TWO_GAMMAS
    }
    found = {f"gamma = {g:g}": f"{up.seconds:.1f} s" for g, up in ups.items()}
    return Tried(f"{name}: the best policy is upright after", listed(found))


def _all_turns(results: Results) -> Tried:
    found = {}
    for label, study in {**chapter5.CRISP_SWINGS, "fuzzy": pendulum("fuzzy")}.items():
        turns = [each.turns for each in measures.swing_ups(results, study)]
        found[label] = f"{np.median(turns):g} [{min(turns)}, {max(turns)}]"
    what = "turns of all runs instead of the best one: median and range"
    return Tried(what, listed(found))


def _more_ants(results: Results) -> Tried:
    found = {
        f"N = {n}": estimate(measures.late_cost(results, s))
        for n, s in chapter5.MANY_ANTS.items()
    }
    return Tried("624 fuzzy ants on every partition", listed(found))


def _median_trials(results: Results) -> Tried:
    found = {
        f"{kind}, N = {n}": estimate(np.median(results.values(s)[:, -10:], axis=1))
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
        shares = np.mean(
            [m.structure for m in measures.torque_maps(results, study)], axis=0
        )
        found[label] = ", ".join(f"{share:.0%}" for share in shares)
    return Tried(
        "same action as the neighbour, drives near hanging, brakes near upright, in "
        "other studies",
        listed(found, "; "),
    )


def _coasting(results: Results) -> Tried:
    maps = measures.torque_maps(results, pendulum("fuzzy"))
    idle = [(each.along <= 0)[each.leaving_upright].mean() for each in maps]
    slow = [
        (each.along < 0)[each.leaving_upright & (each.speed <= 3.0)].mean()
        for each in maps
    ]
    return Tried(
        "fuzzy, near upright and moving away: the share of cells that do not drive it "
        "on (torque against the motion, or none); the share that brakes among those up "
        "to 3 rad/s, which can be caught",
        f"{estimate(idle)}; {estimate(slow)}",
    )


def _for(kind: str, *functions: Callable[[str, Results], Tried]) -> tuple[Attempt, ...]:
    return tuple(partial(function, kind) for function in functions)


def _for_each_change(kind: str) -> tuple[Attempt, ...]:
    return tuple(partial(_gammas, kind, name) for name in chapter5.CHANGED)


C13 = _for("crisp", _longer, _first_below, _spikes)
C14 = _for("fuzzy", _spikes, _longer, _first_below)
C15 = (*_for_each_change("crisp"), *_for("crisp", _best_of_run))
C16 = (*_for_each_change("fuzzy"), *_for("fuzzy", _best_of_run))
C18: tuple[Attempt, ...] = (
    *(partial(_swung_with, name) for name in chapter5.CHANGED),
    _all_turns,
)
C19 = (_more_ants, _median_trials)
C20 = (_structures, _coasting)
