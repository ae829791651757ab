"""`lights.json` in a bundle: what is written is read, and what is damaged is refused with the remedy."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gellight.base.errors import BundleError
from gellight.base.settings import GeometrySettings, SensorSettings, Settings
from gellight.bundle.bundle import Bundle, extend_bundle, load_bundle
from gellight.lab.optics.lights.adding import led_colours
from gellight.photometric.light_model import LightGroups, LightModel
from gellight.photometric.lights_file import FILE_NAME, has_lights, read_lights, write_lights
from gellight.photometric.ring_geometry import RingGeometry
from tests.helpers.linear_sensor import linear_bundle
from tests.helpers.simulated_gel import Gel


@pytest.fixture(scope="module")
def model() -> LightModel:
    return Gel(noise_grey=0).model(1)


@pytest.fixture
def bundle(tmp_path: Path) -> Bundle:
    return linear_bundle(tmp_path / "bundle", (240, 320))


def test_what_is_written_is_read(bundle: Bundle, model: LightModel, tmp_path: Path) -> None:
    assert not has_lights(bundle)
    written = write_lights(bundle, model, tmp_path / "new")
    again = read_lights(load_bundle(tmp_path / "new"))
    assert has_lights(written)
    for kind in LightGroups:
        np.testing.assert_allclose(again.references(kind), model.references(kind), rtol=1e-4)
    assert (again.ring, again.gamma, again.exposure_us) == (model.ring, model.gamma, model.exposure_us)
    np.testing.assert_allclose(again.crosstalk, model.crosstalk, atol=1e-6)
    assert written.manifest.noise_grey == bundle.manifest.noise_grey
    assert written.network == bundle.network


def test_a_bundle_is_not_overwritten_unless_told(bundle: Bundle, model: LightModel, tmp_path: Path) -> None:
    with pytest.raises(BundleError, match="exists: choose another name"):
        write_lights(bundle, model, tmp_path / "bundle")
    assert has_lights(write_lights(bundle, model, tmp_path / "bundle", overwrite=True))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"gamma": 0.0}, "gamma"),
        ({"colours": [[255, 0, 0]]}, "12 LEDs, 1 colours"),
        ({"patterns": {"singles": [[[0.0]]]}}, "patterns for singles"),
        ({"patterns": {"singles": [[[0.0]]] * 12, "triples": [[[0.0]]] * 3}}, "3 patterns of triples for 12 LEDs"),
        ({"wavelength": 1}, "wavelength"),
        ({"ring": {"radius_mm": 21.5}}, "ring.radius_mm"),
        ({"ring": {"ring_radius_mm": float("nan")}}, "ring.ring_radius_mm"),
        ({"ring": {"ring_radius_mm": -1.0}}, "on a radius of -1 mm"),
    ],
)
def test_a_damaged_file_is_refused(
    bundle: Bundle, model: LightModel, tmp_path: Path, change: dict[str, object], words: str
) -> None:
    content = json.loads(write_lights(bundle, model, tmp_path / "good").files[FILE_NAME])
    damaged = extend_bundle(bundle, tmp_path / "bad", {FILE_NAME: json.dumps(content | change).encode()})
    with pytest.raises(BundleError, match=rf"lights.json: .*{words}.*gellight calibrate lights"):
        read_lights(damaged)


def test_lights_of_another_image_size_are_refused(bundle: Bundle, model: LightModel, tmp_path: Path) -> None:
    other = write_lights(bundle, replace(model, image_shape=(480, 640)), tmp_path / "other")
    with pytest.raises(BundleError, match=r"is for 640 x 480 px, the bundle for 320 x 240"):
        read_lights(other)


def test_the_shipped_bundle_knows_its_lights() -> None:
    model = read_lights(load_bundle("synthetic"))
    assert model.ring == RingGeometry(window_mm=8.0)
    assert model.exposure_us is not None
    assert model.pattern_residual < 0.005


def test_colours_come_from_the_bundle_and_have_to_agree_with_the_settings() -> None:
    shipped = load_bundle("synthetic")
    assert led_colours(shipped, RingGeometry())[[0, 4, 8]].tolist() == [[255, 0, 0], [0, 255, 0], [0, 0, 255]]
    settings = Settings(sensor=SensorSettings(), geometry=GeometrySettings(led_colours="RGB" * 4))
    with pytest.raises(BundleError, match=r"a ring RRRRGGGGBBBB, the settings say RGBRGB.*led_colours"):
        led_colours(shipped, RingGeometry.from_overrides(settings.geometry.overrides()))
