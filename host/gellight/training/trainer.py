"""What trains: PyTorch where it is installed, NumPy everywhere else.

Both train the same network by the same recipes, in a child process. This is the one place that chooses between them.
"""

import importlib.util
import logging
from typing import Literal

from gellight.base.errors import InputError

logger = logging.getLogger(__name__)

TrainerName = Literal["auto", "torch", "numpy"]


def chosen_trainer(wanted: TrainerName) -> Literal["torch", "numpy"]:
    """Return what trains; "auto" is torch where it is installed. InputError for a torch that is not."""
    installed = importlib.util.find_spec("torch") is not None
    if wanted == "torch" and not installed:
        raise InputError('PyTorch is not installed: pip install "gellight[torch]", or train with numpy')
    chosen: Literal["torch", "numpy"] = "torch" if installed and wanted != "numpy" else "numpy"
    logger.info("%s trains the network (asked for: %s; PyTorch installed: %s)", chosen, wanted, installed)
    return chosen
