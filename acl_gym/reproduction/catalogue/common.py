"""What the lists of experiments share: sweeps, and how they are labelled."""

from __future__ import annotations

from dataclasses import replace

from acl_gym.reproduction.settings import Setting, Study

NEARLY_ONE = 0.999999
"""For gamma = 1, which lies outside of the range [0, 1) of (3.11)."""

RHOS_ROW = (0.0, 0.1, 0.2, 0.5, 0.9, 1.0)
GAMMAS_ROW = (0.01, 0.05, 0.1, 0.2, 0.5, 0.9)
RHOS = (0.0, 0.001, 0.01, 0.1, 0.5, 1.0)
GAMMAS = (0.0, 0.001, 0.01, 0.1, 0.5, NEARLY_ONE)
ANTS = (100, 250, 500, 1000, 1500, 2000)
SIZES = {"11x11": 86, "21x21": 278, "31x31": 640}
KINDS = ("crisp", "fuzzy")

_NUMBER = {NEARLY_ONE: "1"}


def number(value: float) -> str:
    """A parameter as a figure labels it."""
    return _NUMBER.get(value, f"{value:g}")


FEWER = 10
"""Runs of what is tried beside the thesis's experiments and takes long."""


def fewer(settings: dict[str, Setting]) -> dict[str, Setting]:
    """The same with `FEWER` runs."""
    return {
        label: replace(setting, most_runs=FEWER) for label, setting in settings.items()
    }


def studies(settings: dict[str, Setting]) -> tuple[Study, ...]:
    """Settings under their labels."""
    return tuple(Study(label, setting) for label, setting in settings.items())
