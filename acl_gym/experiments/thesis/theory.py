"""Figures 3.3 and 3.4, and the claims C21 to C23: §3.4 on the two-state system."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from acl_gym import theory
from acl_gym.experiments.claims import Part, Tried
from acl_gym.experiments.results import Results
from acl_gym.experiments.study import Study
from acl_gym.experiments.systems import two_state
from acl_gym.experiments.thesis.common import (
    claim,
    experiment,
    listed,
    percentages,
    sweep,
)
from acl_gym.utils.typing import BoolArray

ANTS = (1, 2, 8)
GAMMAS = (0.0, 0.1, 0.5)

LIMIT = 100
"""How many trials at the end stand for the limit."""

DEPOSITS = 1.0 / np.array([1.0, 2.0, 4.0])
"""1 / J of the three actions in q'."""

_BAND = sweep("M", ANTS, two_state)
_GAPS = {
    f"M = {ants}, gamma = {gamma:g}": two_state(ants, local_decay=gamma)
    for ants in ANTS
    for gamma in GAMMAS
}

EXPERIMENTS = (
    experiment(
        *("fig3.3", "The level in q between its bounds", "§3.4.7"),
        *(_BAND, "C21 C22", "level_band"),
        text="The two-state system of Figure 3.2 with costs 1, 2 and 4, epsilon-greedy "
        "ants (epsilon = 0.1), rho = gamma = 0.1. The thesis draws an illustration; "
        "this is simulated: the mean over the runs between the bounds of Propositions "
        "3.8 and 3.9, and the range of all runs.",
    ),
    experiment(
        *("fig3.4", "The gap between the levels of the two policies", "§3.4.8"),
        *(_GAPS, "C21 C22 C23", "policy_gap"),
        text="The gap between the levels, Delta of eq. (3.31), is positive for one ant "
        "and negative for more, where the two best actions cost 1 and 2. The figure "
        "shows how many runs keep the optimal policy to the end, and how many still "
        "change theirs.",
    ),
)


def parameters(study: Study) -> tuple[int, float, float, float]:
    """M, tau0, gamma and rho, in the order in which `acl_gym.theory` takes them."""
    tau0, gamma, rho = (
        study.settings[name] for name in ("tau0", "local_decay", "global_decay")
    )
    return study.slots, tau0, gamma, rho


def expected_deposits(study: Study) -> tuple[float, float]:
    """The expected deposit while the best action leads in q', and the second best."""
    epsilon = study.settings["epsilon"]
    return (
        float(theory.expected_deposit(epsilon, DEPOSITS)),
        float(theory.expected_deposit(epsilon, DEPOSITS[[1, 0, 2]])),
    )


def gap(study: Study) -> float:
    """Delta, the gap between the levels of the two policies, eq. (3.31)."""
    return float(theory.policy_gap(*parameters(study), *expected_deposits(study)))


def kept(results: Results, study: Study) -> BoolArray:
    """Whether the optimal action leads in q' over the last trials, `(runs,)`."""
    best, second = (results.values(study, f"level_{n}") for n in ("best", "second"))
    return np.asarray((best > second)[:, -LIMIT:].all(axis=1))


def _one_ant() -> list[tuple[float, Study, float]]:
    """gamma, the study of one ant, and the limit of its mean level, §3.4.7."""
    found = []
    for gamma in GAMMAS:
        study = two_state(1, local_decay=gamma)
        deposit = expected_deposits(study)[0]
        limit = theory.one_ant_limit(*parameters(study)[1:], deposit)
        found.append((gamma, study, float(limit)))
    return found


@claim()
def _c21(results: Results) -> Iterator[Part]:
    lowest, highest = math.inf, 0.0
    for study in (*_BAND.values(), *_GAPS.values()):
        bound = float(theory.level_bound(*parameters(study), DEPOSITS[0]))
        low = results.values(study, "lowest_level").min()
        high = results.values(study, "highest_level").max()
        lowest = min(lowest, low / study.settings["tau0"])
        highest = max(highest, high / bound)
    statement = "the lowest level of all runs, studies and trials is at least tau0"
    yield Part(statement, f"{lowest:.6f} times tau0", lowest >= 1 - 1e-9)
    statement = "the highest level is at most the bound of eq. (3.23)"
    yield Part(statement, f"{highest:.3f} times the bound", highest <= 1 + 1e-9)


def _over_more_trials(results: Results) -> Tried:
    found = {}
    for gamma, study, limit in _one_ant():
        levels = results.values(study, "level_q")
        mean = levels[:, levels.shape[1] // 2 :].mean()  # less noise
        found[f"gamma = {gamma:g}"] = f"{mean:.4f} against {limit:.4f}"
    what = "the mean over the second half of the trials of all runs"
    return Tried(what, listed(found))


@claim(_over_more_trials)
def _c22(results: Results) -> Iterator[Part]:
    for gamma, study, limit in _one_ant():
        late = results.values(study, "level_q")[:, -LIMIT:].mean(axis=1)
        for which, runs in (
            ("all runs", late),
            ("the runs that keep the optimal action", late[kept(results, study)]),
        ):
            if not runs.size:
                continue
            error = runs.std(ddof=1) / math.sqrt(runs.size) if runs.size > 1 else 0.0
            yield Part(
                f"gamma = {gamma:g}: the mean level of {which} over the last {LIMIT} "
                f"trials is {limit:.4f} within two standard errors and 1%",
                f"{runs.mean():.4f} +- {2 * error:.4f} ({runs.size} runs)",
                abs(runs.mean() - limit) <= 2 * error + 0.01 * limit,
            )


def _each_gap(results: Results) -> Tried:
    found = {
        label: f"Delta {gap(study):.3g}, {kept(results, study).mean():.0%}"
        for label, study in _GAPS.items()
    }
    return Tried("Delta and the runs that keep the optimal action", listed(found, "; "))


@claim(_each_gap)
def _c23(results: Results) -> Iterator[Part]:
    shares = [(gap(each), kept(results, each).mean()) for each in _GAPS.values()]
    positive = [share for delta, share in shares if delta > 0]
    negative = [share for delta, share in shares if delta <= 0]
    yield Part(
        "where Delta > 0, at least nine of ten runs keep the optimal action in q' over "
        f"the last {LIMIT} trials",
        f"{percentages(positive)} of the runs",
        min(positive) >= 0.9,
    )
    statement = "where Delta < 0, fewer do so in at least one study"
    yield Part(statement, f"{percentages(negative)} of the runs", min(negative) < 0.9)


CLAIMS = (_c21, _c22, _c23)
