"""The project's targets for its speed, most of them as ratios within one run."""

from __future__ import annotations

from typing import Any

from speed_cases import WALKERS, alone, cart_pole, in_numpy, loop, walking_back

FUZZY_LOOP = loop("pendulum", "fuzzy", 2_000)
ALONE = alone("pendulum", 2_048)


def criteria(rates: dict[str, float]) -> list[dict[str, Any]]:
    """Compare the steps per second of the cases with the targets.

    Args:
        rates: steps per second by name of the case; missing cases are skipped.

    Returns:
        One row per criterion: `what`, `measured`, `asked` ("at least" or "at most"),
        `bound`, `met`.
    """
    gymnax = next((name for name in rates if "gymnax" in name), "")
    envpool = next((name for name in rates if "envpool" in name), "")
    asked = [
        ("learning, 2,000 ants, to NumPy", FUZZY_LOOP, in_numpy(2_000), 10.0),
        ("pendulum alone to CartPole, 2,048 slots", ALONE, cart_pole(2_048), 3.0),
        ("pendulum alone to gymnax (all cores), 2,048 slots", ALONE, gymnax, 5.0),
        ("pendulum alone to EnvPool, 2,048 slots", ALONE, envpool, 30.0),
        (
            "learning with 250 ants to learning with 2,000",
            loop("pendulum", "fuzzy", 250),
            FUZZY_LOOP,
            0.5,
        ),
        ("learning, 2,000 ants, to CartPole alone", FUZZY_LOOP, cart_pole(2_000), 1.0),
        ("learning, 2,000 ants, to gymnax alone (all cores)", FUZZY_LOOP, gymnax, 1.0),
        ("learning, 2,000 ants, to EnvPool alone", FUZZY_LOOP, envpool, 1.0),
    ]
    rows = [
        _row(what, rates[ours] / rates[theirs], "at least", bound)
        for what, ours, theirs, bound in asked
        if ours in rates and theirs in rates
    ]
    same = alone("pendulum", 2_000)
    if FUZZY_LOOP in rates and same in rates:
        ratio = rates[same] / rates[FUZZY_LOOP]
        what = "cost of a learning ant-step to that of the environment alone"
        rows.append(_row(what, ratio, "at most", 3.5))
    if walking_back(WALKERS[0]) in rates:
        what = "walking back, nanoseconds a remembered step"
        rows.append(_row(what, 1e9 / rates[walking_back(WALKERS[0])], "at most", 35.0))
    return rows


def _row(what: str, measured: float, asked: str, bound: float) -> dict[str, Any]:
    met = measured >= bound if asked == "at least" else measured <= bound
    return {
        "what": what,
        "measured": measured,
        "asked": asked,
        "bound": bound,
        "met": met,
    }


def complete_run_row(seconds: float) -> dict[str, Any]:
    """The criterion in seconds: a complete run."""
    what = "complete run, 100 trials of 250 ants on the fuzzy pendulum, seconds"
    return _row(what, seconds, "at most", 2.0)
