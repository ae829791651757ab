"""The native form of the frame path beside the NumPy form it must agree with."""

import numpy as np
import pytest

from gellight.bundle.bundle import Bundle
from gellight.frame_path.pipeline import Form, Reconstructor
from gellight.frames.frames import TactileFrame
from gellight.reconstruction.contact import find_contact
from gellight.reconstruction.integration import angle_deg


def both(bundle: Bundle, **options: object) -> tuple[Reconstructor, Reconstructor]:
    native, cells = (Reconstructor(bundle, form=form, **options) for form in (Form.NATIVE, Form.CELLS))  # type: ignore[arg-type]
    assert str(native.status()["computed_by"]).startswith("C, ")
    assert cells.status()["computed_by"] == "NumPy, cells"
    return native, cells


def agree(found: TactileFrame, right: TactileFrame, *, but: float = 0.0) -> None:
    """Compare two frames.

    but: share of the pixels left out. The networks of both round otherwise, so of many pixels at a limit one may be
    asked about in one form alone; smoothing and integration spread it.
    """
    angle = angle_deg(found.normal_map.reshape(-1, 3), right.normal_map.reshape(-1, 3))
    apart = np.abs(found.gradient_map - right.gradient_map) > 2e-4 * (1 + np.abs(right.gradient_map))
    beyond = [angle >= 0.02, np.abs(found.depth_mm - right.depth_mm) >= 1e-5, apart]
    assert max(np.count_nonzero(pixels) for pixels in beyond) <= but * angle.size
    np.testing.assert_allclose(found.difference, right.difference, atol=1e-4)
    # Of the same depth: the rim of a torn surface may jump. Pixels are square.
    contact = find_contact(found.depth_mm, 1.0)
    jumping = 2e-5 * right.depth_mm.size
    assert np.count_nonzero(found.contact.mask != contact.mask) <= jumping
    assert found.contact.indentation_mm == pytest.approx(right.contact.indentation_mm, abs=1e-5)
    if right.contact.centroid_mm is not None:
        pixels, apart = np.count_nonzero(right.contact.mask), np.count_nonzero(found.contact.mask != right.contact.mask)
        pixel_mm2 = right.contact.area_mm2 / pixels
        # What jumps at the rim moves the centroid by as much as it may lie from it.
        moved_mm = apart / pixels * np.sqrt(pixel_mm2) * np.hypot(*right.depth_mm.shape)
        assert found.contact.area_mm2 == pytest.approx(right.contact.area_mm2, abs=2 * max(apart, jumping) * pixel_mm2)
        assert found.contact.centroid_mm == pytest.approx(right.contact.centroid_mm, abs=1e-3 + moved_mm)
        assert apart < 2e-3 * pixels
    assert tuple(found.stage_seconds) == tuple(right.stage_seconds)
