"""Make docs/figures/hero.gif: five ants learn to swing a pendulum up."""

from __future__ import annotations

import argparse
from pathlib import Path

import gymnasium as gym

from acl_gym import ReturningACL
from acl_gym.plotting import animate

OUT = Path(__file__).parent.parent / "docs" / "figures" / "hero.gif"

TRIALS = (0, 2, 3, 4, 5, 8, 16, 40)
"""The first policies differ most."""

SECONDS = 2.8
"""Just longer than the last policy takes."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=OUT, help="a .gif or .mp4 file")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=5)
    colony = ReturningACL(env, seed=options.seed)
    path = animate(colony, options.out, trials=TRIALS, seconds=SECONDS)
    print(f"{path}: {path.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
