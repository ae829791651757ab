"""Sensors without our ring that were never calibrated: the page shows what they see, and calibrates them."""

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gellight.base.settings import Settings
from gellight.bundle.bundle import load_bundle
from gellight.daemon import assembly
from gellight.daemon.bundle_choice import placeholder
from tests.helpers.linear_sensor import linear_bundle, verified_bundle
from tests.helpers.sensor_bench import Bench, Paced
from tests.helpers.settings import loaded

SMALL = {"image_width_px": 32, "image_height_px": 24, "pixel_size_mm": 1.176}


def small(url: str, **changes: Mapping[str, object]) -> Settings:
    return Settings.model_validate({"sensor": {"url": url}, "geometry": SMALL, **changes})


def test_a_camera_of_any_size_streams_pictures_without_depth_until_it_has_a_bundle(tmp_path: Path) -> None:
    with assembly.open_session(small("sim://?board=0&fps=200")) as daemon:
        before = daemon.wait_frame(-1, 30)
        status: Any = daemon.status()
        assert before.camera_frame.image.shape == (24, 32, 3)
        assert np.isnan(before.depth_mm).all()
        assert (status["mode"], status["watch"], status["error"]) == ("network", None, None)
        assert "not calibrated" in status["computed_by"]
        daemon.replace_bundle(verified_bundle(tmp_path / "made", sensor="simulated"))
        after = daemon.wait_frame(before.camera_frame.sequence + 3, 30)
        assert np.isfinite(after.depth_mm).all()
        assert daemon.watch is not None, "the first bundle begins the watch"


@pytest.mark.parametrize("wanted", [{"enabled": False}, {"rezero": False}])
def test_the_settings_of_the_watch_hold_for_the_first_bundle_too(tmp_path: Path, wanted: dict[str, bool]) -> None:
    with assembly.open_session(small("sim://?board=0&fps=200", watch=wanted)) as daemon:
        daemon.replace_bundle(verified_bundle(tmp_path / "made", sensor="simulated"))
        assert daemon.watch is None if "enabled" in wanted else not daemon.watch.rezero


def test_a_v4l2_camera_with_lights_of_its_own_is_not_taken_for_the_simulated_sensor(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    bench = Bench(tmp_path / "computer")
    bench.plug("1-2", "GL0001")
    node = bench.usb.dev / "video0"
    assert node.exists()
    opened: list[str] = []

    def open_camera(url: str, **more: Any) -> Any:
        opened.append(url)
        return Paced(bench.open(url, more.get("bundle")))

    monkeypatch.setattr(assembly, "open_camera", open_camera)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    settings = loaded({"sensor.url": f"v4l2://{node}?width=32&height=24&format=YUYV"})
    with caplog.at_level(logging.WARNING), assembly.open_session(settings) as daemon:
        frame = daemon.wait_frame(-1, 30)
    assert frame.camera_frame.image.shape == (24, 32, 3)
    assert np.isnan(frame.depth_mm).all()
    assert len(opened) == 1
    assert "stay dark" not in caplog.text, "it has no LEDs that we could light"


def test_a_placeholder_says_that_it_is_not_calibrated(tmp_path: Path) -> None:
    empty = placeholder((24, 32))
    assert not empty.calibrated
    assert empty.image_shape == empty.reference.shape[:2] == (24, 32)
    assert linear_bundle(tmp_path / "made").calibrated
    assert empty.identity != load_bundle("synthetic").identity
