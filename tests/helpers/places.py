"""Where the tests find what is not theirs: the checkout, and real images beside it."""

from pathlib import Path

CHECKOUT = Path(__file__).parents[2]
REAL_IMAGES = CHECKOUT.parent / "shared/data"
"""tactile images of real sensors, a folder a sensor; not part of the checkout"""
