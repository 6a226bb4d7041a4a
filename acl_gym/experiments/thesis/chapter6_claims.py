"""The claims C24 to C34, on the swarms of chapter 6."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from acl_gym.experiments.claims import Part, Tried
from acl_gym.experiments.results import Results
from acl_gym.experiments.statistics import estimate, median, ratio
from acl_gym.experiments.swarms.delays import growth_of_disturbances
from acl_gym.experiments.swarms.measures import (
    SETTLED,
    SOLVED,
    late_speed,
    least_values,
    mean_ranks,
    settling_steps,
    size_swing,
    solved,
)
from acl_gym.experiments.swarms.study import SwarmStudy
from acl_gym.experiments.thesis import chapter6
from acl_gym.experiments.thesis.common import below_one, claim, listed
from acl_gym.utils.text import digits

STANDS = 1e-12
"""A centre that has drifted less has not moved, but for rounding."""

MOVES = 1e-3
"""A centre that has drifted farther has moved: a thousandth of an agent's distance or so."""

RESTS = 0.01
"""A swarm rests whose centre is slower, in lengths per second, over the last quarter."""

SHORT = 5
"""Delays up to this are looked at in theory; the eigenvalues of longer ones take long."""

MOST = 0.9
"""The share of runs that "nine of ten" stands for."""

NEAR = 1.0
"""A centre that is nearer to a minimum has reached it: in the bowl the noise alone moves the
centre of 50 agents by 0.38 (rms)."""


def _every_radius(results: Results) -> Tried:
    studies = {"everyone": chapter6.SYMMETRIC["everyone"]} | {
        f"radius {sigma:g}": chapter6.SYMMETRIC[f"radius {sigma:g}"]
        for sigma in chapter6.RADII
    }
    found = {
        label: f"{digits(results.last(study, 'parts').mean())} parts, settled after "
        f"{median(settling_steps(results, study)):.0f} steps"
        for label, study in studies.items()
    }
    return Tried("the mean number of parts, and when they settle", listed(found, "; "))


@claim(_every_radius)
def _c24(results: Results) -> Iterator[Part]:
    for label in ("everyone", *(f"radius {sigma:g}" for sigma in chapter6.RADII)):
        parts = results.last(chapter6.SYMMETRIC[label], "parts")
        one = float((parts == 1).mean())
        yield Part(
            f"{label}: at least nine of ten runs end as one part",
            f"{one:.0%}; {digits(parts.mean())} parts in the mean",
            one >= MOST,
        )


@claim()
def _c25(results: Results) -> Iterator[Part]:
    for label, study in chapter6.SYMMETRIC.items():
        drift = results.values(study, "drift").max()
        statement = f"{label}: in no run does the centre drift by {STANDS:g} or more"
        yield Part(statement, f"{drift:.1e} at most", drift < STANDS)


@claim()
def _c26(results: Results) -> Iterator[Part]:
    for label, study in chapter6.ONE_WAY.items():
        drift = results.last(study, "drift")
        yield Part(
            f"{label}: in every run the centre has drifted by more than {MOVES:g}",
            f"{estimate(drift)}; {digits(float(drift.min()))} at least",
            drift.min() > MOVES,
        )


@claim()
def _c27(results: Results) -> Iterator[Part]:
    letter, late = chapter6.LETTER, chapter6.LATE[1]
    drift = results.last(letter, "drift")
    yield Part(
        f"in every run the centre drifts by more than {MOVES:g}",
        f"{estimate(drift)}; {digits(float(drift.min()))} at least",
        drift.min() > MOVES,
    )
    count = min(len(results.runs(letter)), len(results.runs(late)))
    both = [results.values(study, "drift")[:count] for study in (letter, late)]
    apart = float(np.abs(both[0] - both[1]).max())
    yield Part(
        "the centre moves as in a channel that is one step late, to the bit",
        f"{apart:g} apart at most",
        apart == 0.0,
    )
    sizes = [
        estimate(results.last(study, "rms")).value
        for study in (letter, chapter6.LATE[0])
    ]
    yield Part(
        "the size stays the same: the rms distances in the end differ by at most 1%",
        f"{digits(sizes[0])} against {digits(sizes[1])}",
        abs(sizes[0] / sizes[1] - 1) <= 0.01,
    )


def _speeds(results: Results) -> Tried:
    def words(study: SwarmStudy) -> str:
        measures = late_speed(results, study), results.last(study, "drift")
        speed, drift = (digits(float(median(each))) for each in measures)
        return f"{speed} per s, drift {drift}"

    found = {
        chapter6.steps_of(delay): words(study) for delay, study in chapter6.LATE.items()
    }
    what = "the speed of the centre over the last quarter, and its drift, medians of the runs"
    return Tried(what, listed(found, "; "))


def _linear_theory(results: Results) -> Tried:
    rest = results.runs(chapter6.LATE[0])[0].table.reshape(chapter6.AGENTS, -1)
    found = {
        chapter6.steps_of(delay): (
            f"{growth_of_disturbances(rest, chapter6.TIME_STEP, delay):.4f}"
        )
        for delay in chapter6.LATE
        if delay <= SHORT
    }
    what = "the factor by which a small disturbance at rest grows in a step, in theory"
    return Tried(what, listed(found))


@claim(_speeds, _linear_theory)
def _c28(results: Results) -> Iterator[Part]:
    for delay, study in list(chapter6.LATE.items())[1:]:
        late = f"{chapter6.steps_of(delay)} late"
        speed = float(median(late_speed(results, study)))
        yield Part(
            f"{late}: over the last quarter the centre is slower than "
            f"{RESTS:g} per s, median of the runs",
            f"{digits(speed)} per s",
            speed < RESTS,
        )
        steady = float((size_swing(results, study) <= SETTLED).mean())
        yield Part(
            f"{late}: over the last quarter the rms distance swings by at "
            f"most {SETTLED:.0%} in nine of ten runs",
            f"in {steady:.0%} of runs",
            steady >= MOST,
        )
        one = float((results.last(study, "parts") == 1).mean())
        statement = f"{late}: at least nine of ten runs end as one part"
        yield Part(statement, f"{one:.0%}", one >= MOST)


@claim()
def _c29(results: Results) -> Iterator[Part]:
    for profile, row in chapter6.FORAGING.items():
        swarm, alone = (
            results.last(row[label], "miss") for label in ("everyone", "nobody")
        )
        statement = f"{profile}: agents in a swarm end nearer to the goal than alone"
        yield below_one(statement, swarm, alone)


def _misses(results: Results) -> Tried:
    found = {
        f"{profile}, {label}": f"{digits(estimate(results.last(study, 'miss')).value)} "
        f"({digits(estimate(results.last(study, 'centre_miss')).value)})"
        for profile, row in chapter6.FORAGING.items()
        for label, study in row.items()
    }
    what = "the distance of the agents, and of their centre, from the goal"
    return Tried(what, listed(found, "; "))


@claim(_misses)
def _c30(results: Results) -> Iterator[Part]:
    limited = [
        each
        for each in chapter6.FORAGING_CHANNELS
        if each not in ("everyone", "nobody")
    ]
    for profile, row in chapter6.FORAGING.items():
        alone = results.last(row["nobody"], "miss")
        for label in limited:
            miss = results.last(row[label], "miss")
            statement = f"{profile}, {label}: agents end nearer to the goal than alone"
            yield below_one(statement, miss, alone)
            if profile == "plane":
                continue
            near = float((results.last(row[label], "centre_miss") < NEAR).mean())
            yield Part(
                f"{profile}, {label}: in nine of ten runs the centre ends within "
                f"{NEAR:g} of the minimum",
                f"{near:.0%}",
                near >= MOST,
            )


@claim()
def _c31(results: Results) -> Iterator[Part]:
    for function, row in chapter6.SWARMS.items():
        alone = least_values(results, row["nobody"])
        for label in ("everyone", "ring"):
            statement = f"{function}, {label}: lower in the end than without messages"
            yield below_one(statement, least_values(results, row[label]), alone)


def _standard_order(results: Results) -> Tried:
    found = {
        label: f"{digits(float(median(results.last(study, 'value'))))}, "
        f"{solved(results, study):.0%} solved"
        for label, study in chapter6.ORDERS.items()
    }
    return Tried("the median of the least values", listed(found, "; "))


@claim(_standard_order)
def _c32(results: Results) -> Iterator[Part]:
    for boundary in chapter6.BOUNDARIES:
        study = chapter6.ORDERS[f"{chapter6.PRINTED}, bounds: {boundary}"]
        share = solved(results, study)
        value = float(median(results.last(study, "value")))
        yield Part(
            f"bounds: {boundary}: nine of ten runs end below {SOLVED:g} on Sphere",
            f"{share:.0%}; median {digits(value)}",
            share >= MOST,
        )


def _ranks(results: Results) -> Tried:
    labels = next(iter(chapter6.SWARMS.values()))
    ranks = mean_ranks(results, chapter6.SWARMS)
    ordered = sorted(zip(ranks, labels, strict=True))
    found = {label: f"{rank:.1f}" for rank, label in ordered}
    what = "the mean rank of the channels over the five functions (1 is the best)"
    return Tried(what, listed(found))


def _losses(results: Results) -> Tried:
    found = {}
    for function in ("rosenbrock", "rastrigin", "griewank"):
        row = chapter6.SWARMS[function]
        full = least_values(results, row["everyone"])
        for loss in chapter6.PSO_LOSSES:
            values = least_values(results, row[f"{loss:.0%} lost"])
            found[f"{function}, {loss:.0%}"] = str(ratio(values, full))
    what = "the ratio of the least value with losses to that without"
    return Tried(what, listed(found, "; "))


@claim(_ranks, _losses)
def _c33(results: Results) -> Iterator[Part]:
    sphere, rastrigin = chapter6.SWARMS["sphere"], chapter6.SWARMS["rastrigin"]
    limited = [each for each in sphere if each not in ("everyone", "nobody")]
    for label in limited:
        share = solved(results, sphere[label])
        statement = f"sphere, {label}: nine of ten runs end below {SOLVED:g}"
        yield Part(statement, f"{share:.0%}", share >= MOST)
    full = least_values(results, rastrigin["everyone"])
    for label in limited:
        found = ratio(least_values(results, rastrigin[label]), full)
        statement = (
            f"rastrigin, {label}: the interval of the ratio to everyone does not "
        )
        yield Part(f"{statement}lie above 1", str(found), not found.low > 1)


@claim()
def _c34(results: Results) -> Iterator[Part]:
    for label, study in chapter6.COLONIES.items():
        learned, differing, same = (
            results.last(study, measure)
            for measure in ("learned", "differing", "same_draws")
        )
        yield Part(
            f"{label}: in no run does a level differ from that of `ACL.learn`, and "
            "learning has changed some",
            f"{differing.max():.0f} differ, {learned.min():.0f} or more were changed",
            differing.max() == 0 and learned.min() > 0,
        )
        statement = f"{label}: both have drawn the same random numbers in every run"
        yield Part(statement, f"{same.mean():.0%} of runs", same.min() == 1)


CLAIMS = (_c24, _c25, _c26, _c27, _c28, _c29, _c30, _c31, _c32, _c33, _c34)
