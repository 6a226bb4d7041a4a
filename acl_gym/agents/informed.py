"""What agents that remember may be told beforehand (§7.3): a heuristic, and first levels."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray

from acl_gym.agents.remembering import RememberingAgent
from acl_gym.colony.guided import shares_of
from acl_gym.colony.heuristic import (
    Heuristic,
    checked_heuristic,
    checked_initial,
)
from acl_gym.colony.schedules import schedule_from_settings
from acl_gym.partitions import Grid, Partition
from acl_gym.partitions.growing import carried_over
from acl_gym.utils.parameters import Parameter
from acl_gym.utils.serialization import Missing, from_settings, to_settings
from acl_gym.utils.typing import FloatArray


@dataclass(frozen=True, eq=False)
class Told:
    """What is known beforehand of each pair, on a partition that may grow.

    Attributes:
        source: the function of environment and partition to ask when the partition has
            grown, or what stands in for it in an agent read from a file; None where an
            array was given, which is then interpolated.
        check: makes an array of what was given, for a shape, or refuses it.
        values: `(n_cells, n_actions)`, not to be written to; None as long as there is no
            environment to ask the function about.
    """

    source: Callable[[Any, Partition], Any] | None
    check: Callable[[Any, tuple[int, ...]], FloatArray]
    values: FloatArray | None = None

    def asked(self, env: Any, partition: Partition, n_actions: int) -> Self:
        """Ask the function again, if there are one and an environment.

        Raises:
            ValueError: what it returns is refused.
        """
        if self.source is None or env is None or isinstance(self.source, Missing):
            return self
        shape = partition.n_cells, n_actions
        return replace(self, values=self.check(self.source(env, partition), shape))

    def grown(self, env: Any, old: Partition, new: Partition) -> Self:
        """What is known of the cells of a partition that has grown out of another."""
        values = np.asarray(self.values)
        if self.source is not None:
            return self.asked(env, new, values.shape[1])
        carried = carried_over(values, old, new)
        return replace(self, values=self.check(carried, carried.shape))


_CHECKS: dict[str, Callable[[Any, tuple[int, ...]], FloatArray]] = {
    "heuristic": checked_heuristic,
    "initial": checked_initial,
}


class InformedAgent(RememberingAgent):
    """An agent that remembers, and to which something can be told beforehand.

    A function that was told is asked again whenever the partition has grown; an array is
    interpolated. A file holds both as arrays, and of a function also the name: to go on
    learning on a partition that grows it is to be given again.

    Args:
        env: see `RememberingAgent`.
        partition: see `RememberingAgent`.
        heuristic: eta, >= 0 and positive somewhere in each row, `(n_cells, n_actions)`,
            or a function of environment and partition; None: nothing is known.
        initial: what pairs promise that were never tried, likewise; None: see
            `RememberingAgent`.
        of_other_bases: what the next base takes.
    """

    beta: Parameter
    """Exponent of the heuristic."""

    _given_again: ClassVar[tuple[str, ...]] = ("heuristic", "initial")

    def __init__(
        self,
        env: VectorEnv[Any, Any, Any] | None,
        partition: Partition | None = None,
        *,
        heuristic: Heuristic | None,
        initial: Heuristic | None,
        **of_other_bases: Any,
    ) -> None:
        self._priors: dict[str, Told] = {}
        self._shares: FloatArray | None = None
        self._shares_from: tuple[FloatArray, float] | None = None
        super().__init__(env, partition, **of_other_bases)
        self.heuristic, self.initial = heuristic, initial

    @property
    def heuristic(self) -> FloatArray | None:
        """The heuristic eta, `(n_cells, n_actions)`; None: nothing is known."""
        return self._values("heuristic")

    @heuristic.setter
    def heuristic(self, value: Heuristic | None) -> None:
        self._tell("heuristic", value)

    @property
    def initial(self) -> FloatArray | None:
        """What pairs promise that were never tried, `(n_cells, n_actions)`, or None."""
        return self._values("initial")

    @initial.setter
    def initial(self, value: Heuristic | None) -> None:
        self._tell("initial", value)

    def _values(self, name: str) -> FloatArray | None:
        prior = self._priors.get(name)
        return None if prior is None else prior.values

    def _tell(self, name: str, given: Heuristic | None) -> None:
        """Take over what is told; it has an effect from the next walk on."""
        check = _CHECKS[name]
        if given is None:
            self._priors.pop(name, None)
        elif callable(given):
            prior = Told(given, check)
            self._priors[name] = prior.asked(self.env, self.partition, self.n_actions)
        else:
            shape = self.partition.n_cells, self.n_actions
            self._priors[name] = Told(None, check, check(given, shape))

    def set_env(self, env: VectorEnv[Any, Any, Any]) -> None:
        """See `TabularAgent.set_env`; functions that were not asked yet are asked."""
        super().set_env(env)
        for name, prior in self._priors.items():
            if prior.values is None:
                self._priors[name] = prior.asked(env, self.partition, self.n_actions)

    def require_all_given(self) -> None:
        """See `SavedAgent.require_all_given`; a partition that grows needs functions."""
        super().require_all_given()
        for prior in self._priors.values():
            if self.grows and isinstance(prior.source, Missing):
                raise prior.source.error()

    def _proposals(self) -> FloatArray | None:
        """With which probability each cell proposes each action now, or None."""
        eta = self.heuristic
        if eta is None:
            return None
        beta, made_from = type(self).beta.at(self, self.trials), self._shares_from
        if made_from is None or made_from[0] is not eta or made_from[1] != beta:
            self._shares, self._shares_from = shares_of(eta, beta), (eta, beta)
        return self._shares

    def _promise(self, optimism: float) -> None:
        initial = self.initial
        if initial is None:
            super()._promise(optimism)
        else:
            np.copyto(self._table, initial, where=~self._known)

    def _grow_to(self, partition: Grid | None) -> None:
        if partition is not None and self._priors:
            old, env = self.partition, self.env
            # First: a function of a user's own may raise anything.
            grown = {n: p.grown(env, old, partition) for n, p in self._priors.items()}
            super()._grow_to(partition)
            self._priors = grown
        else:
            super()._grow_to(partition)

    def parameters(self) -> dict[str, Any]:
        """The keyword arguments that are declared here; of functions only the names."""
        sources = {name: prior.source for name, prior in self._priors.items()}
        return {
            "beta": to_settings(self.beta),
            **{name: to_settings(sources.get(name)) for name in _CHECKS},
        }

    @classmethod
    def _restored_parameters(cls, saved: dict[str, Any]) -> dict[str, Any]:
        restored = super()._restored_parameters(saved)
        if "beta" in saved:  # older files have none of these
            restored["beta"] = schedule_from_settings("beta", saved["beta"])
        for name in _CHECKS:
            restored[name] = from_settings(name, saved.get(name), ())
        return restored

    def _arrays(self) -> dict[str, NDArray[Any]]:
        known = {n: p.values for n, p in self._priors.items() if p.values is not None}
        return {**super()._arrays(), **known}

    def _restore(
        self, header: dict[str, Any], arrays: Mapping[str, NDArray[Any]]
    ) -> None:
        super()._restore(header, arrays)
        for name, check in _CHECKS.items():
            prior = self._priors.get(name)
            if prior is not None and prior.values is not None:
                continue  # an array was given in place of that in the file
            if name in arrays:
                values = check(arrays[name], self._table.shape)
                self._priors[name] = replace(prior or Told(None, check), values=values)
            elif prior is not None and isinstance(prior.source, Missing):
                raise ValueError(f"the array {name} is missing")

    def _state(self) -> Any:
        return super()._state(), dict(self._priors)

    def _take_over(self, table: FloatArray, state: Any) -> None:
        remembered, priors = state
        super()._take_over(table, remembered)
        self._priors = dict(priors)
