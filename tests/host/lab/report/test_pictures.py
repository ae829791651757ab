"""Pictures of maps as files and in pages."""

import cv2
import numpy as np
import pytest

from gellight.lab.report.html import picture
from gellight.lab.report.pictures import encode_png, round_step


@pytest.mark.parametrize("shape", [(7, 5, 3), (7, 5)])
def test_a_png_holds_the_image(shape: tuple[int, ...]) -> None:
    image = np.random.default_rng(0).integers(0, 256, shape, dtype=np.uint8)
    read = cv2.imdecode(np.frombuffer(encode_png(image), np.uint8), cv2.IMREAD_UNCHANGED)
    assert ((read[..., ::-1] if len(shape) == 3 else read) == image).all()


def test_a_picture_needs_nothing_from_outside() -> None:
    figure = picture(np.zeros((2, 2), np.uint8), 'a "name"', 60)
    assert 'alt="a &quot;name&quot;"' in figure
    assert 'src="data:image/png;base64,' in figure


@pytest.mark.parametrize(
    ("span", "most", "step"), [(1000, 10, 100), (100, 6, 20), (0.03, 6, 0.005), (7, 6, 2), (1, 10, 0.1), (500, 10, 50)]
)
def test_steps_are_round(span: float, most: int, step: float) -> None:
    assert round_step(span, most) == pytest.approx(step)
