"""The policy between the actions of a table: real inputs from levels of a few."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acl_gym.colony.greedy import greedy_actions
from acl_gym.colony.interpolation import interpolated_inputs
from acl_gym.envs.control.signals import Signals
from acl_gym.export import Source, write_c_header, write_numpy_file
from acl_gym.policies.table import TablePolicy
from acl_gym.utils import validation
from acl_gym.utils.input_grid import InputGrid
from acl_gym.utils.parameters import Fixed
from acl_gym.utils.text import short
from acl_gym.utils.typing import CellArray, FloatArray


class InterpolatedPolicy(Fixed):
    """Chooses real inputs between the best action of a table and its neighbours.

    The actions of the table are points of a grid over the inputs. At a state, let v0 be
    the value (4.16) of the best action u0, and v-, v+ those of its neighbours u-, u+
    along one input. The input chosen is the vertex of the parabola through the three,

        u = u0 + (d- h+ / s) h+ / 2 - (d+ h- / s) h- / 2,    s = d- h+ + d+ h-,

    with d = v0 - v and h the distance to the neighbour: the mean of the three inputs,
    weighted by differences of their levels, and exact where values are quadratic in the
    input. It lies no farther from u0 than halfway to a neighbour. It depends on
    differences of values only, so that it holds alike for levels of pheromone, action
    values and expected costs of any sign. Where two neighbours are equally good it lies
    halfway between them, whichever is u0, so that it does not jump where the best action
    changes to a neighbour, but by half a step at an end of the grid.

    Each input is found by itself. Where u0 is at an end of the grid, where all three
    values are the same, or where one is infinite, the input is that of u0.
    docs/continuous-actions.md compares this with other rules, and with more actions.

    Args:
        policy: the greedy policy over the table, which it follows if that changes.
        inputs: of each action, `(n_actions,)` or `(n_actions, n_inputs)`; None takes
            those that the policy knows.

    Attributes:
        greedy: the policy over the table.
        grid: the inputs of the actions.
        dtype: of the inputs that `predict` returns: the one that the environment takes,
            float64 where `inputs` were given.

    Raises:
        TypeError: `policy` is no `TablePolicy`.
        ValueError: the inputs are not known, do not form a grid, or are not one row for
            each action.
    """

    _fixed = ("greedy", "grid", "dtype")

    def __init__(self, policy: TablePolicy, inputs: ArrayLike | None = None) -> None:
        if not isinstance(policy, TablePolicy):
            raise TypeError(
                f"policy must be a TablePolicy, got {validation.shown(policy)}; pass "
                "agent.policy, or call agent.interpolated_policy()."
            )
        signals = policy.signals
        if inputs is not None:
            names = () if signals is None else signals.observations
            signals = Signals.of_inputs(inputs, names)
        elif signals is None:
            raise ValueError(
                "the inputs of the actions must be known to interpolate between them, "
                "got an environment that does not tell; pass inputs=, a row for each "
                f"of the {policy.n_actions} actions, or learn in acl_gym.ActionGrid."
            )
        self.grid = InputGrid(signals.values)
        if len(self.grid.values) != policy.n_actions:
            raise ValueError(
                f"inputs must hold a row for each of the {policy.n_actions} actions, got "
                f"{len(self.grid.values)}."
            )
        self.greedy = policy
        self.dtype = np.dtype(signals.dtype)
        self._signals = signals

    def __repr__(self) -> str:
        """Partition and grid."""
        counts = " x ".join(map(str, self.grid.counts))
        partition = short(repr(self.greedy.partition))
        return f"InterpolatedPolicy({partition}, between {counts} actions)"

    @property
    def signals(self) -> Signals:
        """Names of observations and inputs, and the inputs of each action."""
        return self._signals

    def predict(
        self,
        observation: ArrayLike,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[Any], Any]:
        """Choose inputs, as in Stable-Baselines3 for a Box of actions.

        Args:
            observation: one observation or a batch of them.
            state: returned as it is.
            episode_start: not used.
            deterministic: not used, the policy draws nothing.

        Returns:
            `(inputs, state)`, an array `(n, n_inputs)`, for a single observation
            `(n_inputs,)`, of type `dtype`.

        Raises:
            ValueError: an observation is not finite or has the wrong shape.
        """
        index, degree, single = self.greedy.located(observation)
        inputs = self._inputs(index, degree)
        return (inputs[0] if single else inputs), state

    def to_numpy(self, path: str | Path) -> Path:
        """Write the policy to a file for NumPy, without this package.

        The file is that of `TablePolicy.to_numpy`, with three arrays more: `below` and
        `above`, the actions next to each along each input, -1 where there is none, and
        `input_values`. `acl_gym.export.numpy_file.NUMPY_INPUT_CODE` holds the lines that
        evaluate it, to rounding.

        Args:
            path: the file; `.npz` is added where it is missing.

        Returns:
            The path written, atomically.

        Raises:
            TypeError: the partition locates states by a method of its own.
            ValueError: the table holds numbers that are not finite.
            FileNotFoundError: the folder of the file does not exist.
            IsADirectoryError: the path is a folder.
        """
        return write_numpy_file(path, self._source())

    def to_c(
        self, path: str | Path, *, name: str = "policy", precision: str = "float"
    ) -> Path:
        """Write the policy as one C99 header; see `PartitionPolicy.to_c`.

        `name_input(x, u)` sets the inputs u for the observation x and returns 1; where x
        is not valid, it returns 0 and leaves u alone. `name_action(x)` is there as well,
        the action without interpolation.

        With "double" the inputs are those of `predict` to the bit, with the exceptions
        of `PartitionPolicy.to_c`, before they are rounded to `dtype`. With "float" they
        differ by rounding, which is much where levels of neighbouring actions differ by
        little: then by at most half the distance to a neighbour.

        Args:
            path: the file; `.h` is added to a name without an ending.
            name: what all names in the file begin with, a C identifier.
            precision: "float" or "double", of observations, tables and inputs.

        Returns:
            The path written, atomically; the same policy gives the same bytes.

        Raises:
            TypeError: the partition locates states by a method of its own.
            ValueError: an argument is not valid, the table holds numbers that are not
                finite or do not fit a float, or is too large for a header.
            FileNotFoundError: the folder of the file does not exist.
            IsADirectoryError: the path is a folder.
        """
        return write_c_header(path, self._source(), name, precision)

    def _source(self) -> Source:
        return self.greedy._source().between(self.grid, self._signals)

    def copy(self) -> InterpolatedPolicy:
        """The same policy over a table that no longer changes."""
        copied = object.__new__(type(self))
        copied.__dict__.update({**self.__dict__, "greedy": self.greedy.copy()})
        return copied

    def _inputs(self, index: CellArray, degree: FloatArray) -> NDArray[Any]:
        """The inputs for cells and degrees `(n, k)`."""
        table, grid = self.greedy.table, self.grid
        best = greedy_actions(table, self.greedy.ranks, index, degree)
        inputs = interpolated_inputs(table, index, degree, best, grid)
        return inputs.astype(self.dtype, copy=False)
