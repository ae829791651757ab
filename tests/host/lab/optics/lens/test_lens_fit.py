"""Pictures of pin grids to a lens: right to a tenth of a pixel everywhere, or refused with the reason."""

from collections.abc import Callable
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle, load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame
from gellight.frames.pixel_grid import over_gel
from gellight.lab.optics.lens import lens_fit
from gellight.lab.optics.lens.lattice import Lattice, find_lattice
from gellight.lab.optics.lens.lens_fit import LensFit, check_pins, fit_lens, read_pins, spacing_px
from gellight.lab.optics.lens.pins import dimples, spots
from gellight.lab.simulator.scene import Press as Pressed
from gellight.lab.simulator.scene import Scene
from gellight.reconstruction.lens.model import middle_px
from sim_reference.camera import CameraResponse, digitise
from sim_reference.geometry import AS_BUILT
from tests.helpers.distorted import (
    PIXEL_MM,
    SHAPE,
    DivisionLens,
    TrueLens,
    dimple_picture,
    map_error_px,
    pin_picture,
    untouched,
)
from tests.helpers.linear_sensor import linear_bundle

BARREL = TrueLens(k1=-0.05, centre_px=(331.0, 230.0))
DIVISION = DivisionLens(k1=-0.05, centre_px=(325.0, 247.0))


SIZE_MM = (PIXEL_MM, PIXEL_MM)
SPACING_PX = spacing_px(SIZE_MM, 2.0)


def measured(*pictures: np.ndarray, pitch_mm: float = 2.0) -> LensFit:
    lattices = [
        read_pins(
            spots(picture.astype(np.float32), spacing_px(SIZE_MM, pitch_mm)),
            pixel_size_mm=SIZE_MM,
            pitch_mm=pitch_mm,
            source="grid.png",
        )
        for picture in pictures
    ]
    return fit_lens(lattices, SHAPE, pitch_mm)


def felt(bundle: Bundle, reference: np.ndarray, picture: np.ndarray) -> LensFit:
    """The lens by pins that press into the gel of a sensor."""
    reconstructor = Reconstructor(bundle.with_reference(reference, frames=20))
    depth = reconstructor.reconstruct(CameraFrame(image=picture, time_s=0.0, sequence=0, source="")).depth_mm
    depth = over_gel(depth, bundle.manifest.camera_height_mm)
    lattice = read_pins(dimples(depth, SPACING_PX), pixel_size_mm=SIZE_MM, pitch_mm=2.0, source="grid.png")
    return fit_lens([lattice], SHAPE, 2.0)


def error_px(fit: LensFit, lens: TrueLens) -> float:
    rows, columns = np.indices(lens.shape)
    pixels = np.stack([columns, rows], axis=-1).astype(float)
    return map_error_px(fit.lens.to_gel(pixels), lens.gel_of_pixels())


@pytest.mark.parametrize(
    ("lens", "how"),
    [
        (BARREL, {"noise": 3.0, "missing": 0.15, "seed": 5}),
        (BARREL, {"noise": 3.0, "angle_deg": 44.0, "seed": 6}),
        (BARREL, {"noise": 3.0, "depth": 60.0, "seed": 7}),
        (TrueLens(k1=-0.08, k2=0.03, centre_px=(300.0, 252.0)), {"noise": 2.0, "seed": 8}),
        (TrueLens(k1=0.05, pixel_mm=(0.0600, 0.0576)), {"noise": 2.0, "seed": 9}),
        (DIVISION, {"noise": 2.0, "missing": 0.1, "seed": 10}),
        (TrueLens(), {"noise": 2.0, "seed": 11}),
    ],
    ids=["barrel", "turned", "bright pins", "two coefficients", "pincushion, oblong", "other family", "no distortion"],
)
def test_the_map_is_right_to_a_tenth_of_a_pixel_over_the_whole_picture(lens: TrueLens, how: dict[str, float]) -> None:
    fit = measured(pin_picture(lens, **how))
    assert error_px(fit, lens) < 0.1
    assert fit.rms_after_px < 0.1
    assert fit.rms_before_px > (10 if lens.k1 else 0.99) * fit.rms_after_px


def test_pins_that_press_into_the_gel_are_felt_by_the_network(tmp_path: Path) -> None:
    linear = linear_bundle(tmp_path / "linear", SHAPE, pixel_size_mm=SIZE_MM)
    fit = felt(linear, untouched(SHAPE), dimple_picture(BARREL, noise=2.0, seed=3))
    assert fit.pins > 200
    assert error_px(fit, BARREL) < 0.1


def test_pins_are_found_to_a_tenth_of_a_pixel_though_light_comes_from_another_side_at_every_place() -> None:
    scene = Scene(AS_BUILT, CameraResponse())
    random = np.random.default_rng(0)
    picture = digitise(scene.show(Pressed("PINS", 0.2, 0.3, -0.2))[0], 1.0, random)
    fit = felt(load_bundle("synthetic"), scene.show(None)[0], picture)
    assert fit.pins > 200
    assert fit.rms_after_px < 0.1
    assert error_px(fit, TrueLens()) < 0.1


def test_pixels_in_the_middle_have_the_size_that_the_pitch_gives_them() -> None:
    fit = measured(pin_picture(TrueLens(k1=-0.05, pixel_mm=(0.0600, 0.0576)), noise=2.0, seed=4))
    assert fit.lens.mm_per_px == pytest.approx((0.0600, 0.0576), rel=1e-3)


def test_two_pictures_of_half_a_grid_are_as_good_as_one_of_a_whole_one() -> None:
    left = pin_picture(BARREL, only=(-np.inf, 1.0), seed=1, noise=2.0)
    right = pin_picture(BARREL, only=(-1.0, np.inf), seed=2, noise=2.0, angle_deg=-9.0, shift_mm=(0.1, 0.6))
    with pytest.raises(InputError, match="of 16 parts of the view hold no pin"):
        measured(left)
    assert error_px(measured(left, right), BARREL) < 0.1


def test_the_lens_and_its_inverse_agree() -> None:
    lens = measured(pin_picture(BARREL)).lens
    gel = np.random.default_rng(0).uniform(-15, 15, (50, 2)) * (1, 0.7)
    np.testing.assert_allclose(lens.to_gel(lens.to_picture(gel)), gel, atol=1e-9)
    np.testing.assert_allclose(lens.to_gel(middle_px(lens.image_shape)), 0, atol=1e-9)
    step = 1e-5
    by_steps = [(lens.to_picture(gel + move) - lens.to_picture(gel - move)) / (2 * step) for move in np.eye(2) * step]
    np.testing.assert_allclose(lens.jacobian(gel), np.stack(by_steps, axis=-1), atol=1e-5)


def test_a_grid_is_followed_round_gaps_and_strays_are_left_out() -> None:
    places = np.array([(i, j) for i in range(12) for j in range(9) if (i, j) not in {(4, 4), (4, 5), (7, 2)}])
    turn = np.array([[0.9, -0.3], [0.3, 0.9]])
    strays = np.array([[150.0, 152.0], [30.0, 203.0]])
    lattice = find_lattice(np.concatenate([places @ turn.T * 30 + 50, strays]))
    assert len(lattice.points) == len(places)
    assert lattice.strays == 2
    columns = np.column_stack([lattice.places, np.ones(len(places))])
    matrix = np.linalg.lstsq(columns, lattice.points, rcond=None)[0]
    np.testing.assert_allclose(columns @ matrix, lattice.points, atol=1e-9)
    assert np.linalg.det(matrix[:2]) > 0


def in_disorder() -> np.ndarray:
    picture, (rows, columns) = untouched(SHAPE), np.indices(SHAPE)
    for x, y in np.random.default_rng(3).uniform(20, 460, (120, 2)) * (1.3, 1):
        picture -= 50 * np.exp(-((columns - x) ** 2 + (rows - y) ** 2) / 40)[..., None]
    return picture


@pytest.mark.parametrize(
    ("picture", "refusal"),
    [
        (partial(pin_picture, BARREL, depth=0.0, noise=3.0), "no grid of pins"),
        (
            partial(pin_picture, BARREL, noise=2.0, jitter_mm=0.15),
            r"from where any lens would show them|no row and column",
        ),
        (in_disorder, r"no grid of pins|no row and column"),
    ],
    ids=["no grid", "an irregular one", "disorder"],
)
def test_what_is_no_grid_of_pins_is_refused(picture: Callable[[], np.ndarray], refusal: str) -> None:
    with pytest.raises(InputError, match=refusal):
        measured(picture())


def lattice(count: int, strays: int = 0, spacing: float = 30.0) -> Lattice:
    """Points over all of the view, row by row."""
    places = np.array([(i, j) for j in range(5) for i in range(5)])[[*range(5, 25), 0, 1, 2, 4][:count]]
    points = (places + 0.5) * np.array(SHAPE[::-1]) / 5
    return Lattice(points=points, places=places, spacing_px=spacing, strays=strays)


@pytest.mark.parametrize(
    ("found", "refusal"),
    [
        ([lattice(24)], ""),
        ([lattice(23)], "23 pins in all, 24 are needed"),
        ([lattice(12), lattice(12)], "of 16 parts of the view hold no pin"),
    ],
)
def test_24_pins_in_every_part_of_the_view_are_needed(found: list[Lattice], refusal: str) -> None:
    with pytest.raises(InputError, match=refusal) if refusal else nullcontext():
        check_pins(found, SHAPE)


@pytest.mark.parametrize(
    ("found", "refusal"),
    [
        (lattice(16, 4, 32.9), ""),
        (lattice(16, 4, 27.1), ""),
        (lattice(16, 4, 33.1), "give the right pitch"),
        (lattice(16, 4, 26.9), "give the right pitch"),
        (lattice(16, 5), "5 of 21 spots are in no row"),
    ],
)
def test_pins_are_a_tenth_off_their_pitch_and_a_fifth_of_the_spots_astray_at_most(found: Lattice, refusal: str) -> None:
    with pytest.raises(InputError, match=refusal) if refusal else nullcontext():
        lens_fit._check_lattice(found, 30.0, 2.0, "grid.png")


@pytest.mark.parametrize(("rms_px", "right"), [(0.49, True), (0.51, False)])
def test_pins_lie_within_half_a_pixel_of_where_the_lens_shows_them(rms_px: float, right: bool) -> None:
    lens = Mock(image_shape=SHAPE, jacobian=lambda at: np.tile(np.eye(2), (9, 1, 1)))
    with nullcontext() if right else pytest.raises(InputError, match=r"0\.51 px from where any lens"):
        lens_fit._check_fit(Mock(rms_after_px=rms_px, lens=lens))


@pytest.mark.parametrize(("off", "strays"), [(0.28, 0), (0.32, 1)])
def test_a_pin_may_lie_three_tenths_of_the_spacing_off_its_place(off: float, strays: int) -> None:
    points = np.array([(30.0 * i, 30.0 * j) for i in range(6) for j in range(6)])
    points[-1] += off * 30 / np.sqrt(2)
    assert find_lattice(points).strays == strays
