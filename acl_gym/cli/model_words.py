"""How well a learned model predicts and how sure it is, as commands print it."""

from __future__ import annotations

from collections.abc import Mapping


def model_in_words(
    regressor: str,
    steps: int,
    errors: Mapping[str, float],
    *,
    median: float,
    highest: float,
    limit: float,
    unsure: float,
) -> list[str]:
    """Two sentences on the errors and on the spread of a model.

    Args:
        regressor: the kind of regression.
        steps: how many were recorded.
        errors: of each variable in cross-validation.
        median: of the largest spreads on the paths of the policy.
        highest: of them.
        limit: a spread from which on the model is unsure.
        unsure: the share of starts whose paths exceed it.
    """
    listed = ", ".join(
        f"{name.split(',')[0]} {error:.3f}" for name, error in errors.items()
    )
    return [
        f"The model, {regressor}, of {steps:,} steps. Errors in cross-validation (0: "
        f"none, 1: no better than the mean): {listed}.",
        "Its spread on the paths of the policy (0: certain, 1: the data say nothing): "
        f"median {median:.2f}, highest {highest:.2f}; above {limit:g} from {unsure:.0%} "
        "of the starts.",
    ]
