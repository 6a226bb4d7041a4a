"""Both colonies against reinforcement learning (§7.3): on the four systems, and on harder ones.

The settings are those that the searches have found, see `tasks.tuned_settings`; the
returning colony has its defaults.

`acl-gym reproduce comparison --runs 30` makes all of it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from acl_gym.experiments.comparison.tasks import (
    HARDER,
    ON_POLICY,
    PLAIN,
    REMEMBERED_STEPS,
    TASKS,
    is_tuned,
    tuned,
)
from acl_gym.experiments.names import FORGETTING, METHODS, TABLE_METHODS
from acl_gym.experiments.study import Experiment, Study

LONG = "acl-long"
"""ACL with more interactions than the others: whether it is only these that it lacks."""

MORE = 4
"""How many times the interactions of the others ACL gets in its long runs."""

LABELS = {
    **{name: each.label for name, each in METHODS.items()},
    LONG: f"ACL with {MORE} times the interactions",
}
"""What the methods are called in tables and figures."""

FEWER_RUNS = 10
"""Of each study outside of the four systems."""

SLOTS = (25, 100, 400, 1600)

_LONG = (
    f"The methods get the same number of interactions, those that remember "
    f"{REMEMBERED_STEPS:,}; ACL is run a second time with four times as many and the same "
    "settings, to see whether it lacks no more than these."
)
_JUDGED = (
    "A colony wins or loses where the 95% bootstrap interval of the ratio of "
    "interquartile means, the colony's over the rival's, lies on one side of 1."
)

Rows = dict[str, dict[str, Study]]
"""By the label of a row the studies of the methods."""


def _tuned_words(tasks: Iterable[str]) -> str:
    """How the settings of the methods on some tasks were chosen."""
    pairs = [(name, method) for name in tasks for method in TASKS[name].methods]
    lacking = {method for name, method in pairs if not is_tuned(name, method)}
    names = " and ".join(each.label for m, each in METHODS.items() if m in lacking)
    return (
        f"{names} with the defaults on all tasks; each other method has the best of 16 "
        "settings that the same search found for it on this task, its defaults among "
        "them, with other seeds (docs/versus.md)."
    )


def _overview() -> Experiment:
    rows = {
        task.label: {method: tuned(name, method) for method in task.methods}
        for name, task in PLAIN.items()
    }
    text = "The four systems at a glance; each has a figure of its own below."
    text = f"{text} {_tuned_words(PLAIN)} {_JUDGED}"
    title = "ACL against reinforcement learning"
    found = _of_rows("versus", title, rows, text, "overview", of="System")
    references = {task.label: task.system.reference() for task in PLAIN.values()}
    return replace(found, references=references)


def _system(name: str) -> Experiment:
    task = PLAIN[name]
    return Experiment(
        name=f"versus-{name}",
        title=f"ACL against reinforcement learning: {task.label}",
        section="§7.3",
        studies={METHODS[method].label: tuned(name, method) for method in task.methods},
        references={"dynamic programming": task.system.reference()},
        plots=("race",),
        table="system",
        text=(
            f"{_tuned_words([name])} {task.steps:,} interactions for the methods with a "
            f"table, {task.memory_steps:,} for those that remember; "
            f"{task.dqn_steps:,} for DQN and {ON_POLICY} times as many for PPO and A2C, "
            f"which take as many seconds or more: both are reported. {_JUDGED}"
        ),
        options={"optimum": task.system.optimum},
    )


def _harder(
    name: str, title: str, tasks: list[str], text: str, **options: Any
) -> Experiment:
    rows = {}
    for each in tasks:
        row = {method: tuned(each, method, FEWER_RUNS) for method in TABLE_METHODS}
        steps = MORE * TASKS[each].steps
        rows[TASKS[each].label] = {**row, LONG: replace(row["acl"], steps=steps)}
    text = f"{text} {_LONG} {_tuned_words(tasks)} {_JUDGED}"
    return _of_rows(name, title, rows, text, "harder", **options)


def _of_rows(
    name: str, title: str, rows: Rows, text: str, table: str, **options: Any
) -> Experiment:
    """Several tasks, a row each; with `x` in the options they are drawn over it."""
    return Experiment(
        name=name,
        title=title,
        section="§7.3",
        studies={
            f"{label}, {LABELS[method]}": study
            for label, row in rows.items()
            for method, study in row.items()
        },
        plots=("sweep" if "x" in options else "strips",),
        table=table,
        text=text,
        options={"rows": rows, **options},
    )


def _slots() -> Experiment:
    rows = {
        f"{slots} slots": {
            method: replace(tuned("pendulum-40x41", method, FEWER_RUNS), slots=slots)
            for method in FORGETTING
        }
        for slots in SLOTS
    }
    return _of_rows(
        "versus-slots",
        "More slots, the same number of interactions: pendulum",
        rows,
        "The more slots learn in parallel, the fewer steps one after the other the same "
        "number of interactions takes. The other settings are those found for 40 x 41 "
        f"cells. {_JUDGED}",
        table="slots",
        of="Slots",
        x=SLOTS,
        xlabel="slots",
    )


def _order() -> Experiment:
    pairs = {}
    for method in FORGETTING:
        forth = tuned("pendulum-40x41", method, FEWER_RUNS)
        pairs[METHODS[method].label] = (forth, replace(forth, reversed_slots=True))
    return Experiment(
        name="versus-order",
        title="The same random numbers, slots in reverse order: pendulum",
        section="§4.4",
        studies={
            f"{label}, {way}": study
            for label, pair in pairs.items()
            for way, study in zip(("in order", "in reverse order"), pair, strict=True)
        },
        plots=("order",),
        table="order",
        text=(
            "What ACL's ants learn can be merged in any order (Theorem 4.1); parallel "
            "Q-learning goes from slot to slot, and each update uses the values that "
            "the one before it left. Each run is made twice with the same initial "
            "states and the same random numbers for every slot, the second time in "
            "reverse order. A sum in another order may differ in its last bits."
        ),
        options={"pairs": pairs},
    )


EXPERIMENTS = (
    _overview(),
    *map(_system, PLAIN),
    *(_harder(f"versus-{name}", **each) for name, each in HARDER.items()),
    _slots(),
    _order(),
)
"""The comparison of tuned methods, part of the reproduction."""
