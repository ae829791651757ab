"""The watch on pictures of a real sensor whose LEDs it does not know: every press is a touch, and none is a fault."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gellight.bundle.bundle import write_bundle
from gellight.frames.frames import CameraFrame
from gellight.frames.image_files import read_image
from gellight.watch.monitor import PERIOD_S, SensorWatch
from tests.helpers.linear_sensor import linear_network
from tests.helpers.places import real

REAL = real("gelsight_mini_ball")
NOISE_GREY = 2.0


@pytest.mark.real_images("gelsight_mini_ball")
def test_real_presses_are_touches_and_no_faults(tmp_path: Path) -> None:
    untouched = read_image(REAL / "background.png")
    bundle = write_bundle(
        tmp_path / "bundle",
        sensor="mini",
        reference=untouched.astype(float),
        reference_frames=1,
        noise_grey=NOISE_GREY,
        pixel_size_mm=(0.0634, 0.0634),
        network=linear_network(),
        metrics={},
    )
    watch, random, states = SensorWatch(bundle), np.random.default_rng(6000), []
    presses = [path for path in sorted(REAL.glob("*.png")) if path.name != "background.png"]
    looks = 0
    for path in presses:
        noisy = np.clip(untouched + random.normal(0, NOISE_GREY, untouched.shape), 0, 255).astype(np.uint8)
        for image in [read_image(path)] * 2 + [noisy] * 2:
            looks += 1
            frame: Any = type("Frame", (), {"camera_frame": seen(image, looks), "measures": None})
            watch.note(frame)
            states.append(watch.status()["state"])
            assert watch.findings() == []
    assert len(presses) == 33
    assert states == ["touched", "touched", "at rest", "at rest"] * 33


def seen(image: np.ndarray, number: int) -> CameraFrame:
    return CameraFrame(image=image, time_s=number * PERIOD_S, sequence=number)
