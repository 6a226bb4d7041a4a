"""Greedy policies as files that need nothing of this package: NumPy arrays, C code."""

from acl_gym.export.c_header import write_c_header
from acl_gym.export.numpy_file import write_numpy_file
from acl_gym.export.source import Source

__all__ = ["Source", "write_c_header", "write_numpy_file"]
