"""GelNet under a changing light: depth where it was trained, and nothing made up elsewhere."""

from typing import Any

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.bundle.bundle import Bundle, load_bundle
from gellight.dashboard.identity_cache import IdentityCache
from gellight.dashboard.messages import encode as page_message
from gellight.dashboard.reference_views import ReferenceViews
from gellight.frame_path.pipeline import Reconstructor
from gellight.frame_path.sequence_path import SequencePath
from gellight.frames.frames import CameraFrame, LightLabel, LightState


@pytest.fixture(scope="module")
def bundle() -> Bundle:
    return load_bundle("synthetic")


@pytest.fixture(scope="module")
def path(bundle: Bundle) -> SequencePath:
    colours = bundle.colours
    return SequencePath(Reconstructor(bundle), np.stack([colours // 2, colours]))


def frame(bundle: Bundle, label: LightLabel | None, **changes: Any) -> CameraFrame:
    image = np.clip(np.rint(bundle.reference), 0, 255).astype(np.uint8)
    return CameraFrame(**{"image": image, "time_s": 1.0, "sequence": 3, "source": "test", "label": label, **changes})


def test_under_the_light_of_the_calibration_there_is_depth(bundle: Bundle, path: SequencePath) -> None:
    felt = path.reconstruct(frame(bundle, LightLabel(state=LightState.CLEAN, group=1)))
    assert np.isfinite(felt.depth_mm).all()
    assert felt.contact.indentation_mm < 0.05
    assert path.status()["mode"] == "sequence"
    assert path.status()["groups_with_depth"] == [1]


@pytest.mark.parametrize(
    "label",
    [
        LightLabel(state=LightState.CLEAN, group=0),
        LightLabel(state=LightState.MIXED),
        LightLabel(state=LightState.UNKNOWN),
        None,
    ],
)
def test_under_any_other_light_nothing_is_said_of_the_depth(
    bundle: Bundle, path: SequencePath, label: LightLabel | None
) -> None:
    felt = path.reconstruct(frame(bundle, label))
    assert felt.camera_frame.label == label
    for array in (felt.depth_mm, felt.gradient_map, felt.normal_map):
        assert np.isnan(array).all()
    assert np.isnan([felt.contact.indentation_mm, felt.contact.area_mm2]).all()
    assert not felt.contact.mask.any()
    assert felt.contact.centroid_mm is None
    assert np.abs(felt.difference).max() <= 0.5
    page_message(felt, pixel_size_mm=bundle.pixel_size_mm, references=ReferenceViews(), once=IdentityCache())


def test_a_picture_of_another_size_is_refused_under_every_light(bundle: Bundle, path: SequencePath) -> None:
    for label in (None, LightLabel(state=LightState.CLEAN, group=1)):
        with pytest.raises(InputError, match="64 x 48 px"):
            path.reconstruct(frame(bundle, label, image=np.zeros((48, 64, 3), np.uint8)))
