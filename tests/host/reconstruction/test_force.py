"""Force from depth: of the layer that the reference has, and of a gel of finite elements, which is no ideal layer."""

from pathlib import Path

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.bundle.bundle import extend_bundle, load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame
from gellight.frames.measures import BEYOND_VIEW, HEAVIER
from gellight.reconstruction import force as force_module
from gellight.reconstruction.force import Layer, compliance, indenting
from gellight.reconstruction.force_file import FILE_NAME, ForceRecord
from sim_reference import gel
from tests.benchmarks.force import FINGER, on_a_finger
from tests.helpers.fem_presses import NAMES, SPACING_MM, depth_mm, force_n, picture
from tests.helpers.linear_sensor import linear_bundle
from tests.helpers.weighed import PIXEL_MM, SHAPE, force_files, weighed

PIXELS = (PIXEL_MM, PIXEL_MM)
SCALE = ForceRecord.model_validate_json(force_files()[FILE_NAME]).model_copy(
    update={"error_share": 0.1, "error_floor_n": 0.02, "heaviest_n": 2.0}
)


def test_the_layer_is_that_of_the_reference() -> None:
    ours = compliance((48, 48), (0.3, 0.3), Layer(4.0, 0.47))
    theirs = gel.compliance(48, 0.3, 4.0, 0.47)
    np.testing.assert_allclose(ours, theirs * 2 * (1 + 0.47), rtol=1e-9)  # their unit is the shear modulus


@pytest.mark.parametrize("press_mm", [0.1, 0.3, 0.6])
@pytest.mark.parametrize(("radius_mm", "pixels"), [(1.5, PIXELS), (4.0, PIXELS), (3.0, (0.05, 0.04))])
def test_a_ball_gives_back_its_force(press_mm: float, radius_mm: float, pixels: tuple[float, float]) -> None:
    press = weighed(press_mm, radius_mm, 0.0, pixels)
    force = SCALE.force(press.depth_mm, pixels)
    assert force.normal_n == pytest.approx(press.force_n, rel=0.01)
    assert force.error_n == pytest.approx(np.hypot(0.02, 0.1 * force.normal_n))


def test_where_the_contact_stays_as_it_is_a_step_needs_one_transform(monkeypatch: pytest.MonkeyPatch) -> None:
    """They are what a force costs; two a step made 19, and 113 of a gel that a white picture presses everywhere."""
    counted = list[None]()
    plain = force_module._sunk
    monkeypatch.setattr(force_module, "_sunk", lambda *given: (counted.append(None), plain(*given))[1])
    SCALE.force(weighed(0.5, 3.0).depth_mm, PIXELS)
    assert len(counted) <= 12
    counted.clear()
    SCALE.force(np.full(SHAPE, 1.0, np.float32) + np.linspace(0, 0.5, SHAPE[1], dtype=np.float32), PIXELS)
    assert len(counted) <= 60


def test_the_pressure_map_is_where_the_ball_presses_and_adds_up_to_the_force() -> None:
    press = weighed(0.5, 3.0, 1.0)
    force = SCALE.force(press.depth_mm, PIXELS)
    assert force.pressure_mpa.shape == SHAPE
    assert force.pressure_mpa is force.pressure_mpa, "computed once"
    assert force.pressure_mpa.min() >= 0
    assert force.pressure_mpa.sum() * PIXEL_MM**2 == pytest.approx(force.normal_n, rel=1e-4)
    assert np.corrcoef(force.pressure_mpa.ravel(), press.pressure_mpa.ravel())[0, 1] > 0.97
    assert force.pressure_mpa.max() == pytest.approx(press.pressure_mpa.max(), rel=0.1)


@pytest.mark.parametrize("dip_mm", [0.0, 0.03])
def test_a_zero_that_is_off_and_leans_and_a_dip_far_away_change_no_force(dip_mm: float) -> None:
    """The layer knows the depth beside the contact; where a tenth of that is off, the others tell."""
    press = weighed(0.5, 3.0)
    down, across = (np.linspace(0, 1, length) for length in SHAPE)
    depth = press.depth_mm + 0.01 + 0.02 * down[:, None] - 0.015 * across
    depth[down < 0.1] -= dip_mm
    assert SCALE.force(depth.astype(np.float32), PIXELS).normal_n == pytest.approx(press.force_n, rel=0.01)


def test_the_gel_at_rest_carries_nothing() -> None:
    force = SCALE.force(np.zeros(SHAPE, np.float32), PIXELS)
    assert (force.normal_n, force.error_n, force.flags) == (0.0, 0.02, ())
    assert not force.pressure_mpa.any()


def test_a_touch_that_the_view_cuts_off_and_a_force_beyond_the_calibration_are_flagged() -> None:
    assert SCALE.force(weighed(0.5, 3.0, 7.5).depth_mm, PIXELS).flags == (BEYOND_VIEW,)
    felt_n = SCALE.force(weighed(0.5).depth_mm, PIXELS).normal_n
    for by, flags in ((1.24, ()), (1.26, (HEAVIER,))):
        scale = SCALE.model_copy(update={"heaviest_n": felt_n / by})
        assert scale.force(weighed(0.5).depth_mm, PIXELS).flags == flags


@pytest.mark.parametrize(("thickness", "ratio"), [(0.0, 0.4), (np.nan, 0.4), (2.0, 0.5), (2.0, -0.1)])
def test_what_is_no_layer_is_refused(thickness: float, ratio: float) -> None:
    with pytest.raises(InputError, match="give a"):
        Layer(thickness, ratio)


def test_a_frame_carries_its_force_where_the_bundle_knows_it(tmp_path: Path) -> None:
    press = weighed(0.5)
    frame = CameraFrame(image=press.picture(), time_s=0.0, sequence=0)
    plain = linear_bundle(tmp_path / "plain", SHAPE, pixel_size_mm=PIXELS)
    assert Reconstructor(plain).reconstruct(frame).force is None
    knowing = extend_bundle(plain, tmp_path / "knowing", force_files())
    force = Reconstructor(knowing).reconstruct(frame).force
    assert force.normal_n == pytest.approx(press.force_n, rel=0.05)
    flat = Reconstructor(knowing).reconstruct(CameraFrame(image=weighed(0.0).picture(), time_s=0.0, sequence=1)).force
    assert flat.normal_n == 0


# ---- finite elements: weighed with one ball, other objects are right within 10 % ----

WEIGHED = "ball4_1.0"
WEIGHED_LAYER = Layer(5.0, 0.49)


def integral(depth: np.ndarray, pixel_mm: tuple[float, float] = (SPACING_MM, SPACING_MM)) -> float:
    return indenting(depth, pixel_mm, WEIGHED_LAYER).integral_mm2


@pytest.mark.parametrize("name", NAMES)
def test_one_ball_weighs_every_object_within_a_tenth(name: str) -> None:
    modulus = force_n(WEIGHED) / integral(depth_mm(WEIGHED))
    assert modulus == pytest.approx(0.2, rel=0.04), "of the gel, 0.2 MPa"
    assert modulus * integral(depth_mm(name)) == pytest.approx(force_n(name), rel=0.1)


def test_so_it_is_when_the_depth_is_felt_in_pictures() -> None:
    bundle = load_bundle("synthetic")
    reconstructor = Reconstructor(bundle)
    felt = {
        name: integral(reconstructor.reconstruct(picture(name)).depth_mm, bundle.pixel_size_mm)
        for name in (WEIGHED, "ball2.5_0.9", "cyl_1.0", "prism_0.9", "pins_0.4")
    }
    modulus = force_n(WEIGHED) / felt[WEIGHED]
    weighed = {name: modulus * value / force_n(name) for name, value in felt.items()}
    assert weighed == pytest.approx(dict.fromkeys(felt, 1.0), rel=0.1)


def test_a_small_view_and_an_unknown_zero_change_the_force_of_no_object() -> None:
    """Where skirts are cut off and the zero is a plane, the force was 0.9 to 4.7 times the right one."""
    pixels, random = (SPACING_MM, SPACING_MM), np.random.default_rng(0)
    for name in FINGER:
        whole = indenting(depth_mm(name), pixels, WEIGHED_LAYER)
        seen = indenting(on_a_finger(name, random), pixels, WEIGHED_LAYER)
        assert seen.integral_mm2 == pytest.approx(whole.integral_mm2, rel=0.04), name
        assert not seen.at_border


@pytest.mark.parametrize("name", ["ball4_0.3", "pins_0.4", "punch_0.4", "tstep_0.5"])
def test_more_rounds_and_steps_change_no_force(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    found = integral(depth_mm(name))
    for constant, value in {"_ROUNDS": 12, "_PATCH_ROUNDS": 12, "_SETTLED": 1e-6, "_SETTLED_AT_LAST": 1e-6}.items():
        monkeypatch.setattr(force_module, constant, value)
    monkeypatch.setattr(force_module, "_ZERO_SETTLED_MM", 1e-6)
    monkeypatch.setattr(force_module, "_ZERO_CELLS", 100_000)
    assert found == pytest.approx(integral(depth_mm(name)), rel=0.003)


@pytest.mark.parametrize(("name", "cut_off"), [("ball7_0.8", False), ("cyl_1.0", True), ("tstep_0.5", True)])
def test_only_a_load_that_goes_on_beyond_the_view_is_beyond_it(name: str, cut_off: bool) -> None:
    """In 8 mm of view every skirt is cut off, but under the ball of 7 mm no load is."""
    depth = depth_mm(name)
    cut = (len(depth) - round(8 / SPACING_MM)) // 2
    seen = depth[cut:-cut, cut:-cut]
    assert max(seen[0].max(), seen[:, 0].max()) > 0.02
    found = indenting(seen, (SPACING_MM, SPACING_MM), WEIGHED_LAYER)
    assert found.at_border == cut_off
