"""Make docs/figures/environments/*.png: each environment as it renders itself.

Each picture shows a state in which there is something to see; `STATES` has them.

    python benchmarks/environment_pictures.py
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from PIL import Image

import acl_gym

OUT = Path(__file__).parent.parent / "docs" / "figures" / "environments"

STATES: dict[str, Any] = {
    "acl_gym/GridSearch1D-v0": 2,
    "acl_gym/GridSearch2D-v0": 70,
    "acl_gym/Pendulum-v0": [2.2, -3.0],
    "acl_gym/Navigation-v0": [-3.5, 0.8, -2.5, 1.0],
}
"""Where an episode begins; others begin anywhere."""

STEPS: dict[str, int] = {
    "acl_gym/DoubleBridge-v0": 4,
    "acl_gym/TravellingSalesman-v0": 30,
    "acl_gym/SwarmAggregation-v0": 8,
    "acl_gym/TwoState-v0": 1,
}
"""How many steps are made before the picture is taken, else 1."""


def picture(env_id: str, seed: int) -> np.ndarray[Any, Any]:
    env = gym.make(env_id, render_mode="rgb_array")
    options = {"state": STATES[env_id]} if env_id in STATES else None
    observation, info = env.reset(seed=seed, options=options)
    random = np.random.default_rng(seed)
    for _ in range(STEPS.get(env_id, 1)):
        allowed = info.get("action_mask", np.ones(env.action_space.n))
        choice = random.choice(np.flatnonzero(allowed))
        if env_id == "acl_gym/TravellingSalesman-v0":
            distances = env.unwrapped.system.instance.distances[observation]
            choice = np.argmin(np.where(allowed, distances, np.inf))  # the nearest city
        observation, *_, info = env.step(choice)
    frame = env.render()
    env.close()
    return np.asarray(frame)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=OUT, help="a folder")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
    options.out.mkdir(parents=True, exist_ok=True)
    for env_id in acl_gym.envs.ENVIRONMENTS:
        path = options.out / f"{env_id.partition('/')[2].lower()}.png"
        Image.fromarray(picture(env_id, options.seed)).save(path, optimize=True)
        print(f"{path}: {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
