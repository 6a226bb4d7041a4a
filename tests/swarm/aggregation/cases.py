"""Swarms for tests: positions and interactions of any kind, drawn by Hypothesis."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from acl_gym.swarm.aggregation import BoundedRepulsion, Interaction, UnboundedRepulsion

# A grid of coordinates: some agents are in one place, some exactly on a radius.
coordinates = st.integers(-24, 24).map(lambda k: k / 8.0)


@st.composite
def positions(draw: st.DrawFn, most: int = 40, axes: int = 3) -> np.ndarray:
    """Of 1 to `most` agents in 1 to `axes` dimensions."""
    shape = draw(st.integers(1, most)), draw(st.integers(1, axes))
    return draw(arrays(np.float64, shape, elements=coordinates))


@st.composite
def interactions(draw: st.DrawFn, n: int) -> Interaction:
    """For n agents: a number for all, or one for each."""

    def parameter(least: float, most: float) -> object:
        value = st.floats(least, most)
        if draw(st.booleans()):
            return draw(value)
        return draw(st.lists(value, min_size=n, max_size=n))

    attraction, repulsion = parameter(0.0, 3.0), parameter(0.0, 30.0)
    if draw(st.booleans()):
        return UnboundedRepulsion(attraction=attraction, repulsion=repulsion)
    return BoundedRepulsion(
        attraction=attraction, repulsion=repulsion, spread=parameter(0.05, 2.0)
    )
