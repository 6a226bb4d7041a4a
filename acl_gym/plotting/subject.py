"""What a picture is of: a policy, its table, and the names of states and actions."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from acl_gym.agents.base import TabularAgent
from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.control.lookup import (
    actions_are_replaced,
    signals_of,
    system_of,
)
from acl_gym.envs.control.signals import Signals
from acl_gym.envs.control.system import ControlSystem
from acl_gym.envs.grid_search.system import GridSearch
from acl_gym.evaluation.predictions import checked_actions
from acl_gym.partitions import Discrete, Grid, Partition
from acl_gym.plotting import pieces
from acl_gym.plotting.names import Labels, action_names, variable_names, with_unit
from acl_gym.plotting.style import GREEK
from acl_gym.policies import (
    InterpolatedPolicy,
    PartitionPolicy,
    SoftPolicy,
    TablePolicy,
)
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray, IntArray

_BATCH = 20_000
"""States that are looked up at once: a fuzzy one has 2^d degrees."""


@dataclass(frozen=True)
class Variable:
    """A state variable.

    Attributes:
        name: with its unit: "omega (rad/s)".
        low: where it begins.
        high: where it ends, > low.
        edges: what it is divided by into pieces within which a policy is looked up
            once, increasing, from `low` to `high`.
        period: of a circular one, else None.
    """

    name: str
    low: float
    high: float
    edges: FloatArray
    period: float | None = None

    @property
    def unit(self) -> str:
        """What stands in brackets at the end of the name."""
        found = re.search(r"\(([^()]*)\)$", self.name)
        return found.group(1) if found else ""

    @property
    def short(self) -> str:
        """The name without its unit."""
        return re.sub(r"\s*\([^()]*\)$", "", self.name)

    @property
    def symbol(self) -> str:
        """The last word of the name where that is a symbol: "omega", "c1"."""
        last = self.short.split(" ")[-1]
        return last if last in GREEK or re.fullmatch(r"[a-z]\d?", last) else self.short

    def called(self) -> tuple[str, ...]:
        """What it may be called: the name with and without its unit, and the symbol."""
        return self.name, self.short, self.symbol

    def name_in_short(self) -> str:
        """The symbol with its unit: "omega (rad/s)"."""
        return f"{self.symbol} ({self.unit})" if self.unit else self.symbol

    def middle(self) -> float:
        """The middle of the range."""
        return 0.5 * (self.low + self.high)


@dataclass(frozen=True)
class Subject:
    """A policy with all that is known for a picture of it.

    Attributes:
        policy: chooses actions.
        partition: None of a policy that has none.
        table: levels or action values, `(n_cells, n_actions)`, or None.
        env: the environment, or None.
        system: that of an environment of this package, or None.
        inputs: the physical input of each action, `(n_actions, m)`, or None.
        input_names: of the columns of `inputs`.
        variables: the state variables; of numbered states none. An angle that is
            observed as cosine and sine is one.
        n_states: how many numbered states there are, or 0.
        first_state: the number of the first of them.
        n_actions: how many actions there are.
        first_action: the number of the first of them.
        actions: their names.
        title: what the agent is called; empty if it is a mere policy.
    """

    policy: Any
    partition: Partition | None
    table: FloatArray | None
    env: Any
    system: ControlSystem | None
    inputs: FloatArray | None
    input_names: tuple[str, ...]
    variables: tuple[Variable, ...]
    n_states: int
    first_state: int
    n_actions: int
    first_action: int
    actions: tuple[str, ...]
    title: str

    def heading(self, kind: str) -> str:
        """The title of a picture of some kind."""
        return ", ".join(filter(None, [kind.capitalize(), self.title]))

    def observations(self, values: FloatArray) -> NDArray[Any]:
        """What is observed where the variables have these values, `(n, variables)`."""
        if isinstance(self.partition, Grid):
            return self.partition.observations(values)
        if isinstance(self.partition, Discrete):
            whole = np.rint(values).astype(np.int64)
            return whole.reshape(-1, *self.partition.sizes.shape)
        return values

    def values(self, observations: FloatArray) -> FloatArray:
        """The values of the variables in some observations, each `(n, d)`.

        These may be states of a plant, with parameters after what is observed.
        """
        if self.system is not None and not self.system.fully_observed:
            space = self.system.observation_space
            if isinstance(space, spaces.Box):
                observations = observations[:, : space.shape[0]]
        if not isinstance(self.partition, Grid):
            return observations
        values: FloatArray = self.partition.variables(observations)
        if self.partition.angles:
            # From -pi to pi, while the axis of a picture may begin elsewhere.
            for axis, variable in enumerate(self.variables):
                if variable.period is not None:
                    low = variable.low
                    values[:, axis] = low + (values[:, axis] - low) % variable.period
        return values

    def columns(self, states: NDArray[Any]) -> IntArray:
        """The action of the policy for some observations, counted from 0, `(n,)`.

        Raises:
            ValueError: what it returns are no actions, one for each.
        """
        chosen = [
            checked_actions(
                self.policy.predict(part, deterministic=True),
                np.arange(len(part)),
                self.first_action,
                self.n_actions,
            )
            for part in _batches(states)
        ]
        return np.concatenate(chosen) - self.first_action

    def levels(self, states: NDArray[Any]) -> FloatArray:
        """The entries of the table, weighed with the degrees, `(n, n_actions)`."""
        if self.partition is None or self.table is None:
            raise TypeError(
                "agent must have a partition and a table, such as ACL, QLearning or a "
                f"TablePolicy, got {type(self.policy).__name__}; only plot_policy and "
                "plot_trajectory draw other policies."
            )
        table, partition = self.table, self.partition
        values = []
        for part in _batches(states):
            index, degree = partition(part)
            values.append(np.einsum("nk,nku->nu", degree, table[index]))
        return np.concatenate(values)

    def vector_env(self) -> ControlVectorEnv | None:
        """The native vector environment of this package, unwrapped, or None.

        It is None also where a wrapper replaces actions, so that policies are run in it.
        """
        base = None if self.env is None else self.env.unwrapped
        same = (
            isinstance(base, ControlVectorEnv)
            and self.system is not None
            and not actions_are_replaced(self.env)
        )
        return base if same else None


def subject_of(
    agent: Any,
    env: Any = None,
    labels: Labels = None,
    actions: Sequence[str] | None = None,
) -> Subject:
    """Find out what is known of a policy.

    Args:
        agent: an agent or a policy with a partition; or any model with `predict`, such
            as one of Stable-Baselines3, if `env` is given.
        env: an environment that gives names and bounds, single or vector; None takes
            that of the agent, if it has one.
        labels: names of the state variables, with their units in brackets at the end;
            None takes those of a system of this package, or "state 1", "state 2", ...,
            and "angle 1 (rad)" where state 1 is its cosine.
        actions: names of all actions; None takes those of the system, or
            "action 0", "action 1", ...

    Raises:
        TypeError: `agent` is no agent and no policy.
        ValueError: names do not fit, or states cannot be drawn.
    """
    policy, partition, table = _policy_of(agent, env)
    env = getattr(agent, "env", None) if env is None else env
    space = _space(env, "observation_space")
    if partition is not None and space is not None:
        partition.check_space(space)
    system = None if env is None else system_of(env)
    if system is not None and system.observation_space != space:
        system = None  # a wrapper has changed what is observed
    first, count = _actions(policy, env)
    signals = getattr(policy, "signals", None) if env is None else signals_of(env)
    inputs, input_names = _inputs(signals, system, count)
    names = action_names(actions, system, first, count)
    n_states, first_state = 0, 0
    variables: tuple[Variable, ...] = ()
    if isinstance(space, spaces.Discrete):
        n_states, first_state = int(space.n), int(space.start)
    elif isinstance(partition, Discrete) and partition.state_ndim == 0:
        n_states, first_state = partition.n_cells, int(partition.starts)
    else:
        variables = _variables(partition, space, system, signals, labels)
    known = (policy, partition, table, env, system, inputs, input_names, variables)
    numbers = (n_states, first_state, count, first)
    return Subject(*known, *numbers, names, _title(agent))


def _title(agent: Any) -> str:
    name = type(agent).__name__
    if not isinstance(agent, TabularAgent):
        return "" if isinstance(agent, PartitionPolicy) else name
    unit = "trial" if agent.trials == 1 else "trials"
    return f"{name} after {agent.trials:,} {unit}"


def _policy_of(agent: Any, env: Any) -> tuple[Any, Partition | None, FloatArray | None]:
    if isinstance(agent, TabularAgent):
        return agent.policy, agent.partition, agent.table
    if isinstance(agent, SoftPolicy):
        table = agent.table
        greedy = TablePolicy(agent.partition, table, first_action=agent.first_action)
        return greedy, agent.partition, table
    if isinstance(agent, PartitionPolicy):
        return agent, agent.partition, getattr(agent, "table", None)
    if isinstance(agent, InterpolatedPolicy):
        raise TypeError(
            "agent must choose among actions here, got an InterpolatedPolicy, which only "
            "plot_policy draws; pass policy.greedy, the policy over its table."
        )
    predicts = callable(getattr(agent, "predict", None))
    if isinstance(agent, type) or not predicts:
        raise TypeError(
            "agent must be an agent or a policy, such as ACL, QLearning or "
            f"agent.policy, got {validation.shown(agent)}."
        )
    if _space(env, "observation_space") is None:
        raise TypeError(
            f"agent must have a partition if env is not given, got "
            f"{type(agent).__name__}; pass env=, whose states are then drawn."
        )
    return agent, None, None


def _space(env: Any, name: str) -> Any:
    """A space of one slot."""
    if env is None:
        return None
    space = getattr(env, f"single_{name}", None) or getattr(env, name, None)
    if not isinstance(space, spaces.Space):
        raise TypeError(
            "env must be a Gymnasium environment, single or vector, got "
            f"{validation.shown(env)}; make one with gym.make(id) or gym.make_vec(id, "
            "num_envs=n)."
        )
    return space


def _actions(policy: Any, env: Any) -> tuple[int, int]:
    """The number of the first action, and how many there are."""
    if isinstance(policy, PartitionPolicy):
        return policy.first_action, policy.n_actions
    space = _space(env, "action_space")
    if not isinstance(space, spaces.Discrete):
        raise ValueError(
            "env must have Discrete actions to be drawn, got "
            f"{validation.shown(space)}."
        )
    return int(space.start), int(space.n)


def _inputs(
    signals: Signals | None, system: ControlSystem | None, count: int
) -> tuple[FloatArray | None, tuple[str, ...]]:
    """What actions set, where that is more telling than their names."""
    if signals is None or isinstance(system, GridSearch):
        return None, ()
    values = np.array(signals.values)
    if len(values) != count:
        return None, ()
    return values, tuple(map(with_unit, signals.inputs))


def _variables(
    partition: Partition | None,
    space: Any,
    system: ControlSystem | None,
    signals: Signals | None,
    labels: Labels,
) -> tuple[Variable, ...]:
    if isinstance(partition, Grid):
        made = pieces.of_grid(partition, space)
    elif isinstance(partition, Discrete):
        made = [
            pieces.of_integers(int(size), int(start))
            for size, start in zip(
                partition.sizes.ravel(), partition.starts.ravel(), strict=True
            )
        ]
    elif isinstance(space, spaces.Box) and len(space.shape) == 1:
        circular = () if system is None else system.circular
        made = [
            pieces.of_bounds(low, high, axis in circular)
            for axis, (low, high) in enumerate(zip(space.low, space.high, strict=True))
        ]
    else:
        raise ValueError(
            "states must be a number or a row of numbers to be drawn, got "
            f"{space if partition is None else partition!r}."
        )
    angles = partition.angles if isinstance(partition, Grid) else ()
    names = variable_names(labels, signals, len(made), angles)
    return tuple(
        Variable(name, edges[0], edges[-1], edges, period)
        for name, (edges, period) in zip(names, made, strict=True)
    )


def _batches(states: NDArray[Any]) -> list[NDArray[Any]]:
    return [states[i : i + _BATCH] for i in range(0, len(states), _BATCH)]
