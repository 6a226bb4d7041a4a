"""Callbacks of `learn`: evaluation, early stopping, files and TensorBoard."""

from acl_gym.callbacks.base import (
    Agent,
    Callback,
    Callbacks,
    Function,
    as_callbacks,
    is_stop,
)
from acl_gym.callbacks.evaluation import EarlyStop, PolicyEvaluation
from acl_gym.callbacks.files import Checkpoint, CSVLog
from acl_gym.callbacks.tensorboard import TensorBoardLog
from acl_gym.utils.typing import Row

__all__ = [
    "Agent",
    "CSVLog",
    "Callback",
    "Callbacks",
    "Checkpoint",
    "EarlyStop",
    "Function",
    "PolicyEvaluation",
    "Row",
    "TensorBoardLog",
    "as_callbacks",
    "is_stop",
]
