"""A controller from the description of a plant, with a page that says how good it is.

The command `acl-gym design` calls `design`.
"""

from acl_gym.design.plants import PlantFileError, load_plant
from acl_gym.design.run import Design, design

__all__ = ["Design", "PlantFileError", "design", "load_plant"]
