"""Parts to make: the unrolled cone, the table of its LEDs, and the design that the rest of the stack reads."""

from dataclasses import replace
from math import degrees, pi, radians
from pathlib import Path

import pytest

from gellight.base.errors import ConfigError, InputError
from gellight.opening import open_camera
from gellight_design import parts
from gellight_design.simulating.geometry_file import design_file, read_geometry
from sim_reference.geometry import SensorGeometry
from tests.helpers.settings import loaded

GEOMETRY = SensorGeometry()


def test_the_strip_is_the_unrolled_cone() -> None:
    flat = parts.strip(GEOMETRY)
    assert (degrees(flat.sector_rad), degrees(flat.pitch_rad)) == pytest.approx((314.863, 26.239), abs=6e-4)
    radii = flat.inner_radius_mm, flat.middle_radius_mm, flat.outer_radius_mm
    assert (*radii, flat.rise_mm) == pytest.approx((21.332, 24.582, 27.832, 3.151), abs=6e-4)
    # Rolled up, the middle line closes on the ring.
    assert flat.sector_rad * flat.middle_radius_mm == pytest.approx(2 * pi * GEOMETRY.ring_radius_mm)


def test_the_led_table_is_the_ring() -> None:
    rows = parts.led_table(GEOMETRY).splitlines()
    assert len(rows) == 13
    assert rows[4] == "3,R,90.00000,0.00000,-21.50000,20.00000,-0.00000,0.48481,-0.87462"


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"ring_radius_mm": 22.5}, "the housing is 25 mm"),
        ({"led_colours": "RGB" * 10}, "use fewer"),
    ],
)
def test_a_strip_that_cannot_be_made_is_refused(change: dict[str, float | str], reason: str) -> None:
    with pytest.raises((ConfigError, InputError), match=reason):
        parts.strip(replace(GEOMETRY, **change))  # type: ignore[arg-type]


def test_fifteen_leds_need_a_ring_of_13_mm() -> None:
    assert not parts.fits(15, replace(GEOMETRY, ring_radius_mm=13.1))
    assert parts.fits(15, replace(GEOMETRY, ring_radius_mm=13.2))


def test_the_design_is_the_sensor_that_is_simulated(tmp_path: Path) -> None:
    wanted = replace(
        GEOMETRY,
        led_colours="RGBRGBRGBRGB",
        incident_angle_rad=radians(41.5),
        mounting_height_mm=12.5,
        image_width_px=64,
        image_height_px=48,
    )
    (tmp_path / "gellight.toml").write_bytes(design_file(wanted))
    assert read_geometry(tmp_path / "gellight.toml").perspective, "a design says nothing of how it is seen"
    read = read_geometry(tmp_path / "gellight.toml", as_built=False)
    assert read.incident_angle_rad == pytest.approx(wanted.incident_angle_rad)
    assert replace(read, incident_angle_rad=0.5, beam_angle_rad=2.0) == replace(
        wanted, incident_angle_rad=0.5, beam_angle_rad=2.0
    )
    settings = loaded(folder=tmp_path, user_folder=tmp_path / "none")
    with open_camera("sim://?programme=0&board=0", geometry=settings.geometry.overrides()) as camera:
        assert camera.image_shape == (48, 64)
        assert camera.read().light[1].tolist() == [0, 255, 0]
