"""The programs in docs/virtual-sensor.md run."""

import numpy as np
import pytest

from gellight.lab.simulator.usb.encoding import Mark, to_jpeg
from tests.helpers.doc_examples import examples, run
from tests.helpers.fake_kernel import FakeCamera, FakeKernel

DOCUMENT = "docs/virtual-sensor.md"
OFFER, TRUTH = examples(DOCUMENT)


def test_a_sensor_is_offered_with_faults(capsys: pytest.CaptureFixture[str]) -> None:
    names = run(OFFER, DOCUMENT)
    assert names["sensor"].faults.drop == 0.1
    assert f"usbip --tcp-port {names['server'].port} attach" in capsys.readouterr().out


def test_the_truth_of_a_picture_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    grey = np.full((480, 640, 3), 90, np.uint8)
    camera = FakeCamera(payload=lambda number: to_jpeg(grey, Mark(number + 1, 99.5, 8000)))
    fake = FakeKernel({"/dev/video0": camera})
    fake.take_over(monkeypatch)
    names = run(TRUTH, DOCUMENT)
    assert names["mark"] == Mark(names["picture"].sequence + 1, 99.5, 8000)
