"""How a policy does over the range in which parameters of a plant are known to lie."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv

from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.control.system import ControlSystem
from acl_gym.envs.plant.system import Plant
from acl_gym.envs.plant.uncertain import PlantParameters
from acl_gym.evaluation.policy_cost import PolicyCost, evaluate_policy_cost
from acl_gym.evaluation.predictions import require_predictor
from acl_gym.evaluation.slots import control_env, rows_of_states
from acl_gym.utils import validation
from acl_gym.utils.text import digits
from acl_gym.utils.typing import FloatArray, Predictor

_SLOTS = 20_000  # that are run at once


@dataclass(frozen=True)
class Robustness:
    """What a policy costs in each of some plants.

    Attributes:
        nominal: in the nominal plant, from each initial state.
        worst: in the plant in which the mean over the initial states is highest, which
            may be the nominal one.
        worst_parameters: of that plant, by name.
        costs: the mean in each of the plants that were drawn, `(draws,)`.
        success_rates: the fraction of episodes there that reached the goal, `(draws,)`.
        parameters: of these plants, `(draws, n)`, a column for each name of
            `worst_parameters`, in the same order.
    """

    nominal: PolicyCost
    worst: PolicyCost
    worst_parameters: dict[str, float]
    costs: FloatArray
    success_rates: FloatArray
    parameters: FloatArray

    def __repr__(self) -> str:
        """Nominal and worst cost, and where the worst is."""
        at = ", ".join(f"{n}={digits(v)}" for n, v in self.worst_parameters.items())
        return (
            f"Robustness(nominal={digits(self.nominal.cost)}, "
            f"worst={digits(self.worst.cost)} at {at}, lowest_success_rate="
            f"{self.success_rates.min():.0%}, {len(self.costs)} plants)"
        )


def evaluate_over_range(
    model: Predictor,
    env: VectorEnv[Any, Any, Any],
    *,
    draws: int = 20,
    seed: int = 0,
    uncertain: Mapping[str, tuple[float, float]] | None = None,
    states: FloatArray | None = None,
    max_steps: int | None = None,
) -> Robustness:
    """Evaluate a policy in the nominal plant and in others over the uncertain range.

    The others are all corners of the range, all parameters being lowest or highest, and
    beyond that plants drawn uniformly. Where `draws` is less than the number of corners,
    half of the plants are corners drawn at random.

    Args:
        model: see `evaluate_policy_cost`.
        env: a vector environment of this package. One that is wrapped must have a slot
            for each initial state, see `evaluate_policy_cost`, and cannot be given
            `uncertain`.
        draws: plants beside the nominal one, >= 1.
        seed: of the draws, >= 0.
        uncertain: for each parameter its range (low, high), such as
            `{"mass": (0.08, 0.12)}`; of any environment of this package, the parameters
            of its system. None takes those of a plant that was made with them.
        states: initial states `(n, ...)`; None takes `evaluation_states()`.
        max_steps: T, see `evaluate_policy_cost`.

    Returns:
        Costs in all plants; the same for the same seed.

    Raises:
        TypeError: `model` has no `predict`, `env` is of another package, or a parameter
            does not exist.
        ValueError: nothing is uncertain, a range is empty, or an argument is out of range.
    """
    require_predictor(model)
    base = control_env(env)
    count = validation.integer("draws", draws, at_least=1)
    rng = np.random.default_rng(validation.integer("seed", seed, at_least=0))
    known = _uncertain_of(base.system, uncertain)
    rows = _plants(known, count, rng)
    if states is None:
        states = base.system.evaluation_states()
    starts = _without_parameters(base.system, rows_of_states(states))
    if uncertain is not None:
        if env is not base:
            raise ValueError(
                "uncertain can be given with an env that is not wrapped, got "
                f"{type(env).__name__}; give the ranges to acl_gym.plant instead."
            )
        results = _one_by_one(model, base, starts, known, rows, max_steps)
    else:
        results = _in_slots(model, env, starts, rows, max_steps)
    nominal = evaluate_policy_cost(model, env, starts, max_steps=max_steps, seed=0)
    costs = np.array([each.cost for each in results])
    at = int(np.argmax(costs))
    worst, where = results[at], rows[at].tolist()
    if nominal.cost > worst.cost:
        worst = nominal
        where = [base.system.parameter(name) for name in known.uncertain]
    return Robustness(
        nominal,
        worst,
        dict(zip(known.uncertain, where, strict=True)),
        costs,
        np.array([each.success_rate for each in results]),
        rows,
    )


def _uncertain_of(system: ControlSystem, uncertain: Any) -> PlantParameters:
    """What is uncertain.

    Raises:
        ValueError: nothing is, or a range is empty.
        TypeError: the system has no such parameter.
    """
    if uncertain is None:
        known = system.parameters if isinstance(system, Plant) else PlantParameters()
    else:
        known = PlantParameters(None, uncertain)
        for name in known.names:
            system.parameter(name)  # which must exist
    if not known.count:
        raise ValueError(
            f"env must have uncertain parameters, got {type(system).__name__} without "
            "any; pass uncertain={name: (low, high)}, here or to acl_gym.plant."
        )
    return known


def _without_parameters(system: ControlSystem, states: FloatArray) -> FloatArray:
    """Initial states without the uncertain parameters that those of a plant may hold."""
    if not isinstance(system, Plant):
        return states
    rows = states[:, None] if states.ndim == 1 else states
    return rows[:, : system.low.size]


def _plants(known: PlantParameters, count: int, rng: np.random.Generator) -> FloatArray:
    """Parameters of corners of the range and of plants anywhere in it, `(count, m)`."""
    m = known.count
    if m < 63 and 2**m <= count:
        upper = np.array(list(itertools.product((False, True), repeat=m)))
    else:
        upper = rng.integers(2, size=(count // 2, m)).astype(np.bool_)
    corners = np.where(upper, known.high, known.low)
    return np.concatenate([corners, known.draw(rng, count - len(corners)).T])


def _one_by_one(
    model: Predictor,
    env: ControlVectorEnv,
    states: FloatArray,
    known: PlantParameters,
    rows: FloatArray,
    max_steps: int | None,
) -> list[PolicyCost]:
    """The results in environments with these parameters."""
    results = []
    for row in rows.tolist():
        values = dict(zip(known.uncertain, row, strict=True))
        changed = env.with_parameters(**values)
        results.append(
            evaluate_policy_cost(model, changed, states, max_steps=max_steps, seed=0)
        )
    return results


def _in_slots(
    model: Predictor,
    env: VectorEnv[Any, Any, Any],
    states: FloatArray,
    rows: FloatArray,
    max_steps: int | None,
) -> list[PolicyCost]:
    """The results in plants whose states hold their parameters, many at a time."""
    count = len(states)
    at_once = max(1, _SLOTS // count) if env is env.unwrapped else 1
    results = []
    for first in range(0, len(rows), at_once):
        some = rows[first : first + at_once]
        own = np.repeat(some, count, axis=0)
        starts = np.concatenate([np.tile(states, (len(some), 1)), own], axis=1)
        found = evaluate_policy_cost(model, env, starts, max_steps=max_steps, seed=0)
        for i in range(len(some)):
            each = slice(i * count, (i + 1) * count)
            success = None if found.success is None else found.success[each]
            results.append(
                PolicyCost(
                    found.costs[each], success, found.lengths[each], found.returns[each]
                )
            )
    return results
