"""The programs in docs/capture.md run, on a kernel and a bus made of nothing."""

from pathlib import Path

import pytest

from gellight.sensor import sensor_camera
from tests.helpers.doc_examples import examples, run
from tests.helpers.fake_kernel import FakeCamera, FakeKernel
from tests.helpers.sensor_bench import Bench, lit_bundle
from tests.helpers.v4l2_pictures import jpeg, scene

DOCUMENT = "docs/capture.md"
CAMERA, SENSOR = examples(DOCUMENT)


@pytest.fixture
def kernel(monkeypatch: pytest.MonkeyPatch) -> FakeKernel:
    """The system, with a camera at /dev/video0."""
    picture = jpeg(scene())
    fake = FakeKernel({"/dev/video0": FakeCamera(payload=lambda number: picture)})
    fake.take_over(monkeypatch)
    return fake


def test_the_camera_alone(kernel: FakeKernel) -> None:
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
