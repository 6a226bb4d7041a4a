"""The best agent of a run as a file: whether it belongs to the agent at hand."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from acl_gym.callbacks.base import Agent
from acl_gym.utils.archives import Archive
from acl_gym.utils.serialization import from_json
from acl_gym.utils.typing import Row


def row_of_saved_best(path: Path, agent: Agent) -> Row | None:
    """What was measured of the policy in a file, if it is an earlier state of an agent.

    Args:
        path: a file that `PolicyEvaluation(save_best=path)` may have written.
        agent: who continues learning.

    Returns:
        The last row of the history in the file, with `trial` and `policy_cost`; None if
        there is no such file, or it is of another environment or another run.
    """
    try:
        header = Archive(path).header
        saved = from_json(header["history"])[-1]
        metadata = from_json(header.get("metadata", {}))
        usable = math.isfinite(saved["policy_cost"])
        trial, env_id = saved["trial"], metadata.get("env_id")
    except (OSError, ValueError, TypeError, LookupError, AttributeError):
        return None  # whatever it is, it is not what was written here
    known = getattr(agent, "metadata", {}).get("env_id")
    same = header.get("agent") == type(agent).__name__ and env_id == known
    if not (usable and same):
        return None
    rows = (row for row in agent.history if row["trial"] == trial)
    return saved if any(_agree(row, saved) for row in rows) else None


def _agree(row: Row, saved: Row) -> bool:
    """Whether two rows are of one trial: a row may lack an evaluation, not differ."""
    return all(_equal(row[name], saved[name]) for name in row.keys() & saved.keys())


def _equal(one: Any, other: Any) -> bool:
    return bool(one == other or (one != one and other != other))  # NaN is not
