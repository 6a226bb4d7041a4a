"""The instances of TSPLIB that come with the package, and their optimal tours."""

from __future__ import annotations

from functools import cache
from importlib import resources

import numpy as np
from numpy.typing import NDArray

from acl_gym.envs.graph.cities import TravellingSalesmanInstance
from acl_gym.envs.graph.tsplib import parse_tour, parse_tsplib
from acl_gym.utils import validation

__all__ = [
    "OPTIMA",
    "TravellingSalesmanInstance",
    "load_instance",
    "optimal_tour",
]

OPTIMA: dict[str, float] = {
    "att48": 10_628.0,
    "eil51": 426.0,
    "kroA100": 21_282.0,
    "lin318": 42_029.0,
    "pr2392": 378_032.0,
}
"""Name -> length of a shortest tour, of the instances that come with the package.

G. Reinelt, "TSPLIB - A traveling salesman problem library", ORSA Journal on Computing
3 (1991), 376-384.
"""


def load_instance(name: str) -> TravellingSalesmanInstance:
    """Return an instance of TSPLIB that comes with the package.

    Args:
        name: "att48", "eil51", "kroA100", "lin318" or "pr2392"; the number is that of
            the cities.

    Raises:
        ValueError: there is no such instance.
    """
    return _loaded(validation.one_of("instance", name, tuple(OPTIMA)))


@cache
def _loaded(name: str) -> TravellingSalesmanInstance:
    """The instance, made once: all that there are take 50 MB."""
    return parse_tsplib(_text_of(f"{name}.tsp"), f"{name}.tsp", optimum=OPTIMA[name])


def optimal_tour(name: str) -> NDArray[np.int32]:
    """Return a shortest tour of an instance that comes with the package.

    Args:
        name: as of `load_instance`; TSPLIB has no such tour of lin318.

    Returns:
        The cities in their order, numbered from 0, int32 `(n,)`, a new array.

    Raises:
        ValueError: there is none.
    """
    with_tour = tuple(each for each in OPTIMA if each != "lin318")
    validation.one_of("instance", name, with_tour)
    return parse_tour(_text_of(f"{name}.opt.tour"), f"{name}.opt.tour")


def _text_of(file: str) -> str:
    folder = resources.files("acl_gym.envs.graph") / "data"
    return (folder / file).read_text(encoding="ascii")
