"""Pictures of policies, of what they do, and of how they were learned.

`plot_policy`, `plot_pheromone`, `plot_learning_curve`, `plot_trajectory` and `animate`
take any agent of this package, and `plot_tour` a tour of a travelling salesman. They
draw on axes of the caller or make a figure of their own, leave pyplot and the global
settings of Matplotlib alone, and never open a window.
The functions named `draw_...` make the figures of the experiments.
"""

from __future__ import annotations

from types import ModuleType

from matplotlib.figure import Figure

from acl_gym.envs.grid_search.system import GridSearch
from acl_gym.envs.navigation.system import Navigation
from acl_gym.envs.pendulum.system import Pendulum
from acl_gym.plotting import grid_search, navigation, pendulum
from acl_gym.plotting.animation import animate
from acl_gym.plotting.learning import draw_learning_curves, plot_learning_curve
from acl_gym.plotting.maps import plot_pheromone, plot_policy
from acl_gym.plotting.shown import Shown
from acl_gym.plotting.tours import plot_tour
from acl_gym.plotting.trajectories import plot_trajectory

__all__ = [
    "Shown",
    "animate",
    "draw_learning_curves",
    "draw_policies",
    "draw_trajectories",
    "plot_learning_curve",
    "plot_pheromone",
    "plot_policy",
    "plot_tour",
    "plot_trajectory",
]

_SYSTEMS: dict[type, ModuleType] = {
    Pendulum: pendulum,
    Navigation: navigation,
    GridSearch: grid_search,
}


def draw_policies(shown: list[Shown], *, paths: bool = False) -> Figure:
    """Draw policies of one system over its states, a panel for each.

    Args:
        shown: the policies.
        paths: on the plane of the navigation, whether a panel beside each shows where
            its vehicles go.

    Raises:
        TypeError: this system has no picture.
    """
    figure: Figure = _module(shown).policies(shown, paths=paths)
    return figure


def draw_trajectories(shown: list[Shown]) -> Figure:
    """Draw what policies do from states at rest.

    Args:
        shown: policies of the pendulum, or of the navigation.

    Raises:
        TypeError: this system has no such picture.
    """
    module = _module(shown)
    if not hasattr(module, "trajectories"):
        raise TypeError("trajectories are drawn of the pendulum and the navigation.")
    figure: Figure = module.trajectories(shown)
    return figure


def _module(shown: list[Shown]) -> ModuleType:
    system = shown[0].env.system
    for kind, module in _SYSTEMS.items():
        if isinstance(system, kind):
            return module
    raise TypeError(
        "policies are drawn of the pendulum, the navigation and the grids, got "
        f"{type(system).__name__}."
    )
