"""What the runs of a comparison say: medians, intervals, and sentences.

Medians over seeds, with 95% percentile-bootstrap intervals. A mark that a run never
reached counts as infinitely late; in the results infinity is None, which JSON knows.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from acl_gym.experiments import wording
from acl_gym.experiments.intervals import (
    FEW_VALUES,
    Estimate,
    estimate,
    or_infinity,
    overlap,
)
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray

Run = dict[str, Any]
"""One run as `comparison` holds it: agent, label, seed, rows, best, ..."""

Entry = dict[str, Any]
"""What `summarise` says of one agent."""

MARKS = (25, 10)
"""Percent above J* that count as close, the wider first."""


class Band(NamedTuple):
    """Step functions over seeds; each value holds from its x to the next.

    Attributes:
        x: where a value of some seed changes, increasing, `(n,)`.
        median: over the seeds, `(n,)`.
        low: the smallest, `(n,)`.
        high: the largest, `(n,)`.
    """

    x: FloatArray
    median: FloatArray
    low: FloatArray
    high: FloatArray


def by_agent(runs: Iterable[Run]) -> dict[str, list[Run]]:
    """The runs of each agent, agents in the order in which they first occur."""
    groups: dict[str, list[Run]] = {}
    for run in runs:
        groups.setdefault(run["agent"], []).append(run)
    return groups


def median_run(runs: Sequence[Run]) -> Run:
    """The run with the median final policy cost; of an even number, the cheaper.

    Args:
        runs: of one agent, at least one.
    """
    ranked = sorted(runs, key=lambda run: float(run["rows"][-1]["policy_cost"]))
    return ranked[(len(ranked) - 1) // 2]


def time_to(
    run: Run, cost: float, x: Literal["env_steps", "seconds"] = "env_steps"
) -> float:
    """When the first evaluation at or below `cost` was made; infinity if none was."""
    return next((row[x] for row in run["rows"] if row["policy_cost"] <= cost), math.inf)


def summarise(
    runs: Sequence[Run], optimal_cost: float, *, seed: int = 0
) -> list[Entry]:
    """Summarise the runs of each agent.

    Args:
        runs: of any agents, rows in order of increasing env_steps.
        optimal_cost: J*, > 0.
        seed: of the bootstrap. Every estimate starts from it anew, so that none
            hangs on which others are made.

    Returns:
        One entry for each agent: `agent`, `label`, `seeds` (how many), and estimates
        `final_policy_cost`, `best_policy_cost`, `final_gap_percent` and
        `best_gap_percent` (above J*), `final_success_rate`, `best_success_rate`,
        `env_steps` and `seconds` (of the whole training), and for each mark
        `env_steps_to_25`, `seconds_to_25`, `env_steps_to_10`, `seconds_to_10`.

    Raises:
        ValueError: `optimal_cost` is not positive.
    """
    optimal_cost = validation.number("optimal_cost", optimal_cost, above=0)
    summary = []
    for agent, own in by_agent(runs).items():
        final = [run["rows"][-1] for run in own]
        best = [run["best"] for run in own]
        values: dict[str, list[float]] = {}
        for name, rows in (("final", final), ("best", best)):
            costs = [float(row["policy_cost"]) for row in rows]
            values[f"{name}_policy_cost"] = costs
            values[f"{name}_gap_percent"] = [
                100 * (cost / optimal_cost - 1) for cost in costs
            ]
            values[f"{name}_success_rate"] = [row["success_rate"] for row in rows]
        values["env_steps"] = [row["env_steps"] for row in final]
        values["seconds"] = [row["seconds"] for row in final]
        entry = {"agent": agent, "label": own[0]["label"], "seeds": len(own)}
        entry |= {name: estimate(each, seed=seed) for name, each in values.items()}
        for mark in MARKS:
            bound = mark_cost(optimal_cost, mark)
            for x in ("env_steps", "seconds"):
                times = [time_to(run, bound, x) for run in own]
                entry[f"{x}_to_{mark}"] = {
                    **estimate(times, seed=seed),
                    "reached": sum(map(math.isfinite, times)),
                }
        summary.append(entry)
    return summary


def mark_cost(optimal_cost: float, mark: float) -> float:
    """The cost that lies `mark` percent above J*."""
    return optimal_cost * (1 + mark / 100)


def curve_band(
    runs: Sequence[Run],
    x: Literal["env_steps", "seconds"] = "env_steps",
    *,
    best_so_far: bool = False,
) -> Band:
    """Policy cost of one agent as training goes on, over its seeds.

    A policy counts from its evaluation to the next one, the last one to the end. The
    band begins where every seed has been evaluated, and ends with the longest.

    Args:
        runs: of one agent.
        x: what to measure training by.
        best_so_far: take the cheapest policy up to then, not the one of the time.
    """
    curves = []
    for run in runs:
        at = np.array([row[x] for row in run["rows"]], dtype=np.float64)
        cost = np.array([row["policy_cost"] for row in run["rows"]], dtype=np.float64)
        curves.append((at, np.minimum.accumulate(cost) if best_so_far else cost))
    if not curves:
        return Band(*(np.empty(0) for _ in Band._fields))
    grid = np.unique(np.concatenate([at for at, _ in curves]))
    begin = max(at[0] for at, _ in curves)
    grid = grid[grid >= begin]
    values = np.array(
        [cost[np.searchsorted(at, grid, side="right") - 1] for at, cost in curves]
    )
    return Band(grid, np.median(values, axis=0), values.min(axis=0), values.max(axis=0))


class _Measure(NamedTuple):
    """A figure by which agents are ranked, the lowest first, and how to tell it."""

    key: str
    name: str  # in a comparison of two agents
    lead: str  # what the agent with the lowest value does
    together: str  # what several with the same value do

    def value(self, estimate: Estimate, end: str = "median", unit: str = " s") -> str:
        value = estimate[end]
        if self.key.startswith("env_steps"):
            return wording.steps(value)
        if self.key.startswith("seconds"):
            return wording.seconds(value, unit=unit if value is not None else "")
        return wording.cost(value)

    def of(self, entry: Entry) -> str:
        estimate = entry[self.key]
        if estimate["median"] is None and estimate.get("reached"):
            return f"only in {estimate['reached']} of {entry['seeds']} seeds"
        return self.value(estimate)

    def with_interval(self, estimate: Estimate) -> str:
        if estimate["low"] is None:
            return self.value(estimate)
        low, high = (self.value(estimate, end, "") for end in ("low", "high"))
        return f"{self.value(estimate)} ({low} to {high})"

    def excess(self, low: Estimate, high: Estimate) -> str:
        """By how much the median of `high` exceeds that of `low`."""
        if high["median"] in (None, low["median"]) or low["median"] <= 0:
            return ""
        ratio = high["median"] / low["median"]
        if "cost" in self.key:
            return f"{100 * (ratio - 1):.1f}% more"
        return f"{wording.ratio(ratio)} as {'many' if 'steps' in self.key else 'much'}"


_COSTS = (
    _Measure(
        "final_policy_cost",
        "last policy",
        "ends lowest with its last policy",
        "end lowest with their last policies",
    ),
    _Measure(
        "best_policy_cost",
        "best policy",
        "finds the cheapest policy on its way",
        "find the cheapest policies on their ways",
    ),
)
_TIMES = tuple(
    _Measure(
        f"{x}_to_{mark}",
        f"{name} to {mark}%",
        f"needs the {most} {name}",
        f"need the {most} {name}",
    )
    for mark in MARKS
    for x, name, most in (
        ("seconds", "wall-clock time", "least"),
        ("env_steps", "environment steps", "fewest"),
    )
)


def findings(
    summary: Sequence[Entry], reference: dict[str, Any], preset: str
) -> list[str]:
    """Say in plain English what the figures show, and nothing else.

    Args:
        summary: of `summarise`.
        reference: with `optimal_cost` or `best_known_cost`, and perhaps `coarse`.
        preset: how much was run.
    """
    if not summary:
        return []
    summary = [
        {**entry, "label": wording.in_a_sentence(entry["label"])} for entry in summary
    ]
    optimal_cost = wording.reference_cost(reference)
    name = wording.the_reference(reference)
    sentences = []
    for measure in _TIMES:
        mark = int(measure.key.rsplit("_", 1)[1])
        bound = wording.cost(mark_cost(optimal_cost, mark))
        goal = f"within {mark}% of {name} ({bound})"
        if any(entry[measure.key]["median"] is not None for entry in summary):
            text = f"To come {goal}, {_ranking(summary, measure)}."
        elif measure.key.startswith("seconds"):
            text = f"No method comes {goal} in more than half of its seeds."
        else:
            continue
        sentences.append(" ".join([text, *_laggards(summary, measure)]))
    for measure in _COSTS:
        gap = min(
            entry[measure.key.replace("policy_cost", "gap_percent")]["median"]
            for entry in summary
        )
        above = f", {wording.percent_above(gap)} {name} ({wording.cost(optimal_cost)})"
        sentences.append(wording.sentence(_ranking(summary, measure, above)))
    sentences.append(_successes(summary))
    champion, rivals = _rivals(summary)
    for rival in rivals:
        sentences += _duel(champion, rival)
    return sentences + _circumstances(summary, reference, preset)


def _ranked(summary: Sequence[Entry], measure: _Measure) -> list[Entry]:
    return sorted(summary, key=lambda entry: or_infinity(entry[measure.key]["median"]))


def _ranking(summary: Sequence[Entry], measure: _Measure, note: str = "") -> str:
    """The first, with a note, and the second; or those that share the first place."""
    first, *others = _ranked(summary, measure)
    best = first[measure.key]
    alike = [e for e in others if _equal(e[measure.key], best)]
    if alike:
        names = wording.listed([entry["label"] for entry in (first, *alike)])
        value = measure.value(best)
        return f"{names} {measure.together}, in the median at {value}{note}"
    text = f"{first['label']} {measure.lead}: {measure.with_interval(best)}{note}"
    if others and others[0][measure.key]["median"] is not None:
        second = others[0][measure.key]
        text += f", then {others[0]['label']} with {measure.with_interval(second)}"
        if excess := measure.excess(best, second):
            text += f", {excess}"
        if overlap(best, second):
            text += "; the intervals overlap"
    return text


def _equal(first: Estimate, second: Estimate) -> bool:
    """Whether two medians are one, but for rounding."""
    pair = [each["median"] for each in (first, second)]
    return None not in pair and math.isclose(*pair, rel_tol=1e-9)


def _laggards(summary: Sequence[Entry], measure: _Measure) -> list[str]:
    """Who reached a mark in some seeds only, and who in none."""
    counts = [(e["label"], e[measure.key]["reached"], e["seeds"]) for e in summary]
    never = [label for label, count, _ in counts if count == 0]
    some = [f"{label} in {n} of {seeds}" for label, n, seeds in counts if 0 < n < seeds]
    sentences = []
    if some:
        sentences.append(f"Reached in a part of the seeds: {wording.listed(some)}.")
    if never:
        sentences.append(f"Never reached: {wording.listed(never)}.")
    return sentences


def _successes(summary: Sequence[Entry]) -> str:
    """From how many starts the last policies reach the goal, the least first."""
    shares: dict[float, list[str]] = {}
    for entry in sorted(
        summary, key=lambda e: float(e["final_success_rate"]["median"])
    ):
        rate = float(entry["final_success_rate"]["median"])
        shares.setdefault(rate, []).append(entry["label"])
    parts = [
        f"from {'every start' if rate >= 1 else wording.share(rate) + ' of the starts'} "
        f"with {wording.listed(labels)}"
        for rate, labels in shares.items()
    ]
    return f"In the median the last policy reaches the goal {'; '.join(parts)}."


def _rivals(summary: Sequence[Entry]) -> tuple[Entry, list[Entry]]:
    """The colony that ends lowest; its other variants, and the best of each family.

    The family is the agent's name without its kind of partition. Without colonies, no rivals.
    """
    colonies: list[Entry] = []
    families: dict[str, Entry] = {}
    for entry in _ranked(summary, _COSTS[0]):
        family = entry["agent"].removesuffix("-fuzzy").removesuffix("-crisp")
        if family == "acl":
            colonies.append(entry)
        else:
            families.setdefault(family, entry)
    if not colonies:
        return {}, []
    return colonies[0], [*families.values(), *colonies[1:]]


def _duel(champion: Entry, other: Entry) -> list[str]:
    """Where the better colony loses to another method, and where it is ahead."""
    losses: list[str] = []
    gains: list[str] = []
    for measure in (*_COSTS, *_TIMES):
        mine, yours = champion[measure.key], other[measure.key]
        if mine["median"] == yours["median"] or _equal(mine, yours):
            continue
        ahead = or_infinity(mine["median"]) < or_infinity(yours["median"])
        values = (measure.of(champion), measure.of(other))
        text = f"{measure.name}, {' against '.join(values)}"
        notes = [] if ahead else [measure.excess(yours, mine)]
        if overlap(mine, yours):
            notes.append("the intervals overlap")
        if any(notes):
            text += f" ({', '.join(filter(None, notes))})"
        (gains if ahead else losses).append(text)
    return [
        f"Where {champion['label']} {verb} {other['label']}: {'; '.join(texts)}."
        for texts, verb in ((losses, "loses to"), (gains, "is ahead of"))
        if texts
    ]


def _circumstances(
    summary: Sequence[Entry], reference: dict[str, Any], preset: str
) -> list[str]:
    """What to bear in mind: budgets, what the partition allows, number of seeds."""
    sentences = []
    if len(summary) > 1:
        ranked = sorted(summary, key=lambda entry: float(entry["env_steps"]["median"]))
        least, most = (
            f"{wording.steps(entry['env_steps']['median'])} environment steps in "
            f"{wording.seconds(entry['seconds']['median'])} s ({entry['label']})"
            for entry in (ranked[0], ranked[-1])
        )
        sentences.append(f"The budgets differ, in the median from {least} to {most}.")
    if coarse := reference.get("coarse"):
        cells = " x ".join(map(str, coarse["cells"]))
        hovers = coarse["success_rate"] < 1
        sentences.append(
            f"Fuzzy Q-iteration, which knows the model, gets to a policy cost of "
            f"{coarse['policy_cost']:.1f} on {cells} cells, as many as the table-based "
            f"methods have, and reaches the goal from "
            f"{wording.share(coarse['success_rate'])} of the starts"
            f"{': its greedy policy hovers beside the goal' if hovers else ''}. It is "
            "no bound on what these cells allow."
        )
    seeds = [int(entry["seeds"]) for entry in summary]
    number = " to ".join(map(str, sorted({min(seeds), max(seeds)})))
    if max(seeds) == 1:
        text = "With one seed nothing is known about the spread"
    else:
        text = f"In brackets: 95% bootstrap intervals of the median over {number} seeds"
        if min(seeds) <= FEW_VALUES:
            text += ", with so few the range of the runs, a rough measure of spread"
    sentences.append(f"{text} (preset {preset}).")
    return sentences
