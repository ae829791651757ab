"""Where the tests find what is not theirs: the checkout, and pictures of real sensors."""

from pathlib import Path

import pytest
from _pytest.mark.structures import ParameterSet

CHECKOUT = Path(__file__).parents[2]
REAL_CROPS = CHECKOUT / "tests/data/real"
"""pictures that may be passed on, a folder a sensor; tests/data/real/README.md says where they come from"""
REAL_IMAGES = CHECKOUT.parent / "shared/data"
"""pictures of real sensors, a folder a sensor; not part of the checkout"""
FETCHED = CHECKOUT / "tests/data/fetched"
"""where `python -m tests.data.fetch` puts them"""


def real(name: str) -> Path:
    """Return the folder of a real sensor's pictures; where there is none, the one that they are fetched into."""
    beside = REAL_IMAGES / name
    return beside if beside.is_dir() else FETCHED / name


def is_here(name: str) -> bool:
    """Say whether the pictures of a real sensor are on this computer."""
    return real(name).is_dir()


def real_picture(name: str) -> Path:
    """Return a picture, FOLDER/FILE: a crop that comes along, or one of a real sensor."""
    folder, file = name.split("/")
    return crop if (crop := REAL_CROPS / name).exists() else real(folder) / file


def of_real(name: str) -> ParameterSet:
    """Return a parameter, FOLDER/FILE, of a test that is left out where these pictures are not on this computer."""
    return pytest.param(name, marks=pytest.mark.real_images(name.split("/")[0]))
