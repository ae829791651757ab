"""The native form of the frame path beside the NumPy form it must agree with."""

import numpy as np
import pytest

from gellight.bundle.bundle import Bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import TactileFrame
from gellight.reconstruction.contact import find_contact
from gellight.reconstruction.integration import angle_deg


def both(bundle: Bundle, **options: object) -> tuple[Reconstructor, Reconstructor]:
    native, pixels = (Reconstructor(bundle, native=native, **options) for native in (True, False))  # type: ignore[arg-type]
    assert str(native.status()["computed_by"]).startswith("C, ")
    assert pixels.status()["computed_by"] == "NumPy"
    return native, pixels


def agree(found: TactileFrame, right: TactileFrame, *, linear: bool = False, mean_mm: float = 9e-3) -> None:
    """Compare two frames, of a network that is `linear` in the colours: there cells and pixels give the same.

    Another one bends between cells: on steep waves by 0.23 degrees and 11 micrometres in the mean,
    of an indentation by 0.9 per cent at most.
    """
    angle = angle_deg(found.normal_map.reshape(-1, 3), right.normal_map.reshape(-1, 3))
    depth_mm = np.abs(found.depth_mm - right.depth_mm)
    apart = np.abs(found.gradient_map - right.gradient_map) / (1 + np.abs(right.gradient_map))
    if linear:
        assert angle.max() < 0.02
        assert depth_mm.max() < 1e-5
        assert apart.max() < 2e-4
    assert angle.mean() < 0.25
    assert depth_mm.mean() < mean_mm
    np.testing.assert_allclose(found.difference, right.difference, atol=1e-4)
    # Of the same depth: the rim of a torn surface may jump. Pixels are square.
    contact = find_contact(found.depth_mm, 1.0)
    jumping = 2e-5 * right.depth_mm.size
    assert np.count_nonzero(found.contact.mask != contact.mask) <= jumping
    near = {"abs": 1e-5} if linear else {"abs": 8e-3, "rel": 0.01}
    assert found.contact.indentation_mm == pytest.approx(right.contact.indentation_mm, **near)
    if linear and right.contact.centroid_mm is not None:
        pixels, other = np.count_nonzero(right.contact.mask), np.count_nonzero(found.contact.mask != right.contact.mask)
        pixel_mm2 = right.contact.area_mm2 / pixels
        # What jumps at the rim moves the centroid by as much as it may lie from it.
        moved_mm = other / pixels * np.sqrt(pixel_mm2) * np.hypot(*right.depth_mm.shape)
        assert found.contact.area_mm2 == pytest.approx(right.contact.area_mm2, abs=2 * max(other, jumping) * pixel_mm2)
        assert found.contact.centroid_mm == pytest.approx(right.contact.centroid_mm, abs=1e-3 + moved_mm)
        assert other < 2e-3 * pixels
    assert tuple(found.stage_seconds) == tuple(right.stage_seconds)
