"""What `acl-gym design --help` says, and the plants that are shipped as examples."""

from __future__ import annotations

from importlib.resources import files
from typing import Any

from acl_gym.cli.errors import Command

EXAMPLES = {
    "pendulum": "swing up a pendulum on a weak motor; seconds",
    "dc_motor": "turn the shaft of a geared motor to an angle, with friction; seconds",
    "two_tanks": "bring the second of two coupled tanks to a level; seconds",
    "cart_pole": "swing up a pole on a cart, four variables; most of a minute",
}

HELP = """Design a controller for a plant of yours, and say how good it is.

FILE describes the plant by equations (PLANT.py) or by measurements (DATA.csv).

PLANT.py is a Python file that calls acl_gym.plant(...) and keeps what it returns in a
name, such as env = acl_gym.plant(...); or defines make(num_envs), which returns it. The
file is run. A colony of ants then learns the plant until the goal is reached from 95% of
the starts and the cost no longer falls, or the time is up. There are as many ants as
num_envs= of the file says; 5, or 10 for three variables and more, if it is 1 or left out.

DATA.csv (or .parquet) has a row for each moment, and names of columns in its first row:
those of --state, and those of --input, which are held from one row to the next. A model
is fitted, ants learn in it, and the report shows where it is unsure.

The folder gets policy.h, the controller as C without any library; policy.npz, the same
for NumPy; report.html, one page with the policy, trajectories from a typical and the
worst start, and success, cost, settling time and overshoot over 1,000 random starts;
summary.json with the same figures; and the pictures as PNG.

The exit code is 1 if the goal is not reached from 95% of the starts, or if the model is
unsure almost everywhere; the folder is written all the same, with what to try. Ctrl-C
keeps the best controller so far.

\b
Examples:
  acl-gym design --show pendulum > my_plant.py    a file to begin with
  acl-gym design my_plant.py --out my_controller
  acl-gym design my_plant.py --seconds 300 --seed 1
  acl-gym design --example cart_pole
  acl-gym design DATA.csv --state theta,omega --circular theta --input u --time t
    --goal 3.1416,0 --tolerance 0.1,0.3 --cost 1,0.1:0.05
"""


class DesignCommand(Command):
    """Its help shows a complete file."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help."""
        names = [f"  {name:10} {words}" for name, words in EXAMPLES.items()]
        blocks = ["\n".join(["Plants for --example and --show:", *names])]
        indented = [f"  {line}".rstrip() for line in example("pendulum").splitlines()]
        blocks += ["A complete file, pendulum.py:"]
        blocks += "\n".join(indented).split("\n\n")
        self.epilog = "\n\n".join(f"\b\n{block.strip(chr(10))}" for block in blocks)
        super().format_help(ctx, formatter)


def example(name: str) -> str:
    """The text of an example."""
    return str(example_file(name).read_text(encoding="utf-8"))


def example_file(name: str) -> Any:
    """The file of an example, which may lie in an archive."""
    return files("acl_gym").joinpath("examples", f"{name}.py")
