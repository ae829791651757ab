"""The light of each LED, as the calibration routine takes it before it trains."""

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gellight.lab.calibration.lights import measure_lights
from gellight.lab.calibration.preparing import prepare
from gellight.lab.calibration.probing import measure_pixel_size
from gellight.lab.calibration.run import Aborted, CalibrationRun
from gellight.lab.calibration.untouched import take_reference
from gellight.lab.simulator.virtual_hand import hand_of
from gellight.opening import open_camera
from gellight.photometric.ring_geometry import RingGeometry
from tests.helpers.calibration_routine import GEOMETRY, LIT, URL, options


@contextmanager
def begun(
    folder: Path, url: str = LIT, geometry: Mapping[str, Any] = GEOMETRY, **tools: Any
) -> Iterator[CalibrationRun]:
    """A calibration of a sensor whose pixels are known, before its first press."""
    with open_camera(url, geometry=geometry) as sensor:
        chosen = options(folder, pixel_size_mm=0.1176, **tools)
        run = CalibrationRun(sensor, chosen, folder / "state", hand=hand_of(sensor, seed=0))
        for step in (prepare, take_reference, measure_pixel_size):
            step(run)
        yield run


def test_the_lights_are_those_of_the_ring_and_the_ring_shines_afterwards_as_before(tmp_path: Path) -> None:
    with begun(tmp_path) as run:
        before = run.frame().image
        model = measure_lights(run)
        after = run.frame().image
    assert model.ring == RingGeometry(window_mm=8.0)
    assert model.gamma == 1.0
    assert model.pattern_residual < 0.01
    assert np.abs(before.astype(float) - after).mean() < 2


HIGH = {**GEOMETRY, "mounting_height_mm": 15.0}


def test_a_ring_that_stands_elsewhere_than_the_settings_say_is_told_with_its_measures(tmp_path: Path) -> None:
    with begun(tmp_path, geometry=HIGH) as run:
        assert measure_lights(run) is None
        told = re.search(
            r"of LEDs (\S+) mm above .* radius of (\S+) mm, \[geometry\] has (\S+) and (\S+) mm",
            run.display.shown.problem,
        )
        assert told
        assert [float(number) for number in told.groups()] == pytest.approx([25.0, 21.5, 20.0, 21.5], abs=0.5)


def test_a_ring_that_stands_as_the_settings_say_is_taken(tmp_path: Path) -> None:
    with begun(tmp_path, geometry=HIGH, ring=RingGeometry(mounting_height_mm=15.0)) as run:
        model = measure_lights(run)
        assert model.ring.height_mm == 25.0


def test_without_a_ring_no_lights_are_taken(tmp_path: Path) -> None:
    with begun(tmp_path, URL) as run:
        assert measure_lights(run) is None
        assert not run.display.shown.problem


def test_they_are_stopped_between_two_lights(tmp_path: Path) -> None:
    with begun(tmp_path) as run:
        taken: list[int] = []

        def stop_at_the_third(**changes: Any) -> None:
            if "progress" in changes:
                taken.append(changes["progress"].done)
                if len(taken) == 3:
                    run.submit("abort", {})

        run.display.update = stop_at_the_third  # type: ignore[method-assign]
        with pytest.raises(Aborted):
            measure_lights(run)
        assert taken == [0, 1, 2]
