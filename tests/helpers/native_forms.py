"""The native form of the frame path beside the NumPy form it must agree with."""

import numpy as np
import pytest

from gellight.bundle.bundle import Bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import TactileFrame
from gellight.reconstruction.contact import find_contact
from gellight.reconstruction.integration import angle_deg
from gellight.reconstruction.native.cells import EVERY_PIXEL


def both(bundle: Bundle, **options: object) -> tuple[Reconstructor, Reconstructor]:
    """The native form, which asks the network at every touched pixel, and the NumPy form."""
    native, pixels = (Reconstructor(bundle, native=native, **options) for native in (True, False))  # type: ignore[arg-type]
    assert str(native.status()["computed_by"]).startswith("C, ")
    assert pixels.status()["computed_by"] == "NumPy"
    native._path.limits = EVERY_PIXEL  # type: ignore[attr-defined]
    return native, pixels


def agree(found: TactileFrame, right: TactileFrame) -> None:
    """Compare two frames, which differ by rounding alone."""
    angle = angle_deg(found.normal_map.reshape(-1, 3), right.normal_map.reshape(-1, 3))
    apart = np.abs(found.gradient_map - right.gradient_map) / (1 + np.abs(right.gradient_map))
    assert angle.max() < 0.02
    assert np.abs(found.depth_mm - right.depth_mm).max() < 1e-5
    assert apart.max() < 2e-4
    np.testing.assert_allclose(found.difference, right.difference, atol=1e-4)
    # Of the same depth, less what nothing touches: the rim of a torn surface may jump. Pixels are square.
    contact = find_contact(found.depth_mm, 1.0)
    jumping = 2e-5 * right.depth_mm.size
    assert np.count_nonzero(found.contact.mask & ~contact.mask) <= jumping
    assert found.contact.indentation_mm == pytest.approx(right.contact.indentation_mm, abs=1e-5)
    if right.contact.centroid_mm is not None:
        pixels, other = np.count_nonzero(right.contact.mask), np.count_nonzero(found.contact.mask != right.contact.mask)
        pixel_mm2 = right.contact.area_mm2 / pixels
        # What jumps at the rim moves the centroid by as much as it may lie from it.
        moved_mm = other / pixels * np.sqrt(pixel_mm2) * np.hypot(*right.depth_mm.shape)
        assert found.contact.area_mm2 == pytest.approx(right.contact.area_mm2, abs=2 * max(other, jumping) * pixel_mm2)
        assert found.contact.centroid_mm == pytest.approx(right.contact.centroid_mm, abs=1e-3 + moved_mm)
        assert other < 2e-3 * pixels
    assert tuple(found.stage_seconds) == tuple(right.stage_seconds)
