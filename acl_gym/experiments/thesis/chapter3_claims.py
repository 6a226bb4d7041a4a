"""The claims C1 to C8 on the grid searches of §3.6, and what was tried beside them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from acl_gym.experiments.claims import Part, Tried, settled_from
from acl_gym.experiments.methods import restore_policy
from acl_gym.experiments.results import Results
from acl_gym.experiments.statistics import estimate, median, rank_correlation, ratio
from acl_gym.experiments.study import Study
from acl_gym.experiments.systems import (
    GRID_STATES,
    free_states,
    grid_1d,
    grid_2d,
    grid_optimum,
)
from acl_gym.experiments.thesis import chapter3
from acl_gym.experiments.thesis.common import (
    LATE,
    centres,
    claim,
    for_each,
    listed,
    percentages,
)
from acl_gym.planning.model import TabularModel
from acl_gym.planning.value_iteration import policy_value, value_iteration
from acl_gym.utils.typing import BoolArray, FloatArray, IntArray

OPTIMUM_1D = 5.0
"""J* of the 1-D grid of ten states."""


def optimal(results: Results, study: Study) -> BoolArray:
    """On the 1-D grid, whether the policy is optimal, `(runs, trials)`."""
    return np.asarray(results.values(study) <= OPTIMUM_1D + 1e-9)


def best_actions(results: Results, study: Study) -> IntArray:
    """The last policy of each run, `(runs, cells)`."""
    runs = results.runs(study)
    return np.array([restore_policy(study, run).best_actions() for run in runs])


def exact_costs(results: Results, study: Study) -> FloatArray:
    """The cost of each run's last policy; infinite if a state never gets to the goal."""
    model = TabularModel.from_env(study.task.make_system_env(1))
    free, policies = free_states(study), best_actions(results, study)
    return np.array([-policy_value(model, each)[free].mean() for each in policies])


def agreement(actions: IntArray) -> float:
    """How often two runs of a study have the same action in a cell."""
    return float((actions == np.roll(actions, 1, axis=0)).mean())


def trials_to(results: Results, study: Study, share: float) -> FloatArray:
    """The trial at which the cost of a run first comes within a share of its end."""
    costs = results.values(study)
    end = median(costs[:, -LATE:])[:, np.newaxis]
    return np.asarray((costs <= (1.0 + share) * end).argmax(axis=1) + 1.0)


def _read_as(reading: str, results: Results) -> Tried:
    found = {
        gamma: estimate(results.values(study).mean(axis=1))
        for gamma, study in {0.0: grid_1d(), **chapter3.READ_AS[reading]}.items()
    }
    what = f"local update {reading}: mean cost over the trials, by gamma"
    return Tried(what, listed(found))


def _first_trials(results: Results) -> Tried:
    studies = {gamma: grid_1d(local_decay=gamma) for gamma in (0.0, *chapter3.GAMMAS)}
    firsts = {g: settled_from(optimal(results, s)) for g, s in studies.items()}
    found = {gamma: f"{median(first):g}" for gamma, first in firsts.items()}
    return Tried("the median trial from which on J = 5, by gamma", listed(found))


def _one_ant(results: Results) -> Tried:
    ends = {c: optimal(results, study)[:, -1] for c, study in chapter3.ONE_ANT.items()}
    found = {choice: f"{end.mean():.0%}" for choice, end in ends.items()}
    return Tried("one ant, runs that end at J = 5 with other choices", listed(found))


def _every_run(results: Results) -> Tried:
    shortest, found = grid_optimum(grid_2d()), {}
    for p in chapter3.PROBABILITIES:
        costs = exact_costs(results, grid_2d(p=p))
        near, lost = np.mean(costs * p / shortest <= 1.1), np.isinf(costs).mean()
        found[f"p = {p:g}"] = f"{near:.0%} ({lost:.0%} with a cell that never arrives)"
    what = "runs whose last policy costs at most 1.1 times the claim"
    return Tried(what, listed(found))


def _costs_with(choice: str, results: Results) -> Tried:
    found = {}
    for p, study in chapter3.CHOICES[choice].items():
        cost, optimum = estimate(exact_costs(results, study)), grid_optimum(study)
        found[f"p = {p:g}"] = f"{cost} (optimum {optimum:.2f})"
    return Tried(f"{choice}: cost of the last policy", listed(found))


def _agreement_with(choice: str, results: Results) -> Tried:
    studies = chapter3.CHOICES[choice].values()
    low, high = (best_actions(results, study) for study in studies)
    return Tried(
        f"{choice}: cells with the same action at both p, of all cells; and in two "
        "runs at one p",
        f"{(low == high).mean():.0%}, and {agreement(low):.0%} (p = 0.5), "
        f"{agreement(high):.0%} (p = 0.9)",
    )


def _within(share: float, results: Results) -> Tried:
    studies = chapter3.COVERED
    trials = {each: trials_to(results, s, share) for each, s in studies.items()}
    found = {f"{s}, {a:.0%}": f"{median(t):g}" for (s, a), t in trials.items()}
    return Tried(f"median trials until within {share:.0%} of the end", listed(found))


@claim()
def _c1(results: Results) -> Iterator[Part]:
    late = optimal(results, grid_1d(global_decay=0.0))[:, -LATE:].all(axis=1)
    statement = f"no run keeps J = 5 over the last {LATE} trials"
    yield Part(statement, f"{late.sum()} of {late.size} runs", not late.any())


@claim()
def _c2(results: Results) -> Iterator[Part]:
    late = optimal(results, grid_1d())[:, -LATE:].all(axis=1)
    statement = f"every run keeps J = 5 over the last {LATE} trials"
    yield Part(statement, f"{late.sum()} of {late.size} runs", bool(late.all()))


@claim()
def _c3(results: Results) -> Iterator[Part]:
    for rho in (0.9, 1.0):
        reached = optimal(results, grid_1d(global_decay=rho))
        once = reached.any(axis=1).mean()
        left = np.mean([run.any() and not run[run.argmax() :].all() for run in reached])
        statement = f"rho = {rho:g}: at least nine of ten runs reach J = 5 once"
        yield Part(statement, f"{once:.0%}", once >= 0.9)
        statement = f"rho = {rho:g}: at least half of the runs leave it again"
        yield Part(statement, f"{left:.0%}", bool(left >= 0.5))


@claim(*for_each(chapter3.READ_AS, _read_as), _first_trials)
def _c4(results: Results) -> Iterator[Part]:
    studies = {gamma: grid_1d(local_decay=gamma) for gamma in (0.0, *chapter3.GAMMAS)}
    # The mean over the trials is low where learning is both fast and good.
    means = {gamma: results.values(s).mean(axis=1) for gamma, s in studies.items()}
    costs = centres(means)
    yield Part(
        "no gamma has a lower mean cost over the trials than gamma = 0: no interval of "
        "its ratio to that of gamma = 0 lies below 1",
        listed(costs),
        all(not ratio(each, means[0.0]).high < 1 for each in means.values()),
    )
    rank = rank_correlation(list(costs), list(costs.values()))
    statement = "the mean cost rises with gamma: rank correlation of at least 0.9"
    yield Part(statement, f"{rank:.2f}", rank >= 0.9)


@claim(_one_ant)
def _c5(results: Results) -> Iterator[Part]:
    reached = [optimal(results, grid_1d(ants)) for ants in (1, 5, 9)]
    first = [float(median(settled_from(each))) for each in reached]
    ends = [float(each[:, -1].mean()) for each in reached]
    statement = "the median trial from which on J = 5 falls from 1 to 5 to 9 ants"
    measured = ", ".join(f"{each:g}" for each in first)
    yield Part(statement, measured, first[0] > first[1] > first[2])
    statement = "with each number of ants at least 95% of the runs end at J = 5"
    yield Part(statement, percentages(ends), min(ends) >= 0.95)


@claim(_every_run, *for_each(chapter3.CHOICES, _costs_with))
def _c6(results: Results) -> Iterator[Part]:
    shortest = grid_optimum(grid_2d())
    for p in chapter3.PROBABILITIES:
        found = estimate(exact_costs(results, grid_2d(p=p)))
        yield Part(
            f"p = {p:g}: the last policies cost {shortest / p:.2f} within 10% in the "
            "interquartile mean",
            str(found),
            abs(found.value * p / shortest - 1) <= 0.1,
        )


@claim(*for_each(chapter3.CHOICES, _agreement_with))
def _c7(results: Results) -> Iterator[Part]:
    study = grid_2d()
    free = free_states(study)
    values = value_iteration(study.task.make_system_env(1)).action_values[free]
    best = values >= values.max(axis=1, keepdims=True) - 1e-6
    cells = free[best.sum(axis=1) == 1]
    low, high = (best_actions(results, grid_2d(p=p))[:, cells] for p in (0.5, 0.9))
    between = float((low == high).mean())
    within = (agreement(low) + agreement(high)) / 2
    statement = "where one action is best, the policies agree in at least 90% of cells"
    yield Part(statement, f"{between:.0%}", between >= 0.9)
    statement = "they agree as often as two runs at one p, within 5 percentage points"
    measured = f"{between:.0%} against {within:.0%}"
    yield Part(statement, measured, between >= within - 0.05)


@claim(*for_each((0.1, 0.25), _within))
def _c8(results: Results) -> Iterator[Part]:
    trials = {each: trials_to(results, s, 0.05) for each, s in chapter3.COVERED.items()}
    for size in GRID_STATES:
        found = ratio(trials[size, 0.2], trials[size, 1.0])
        yield Part(
            f"{size}: a fifth of the ants needs at least 1.5 times as many trials until "
            "the cost first comes within 5% of its end",
            str(found),
            found.value >= 1.5,
        )
    for share in chapter3.SHARES:
        found = ratio(trials["31x31", share], trials["11x11", share])
        yield Part(
            f"ants as {share:.0%} of the states: 7.4 times as many states need at most "
            "twice as many trials",
            str(found),
            found.value <= 2.0,
        )


CLAIMS = (_c1, _c2, _c3, _c4, _c5, _c6, _c7, _c8)
