"""Where a learned model is unsure, as a picture."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from acl_gym.design.pictures import levels_shown, mark_goal, most_divided
from acl_gym.design.recordings import spread_over
from acl_gym.envs.learned.env import LearnedVectorEnv
from acl_gym.plotting import palettes, style
from acl_gym.plotting.names import with_unit
from acl_gym.policies import TablePolicy


def draw_spread(policy: TablePolicy, env: LearnedVectorEnv) -> Figure:
    """Where a learned model is unsure, over two variables, and what was recorded.

    The others are at the goal, or in the middle of their range.
    """
    plant = env.system
    size = plant.low.size
    names = [style.symbol(with_unit(name)) for name in plant.variable_names]
    shown = list(most_divided(policy) if size > 1 else (0,))
    fixed = [levels_shown(plant, axis, few=False)[0] for axis in range(size)]
    lines = [np.linspace(plant.low[axis], plant.high[axis], 61) for axis in shown]
    mesh = np.meshgrid(*lines)
    states = np.tile(np.array(fixed), (mesh[0].size, 1))
    for axis, values in zip(shown, mesh, strict=True):
        states[:, axis] = values.ravel()
    # The end of a circle is its beginning.
    spread = spread_over(env, np.clip(states, plant.low, plant.high))
    seen = plant.variables(env.transitions.states)
    with style.in_style():
        figure = style.new_figure(3.6, 5.6)
        ax = figure.subplots()
        if size == 1:
            ax.plot(lines[0], spread, color=style.BLUE)
            ax.plot(seen[:, 0], np.zeros(len(seen)), "|", color="0.2")
            ax.set_ylabel("spread")
        else:
            image = ax.pcolormesh(
                *lines, spread.reshape(mesh[0].shape), cmap="Purples", vmin=0.0,
                vmax=max(1.0, float(spread.max())), shading="nearest", rasterized=True,
            )  # fmt: skip
            palettes.add_level_bar(ax, image, "spread")
            ax.plot(*seen[:, shown].T, ".", color=style.ORANGE, markersize=2.5)
            ax.set_ylabel(names[shown[1]])
            mark_goal(ax, plant, tuple(shown))
            ax.grid(visible=False)
        ax.set_xlim(plant.low[shown[0]], plant.high[shown[0]])
        ax.set_xlabel(names[shown[0]])
    return figure
