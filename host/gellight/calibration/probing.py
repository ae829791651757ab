"""Step 3: the size of a pixel, from presses of a cylinder whose diameter is known."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BundleError, InputError
from gellight.calibration.bulletin import Picture
from gellight.calibration.cylinder import Imprint, find_cylinder
from gellight.calibration.sensing import Watcher, check_light, wait_free, wait_press
from gellight.calibration.session import Session

SQUARE = 0.006
"""x and y may differ by this share; more is a camera mode that squeezes the picture"""
_LARGEST_SPREAD = 0.01


def measure_pixel_size(session: Session) -> None:
    """Collect presses of the cylinder and keep mm per pixel."""
    options, reference = session.options, session.folder.reference()
    noise = session.folder.steps["reference"]["noise_grey"]
    watcher = Watcher(reference, noise)
    found: list[Imprint] = []
    refused = 0
    while len(found) < options.cylinder_presses:
        _announce(session, len(found))
        wait_free(session, watcher)
        if session.hand:
            session.hand.cylinder(len(found))
        try:
            found.append(_one_press(session, watcher, reference, noise))
        except InputError as error:
            refused += 1
            if session.hand and refused > options.cylinder_presses:
                raise
            session.bulletin.post(problem=str(error))
        if session.hand:
            session.hand.lift()
    wait_free(session, watcher)
    session.folder.finish("pixel_size", pixel_size(found, options.cylinder_diameter_mm))


def _announce(session: Session, done: int) -> None:
    options = session.options
    session.bulletin.post(
        instruction=f"Press the {options.cylinder_diameter_mm:g} mm cylinder, its flat end straight, some tenths of a "
        "millimetre deep, each time at another place of the picture. Hold still, then lift.",
        progress={"done": done, "wanted": options.cylinder_presses, "unit": "presses"},
    )


def _one_press(session: Session, watcher: Watcher, reference: NDArray[np.float32], noise: float) -> Imprint:
    """Wait for one press and measure it; InputError says why it is refused."""
    capture = wait_press(session, watcher, lambda: False)
    assert capture is not None
    check_light(capture.image, "the press")
    imprint = find_cylinder(capture.image - reference, noise)
    session.bulletin.post(
        problem="",
        press={
            "center_x_px": imprint.center_x_px,
            "center_y_px": imprint.center_y_px,
            "contact_radius_px": (imprint.radius_x_px + imprint.radius_y_px) / 2,
            "state": "measured",
        },
    )
    session.bulletin.show(cylinder=drawn(capture.image, imprint))
    return imprint


def drawn(image: Picture, imprint: Imprint) -> Picture:
    """Draw the edge points of an imprint on its picture."""
    picture = image.copy()
    for x, y in np.rint(imprint.edge_px).astype(int):
        picture[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2] = (255, 240, 80)
    return picture


def pixel_size(found: list[Imprint], diameter_mm: float) -> dict[str, Any]:
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
    return {
        "presses": len(found),
        "diameter_px": mean_px,
        "spread_px": spread,
        "x_mm": x_mm,
        "y_mm": y_mm,
        "x_spread_mm": float(np.std(diameter_mm / across, ddof=1)),
        "y_spread_mm": float(np.std(diameter_mm / down, ddof=1)),
        "pixel_size_mm": float(np.sqrt(x_mm * y_mm)),
        "edge_scatter_px": float(np.median([one.scatter_px for one in found])),
    }
