"""Displacement and force along the gel against the reference simulator, which computes them by another way."""

from dataclasses import replace

import numpy as np
import pytest

from gellight.bundle.bundle import Bundle, load_bundle
from gellight.frames.frames import CameraFrame, TactileFrame
from gellight.frames.measures import BEYOND_VIEW, HEAVIER
from gellight.frames.shear import FEW_DOTS, FRICTION, PERSPECTIVE, DotsSeen, Shear, Unseen
from gellight.lab.simulator.printed_dots import PrintedDots, known_force
from gellight.lab.simulator.scene import Press, Printed, Scene
from gellight.reconstruction.force import Layer
from gellight.reconstruction.force_file import FILE_NAME, ForceRecord
from gellight.reconstruction.measures import BundleMeasures
from gellight.reconstruction.shear.traction import find_pull, kernels
from gellight.reconstruction.stages import Stages, tactile_frame
from sim_reference.camera import CameraResponse
from sim_reference.fem.tangential import Layer as ReferenceLayer
from sim_reference.geometry import AS_BUILT

GEOMETRY = AS_BUILT
DOTS = PrintedDots(columns=9, rows=7)
DRAGS = [
    Press("BALL", 1.0, 1.0, 0.5, ((0.3, 0.1, 0.0),)),
    Press("BALL", 0.6, -3.0, 1.5, ((-0.1, 0.4, 0.0),)),
    Press("CYLINDER", 0.4, 0.5, 0.3, ((0.2, 0.0, 0.0),)),
    Press("BALL", 1.2, 2.0, -1.0, ((0.5, 0.0, 0.0), (1.0, 0.0, 0.0))),
    Press("CYLINDER", 0.4, -1.0, 0.5, ((0.0, -0.1, 0.1),)),
]


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene(GEOMETRY, CameraResponse(noise_grey=0.0), printed=Printed(dots=DOTS))


@pytest.fixture(scope="module")
def bundle() -> Bundle:
    return replace(load_bundle("synthetic"), files={**load_bundle("synthetic").files, **known_force(GEOMETRY)})


def seen_dots(scene: Scene, press: Press | None, rng: np.random.Generator, unseen: float = 0.0) -> DotsSeen:
    """The dots as a follower tells them: off by 0.04 px, some of them not seen."""
    rest, now = scene.shear(None), scene.shear(press)
    reasons = np.where(rng.random(63) < unseen, Unseen.MISSING, Unseen.SEEN).astype(np.uint8)
    return DotsSeen(
        rest_px=rest.dots_px, places_px=now.dots_px + rng.normal(0, 0.04, (63, 2)), reasons=reasons
    )  # fmt: skip


def felt(scene: Scene, bundle: Bundle, press: Press | None, dots: DotsSeen | None) -> TactileFrame:
    """The tactile frame of a press whose depth is true."""
    grey, surface = scene.show(press)
    image = np.clip(grey, 0, 255).astype(np.uint8)
    frame = CameraFrame(image=image, time_s=0.0, sequence=1, dots=dots, truth=None)
    depth = surface.depth_mm.astype(np.float32)
    slopes = surface.gradient_map.astype(np.float32)
    return tactile_frame(
        frame, image.astype(np.float32), slopes, depth, bundle.pixel_size_mm, Stages(), measures=BundleMeasures(bundle)
    )


def shear_of(scene: Scene, bundle: Bundle, press: Press, seed: int = 0, unseen: float = 0.0) -> Shear:
    return felt(scene, bundle, press, seen_dots(scene, press, np.random.default_rng(seed), unseen)).shear


def side_of(bundle: Bundle) -> ForceRecord:
    return ForceRecord.model_validate_json(bundle.files[FILE_NAME])


def test_a_cell_moves_the_gel_as_in_the_reference() -> None:
    layer = ReferenceLayer((480, 480), 0.25, 5.0, 0.49)
    traction = np.zeros((480, 480, 3))
    traction[240, 240] = (0.3, -0.2, 0.5)
    moved = layer.displacement(traction)[..., :2]
    rows, columns = np.indices((480, 480))
    away = np.stack([columns - 240, rows - 240], axis=-1)[200:280, 200:280] * 0.25
    xx, xy, yy, xz, yz = kernels(Layer(5.0, 0.49)).at(away)
    cell, by_young = 0.25**2, 1 / (2 * 1.49)
    x = (0.3 * xx - 0.2 * xy + 0.5 * xz) * cell * by_young
    y = (0.3 * xy - 0.2 * yy + 0.5 * yz) * cell * by_young
    # The reference repeats its grid, the kernels end 6 thicknesses away.
    np.testing.assert_allclose(np.stack([x, y], axis=-1), moved[200:280, 200:280], atol=2e-5)


def test_what_moves_no_dot_is_known_only_as_well_as_friction_says() -> None:
    pressure, cells = np.full(4, 0.1), np.array([[-1.0, 0], [1, 0], [0, -1], [0, 1]])
    blind = find_pull(np.zeros((2, 2)), 0.01, np.zeros((4, 8)), pressure, cells, 1.0)
    assert not blind.total.any()
    assert np.sqrt(blind.covariance[0, 0]) > 0.4 * pressure.sum()


def test_a_dot_on_every_cell_tells_the_traction_of_each() -> None:
    pressure, cells = np.full(4, 0.1), np.array([[-1.0, 0], [1, 0], [0, -1], [0, 1]])
    traction = np.array([[0.02, -0.01], [-0.01, 0.005], [0.01, 0.01], [-0.005, 0.02]])
    seen = find_pull(10 * traction, 1e-4, 10 * np.eye(8), pressure, cells, 0.5)
    np.testing.assert_allclose(seen.traction, traction, atol=1e-5)
    turn = 0.5 * (cells[:, 0] @ traction[:, 1] - cells[:, 1] @ traction[:, 0])
    np.testing.assert_allclose(seen.total, [*0.5 * traction.sum(axis=0), turn], atol=1e-5)
    np.testing.assert_allclose(np.sqrt(np.diag(seen.covariance)), 1e-5, rtol=0.01)


@pytest.mark.parametrize("press", DRAGS[:4])
def test_the_force_of_a_drag_is_told_within_a_tenth_and_the_traction_adds_up_to_it(
    scene: Scene, bundle: Bundle, press: Press
) -> None:
    shear, truth = shear_of(scene, bundle, press), scene.shear(press)
    assert not shear.unknown
    total = shear.traction_mpa.sum(axis=(0, 1)) * GEOMETRY.pixel_size_mm**2
    np.testing.assert_allclose(total, shear.force_n, rtol=0.02, atol=0.002)
    off = np.hypot(*np.subtract(shear.force_n, truth.force_n))
    assert off < 0.12 * np.hypot(*truth.force_n)
    assert off < 4 * np.hypot(*shear.force_error_n)
    assert min(shear.force_error_n) > side_of(bundle).side_error_share * np.hypot(*shear.force_n)
    assert shear.centre_mm == pytest.approx(press.place[:2], abs=0.02)
    np.testing.assert_allclose(shear.field_mm, truth.dots_mm, atol=0.02)
    assert np.sqrt(np.mean((shear.field_mm - truth.dots_mm) ** 2)) < 0.005


def test_the_gel_carries_the_imprint_along(scene: Scene, bundle: Bundle) -> None:
    """By 1 mm, a third of the radius of the contact: kernels from where it is now would be 7 % off."""
    shear, truth = shear_of(scene, bundle, DRAGS[3]), scene.shear(DRAGS[3])
    assert shear.force_n == pytest.approx(truth.force_n, abs=0.04 * truth.force_n[0])


def test_a_twist_is_told_within_a_quarter(scene: Scene, bundle: Bundle) -> None:
    shear, truth = shear_of(scene, bundle, DRAGS[4]), scene.shear(DRAGS[4])
    assert shear.torque_nmm == pytest.approx(truth.torque_nmm, rel=0.25)
    assert truth.torque_nmm > 0.5
    assert shear.torque_error_nmm > side_of(bundle).side_error_share * shear.torque_nmm


def test_a_press_has_no_force_along_the_gel(scene: Scene, bundle: Bundle) -> None:
    for press in (Press("BALL", 1.0, 4.0, 2.0), Press("CYLINDER", 0.5, -3.0, 0.0)):
        shear = shear_of(scene, bundle, press)
        normal = felt(scene, bundle, press, None).force
        assert np.hypot(*shear.force_n) < 0.02 * normal.normal_n


def test_a_fifth_of_the_dots_missing_costs_little(scene: Scene, bundle: Bundle) -> None:
    truth = scene.shear(DRAGS[0])
    shear = shear_of(scene, bundle, DRAGS[0], seed=2, unseen=0.2)
    assert np.isnan(shear.field_mm).any()
    assert np.hypot(*np.subtract(shear.force_n, truth.force_n)) < 0.15 * np.hypot(*truth.force_n)


def test_nothing_touched_is_no_force_and_without_dots_there_is_nothing_to_say(scene: Scene, bundle: Bundle) -> None:
    shear = felt(scene, bundle, None, seen_dots(scene, None, np.random.default_rng(0))).shear
    assert (shear.force_n, shear.traction_mpa) == ((0, 0), None)
    assert felt(scene, bundle, DRAGS[0], None).shear is None


def test_dots_of_another_gel_give_no_force(scene: Scene, bundle: Bundle) -> None:
    dots = replace(seen_dots(scene, DRAGS[0], np.random.default_rng(0)), problem="this is another gel")
    shear = felt(scene, bundle, DRAGS[0], dots).shear
    assert shear.force_n is None
    assert shear.unknown == "this is another gel"
    assert np.isnan(shear.field_mm).all()


def test_a_bundle_without_a_constant_knows_the_displacement_alone(scene: Scene, bundle: Bundle) -> None:
    plain = replace(bundle, files={name: file for name, file in bundle.files.items() if name != FILE_NAME})
    shear = felt(scene, plain, DRAGS[0], seen_dots(scene, DRAGS[0], np.random.default_rng(0))).shear
    assert shear.force_n is None
    assert "calibrate force" in shear.unknown
    assert np.nanmax(shear.field_mm) > 0.2
    assert shear.flags == (PERSPECTIVE,)


def test_the_constant_scales_the_force(scene: Scene, bundle: Bundle) -> None:
    record = ForceRecord.model_validate_json(bundle.files[FILE_NAME])
    other = replace(bundle, files={**bundle.files, **record.model_copy(update={"side_scale": 2.0}).files()})
    one, two = (shear_of(scene, each, DRAGS[0]) for each in (bundle, other))
    np.testing.assert_allclose(two.force_n, np.multiply(one.force_n, 2))


def test_a_contact_at_the_border_and_one_far_from_dots_are_flagged(scene: Scene, bundle: Bundle) -> None:
    aside = shear_of(scene, bundle, Press("BALL", 0.6, 14.0, 0.0, ((0.2, 0.0, 0.0),)))
    assert FEW_DOTS in aside.flags
    cut = shear_of(scene, bundle, Press("BALL", 0.8, 18.0, 0.0, ((0.1, 0.0, 0.0),)))
    assert BEYOND_VIEW in cut.flags


def test_a_plate_that_is_felt_pulls_as_a_sheared_block_and_carries_the_flags_of_its_normal_force(
    scene: Scene, bundle: Bundle
) -> None:
    """It ends 20 px inside the view; under it the gel is sheared by 0.2 mm over 5 mm, at a modulus of E / 2.98."""
    depth = np.zeros(GEOMETRY.image_shape, np.float32)
    depth[20:-20, 20:-20] = 0.3
    dots = seen_dots(scene, None, np.random.default_rng(0))
    _, spread = BundleMeasures(bundle).dot_motion(depth, dots)
    carried = (np.array([0.2, 0.0]) - spread) / GEOMETRY.pixel_size_mm
    measures = BundleMeasures(bundle)
    shear = measures.shear(depth, replace(dots, places_px=dots.places_px + carried), measures.force(depth))
    area = (depth > 0).sum() * GEOMETRY.pixel_size_mm**2
    assert shear.force_n == pytest.approx(
        (area * side_of(bundle).youngs_modulus_mpa / 2.98 * 0.2 / 5.0, 0.0), rel=0.25, abs=0.1
    )
    assert HEAVIER in shear.flags


def test_more_than_friction_holds_is_flagged(scene: Scene, bundle: Bundle) -> None:
    """As where the depth is told far too low."""
    press = DRAGS[0]
    measures, dots = BundleMeasures(bundle), seen_dots(scene, press, np.random.default_rng(0))
    depth = felt(scene, bundle, press, dots).depth_mm
    told = {share: measures.shear(depth * share, dots, measures.force(depth * share)) for share in (1.0, 0.1)}
    assert [FRICTION in shear.flags for shear in told.values()] == [False, True]


@pytest.mark.parametrize("press", [None, Press("BALL", 0.3, 0.0, 0.0)])
def test_dots_that_no_felt_contact_moves_give_no_force(scene: Scene, bundle: Bundle, press: Press | None) -> None:
    """As under a plate that fills the view: it drags every dot, and little or no depth is felt."""
    dots = seen_dots(scene, press, np.random.default_rng(0))
    dragged = replace(dots, places_px=dots.places_px + 0.2 / GEOMETRY.pixel_size_mm)
    shear = felt(scene, bundle, press, dragged).shear
    assert shear.force_n is None
    assert "fill the view" in shear.unknown
    assert np.nanmedian(np.abs(shear.field_mm)) > 0.15


@pytest.mark.parametrize(("by_mm", "known"), [(0.0, True), (0.018, True), (0.022, False)])
def test_what_is_not_felt_and_may_fill_the_view_is_in_the_error_or_makes_it_unknown(
    scene: Scene, bundle: Bundle, by_mm: float, known: bool
) -> None:
    """A block of the view's area, sheared by what all dots have moved: G A u / t."""
    dots = seen_dots(scene, None, np.random.default_rng(0))
    dots = replace(dots, places_px=dots.places_px + np.array([by_mm, 0.0]) / GEOMETRY.pixel_size_mm)
    shear = felt(scene, bundle, None, dots).shear
    if not known:
        assert (shear.force_n, "fill the view" in shear.unknown) == (None, True)
        return
    area = np.prod(GEOMETRY.image_shape) * GEOMETRY.pixel_size_mm**2
    moved = shear.field_mm.mean(axis=0)
    unsure_mm = np.hypot(np.hypot(*moved), 0.01 / np.sqrt(len(dots.reasons)))
    pull = side_of(bundle).youngs_modulus_mpa / 2.98 * area * unsure_mm / GEOMETRY.gel_thickness_mm
    assert moved[0] == pytest.approx(by_mm, abs=0.002)
    assert shear.force_n == (0.0, 0.0)
    assert shear.force_error_n == pytest.approx((pull, pull))
    assert shear.torque_error_nmm == pytest.approx(pull * np.sqrt(area / (2 * np.pi)))
