"""What the agents of chapter 2 ask of an environment, and say where it does not fit."""

from __future__ import annotations

from acl_gym.colony.deposits import Return, UndefinedDepositError
from acl_gym.envs.graph.cities import TravellingSalesmanInstance
from acl_gym.envs.graph.travelling_salesman.lookup import Salesman


def check_instance(
    instance: TravellingSalesmanInstance,
    known: TravellingSalesmanInstance | None,
    fingerprint: bytes | None,
) -> None:
    """Check that cities are those by whose distances an agent chooses.

    Args:
        instance: the cities.
        known: those of the agent; None if it has met none yet.
        fingerprint: of those that the agent had when it was saved; None if there were
            none, or the file does not tell.

    Raises:
        ValueError: a distance differs.
    """
    kept, what = "those with which its file was made", None
    if known is not None:
        kept, what = f"those of {known.name!r}", instance.difference(known)
    elif fingerprint not in (None, instance.fingerprint):
        what = f"others, of {instance!r}"
    if what is not None:
        raise ValueError(
            "env must have the distances by which this agent chooses, "
            f"{kept}, got {what}; make a new agent for other cities."
        )


def check_steps(n_cities: int, limit: int | None, max_steps: int) -> None:
    """Check that ants may go through all cities.

    Args:
        n_cities: how many there are.
        limit: the time limit of the environment, None if it has none.
        max_steps: the most steps of an ant.

    Raises:
        ValueError: a tour would be cut.
    """
    if limit is not None and limit < n_cities:
        raise ValueError(
            f"env must have a time limit of at least {n_cities} steps, the number of "
            f"cities, got max_episode_steps={limit}, which ends every tour; make the "
            "environment without it."
        )
    if max_steps < n_cities:
        raise ValueError(
            f"max_steps must be at least the number of cities, {n_cities}, got "
            f"{max_steps}; leave it out."
        )


def fitness_error(
    error: UndefinedDepositError, salesman: Salesman | None
) -> ValueError:
    """What to say where ants can deposit nothing, with remedies that these agents have.

    Args:
        error: of the deposit.
        salesman: where the ants walk; None elsewhere.
    """
    if salesman is not None and salesman.is_plain:
        remedy = "scale the distances, or leave deposit out"
        if isinstance(error.deposit, Return):
            remedy = "leave deposit out, for tours cost their lengths"
        elif error.cost == 0.0:
            remedy = (
                "a tour of length 0 is a shortest one, so that nothing is left to look "
                "for; to go on nevertheless pass deposit=InverseCost(offset=1)"
            )
    elif isinstance(error.deposit, Return):
        remedy = (
            'pass deposit="inverse_cost" where all returns are negative, else '
            "deposit=InverseCost(offset=...) with an offset above the highest return"
        )
    else:
        remedy = (
            'pass deposit="return" where returns are never negative, else '
            "deposit=InverseCost(offset=...) with an offset above the highest return"
        )
    return ValueError(f"{error.problem}; {remedy}.")
