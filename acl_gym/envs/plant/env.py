"""Environments from a plant: the function `plant`, single and vector environment."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import TimeLimit

from acl_gym.envs.control.environments import ControlVectorEnv
from acl_gym.envs.control.single import ControlEnv
from acl_gym.envs.plant.system import Plant
from acl_gym.utils import validation
from acl_gym.utils.typing import FloatArray, IntArray

_PAINTER = "acl_gym.envs.plant.painter:PlantPainter"


class PlantEnv(ControlEnv):
    """A single plant, without a time limit; see `plant`."""

    system_type = Plant
    painter = _PAINTER


class PlantVectorEnv(ControlVectorEnv):
    """Many plants, one a slot, advanced together; see `plant`."""

    system_type = Plant
    painter = _PAINTER

    @property
    def system(self) -> Plant:
        """The parameters and dynamics of the plant."""
        found: Any = self._system
        return found  # type: ignore[no-any-return]

    def _checked_states(self, given: Any, slots: IntArray) -> FloatArray:
        array = validation.as_array(given)
        if array is not None and array.ndim == 1 and self.system.low.size == 1:
            given = array[:, None]  # so that parameters can be left out here too
        return super()._checked_states(given, slots)

    def _arguments_with(self, values: dict[str, Any]) -> dict[str, Any]:
        known = self.system.parameters
        for name in values:
            known.value_of(name)  # which must exist
        named = dict(zip(known.names, known.nominal.tolist(), strict=True))
        kept = {n: ends for n, ends in known.uncertain.items() if n not in values}
        named.update(values)
        return {**self.parameters, "parameters": named, "uncertain": kept}


def plant(
    dynamics: Any,
    *,
    low: Any,
    high: Any,
    inputs: Any,
    sampling_time: float,
    goal: Any,
    cost: Any = "time",
    max_episode_steps: int,
    num_envs: int | None = None,
    tolerance: Any = None,
    circular: Iterable[int] = (),
    substeps: int = 1,
    discrete_time: bool = False,
    initial: Any = None,
    evaluation_states: Any = None,
    state_names: Sequence[str] | None = None,
    input_names: Sequence[str] | None = None,
    parameters: Mapping[str, float] | None = None,
    uncertain: Mapping[str, tuple[float, float]] | None = None,
    autoreset_mode: str | AutoresetMode | None = None,
    render_mode: str | None = None,
) -> Any:
    """Make an environment from a plant of your own.

    The plant x' = f(x, u) is integrated by the fourth-order method of Runge and Kutta,
    the input held constant over a sampling time. The environment is of the same kind as
    those of this package: all modes of autoreset, `reset(options={"state": ...})`,
    evaluation from fixed states, perturbations, fuzzy Q-iteration.

    >>> import numpy as np, acl_gym
    >>> def rod(x, u):  # angle from upright, rad; angular velocity, rad/s
    ...     return [x[1], 9.81 * np.sin(x[0]) - 0.5 * x[1] + u[0]]
    >>> env = acl_gym.plant(
    ...     rod,
    ...     low=[-np.pi, -8],
    ...     high=[np.pi, 8],
    ...     circular=[0],
    ...     inputs=[-6, 0, 6],
    ...     sampling_time=0.1,
    ...     goal=[0, 0],
    ...     tolerance=[0.1, 0.3],
    ...     cost=([1, 0.1], 0.01),
    ...     max_episode_steps=100,
    ...     num_envs=200,
    ... )
    >>> env.reset(seed=0)[0].shape
    (200, 2)

    Args:
        dynamics: x' = f(x, u), one of

            - a function of the states x, `(state_size, n)`, and inputs u,
              `(n_inputs, n)`, of n plants: `x[0]` is the first variable of all n. It
              returns a row for each variable, as a list or an array; a row may be a
              number. What is written for one state mostly works for n: NumPy's functions
              in place of those of `math`, and `np.where` in place of `if`;
            - the same function compiled by Numba (`@njit`), several times as fast. It
              takes one state x, `(state_size,)`, and one input u, `(n_inputs,)`, and
              should return a tuple. `math` and `if` are allowed;
            - a model of python-control, `control.nlsys(...)` or `control.ss(...)`, which
              must not depend on time. A model in discrete time gives the next state. An
              update function that cannot take arrays of states is slow.

            It is tried on a few states at once, and must give finite numbers. The
            states and inputs of a function of many plants are read-only, as are the
            states of `goal` and `cost`; a compiled one gets copies. To send
            the environment to other processes, define it at the top of a module.
        low: lower end of each state variable, `(state_size,)`.
        high: upper end of each. After each step, a variable beyond an end is set back to
            it, as if it had hit a wall. Where the plant has no such stop, make the range
            wider than anything it can reach, and say by `initial` where episodes begin.
        inputs: what each action sets, `(n_actions,)`, or `(n_actions, n_inputs)`; or a
            bounded `gymnasium.spaces.Box` of one axis: the actions are then real inputs,
            `(n_inputs,)`, set to its bounds where they are beyond. `ActionGrid` gives
            such an environment numbered actions again, for agents to learn on.
        sampling_time: s, > 0.
        goal: where an episode ends in success: a state, a pair of states (low, high), a
            function of x, `(state_size, n)`, that returns n booleans, or None: nowhere.
            A state must lie within low and high, or within the tolerance of them. The
            pair may have infinite ends, and lead over the end of a circle.
        cost: what a step costs: "time", the sampling time; a pair (Q, R), the quadratic
            cost e' Q e + u' R u of the error e from the goal after the step, each a
            number, a diagonal or a matrix; or a function of x and u, as `dynamics` takes
            them, that returns n costs.
        max_episode_steps: T, steps after which an episode is truncated, >= 1; also of an
            evaluation.
        num_envs: number of slots of a vector environment; None makes a single one.
        tolerance: half-width of the goal around a state, for all variables or each; None
            takes a fortieth of the range of each variable.
        circular: the variables that wrap around from `high` to `low`, such as angles.
        substeps: Runge-Kutta steps in a sampling time, >= 1.
        discrete_time: whether `dynamics` gives the next state, not the derivative.
        initial: states in which episodes begin: None, uniform within the bounds but
            outside the goal; a box of states,
            `gymnasium.spaces.Box(low, high, dtype=np.float64)` with two arrays, the same
            within it; a state or rows of states, drawn with equal chances; or a function
            of a `numpy.random.Generator` and n that returns n rows.
        evaluation_states: rows of states from which policies are evaluated; None draws
            100 initial states once, the same each time.
        state_names: of the variables, with units, for exported policies.
        input_names: of the inputs.
        parameters: numbers that `dynamics` takes by name, such as `{"mass": 0.1}`. It is
            then a function of x, u and p, and finds them as `p.mass`; a model of
            python-control finds them in its params. `ChangingVectorEnv` lets them change.
        uncertain: for some parameters the range (low, high) in which they are known to
            lie. Each slot walks in a plant of its own, whose values are drawn uniformly
            for each episode, so that one policy is learned for all of them. To a function
            of n plants they are arrays `(n,)`. Nominally, as in evaluations, they have
            the value in `parameters`, or the middle of the range. They are further
            variables of a state, after the others, which are not observed; states that
            are set may leave them out. `goal` and `cost` do not depend on them.
        autoreset_mode: of a vector environment, see `ControlVectorEnv`; None takes
            "NextStep".
        render_mode: "rgb_array", or "human" for a single environment: gauges of the
            state.

    Returns:
        A `PlantVectorEnv`, or a `PlantEnv` with a `TimeLimit`. A step that leads to a
        state or a cost that is not finite raises a ValueError that names the slot and
        the state; reset the environment then.

    Raises:
        TypeError: `dynamics` is no function, or an argument has the wrong type.
        ValueError: `dynamics`, `goal` or `cost` fail on states within the bounds or give
            arrays of the wrong shape, or an argument is out of range.
    """
    steps = validation.integer("max_episode_steps", max_episode_steps, at_least=1)
    settings: dict[str, Any] = {
        "dynamics": dynamics,
        "low": low,
        "high": high,
        "inputs": inputs,
        "sampling_time": sampling_time,
        "goal": goal,
        "cost": cost,
        "tolerance": tolerance,
        "circular": circular,
        "substeps": substeps,
        "discrete_time": discrete_time,
        "initial": initial,
        "evaluation_states": evaluation_states,
        "evaluation_steps": steps,
        "state_names": state_names,
        "input_names": input_names,
        "parameters": parameters,
        "uncertain": uncertain,
    }
    if num_envs is not None:
        return PlantVectorEnv(
            num_envs,
            max_episode_steps=steps,
            autoreset_mode=(
                AutoresetMode.NEXT_STEP if autoreset_mode is None else autoreset_mode
            ),
            render_mode=render_mode,
            **settings,
        )
    if autoreset_mode is not None:
        raise ValueError(
            "autoreset_mode belongs to a vector environment, got "
            f"{validation.shown(autoreset_mode)}; give num_envs as well, or leave it out."
        )
    return TimeLimit(PlantEnv(render_mode, **settings), steps)
