"""Daemon and session on a real sensor, its kernel and bus made of nothing."""

import time
from pathlib import Path
from typing import Any

import pytest

from gellight.base.errors import BundleError
from gellight.base.settings import load_settings
from gellight.bundle.bundle import Bundle
from gellight.daemon import assembly
from gellight.daemon.daemon import Daemon
from gellight.sensor.sensor_camera import SensorCamera
from tests.helpers.scripted_camera import CountingReconstructor
from tests.helpers.sensor_bench import Bench, lit_bundle


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path / "computer")


@pytest.fixture
def bundle(tmp_path: Path) -> Bundle:
    return lit_bundle(tmp_path / "bundle")


def test_the_daemon_serves_its_status_while_the_sensor_is_away_and_goes_on(bench: Bench, bundle: Bundle) -> None:
    bench.plug("1-2", "GL0001")
    sensor = bench.open("auto", bundle)

    class Paced(SensorCamera):
        """The same sensor, in real time: virtual time would race ahead."""

        def read(self) -> Any:
            time.sleep(0.002)
            return super().read()

    sensor.__class__ = Paced
    reconstructor: Any = CountingReconstructor()
    with Daemon(sensor, reconstructor) as daemon:
        before = daemon.wait_frame(10, 10).camera_frame
        told: list[Any] = []
        bench.rings[0].close = lambda: told.append(daemon.status()["error"])  # type: ignore[method-assign]
        bench.unplug("1-2")
        deadline = time.monotonic() + 10
        while "reconnecting" not in (daemon.status()["error"] or "") and time.monotonic() < deadline:
            time.sleep(0.005)
        assert "was unplugged" in told[0], "before the ring was given up, which may take seconds"
        bench.rings.pop(0)
        status: Any = daemon.status()
        assert "reconnecting to sensor GL0001" in status["error"]
        assert status["camera"]["connection"] == "reconnecting"
        with pytest.raises(TimeoutError):
            daemon.wait_frame(-1, 0.2)
        replugged_s = bench.kernel.now_s
        bench.plug("1-5", "GL0001")
        after = daemon.wait_frame(before.sequence, 10).camera_frame
        assert after.time_s > replugged_s, "the first frame that is delivered was taken after the sensor came back"
        status = daemon.status()
        assert status["error"] is None
        assert status["camera"]["reconnections"] == 1
    assert bench.all_dark()


def test_the_session_refuses_a_camera_of_another_size_and_leaves_the_leds_dark(
    bench: Bench, bundle: Bundle, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.plug("1-2", "GL0001")
    monkeypatch.setattr(assembly, "load_bundle", lambda name: bundle)
    monkeypatch.setattr(assembly, "open_camera", lambda url, geometry, bundle: bench.open(url, bundle))
    settings = load_settings({"sensor.url": "auto?width=640&height=480"}, environment={}, folder=Path("/nowhere"),
                             user_folder=Path("/nowhere"))  # fmt: skip
    with pytest.raises(BundleError, match=r"delivers 640x480 pixels, the calibration .* is for 32x24"):
        assembly.open_session(settings)
    assert bench.all_dark()
