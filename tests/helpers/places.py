"""Where the tests find what is not theirs: the checkout, and real images beside it."""

from pathlib import Path

CHECKOUT = Path(__file__).parents[2]
REAL_CROPS = CHECKOUT / "tests/data/real"
"""crops of such images that may be passed on; tests/data/real/README.md says where they come from"""
REAL_IMAGES = CHECKOUT.parent / "shared/data"
"""tactile images of real sensors, a folder a sensor; not part of the checkout"""
