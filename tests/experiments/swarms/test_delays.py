"""The linear theory of late messages against the swarm itself."""

from __future__ import annotations

import numpy as np
import pytest

from acl_gym.experiments.swarms.delays import _slopes, growth_of_disturbances
from acl_gym.swarm import Delayed, Everyone, run
from acl_gym.swarm.aggregation import AggregatingAgents, BoundedRepulsion, Field

G = BoundedRepulsion(attraction=0.7, repulsion=9.0, spread=0.4)


def resting(n: int) -> np.ndarray:
    field = Field(n, time_step=0.01)
    run(AggregatingAgents(G), field, 4_000, 0)
    return field.positions.copy()


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_slopes_are_the_derivatives_of_g(dim: int) -> None:
    x = np.random.default_rng(0).random((4, dim))
    found, step = _slopes(x, G), 1e-6
    for i in range(4):
        for j in range(4):
            for axis in range(dim):
                move = step * np.eye(dim)[axis]
                y = x[i] - x[j]
                plain = (G(y + move) - G(y - move)) / (2 * step)
                expected = 0.0 * plain if i == j else plain
                np.testing.assert_allclose(found[i, j, :, axis], expected, atol=1e-7)


def test_two_agents_on_a_line_by_hand() -> None:
    """Their distance is multiplied by 1 + 2 h g'(delta); as a whole nothing happens."""
    delta, h = float(G.rest_distance), 0.01
    slope = -2.0 / 0.4 * delta**2 * 0.7  # g' at rest, where b exp(-delta^2/c) = a
    x = np.array([[0.0], [delta]])
    assert abs(1 + 2 * h * slope) < 1
    assert growth_of_disturbances(x, h, 0, G) == pytest.approx(1.0, abs=1e-12)
    coarse = 1.5 / -slope  # so that the distance overshoots: 1 - 3 = -2
    assert growth_of_disturbances(x, coarse, 0, G) == pytest.approx(2.0)


@pytest.mark.parametrize("delay", [1, 3])
def test_a_disturbance_grows_as_in_theory(delay: int) -> None:
    """From 1e-12 to 1e-4, where the fastest mode prevails and all is linear."""
    rest, h = resting(6), 0.15
    growth = growth_of_disturbances(rest, h, delay, G)
    assert growth > 1.1
    start = rest + 1e-12 * np.random.default_rng(1).standard_normal(rest.shape)
    field = Field(start, time_step=h)
    sizes = []
    run(
        *(AggregatingAgents(G), field, 200, 0, Delayed(Everyone(), delay)),
        callback=lambda *_: sizes.append(np.linalg.norm(field.positions - rest)),
    )
    last = int(np.flatnonzero(np.array(sizes) < 1e-4)[-1])
    # Peaks, because the mode oscillates.
    late, early = (max(sizes[k - 10 : k]) for k in (last, last - 60))
    assert (late / early) ** (1 / 60) == pytest.approx(growth, rel=0.012)


def test_bad_arguments() -> None:
    x = np.zeros((2, 2))
    with pytest.raises(ValueError, match="time_step must"):
        growth_of_disturbances(x, 0.0, 1)
    with pytest.raises(ValueError, match="delay must"):
        growth_of_disturbances(x, 0.1, -1)
