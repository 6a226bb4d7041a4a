"""Which agents are near each other, found with SciPy's k-d tree."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial import cKDTree

from acl_gym.utils import validation
from acl_gym.utils.compiling import njit
from acl_gym.utils.typing import FloatArray, IntArray

_SLIGHTLY = 1.0 + 1e-9
"""More than by what the tree's distances and ours differ."""

_MANY = 10_000
"""Agents from which on pairs are counted before they are listed."""


def within_radius(
    x: FloatArray, sigma: FloatArray, include_self: bool
) -> tuple[IntArray, IntArray]:
    """For each agent i all agents j with |x_i - x_j| < sigma_i.

    Args:
        x: positions, `(n, dim)`, as `checked_positions` returns them.
        sigma: radii, `(n,)`, >= 0 or infinite.
        include_self: whether j may be i.

    Returns:
        The senders j of each receiver i in ascending order, and where those of each
        receiver begin, `(n + 1,)`.

    Raises:
        ValueError: no memory is large enough for them.
    """
    receiver, sender = _candidates(x, sigma)
    if include_self:
        themselves = np.arange(len(x))
        receiver = np.concatenate([receiver, themselves])
        sender = np.concatenate([sender, themselves])
    return _transposed(*_heard_by(x, sigma, receiver, sender))


def nearest(x: FloatArray, k: int, include_self: bool) -> tuple[IntArray, IntArray]:
    """For each agent the k others that are nearest to it; of ties, any.

    Args:
        x: positions, `(n, dim)`, as `checked_positions` returns them, of more than k
            agents.
        k: how many, >= 1.
        include_self: whether to add the agent itself.

    Returns:
        See `within_radius`.

    Raises:
        ValueError: no memory is large enough for them.
    """
    n = len(x)
    validation.check_memory(
        f"the {k} nearest of {n:,} agents", 40 * n * (k + 1), "use a smaller k"
    )
    _, found = cKDTree(x).query(x, k + 1)
    found = np.asarray(found, np.int64)
    others = found != np.arange(n)[:, None]
    # Where more than k others are in the same place, the agent itself may be missing.
    missing = np.flatnonzero(others.all(axis=1))
    found[missing, k], others[missing, k] = missing, False
    if not include_self:
        found = found[others].reshape(n, k)
    found.sort(axis=1)
    return found.reshape(-1), np.arange(n + 1) * found.shape[1]


def _candidates(x: FloatArray, sigma: FloatArray) -> tuple[IntArray, IntArray]:
    """All receivers and senders, in any order, where one may hear another, and more."""
    tree = cKDTree(x)
    # Beyond all agents; a radius may be infinite.
    farthest = 2.0 * float(np.linalg.norm(np.ptp(x, axis=0)))
    radius = np.minimum(sigma, farthest) * _SLIGHTLY
    largest = float(radius.max())
    if largest <= 2.0 * radius.min():
        _check_room(tree, tree, largest)
        pairs = tree.query_pairs(largest, output_type="ndarray")
        return pairs.reshape(-1), pairs[:, ::-1].reshape(-1)
    # One large radius must not make all others look as far. So agents search in groups
    # whose radii differ by a factor of two at most.
    _, group = np.frexp(radius)
    parts = []
    for size in np.unique(group[radius > 0.0]):
        agents = np.flatnonzero((group == size) & (radius > 0.0))
        searching, reach = cKDTree(x[agents]), float(radius[agents].max())
        _check_room(searching, tree, reach)
        near = searching.sparse_distance_matrix(tree, reach, output_type="ndarray")
        parts.append((agents[near["i"]], near["j"].astype(np.int64)))
    receiver = np.concatenate([each for each, _ in parts])
    sender = np.concatenate([each for _, each in parts])
    others = receiver != sender
    return receiver[others], sender[others]


def _check_room(searching: cKDTree, tree: cKDTree, radius: float) -> None:
    if searching.n * tree.n >= _MANY**2:
        n_links = int(searching.count_neighbors(tree, radius))
        validation.check_memory(
            f"{n_links:,} links", 64 * n_links, "use a smaller radius or fewer agents"
        )


@njit
def _heard_by(
    x: FloatArray, sigma: FloatArray, receiver: IntArray, sender: IntArray
) -> tuple[IntArray, IntArray]:
    """The receivers of each sender that are within their radius of it, in any order."""
    n, n_links = len(x), 0
    begin = np.zeros(n + 1, np.int64)
    near = np.empty((2, receiver.size), np.int64)
    for link in range(receiver.size):
        i, j = receiver[link], sender[link]
        square = 0.0
        for axis in range(x.shape[1]):
            square += (x[i, axis] - x[j, axis]) ** 2
        if math.sqrt(square) < sigma[i]:
            near[0, n_links], near[1, n_links] = i, j
            n_links += 1
            begin[j + 1] += 1
    for j in range(n):
        begin[j + 1] += begin[j]
    free = begin.copy()
    receivers = np.empty(n_links, np.int64)
    for link in range(n_links):
        j = near[1, link]
        receivers[free[j]] = near[0, link]
        free[j] += 1
    return receivers, begin


@njit
def _transposed(receivers: IntArray, begin: IntArray) -> tuple[IntArray, IntArray]:
    """The senders of each receiver, in ascending order."""
    n = begin.size - 1
    offsets = np.zeros(n + 1, np.int64)
    for i in receivers:
        offsets[i + 1] += 1
    for i in range(n):
        offsets[i + 1] += offsets[i]
    free = offsets[:-1].copy()
    senders = np.empty_like(receivers)
    for j in range(n):
        for link in range(begin[j], begin[j + 1]):
            i = receivers[link]
            senders[free[i]] = j
            free[i] += 1
    return senders, offsets
