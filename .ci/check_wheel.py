"""Check the installed wheel; run with the interpreter of the environment it is in."""

import importlib.metadata
import re
import subprocess
import sys
from pathlib import Path

import gymnasium as gym

import acl_gym

SUFFIXES = {
    *(".py", ".typed", ".j2", ".json", ".mplstyle", ".toml", ".tour", ".tsp", ".txt")
}
LARGEST = 100_000  # bytes; logs, results and figures do not belong in the wheel

package = Path(acl_gym.__file__).parent
if not package.is_relative_to(sys.prefix):
    sys.exit(f"expected acl_gym from {sys.prefix}, got {package}")

wheel = importlib.metadata.distribution("acl-gym")
if acl_gym.__version__ != wheel.version:
    sys.exit(f"acl_gym has version {acl_gym.__version__}, its metadata {wheel.version}")

# Beside the package itself pip lists the metadata and the commands ("../../../bin").
files = [file for file in wheel.files or () if file.parts[0] == "acl_gym"]
strangers = {
    file.parts[0]
    for file in wheel.files or ()
    if file.parts[0] not in ("acl_gym", "..")
    and not file.parts[0].endswith(".dist-info")
}
if strangers:
    sys.exit(f"expected only acl_gym in the wheel, found also {sorted(strangers)}")

for file in files:
    if file.suffix in SUFFIXES and (file.size or 0) <= LARGEST:
        continue
    if "__pycache__" not in file.parts:
        sys.exit(f"{file} ({file.size} bytes) is not a file that users need to run")

# Templates, styles, maps and settings: all that the sources have.
source = Path(__file__).resolve().parents[1] / "acl_gym"
wanted = {
    path.relative_to(source.parent).as_posix()
    for path in source.rglob("*")
    if path.suffix in SUFFIXES
}
if missing := wanted - {file.as_posix() for file in files}:
    sys.exit(f"the wheel lacks {sorted(missing)}")

# Reads the experiments and their settings, which are data in the package.
command = [str(Path(sys.prefix, "bin", "acl-gym")), "reproduce", "--list"]
listed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
if "versus-pendulum" not in listed:
    sys.exit(f"expected versus-pendulum among the experiments, got:\n{listed}")

# PyPI shows the README, where links into the project lead nowhere.
links = re.findall(r"\]\(([^)]+)\)", wheel.metadata["Description"])
if not links or not all(link.startswith(("https:", "#")) for link in links):
    sys.exit(f"expected complete addresses in the description, got {links}")
if not wheel.metadata.get_all("Project-URL"):
    sys.exit("the metadata names no address of the project")

env = gym.make("acl_gym/Pendulum-v0")
env.reset(seed=0)
env.step(env.action_space.sample())
env.close()
print(f"acl-gym {wheel.version} works as installed from its wheel")
