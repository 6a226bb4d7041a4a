"""Stable-Baselines3: its interface for our environments, and its DQN."""
