"""The benchmarks' figures look like those of the package."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl

import acl_gym

WIDTH = 7.2
"""Inches, the text width of a page."""

_STYLE = Path(acl_gym.__file__).parent / "experiments/plots/acl_gym.mplstyle"

in_style = mpl.rc_context(fname=_STYLE)
"""Decorates a function that draws."""
