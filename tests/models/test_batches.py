"""Presses in batches by torch are those of the reference simulator, each as if it were alone."""

import io
import json
import sys
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from gelnet.pressed import Presses, main, serve
from sim_reference import gel
from sim_reference.deformation import NotConverged, grid
from sim_reference.geometry import SensorGeometry
from sim_reference.imaging import ring_irradiance, ring_light
from sim_reference.objects import object_height
from sim_reference.surface import press_object, sample, untouched

pytestmark = pytest.mark.nightly
torch: Any = pytest.importorskip("torch")
batches: Any = pytest.importorskip("gelnet.batches")
SMALL = SensorGeometry(image_width_px=160, image_height_px=120, pixel_size_mm=0.2)
SIZE, SPACING_MM = 96, 0.5
CASES = (("BALL", 1.0), ("WAVE", 0.8), ("TSTEP", 0.6), ("BALL", 0.001), ("BALL", 0.0))
PROCESSOR = torch.device("cpu")


def rest_gaps() -> NDArray[np.float64]:
    at = grid(SIZE, SPACING_MM)
    return np.stack([-(object_height(name, at[None, :], at[:, None]) + deep) for name, deep in CASES])


def test_each_press_of_a_batch_has_the_pressure_it_has_alone() -> None:
    found = batches.contact_pressures(rest_gaps(), SPACING_MM, SMALL, PROCESSOR)
    response = gel.compliance(SIZE, SPACING_MM, SMALL.gel_thickness_mm, SMALL.poisson_ratio)
    for gap, pressure in zip(rest_gaps(), found, strict=True):
        alone = gel.contact_pressure(gap, response, SMALL.gel_thickness_mm)
        np.testing.assert_allclose(pressure, alone, rtol=0, atol=1e-9 * max(alone.max(), 1))


def test_a_press_that_does_not_converge_is_told() -> None:
    with pytest.raises(NotConverged, match=r"of 5 presses did not converge in 3 iterations"):
        batches.contact_pressures(rest_gaps(), SPACING_MM, SMALL, PROCESSOR, most=3)


@pytest.mark.parametrize("beam", [np.radians(120.0), np.radians(90.0)])
def test_the_light_is_that_of_the_reference_with_its_shadows(beam: float) -> None:
    sensor = SensorGeometry(**{**SMALL.__dict__, "beam_angle_rad": beam})
    pressed = [
        sample(press_object(name, 0.9, sensor), sensor, 3.0, -2.0).single_precision() for name in ("BALL", "WAVE")
    ]
    surfaces = [*pressed, untouched(sensor).single_precision()]
    lights = np.stack([ring_light(sensor), np.eye(12)[:, [2, 2, 2]]])
    found = batches.Ring(sensor, PROCESSOR).irradiances(surfaces, lights)
    for surface, lit in zip(surfaces, found, strict=True):
        for light, picture in zip(lights, lit, strict=True):
            wanted = ring_irradiance(surface, sensor, light)
            np.testing.assert_allclose(picture, wanted, rtol=0, atol=1e-5 * wanted.max())
    shadowless = [ring_irradiance(surface, sensor, lights[0]) for surface in surfaces]
    assert np.ptp(shadowless[1]) > 0, "what is compared is not flat"


def test_what_was_deformed_is_kept_and_forgotten_in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gelnet.pressed.MOST_KEPT", 2)
    presses = Presses(SMALL, "torch", batch=2)
    light = ring_light(SMALL)[None]
    first = list(presses.seen([("BALL", 0.5, 0.0, 0.0), ("BALL", 0.5, 4.0, 0.0), ("TSTEP", 0.5, 0.0, 0.0)], light))
    again = list(presses.seen([("BALL", 0.5, 0.0, 0.0), ("BALL", 0.6, 0.0, 0.0)], light))
    assert set(presses._kept) == {("BALL", 0.5), ("BALL", 0.6)}
    for one, other in zip(first[0], again[0], strict=True):
        np.testing.assert_array_equal(one, other)


def test_another_program_gets_a_press_field_by_field() -> None:
    sensor = {"geometry": SMALL.__dict__, "light": ring_light(SMALL)[None].tolist()}
    asked = io.BytesIO(f'{json.dumps(sensor)}\n[["BALL", 0.8, 2.0, 1.0]]\n[]\n'.encode())
    answers = io.BytesIO()
    serve(asked, answers, "torch", batch=4)
    answers.seek(0)
    name, irradiance, depth, gradient, contact, deep, pressure = (np.lib.format.read_array(answers) for _ in range(7))
    deformation = press_object("BALL", 0.8, SMALL)
    surface = sample(deformation, SMALL, 2.0, 1.0).single_precision()
    assert str(name).startswith("processor, torch ")
    np.testing.assert_allclose(depth, surface.depth_mm, atol=1e-6)
    np.testing.assert_allclose(gradient, surface.gradient_map, atol=1e-6)
    np.testing.assert_array_equal(contact, surface.contact)
    np.testing.assert_allclose(deep, deformation.depth_mm, atol=1e-9)
    np.testing.assert_allclose(pressure, deformation.pressure, atol=1e-9)
    assert irradiance.shape == (1, *SMALL.image_shape, 3)


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a GPU")
def test_without_a_gpu_it_says_so(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(batches.NoGpuError, match=r"finds no GPU \(CUDA\)"):
        batches.device_of("cuda")
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b'{"geometry": {}, "light": []}\n')))
    assert main(["--by", "cuda"]) == 2
    assert "finds no GPU" in capsys.readouterr().err
