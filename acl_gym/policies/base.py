"""What every policy over a partition offers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acl_gym.export import Source, write_c_header, write_numpy_file
from acl_gym.partitions import Partition, checked_partition, locate_all
from acl_gym.utils import validation
from acl_gym.utils.parameters import Fixed
from acl_gym.utils.text import short
from acl_gym.utils.typing import BoolArray, CellArray, FloatArray, IntArray


class Action(np.ndarray[tuple[()], np.dtype[np.int64]]):
    """One action: an array without axes, as Stable-Baselines3 gives it, with a hash.

    The environments of `gymnasium.envs.toy_text` look actions up in a dict, where a
    plain array without axes is refused. What is calculated with it is plain again.
    """

    def __hash__(self) -> int:  # type: ignore[override]
        """That of the number, to which it is equal."""
        return hash(self.item())

    def __array_wrap__(
        self, array: Any, context: Any = None, return_scalar: bool = False
    ) -> Any:
        """The result of a calculation, a number where it has no axes."""
        return array[()]


class PartitionPolicy(Fixed, ABC):
    """A policy that sees cells and degrees, with Stable-Baselines3's `predict`.

    Attributes:
        partition: turns observations into cells and degrees.
        first_action: the action that column 0 of a table stands for,
            `Discrete.start`.
    """

    partition: Partition
    first_action: int

    def __repr__(self) -> str:
        """Partition and number of actions."""
        name = type(self).__name__
        return f"{name}({short(repr(self.partition))}, {self.n_actions} actions)"

    @property
    @abstractmethod
    def n_actions(self) -> int:
        """The number of actions, the columns of the table."""

    @property
    @abstractmethod
    def _n_cells(self) -> int:
        """The rows of the table, to which cells are held."""

    @staticmethod
    def _check_fits(name: str, table: FloatArray, partition: Partition) -> None:
        """Refuse a table that has not one row per cell: kernels do not check indices.

        Raises:
            TypeError: the partition is none.
            ValueError: the table does not fit the partition.
        """
        checked_partition(partition)
        if table.ndim != 2 or len(table) != partition.n_cells or not table.size:
            raise ValueError(
                f"{name} must have shape ({partition.n_cells}, n_actions), a row for "
                f"each cell of the partition, got shape {table.shape}."
            )

    @abstractmethod
    def _act(
        self,
        index: CellArray,
        degree: FloatArray,
        deterministic: bool,
        allowed: BoolArray | None,
    ) -> IntArray:
        """Choose columns of the table, `(n,)`, for cells and degrees `(n, k)`."""

    def _act_in_state(
        self, state: Any, episode_start: Any, *situation: Any
    ) -> tuple[IntArray, Any]:
        """Choose by `_act(*situation)`; return the next state with the columns."""
        return self._act(*situation), state

    def predict(
        self,
        observation: ArrayLike,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
        action_masks: ArrayLike | None = None,
    ) -> tuple[NDArray[np.int64], Any]:
        """Choose actions, as in Stable-Baselines3 but for the default of `deterministic`.

        There it is False, since its agents learn policies that draw their actions. Here
        the policy is a function of the observation, and random actions belong to
        learning; who asks for an action gets that of the policy.

        Args:
            observation: one observation or a batch of them, an array or lists, of any
                real dtype.
            state: returned as it is, except by a `SoftPolicy`; a table has no memory.
            episode_start: only used by a `SoftPolicy`.
            deterministic: True follows the policy; False makes an agent explore as it
                does in learning. A policy that is not an agent does not explore and
                follows itself in both cases.
            action_masks: which actions may be chosen, `(n_actions,)` or
                `(n, n_actions)`, such as `info["action_mask"]`; None: all.

        Returns:
            `(actions, state)`, the actions as an int64 array `(n,)`, for a single
            observation `()`, ready for `env.step`.

        Raises:
            ValueError: an observation is not finite or has the wrong shape, or a mask
                has the wrong shape or allows nothing.
        """
        index, degree, single = self.located(observation)
        allowed = self._checked_masks(action_masks, len(index))
        columns, state = self._act_in_state(
            state, episode_start, index, degree, deterministic, allowed
        )
        actions = columns + self.first_action
        return (actions.reshape(()).view(Action) if single else actions), state

    def located(self, observation: ArrayLike) -> tuple[CellArray, FloatArray, bool]:
        """The cells of observations, their degrees, and whether it is a single one.

        Args:
            observation: one observation or a batch of them.

        Returns:
            `(index, degree, single)`, the first two `(n, k)`.

        Raises:
            ValueError: an observation is not finite or has the wrong shape.
        """
        batch = validation.as_array(observation)
        if batch is None or batch.dtype == object:
            raise ValueError(
                "observation must be an array of numbers, got "
                f"{validation.shown(observation)}; pass one observation or a batch."
            )
        single = batch.ndim == self.partition.state_ndim
        if single:
            batch = batch[None]
        index, degree = locate_all(self.partition, batch, self._n_cells)
        return index, degree, single

    def to_numpy(self, path: str | Path) -> Path:
        """Write the greedy policy to a file for NumPy, without this package.

        These lines evaluate it; they give what `predict` gives for every finite
        observation within the range of a discrete one:

        ```python
        import numpy as np

        p = dict(np.load("policy.npz"))
        lines = [p[f"centres_{axis}"] for axis in range(p["periods"].size)]
        axes = list(zip(p["columns"], p["sines"], lines, p["periods"]))


        def act(observation):
            seen = np.ravel(observation).astype(float)
            corners = [((), 1.0)]  # the cells around the observation, and their degrees
            for column, sine, line, period in axes:
                x = np.arctan2(seen[sine], seen[column]) if sine >= 0 else seen[column]
                x = x - period * np.floor((x - line[0]) / period) if period else x
                low = np.searchsorted(line[1:-1], x, "right")
                up = np.clip((x - line[low]) / (line[low + 1] - line[low]), 0, 1)
                up = up if p["fuzzy"] else float(up >= 0.5)
                sides = [(low, 1 - up), (low + 1, up)]
                corners = [((*c, s), d * w) for c, d in corners for s, w in sides if w]
            values = sum(d * p["table"][c] for c, d in corners)
            ranks = p["ranks"][max(corners, key=lambda corner: corner[1])[0]]
            return int(p["first_action"] + np.lexsort((ranks, -values))[0])
        ```

        The arrays are described in `acl_gym.export.numpy_file.numpy_arrays`; where
        they are known, `inputs` and `input_values` say what each action sets. Action
        masks are not known, as in `to_c`.

        Args:
            path: the file; `.npz` is added where it is missing.

        Returns:
            The path written, atomically.

        Raises:
            TypeError: the policy draws its actions, or locates states by a method of
                its own.
            ValueError: the table holds numbers that are not finite.
            FileNotFoundError: the folder of the file does not exist.
            IsADirectoryError: the path is a folder.
        """
        return write_numpy_file(path, self._source())

    def to_c(
        self,
        path: str | Path,
        *,
        name: str = "policy",
        precision: str = "float",
        inputs: ArrayLike | None = None,
    ) -> Path:
        """Write the greedy policy as one C99 header, also for C++.

        `name_action(x)` returns the action for the observation `x`. It allocates
        nothing, needs no library (`cc -std=c99 -O2 main.c -o main`, without `-lm`, which
        only atan2 needs, for observations that show an angle as cosine and sine), and
        keeps its tables in read-only memory: a byte for each cell of a crisp or discrete
        policy, n_actions numbers and a byte or two for each cell of a fuzzy one. The
        comment at the head of the file states the units, the memory, the work of a call
        and how to call it. On a desktop processor a call takes about 0.1 us, less than a
        hundredth of `predict` for one observation (`benchmarks/policy_export.py`).
        Where it is known, the table `name_inputs` holds the input values that each
        action stands for.

        With "double" the actions are those of `predict` to the bit, unless atan2 of the C
        library differs from NumPy's in the last place, at a border between two actions.
        With "float", half the memory, they differ only where rounding to a float, one
        part in 10^7, moves an observation across such a border. An observation that
        `predict` refuses (NaN, infinite, out of the range of a discrete variable) gives
        `name_INVALID`. The program knows no action masks: where an environment does not
        allow every action, it may choose one that is not allowed, which `predict` with
        `action_masks` never does.

        Args:
            path: the file; `.h` is added to a name without an ending.
            name: what all names in the file begin with, a C identifier; two headers
                of one program need different ones.
            precision: "float" or "double", of observations and tables.
            inputs: what each action sets, `(n_actions,)` or `(n_actions, n_inputs)`,
                in place of what the environment knows.

        Returns:
            The path written, atomically; the same policy gives the same bytes.

        Raises:
            TypeError: the policy draws its actions, or locates states by a method of
                its own.
            ValueError: an argument is not valid, the table holds numbers that are not
                finite or do not fit a float, or is too large for a header.
            FileNotFoundError: the folder of the file does not exist.
            IsADirectoryError: the path is a folder.
        """
        source = self._source(inputs)
        return write_c_header(path, source, name, precision)

    def _source(self, inputs: ArrayLike | None = None) -> Source:
        """What is exported; `inputs` as in `to_c`."""
        raise TypeError(
            "only a greedy policy over a table can be exported, got "
            f"{type(self).__name__}, which draws its actions or has rules of its own; "
            "export agent.policy, or TablePolicy(partition, levels)."
        )

    def _checked_masks(self, masks: ArrayLike | None, count: int) -> BoolArray | None:
        if masks is None:
            return None
        given, shape = validation.as_array(masks), (count, self.n_actions)
        if given is not None and given.ndim == 1:
            given = given[None]
        if (
            given is None
            or given.shape != shape
            or given.dtype.kind not in "biuf"
            or not ((given == 0) | (given == 1)).all()
            or not (given == 1).any(axis=1).all()
        ):
            raise ValueError(
                f"action_masks must have shape {shape}, hold 0 and 1, and allow an "
                f"action in each row, got {validation.shown(masks)}."
            )
        return np.ascontiguousarray(given == 1)


def checked_first_action(first_action: Any) -> int:
    """`Discrete.start`: any integer to which the actions can be added."""
    least = -(2**62)
    return validation.integer(
        "first_action", first_action, at_least=least, at_most=-least
    )
