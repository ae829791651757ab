"""The times of the frame path: of the scenes they name, in both sizes, and of a real press."""

from pathlib import Path

import pytest

from gellight.bundle.bundle import load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame
from gellight.reconstruction.stages import STAGES
from tests.benchmarks import frame_times as timing
from tests.helpers.linear_sensor import linear_bundle, tanh_network
from tests.helpers.places import REAL_CROPS


@pytest.mark.nightly
def test_all_scenes_and_a_real_press_are_timed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As `make bench` does: the real gel's pictures have another size than the bundle's."""
    linear_bundle(tmp_path / "b", (120, 160), network=tanh_network(8))
    press, untouched = (str(REAL_CROPS / "three_lights" / name) for name in ("press.png", "untouched.png"))
    given = ["--calibration", str(tmp_path / "b"), "--rounds", "3"]
    timing.main([*given, "--press", press, "--untouched", untouched])
    printed = capsys.readouterr().out
    sized = ("at rest, 160 x 120 px", "ball, 80 x 60 px", "all touched, steep", "press, 306 x 230")
    others = ("form cells", timing.USUAL)
    assert [word for word in (*STAGES, *others, *sized, "x the whole frame") if word not in printed] == []


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
