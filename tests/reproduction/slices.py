"""A small slice of every experiment: few ants, few trials, short walks."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

from acl_gym.reproduction.catalogue import EXPERIMENTS
from acl_gym.reproduction.evidence import Evidence
from acl_gym.reproduction.reproduce import settings_of
from acl_gym.reproduction.settings import Runnable, Setting

TRIALS, SEEDS = 6, 2


def shortened(setting: Runnable) -> Any:
    """The same cells and parameters, a fraction of the work."""
    if not isinstance(setting, Setting):
        return setting.brief()
    steps = min(setting.colony["max_steps"], 25)
    return replace(
        setting,
        ants=min(setting.ants, 12),
        trials=TRIALS,
        colony={**setting.colony, "max_steps": steps},
        evaluation_steps=min(steps, 15),
    )


def runs_of(most: int | None) -> int:
    """How many runs a setting with so many at most has here."""
    return SEEDS if most is None else min(SEEDS, most)


def silent(fraction: float) -> None:
    """Nobody listens."""


@cache
def evidence() -> Evidence:
    """Runs of the slice under the keys of the whole settings."""
    results: dict[str, list[dict[str, Any]]] = {
        setting.key: [
            setting.learner(shortened(setting), seed, silent)
            for seed in range(runs_of(setting.most_runs))
        ]
        for setting in settings_of(EXPERIMENTS)
    }
    return Evidence(results)
