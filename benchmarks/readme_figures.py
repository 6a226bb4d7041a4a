"""Print what the programs of README.md come to, with several seeds.

Each Python program of the README that learns is run with the seeds 0, 1, ... in place of
its own, and `acl-gym train` as the README calls it. Prints the cost of the last policy, the
share of starts that it brings to the goal, the interactions and the seconds of learning.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tqdm.auto import tqdm

from acl_gym import ReturningACL, evaluate_policy_cost
from acl_gym.utils.text import replace_unprintable_letters

README = Path(__file__).parent.parent / "README.md"
SEED = re.compile(r"(?<=seed=)0(?=\))")
SHELL = "acl-gym train acl_gym/Pendulum-v0 --trials 40"


def programs() -> dict[str, str]:
    """The programs that learn, by the heading under which they stand."""
    found, heading, text = {}, "", README.read_text(encoding="utf-8")
    for part in re.split(r"^(?=## )", text, flags=re.MULTILINE):
        heading = part.splitlines()[0].removeprefix("## ")
        for block in re.findall(r"```python\n(.*?)```", part, flags=re.DOTALL):
            if ".learn(" in block and "ReturningACL(" in block:
                found[heading] = block
    return found


def measured(program: str, seed: int) -> tuple[float, float, int, float]:
    """Cost, success rate, interactions and seconds of one run of a program."""
    with contextlib.redirect_stdout(io.StringIO()):
        names: dict[str, Any] = {}
        exec(compile(SEED.sub(str(seed), program), str(README), "exec"), names)
    colony = names["colony"]
    result = names.get("result") or evaluate_policy_cost(colony, names["env"])
    return result.cost, result.success_rate, colony.num_timesteps, colony.seconds


def from_the_shell(seed: int) -> tuple[float, float, int, float]:
    """The same of `acl-gym train`, with its default number of ants."""
    import gymnasium as gym

    env = gym.make_vec("acl_gym/Pendulum-v0", num_envs=5)
    colony = ReturningACL(env, seed=seed).learn(trials=40)
    result = evaluate_policy_cost(colony, env)
    return result.cost, result.success_rate, colony.num_timesteps, colony.seconds


def rows(seeds: int) -> Iterator[str]:
    """The lines of the table."""
    yield "| program | seed | cost | success | interactions | seconds |"
    yield "| --- | ---: | ---: | ---: | ---: | ---: |"
    for heading, program in programs().items():
        for seed in tqdm(range(seeds), desc=heading, leave=False):
            cost, success, steps, seconds = measured(program, seed)
            yield (
                f"| {heading} | {seed} | {cost:.1f} | {success:.0%} | {steps:,} "
                f"| {seconds:.2f} |"
            )
    for seed in tqdm(range(seeds), desc=SHELL, leave=False):
        cost, success, steps, seconds = from_the_shell(seed)
        yield (
            f"| `{SHELL}` | {seed} | {cost:.1f} | {success:.0%} | {steps:,} "
            f"| {seconds:.2f} |"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=5, help="runs of each program")
    options = parser.parse_args()
    if options.seeds < 1:
        parser.error(f"--seeds must be at least 1, got {options.seeds}.")
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        for row in rows(options.seeds):
            print(row, flush=True)


if __name__ == "__main__":
    replace_unprintable_letters()
    main()
