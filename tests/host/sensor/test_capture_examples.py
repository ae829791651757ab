"""The programs in docs/capture.md and docs/light.md run, on a kernel, a bus and a board made of nothing."""

from pathlib import Path

import numpy as np
import pytest

import gellight
from gellight.sensor import sensor_camera
from tests.helpers.doc_examples import examples, run
from tests.helpers.fake_kernel import FakeCamera, FakeKernel
from tests.helpers.sensor_bench import Bench, lit_bundle
from tests.helpers.v4l2_pictures import jpeg, scene
from tests.helpers.virtual_sensor import RING, virtual_sensor

DOCUMENT, LIGHT = "docs/capture.md", "docs/light.md"
CAMERA, SENSOR = examples(DOCUMENT)


def test_the_camera_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    picture = jpeg(scene())
    kernel = FakeKernel({"/dev/video0": FakeCamera(payload=lambda number: picture)})
    kernel.take_over(monkeypatch)
    names = run(CAMERA, DOCUMENT)
    assert names["frame"].image.shape == (480, 640, 3)
    assert kernel.opened == {}


def test_the_whole_sensor(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    bench = Bench(tmp_path / "bus")
    bench.plug("1-1", "GL0001")
    lit_bundle(tmp_path / "calibration")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sensor_camera, "Surroundings", lambda **_: bench.surroundings)
    names = run(SENSOR, DOCUMENT)
    assert names["frame"].image.shape == (24, 32, 3)
    assert names["status"]["connection"] == "connected"
    assert bench.rings[0].lit_s > 0
    assert bench.all_dark()


@pytest.mark.nightly
def test_the_examples_of_the_page_about_light_run(monkeypatch: pytest.MonkeyPatch) -> None:
    hold, stream, shutter = examples(LIGHT)
    names: dict[str, object] = {"gellight": gellight}
    for example in (hold, stream):
        run(example, LIGHT, names)
    frames, frame = names["frames"], names["frame"]
    assert [shown.label.group for shown in frames] == [0, 1, 2, 3]
    assert isinstance(frame, gellight.CameraFrame)
    assert frame.label is not None
    names["camera"] = camera = virtual_sensor(monkeypatch)  # the clock of sim:// is too irregular on a busy machine
    camera.ring.light(RING // 3)
    run(shutter, LIGHT, names)
    timing = names["timing"]
    assert timing.exposure_s == pytest.approx(0.008, abs=0.001)
    np.testing.assert_array_equal(camera.ring.still, RING // 3)
    camera.close()
