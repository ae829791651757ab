"""The times of the frame path: measured side by side, of the scenes they name, in both sizes."""

import itertools
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from gellight.bundle.bundle import Bundle, load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame
from gellight.frames.image_files import read_image
from gellight.reconstruction.stages import STAGES
from tests.benchmarks import frame_times as timing
from tests.benchmarks.frame_times import (
    NETWORK_BLOCKS,
    NETWORK_ONE_BATCH,
    USUAL,
    Machine,
    Times,
    frame_times,
    network_flops,
)
from tests.helpers.linear_sensor import linear_bundle, linear_network, tanh_network
from tests.helpers.places import REAL_CROPS

OTHERS = ("form cells", "form pixels", NETWORK_ONE_BATCH, NETWORK_BLOCKS, USUAL)


@pytest.fixture
def bundle(tmp_path: Path) -> Bundle:
    return linear_bundle(tmp_path / "b", (120, 160), network=tanh_network(8))


def test_both_sizes_and_all_scenes_are_timed(bundle: Bundle) -> None:
    press = timing.scenes(bundle)["ball"]
    found = frame_times(bundle, rounds=1, press=press)
    scenes = ["at rest", "ball", "all touched, smooth", "all touched, steep"]
    assert [(t.image_width_px, t.scene) for t in found] == [
        *((160, scene) for scene in scenes),
        *((80, scene) for scene in scenes),
        (160, "press"),
    ]
    for times in found:
        assert tuple(times.stages) == STAGES
        assert tuple(times.others) == tuple(times.ratios) == OTHERS


def test_the_press_of_a_clone_is_timed_in_its_own_size(bundle: Bundle) -> None:
    """What `make bench` gives: a real gel, whose pictures have another size than the bundle's."""
    press, untouched = (read_image(REAL_CROPS / "three_lights" / name) for name in ("press.png", "untouched.png"))
    found = frame_times(bundle, rounds=1, press=press, untouched=untouched)[-1]
    assert (found.scene, found.image_width_px, found.image_height_px) == ("press", 306, 230)
    assert found.touched > 0.05


def test_the_scenes_touch_what_they_say() -> None:
    synthetic = load_bundle("synthetic")
    for bundle, of_steep in ((synthetic, 0.0134), (timing.halved(synthetic), 0.0155)):
        reconstructor = Reconstructor(bundle)
        shares, single = [], []
        for image in timing.scenes(bundle).values():
            frame = reconstructor.reconstruct(CameraFrame(image=image, time_s=0.0, sequence=0))
            shares.append(float(reconstructor.touched(frame.difference).mean()))
            single.append(reconstructor.network_rows.pixels / image[..., 0].size)
        assert shares == pytest.approx([0, 0.21, 1, 1], abs=0.04)
        assert max(single[:3]) < 0.002
        assert single[3] == pytest.approx(of_steep, abs=0.004)


def test_ratios_and_shares_of_the_peak_follow_from_the_times(bundle: Bundle, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every look at the clock takes a millisecond; a frame looks when it begins and after each stage."""

    def counter() -> Iterator[float]:
        return itertools.count(0, 1e-3)

    clock = SimpleNamespace(perf_counter=counter().__next__, process_time=counter().__next__)
    monkeypatch.setattr(timing, "time", clock)
    monkeypatch.setattr(timing, "measure_machine", lambda: Machine(flops=1e9, bytes_per_s=1e9))
    for times in frame_times(bundle, rounds=3):
        if times.scene != "at rest":
            assert set(times.stages.values()) == {Times(1.0, 1.0)}
        looks = 3 if times.scene == "at rest" else len(STAGES) + 1
        assert times.whole.wall_ms == looks + 1
        assert times.whole.cpu_ms == 1
        assert set(times.ratios.values()) == {1.0}
        pixels = times.image_width_px * times.image_height_px
        assert times.peak_fraction["memory"] == pytest.approx(52 * pixels / 1e-3 / 1e9, rel=0.01)


def test_the_operations_of_a_network_are_counted() -> None:
    assert network_flops(linear_network()) == 2 * 5 * 2
    assert network_flops(tanh_network(8)) == 2 * (5 * 8 + 3 * 8 * 8 + 8 * 2)


def test_the_table_holds_all_of_it(bundle: Bundle, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cv2.imwrite(str(tmp_path / "press.png"), np.zeros((120, 160, 3), np.uint8))
    timing.main(["--calibration", str(tmp_path / "b"), "--rounds", "3", "--press", str(tmp_path / "press.png")])
    printed = capsys.readouterr().out
    sized = ("at rest, 160 x 120 px", "ball, 80 x 60 px", "press, 160 x 120")
    for word in (*STAGES, *OTHERS, *sized, "x the whole frame"):
        assert word in printed
