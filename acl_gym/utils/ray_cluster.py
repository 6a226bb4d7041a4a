"""Finding the Ray cluster that this machine belongs to."""

from __future__ import annotations

import logging
from typing import Any


def connected_ray() -> tuple[Any, bool]:
    """Connect to a cluster.

    A connection that the caller has made by `ray.init` is used; else it is made to the
    cluster that runs on this machine.

    Returns:
        The module `ray`, and whether the connection was made now.

    Raises:
        ModuleNotFoundError: Ray is not installed.
        ConnectionError: there is no cluster.
    """
    try:
        import ray
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            "the executor 'ray' needs Ray; pip install 'acl-gym[cluster]'."
        ) from error
    if ray.is_initialized():
        return ray, False
    try:
        ray.init(address="auto", log_to_driver=False, logging_level=logging.ERROR)
    except ConnectionError as error:
        raise ConnectionError(
            "there is no Ray cluster here; `ray start --head` makes one of this "
            "machine, `ray start --address=...` joins one."
        ) from error
    return ray, True
