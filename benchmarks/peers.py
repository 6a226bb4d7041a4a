"""The pendulums of EnvPool and gymnax, measured in a virtual environment of their own.

`make bench-peers` makes .venv-peers, because their dependencies conflict with those of
acl-gym. throughput.py runs this script there and reads the JSON that it prints: a list of
cases with `name`, `n_ants` and `rates`, the slot-steps per second of each repetition.
"""

import importlib.metadata
import json
import sys
import time
from collections.abc import Callable


def rates(work: Callable[[], int], repetitions: int) -> list[float]:
    """Slot-steps per second, after one repetition that is not counted."""
    work()
    results = []
    for _ in range(repetitions):
        start = time.perf_counter()
        steps = work()
        results.append(steps / (time.perf_counter() - start))
    return results


def envpool_pendulum(n: int) -> Callable[[], int]:
    """EnvPool in synchronous mode, with one thread."""
    import envpool
    import numpy as np

    env = envpool.make_gymnasium("Pendulum-v1", num_envs=n, num_threads=1, seed=0)
    env.reset()
    actions = np.random.default_rng(0).uniform(-2, 2, (20, n, 1)).astype(np.float32)

    def work() -> int:
        for row in actions:
            env.step(row)
        return 20 * n

    return work


def gymnax_pendulum(n: int) -> Callable[[], int]:
    """gymnax, vmapped and compiled, one call per step, on all cores of the CPU."""
    import gymnax
    import jax

    env, parameters = gymnax.make("Pendulum-v1")
    key = jax.random.PRNGKey(0)
    keys = jax.random.split(key, n)
    _, state = jax.vmap(env.reset, in_axes=(0, None))(keys, parameters)
    step = jax.jit(jax.vmap(env.step, in_axes=(0, 0, 0, None)))
    actions = jax.random.uniform(key, (n, 1), minval=-2.0, maxval=2.0)

    def work() -> int:
        nonlocal state
        for _ in range(100):
            result = jax.block_until_ready(step(keys, state, actions, parameters))
            state = result[1]
        return 100 * n

    return work


PEERS = {"envpool": envpool_pendulum, "gymnax": gymnax_pendulum}


def main() -> None:
    """Measure; the arguments are the numbers of slots and repetitions."""
    n, repetitions = int(sys.argv[1]), int(sys.argv[2])
    cases = []
    for name, make in PEERS.items():
        try:
            version = importlib.metadata.version(name)
            found = rates(make(n), repetitions)
        except (ImportError, RuntimeError, OSError) as error:
            print(f"{name} is left out: {error}", file=sys.stderr)
            continue
        cores = "all cores" if name == "gymnax" else "one thread"
        title = f"pendulum of {name} {version}, {n:,} slots, {cores}"
        cases.append({"name": title, "n_ants": n, "rates": found})
    print(json.dumps(cases))


if __name__ == "__main__":
    main()
