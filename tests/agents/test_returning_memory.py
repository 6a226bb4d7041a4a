"""Many ants that walk long take the memory of what is remembered, not of all steps."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

TRIAL = """
import json, resource
import gymnasium as gym
from acl_gym import ReturningACL

def learn(ants):
    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=ants)
    colony = ReturningACL(env, max_steps=300, restart_after=300, walks_back=2, seed=0)
    colony.learn(trials=1)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss  # kilobytes
    return colony.num_timesteps, peak / 2**20

learn(50)  # compiles the kernels, which takes memory as well
print(json.dumps([learn(50), learn(100_000)]))
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="peaks have other units elsewhere")
def test_a_hundred_thousand_ants_of_three_hundred_steps() -> None:
    done = subprocess.run(
        [sys.executable, "-c", TRIAL], capture_output=True, text=True, check=True
    )
    (_, few), (steps, many) = json.loads(done.stdout)
    assert steps > 2_500_000
    # All observations of these steps alone would take 0.05 GiB; each step is remembered
    # with two states, since all ants walk back after each, of 73 bytes.
    assert many - few < 0.25
