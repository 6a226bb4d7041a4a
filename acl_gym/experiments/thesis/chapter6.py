"""The experiments of chapter 6: swarms of moving agents in different channels."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from acl_gym.experiments.study import Experiment
from acl_gym.experiments.swarms.study import AGGREGATION, ANTS, PSO, SwarmStudy
from acl_gym.swarm.pso.benchmark_functions import BENCHMARK_FUNCTIONS

AGENTS, TIME_STEP, STEPS = 50, 0.002, 2_000

RADII = (1.0, 1.5, 2.0, 3.0)
UNEQUAL = [0.8, 2.2]
LOSSES = (0.1, 0.3)
DELAYS = (1, 2, 3, 4, 5, 10, 20)

NOISE = 60.0
"""Standard deviation of the error with which foraging agents observe each coordinate of the
slope: with the time step it makes a random walk of 2.7 in a second."""

VARIABLES, EVALUATIONS = 10, 50_000


def aggregation(stale: bool = False, **channel: Any) -> SwarmStudy:
    """An aggregating swarm in a channel, see `swarms.study.make_channel`."""
    settings = {"agents": AGENTS, "time_step": TIME_STEP}
    return SwarmStudy(
        method=AGGREGATION,
        settings=settings,
        channel=channel,
        stale=stale,
        steps=STEPS,
    )


def foraging(profile: str, **channel: Any) -> SwarmStudy:
    """A foraging swarm in a channel; each agent observes the slope with noise."""
    settings = {
        **{"agents": AGENTS, "time_step": TIME_STEP},
        **{"profile": profile, "noise": NOISE},
    }
    return SwarmStudy(
        method=AGGREGATION, settings=settings, channel=channel, steps=STEPS
    )


def particles(
    function: str, channel: Mapping[str, Any] | None = None, **settings: Any
) -> SwarmStudy:
    """A particle swarm in a channel."""
    return SwarmStudy(
        method=PSO,
        settings={"function": function, "variables": VARIABLES, **settings},
        channel=dict(channel or {}),
        steps=EVALUATIONS,
    )


def ants(env: str, **channel: Any) -> SwarmStudy:
    """A colony that learns by `ACL.learn` and as a swarm of moving agents."""
    settings = {"env": env, "ants": 20, "max_steps": 120, "epsilon": 0.1}
    return SwarmStudy(method=ANTS, settings=settings, channel=channel, steps=5)


SYMMETRIC = {
    "everyone": aggregation(),
    **{
        f"radius {sigma:g}": aggregation(topology="radius", sigma=sigma)
        for sigma in RADII
    },
    **{
        f"{loss:.0%} lost both ways": aggregation(loss=loss, symmetric=True)
        for loss in LOSSES
    },
}
"""Channels in which an agent hears those, and only those, that hear it."""

ONE_WAY = {
    "5 nearest": aggregation(topology="nearest", neighbours=5),
    f"radii {UNEQUAL[0]:g} to {UNEQUAL[1]:g}": aggregation(
        topology="radius", sigma=UNEQUAL
    ),
    **{f"{loss:.0%} lost one way": aggregation(loss=loss) for loss in LOSSES},
}
"""Channels in which an agent may hear one that does not hear it."""

LETTER = aggregation(stale=True)
LATE = {0: aggregation()} | {steps: aggregation(delay=steps) for steps in DELAYS}


def steps_of(delay: int) -> str:
    """A delay in words: 1 step, 2 steps."""
    return f"{delay} step" if delay == 1 else f"{delay} steps"


FORAGING_CHANNELS: dict[str, dict[str, Any]] = {
    "everyone": {},
    "30% lost": {"loss": 0.3},
    "radius 1.5": {"topology": "radius", "sigma": 1.5},
    "5 nearest": {"topology": "nearest", "neighbours": 5},
    "nobody": {"topology": "nobody"},
}
FORAGING_PROFILES = ("plane", "quadratic", "Gaussian")
FORAGING = {
    profile: {
        label: foraging(profile, **channel)
        for label, channel in FORAGING_CHANNELS.items()
    }
    for profile in FORAGING_PROFILES
}

PSO_LOSSES = (0.1, 0.3, 0.5, 0.7, 0.9)
PSO_DELAYS = (1, 5, 20)


def _pso_channels(largest: float) -> dict[str, dict[str, Any]]:
    """Channels of particle swarms by label; radii are relative to the search range."""
    nearest = {"topology": "nearest", "neighbours": 5}
    return {
        "everyone": {},
        "von Neumann": {"topology": "von_neumann"},
        "ring": {"topology": "ring"},
        "5 nearest": nearest,
        "5 nearest, not oneself": {**nearest, "include_self": False},
        "radius 2 L": {"topology": "radius", "sigma": 2.0 * largest},
        "radius 1 L": {"topology": "radius", "sigma": largest},
        **{f"{loss:.0%} lost": {"loss": loss} for loss in PSO_LOSSES},
        **{f"{steps} late": {"delay": steps} for steps in PSO_DELAYS},
        "nobody": {"topology": "nobody"},
    }


SWARMS = {
    function: {
        label: particles(function, channel)
        for label, channel in _pso_channels(benchmark.largest).items()
    }
    for function, benchmark in BENCHMARK_FUNCTIONS.items()
}

STANDARD, PRINTED = "theta + new velocity", "(6.1) as printed"
BOUNDARIES = ("none", "reflect")
SMALL: dict[str, Any] = {"cognitive": 0.25, "social": 0.25}
"""Accelerations for which (6.1) as printed is stable: c1 + c2 < 0.54 at w = 0.73."""

ORDERS = {
    **{
        f"{name}, bounds: {boundary}": particles(
            "sphere", order=order, boundary=boundary
        )
        for name, order in ((STANDARD, "standard"), (PRINTED, "literal"))
        for boundary in BOUNDARIES
    },
    f"{PRINTED}, c1 = c2 = 0.25": particles(
        "sphere", order="literal", boundary="none", **SMALL
    ),
    f"{STANDARD}, c1 = c2 = 0.25": particles("sphere", boundary="none", **SMALL),
}

COLONIES = {
    "grid, on time": ants("grid"),
    "pendulum, on time": ants("pendulum"),
    "grid, 3 steps late": ants("grid", delay=3),
    "pendulum, 3 steps late": ants("pendulum", delay=3),
}


def _experiment(name: str, title: str, section: str, **more: Any) -> Experiment[Any]:
    return Experiment[SwarmStudy](name=name, title=title, section=section, **more)


def _flat(table: Mapping[str, Mapping[str, SwarmStudy]]) -> dict[str, SwarmStudy]:
    return {
        f"{group}, {label}": study
        for group, row in table.items()
        for label, study in row.items()
    }


_SWARM = (
    f"{AGENTS} agents start in a square of 6 x 6 and follow (6.5) with the bounded "
    "repulsion of Gazi and Passino (a = 1, b = 20, c = 0.2), "
    f"{STEPS:,} steps of {TIME_STEP:g} s."
)

EXPERIMENTS: tuple[Experiment[Any], ...] = (
    _experiment(
        *("fig6.centre", "The centre of a swarm, and its parts", "§6.3.3"),
        studies={**SYMMETRIC, **ONE_WAY, "Definition 6.2 to the letter": LETTER},
        plots=("centre",),
        table="aggregation",
        claims=("C24", "C25", "C26", "C27"),
        text=f"{_SWARM} Who hears whom is varied, and which messages are lost. Read to "
        "the letter, Definition 6.2 makes every message one step late. Agents that are "
        "less than 1 apart belong to the same part; two agents rest 0.774 apart.",
    ),
    _experiment(
        *("fig6.delays", "A swarm that hears late", "§6.3.3"),
        studies={f"{steps_of(delay)} late": study for delay, study in LATE.items()},
        plots=("delays",),
        table="aggregation",
        claims=("C27", "C28"),
        text=f"{_SWARM} Everyone hears everyone, but messages arrive late.",
    ),
    _experiment(
        *("fig6.foraging", "A foraging swarm with noisy observations", "§6.3.3"),
        studies=_flat(FORAGING),
        plots=("foraging",),
        table="foraging",
        claims=("C29", "C30"),
        text=f"{_SWARM} Each also descends a profile: a plane, a bowl, or a Gaussian "
        "valley, and observes its slope with noise of its own. The goal is the minimum "
        "at (3, 3); on the plane it is where the centre would be without noise.",
        options={"rows": FORAGING},
    ),
    _experiment(
        *("fig6.optimum", "Particle swarms in different channels", "§6.3.2"),
        studies=_flat(SWARMS),
        plots=("optimum",),
        table="pso",
        claims=("C31", "C33"),
        text=f"40 particles, {VARIABLES} variables, {EVALUATIONS:,} evaluations, w = "
        "0.7298, c1 = c2 = 1.4962, reflecting bounds. Losses and delays are those of a "
        "swarm in which everyone hears everyone. L is the largest value of a variable. "
        "Values below 1e-10 count as solved.",
        options={"rows": SWARMS},
    ),
    _experiment(
        *("fig6.order", "Particles that move with the old velocity", "§6.3.2"),
        studies=ORDERS,
        plots=("least_values",),
        claims=("C32",),
        text=f"Sphere with {VARIABLES} variables; everyone hears everyone. (6.1) as "
        "printed adds the old velocity to the position, all other literature the new "
        "one. By theory the printed order is stable only for c1 + c2 < 0.54.",
    ),
    _experiment(
        *("fig6.colony", "A colony as a swarm of moving agents", "§6.3.1"),
        studies=COLONIES,
        plots=("colonies",),
        table="colonies",
        claims=("C34",),
        text="20 ants learn for 5 trials, once by `ACL.learn` and once by `swarm.run` "
        "with the ants as dynamic agents, the pheromone as the state of the process, "
        "and the messages that an ant is done; both from the same seed.",
    ),
)
