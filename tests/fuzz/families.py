"""Families of random calls: each makes a call and says what must come of it."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode

import acl_gym
from acl_gym import (
    ACL,
    Crisp,
    Discrete,
    Fuzzy,
    QLearning,
    ReturningACL,
    SoftPolicy,
    theory,
)
from acl_gym.callbacks import Checkpoint, CSVLog, EarlyStop, PolicyEvaluation
from acl_gym.colony import costs, deposits, schedules, selection
from acl_gym.envs.wrappers.perturbations import perturbed
from acl_gym.evaluation import evaluate_policy_cost
from acl_gym.evaluation.trajectory import actions_in, record_trajectory
from acl_gym.partitions.automatic import automatic_partition, thesis_partition
from acl_gym.partitions.bounds import estimate_bounds
from acl_gym.planning.model import TabularModel
from acl_gym.planning.q_iteration import fuzzy_q_iteration
from acl_gym.planning.value_iteration import policy_value, value_iteration
from acl_gym.policies import TablePolicy
from tests.fuzz import liars, values
from tests.fuzz.values import choice, hostile
from tests.planning.chains import corridor


class Call(NamedTuple):
    """A call, and what must come of it.

    Attributes:
        name: of the call, with its arguments as far as they tell something.
        make: does it.
        outcome: "refuse": an error in words; "any": that or success; "crash-free": any
            error will do; otherwise the value that a call must have which succeeds.
    """

    name: str
    make: Callable[[], Any]
    outcome: Any = "any"


Rng = np.random.Generator


def pendulum(slots: int = 3, **parameters: Any) -> Any:
    """A vector environment of this package."""
    return gym.make_vec("acl_gym/Pendulum-v0", num_envs=slots, **parameters)


def grid() -> Fuzzy:
    """A small partition for it."""
    return Fuzzy.from_box(spaces.Box(-9.0, 9.0, (2,), np.float64), (4, 3))


def colony(env: Any = None, **parameters: Any) -> ACL:
    """A small colony."""
    settings: dict[str, Any] = {"max_steps": 4, "seed": 0, "tau0": 1e-3}
    return ACL(pendulum() if env is None else env, grid(), **(settings | parameters))


# Arguments


def _model() -> TabularModel:
    return TabularModel.from_env(_Published())


class _Published(gym.Env[int, int]):
    observation_space = spaces.Discrete(4)
    action_space = spaces.Discrete(2)
    P = corridor(4, 0.5, 2)


def _learn(kind: Any) -> Callable[..., Any]:
    def learn(**parameters: Any) -> Any:
        agent = kind(**parameters)
        # T without a limit is no fault, but the pendulum would walk for ever.
        if agent.max_steps <= 1000:
            agent.learn(trials=1)
        return agent

    return learn


_TABLE = np.linspace(1.0, 2.0, 36).reshape(12, 3)

CONSTRUCTORS: dict[str, Callable[[], tuple[Callable[..., Any], dict[str, Any]]]] = {
    "ACL": lambda: (
        _learn(ACL),
        {
            "env": pendulum(),
            "partition": grid(),
            "tau0": 1e-3,
            "local_decay": 0.01,
            "global_decay": 0.1,
            "alpha": 3.0,
            "heuristic": np.ones((12, 3)),
            "beta": 1.0,
            "initial": np.ones((12, 3)),
            "epsilon": 0.1,
            "selection": "boltzmann",
            "cost": None,
            "deposit": "rank",
            "update": "each_visit",
            "schedule": "asynchronous",
            "tabu": False,
            "max_steps": 3,
            "seed": 0,
            "n_actions": 3,
        },
    ),
    "QLearning": lambda: (
        _learn(QLearning),
        {
            "env": pendulum(),
            "partition": grid(),
            "learning_rate": 0.3,
            "discount": 0.9,
            "epsilon": 0.1,
            "trace_decay": 0.5,
            "traces": "replacing",
            "replay": 2,
            "older_steps": 3,
            "steps_per_replay": 5,
            "memory_size": 20,
            "optimism": 1.0,
            "grows": True,
            "visits_to_grow": 5.0,
            "max_cells": 100,
            "max_steps": 3,
            "seed": 0,
            "n_actions": 3,
        },
    ),
    "ReturningACL": lambda: (
        _learn(ReturningACL),
        {
            "env": pendulum(),
            "partition": grid(),
            "discount": 0.9,
            "mix": 0.2,
            "learning_rate": 0.9,
            "trust": 1.0,
            "epsilon": 0.1,
            "optimism": 1.0,
            "heuristic": np.ones((12, 3)),
            "beta": 1.0,
            "initial": np.zeros((12, 3)),
            "walks_back": 2,
            "older_steps": 3,
            "steps_per_walk": 5,
            "memory_size": 20,
            "visits_to_grow": 5.0,
            "max_cells": 100,
            "grows": True,
            "schedule": "asynchronous",
            "max_steps": 3,
            "seed": 0,
            "n_actions": 3,
        },
    ),
    "learn": lambda: (
        colony().learn,
        {"trials": 1, "callback": None, "log_interval": None, "progress_bar": False},
    ),
    "Fuzzy": lambda: (Fuzzy, {"centres": ([0, 1], [0, 1, 2]), "periods": (None, 4.0)}),
    "Crisp": lambda: (Crisp, {"centres": ([0, 1], [0, 1, 2]), "periods": (None, 4.0)}),
    "from_box": lambda: (
        Fuzzy.from_box,
        {"space": spaces.Box(0, 1, (2,)), "cells": (3, 4), "circular": (0,)},
    ),
    "refine": lambda: (grid().refine, {"axis": 0, "centres": [0.5]}),
    "check_space": lambda: (grid().check_space, {"space": spaces.Box(0, 1, (2,))}),
    "Discrete": lambda: (Discrete, {"sizes": (2, 3), "starts": 0}),
    "from_space": lambda: (Discrete.from_space, {"space": spaces.Discrete(3)}),
    "TablePolicy": lambda: (
        TablePolicy,
        {"partition": grid(), "table": _TABLE, "ranks": None, "first_action": 0},
    ),
    "SoftPolicy": lambda: (
        lambda **given: SoftPolicy(**given).predict([[0.0, 0.0]]),
        {"partition": grid(), "levels": _TABLE, "exponent": 2.0, "seed": 0},
    ),
    "Linear": lambda: (
        lambda **given: schedules.Linear(**given)(3),
        {"start": 1.0, "end": 0.0, "trials": 5},
    ),
    "Exponential": lambda: (
        lambda **given: schedules.Exponential(**given)(3),
        {"start": 1.0, "factor": 0.5, "end": 0.1},
    ),
    "Harmonic": lambda: (
        lambda **given: schedules.Harmonic(**given)(3),
        {"start": 1.0, "trials": 5},
    ),
    "Quadratic": lambda: (
        costs.Quadratic,
        {
            "goal": (0.0, 0.0),
            "state_weight": (1.0, 1.0),
            "inputs": ((0.0,), (1.0,), (2.0,)),
            "input_weight": (1.0,),
            "periods": (None, 1.0),
        },
    ),
    "RiseTime": lambda: (
        costs.RiseTime,
        {"variable": 0, "target": 1.0, "low": 0.1, "high": 0.9, "period": None},
    ),
    "SettlingTime": lambda: (
        costs.SettlingTime,
        {"variable": 0, "target": 1.0, "tolerance": 0.1, "period": None},
    ),
    "Overshoot": lambda: (costs.Overshoot, {"variable": 0, "target": 1.0}),
    "Weighted": lambda: (costs.Weighted, {"factor": 1.0, "cost": costs.Steps()}),
    "Sum": lambda: (costs.Sum, {"terms": (costs.Steps(), costs.Constant(1.0))}),
    "Rank": lambda: (deposits.Rank, {"exponent": 2.0}),
    "InverseCost": lambda: (deposits.InverseCost, {"offset": 2.0}),
    "automatic_partition": lambda: (
        automatic_partition,
        {
            "env": pendulum(),
            "kind": Fuzzy,
            "cells": (3, 3),
            "bounds": {1: (-1.0, 1.0)},
            "random_steps": 9,
            "seed": 0,
        },
    ),
    "thesis_partition": lambda: (
        thesis_partition,
        {"env": pendulum(), "cells": (4, 5), "kind": Crisp},
    ),
    "estimate_bounds": lambda: (
        _few_steps(estimate_bounds, "random_steps"),
        {"env": pendulum(), "random_steps": 9, "seed": 0},
    ),
    "evaluate_policy_cost": lambda: (
        _few_steps(evaluate_policy_cost, "max_steps"),
        {
            "model": colony(),
            "env": pendulum(2),
            "states": np.zeros((2, 2)),
            "max_steps": 3,
            "seed": 0,
            "cost": costs.Steps(),
        },
    ),
    "record_trajectory": lambda: (
        _few_steps(record_trajectory, "max_steps"),
        {"model": colony(), "env": pendulum(1), "state": np.zeros(2), "max_steps": 3},
    ),
    "actions_in": lambda: (
        actions_in,
        {"model": colony(), "env": pendulum(2), "states": np.zeros((2, 2))},
    ),
    "value_iteration": lambda: (
        value_iteration,
        {"model": _model(), "discount": 0.9, "tolerance": 1e-3, "max_iterations": 9},
    ),
    "policy_value": lambda: (
        policy_value,
        {"model": _model(), "policy_actions": [0, 0, 0, 0], "discount": 0.9},
    ),
    "TabularModel": lambda: (
        TabularModel,
        {
            "probability": np.ones((2, 1, 1)),
            "next_state": np.zeros((2, 1, 1), int),
            "reward": np.zeros((2, 1, 1)),
            "terminated": np.zeros((2, 1, 1), bool),
            "first_state": 0,
            "first_action": 0,
        },
    ),
    "fuzzy_q_iteration": lambda: (
        fuzzy_q_iteration,
        {
            "env": pendulum(),
            "partition": grid(),
            "discount": 0.9,
            "tolerance": 1.0,
            "max_iterations": 3,
        },
    ),
    "make_vec": lambda: (
        lambda **given: gym.make_vec("acl_gym/Pendulum-v0", **given).reset(seed=0),
        {
            "num_envs": 2,
            "max_episode_steps": 5,
            "autoreset_mode": "NextStep",
            "torques": (-1.0, 1.0),
            "goal_bounds": (0.1, 0.1),
        },
    ),
    "reset": lambda: (
        pendulum().reset,
        {"seed": 0, "options": {"state": np.zeros((3, 2))}},
    ),
    "state": lambda: (
        lambda state: pendulum().reset(options={"state": state}),
        {"state": np.zeros((3, 2))},
    ),
    "step": lambda: (_stepped, {"actions": np.zeros(3, int)}),
    "ScaledObservation": lambda: (
        acl_gym.ScaledObservation,
        {"env": gym.make("acl_gym/Pendulum-v0"), "circular": [0]},
    ),
    "ScaledVectorObservation": lambda: (
        acl_gym.ScaledVectorObservation,
        {"env": pendulum(), "circular": [0]},
    ),
    "ActionGrid": lambda: (
        acl_gym.ActionGrid,
        {"env": pendulum(continuous=True), "counts": 3},
    ),
    "step_inputs": lambda: (
        partial(_stepped, continuous=True),
        {"actions": np.zeros((3, 1))},
    ),
    "perturbed": lambda: (
        lambda **given: perturbed(pendulum(), given),
        {"slips": 0.1, "noise": (0.1, 0.1), "rounded": (3, 3), "hidden": (1,)},
    ),
    "VectorEnvAdapter": lambda: (
        acl_gym.VectorEnvAdapter,
        {"env": pendulum(autoreset_mode="Disabled")},
    ),
    "PolicyEvaluation": lambda: (
        PolicyEvaluation,
        {"env": pendulum(), "states": None, "every": 1, "max_steps": 3, "seed": 0},
    ),
    "EarlyStop": lambda: (
        EarlyStop,
        {"patience": 1, "measure": "a", "min_improvement": 0.0, "threshold": 1.0},
    ),
    "Checkpoint": lambda: (Checkpoint, {"path": Path("x.npz"), "every": 1}),
    "CSVLog": lambda: (CSVLog, {"path": Path("x.csv")}),
    "choose_actions": lambda: (
        selection.choose_actions,
        {
            "rule": "max_boltzmann",
            "pheromone": colony().pheromone,
            "index": np.zeros((2, 4), np.int32),
            "degree": np.full((2, 4), 0.25),
            "epsilon": 0.1,
            "rng": np.random.default_rng(0),
            "allowed": np.ones((2, 3), bool),
        },
    ),
    "set_table": lambda: (colony().set_table, {"table": _TABLE}),
    "set_random_seed": lambda: (colony().set_random_seed, {"seed": 0}),
    "set_env": lambda: (colony().set_env, {"env": pendulum()}),
    "soft_policy": lambda: (colony().soft_policy, {"exponent": 2.0, "seed": 0}),
    "InterpolatedPolicy": lambda: (
        acl_gym.InterpolatedPolicy,
        {"policy": TablePolicy(grid(), _TABLE), "inputs": np.arange(3.0)},
    ),
    "interpolated_policy": lambda: (
        colony().interpolated_policy,
        {"inputs": np.arange(3.0)},
    ),
    "predict_inputs": lambda: (
        colony().interpolated_policy().predict,
        {"observation": np.zeros((2, 2)), "state": None, "episode_start": None},
    ),
    "set_num_threads": lambda: (acl_gym.set_num_threads, {"count": 1}),
    "predict": lambda: (
        colony().predict,
        {"observation": np.zeros((2, 2)), "action_masks": np.ones((2, 3), int)},
    ),
    "predict_soft": lambda: (
        SoftPolicy(grid(), _TABLE, seed=0).predict,
        {
            "observation": np.zeros((2, 2)),
            "state": None,
            "episode_start": np.ones(2, bool),
            "action_masks": None,
        },
    ),
    "predict_cells": lambda: (
        TablePolicy(Discrete((2, 3)), np.ones((6, 2))).predict,
        {"observation": np.zeros((2, 2), int), "action_masks": None},
    ),
    "partition": lambda: (grid(), {"states": np.zeros((2, 2))}),
    "cells": lambda: (Discrete(4), {"states": np.zeros(2, int)}),
    "locate": lambda: (
        grid().locate,
        {
            "states": np.zeros((2, 2)),
            "slots": np.arange(2),
            "index": np.zeros((2, 4), np.int32),
            "degree": np.zeros((2, 4)),
        },
    ),
    "load": lambda: (ACL.load, {"path": "nothing.npz"}),
}


def _few_steps(function: Callable[..., Any], name: str) -> Callable[..., Any]:
    """The function, but refusing to walk for hours where that is what was asked for."""

    def call(**given: Any) -> Any:
        steps = given[name]
        if isinstance(steps, (int, np.integer)) and 1000 < steps < 2**63:
            given[name] = 3
        return function(**given)

    return call


def _stepped(actions: Any, **parameters: Any) -> Any:
    env = pendulum(**parameters)
    env.reset(seed=0)
    return env.step(actions)


def arguments(rng: Rng) -> Call:
    """One or two arguments of a public call are hostile."""
    name = choice(rng, CONSTRUCTORS)
    function, given = CONSTRUCTORS[name]()
    changed = {}
    for key in rng.choice(list(given), size=min(len(given), int(rng.integers(1, 3)))):
        changed[str(key)] = hostile(rng)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        shown = ", ".join(f"{key}={_shown(value)}" for key, value in changed.items())
    return Call(f"{name}({shown})", lambda: function(**{**given, **changed}))


_THEORY = [name for name in theory.__all__ if name[0].islower()]


def formulas(rng: Rng) -> Call:
    """A function of the theory with hostile numbers."""
    import inspect

    name = choice(rng, _THEORY)
    function = getattr(theory, name)
    given = dict.fromkeys(inspect.signature(function).parameters, 0.5)
    given |= {key: 3 for key in given if key.startswith("n_") or key == "visits"}
    if name == "expected_deposit":
        given["deposits"] = [0.5, 0.25]  # type: ignore[assignment]
    for key in rng.choice(list(given), size=1):
        given[str(key)] = hostile(rng)
    if isinstance(given.get("n_updates"), int) and given["n_updates"] > 1000:
        given["n_updates"] = 3
    shown = ", ".join(f"{key}={_shown(value)}" for key, value in given.items())
    return Call(f"theory.{name}({shown})", lambda: function(**given))


# What environments return


def _run(env: Any, kind: str, boxes: bool) -> Any:
    """What comes of it, as numbers to compare."""
    partition = Crisp([[-1, 0, 1], [-1, 1]]) if boxes else Discrete(7)
    if kind == "fuzzy" and boxes:
        partition = Fuzzy([[-1, 0, 1], [-1, 1]])
    if kind == "model":
        cost = costs.Steps() if boxes else None
        found = evaluate_policy_cost(liars.Model(), env, max_steps=9, seed=1, cost=cost)
        return found.costs.tolist(), found.returns.tolist(), found.lengths.tolist()
    kinds: dict[str, Any] = {
        "q": QLearning,
        "replay": partial(QLearning, replay=2, trace_decay=0.5),
        "returning": ReturningACL,
    }
    agent: Any = kinds.get(kind, ACL)(env, partition, seed=0, max_steps=9)
    agent.learn(trials=2)
    return agent.table.tolist(), agent.num_timesteps


_TRUTH: dict[Any, Any] = {}


def environments(rng: Rng) -> Call:
    """One thing that an environment returns is changed."""
    boxes, masked = bool(rng.integers(2)), bool(rng.integers(2))
    mode = choice(rng, list(AutoresetMode))
    kind = choice(rng, ("crisp", "fuzzy", "q", "replay", "returning", "model"))
    what = choice(rng, ("observations", "rewards", "terminated", "truncated", "infos"))
    forms, outcome = values.WRONG, "refuse"
    if masked and rng.random() < 0.3:
        what = "mask"
    if rng.random() < 0.4:
        forms, outcome = values.SAME, "same"
    elif rng.random() < 0.2:
        forms = values.NOT_FINITE
    form = choice(rng, forms)
    when = int(rng.integers(0, 4))
    change = forms[form]
    if what == "infos":
        change, outcome = (lambda infos: hostile(rng)), "any"
    if kind == "model" and what in ("observations", "mask") and form in _CONTENT:
        outcome = "any"  # the model does not look at it
    if form == "objects" and what == "observations" and not boxes:
        outcome = "any"
    if form in ("None", "dict") and what == "mask":
        outcome = "any"  # no mask: all is allowed
    key = boxes, masked, mode, kind
    if outcome == "same" and key not in _TRUTH:
        _TRUTH[key] = _run(liars.Liar(boxes, mode, masked=masked), kind, boxes)
    env = liars.Liar(boxes, mode, what, change, when, masked)
    return Call(
        f"{kind} on {'boxes' if boxes else 'cells'}, {mode.name}, masked={masked}: "
        f"{what} {form} from step {when}",
        lambda: _run(env, kind, boxes),
        ("same", _TRUTH[key]) if outcome == "same" else outcome,
    )


_CONTENT = (
    "complex",
    "objects",
    "text",
    "dates",
    "masked",
    "two axes more",
    "nan",
    "inf",
    "-inf",
)


def models(rng: Rng) -> Call:
    """A model's actions are changed."""
    forms: Any = {**values.WRONG, **values.NOT_FINITE}
    forms["too many"] = lambda actions: actions + 98
    forms["negative"] = lambda actions: -actions
    forms["fractions"] = lambda actions: actions + 1.9
    forms["huge"] = lambda actions: actions.astype(np.uint64) + np.uint64(2**63)
    outcome: Any = "refuse"
    if rng.random() < 0.4:
        forms = dict(values.SAME, column=lambda actions: actions[:, None])
        outcome = (
            "same",
            _run(liars.Liar(True, AutoresetMode.DISABLED), "model", True),
        )
    form = choice(rng, forms)
    model = liars.Model(forms[form])
    env = liars.Liar(True, AutoresetMode.DISABLED)

    def evaluate() -> Any:
        found = evaluate_policy_cost(
            model, env, max_steps=9, seed=1, cost=costs.Steps()
        )
        return found.costs.tolist(), found.returns.tolist(), found.lengths.tolist()

    return Call(f"model: actions {form}", evaluate, outcome)


# What users write


def own_parts(rng: Rng) -> Call:
    """A partition, rule, deposit, cost, schedule or heuristic of a user's own lies."""
    part = choice(rng, _PARTS)
    return _PARTS[part](rng)


def _own_partition(rng: Rng) -> Call:
    lie = choice(rng, liars.LIES_OF_CELLS)
    kind = choice(rng, (ACL, QLearning, ReturningACL))

    def learn() -> Any:
        partition = liars.OwnPartition(liars.LIES_OF_CELLS[lie])
        return kind(pendulum(), partition, seed=0, max_steps=3).learn(trials=1)

    return Call(f"{kind.__name__} with a partition: {lie}", learn, "refuse")


def _own_sizes(rng: Rng) -> Call:
    partition = liars.OwnPartition(lambda *arrays: None)
    name = choice(rng, ("n_cells", "cells_per_state", "state_ndim"))
    value = hostile(rng)
    setattr(partition, name, value)
    return Call(
        f"partition with {name}={_shown(value)}",
        lambda: ACL(pendulum(), partition, seed=0, max_steps=3).learn(trials=1),
        "crash-free",
    )


def _subclass(rng: Rng) -> Call:
    box = spaces.Box(-9.0, 9.0, (2,), np.float64)
    make = choice(rng, (liars.FarCrisp, liars.FarFuzzy, liars.FarDiscrete))
    if make is liars.FarDiscrete:
        env: Any = liars.Liar(False, AutoresetMode.DISABLED)
        partition = liars.FarDiscrete(7)
    else:
        env, partition = pendulum(), make.from_box(box, (4, 3))
    used = choice(rng, ("learn", "predict", "soft", "call"))

    def call() -> Any:
        if used == "call":
            return partition([[0.0, 0.0]] if make is not liars.FarDiscrete else [0])
        seen = [[0.0, 0.0]] if make is not liars.FarDiscrete else [0]
        if used == "soft":
            table = np.ones((partition.n_cells, 3))
            return SoftPolicy(partition, table, seed=0).predict(seen)
        agent = ACL(env, partition, seed=0, max_steps=3)
        return agent.predict(seen) if used == "predict" else agent.learn(trials=1)

    return Call(f"{make.__name__}: {used}", call, "refuse")


def _own_rule(rng: Rng) -> Call:
    forms: Any = {**values.WRONG, **values.NOT_FINITE}
    forms["too many"] = lambda actions: actions + 98
    forms["negative"] = lambda actions: -1 - actions
    if rng.random() < 0.4:
        scribbled = int(choice(rng, (2**31 - 1, -(2**31), 12)))

        def scribble(index: Any) -> None:
            index[:] = scribbled

        rule, outcome = liars.Rule(scribble=scribble), "any"
        name = f"cells {scribbled}"
    elif rng.random() < 0.3:
        name = choice(rng, (np.nan, np.inf, -1.0, 0.0))

        def spoil(levels: Any) -> None:
            levels[0, 0] = name

        rule, outcome = liars.Rule(levels=spoil), "refuse"
    else:
        name, outcome = choice(rng, forms), "refuse"
        rule = liars.Rule(choice=forms[name])
    return Call(
        f"update rule: {name}",
        lambda: colony(update=rule).learn(trials=1),
        outcome,
    )


def _own_function(rng: Rng) -> Call:
    name = choice(rng, ("deposit", "cost", "epsilon", "alpha", "heuristic", "initial"))
    value = hostile(rng)
    function: Any = lambda *arguments: value  # noqa: E731
    if name == "deposit" and rng.random() < 0.5:

        class Own(deposits.Deposit):
            def __call__(self, costs: Any, tau0: float) -> Any:
                return value

        function = Own()
    if name == "cost" and rng.random() < 0.5:

        class OwnCost(costs.Cost):
            def __call__(self, episodes: Any) -> Any:
                return value

        function = OwnCost()
    given = {name: function}
    return Call(
        f"{name} returns {_shown(value)}",
        lambda: np.isfinite(colony(**given).learn(trials=1).table).all(),
    )


_PARTS: dict[str, Callable[[Rng], Call]] = {
    "partition": _own_partition,
    "sizes": _own_sizes,
    "subclass": _subclass,
    "rule": _own_rule,
    "function": _own_function,
}


# What changes under way


def replaced(rng: Rng) -> Call:
    """A public attribute is replaced, then the thing is used."""
    makers = [
        colony,
        lambda: QLearning(pendulum(), grid(), max_steps=3),
        lambda: ReturningACL(pendulum(), grid(), max_steps=3),
    ]
    agent = makers[rng.integers(3)]()
    things: list[Any] = [agent, agent.partition, agent.policy, agent.env, agent.rollout]
    between = agent.interpolated_policy()
    things += [between, between.grid]
    if isinstance(agent, ACL):
        things += [agent.pheromone, agent.soft_policy(seed=0)]
    thing = things[rng.integers(len(things))]
    names = [name for name in dir(thing) if name[0] != "_"]
    name, value = choice(rng, names), hostile(rng)

    def use() -> Any:
        setattr(thing, name, value)
        if agent.max_steps < 100:
            agent.learn(trials=1)
        between.predict(np.zeros((2, 2)))
        return agent.predict(np.zeros((2, 2)))

    return Call(f"{type(thing).__name__}.{name} = {_shown(value)}", use, "crash-free")


def scribbled(rng: Rng) -> Call:
    """Arrays that are handed out are written to, then the thing is used."""
    agent = colony()
    agent.learn(trials=1)
    cells = Discrete((3, 2))
    arrays: dict[str, Any] = {
        "centres": agent.partition.centres[0],
        "sizes": cells.sizes,
        "starts": cells.starts,
        "ants": agent.rollout.ants,
        "length": agent.rollout.length,
        "levels": agent.pheromone.levels,
        "stale": agent.pheromone.stale,
        "probabilities": agent.pheromone.probabilities,
        "table": agent.table,
        "ranks": agent.policy.ranks,
    }
    name = choice(rng, arrays)
    value = choice(rng, (2**30, -(2**30), 0, 1))

    def use() -> Any:
        arrays[name][...] = value
        cells([[1, 1]])
        agent.learn(trials=1)
        return agent.predict(np.zeros((2, 2)))

    return Call(f"{name}[...] = {value}", use, "crash-free")


def mischief(rng: Rng) -> Call:
    """The environment meddles with the agent in the middle of a step."""
    boxes = bool(rng.integers(2))
    env = liars.Liar(boxes, choice(rng, list(AutoresetMode)))
    partition: Any = Fuzzy([[-1, 0, 1], [-1, 1]]) if boxes else Discrete(7)
    kind = choice(rng, (ACL, QLearning, ReturningACL))
    agent = kind(env, partition, seed=0, max_steps=9)
    larger = liars.Liar(boxes, AutoresetMode.DISABLED)
    larger.num_envs = choice(rng, (1, 9))
    deeds: dict[str, tuple[Callable[[], Any], str]] = {
        "set_env": (lambda: agent.set_env(larger), "refuse"),
        "learn": (lambda: agent.learn(trials=1), "refuse"),
        "num_envs": (lambda: setattr(env, "num_envs", 9), "any"),
        "start": (agent.rollout.start, "crash-free"),
        "predict": (lambda: agent.predict(env._see()), "any"),
        "seed": (lambda: agent.set_random_seed(3), "any"),
        "table": (lambda: agent.set_table(np.ones(agent.table.shape)), "any"),
    }
    deed = choice(rng, deeds)
    env.mischief, outcome = deeds[deed]
    return Call(
        f"{kind.__name__} on {'boxes' if boxes else 'cells'}: {deed} in a step",
        lambda: agent.learn(trials=2),
        outcome,
    )


FAMILIES: tuple[tuple[Callable[[Rng], Call], float], ...] = (
    (arguments, 0.45),
    (formulas, 0.1),
    (environments, 0.2),
    (models, 0.05),
    (own_parts, 0.1),
    (replaced, 0.05),
    (scribbled, 0.02),
    (mischief, 0.03),
)
"""The families and how often each comes."""


def call_number(seed: int, number: int) -> Call:
    """The call of that number; the same in every process."""
    rng = np.random.default_rng([seed, number])
    families, weights = zip(*FAMILIES, strict=True)
    family = families[int(rng.choice(len(families), p=weights))]
    return family(rng)


def _shown(value: Any) -> str:
    try:
        text = repr(value)
    except Exception:
        text = f"a {type(value).__name__}"
    return text if len(text) < 60 else f"{text[:50]}... ({type(value).__name__})"
