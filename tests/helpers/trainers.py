"""The trainers of GelNet as parameters of a test; PyTorch's is judged at night."""

import pytest

from gelnet.trainers import NAMES

TRAINERS = [pytest.param(name, marks=[pytest.mark.nightly] if name == "torch" else []) for name in NAMES]
