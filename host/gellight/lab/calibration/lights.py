"""The light of each LED, measured before the network is trained: the frame path then knows how depth changes it."""

import logging

import numpy as np

from gellight.base.errors import BundleError
from gellight.frames.picture import steps_in
from gellight.lab.calibration.display import Progress
from gellight.lab.calibration.pressing import ball_of
from gellight.lab.calibration.records import Preparation
from gellight.lab.calibration.run import CalibrationRun
from gellight.lab.calibration.sensing import detector_of, wait_free
from gellight.lab.optics.lights.adding import take_lights
from gellight.lab.optics.lights.ring_fit import fit_ring
from gellight.photometric.light_model import LightModel

logger = logging.getLogger(__name__)

FRAMES = 8
"""averaged under each LED"""
ALIKE = 0.1
"""Radius and height of the ring by its light may differ from [geometry] by this share. Where LEDs are taken to stand a
quarter too low, shadows that are not there make deep walls twice as wrong as none that are found."""


def measure_lights(run: CalibrationRun) -> LightModel | None:
    """Return the light of each LED on the untouched gel; None where it would be of no use.

    That is without a ring; with a view, for shadows are sought in pictures as the camera takes them; and where the
    light does not fit the ring of [geometry], which the user is told.
    """
    steps = steps_in(run.camera.bundle_files)
    if run.camera.ring is None or (steps is not None and steps.view is not None):
        return None
    run.display.update(instruction="The light of each LED is measured. Touch nothing.")
    wait_free(run, detector_of(run))
    try:
        return _measured(run)
    except BundleError as error:
        problem = f"no light of single LEDs, so deep presses are felt less exactly: {error}"
        logger.warning(problem)
        run.display.update(problem=problem)
        return None


def _measured(run: CalibrationRun) -> LightModel:
    """Light the LEDs one by one; BundleError where that is not the light of the ring of [geometry]."""

    def taking(index: int, groups: int) -> None:
        run.check_stopped()
        run.display.update(progress=Progress(done=index, wanted=groups, unit="lights"))

    colours = np.array(run.folder.figures(Preparation).led, np.uint8)
    pixel_size_mm = 2 * (ball_of(run).pixel_size_mm,)
    model = take_lights(run.camera, run.options.ring, colours, pixel_size_mm, FRAMES, taking)
    told, found = model.ring, fit_ring(model, pixel_size_mm).ring
    if max(abs(found.ring_radius_mm / told.ring_radius_mm - 1), abs(found.height_mm / told.height_mm - 1)) > ALIKE:
        raise BundleError(
            f"it falls off as that of LEDs {found.height_mm:.1f} mm above the gel on a radius of "
            f"{found.ring_radius_mm:.1f} mm, [geometry] has {told.height_mm:.1f} and {told.ring_radius_mm:.1f} mm: "
            "correct camera_height_mm, mounting_height_mm and ring_radius_mm there, then `gellight calibrate lights`"
        )
    return model
