"""Claims C21 to C23: the theory of §3.4, on the system of Figure 3.2."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from acl_gym import theory
from acl_gym.reproduction.catalogue import BY_NAME
from acl_gym.reproduction.evidence import Evidence
from acl_gym.reproduction.settings import Setting, Study
from acl_gym.reproduction.systems import two_state
from acl_gym.reproduction.verdicts import Claim, Part, Tried

DEPOSITS = 1.0 / np.array([1.0, 2.0, 4.0])
"""1 / J of the three actions in q'."""

LATE = 100
"""So many trials at the end are the limit."""


def common(setting: Setting) -> tuple[int, float, float, float]:
    """M, tau0, gamma and rho, as `acl_gym.theory` takes them."""
    colony = setting.colony
    return (
        setting.ants,
        colony["tau0"],
        colony["local_decay"],
        colony["global_decay"],
    )


def expected_deposits(setting: Setting) -> tuple[float, float]:
    """J_exp^-1, and the same while the second-best action is taken for the best."""
    epsilon = setting.colony["epsilon"]
    second = DEPOSITS[[1, 0, 2]]
    return (
        float(theory.expected_deposit(epsilon, DEPOSITS)),
        float(theory.expected_deposit(epsilon, second)),
    )


def _studies() -> list[Study]:
    return [*BY_NAME["fig3.3"].studies, *BY_NAME["fig3.4"].studies]


def c21(evidence: Evidence) -> list[Part]:
    """Levels stay within [tau0, (3.23)]."""
    lowest, highest = math.inf, 0.0
    for study in _studies():
        setting = study.setting
        bound = float(theory.level_bound(*common(setting), DEPOSITS[0]))
        low = evidence.rows(setting, "lowest_level").min()
        high = evidence.rows(setting, "highest_level").max()
        lowest = min(lowest, low / setting.colony["tau0"])
        highest = max(highest, high / bound)
    return [
        Part(
            "the lowest level of all runs, settings and trials is tau0 or more",
            f"{lowest:.6f} times tau0",
            lowest >= 1 - 1e-9,
        ),
        Part(
            "the highest is at most (3.23)",
            f"{highest:.3f} times the bound",
            highest <= 1 + 1e-9,
        ),
    ]


def c22(evidence: Evidence) -> list[Part]:
    """For one ant the mean level goes to the limit of §3.4.7."""
    parts = []
    for gamma in (0.0, 0.1, 0.5):
        setting = two_state(1, local_decay=gamma)
        limit = float(
            theory.one_ant_limit(*common(setting)[1:], expected_deposits(setting)[0])
        )
        late = evidence.rows(setting, "level_q")[:, -LATE:].mean(axis=1)
        for which, runs in (
            ("of all runs", late),
            ("of the runs that keep u*", late[_kept(evidence, setting)]),
        ):
            if not runs.size:
                continue
            error = runs.std(ddof=1) / math.sqrt(runs.size) if runs.size > 1 else 0.0
            parts.append(
                Part(
                    f"gamma = {gamma:g}: the mean level {which} over the last {LATE} "
                    f"trials is {limit:.4f} within two standard errors and 1%",
                    f"{runs.mean():.4f} +- {2 * error:.4f} ({runs.size} runs)",
                    bool(abs(runs.mean() - limit) <= 2 * error + 0.01 * limit),
                )
            )
    return parts


def longer_mean(evidence: Evidence) -> Tried:
    """More trials for the mean, which follow on one another: more of them, less noise."""
    found = []
    for gamma in (0.0, 0.1, 0.5):
        setting = two_state(1, local_decay=gamma)
        limit = float(
            theory.one_ant_limit(*common(setting)[1:], expected_deposits(setting)[0])
        )
        levels = evidence.rows(setting, "level_q")
        mean = levels[:, levels.shape[1] // 2 :].mean()
        found.append(f"gamma = {gamma:g}: {mean:.4f} against {limit:.4f}")
    return Tried(
        "the mean over the second half of the trials of all runs", ", ".join(found)
    )


def by_ants(evidence: Evidence) -> Tried:
    """How many runs settle under each setting, beside Delta."""
    found = []
    for study in BY_NAME["fig3.4"].studies:
        setting = study.setting
        gap = float(theory.policy_gap(*common(setting), *expected_deposits(setting)))
        found.append(
            f"{study.label}: Delta {gap:.3g}, {settled(evidence, setting):.0%}"
        )
    return Tried("Delta and the runs that keep u*, one by one", "; ".join(found))


def c23(evidence: Evidence) -> list[Part]:
    """Delta > 0 predicts a settled policy."""
    positive: list[float] = []
    negative: list[float] = []
    for study in BY_NAME["fig3.4"].studies:
        gap = float(
            theory.policy_gap(*common(study.setting), *expected_deposits(study.setting))
        )
        (positive if gap > 0 else negative).append(settled(evidence, study.setting))
    return [
        Part(
            "where Delta > 0, nine of ten runs keep the optimal action in q' over the "
            f"last {LATE} trials",
            ", ".join(f"{each:.0%}" for each in positive) + " of the runs",
            min(positive) >= 0.9,
        ),
        Part(
            "where Delta < 0 fewer do in some setting",
            ", ".join(f"{each:.0%}" for each in negative) + " of the runs",
            min(negative) < 0.9,
        ),
    ]


def _kept(evidence: Evidence, setting: Setting) -> Any:
    """Of each run, whether u* leads in q' over the last trials."""
    best = evidence.rows(setting, "level_best")[:, -LATE:]
    second = evidence.rows(setting, "level_second")[:, -LATE:]
    return (best > second).all(axis=1)


def settled(evidence: Evidence, setting: Setting) -> float:
    """The share of runs whose best action in q' is the optimal one to the end."""
    return float(_kept(evidence, setting).mean())


CLAIMS = (
    Claim(
        "C21",
        "The levels stay between tau0 and the bound (3.23).",
        "§3.4.5",
        c21,
    ),
    Claim(
        "C22",
        "For one ant the mean level converges to the limit of §3.4.7.",
        "§3.4.7",
        c22,
        (longer_mean,),
    ),
    Claim(
        "C23",
        "Delta > 0 predicts a settled policy on the two-state system of Figure 3.2.",
        "§3.4.8",
        c23,
        (by_ants,),
    ),
)
