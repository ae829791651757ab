"""A bundle with a lens: what is felt has its true shape and size."""

from pathlib import Path

import numpy as np
import pytest

from gellight.base.errors import BundleError
from gellight.base.settings import ReconstructionSettings, Settings
from gellight.bundle.bundle import Bundle, extend_bundle
from gellight.daemon.configuration import mode_config
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import TactileFrame
from gellight.reconstruction.lens import undistortion as module
from gellight.reconstruction.lens.model import Lens
from gellight.reconstruction.lens.undistortion import (
    FILE_NAME,
    Undistortion,
)
from tests.helpers.distorted import TrueLens
from tests.helpers.linear_sensor import linear_bundle, photograph
from tests.helpers.small_bundles import with_lens

SHAPE = (240, 320)
PIXEL_MM = 0.1
BALL_MM, PRESSED_MM = 5.0, 0.8
CONTACT_MM = np.sqrt(BALL_MM**2 - (BALL_MM - PRESSED_MM) ** 2)
PLACE = np.array([9.0, -6.0])
"""mm; the radius of the contact is 2.7 mm, the view 32 x 24 mm"""
MIDDLE = ((SHAPE[1] - 1) / 2, (SHAPE[0] - 1) / 2)
BARREL = TrueLens(k1=-0.10, centre_px=MIDDLE, pixel_mm=(PIXEL_MM, PIXEL_MM), shape=SHAPE)
STRAIGHT = TrueLens(centre_px=MIDDLE, pixel_mm=(PIXEL_MM, PIXEL_MM), shape=SHAPE)


def bent_by(bundle: Bundle, lens: TrueLens, *, from_circles: bool = False) -> Bundle:
    """The bundle with the record of a lens."""
    return with_lens(
        bundle, image_width_px=SHAPE[1], image_height_px=SHAPE[0], centre_px=lens.centre_px, k1=lens.k1,
        px_per_mm=(1 / PIXEL_MM, 0.0, 1 / PIXEL_MM), learnt_from_circles=from_circles,
    )  # fmt: skip


def lens_of(bundle: Bundle) -> Lens:
    return module.lens_of(module.LensRecord.in_bundle(bundle))


@pytest.fixture
def plain(tmp_path: Path) -> Bundle:
    return linear_bundle(tmp_path / "plain", SHAPE, pixel_size_mm=(PIXEL_MM, PIXEL_MM))


def cap_slopes(offset: np.ndarray, ball: float, contact: float) -> np.ndarray:
    """Slopes (..., 2) of a ball's cap in a rigid plane, at offsets from its centre in any unit."""
    r2 = (offset**2).sum(axis=-1, keepdims=True)
    return np.where(r2 < contact**2, -offset / np.sqrt(np.maximum(ball**2 - r2, 1e-9)), 0).astype(np.float32)


def felt(bundle: Bundle, slopes: np.ndarray) -> TactileFrame:
    return Reconstructor(bundle).reconstruct(photograph(slopes))


def extent_mm(frame: TactileFrame) -> tuple[float, float, np.ndarray]:
    """Standard deviations (largest, smallest), mm, and centre of the part deeper than a quarter, from its moments."""
    rows, columns = np.nonzero(frame.depth_mm > 0.25 * PRESSED_MM)
    points = (np.column_stack([columns, rows]) - MIDDLE) * PIXEL_MM
    small, large = np.sqrt(np.linalg.eigvalsh(np.cov(points.T)))
    return float(large), float(small), points.mean(axis=0)


def test_a_ball_pressed_near_a_corner_of_a_barrel_lens_is_round_and_where_it_is(plain: Bundle) -> None:
    slopes = cap_slopes(BARREL.gel_of_pixels() - PLACE, BALL_MM, CONTACT_MM)
    bent = felt(plain, slopes)
    straight = felt(bent_by(plain, BARREL), slopes)
    large, small, centre = extent_mm(straight)
    assert large / small == pytest.approx(1, abs=0.01)
    # Deeper than a quarter is a disc, whose standard deviation is half its radius.
    assert 2 * large == pytest.approx(np.sqrt(BALL_MM**2 - (BALL_MM - 0.75 * PRESSED_MM) ** 2), rel=0.02)
    np.testing.assert_allclose(centre, PLACE, atol=0.02)
    assert straight.contact.indentation_mm == pytest.approx(PRESSED_MM, rel=0.02)
    assert bent.contact.indentation_mm < 0.95 * PRESSED_MM
    assert extent_mm(bent)[0] / extent_mm(bent)[1] > 1.05
    assert np.linalg.norm(extent_mm(bent)[2] - PLACE) > 0.3


def test_a_network_that_learnt_from_circles_in_the_picture_also_feels_the_true_ball(plain: Bundle) -> None:
    centre_px = BARREL.to_picture(PLACE)
    rows, columns = np.indices(SHAPE)
    offset_px = np.stack([columns, rows], axis=-1) - centre_px
    true_offset = BARREL.gel_of_pixels() - PLACE
    inside = (true_offset**2).sum(axis=-1, keepdims=True) < CONTACT_MM**2
    # What `gellight calibrate fit` teaches: the ball has the same radius in px everywhere in the picture.
    taught = np.where(inside, cap_slopes(offset_px, BALL_MM / PIXEL_MM, np.inf), 0).astype(np.float32)
    frame = felt(bent_by(plain, BARREL, from_circles=True), taught)
    unaware = felt(bent_by(plain, BARREL), taught)
    assert frame.contact.indentation_mm == pytest.approx(PRESSED_MM, rel=0.03)
    assert unaware.contact.indentation_mm < 0.95 * PRESSED_MM
    assert extent_mm(frame)[0] / extent_mm(frame)[1] == pytest.approx(1, abs=0.02)


def test_a_lens_without_distortion_changes_nothing(plain: Bundle) -> None:
    slopes = cap_slopes(STRAIGHT.gel_of_pixels() - PLACE, BALL_MM, CONTACT_MM)
    before = felt(plain, slopes)
    for from_circles in (False, True):
        bundle = bent_by(plain, STRAIGHT, from_circles=from_circles)
        after = felt(bundle, slopes)
        np.testing.assert_allclose(after.gradient_map, before.gradient_map, atol=1e-5)
        np.testing.assert_allclose(after.depth_mm, before.depth_mm, atol=1e-5)
        assert (after.contact.mask == before.contact.mask).all()


def test_what_the_camera_does_not_see_is_not_felt(plain: Bundle) -> None:
    pincushion = TrueLens(k1=0.1, centre_px=MIDDLE, pixel_mm=(PIXEL_MM, PIXEL_MM), shape=SHAPE)
    slopes = cap_slopes(pincushion.gel_of_pixels() - (14.0, 10.5), BALL_MM, CONTACT_MM)
    frame = felt(bent_by(plain, pincushion), slopes)
    assert frame.contact.mask.any()
    assert not frame.contact.mask[-1, -1]
    assert frame.depth_mm[-1, -1] == 0


def test_a_labelled_press_is_judged_over_the_picture_it_was_labelled_in(plain: Bundle) -> None:
    slopes = cap_slopes(STRAIGHT.gel_of_pixels() - PLACE, BALL_MM, CONTACT_MM)
    bundle = bent_by(plain, BARREL)
    over_picture = Reconstructor(bundle, undistorted=False).reconstruct(photograph(slopes))
    np.testing.assert_array_equal(over_picture.depth_mm, felt(plain, slopes).depth_mm)


@pytest.mark.parametrize(("content", "said"), [(b"{", "it is no JSON"), (b'{"schema_version": 1}', "image_width_px")])
def test_a_damaged_lens_file_is_refused(plain: Bundle, tmp_path: Path, content: bytes, said: str) -> None:
    bundle = extend_bundle(plain, tmp_path / "broken", {FILE_NAME: content})
    with pytest.raises(BundleError, match=rf"lens.json: {said}.*gellight calibrate lens"):
        Reconstructor(bundle)


def test_a_lens_of_another_picture_size_is_refused(tmp_path: Path) -> None:
    small = linear_bundle(tmp_path / "small", (120, 160), pixel_size_mm=(PIXEL_MM, PIXEL_MM))
    bundle = bent_by(small, BARREL)
    with pytest.raises(BundleError, match="is for 320 x 240 px, the bundle for 160 x 120 px"):
        Reconstructor(bundle)


def test_photometric_mode_refuses_a_bundle_with_a_lens(plain: Bundle) -> None:
    bundle = bent_by(plain, BARREL)
    with pytest.raises(BundleError, match=r"has lens.json.*use network mode"):
        mode_config(bundle, Settings(reconstruction=ReconstructionSettings(mode="photometric")))


def test_a_small_contact_keeps_its_slopes_between_the_pixels(plain: Bundle) -> None:
    # A picture that is shifted by half a pixel each way is the worst that resampling can meet.
    shifted = lens_of(bent_by(plain, TrueLens(centre_px=(MIDDLE[0] + 0.5, MIDDLE[1] + 0.5))))
    undistortion = Undistortion(shifted, (PIXEL_MM, PIXEL_MM), from_circles=False)
    sigma_px = 3.0

    def slopes(by_px: float) -> np.ndarray:
        offset = STRAIGHT.gel_of_pixels() / PIXEL_MM + by_px
        bump = np.exp(-(offset**2).sum(axis=-1, keepdims=True) / (2 * sigma_px**2))
        return (-offset / sigma_px**2 * bump).astype(np.float32)

    touched = np.linalg.norm(slopes(0.0), axis=-1) > 1e-4
    moved, moved_touch = undistortion.apply(slopes(0.0), touched)
    error = np.abs(moved - slopes(0.5)).max() / np.abs(slopes(0.5)).max()
    assert error < 0.01
    assert abs(int(moved_touch.sum()) - int(touched.sum())) < 0.02 * touched.sum()
