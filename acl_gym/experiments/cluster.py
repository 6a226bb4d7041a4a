"""The same runs on a Ray cluster: same code, same seeds, same bits."""

from __future__ import annotations

import platform
from typing import Any

from acl_gym.experiments.executors import Finished, RunFailedError, write_run
from acl_gym.experiments.methods import run as run_study
from acl_gym.experiments.provenance import circumstances
from acl_gym.experiments.results import Run
from acl_gym.experiments.store import Job, Store
from acl_gym.utils.ray_cluster import connected_ray


def in_ray(jobs: list[Job], store: Store) -> Finished:
    """Make runs on the cluster that this machine belongs to; an `Executor`.

    Every node needs the same version of this package. Runs come back to the caller, who
    alone writes them.

    Raises:
        RunFailedError: Ray is not installed, there is no cluster, a run failed, or its
            worker died.
    """
    try:
        ray, made_now = connected_ray()
    except (ModuleNotFoundError, ConnectionError) as error:
        raise RunFailedError(str(error)) from error
    run: Any = ray.remote(num_cpus=1, max_retries=0)(_run)
    under_way = {run.remote(job, job.key): job for job in jobs}
    resources = ray.cluster_resources()
    made = circumstances(int(resources.get("CPU", 1)))
    try:
        while under_way:
            done, _ = ray.wait(list(under_way), num_returns=1)
            for reference in done:
                job = under_way.pop(reference)
                try:
                    found = ray.get(reference)
                except ray.exceptions.RayError as error:
                    reason = str(error).strip().splitlines()[-1]
                    raise RunFailedError(
                        f"{job.name} failed on the cluster: {reason}; what is finished "
                        "is kept, call again to go on."
                    ) from error
                write_run(job, found, store, made)
                yield job
    finally:
        for reference in under_way:
            ray.cancel(reference, force=True)
        if made_now:
            ray.shutdown()


def _run(job: Job, key: str) -> Run:
    if job.key != key:  # it has the code and the versions of this node in it
        raise RuntimeError(
            f"node {platform.node()} must have the code and the package versions of the "
            "caller, but they differ; install the same there"
        )
    return run_study(job.study, job.seed)
