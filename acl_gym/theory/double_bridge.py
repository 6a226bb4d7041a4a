"""The choice model of the double bridge, §2.3.2: what it promises exactly.

Part of `acl_gym.theory`. Ants cross a bridge one after the other and choose between its
branches A and B by (2.1). The number of crossings of A is then a Markov chain, whose law
after any number of ants follows by recursion. Where crossings take time, see
`simulate_crossings`.

Common arguments:
    alpha: how strongly ants follow the others, >= 0; about 2 in the experiments of
        Deneubourg et al. (1990).
    offset: C of (2.1), > 0, how attractive a branch is that nobody has crossed; about
        20 there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from acl_gym.theory import ranges
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray

ALPHA, OFFSET = 2.0, 20.0
"""alpha and C as fitted to the Argentine ant (Deneubourg et al., 1990)."""


def choice_probability(
    crossed: ArrayLike,
    others: ArrayLike,
    alpha: ArrayLike = ALPHA,
    offset: ArrayLike = OFFSET,
) -> FloatArray:
    """P_A of eq. (2.1): the probability that the next ant chooses branch A.

    Args:
        crossed: N_A, how many ants have crossed branch A, >= 0.
        others: N_B, how many have crossed branch B, >= 0.
        alpha: see `acl_gym.theory.double_bridge`.
        offset: C, see `acl_gym.theory.double_bridge`.
    """
    offset = ranges.positive("offset", offset)
    a = offset + ranges.checked("crossed", crossed, at_least=0)
    b = offset + ranges.checked("others", others, at_least=0)
    alpha = ranges.checked("alpha", alpha, at_least=0)
    # Powers of the ratio: those of the numbers themselves may overflow.
    with np.errstate(over="ignore"):  # beyond all floats the probability is 0
        return np.asarray(1.0 / (1.0 + (b / a) ** alpha))


def crossing_law(
    n_ants: int, alpha: float = ALPHA, offset: float = OFFSET
) -> FloatArray:
    """The exact law of N_A after some ants, by recursion over the ants.

    P_{n+1}(k) = P_n(k - 1) p(k - 1, n - k + 1) + P_n(k) (1 - p(k, n - k)), with p the
    probability (2.1). It takes n_ants^2 / 2 additions: 0.1 s for 5,000 ants.

    Args:
        n_ants: N, >= 0.
        alpha: see `acl_gym.theory.double_bridge`.
        offset: C, see `acl_gym.theory.double_bridge`.

    Returns:
        The probability that k of the ants have chosen branch A, for k = 0, .., N,
        shape `(N + 1,)`.
    """
    count = validation.integer("n_ants", n_ants, at_least=0)
    weights = crossing_weights(count, alpha, offset)
    law = np.ones(1)
    for n in range(count):
        of_a = weights[: n + 1]
        chosen = law * (of_a / (of_a + of_a[::-1]))
        following = np.empty(n + 2)
        following[0] = 0.0
        following[1:] = chosen
        following[:-1] += law - chosen
        law = following
    return law


def linear_crossing_law(n_ants: int, offset: float = OFFSET) -> FloatArray:
    """The law of N_A for alpha = 1: the Beta-binomial law, in closed form.

    The model is then Polya's urn. The share of branch A has the law Beta(C, C) in the
    limit: it settles, but anywhere, and no branch wins.

    Args:
        n_ants: N, >= 0.
        offset: C, see `acl_gym.theory.double_bridge`.

    Returns:
        See `crossing_law`.
    """
    count = validation.integer("n_ants", n_ants, at_least=0)
    offset = validation.number("offset", offset, above=0)
    validation.check_memory(f"{count:,} ants", 64 * count, "use fewer")
    k = np.arange(float(count))
    # P(k + 1) / P(k) of C(N, k) B(k + C, N - k + C) / B(C, C).
    ratio = (count - k) * (k + offset) / ((k + 1.0) * (count - k - 1.0 + offset))
    logs = np.concatenate([[0.0], np.cumsum(np.log(ratio))])
    law = np.exp(logs - logs.max())
    return np.asarray(law / law.sum())


def majority_probability(law: ArrayLike, share: float = 0.8) -> float:
    """The probability that one branch holds more than a share of the crossings.

    Args:
        law: of N_A, as `crossing_law` returns it, `(N + 1,)` with N >= 1.
        share: in [0.5, 1).
    """
    law = ranges.checked("law", law, at_least=0, at_most=1)
    if law.ndim != 1 or law.size < 2 or abs(law.sum() - 1.0) > 1e-6:
        raise ValueError(
            "law must hold the probabilities of 0 to N crossings with N >= 1, which sum "
            f"to 1, got an array of shape {law.shape} with the sum {law.sum():g}; "
            "crossing_law makes one."
        )
    share = validation.number("share", share, at_least=0.5, below=1)
    count = law.size - 1
    k = np.arange(law.size)
    # A share such as 0.57 of 100 ants must not be a little less than 57.
    more = np.maximum(k, count - k) > share * count + 1e-9 * count
    return float(law[more].sum())


def crossing_weights(count: int, alpha: float, offset: float) -> FloatArray:
    """(C + n)^alpha for n = 0, .., `count`, relative to the largest: `(count + 1,)`.

    Raises:
        ValueError: an argument is out of range, or a float cannot hold the smallest
            weight beside the largest.
    """
    alpha = validation.number("alpha", alpha, at_least=0)
    offset = validation.number("offset", offset, above=0)
    validation.check_memory(f"{count:,} ants", 8 * count, "use fewer")
    weights = ((offset + np.arange(count + 1.0)) / (offset + count)) ** alpha
    if weights[0] < np.finfo(np.float64).tiny:
        raise ValueError(
            f"alpha must leave numbers that a float can hold, got {alpha:g}, with which "
            f"({offset:g} / {offset + count:g})^alpha is 0; a smaller alpha, a larger "
            "offset or fewer ants help."
        )
    return np.asarray(weights)
