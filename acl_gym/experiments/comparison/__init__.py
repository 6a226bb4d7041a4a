"""Methods against methods: the systems as they are, harder tasks, and tuning."""

from acl_gym.experiments.comparison.experiments import EXPERIMENTS

__all__ = ["EXPERIMENTS"]
