"""What trains: NumPy, or PyTorch where a user asks for it, on the processor or on a GPU ("cuda").

Both train the same network by the same recipes, in a child process. NumPy takes less than half of the processor time,
and PyTorch has to be loaded first.
"""

import importlib.util
import logging
from typing import Literal

from gellight.base.errors import InputError

logger = logging.getLogger(__name__)

TrainerName = Literal["numpy", "torch", "cuda"]
RECIPES = ("fast", "thorough", "fine", "paper")


def checked_trainer(wanted: TrainerName) -> TrainerName:
    """Return what trains; InputError for a torch that is not installed."""
    installed = importlib.util.find_spec("torch") is not None
    if wanted != "numpy" and not installed:
        raise InputError("PyTorch is not installed: pip install torch, or train with numpy")
    logger.info("%s trains the network (PyTorch installed: %s)", wanted, installed)
    return wanted
