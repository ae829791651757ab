"""Step 3: the size of a pixel, from presses of a cylinder whose diameter is known."""

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BundleError, InputError
from gellight.lab.calibration.cylinder import Imprint, find_cylinder
from gellight.lab.calibration.display import Picture, Progress
from gellight.lab.calibration.records import MeasuredPixelSize, PixelSize, ShownCircle, UntouchedGel
from gellight.lab.calibration.run import CalibrationRun
from gellight.lab.calibration.sensing import check_light, detector_of, next_press, wait_free

SQUARE = 0.006
"""x and y may differ by this share; more is a camera mode that squeezes the picture"""
_LARGEST_SPREAD = 0.01  # chosen: presses agree to it; simulated ones give the scale to 0.2 %


def measure_pixel_size(run: CalibrationRun) -> None:
    """Keep mm per pixel: what was given, or else what presses of the cylinder say."""
    if (given := run.options.tools.pixel_size_mm) is not None:
        run.folder.finish(PixelSize(x_mm=given, y_mm=given, pixel_size_mm=given))
        return
    options, reference = run.options, run.folder.reference()
    noise, detector = run.folder.figures(UntouchedGel).noise_grey, detector_of(run)
    found: list[Imprint] = []
    refused = 0
    while len(found) < options.cylinder_presses:
        _announce(run, len(found))
        with next_press(run, detector, lambda hand: hand.cylinder(len(found))) as capture:
            assert capture is not None
            try:
                found.append(_measured(run, capture.image, reference, noise))
            except InputError as error:
                refused += 1
                run.refuse(error, tolerate=refused <= options.cylinder_presses)
    wait_free(run, detector)
    run.folder.finish(pixel_size(found, options.tools.cylinder_diameter_mm))


def _announce(run: CalibrationRun, done: int) -> None:
    run.display.update(
        instruction=f"Press the {run.options.tools.cylinder_diameter_mm:g} mm cylinder, its flat end straight, some "
        "tenths of a millimetre deep, each time at another place of the picture. Hold still, then lift.",
        progress=Progress(done=done, wanted=run.options.cylinder_presses, unit="presses"),
    )


def _measured(run: CalibrationRun, image: Picture, reference: NDArray[np.float32], noise: float) -> Imprint:
    """Measure one press and show it; InputError says why it is refused."""
    check_light(image, "the press")
    imprint = find_cylinder(image - reference, noise)
    run.display.update(
        problem="",
        press=ShownCircle(
            center_x_px=imprint.center_x_px,
            center_y_px=imprint.center_y_px,
            contact_radius_px=(imprint.radius_x_px + imprint.radius_y_px) / 2,
            state="measured",
        ),
    )
    run.display.show(cylinder=drawn(image, imprint))
    return imprint


def drawn(image: Picture, imprint: Imprint) -> Picture:
    """Draw the edge points of an imprint on its picture."""
    picture = image.copy()
    for x, y in np.rint(imprint.edge_px).astype(int):
        picture[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2] = (255, 240, 80)
    return picture


def pixel_size(found: list[Imprint], diameter_mm: float) -> MeasuredPixelSize:
    """Return mm per pixel in x and y, and how much the diameters of the presses spread.

    Raises BundleError where x and y differ or the presses disagree; the median guards against one bad press.
    """
    across = np.array([2 * one.radius_x_px for one in found])
    down = np.array([2 * one.radius_y_px for one in found])
    x_mm, y_mm = diameter_mm / float(np.median(across)), diameter_mm / float(np.median(down))
    spread = float(np.std(across + down, ddof=1)) / 2
    mean_px = float(np.mean(across + down)) / 2
    if spread > _LARGEST_SPREAD * mean_px:
        raise BundleError(
            f"the cylinder measures {mean_px:.1f} px with a spread of {spread:.1f} px between its presses: press it "
            "straight, and nearer to the middle, where the lens distorts less"
        )
    if abs(x_mm / y_mm - 1) > SQUARE:
        raise BundleError(
            f"a pixel is {x_mm:.5f} mm wide and {y_mm:.5f} mm high: choose a camera mode that does not squeeze the "
            "picture"
        )
    return MeasuredPixelSize(
        presses=len(found),
        diameter_px=mean_px,
        spread_px=spread,
        x_mm=x_mm,
        y_mm=y_mm,
        x_spread_mm=float(np.std(diameter_mm / across, ddof=1)),
        y_spread_mm=float(np.std(diameter_mm / down, ddof=1)),
        pixel_size_mm=float(np.sqrt(x_mm * y_mm)),
    )
