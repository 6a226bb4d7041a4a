"""The navigation of §4.5: its experiments, claims, and what was tried beside them."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from acl_gym.evaluation import evaluate_policy_cost
from acl_gym.evaluation.rollout import Rollout
from acl_gym.experiments.claims import Part, Tried
from acl_gym.experiments.methods import restore_policy
from acl_gym.experiments.results import Results
from acl_gym.experiments.statistics import estimate, interquartile_range, ratio
from acl_gym.experiments.study import Experiment, Study
from acl_gym.experiments.systems import navigation, planned
from acl_gym.experiments.thesis.common import (
    FUZZY_FIRST,
    KINDS,
    LATE,
    below_one,
    claim,
    experiment,
    fewer,
    for_each,
    late_cost,
    listed,
)
from acl_gym.utils.typing import FloatArray

COSTS = {"quadratic": "quadratic cost", "time": "time-spent cost"}
"""The costs of the environment, and what titles call them."""

RULES = {
    "bounds": "the goal rule of Table 4.1",
    "membership": "the goal rule of §4.3.2 (membership above 0.5)",
}

LONG_WALKS = navigation("time", "fuzzy", "membership", max_steps=600)
"""Four times as long walks in learning; policies are evaluated over 150 steps."""

CORNERS = np.array([[a, 0.0, b, 0.0] for a in (-5.0, 5.0) for b in (-5.0, 5.0)])
"""At rest in the corners of the field, `(4, state_size)`."""

_GOAL = (
    "200 ants, Table 4.1, K = 200; the goal is reached within 0.25 m and 0.05 m/s. The "
    "other goal rule of the thesis is in navigation-rules."
)
_VARIATION = "The share of cells whose action differs from that of the trial before."
_SENSITIVITY = "The sensitivity of the policy, eq. (3.48), the mean over the cells."
_POLICIES = (
    "The policy at rest, and the paths of vehicles that start at rest, over the damping "
    "field; the last policy of the run whose last policy is the cheapest."
)
_PLANNED = (
    "The policy of fuzzy Q-iteration on the same cells, which knows the model; the best "
    "of the discounts 1, 0.98 and 0.95."
)


def reference(cost: str, kind: str = "fuzzy", rule: str = "bounds") -> Study:
    """Fuzzy Q-iteration on the cells of a study."""
    return planned(navigation(cost, kind, rule))


def _figure(
    number: int,
    cost: str,
    title: str,
    text: str,
    claims: str = "",
    plot: str = "bands",
    **options: str,
) -> Experiment:
    kinds = ("fuzzy",) if plot == "baseline" else KINDS
    compared = "C11" in claims or "C12" in claims
    return experiment(
        f"fig4.{number}",
        f"Navigation, {COSTS[cost]}: {title}",
        {"quadratic": "§4.5.2", "time": "§4.5.3"}[cost],
        {kind: navigation(cost, kind) for kind in kinds},
        *(claims, plot),
        references={"fuzzy Q-iteration": reference(cost)} if compared else {},
        text=text,
        options=options,
    )


_variation = partial(_figure, title="policy variation", measure="policy_variation")
_sensitivity = partial(_figure, title="sensitivity", measure="sensitivity")

EXPERIMENTS = (
    _figure(6, "quadratic", "cost of the policy", _GOAL, "C9 C11"),
    _variation(7, "quadratic", text=_VARIATION, claims="C10"),
    _sensitivity(8, "quadratic", text=_SENSITIVITY, claims="C10"),
    _figure(9, "quadratic", "best policies", _POLICIES, plot="policies"),
    _figure(10, "quadratic", "fuzzy Q-iteration", _PLANNED, "C11", "baseline"),
    _figure(11, "time", "cost of the policy", _GOAL, "C12"),
    _variation(12, "time", text=_VARIATION),
    _figure(13, "time", "best policies", _POLICIES, "C12", "policies"),
    _figure(14, "time", "fuzzy Q-iteration", _PLANNED, "C12", "baseline"),
    experiment(
        *("navigation-rules", "Navigation under the other goal rule", "§4.3.2"),
        studies={
            f"{cost}, {kind}": navigation(cost, kind, "membership")
            for cost in COSTS
            for kind in KINDS
        },
        references={
            "quadratic, fuzzy Q-iteration": reference("quadratic", rule="membership")
        },
        explains="C9 C10 C11 C12",
        text="The goal is reached where its membership function exceeds 0.5 (§4.3.2), "
        "not within the bounds of Table 4.1: the thesis states both rules.",
        options={"columns": 2},
    ),
    experiment(
        *("navigation-long", "Navigation, time-spent cost: longer walks", "§4.5.3"),
        studies=fewer({"fuzzy, T = 600": LONG_WALKS}),
        explains="C12",
        text="The goal rule of §4.3.2; in learning ants may walk four times as long, "
        "and policies are evaluated over 150 steps, as in the other experiments.",
    ),
)


def late_costs(results: Results, cost: str, rule: str = "bounds") -> list[FloatArray]:
    """The late policy costs of fuzzy, then of crisp ACL, each `(runs,)`."""
    return [late_cost(results, navigation(cost, kind, rule)) for kind in FUZZY_FIRST]


def trials_of_fall(
    results: Results, cost: str, rule: str = "bounds", share: float = 0.9
) -> list[int]:
    """When the mean over the runs has done a share of its fall: fuzzy, then crisp."""
    trials = []
    for kind in FUZZY_FIRST:
        mean = results.values(navigation(cost, kind, rule)).mean(axis=0)
        end = mean[-LATE:].mean()
        bound = end + (1 - share) * max(mean[0] - end, 0.0)
        trials.append(int(np.argmax(mean <= bound)) + 1)
    return trials


def mean_damping(policy: Any, study: Study) -> float:
    """The mean damping on the paths from the evaluation states, in kg/s."""
    states = study.task.evaluation_states()
    env = study.task.make_system_env(len(states))
    rollout, met = Rollout(env, study.task.longest_evaluation), []
    observation = rollout.start(seed=0, states=states)
    while rollout.ants.size:
        there = observation[rollout.ants]
        met.append(env.system.damping(there[:, 0], there[:, 2]))  # type: ignore[attr-defined]
        observation = rollout.step(policy.predict(there)[0]).observation
    return float(np.concatenate(met).mean())


def _other_rule(cost: str, results: Results) -> Tried:
    fuzzy, crisp = late_costs(results, cost, "membership")
    fast, slow = trials_of_fall(results, cost, "membership")
    return Tried(
        f"{RULES['membership']}: trials to 90% of the fall, cost of the last {LATE} "
        "trials, interquartile range of the runs, fuzzy against crisp",
        f"{fast} against {slow}; ratio {ratio(fuzzy, crisp)}; "
        f"{interquartile_range(fuzzy):.3g} against {interquartile_range(crisp):.3g}",
    )


def _other_shares(results: Results) -> Tried:
    found = {}
    for share in (0.5, 0.8, 0.95):
        fast, slow = trials_of_fall(results, "quadratic", share=share)
        found[f"{share:.0%}"] = f"{fast} against {slow}"
    what = "trials to other shares of the fall, fuzzy against crisp"
    return Tried(what, listed(found))


def _sensitivities(rule: str, results: Results) -> Tried:
    found = {}
    for kind in FUZZY_FIRST:
        study = navigation("quadratic", kind, rule)
        mean = results.values(study, "sensitivity").mean(axis=0)
        low = int(mean.argmin())
        lowest = f"lowest {mean[low]:.2f} after {low + 1} trials"
        found[kind] = f"{mean[0]:.2f} at first, {lowest}, {mean[-1]:.2f} at the end"
    return Tried(f"how the sensitivity changes, {RULES[rule]}", listed(found, "; "))


def _cheapest(results: Results) -> Tried:
    found = {}
    for rule in RULES:
        study, planner = (
            f("quadratic", "fuzzy", rule) for f in (navigation, reference)
        )
        cost = results.last(planner)[0]
        last = estimate(late_cost(results, study) / cost)
        best = estimate(results.values(study).min(axis=1) / cost)
        ours, theirs = (
            results.last(s, "success_rate").mean() for s in (study, planner)
        )
        arrive = f"{ours:.0%} of the starts arrive against {theirs:.0%}"
        found[rule] = f"last {last}, best {best}; {arrive}"
    return Tried(
        "both goal rules; cost of the last and of the best policies over that of fuzzy "
        "Q-iteration",
        listed(found, "; "),
    )


def _longer_walks(results: Results) -> Tried:
    last = estimate(late_cost(results, LONG_WALKS))
    best = estimate(results.values(LONG_WALKS).min(axis=1))
    arrive = results.last(LONG_WALKS, "success_rate").mean()
    return Tried(
        f"T = 600 in learning, {RULES['membership']}, fuzzy: cost of the last {LATE} "
        "trials, of the best policies, and the share of the starts that arrive (more in "
        "docs/reproduction.md)",
        f"{last}, {best}, {arrive:.0%}",
    )


def _arrivals(results: Results) -> Tried:
    studies = {
        f"{kind}, {rule}": navigation("time", kind, rule)
        for rule in RULES
        for kind in FUZZY_FIRST
    }
    studies["fuzzy Q-iteration"] = reference("time")
    shares = {s: results.last(each, "success_rate") for s, each in studies.items()}
    found = {label: f"{share.mean():.0%}" for label, share in shares.items()}
    what = "starts from which the last policies arrive, both goal rules"
    return Tried(what, listed(found))


@claim(partial(_other_rule, "quadratic"), _other_shares)
def _c9(results: Results) -> Iterator[Part]:
    fuzzy, crisp = late_costs(results, "quadratic")
    fast, slow = trials_of_fall(results, "quadratic")
    narrow, wide = interquartile_range(fuzzy), interquartile_range(crisp)
    statement = "the mean of the fuzzy runs has done 90% of its fall in fewer trials"
    yield Part(statement, f"{fast} against {slow}", fast < slow)
    statement = f"the fuzzy policies of the last {LATE} trials cost less than the crisp"
    yield below_one(statement, fuzzy, crisp)
    statement = "the interquartile range of the fuzzy runs is narrower"
    yield Part(statement, f"{narrow:.3g} against {wide:.3g}", narrow < wide)


@claim(*for_each(RULES, _sensitivities))
def _c10(results: Results) -> Iterator[Part]:
    ends = {}
    for kind in FUZZY_FIRST:
        study = navigation("quadratic", kind)
        variation = results.values(study, "policy_variation")[:, -LATE:].mean(axis=1)
        sensitivity = results.values(study, "sensitivity")
        ends[kind] = sensitivity[:, -LATE:].mean(axis=1)
        statement = f"{kind}: in every run some cells change in the last {LATE} trials"
        measured = f"{variation.min():.1%} of the cells or more"
        yield Part(statement, measured, variation.min() > 0)
        statement = f"{kind}: the sensitivity falls from the fifth trial to the end"
        yield below_one(statement, ends[kind], sensitivity[:, 4])
    yield below_one("crisp ends less sensitive", ends["crisp"], ends["fuzzy"])


@claim(_cheapest)
def _c11(results: Results) -> Iterator[Part]:
    cost = results.last(reference("quadratic"))[0]
    found = estimate(late_costs(results, "quadratic")[0] / cost)
    yield Part(
        f"the policies of the last {LATE} trials cost what that of fuzzy Q-iteration on "
        f"the same cells costs, {cost:.1f}, within 15%: the ratio",
        str(found),
        abs(found.value - 1) <= 0.15,
    )
    yield Part("they cost at most 15% more: the ratio", str(found), found.value <= 1.15)


@claim(partial(_other_rule, "time"), _arrivals, _longer_walks)
def _c12(results: Results) -> Iterator[Part]:
    study = navigation("time", "fuzzy")
    fuzzy, crisp, q_iteration = (
        restore_policy(each, results.runs(each)[results.best_run(each)])
        for each in (study, navigation("time", "crisp"), reference("time"))
    )
    steps, make_env = study.task.longest_evaluation, study.task.make_system_env
    statement = f"the fuzzy policies of the last {LATE} trials cost less than the crisp"
    yield below_one(statement, *late_costs(results, "time"))
    statement = "the best fuzzy policy reaches the goal from at least 90% of the starts"
    starts = evaluate_policy_cost(fuzzy, make_env(study.slots), max_steps=steps)
    arrive = float(np.asarray(starts.success).mean())
    yield Part(statement, f"{arrive:.0%}", arrive >= 0.9)
    ours, theirs = (mean_damping(policy, study) for policy in (fuzzy, q_iteration))
    yield Part(
        "the mean damping on the paths of the best fuzzy policy is at most 1.1 times "
        "that on the paths of fuzzy Q-iteration",
        f"{ours:.3g} against {theirs:.3g} kg/s",
        ours <= 1.1 * theirs,
    )
    corners = evaluate_policy_cost(crisp, make_env(4), CORNERS, max_steps=steps)
    statement = "the best crisp policy fails from at least one corner of the field"
    failed = int((~np.asarray(corners.success, dtype=np.bool_)).sum())
    yield Part(statement, f"{failed} of 4", failed > 0)


CLAIMS = (_c9, _c10, _c11, _c12)
