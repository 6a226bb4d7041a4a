"""Check the installed wheel; run with the interpreter of the environment it is in."""

import importlib.metadata
import sys
from pathlib import Path

import gymnasium as gym

import acl_gym
from acl_gym.reproduction.catalogue import EXPERIMENTS

package = Path(acl_gym.__file__).parent
if not package.is_relative_to(sys.prefix):
    sys.exit(f"expected acl_gym from {sys.prefix}, got {package}")

wheel = importlib.metadata.distribution("acl-gym")
if acl_gym.__version__ != wheel.version:
    sys.exit(f"acl_gym says {acl_gym.__version__}, its metadata {wheel.version}")

# Beside the package itself pip lists the metadata and the commands ("../../../bin").
top_levels = {file.parts[0] for file in wheel.files or ()}
strangers = {
    name
    for name in top_levels
    if name not in ("acl_gym", "..") and not name.endswith(".dist-info")
}
if strangers:
    sys.exit(f"expected only acl_gym in the wheel, found also {sorted(strangers)}")
if not (package / "py.typed").is_file():
    sys.exit("the wheel lacks acl_gym/py.typed, without which its types are not seen")

for template in ("experiments/templates/report", "reproduction/templates/page"):
    if not (package / f"{template}.html.j2").is_file():
        sys.exit(f"the wheel lacks acl_gym/{template}.html.j2, which a report needs")

# Reads what the searches for settings have found, which is data in the package.
names = {experiment.name for experiment in EXPERIMENTS}
if "versus-pendulum" not in names:
    sys.exit(f"expected versus-pendulum among the experiments, got {sorted(names)}")

env = gym.make("acl_gym/Pendulum-v0")
env.reset(seed=0)
env.step(env.action_space.sample())
env.close()
print(f"acl-gym {wheel.version} works as installed from its wheel")
