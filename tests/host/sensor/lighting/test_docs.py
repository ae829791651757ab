"""The examples of docs/light.md run as they stand there, one after the other."""

import re
from pathlib import Path

import numpy as np
import pytest

import gellight
from gellight.frames.timing import CameraTiming
from tests.helpers.virtual_sensor import RING, virtual_sensor

PAGE = Path(__file__).parents[4] / "docs" / "light.md"
PYTHON = re.compile(r"```python\n(.*?)```", re.DOTALL)


def test_the_examples_of_the_page_about_light_run(monkeypatch: pytest.MonkeyPatch) -> None:
    hold, stream, shutter = PYTHON.findall(PAGE.read_text())
    names: dict[str, object] = {"gellight": gellight}
    for example in (hold, stream):
        exec(compile(example, str(PAGE), "exec"), names)
    frames, frame = names["frames"], names["frame"]
    assert isinstance(frames, list)
    assert [shown.label.group for shown in frames] == [0, 1, 2, 3]
    assert isinstance(frame, gellight.CameraFrame)
    assert frame.label is not None
    names["camera"] = camera = virtual_sensor(monkeypatch)  # the clock of sim:// is too irregular on a busy machine
    camera.ring.light(RING // 3)
    exec(compile(shutter, str(PAGE), "exec"), names)
    timing = names["timing"]
    assert isinstance(timing, CameraTiming)
    assert timing.exposure_s == pytest.approx(0.008, abs=0.001)
    np.testing.assert_array_equal(camera.ring.still, RING // 3)
    camera.close()
