"""Particle swarm optimization, §6.3.2 of the thesis, in the framework of chapter 6.

`minimize` minimizes a function. Its parts are those of `acl_gym.swarm`: a `Landscape` is
the environment of a `ParticleSwarm`, and any `Channel` says who hears of whose best point.
`stability` has the theory, and docs/particle-swarms.md explains all of it.
"""

from acl_gym.swarm.pso.agents import ParticleSwarm
from acl_gym.swarm.pso.coefficients import constriction_coefficients
from acl_gym.swarm.pso.landscape import ExplosionError, Landscape
from acl_gym.swarm.pso.optimize import minimize
from acl_gym.swarm.pso.stability import (
    Moments,
    is_stable,
    largest_acceleration,
    position_moments,
    spectral_radius,
)

__all__ = [
    "ExplosionError",
    "Landscape",
    "Moments",
    "ParticleSwarm",
    "constriction_coefficients",
    "is_stable",
    "largest_acceleration",
    "minimize",
    "position_moments",
    "spectral_radius",
]
