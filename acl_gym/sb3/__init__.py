"""Stable-Baselines3: an adapter for vector environments, and its DQN.

Nothing else in this package needs Stable-Baselines3 and torch, so that it also works
where they are missing.
"""

try:
    import stable_baselines3 as _  # noqa: F401
except ImportError as error:
    raise ModuleNotFoundError(
        "VectorEnvAdapter and DQN need Stable-Baselines3 and torch, which cannot be "
        f"imported ({error}); run `pip install stable-baselines3 torch`."
    ) from error
