"""Names of `acl_gym.swarm` that are imported on first use."""

from __future__ import annotations

import subprocess
import sys
from importlib import import_module

import pytest

from acl_gym import swarm


def test_every_public_name_is_there() -> None:
    for name in swarm.__all__:
        assert hasattr(swarm, name)
    assert set(swarm.__all__) <= set(dir(swarm))
    for name, module in swarm._LAZY.items():
        assert getattr(swarm, name) is getattr(import_module(module), name)


def test_the_packages_are_attributes() -> None:
    code = """
import acl_gym.swarm as s
assert s.pso.minimize is s.minimize
assert s.aggregation.Field is s.Field
"""
    assert "aggregation" in swarm.__doc__
    subprocess.run([sys.executable, "-c", code], check=True)


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
