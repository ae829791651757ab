"""The scenes that are timed are what they say."""

import pytest

from gellight.bundle.bundle import load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame
from tests.benchmarks import frame_times as timing


def test_the_scenes_touch_what_they_say() -> None:
    synthetic = load_bundle("synthetic")
    for bundle, of_steep in ((synthetic, 0.0355), (timing.halved(synthetic), 0.0407)):
        reconstructor = Reconstructor(bundle)
        shares, single = [], []
        for image in timing.scenes(bundle).values():
            frame = reconstructor.reconstruct(CameraFrame(image=image, time_s=0.0, sequence=0))
            shares.append(float(reconstructor.touched(frame.difference).mean()))
            single.append(reconstructor.network_rows.pixels / image[..., 0].size)
        assert shares == pytest.approx([0, 0.21, 1, 1], abs=0.04)
        assert max(single[:3]) < 0.002
        assert single[3] == pytest.approx(of_steep, abs=0.004)
