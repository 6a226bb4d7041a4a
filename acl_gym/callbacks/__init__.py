"""What may happen between trials: your own function, or one of these objects."""

from acl_gym.callbacks.base import (
    Callback,
    Callbacks,
    Function,
    Row,
    as_callbacks,
    is_stop,
)
from acl_gym.callbacks.evaluation import EarlyStop, PolicyEvaluation
from acl_gym.callbacks.files import Checkpoint, CSVLog
from acl_gym.callbacks.tensorboard import TensorBoardLog

__all__ = [
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
