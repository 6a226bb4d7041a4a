"""Agents: the colony and the reinforcement-learning methods to compare it with."""
