"""The errors against a true surface: of known size, over the map and over the contact."""

from dataclasses import replace

import numpy as np
import pytest

from gellight.frames.frames import CameraFrame, Contact, GroundTruth, TactileFrame
from gellight.reconstruction.errors import surface_errors

SHAPE = (6, 8)


def frame(depth_mm: np.ndarray, gradient_map: np.ndarray) -> TactileFrame:
    image = np.zeros((*SHAPE, 3), np.uint8)
    return TactileFrame(
        camera_frame=CameraFrame(image=image, time_s=0.0, sequence=0),
        difference=image.astype(np.float32),
        gradient_map=gradient_map,
        depth_mm=depth_mm,
        contact=Contact(mask=np.ones(SHAPE, np.bool_), area_mm2=0.0, indentation_mm=0.0, centroid_mm=None),
    )


def test_errors_are_means_over_the_map_and_over_the_true_contact() -> None:
    contact = np.zeros(SHAPE, np.bool_)
    contact[2:4, 2:6] = True
    true = GroundTruth(
        depth_mm=np.zeros(SHAPE, np.float32), gradient_map=np.zeros((*SHAPE, 2), np.float32), contact=contact
    )
    depth = np.where(contact, -0.5, 0.1).astype(np.float32)
    slopes = np.zeros((*SHAPE, 2), np.float32)
    slopes[contact, 0] = np.tan(np.radians(12))
    error = surface_errors(frame(depth, slopes), true)
    share = contact.mean()
    assert error.contact_depth_mm == pytest.approx(0.5)
    assert error.depth_mm == pytest.approx(0.5 * share + 0.1 * (1 - share))
    assert error.contact_normal_deg == pytest.approx(12, rel=1e-5)
    assert error.normal_deg == pytest.approx(12 * share, rel=1e-5)
    untouched = surface_errors(frame(depth, slopes), replace(true, contact=np.zeros(SHAPE, np.bool_)))
    assert (untouched.contact_normal_deg, untouched.contact_depth_mm) == (error.normal_deg, error.depth_mm)
