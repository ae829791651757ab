"""The distortion of the lens, if the user has a pin grid: pressed after the cylinder, used after the training.

The pins are looked for twice. When they are pressed there is no network yet. The difference image shows them some
pixels off: enough to check that it is a grid of the right pitch over the whole view. The lens is then fitted to pins in
the depth that the trained network feels, which are right to some hundredths of a pixel.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BundleError, InputError
from gellight.bundle.bundle import load_bundle
from gellight.frames.image_files import read_image
from gellight.lab.calibration.display import Picture, Progress
from gellight.lab.calibration.records import MeasuredLens, PinGrid, PixelSize
from gellight.lab.calibration.run import CalibrationRun
from gellight.lab.calibration.sensing import Capture, check_light, detector_of, next_press, wait_free
from gellight.lab.optics.lens.lattice import Lattice
from gellight.lab.optics.lens.lens_fit import check_pins, read_pins, spacing_px
from gellight.lab.optics.lens.measuring import add_lens, felt_lens, figures
from gellight.lab.optics.lens.pins import imprints, marked
from gellight.lab.simulator.virtual_hand import VirtualHand
from gellight.reconstruction.lens.undistortion import has_lens

Floats = NDArray[np.float32]
_SOURCE = "the pin grid"


def collect_grid(run: CalibrationRun) -> None:
    """Take pictures of the grid until pins were seen in every part of the view, or the user goes on without it."""
    reference, detector = run.folder.reference(), detector_of(run)
    seen = [_pins(run, read_image(path), reference) for path in _pictures(run)]
    wanted = _missing(seen, run.camera.image_shape)
    with run.offering("next"):
        while wanted:
            _announce(run, len(seen), wanted)
            with next_press(run, detector, VirtualHand.grid, run.skipped) as capture:
                if capture is None:
                    run.folder.forget_grid()
                    run.folder.finish(PinGrid(pictures=0))
                    return
                seen += _taken(run, capture, reference)
                wanted = _missing(seen, run.camera.image_shape)
        wait_free(run, detector)
    run.folder.finish(PinGrid(pictures=len(seen), pitch_mm=run.options.tools.pin_pitch_mm))


def _announce(run: CalibrationRun, done: int, wanted: str) -> None:
    run.display.update(
        instruction=f"Press the pin grid ({run.options.tools.pin_pitch_mm:g} mm apart) flat into the gel, over the "
        "whole view, some tenths of a millimetre deep. Hold still, then lift. Without one, go on.",
        progress=Progress(done=done, wanted=done + 1, unit="pictures"),
        problem=wanted if done else run.display.problem,
    )


def _taken(run: CalibrationRun, capture: Capture, reference: Floats) -> list[Lattice]:
    """Keep the picture and return its pins; empty where it is refused, and then the reason is shown."""
    try:
        check_light(capture.image, _SOURCE)
        lattice = _pins(run, capture.image, reference)
    except InputError as error:
        run.refuse(error)
        return []
    run.folder.add_grid(capture.image)
    run.display.update(problem="")
    run.display.show(pins=marked(capture.image, lattice.points, np.empty((0, 2))))
    return [lattice]


def _pins(run: CalibrationRun, picture: Picture, reference: Floats) -> Lattice:
    pitch, size = _pitch_mm(run), (run.folder.figures(PixelSize).pixel_size_mm,) * 2
    contrasts = imprints(picture.astype(np.float32) - reference, spacing_px(size, pitch))
    return read_pins(contrasts, pixel_size_mm=size, pitch_mm=pitch, source=_SOURCE)


def _pitch_mm(run: CalibrationRun) -> float:
    assert run.options.tools.pin_pitch_mm is not None
    return run.options.tools.pin_pitch_mm


def _missing(seen: list[Lattice], image_shape: tuple[int, int]) -> str:
    """Say what is still missing; empty when the lens can be fitted everywhere."""
    if not seen:
        return "no picture yet"
    try:
        check_pins(seen, image_shape)
    except InputError as error:
        return str(error)
    return ""


def straighten(run: CalibrationRun) -> None:
    """Fit the lens to the pins as the draft feels them, and add it to the draft; without a grid do nothing.

    Raises BundleError where the pins tell no lens; then the grid is asked for again, and nothing else.
    """
    grid, draft = run.folder.state.steps.lens, load_bundle(run.folder.draft)
    if grid is None or not grid.pictures or (has_lens(draft) and isinstance(grid, MeasuredLens)):
        return
    paths = _pictures(run)
    try:
        fit = felt_lens(draft, paths, _pitch_mm(run), _SOURCE)
    except InputError as error:
        run.folder.forget_grid()
        raise BundleError(f"{error}. The presses are kept: go on, and press the grid again") from error
    add_lens(draft, fit, paths, run.folder.draft, overwrite=True)
    found = MeasuredLens(pitch_mm=grid.pitch_mm, **dict(figures(fit, draft)))
    run.folder.finish(found)
    run.display.add_figures("lens", found)
    run.display.show(pins=marked(read_image(paths[0]), fit.lattices[0].points, fit.expected_px[0]))


def _pictures(run: CalibrationRun) -> list[Path]:
    return [run.folder.path / record.file for record in run.folder.state.grids]
