"""Elementary functions that LLVM can vectorise, with bounded and tested errors."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic, overload

from acl_gym.utils.compiling import njit

# pi as the sum of two floats, the first with trailing zeros: n * PI_HIGH is exact for
# the small n that occur, which keeps the reduced argument of the sine accurate.
_PI_HIGH = 3.1415926218032837
_PI_LOW = 3.178650954705639e-08


@njit(inline="always")
def sine(x: float) -> float:
    """Sine without branches, so that LLVM vectorises the loop it is called in.

    The argument is reduced to [-pi/2, pi/2], where the Taylor series through r^19
    leaves 3e-16. Valid for |x| < 1e5; a test checks that the error is at most 1e-15 for
    |x| < 100.
    """
    # Numba's math.floor returns an integer, a conversion that is not vectorised.
    turns: float = np.floor(x * (1.0 / math.pi) + 0.5)
    r = (x - turns * _PI_HIGH) - turns * _PI_LOW
    sign: float = 1.0 - 2.0 * (turns - 2.0 * np.floor(0.5 * turns))
    s = r * r
    series = -8.22063524662433e-18
    series = series * s + 2.8114572543455206e-15
    series = series * s - 7.647163731819816e-13
    series = series * s + 1.6059043836821613e-10
    series = series * s - 2.505210838544172e-08
    series = series * s + 2.7557319223985893e-06
    series = series * s - 0.0001984126984126984
    series = series * s + 0.008333333333333333
    series = series * s - 0.16666666666666666
    return sign * (r + r * s * series)


# Adding this number leaves the nearest integer in the last bits of the sum.
_ROUNDING = 6755399441055744.0  # 1.5 * 2^52
_LOG2_E = 1.4426950408889634
# log(2) as the sum of two floats, the first with trailing zeros, as pi above.
_LOG_2_HIGH = 0.6931471803691238
_LOG_2_LOW = 1.9082149292705877e-10
_LOWEST_EXPONENT = -708.0  # exp of less is not a normal float


def _power_of_two(rounded: float) -> float:
    """2^n from n + _ROUNDING, for |n| < 1022; compiles to two integer operations."""
    return math.ldexp(1.0, int(rounded - _ROUNDING))


@intrinsic
def _move_to_exponent(_: Any, rounded: Any) -> Any:
    """Return the float whose exponent bits are the low bits of `rounded` plus 1023."""

    def code(context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        bits = builder.bitcast(args[0], context.get_value_type(types.int64))
        biased = builder.add(bits, context.get_constant(types.int64, 1023))
        exponent = builder.shl(biased, context.get_constant(types.int64, 52))
        return builder.bitcast(exponent, context.get_value_type(types.float64))

    return types.float64(types.float64), code


@overload(_power_of_two, inline="always")
def _compiled_power_of_two(rounded: Any) -> Any:
    def implementation(rounded: Any) -> Any:
        return _move_to_exponent(rounded)  # type: ignore[call-arg]

    return implementation


@njit(inline="always")
def exponential(x: float) -> float:
    """Exponential function without branches, so that LLVM vectorises its loop.

    exp(x) = 2^n exp(r), where |r| <= log(2) / 2 and the Taylor series through r^13
    leaves 4e-18. Valid for x <= 708, also for -inf; 0 below -708, where it is less
    than 4e-308. A test checks that the relative error is at most 1e-15.
    """
    bounded = max(x, _LOWEST_EXPONENT)
    rounded = bounded * _LOG2_E + _ROUNDING
    n = rounded - _ROUNDING
    r = (bounded - n * _LOG_2_HIGH) - n * _LOG_2_LOW
    series = 1.6059043836821613e-10
    series = series * r + 2.08767569878681e-09
    series = series * r + 2.505210838544172e-08
    series = series * r + 2.755731922398589e-07
    series = series * r + 2.7557319223985893e-06
    series = series * r + 2.48015873015873e-05
    series = series * r + 0.0001984126984126984
    series = series * r + 0.001388888888888889
    series = series * r + 0.008333333333333333
    series = series * r + 0.041666666666666664
    series = series * r + 0.16666666666666666
    series = series * r + 0.5
    value = (1.0 + (r + r * r * series)) * _power_of_two(rounded)
    return value if x >= _LOWEST_EXPONENT else 0.0
