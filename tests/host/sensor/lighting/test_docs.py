"""The examples of docs/light.md run as they stand there, one after the other."""

import numpy as np
import pytest

import gellight
from tests.helpers.doc_examples import examples, run
from tests.helpers.virtual_sensor import RING, virtual_sensor

DOCUMENT = "docs/light.md"


@pytest.mark.nightly
def test_the_examples_of_the_page_about_light_run(monkeypatch: pytest.MonkeyPatch) -> None:
    hold, stream, shutter = examples(DOCUMENT)
    names: dict[str, object] = {"gellight": gellight}
    for example in (hold, stream):
        run(example, DOCUMENT, names)
    frames, frame = names["frames"], names["frame"]
    assert [shown.label.group for shown in frames] == [0, 1, 2, 3]
    assert isinstance(frame, gellight.CameraFrame)
    assert frame.label is not None
    names["camera"] = camera = virtual_sensor(monkeypatch)  # the clock of sim:// is too irregular on a busy machine
    camera.ring.light(RING // 3)
    run(shutter, DOCUMENT, names)
    timing = names["timing"]
    assert timing.exposure_s == pytest.approx(0.008, abs=0.001)
    np.testing.assert_array_equal(camera.ring.still, RING // 3)
    camera.close()
