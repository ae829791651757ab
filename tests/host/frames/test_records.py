"""What a program sees of frames: one line each, and `==` that answers."""

import dataclasses
import importlib
import pkgutil
import typing
from collections.abc import Iterator

import numpy as np
import pytest

import gellight
import gelnet
import sim_reference
from gellight.bundle.bundle import load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame, Contact, GroundTruth, LightLabel, LightState
from gellight.frames.pose import ObjectPose, PoseFigures
from gellight.frames.shear import DotsSeen, Shear
from gellight.opening import open_camera


def classes() -> Iterator[type]:
    """Yield every dataclass of our packages, wherever it is defined."""
    for package in (gellight, sim_reference, gelnet):
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if module.name.endswith("__main__") or "-" in module.name:  # a library of some platform
                continue
            for item in vars(importlib.import_module(module.name)).values():
                if isinstance(item, type) and item.__module__ == module.name and dataclasses.is_dataclass(item):
                    yield item


def holds_arrays(annotation: object) -> bool:
    """Whether a value of this type is an array, or a container of arrays."""
    origin = typing.get_origin(annotation) or annotation
    return origin is np.ndarray or any(map(holds_arrays, typing.get_args(annotation)))


@pytest.mark.nightly  # some modules need packages that few have, such as PyTorch
def test_no_dataclass_that_holds_arrays_compares_them() -> None:
    found = []
    for item in classes():
        hints = typing.get_type_hints(item)
        if any(holds_arrays(hints[field.name]) for field in dataclasses.fields(item) if field.compare):
            found.append(item)
    assert len(found) > 30
    assert [item for item in found if item.__eq__ is not object.__eq__] == []


def test_frames_are_shown_in_one_line_and_compared_without_an_error() -> None:
    with open_camera("sim://?board=0&object=BALL&depth=1.0") as camera:
        felt = Reconstructor(load_bundle("synthetic")).reconstruct(camera.read())
    frame, again = felt.camera_frame, dataclasses.replace(felt)
    lit = dataclasses.replace(frame, label=LightLabel(state=LightState.CLEAN, group=1))
    for item in (felt, frame, lit, felt.contact, frame.truth, load_bundle("synthetic")):
        assert "\n" not in repr(item)
        assert len(repr(item)) < 120, repr(item)
    assert f"640x480, sequence {frame.sequence}, {frame.time_s:.3f} s, {felt.contact.indentation_mm:.3f} mm" in repr(
        felt
    )
    assert repr(lit).endswith("s, clean light>")
    assert felt == felt
    assert felt != again
    assert len({felt, again, frame, felt.contact}) == 4, "they can be kept in sets"


def test_a_gel_that_nothing_touches_dots_shear_and_pose_are_printed_in_one_line_too() -> None:
    free = Contact(mask=np.zeros((2, 3), bool), area_mm2=0.0, indentation_mm=0.0, centroid_mm=None)
    assert repr(free) == "<Contact: no contact>"
    assert isinstance(CameraFrame(image=np.zeros((2, 3, 3), np.uint8), time_s=1.0, sequence=4).__repr__(), str)
    flat = np.zeros((2, 3), np.float32)
    truth = GroundTruth(depth_mm=flat, gradient_map=np.zeros((2, 3, 2), np.float32), contact=flat > 0)
    assert repr(truth) == "<GroundTruth 3x2, 0.000 mm deep>"
    rest, reasons = np.zeros((3, 2)), np.array([0, 1, 0], np.uint8)
    dots = DotsSeen(rest_px=rest, places_px=rest, reasons=reasons)
    assert repr(dots) == "<DotsSeen 2 of 3>"
    shear = Shear(dots=dots, field_mm=rest, force_n=(0.25, -1.0))
    assert repr(shear) == "<Shear by 2 of 3 dots, force (0.250, -1.000) N>"
    assert repr(dataclasses.replace(shear, force_n=None, unknown="too few")) == "<Shear by 2 of 3 dots, force too few>"
    figures = PoseFigures(number=2, since_sequence=7, origin_mm=(1, 2, 3))
    assert repr(ObjectPose.of(figures)) == "<ObjectPose: object 2 is lost>"
