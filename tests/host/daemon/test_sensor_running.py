"""A session on a real sensor, its kernel and bus made of nothing."""

import logging
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gellight.base.errors import BundleError
from gellight.base.settings import Settings
from gellight.bundle.bundle import Bundle
from gellight.daemon import assembly
from gellight.frames.frames import CameraFrame, TactileFrame
from tests.helpers.linear_sensor import verified_bundle
from tests.helpers.scripted_camera import CountingReconstructor
from tests.helpers.sensor_bench import Bench, Paced, lit_bundle
from tests.helpers.sessions import session_of
from tests.helpers.settings import loaded
from tests.helpers.waiting import eventually


@pytest.fixture
def bundle(tmp_path: Path) -> Bundle:
    return lit_bundle(tmp_path / "bundle")


class Gated(CountingReconstructor):
    """Says whether it has a frame in hand that waits for the gate."""

    holds = False

    def reconstruct(self, frame: CameraFrame) -> TactileFrame:
        self.holds = not self.gate.is_set()
        return super().reconstruct(frame)


def test_while_the_sensor_is_away_the_daemon_says_so_delivers_nothing_from_before_and_goes_on_when_it_is_back(
    bench: Bench, bundle: Bundle
) -> None:
    bench.plug("1-2", "GL0001")
    gated = Gated()
    with session_of(Paced(bench.open("auto", bundle)), gated) as daemon:
        shown = lambda: str(daemon.status()["error"])  # noqa: E731
        daemon.wait_frame(10, 60)
        gated.gate.clear()
        eventually(lambda: gated.holds)  # a frame from before is being reconstructed ...
        at_close: list[str] = []
        close, bench.rings[0].close = bench.rings[0].close, lambda: at_close.append(shown())
        bench.unplug("1-2")
        eventually(lambda: "reconnecting to sensor GL0001" in shown())
        assert "was unplugged" in at_close[0], "said before the ring was given up, which may take seconds"
        close()
        status: Any = daemon.status()
        assert (status["camera"]["connection"], status["camera"]["reconnections"]) == ("reconnecting", 0)
        gated.gate.set()  # ... and is ready when the sensor is away
        with pytest.raises(TimeoutError):
            daemon.wait_frame(-1, 0.3)
        replugged_s = bench.kernel.now_s
        bench.plug("1-5", "GL0001")
        after = daemon.wait_frame(-1, 60).camera_frame
        assert after.time_s > replugged_s
        eventually(lambda: shown() == "None")
        status = daemon.status()
        assert (status["camera"]["connection"], status["camera"]["reconnections"]) == ("connected", 1)
    assert bench.all_dark()


def test_the_session_refuses_a_camera_of_another_size_and_leaves_the_leds_dark(
    bench: Bench, bundle: Bundle, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.plug("1-2", "GL0001")
    monkeypatch.setattr("gellight.daemon.bundle_choice.load_bundle", lambda name: bundle)
    monkeypatch.setattr(assembly, "open_camera", lambda url, geometry, bundle: bench.open(url, bundle))
    settings = loaded({"sensor.url": "auto?width=640&height=480", "sensor.calibration": "synthetic"})
    with pytest.raises(BundleError, match=r"delivers 640x480 pixels, the calibration .* is for 32x24"):
        assembly.open_session(settings)
    assert bench.all_dark()


SMALL = {"image_width_px": 32, "image_height_px": 24, "pixel_size_mm": 1.176}


@pytest.mark.parametrize("wanted", [{"enabled": False}, {"rezero": False}])
def test_the_settings_of_the_watch_hold_for_the_first_bundle_too(tmp_path: Path, wanted: dict[str, bool]) -> None:
    told = {"sensor": {"url": "sim://?board=0&fps=200"}, "geometry": SMALL, "watch": wanted}
    with assembly.open_session(Settings.model_validate(told)) as daemon:
        assert daemon.watch is None
        assert "not calibrated" in str(daemon.status()["computed_by"])
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
        frame = daemon.wait_frame(-1, 60)
    assert frame.camera_frame.image.shape == (24, 32, 3)
    assert np.isnan(frame.depth_mm).all()
    assert len(opened) == 1
    assert "stay dark" not in caplog.text, "it has no LEDs that we could light"
