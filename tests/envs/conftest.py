"""Fixtures of the environments' tests."""

import pytest

from tests.envs.vector_helpers import MODES


@pytest.fixture(params=MODES)
def mode(request: pytest.FixtureRequest) -> str:
    """Each autoreset mode of Gymnasium, as `make_vec` passes it."""
    return str(request.param)
