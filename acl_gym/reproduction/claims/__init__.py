"""The claims of the thesis, C1 to C23, and how each is decided."""

from acl_gym.reproduction.claims import grids, navigation, pendulum, theory
from acl_gym.reproduction.verdicts import Claim

CLAIMS: tuple[Claim, ...] = (
    *grids.CLAIMS,
    *navigation.CLAIMS,
    *pendulum.CLAIMS,
    *theory.CLAIMS,
)
