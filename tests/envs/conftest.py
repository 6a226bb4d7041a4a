"""Fixtures of the environments' tests."""

import pytest

from tests.envs.systems import SYSTEMS, SystemCase, by_id
from tests.envs.vector_helpers import MODES


@pytest.fixture(params=MODES)
def mode(request: pytest.FixtureRequest) -> str:
    """Each autoreset mode of Gymnasium, as `make_vec` passes it."""
    return str(request.param)


@pytest.fixture(params=SYSTEMS, ids=by_id)
def case(request: pytest.FixtureRequest) -> SystemCase:
    """Each system."""
    assert isinstance(request.param, SystemCase)
    return request.param
