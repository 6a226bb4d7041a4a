"""The claims C13 to C20, on the pendulum of §5.3."""

from __future__ import annotations

from collections.abc import Iterator

from acl_gym.experiments.claims import Part
from acl_gym.experiments.results import Results
from acl_gym.experiments.statistics import (
    estimate,
    interquartile_range,
    median,
    rank_correlation,
    ratio,
)
from acl_gym.experiments.systems import pendulum
from acl_gym.experiments.thesis import chapter5
from acl_gym.experiments.thesis import chapter5_measures as measures
from acl_gym.experiments.thesis.common import (
    FUZZY_FIRST,
    NEARLY_ONE,
    above_one,
    centres,
    claim,
    late_swing,
    listed,
    number,
)


@claim(*measures.TRIED_C13)
def _c13(results: Results) -> Iterator[Part]:
    studies = chapter5.varied("crisp", "rho")
    for rho in (0.0, 0.5, 1.0):
        converged, measured = measures.convergence(results, studies[rho])
        statement = f"rho = {rho:g} does not converge ({measures.CONVERGES})"
        yield Part(statement, measured, not converged)
    ends = measures.late_costs(results, studies)
    costs = centres(ends)
    settled = late_swing(results.values(studies[0.1])) <= measures.SETTLED
    lowest = min(costs, key=costs.__getitem__)
    yield Part("of all rho, 0.001 ends lowest", listed(costs), lowest == 0.001)
    statement = f"rho = 0.1 settles: most runs swing by at most {measures.SETTLED:.0%}"
    share = settled.mean()
    yield Part(statement, f"{share:.0%} of the runs", share > 0.5)
    yield above_one("rho = 0.1 ends higher than 0.001", ends[0.1], ends[0.001])


@claim(*measures.TRIED_C14)
def _c14(results: Results) -> Iterator[Part]:
    for rho in chapter5.RHOS[1:]:
        study = pendulum("fuzzy", global_decay=rho)
        converged, measured = measures.convergence(results, study)
        statement = f"rho = {rho:g} converges ({measures.CONVERGES})"
        yield Part(statement, measured, converged)


@claim(*measures.TRIED_C15)
def _c15(results: Results) -> Iterator[Part]:
    studies = chapter5.varied("crisp", "gamma")
    ends = measures.late_costs(results, studies)
    costs = centres(ends)
    second = min((g for g in costs if g != 0.1), key=costs.__getitem__)
    lead = ratio(ends[second], ends[0.1])
    yield Part(
        "gamma = 0.1 ends lowest, and clearly: the interval of the ratio of the best "
        "other one to it lies above 1",
        f"gamma = {second:g} to 0.1: {lead} ({listed(costs)})",
        lead.low > 1,
    )
    for gamma in (0.5, NEARLY_ONE):
        converged, measured = measures.convergence(results, studies[gamma])
        statement = f"gamma = {number(gamma)} does not converge ({measures.CONVERGES})"
        yield Part(statement, measured, not converged)


@claim(*measures.TRIED_C16)
def _c16(results: Results) -> Iterator[Part]:
    costs = centres(measures.late_costs(results, chapter5.varied("fuzzy", "gamma")))
    small = [cost for gamma, cost in costs.items() if gamma <= 0.1]
    span = max(small) / min(small)
    statement = "up to gamma = 0.1 the highest cost is at most 1.2 times the lowest"
    yield Part(statement, f"{span:.2f}", max(small) <= 1.2 * min(small))
    lowest = min(costs, key=costs.__getitem__)
    yield Part("of all gamma, 0.1 ends lowest", listed(costs), lowest == 0.1)


@claim()
def _c17(results: Results) -> Iterator[Part]:
    ends = {}
    for kind in FUZZY_FIRST:
        studies = chapter5.varied(kind, "M")
        ends[kind] = centres(measures.late_costs(results, studies))
        over_trials = {m: results.values(s).mean(axis=1) for m, s in studies.items()}
        for what, costs in (
            ("last policies", ends[kind]),
            ("mean over trials", centres(over_trials)),
        ):
            rank = rank_correlation(list(costs), list(costs.values()))
            yield Part(
                f"{kind}: the cost ({what}) falls with M: rank correlation of -0.8 or "
                "less",
                f"{rank:.2f} ({listed(costs)})",
                rank <= -0.8,
            )
    fuzzy, crisp = ends["fuzzy"], ends["crisp"]
    gain = fuzzy[250] / fuzzy[2000]
    statement = "fuzzy: 250 ants cost at most 1.1 times as much as 2000"
    yield Part(statement, f"{gain:.3f} times", gain <= 1.1)
    enough = [ants for ants, cost in crisp.items() if cost <= 1.05 * fuzzy[250]]
    yield Part(
        "crisp costs at most 1.05 times as much as 250 fuzzy ants only with 1000 ants or "
        "more",
        f"with {enough[0]} ants" if enough else "not with 2000 ants",
        bool(enough) and enough[0] >= 1000,
    )


@claim(*measures.TRIED_C18)
def _c18(results: Results) -> Iterator[Part]:
    turns = []
    for gamma, seconds in ((0.01, 3.0), (0.1, 2.0)):
        study = pendulum("fuzzy", local_decay=gamma)
        best = measures.best_swing_up(results, study)
        all_runs = measures.swing_ups(results, study)
        typical = median([each.seconds for each in all_runs])
        turns.append(best.turns)
        yield Part(
            f"gamma = {gamma:g}: with the best fuzzy policy it stays within "
            f"{measures.UPRIGHT:g} rad of upright after at most {seconds + 0.5:g} s",
            f"{best.seconds:.1f} s; the runs in the median {typical:.1f} s",
            best.seconds <= seconds + 0.5,
        )
    for label, study in chapter5.CRISP_SWINGS.items():
        best = measures.best_swing_up(results, study)
        yield Part(
            f"the best crisp policy ({label}) turns round more often than the best "
            "fuzzy one (gamma = 0.01)",
            f"{best.turns} turns in {best.seconds:.1f} s against {turns[0]}",
            best.turns > turns[0],
        )


@claim(*measures.TRIED_C19)
def _c19(results: Results) -> Iterator[Part]:
    crisp, fuzzy = (
        measures.late_costs(results, chapter5.partitions(k)) for k in ("crisp", "fuzzy")
    )
    first, second = ratio(crisp[16], crisp[32]), ratio(crisp[32], crisp[64])
    statement = "crisp: N = 16 costs at least 1.1 times as much as N = 32"
    yield Part(statement, str(first), first.value >= 1.1)
    statement = "crisp: N = 32 costs at most 1.1 times as much as N = 64"
    yield Part(statement, str(second), second.value <= 1.1)
    for coarse, fine in ((16, 32), (32, 64)):
        statement = f"fuzzy: N = {coarse} costs more than N = {fine}"
        yield above_one(statement, fuzzy[coarse], fuzzy[fine])
    spread = interquartile_range(fuzzy[64]) / float(median(fuzzy[64]))
    statement = (
        "fuzzy, N = 64: the interquartile range of the runs is at most 5% of the median"
    )
    yield Part(statement, f"{spread:.1%}", spread <= 0.05)


@claim(*measures.TRIED_C20)
def _c20(results: Results) -> Iterator[Part]:
    fuzzy, crisp = (measures.structure(results, pendulum(kind)) for kind in FUZZY_FIRST)
    statement = "neighbouring cells agree more often in fuzzy than in crisp policies"
    yield above_one(statement, fuzzy[0], crisp[0])
    statement = "fuzzy: near hanging the torque drives the motion in 80% of the cells"
    drives, brakes = estimate(fuzzy[1]), estimate(fuzzy[2])
    yield Part(f"{statement} or more", str(drives), drives.value >= 0.8)
    statement = (
        "fuzzy: near upright the torque brakes what moves away in 80% of the cells"
    )
    yield Part(f"{statement} or more", str(brakes), brakes.value >= 0.8)
    statement = "near hanging fuzzy policies drive the motion in more cells than crisp"
    yield above_one(statement, fuzzy[1], crisp[1])


CLAIMS = (_c13, _c14, _c15, _c16, _c17, _c18, _c19, _c20)
