"""The same tasks on a Ray cluster: same code, same seeds, same bits."""

from __future__ import annotations

import logging
import platform
from typing import Any

from acl_gym.experiments.runner import Finished, Progress, Result, Task, TaskFailedError


def in_ray(tasks: list[Task], tell: Progress) -> Finished:
    """Run tasks on the cluster that this machine belongs to; an `Executor`.

    Every node needs the same version of this package. Results come back to the caller,
    who alone writes them.

    Raises:
        TaskFailedError: Ray is not installed, there is no cluster, a task failed, or
            its worker died.
    """
    try:
        import ray
    except ModuleNotFoundError as error:
        raise TaskFailedError(
            "the executor 'ray' needs Ray; pip install 'acl-gym[cluster]'."
        ) from error
    try:
        ray.init(address="auto", log_to_driver=False, logging_level=logging.ERROR)
    except ConnectionError as error:
        raise TaskFailedError(
            "there is no Ray cluster here; `ray start --head` makes one of this "
            "machine, `ray start --address=...` joins one."
        ) from error
    run: Any = ray.remote(num_cpus=1, max_retries=0)(_run)
    waiting = {run.remote(task, task.key): task for task in tasks}
    try:
        while waiting:
            done, _ = ray.wait(list(waiting), num_returns=1)
            for reference in done:
                task = waiting.pop(reference)
                try:
                    result = ray.get(reference)
                except ray.exceptions.RayError as error:
                    reason = str(error).strip().splitlines()[-1]
                    raise TaskFailedError(
                        f"{task.name} failed on the cluster: {reason}; what is "
                        "finished is kept, call again to go on."
                    ) from error
                yield task, result
    finally:
        for reference in waiting:
            ray.cancel(reference, force=True)
        ray.shutdown()


def _run(task: Task, key: str) -> Result:
    if task.key != key:  # it has the code and the versions of this node in it
        raise RuntimeError(
            f"node {platform.node()} must have the code and the package versions of the "
            "caller, but they differ; install the same there"
        )
    return task.function(*task.arguments, lambda fraction: None)
