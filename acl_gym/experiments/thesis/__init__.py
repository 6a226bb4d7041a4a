"""The experiments of the thesis by chapter, each with its claims and what was tried.

The parameters are those of Tables 4.1 and 5.2; what the thesis leaves open is decided in
`experiments.systems`, and said in the text of the experiment.
"""

from typing import Any

from acl_gym.experiments.claims import Claim
from acl_gym.experiments.study import Experiment
from acl_gym.experiments.thesis import (
    chapter3,
    chapter3_claims,
    chapter4,
    chapter5,
    chapter5_claims,
    chapter6,
    chapter6_claims,
    theory,
)
from acl_gym.experiments.thesis.common import FEWER

__all__ = ["CLAIMS", "EXPERIMENTS", "FEWER", "RUNS"]

RUNS = 30
"""Runs of each study, as in the thesis; their seeds are 0 to 29."""

EXPERIMENTS: tuple[Experiment[Any], ...] = (
    *theory.EXPERIMENTS,
    *chapter3.EXPERIMENTS,
    *chapter4.EXPERIMENTS,
    *chapter5.EXPERIMENTS,
    *chapter6.EXPERIMENTS,
)
"""What `acl-gym reproduce` can run of the thesis, with what was tried beside it."""

CLAIMS: tuple[Claim, ...] = (
    *chapter3_claims.CLAIMS,
    *chapter4.CLAIMS,
    *chapter5_claims.CLAIMS,
    *theory.CLAIMS,
    *chapter6_claims.CLAIMS,
)
"""The claims of the thesis, C1 to C34, each with the statements that decide it."""
