"""The systems and tasks on which methods are compared, and what each method runs with.

All of it is data, in tasks.toml and settings.json. A `System` is one of the four systems
as `acl-gym compare` runs it, a `TunedTask` is a system, as it is or made harder, for which
each method was tuned. To add a system or a task, add one entry to tasks.toml; for a method
see docs/project/developing.md. How settings were chosen is in docs/comparison-settings.md and
docs/versus.md.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

from acl_gym.experiments import systems
from acl_gym.experiments.names import (
    GROWING,
    METHODS,
    NETWORKS,
    REMEMBERING,
    TABLE_METHODS,
    agent_names,
)
from acl_gym.experiments.study import Study, Task
from acl_gym.utils.validation import one_of

Settings = Mapping[str, Any]

_FOLDER = files("acl_gym.experiments.comparison")  # also where that is in a zip file

SETTINGS_FILE = Path(__file__).with_name("settings.json")
"""The tuned settings: task -> method -> what its search has found."""


FEW_SLOTS = 5
"""Of methods that remember, which learn from few interactions."""

REMEMBERED_STEPS = 100_000
"""Interactions of such a method on a tuned task that names no others."""

ON_POLICY = 5
"""How many times the interactions of DQN PPO and A2C get, which are as much faster: all
take about as many seconds."""

MEMORY_SPACING = 1.04
"""`Study.spacing` of methods that remember: few interactions count here."""


class Agent(NamedTuple):
    """A method with its kind of partition, as `acl-gym compare` runs it."""

    label: str
    method: str
    kind: str


class Budget(NamedTuple):
    """How much of a system a preset runs.

    Attributes:
        trials: K of the methods with a table.
        dqn_steps: interactions of DQN.
        evaluate_every: interactions between two evaluations of DQN.
        memory_steps: interactions of methods with a table that remember.
        cells: on which the reference is found, see `Task.make_partition`; None where a
            state is a cell.
        on_policy: how many times the interactions of DQN PPO and A2C get.
        length: of the runs of DQN; where it is "long" DQN has its settings for that.
    """

    trials: int
    dqn_steps: int
    evaluate_every: int
    memory_steps: int
    cells: Any = None
    on_policy: int = ON_POLICY
    length: str = "short"


@dataclass(frozen=True, kw_only=True)
class System:
    """One system and how the methods run on it.

    Attributes:
        label: what it is called.
        colony: the thesis's colony on it, whose settings, slots, cells and T hold here.
        settings: what a method runs with, by its name; of networks and of the returning
            colony, what differs from the defaults. Under a name with a suffix, "q-crisp" or
            "dqn-long", is what differs there.
        budgets: one for each preset.
        finite: whether a state is a cell, so that nothing is fuzzy.
        optimum: whether the reference is taken for the optimum J*, or only for the
            best policy known.
    """

    label: str
    colony: Study
    settings: Mapping[str, Settings]
    budgets: Mapping[str, Budget]
    finite: bool = False
    optimum: bool = True

    @property
    def env_id(self) -> str:
        """Its environment."""
        return self.colony.task.env_id

    @property
    def task(self) -> Task:
        """What the learners meet."""
        return Task(env_id=self.env_id)

    @property
    def has_model(self) -> bool:
        """Whether dynamic programming can be held against the methods."""
        return True

    @property
    def max_steps(self) -> int:
        """T, the longest episode."""
        return int(self.colony.settings["max_steps"])

    @property
    def agents(self) -> dict[str, Agent]:
        """What `acl-gym compare` runs, by name, in order."""
        found = {}
        for each in agent_names(self.finite):
            name, _, kind = (
                each.rpartition("-") if each not in METHODS else (each, "", "")
            )
            words = METHODS[name].label
            if kind and not self.finite:
                words += f", {kind}"
            if not kind and name in REMEMBERING:
                kind = GROWING
            found[each] = Agent(words, name, kind)
        return found

    def settings_of(self, method: str, suffix: str) -> dict[str, Any]:
        """What a method runs with, for a kind of partition or a length of run."""
        own = self.colony.settings if method == "acl" else self.settings.get(method, {})
        return {**own, **self.settings.get(f"{method}-{suffix}", {})}

    def study(self, name: str, preset: str) -> Study:
        """An agent as `acl-gym compare` runs it.

        Args:
            name: a key of `agents`.
            preset: a key of `names.PRESETS`.
        """
        _, method, kind = self.agents[one_of("agent", name, tuple(self.agents))]
        budget, task = self.budgets[preset], self.task
        if method in NETWORKS:
            settings = self.settings_of(method, budget.length)
            more = 1 if method == "dqn" else budget.on_policy
            return _network(
                task, method, settings, budget.dqn_steps, budget.evaluate_every, more
            )
        study = replace(
            self.colony,
            task=task,
            method=METHODS[method].key,
            settings={"max_steps": self.max_steps, **self.settings_of(method, kind)},
            kind=kind,
            trials=budget.trials,
        )
        if method not in REMEMBERING:
            return study
        return replace(
            study,
            slots=FEW_SLOTS,
            trials=None,
            steps=budget.memory_steps,
            spacing=MEMORY_SPACING,
        )

    def reference(self, preset: str = "quick") -> Study:
        """Dynamic programming: on states that are cells, else on fine fuzzy cells."""
        return self.planned(self.budgets[preset].cells)

    def planned(self, cells: Any) -> Study:
        """Dynamic programming on some cells."""
        return Study(task=self.task, method="planning", cells=cells, most_runs=1)


def _network(
    task: Task,
    method: str,
    settings: dict[str, Any],
    dqn_steps: int,
    every: int,
    more: int,
) -> Study:
    return Study(
        task=task,
        method=method,
        settings=settings,
        steps=more * dqn_steps,
        evaluate_every=more * every,
    )


_READ = tomllib.loads(_FOLDER.joinpath("tasks.toml").read_text(encoding="utf-8"))

_COLONIES = {
    "pendulum": systems.pendulum("fuzzy"),
    "navigation": systems.navigation("quadratic", "fuzzy"),
    "row": systems.grid_1d(),
    # tabu: the assumption of §3.4.2 that no ant walks in circles.
    "grid": systems.grid_2d(local_decay=0.01, tabu=True),
}

SYSTEMS = {
    name: System(
        colony=_COLONIES[name],
        budgets={
            preset: Budget(**each) for preset, each in entry.pop("budgets").items()
        },
        **entry,
    )
    for name, entry in _READ["systems"].items()
}
"""The systems, the default one first."""

BY_ENV_ID = {system.env_id: system for system in SYSTEMS.values()}


@dataclass(frozen=True)
class TunedTask:
    """A system as learners meet it, and how much of it they get.

    Attributes:
        label: what it is called in tables and figures.
        system: which one.
        steps: interactions of a method with a table that forgets, all slots together.
        memory_steps: interactions of a method that remembers; it computes longer for each.
        spacing: the factor by which interactions grow from one evaluation to the next.
        changes: of the task, keywords of `Task`: what makes it harder.
        cells: see `Task.make_partition`; None takes those of the system.
        max_steps: T, the longest episode; None takes that of the system.
        dqn_steps: interactions of DQN; PPO and A2C get `ON_POLICY` times as many. 0: no
            network takes part.
        evaluate_every: interactions between two evaluations of DQN.
    """

    label: str
    system: System
    steps: int
    spacing: float = 1.3
    changes: Settings = field(default_factory=dict)
    cells: Any = None
    max_steps: int | None = None
    dqn_steps: int = 0
    evaluate_every: int = 500
    memory_steps: int = REMEMBERED_STEPS

    @property
    def methods(self) -> tuple[str, ...]:
        """The methods that take part."""
        return tuple(METHODS) if self.dqn_steps else TABLE_METHODS

    @property
    def task(self) -> Task:
        """What the learners meet."""
        return Task(env_id=self.system.env_id, **self.changes)

    def defaults(self, method: str) -> dict[str, Any]:
        """A method's settings before any search, those that are not searched included.

        `slots` and `kind` are among those of the methods with a table.
        """
        if method in NETWORKS:
            return self.system.settings_of(method, "short")
        finite, judged = self.system.finite, self.task.cost is not None
        kind, slots = "crisp" if finite else "fuzzy", self.system.colony.slots
        if method in REMEMBERING:
            slots = FEW_SLOTS
            if not finite and self.cells is None:
                kind = GROWING
        settings = self.system.settings_of(method, kind)
        if method == "acl":
            # Boltzmann's rule is Max-Boltzmann's with epsilon = 0, which can be searched.
            if settings["selection"] == "boltzmann":
                settings |= {"selection": "max_boltzmann", "epsilon": 0.0}
            if finite:
                settings.setdefault("tabu", False)
            if judged:
                settings["tau0"] = 1e-3  # these costs are a hundred times smaller
        elif judged:
            settings["reward"] = "stage"
        settings["max_steps"] = self.max_steps or self.system.max_steps
        return {"slots": slots, "kind": kind, **settings}

    def study(self, method: str, found: Settings) -> Study:
        """A method with the settings that a search has found.

        Args:
            method: one of `methods`.
            found: what differs from `defaults`.
        """
        settings = {**self.defaults(method), **found}
        if method in NETWORKS:
            if "learning_rate" in settings:
                settings["final_learning_rate"] = settings["learning_rate"]
            more = 1 if method == "dqn" else ON_POLICY
            return _network(
                self.task, method, settings, self.dqn_steps, self.evaluate_every, more
            )
        steps, spacing = self.steps, self.spacing
        if method in REMEMBERING:
            steps, spacing = self.memory_steps, min(spacing, MEMORY_SPACING)
        return Study(
            task=self.task,
            method=METHODS[method].key,
            slots=settings.pop("slots"),
            kind=settings.pop("kind"),
            settings=settings,
            cells=self.cells or self.system.colony.cells,
            steps=steps,
            spacing=spacing,
        )


TASKS = {
    name: TunedTask(system=SYSTEMS[entry.pop("system")], **entry)
    for name, entry in _READ["tasks"].items()
}
"""All tasks by name."""

HARDER: dict[str, dict[str, Any]] = _READ["harder"]
"""The experiments on harder tasks, by name; see `experiments.EXPERIMENTS`."""

PLAIN = {name: task for name, task in TASKS.items() if name in SYSTEMS}
"""The four systems as they are."""


@cache
def tuned_settings() -> dict[str, dict[str, dict[str, Any]]]:
    """What the searches have found: task -> method -> settings."""
    return json.loads(_FOLDER.joinpath(SETTINGS_FILE.name).read_text(encoding="utf-8"))  # type: ignore[no-any-return]


def is_tuned(name: str, method: str) -> bool:
    """Whether there was a search for the settings of a method on a task.

    There is none for the returning colony, which has its defaults everywhere.
    """
    return method in tuned_settings().get(name, {})


def tuned(name: str, method: str, most_runs: int | None = None) -> Study:
    """A method on a task with the settings that its search has found.

    A method of which there was no search has its defaults, see `is_tuned`.

    Args:
        name: a key of `TASKS`.
        method: one of the methods of the task.
        most_runs: see `Study`.
    """
    found = tuned_settings()[name][method] if is_tuned(name, method) else {}
    study = TASKS[name].study(method, found)
    return replace(study, most_runs=most_runs)
