"""Stable-Baselines3: an adapter for vector environments, and its DQN."""
