"""Every experiment of chapters 3 to 5, as data: adding one is adding an entry.

Parameters are those of Tables 4.1 and 5.2; what the thesis leaves open is decided in
`systems`, and said in the text of the experiment.
"""

from acl_gym.reproduction.catalogue import beside, grids, navigation, pendulum, versus
from acl_gym.reproduction.settings import Experiment

RUNS = 30
"""Runs of each setting, as in the thesis; their seeds are 0 to 29."""

EXPERIMENTS: tuple[Experiment, ...] = (
    *grids.EXPERIMENTS,
    *navigation.EXPERIMENTS,
    *pendulum.EXPERIMENTS,
    *beside.EXPERIMENTS,
    *versus.EXPERIMENTS,
)

BY_NAME = {experiment.name: experiment for experiment in EXPERIMENTS}
