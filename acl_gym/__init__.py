"""Ant Colony Learning: colonies of ants that learn control policies.

Each slot of a Gymnasium vector environment is one ant, and all ants share one table of
pheromone over (state, action) pairs (J. M. van Ast, Delft, 2010).
"""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from acl_gym import swarm
    from acl_gym.agents.acl import ACL
    from acl_gym.agents.ant_system import AntColonySystem, AntSystem, MaxMinAntSystem
    from acl_gym.agents.q_learning import QLearning
    from acl_gym.agents.returning import ReturningACL
    from acl_gym.callbacks import (
        Callback,
        Checkpoint,
        CSVLog,
        EarlyStop,
        PolicyEvaluation,
        TensorBoardLog,
    )
    from acl_gym.colony.prior import PolicyPrior, PotentialPrior
    from acl_gym.colony.update_rule import UpdateRule
    from acl_gym.costs import (
        Constant,
        Cost,
        FunctionCost,
        Overshoot,
        Quadratic,
        RiseTime,
        SettlingTime,
        StageCosts,
        Steps,
        Sum,
        Weighted,
    )
    from acl_gym.deposits import Deposit, FunctionDeposit, InverseCost, Rank, Return
    from acl_gym.envs.graph.cities import TravellingSalesmanInstance
    from acl_gym.envs.learned import LearnedVectorEnv, Transitions
    from acl_gym.envs.plant import plant
    from acl_gym.envs.wrappers.action_grid import ActionGrid
    from acl_gym.envs.wrappers.changing import ChangingVectorEnv, Drift, Jump
    from acl_gym.envs.wrappers.inner_loop import InnerLoop
    from acl_gym.envs.wrappers.scaling import ScaledObservation, ScaledVectorObservation
    from acl_gym.envs.wrappers.shield import Shield
    from acl_gym.envs.wrappers.waiting import WaitingVectorEnv
    from acl_gym.envs.wrappers.workers import WorkersVectorEnv
    from acl_gym.evaluation import (
        PolicyCost,
        Robustness,
        evaluate_over_range,
        evaluate_policy_cost,
    )
    from acl_gym.model_based import PlantLearning, learn_from_plant
    from acl_gym.partitions import Crisp, Discrete, Fuzzy, Partition
    from acl_gym.partitions.automatic import automatic_partition
    from acl_gym.planning.q_iteration import fuzzy_q_iteration
    from acl_gym.planning.value_iteration import value_iteration
    from acl_gym.policies import InterpolatedPolicy, SoftPolicy
    from acl_gym.sb3.adapter import VectorEnvAdapter
    from acl_gym.schedules import Exponential, Harmonic, Linear, Schedule
    from acl_gym.utils.threads import get_num_threads, set_num_threads

__version__ = "0.2.0"

# Name -> module. Modules are imported on first use, because compiled kernels and torch
# take seconds to load, which `gym.make` of another environment should not cost.
_PUBLIC = {
    "ACL": "acl_gym.agents.acl",
    "ActionGrid": "acl_gym.envs.wrappers.action_grid",
    "AntColonySystem": "acl_gym.agents.ant_system",
    "AntSystem": "acl_gym.agents.ant_system",
    "CSVLog": "acl_gym.callbacks",
    "Callback": "acl_gym.callbacks",
    "ChangingVectorEnv": "acl_gym.envs.wrappers.changing",
    "Checkpoint": "acl_gym.callbacks",
    "Constant": "acl_gym.costs",
    "Cost": "acl_gym.costs",
    "Crisp": "acl_gym.partitions",
    "Deposit": "acl_gym.deposits",
    "Discrete": "acl_gym.partitions",
    "Drift": "acl_gym.envs.wrappers.changing",
    "EarlyStop": "acl_gym.callbacks",
    "Exponential": "acl_gym.schedules",
    "FunctionCost": "acl_gym.costs",
    "FunctionDeposit": "acl_gym.deposits",
    "Fuzzy": "acl_gym.partitions",
    "Harmonic": "acl_gym.schedules",
    "InnerLoop": "acl_gym.envs.wrappers",
    "InterpolatedPolicy": "acl_gym.policies",
    "InverseCost": "acl_gym.deposits",
    "Jump": "acl_gym.envs.wrappers.changing",
    "LearnedVectorEnv": "acl_gym.envs.learned",
    "Linear": "acl_gym.schedules",
    "MaxMinAntSystem": "acl_gym.agents.ant_system",
    "Overshoot": "acl_gym.costs",
    "Partition": "acl_gym.partitions",
    "PlantLearning": "acl_gym.model_based",
    "PolicyCost": "acl_gym.evaluation",
    "PolicyEvaluation": "acl_gym.callbacks",
    "PolicyPrior": "acl_gym.colony.prior",
    "PotentialPrior": "acl_gym.colony.prior",
    "QLearning": "acl_gym.agents.q_learning",
    "Quadratic": "acl_gym.costs",
    "Rank": "acl_gym.deposits",
    "Return": "acl_gym.deposits",
    "ReturningACL": "acl_gym.agents.returning",
    "RiseTime": "acl_gym.costs",
    "Robustness": "acl_gym.evaluation",
    "ScaledObservation": "acl_gym.envs.wrappers",
    "ScaledVectorObservation": "acl_gym.envs.wrappers",
    "Schedule": "acl_gym.schedules",
    "SettlingTime": "acl_gym.costs",
    "Shield": "acl_gym.envs.wrappers",
    "SoftPolicy": "acl_gym.policies",
    "StageCosts": "acl_gym.costs",
    "Steps": "acl_gym.costs",
    "Sum": "acl_gym.costs",
    "TensorBoardLog": "acl_gym.callbacks",
    "Transitions": "acl_gym.envs.learned",
    "TravellingSalesmanInstance": "acl_gym.envs.graph.cities",
    "UpdateRule": "acl_gym.colony.update_rule",
    "VectorEnvAdapter": "acl_gym.sb3.adapter",
    "WaitingVectorEnv": "acl_gym.envs.wrappers.waiting",
    "Weighted": "acl_gym.costs",
    "WorkersVectorEnv": "acl_gym.envs.wrappers.workers",
    "automatic_partition": "acl_gym.partitions.automatic",
    "evaluate_over_range": "acl_gym.evaluation",
    "evaluate_policy_cost": "acl_gym.evaluation",
    "fuzzy_q_iteration": "acl_gym.planning.q_iteration",
    "get_num_threads": "acl_gym.utils.threads",
    "learn_from_plant": "acl_gym.model_based",
    "plant": "acl_gym.envs.plant",
    "set_num_threads": "acl_gym.utils.threads",
    "swarm": "acl_gym",  # a package, not a name in a module
    "value_iteration": "acl_gym.planning.value_iteration",
}

__all__ = [
    "ACL",
    "ActionGrid",
    "AntColonySystem",
    "AntSystem",
    "CSVLog",
    "Callback",
    "ChangingVectorEnv",
    "Checkpoint",
    "Constant",
    "Cost",
    "Crisp",
    "Deposit",
    "Discrete",
    "Drift",
    "EarlyStop",
    "Exponential",
    "FunctionCost",
    "FunctionDeposit",
    "Fuzzy",
    "Harmonic",
    "InnerLoop",
    "InterpolatedPolicy",
    "InverseCost",
    "Jump",
    "LearnedVectorEnv",
    "Linear",
    "MaxMinAntSystem",
    "Overshoot",
    "Partition",
    "PlantLearning",
    "PolicyCost",
    "PolicyEvaluation",
    "PolicyPrior",
    "PotentialPrior",
    "QLearning",
    "Quadratic",
    "Rank",
    "Return",
    "ReturningACL",
    "RiseTime",
    "Robustness",
    "ScaledObservation",
    "ScaledVectorObservation",
    "Schedule",
    "SettlingTime",
    "Shield",
    "SoftPolicy",
    "StageCosts",
    "Steps",
    "Sum",
    "TensorBoardLog",
    "Transitions",
    "TravellingSalesmanInstance",
    "UpdateRule",
    "VectorEnvAdapter",
    "WaitingVectorEnv",
    "Weighted",
    "WorkersVectorEnv",
    "__version__",
    "automatic_partition",
    "evaluate_over_range",
    "evaluate_policy_cost",
    "fuzzy_q_iteration",
    "get_num_threads",
    "learn_from_plant",
    "plant",
    "set_num_threads",
    "swarm",
    "value_iteration",
]

# The one name that needs it; without it, `from acl_gym import *` imports the others.
if find_spec("stable_baselines3") is None:
    __all__.remove("VectorEnvAdapter")

try:
    import_module("gymnasium")
except ImportError:  # `acl_gym.swarm` and `acl_gym.theory` work without it
    pass
else:
    from acl_gym.envs import register_environments

    register_environments()


def __getattr__(name: str) -> Any:
    if _PUBLIC.get(name) == __name__:
        return import_module(f"{__name__}.{name}")
    if name in _PUBLIC:
        return getattr(import_module(_PUBLIC[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *_PUBLIC])
