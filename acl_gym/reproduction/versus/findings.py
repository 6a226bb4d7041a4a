"""What contests say: tables, and sentences that follow from their figures alone.

ACL is held against each rival by the ratio of interquartile means with its bootstrap
interval, the runs of each drawn apart. It wins or loses where the whole interval lies on
one side of 1; otherwise there is no difference that these runs show.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np

from acl_gym.reproduction.evidence import Evidence
from acl_gym.reproduction.settings import Experiment
from acl_gym.reproduction.verdicts import Interval, interval, iqm, ratio
from acl_gym.reproduction.versus.contest import Contest
from acl_gym.reproduction.versus.reference import Reference
from acl_gym.reproduction.versus.spaces import LONG, METHODS, NAMES
from acl_gym.utils.typing import FloatArray

Findings = dict[str, Any]
"""`headings` and `rows` of a table, `sentences`, `duels`; JSON types."""

MARKS = (25, 10)
"""Percent above the best known cost that count as close."""

FEW = 5
"""With fewer runs nothing is decided."""

SLACK = 1e-3
"""Ratios that are no farther from 1 are taken for 1."""

WINS, LOSES, EVEN, OPEN = "wins", "loses", "no difference", "undecided"
NEITHER = "neither"
"""Of times: neither gets there in more than half of its runs."""

NEVER = "–"
_LAST = "cost of the last policy"


class Duel(NamedTuple):
    """ACL against one rival by one measure.

    Attributes:
        where: the arena.
        measure: what is held against each other; less is better.
        rival: the other method's name.
        verdict: WINS, LOSES, EVEN, NEITHER or OPEN, of ACL.
        ratio: how many times the rival's that of ACL is.
        who: ACL's name here.
    """

    where: str
    measure: str
    rival: str
    verdict: str
    ratio: Interval
    who: str = "ACL"

    def as_json(self) -> dict[str, Any]:
        """As JSON types; None is infinite."""
        found = {**self._asdict(), **self.ratio._asdict()}
        del found["ratio"]
        return {
            name: None if isinstance(each, float) and not _tellable(each) else each
            for name, each in found.items()
        }

    def __str__(self) -> str:
        """A sentence."""
        at = f"{self.where}: " if self.where else ""
        if self.verdict == OPEN:
            return f"{at}{self.measure}: too few runs to tell {self.who} from {self.rival}."
        if self.verdict == NEITHER:
            return (
                f"{at}{self.measure}: neither {self.who} nor {self.rival} gets there in "
                "most runs."
            )
        if self.verdict == EVEN:
            text = f"no difference between {self.who} and {self.rival}"
        else:
            end = "against" if self.verdict == WINS else "to"
            text = f"{self.who} {self.verdict} {end} {self.rival}"
        if _tellable(self.ratio.value):
            return f"{at}{self.measure}: {text}, {times(self.ratio)}."
        return f"{at}{self.measure}: {text}."


def duel(
    where: str,
    measure: str,
    rival: str,
    acl: FloatArray,
    other: FloatArray,
    who: str = "ACL",
) -> Duel:
    """Hold ACL against a rival.

    Args:
        where: the arena, for the sentence.
        measure: what the values are; less is better.
        rival: the name of the other method.
        acl: one value a run, > 0 or infinite.
        other: the same of the rival.
        who: ACL's name here.
    """
    found = ratio(acl, other)
    if min(len(acl), len(other)) < FEW:
        verdict = OPEN
    elif math.isinf(np.median(acl)) and math.isinf(np.median(other)):
        verdict = NEITHER
    elif found.low > 1 + SLACK:
        verdict = LOSES
    elif found.high < 1 - SLACK:
        verdict = WINS
    else:
        verdict = EVEN
    return Duel(where, measure, rival, verdict, found, who)


def times(found: Interval) -> str:
    """A ratio in words."""
    value, low, high = (
        f"{x:.3g}" if _tellable(x) else "∞" if x > 1 else "0" for x in found
    )
    return f"{value} [{low}, {high}] times"


def _tellable(value: float) -> bool:
    """Whether a ratio is one of numbers, and not of one that stands for infinity."""
    return 1e-12 < abs(value) < 1e12


def reached(run: dict[str, Any], bound: float, x: str) -> float:
    """When a policy first cost no more than `bound`; infinity: never.

    Args:
        run: a result.
        bound: of the cost.
        x: "env_steps" or "seconds".
    """
    rows = run["rows"]
    pairs = zip(rows[x], rows["policy_cost"], strict=True)
    return next((float(at) for at, cost in pairs if cost <= bound), math.inf)


def contests(experiment: Experiment) -> dict[str, Contest]:
    """The contests of an experiment by their labels."""
    return {
        study.label: study.setting
        for study in experiment.studies
        if isinstance(study.setting, Contest)
    }


def reference_of(experiment: Experiment, evidence: Evidence) -> tuple[str, float]:
    """What it is called, and the cost."""
    for study in experiment.studies:
        if isinstance(study.setting, Reference):
            return study.setting.name, float(evidence.last(study.setting)[0])
    raise LookupError(f"{experiment.name} must have a reference among its studies.")


def system(experiment: Experiment, evidence: Evidence) -> Findings:
    """One system: costs, and what learning takes in interactions and in time."""
    name, cost = reference_of(experiment, evidence)
    bounds = {mark: cost * (1 + mark / 100) for mark in MARKS}
    found: dict[str, dict[str, FloatArray]] = {}
    rows = []
    for label, contest in contests(experiment).items():
        runs = evidence.runs(contest)
        last = evidence.last(contest)
        best = np.array([min(run["rows"]["policy_cost"]) for run in runs])
        own = {_LAST: last, "cost of the best policy": best}
        cells = [
            label,
            str(interval(last)),
            f"{last.min():.4g} to {last.max():.4g}",
            str(interval(best)),
            f"{100 * evidence.last(contest, 'success_rate').mean():.0f}%",
        ]
        for mark, bound in bounds.items():
            for x, unit in (("env_steps", "interactions"), ("seconds", "seconds")):
                at = np.array([reached(run, bound, x) for run in runs])
                own[f"{unit} to within {mark}% of {name}"] = at
                cells.append(_time(at, x))
        seconds = np.array([run["seconds"] for run in runs])
        cells += [f"{runs[0]['rows']['env_steps'][-1]:,.0f}", f"{iqm(seconds):.2g}"]
        failures = sum(bool(run.get("failure")) for run in runs)
        cells.append(str(failures) if failures else "none")
        rows.append(cells)
        found[label] = own
    duels = [
        duel("", measure, label, found["ACL"][measure], own[measure])
        for label, own in found.items()
        if label != "ACL"
        for measure in own
    ]
    return {
        "headings": [
            "Method",
            "Cost of the last policy",
            "Range",
            "Cost of the best",
            "Reach the goal",
            *(
                f"{unit} to {mark}%"
                for mark in MARKS
                for unit in ("Interactions", "Seconds")
            ),
            "Whole run, interactions",
            "Seconds",
            "Broke down",
        ],
        "rows": rows,
        "sentences": [f"{name} = {cost:.4g}.", *map(str, duels)],
        "duels": [each.as_json() for each in duels],
    }


def _time(at: FloatArray, x: str) -> str:
    """The interquartile mean of times, and how many runs there are of."""
    count = int(np.isfinite(at).sum())
    middle = float(iqm(at))
    text = NEVER
    if math.isfinite(middle):
        text = f"{float(f'{middle:.3g}'):,.0f}" if x == "env_steps" else f"{middle:.2g}"
    return text if count == len(at) else f"{text} ({count} of {len(at)})"


def harder(experiment: Experiment, evidence: Evidence) -> Findings:
    """Several arenas: the cost of the last policy, ACL against each rival."""
    rows, duels = [], []
    table = experiment.options["rows"]
    names = list(next(iter(table.values())))
    colonies = [name for name in names if name in ("acl", LONG)]
    pairs = [(one, m) for one in colonies for m in names if m not in colonies]
    for where, row in table.items():
        last = {name: evidence.last(contest) for name, contest in row.items()}
        own = [
            duel(where, _LAST, NAMES[m], last[one], last[m], NAMES[one])
            for one, m in pairs
        ]
        rows.append(
            [
                where,
                *(str(interval(values)) for values in last.values()),
                *(f"{each.verdict}, {times(each.ratio)}" for each in own),
            ]
        )
        duels += own
    counts = [
        _count([each for each in duels if each.who == NAMES[one]], NAMES[one])
        for one in colonies
    ]
    return {
        "headings": [
            experiment.options.get("of", "Where"),
            *(NAMES[name] for name in names),
            *(f"{NAMES[one]} against {NAMES[m]}" for one, m in pairs),
        ],
        "rows": rows,
        "sentences": [*counts, *map(str, duels)],
        "duels": [each.as_json() for each in duels],
    }


def overview(experiment: Experiment, evidence: Evidence) -> Findings:
    """As `harder`, and the duels for the interactions and the time that learning takes."""
    found = harder(experiment, evidence)
    duels, sentences = [], []
    for mark in MARKS:
        for x, unit in (("env_steps", "interactions"), ("seconds", "seconds")):
            measure = f"{unit} to within {mark}% of the best known cost"
            own = []
            for where, row in experiment.options["rows"].items():
                at = {}
                for method, contest in row.items():
                    best = float(evidence.last(Reference(contest.arena))[0])
                    at[method] = np.array(
                        [
                            reached(run, best * (1 + mark / 100), x)
                            for run in evidence.runs(contest)
                        ]
                    )
                own += [
                    duel(where, measure, METHODS[m], at["acl"], values)
                    for m, values in at.items()
                    if m != "acl"
                ]
            sentences.append(f"{measure}: {_count(own)}")
            duels += own
    return {
        **found,
        "sentences": [
            f"{_LAST}: {found['sentences'][0]}",
            *sentences,
            *found["sentences"][1:],
            *map(str, duels),
        ],
        "duels": found["duels"] + [each.as_json() for each in duels],
    }


def _count(duels: Iterable[Duel], who: str = "ACL") -> str:
    """How often ACL wins and loses."""
    verdicts = [each.verdict for each in duels]
    parts = [
        f"{verdicts.count(word)} {text}"
        for word, text in (
            (WINS, "won"),
            (EVEN, "without a difference"),
            (NEITHER, "where neither gets there"),
            (LOSES, "lost"),
            (OPEN, "undecided"),
        )
        if verdicts.count(word)
    ]
    return f"Of {len(verdicts)} duels of {who}: {', '.join(parts)}."


def slots(experiment: Experiment, evidence: Evidence) -> Findings:
    """As `harder`, and what many slots cost each method at the same interactions."""
    found = harder(experiment, evidence)
    table = list(experiment.options["rows"].items())
    sentences = []
    for method in table[0][1]:
        costs = [evidence.last(row[method]) for _, row in table]
        best = int(np.argmin([iqm(each) for each in costs]))
        change = ratio(costs[-1], costs[best])
        sentences.append(
            f"{METHODS[method]} does best with {table[best][0]}; with {table[-1][0]} "
            f"and as many interactions its policies cost {times(change)} as much."
        )
    return {**found, "sentences": sentences + found["sentences"]}


def order(experiment: Experiment, evidence: Evidence) -> Findings:
    """Each run with its slots in order and in reverse order, with the same luck."""
    rows, sentences = [], []
    for label, (forth, back) in experiment.options["pairs"].items():
        runs = list(zip(evidence.runs(forth), evidence.runs(back), strict=False))
        costs = np.array(
            [[run["rows"]["policy_cost"][-1] for run in pair] for pair in runs]
        )
        apart = np.abs(costs[:, 1] / costs[:, 0] - 1)
        cells = np.array([_differing(*pair) for pair in runs])
        n_cells = forth.arena.partition(forth.settings["kind"]).n_cells
        same = int((cells == 0).sum())
        rows.append(
            [
                label,
                f"{same} of {len(runs)}",
                f"{100 * np.median(cells) / n_cells:.2g}%",
                f"{100 * np.median(apart):.2g}% (at most {100 * apart.max():.2g}%)",
            ]
        )
        sentences.append(
            f"{label}: the order of the slots changes the action of "
            f"{100 * np.median(cells) / n_cells:.2g}% of the cells and the cost of the "
            f"last policy by {100 * np.median(apart):.2g}%, in the median; policies are "
            f"the same in {same} of {len(runs)} runs."
        )
    return {
        "headings": ["Method", "Same policy", "Cells that differ", "Cost differs by"],
        "rows": rows,
        "sentences": sentences,
        "duels": [],
    }


def _differing(first: dict[str, Any], second: dict[str, Any], actions: int = 3) -> int:
    """In how many cells the best actions of two tables of the pendulum differ."""
    best = [
        np.reshape(r["levels"], (-1, actions)).argmax(axis=1) for r in (first, second)
    ]
    return int((best[0] != best[1]).sum())


FINDINGS: dict[str, Callable[[Experiment, Evidence], Findings]] = {
    "overview": overview,
    "system": system,
    "harder": harder,
    "slots": slots,
    "order": order,
}
