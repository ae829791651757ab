"""One press as a map; which valleys count as reached `tests.benchmarks.roughness` judges."""

from dataclasses import replace

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.frames.frames import CameraFrame, Contact, TactileFrame
from gellight.frames.measures import ErrorBounds
from gellight.lab.scanning.height_map import map_of_press
from sim_reference import gel
from sim_reference.deformation import grid
from sim_reference.geometry import SensorGeometry, pixel_grid
from sim_reference.reliefs import FLAT_MM, sine_plate
from sim_reference.surface import Surface, sample

GEOMETRY = SensorGeometry(image_width_px=320, image_height_px=240, pixel_size_mm=0.1176)
PIXEL = (GEOMETRY.pixel_size_mm,) * 2
NEAR = np.hypot(*pixel_grid(GEOMETRY)) < FLAT_MM - 1


def pressed(wavelength_mm: float, steepness: float, depth_mm: float) -> Surface:
    at = grid(256, 0.2)
    plate = sine_plate(at[None, :], at[:, None], wavelength_mm, steepness * wavelength_mm)
    return sample(gel.press(plate, 0.2, depth_mm, GEOMETRY), GEOMETRY, 0.0, 0.0)


def frame(bounds: ErrorBounds | None = None) -> TactileFrame:
    true = pressed(2.0, 0.02, 0.5)
    contact = Contact(mask=true.contact, area_mm2=1.0, indentation_mm=0.5, centroid_mm=(0.0, 0.0))
    taken = CameraFrame(image=np.zeros((240, 320, 3), np.uint8), time_s=0.0, sequence=0)
    felt = TactileFrame(
        camera_frame=taken,
        difference=np.zeros((240, 320, 3), np.float32),
        gradient_map=true.gradient_map.astype(np.float32),
        depth_mm=true.depth_mm.astype(np.float32),
        contact=contact,
    )
    felt.__dict__["error_bounds"] = bounds
    return felt


def test_a_press_is_a_map_of_what_was_reached_with_the_errors_that_are_told() -> None:
    felt = frame()
    found = map_of_press(felt, PIXEL, 0.002)
    assert np.array_equal(found.height_mm[found.reached], felt.depth_mm[found.reached])
    assert np.array_equal(np.isfinite(found.error_mm), found.reached)
    assert found.error_mm[found.reached].max() == np.float32(0.002)
    assert found.reached[NEAR].all()
    assert found.pixel_mm == PIXEL[0]


def test_the_errors_of_the_bundle_are_taken_where_it_knows_them() -> None:
    bound = np.full((240, 320), 1.645e-3, np.float32)
    bound[:, 150:] = np.inf
    found = map_of_press(frame(ErrorBounds(normal_deg=bound, shape_mm=bound)), PIXEL)
    assert not found.reached[:, 150:].any()
    assert found.error_mm[found.reached] == pytest.approx(1e-3)


def test_what_makes_no_map_is_refused() -> None:
    felt = frame()
    with pytest.raises(InputError, match=r"pixels of 0\.1 x 0\.12 mm are not square"):
        map_of_press(felt, (0.1, 0.12), 0.002)
    assert map_of_press(felt, (0.1, 0.10045), 0.002).pixel_mm == 0.1
    with pytest.raises(InputError, match="are not square"):
        map_of_press(felt, (0.1, 0.10055), 0.002)
    with pytest.raises(InputError, match="the bundle does not know by how much its depth is off: say it"):
        map_of_press(felt, PIXEL)
    nothing = replace(felt, depth_mm=np.zeros((240, 320), np.float32))
    with pytest.raises(InputError, match="nothing touches the gel in this frame"):
        map_of_press(nothing, PIXEL, 0.002)
