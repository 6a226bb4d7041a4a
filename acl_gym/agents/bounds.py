"""The bound on tau0 that keeps pheromone levels from falling below it."""

from __future__ import annotations

import math
import warnings
from typing import Any

from acl_gym.colony.deposits import Deposit, InverseCost
from acl_gym.envs.control.environments import ControlVectorEnv


class PheromoneBoundWarning(UserWarning):
    """tau0 exceeds 1 / J_max, so levels may fall below it (Proposition 4.3)."""


def warn_if_tau0_is_high(
    tau0: float, env: Any, max_steps: int, deposit: Deposit, *, stacklevel: int
) -> None:
    """Compare tau0 with Proposition 4.3 where J_max of the environment is known.

    The proposition asks for tau0 <= rho / J_max, but its proof needs no more than
    tau0 <= 1 / J_max: the level after a deposit is at least
    (1 - rho I) tau0 + rho I / J_max. Table 5.2 satisfies the latter, not the former,
    so the latter is what is checked.
    """
    base = getattr(env, "unwrapped", None)
    if not (isinstance(base, ControlVectorEnv) and isinstance(deposit, InverseCost)):
        return
    highest_cost = max_steps * base.system.max_stage_cost + deposit.offset
    bound = 1.0 / highest_cost
    if tau0 > bound:
        digit = 10.0 ** math.floor(math.log10(bound))
        warnings.warn(
            f"tau0 = {tau0:g} exceeds 1 / J_max = {bound:.3g} (J_max <= "
            f"{highest_cost:.4g} on this environment), so pheromone levels may "
            "fall below tau0 (Proposition 4.3); a tau0 of at most "
            f"{math.floor(bound / digit) * digit:.0e} rules that out.",
            PheromoneBoundWarning,
            stacklevel=stacklevel,
        )
