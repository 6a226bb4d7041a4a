"""Names of `acl_gym.swarm` that are imported on first use."""

from __future__ import annotations

import subprocess
import sys

import pytest

from acl_gym import swarm
from acl_gym.swarm import aggregation, pso


def test_every_public_name_is_there() -> None:
    for name in swarm.__all__:
        assert hasattr(swarm, name)
    assert set(swarm.__all__) <= set(dir(swarm))
    for name in swarm._LAZY:
        source = pso if hasattr(pso, name) else aggregation
        assert getattr(swarm, name) is getattr(source, name)
    assert {"AggregatingAgents", "Field", "flow", "minimize"} <= set(swarm._LAZY)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no_such_name"):
        swarm.no_such_name  # noqa: B018


def test_they_are_not_imported_before_and_never_import_gymnasium() -> None:
    code = """
import sys
sys.modules["gymnasium"] = None  # importing it raises
from acl_gym import swarm
print("acl_gym.swarm.pso" in sys.modules)
found = swarm.minimize(lambda x: (x * x).sum(axis=1), [(-1, 1)], seed=0)
print("acl_gym.swarm.pso" in sys.modules, found.fun < 1e-9)
print("acl_gym.swarm.aggregation" in sys.modules)
print(swarm.aggregation.Field is swarm.Field, swarm.pso.minimize is swarm.minimize)
"""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["False", "True", "True", "False", "True", "True"]
