"""What the methods are held against: the best cost that dynamic programming finds."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from acl_gym.evaluation import evaluate_policy_cost
from acl_gym.planning.q_iteration import fuzzy_q_iteration
from acl_gym.planning.value_iteration import value_iteration
from acl_gym.reproduction.settings import Learner, Result
from acl_gym.reproduction.versus.arena import Arena


@dataclass(frozen=True)
class Reference:
    """Value iteration where states are cells, else fuzzy Q-iteration on fine cells.

    Attributes:
        arena: without a veil, and judged by the stage costs.
        preset: of the course; says how fine the cells are.
    """

    arena: Arena
    preset: str = "quick"

    most_runs: ClassVar[int | None] = 1
    system: ClassVar[str] = "versus-reference"

    def __post_init__(self) -> None:
        if self.arena.veil or self.arena.judged_by is not None:
            raise ValueError(
                "a reference needs an arena without a veil and judged by its stage "
                f"costs, got {self.arena}."
            )

    @property
    def about(self) -> dict[str, Any]:
        """All that the result depends on."""
        return {**asdict(self), "reference": True}

    @cached_property
    def key(self) -> str:
        """Names it by what is in it."""
        text = json.dumps(self.about, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:12]

    @property
    def name(self) -> str:
        """J*, or what there is in its place."""
        return "J*" if self.arena.course.optimum else "best known cost"

    @property
    def text(self) -> str:
        """How it is found."""
        make = self.arena.course.budgets[self.preset].reference
        if make is None:
            return "value iteration on the exact model"
        cells = " x ".join(str(len(line)) for line in make().centres)
        return f"fuzzy Q-iteration on {cells} cells, which knows the model"

    @property
    def kernels(self) -> tuple[Any, ...]:
        """See `Runnable`."""
        return self.arena.env_id, "reference"

    def brief(self) -> Reference:
        """On coarse cells."""
        return replace(self, preset="smoke")

    @property
    def learner(self) -> Learner:
        """See `find`."""
        return find

    def along(
        self, runs: Sequence[dict[str, Any]], measure: str
    ) -> NDArray[np.float64]:
        """The one value."""
        return np.array([run["rows"][measure] for run in runs])

    def positions(self) -> list[int]:
        """Learns nothing."""
        return [0]


def find(reference: Reference, seed: int, report: Callable[[float], None]) -> Result:
    """Find the cost of the best policy; no seed matters.

    Returns:
        What `contest.learn` does, with one row.
    """
    env = reference.arena.base(1)
    make = reference.arena.course.budgets[reference.preset].reference
    if make is None:
        exact = value_iteration(env)
        starts = env.system.evaluation_states()[:, 0].astype(np.int64)
        cost, success = float(-exact.values[starts].mean()), 1.0
    else:
        # Coarse cells are only tried out: a few sweeps are enough for that.
        sweeps = 5 if reference.preset == "smoke" else 1_000
        found = fuzzy_q_iteration(env, make(), max_iterations=sweeps)
        result = evaluate_policy_cost(found.policy, env)
        cost, success = result.cost, result.success_rate
    row = {
        "env_steps": 0.0,
        "seconds": 0.0,
        "policy_cost": cost,
        "success_rate": success,
    }
    return {
        "rows": {name: [value] for name, value in row.items()},
        "levels": np.empty(0),
        "seconds": 0.0,
    }
