"""The experiments of §5.3, the pendulum, and those tried beside them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from acl_gym.experiments.study import Experiment, Study
from acl_gym.experiments.systems import pendulum
from acl_gym.experiments.thesis.common import (
    KINDS,
    NEARLY_ONE,
    READINGS,
    experiment,
    fewer,
    sweep,
)

RHOS = (0.0, 0.001, 0.01, 0.1, 0.5, 1.0)
GAMMAS = (0.0, 0.001, 0.01, 0.1, 0.5, NEARLY_ONE)
ANTS = (100, 250, 500, 1000, 1500, 2000)
TWO_GAMMAS = (0.01, 0.1)
"""The gammas whose policies the thesis shows, and with which other choices are tried."""

CELLS = (16, 32, 64)
"""N = N_theta = N_omega - 1 of Figures 5.16 and 5.17."""

MANY_ANTS = {n: pendulum("fuzzy", 624, (n, n + 1)) for n in CELLS}
"""As many fuzzy ants on each partition as on the finest one, by N."""

LONG = {
    (kind, rho): replace(pendulum(kind, global_decay=rho), trials=300)
    for kind, rho in (("crisp", 0.1), ("crisp", 0.5), ("fuzzy", 0.001), ("fuzzy", 1.0))
}
"""Three times as many trials, by partition and rho."""

CRISP_SWINGS = {
    "rho = 0.001": pendulum("crisp", global_decay=0.001),
    "gamma = 0.1": pendulum("crisp", local_decay=0.1),
    "M = 2000": pendulum("crisp", 2000),
}
"""The crisp studies whose best policies are shown as they swing the pendulum up."""

_PAIRS = {(k, g): pendulum(k, local_decay=g) for k in KINDS for g in TWO_GAMMAS}
LIMITS = {
    f"omega_max = {limit:g} rad/s": {
        pair: replace(study, task=replace(study.task, env={"omega_max": limit}))
        for pair, study in _PAIRS.items()
    }
    for limit in (7.0, 15.0)
}
UPDATES = {
    f"local update {reading}": {
        pair: study.with_settings(update=update) for pair, study in _PAIRS.items()
    }
    for reading, update in READINGS.items()
}
CHANGED = LIMITS | UPDATES
"""Studies with another choice, by partition and gamma."""


def varied(kind: str, symbol: str) -> dict[float, Study]:
    """The studies of a figure that varies rho, gamma or M, by its value."""
    if symbol == "M":
        return {ants: pendulum(kind, ants) for ants in ANTS}
    if symbol == "rho":
        return {rho: pendulum(kind, global_decay=rho) for rho in RHOS}
    return {gamma: pendulum(kind, local_decay=gamma) for gamma in GAMMAS}


def partitions(kind: str) -> dict[int, Study]:
    """The studies of Figure 5.16, crisp, or 5.17, fuzzy, by N."""
    share = 0.6 if kind == "crisp" else 0.15
    return {n: pendulum(kind, round(share * n * (n + 1)), (n, n + 1)) for n in CELLS}


def _both(gamma: float) -> dict[str, Study]:
    return {kind: pendulum(kind, local_decay=gamma) for kind in KINDS}


def _panels(changed: dict[str, dict[tuple[str, float], Study]]) -> dict[str, Study]:
    panels = {
        f"{kind}, {name}, gamma = {gamma:g}": study
        for name, studies in changed.items()
        for (kind, gamma), study in studies.items()
    }
    return fewer(panels)


def _figure(
    number: int, title: str, studies: Mapping[str, Study], *how: str, text: str = ""
) -> Experiment:
    section = f"§5.3.{1 + sum(number > last for last in (6, 11, 15))}"
    name, title = f"fig5.{number}", f"Pendulum{title}"
    return experiment(name, title, section, studies, *how, text=text)


def _sweep(number: int, kind: str, symbol: str, claim: str, text: str) -> Experiment:
    what = "number of ants" if symbol == "M" else symbol
    studies = varied(kind, symbol)
    panels = sweep(symbol, studies, studies.__getitem__)
    return _figure(number, f", {kind}, varying {what}", panels, claim, text=text)


def _swing_up(number: int, kind: str, label: str, study: Study) -> Experiment:
    title, studies = f" swung up by the {kind} policy", {f"{kind}, {label}": study}
    return _figure(number, f"{title}, {label}", studies, "C18", "swing", text=_HANGING)


def _cells(number: int, kind: str) -> Experiment:
    studies = {f"N = {n}, M = {s.slots}": s for n, s in partitions(kind).items()}
    title, how = f", {kind}, varying partition", ("C19", "bands_and_policies")
    return _figure(number, title, studies, *how, text=_N)


_HANGING = (
    "From hanging at rest, by the last policy of the run whose last policy is the "
    "cheapest."
)
_N = (
    "N = N_theta = N_omega - 1; the number of ants is 60% of that of the cells for crisp "
    "ants, and 15% for fuzzy ones."
)
_GREYS = (
    "White is the full positive torque, black the full negative one, grey none; on a "
    "grid four times finer than the partition. rho = 0.1."
)
_TABLE = (
    "gamma = 0.01, 250 ants, Table 5.2. The thesis does not say omega_max; here it is "
    "9 rad/s."
)
_GAMMA_ONE = (
    "rho = 0.1, 250 ants. gamma = 1 lies outside the range that the thesis gives it; "
    "0.999999 is used instead."
)
_FIG15 = ", policies of 2000 crisp and 250 fuzzy ants"
_MANY = {
    "crisp, M = 2000": pendulum("crisp", 2000),
    "fuzzy, M = 250": pendulum("fuzzy"),
}

EXPERIMENTS = (
    _sweep(2, "crisp", "rho", "C13", _TABLE),
    _swing_up(3, "crisp", "rho = 0.001", CRISP_SWINGS["rho = 0.001"]),
    _sweep(4, "fuzzy", "rho", "C14", "gamma = 0.01, 250 ants."),
    _swing_up(5, "fuzzy", "rho = 0.1", pendulum("fuzzy")),
    _figure(6, ", policies, gamma = 0.01", _both(0.01), "C20", "policies", text=_GREYS),
    _sweep(7, "crisp", "gamma", "C15", _GAMMA_ONE),
    _swing_up(8, "crisp", "gamma = 0.1", CRISP_SWINGS["gamma = 0.1"]),
    _sweep(9, "fuzzy", "gamma", "C16", _GAMMA_ONE),
    _swing_up(10, "fuzzy", "gamma = 0.1", pendulum("fuzzy", local_decay=0.1)),
    _figure(11, ", policies, gamma = 0.1", _both(0.1), "C20", "policies", text=_GREYS),
    _sweep(12, "crisp", "M", "C17", "rho = 0.1, gamma = 0.01."),
    _swing_up(13, "crisp", "M = 2000", CRISP_SWINGS["M = 2000"]),
    _sweep(14, "fuzzy", "M", "C17", "rho = 0.1, gamma = 0.01."),
    _figure(15, _FIG15, _MANY, "C20", "policies", text=_GREYS),
    _cells(16, "crisp"),
    _cells(17, "fuzzy"),
    experiment(
        *("omega-max", "Pendulum with other bounds on the velocity", "§5.2.2"),
        studies=_panels(LIMITS),
        explains="C15 C16 C18",
        text="The thesis does not say omega_max; it is 9 rad/s in the other experiments. "
        "The cells cover the same range as the velocity.",
        options={"columns": 2},
    ),
    experiment(
        *("local-update", "Pendulum: other readings of the local update", "§5.3.2"),
        studies=_panels(UPDATES),
        explains="C15 C16 C18",
        text="The readings of row-orders.",
        options={"columns": 2},
    ),
    experiment(
        *("pendulum-long", "Pendulum: more trials", "§5.3.1"),
        studies=fewer({f"{kind}, rho = {rho:g}": s for (kind, rho), s in LONG.items()}),
        explains="C13 C14",
        text="K = 300: whether what has not settled after 100 trials does so later.",
    ),
    experiment(
        name="fuzzy-ants",
        title="Pendulum, fuzzy, varying partition, one number of ants",
        section="§5.3.4",
        studies=fewer({f"N = {n}, M = 624": MANY_ANTS[n] for n in CELLS[:-1]}),
        plot="bands_and_policies",
        explains="C19",
        text="The coarse partitions of Figure 5.17 with as many ants as the finest one.",
    ),
)
