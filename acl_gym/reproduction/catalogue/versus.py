"""ACL against Q-learning, Q(lambda) and DQN (§7.3): on the four systems, and on harder ones.

The settings are those that the searches of `versus.tuned` have found.
"""

from __future__ import annotations

from dataclasses import replace

from acl_gym.reproduction.settings import Experiment, Study
from acl_gym.reproduction.versus.arenas import ARENAS, LABELS, SYSTEMS
from acl_gym.reproduction.versus.contest import Contest
from acl_gym.reproduction.versus.reference import Reference
from acl_gym.reproduction.versus.spaces import LONG, METHODS, NAMES, TABLES
from acl_gym.reproduction.versus.tuned import methods_in, settings_of

FEWER_RUNS = 10
"""Of each contest outside of the four systems."""

MORE = 4
"""How many times the interactions of the others ACL gets in its long contests."""

SLOTS = (25, 100, 400, 1600)

_TUNED = (
    "Each method with the best of 16 settings that the same search found for it here, "
    "its defaults among them, with other seeds (docs/versus.md)."
)
_LONG = (
    "The methods get the same number of interactions; ACL is run a second time with four "
    "times as many and the same settings, to see whether it lacks no more than these."
)
_JUDGED = (
    "ACL wins or loses where the 95% bootstrap interval of the ratio of interquartile "
    "means, ACL's over the rival's, lies on one side of 1."
)


def contest(name: str, method: str) -> Contest:
    """A method in an arena, with what its search has found."""
    runs = None if name in SYSTEMS else FEWER_RUNS
    return Contest(ARENAS[name], method, settings_of(name, method), most_runs=runs)


def _overview() -> Experiment:
    rows = {
        LABELS[name]: {method: contest(name, method) for method in methods_in(arena)}
        for name, arena in SYSTEMS.items()
    }
    found = _of_rows(
        "versus",
        "ACL against reinforcement learning",
        rows,
        f"The four systems at a glance; each has a figure of its own below. {_TUNED} "
        f"{_JUDGED}",
        findings="overview",
        of="System",
    )
    references = (
        Study(f"{LABELS[name]}, dynamic programming", Reference(arena))
        for name, arena in SYSTEMS.items()
    )
    return replace(found, studies=(*found.studies, *references))


def _systems() -> tuple[Experiment, ...]:
    return tuple(
        Experiment(
            f"versus-{name}",
            f"ACL against reinforcement learning: {LABELS[name]}",
            "§7.3",
            (
                *(
                    Study(METHODS[method], contest(name, method))
                    for method in methods_in(arena)
                ),
                Study("dynamic programming", Reference(arena)),
            ),
            "race",
            (),
            f"{_TUNED} {arena.steps:,} interactions for the methods with a table, "
            f"{arena.dqn_steps:,} for DQN, whose seconds are as many or more: what a "
            f"method needs of both is told. {_JUDGED}",
            findings="system",
        )
        for name, arena in SYSTEMS.items()
    )


def _harder(
    name: str, title: str, arenas: tuple[str, ...], text: str, **options: object
) -> Experiment:
    rows = {
        LABELS[arena]: {
            **{method: contest(arena, method) for method in TABLES},
            LONG: _long(arena),
        }
        for arena in arenas
    }
    text = f"{text} {_LONG} {_TUNED} {_JUDGED}"
    return _of_rows(name, title, rows, text, **options)


def _long(name: str) -> Contest:
    """ACL with the same settings and `MORE` times the interactions."""
    short = contest(name, "acl")
    return replace(short, arena=replace(short.arena, steps=MORE * short.arena.steps))


def _of_rows(
    name: str,
    title: str,
    rows: dict[str, dict[str, Contest]],
    text: str,
    **options: object,
) -> Experiment:
    findings = str(options.pop("findings", "harder"))
    return Experiment(
        name,
        title,
        "§7.3",
        tuple(
            Study(f"{label}, {NAMES[method]}", setting)
            for label, row in rows.items()
            for method, setting in row.items()
        ),
        str(options.pop("drawing", "harder")),
        (),
        text,
        {"rows": rows, **options},
        findings=findings,
    )


def _slots() -> Experiment:
    base = {method: contest("pendulum-40x41", method) for method in TABLES}
    rows = {
        f"{slots} slots": {
            method: replace(each, settings={**each.settings, "slots": slots})
            for method, each in base.items()
        }
        for slots in SLOTS
    }
    return _of_rows(
        "versus-slots",
        "More slots, as many interactions: pendulum",
        rows,
        "The more slots learn in parallel, the fewer steps one after the other the same "
        "interactions take. The other settings are those found for 40 x 41 cells. "
        f"{_JUDGED}",
        findings="slots",
        drawing="sweep",
        of="Slots",
        x=SLOTS,
        xlabel="slots",
    )


def _order() -> Experiment:
    pairs = {}
    for method in TABLES:
        forth = contest("pendulum-40x41", method)
        pairs[METHODS[method]] = (forth, replace(forth, backwards=True))
    return Experiment(
        "versus-order",
        "The same luck, slots in reverse order: pendulum",
        "§4.4",
        tuple(
            Study(f"{label}, {way}", setting)
            for label, pair in pairs.items()
            for way, setting in zip(("in order", "in reverse order"), pair, strict=True)
        ),
        "order",
        (),
        "What ACL's ants learn is merged in any order (Theorem 4.1); parallel Q-learning "
        "goes from slot to slot, each on the values as they then are. Each run is made "
        "twice with the same initial states and the same luck for every slot, the second "
        "time in reverse order. A sum in another order may differ in its last bits.",
        {"pairs": pairs},
        findings="order",
    )


EXPERIMENTS = (
    _overview(),
    *_systems(),
    _harder(
        "versus-cells",
        "Coarse partitions: pendulum",
        ("pendulum-10x11", "pendulum-16x17", "pendulum-24x25", "pendulum-40x41"),
        "As many interactions with ever more cells.",
        drawing="sweep",
        of="Cells",
        x=(110, 272, 600, 1640),
        xlabel="cells",
    ),
    _harder(
        "versus-noise",
        "Noise",
        ("grid-p0.7", "grid-p0.5", "pendulum-noise", "pendulum-slips"),
        "Moves that fail with probability 1 - p; observations with normal noise of 0.1 "
        "rad and 0.5 rad/s; actions of which every fifth is replaced by one drawn from "
        "all. Policies are evaluated under the same noise.",
    ),
    _harder(
        "versus-partial",
        "Partial states",
        ("navigation-hidden", "pendulum-sign"),
        "The vehicle does not see its velocity along the second axis; the pendulum sees "
        "in which direction it turns, and not how fast.",
    ),
    _harder(
        "versus-wholes",
        "Costs of whole solutions: pendulum",
        ("pendulum-settling", "pendulum-switches", "pendulum-peak"),
        "Settling time to within 0.3 rad and half the overshoot; the time and a half for "
        "each change of torque; the time and the top speed. ACL learns from these costs; "
        "no reward per step expresses them, so the others learn from the stage costs or "
        "from the number of steps, whichever their search found better.",
        of="Cost",
    ),
    _slots(),
    _order(),
)
