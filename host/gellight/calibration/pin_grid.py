"""The distortion of the lens, if the user has a pin grid: pressed after the cylinder, used after the training.

The pins are looked for twice. When they are pressed there is no network yet. The difference image shows them some
pixels off: enough to check that it is a grid of the right pitch over the whole view. The lens is then fitted to pins in
the depth that the trained network feels, which are right to some hundredths of a pixel.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import BundleError, InputError
from gellight.bundle.bundle import Bundle, load_bundle
from gellight.calibration.display import Picture, Progress
from gellight.calibration.lens.lattice import Lattice
from gellight.calibration.lens.lens_fit import LensFit, check_pins, fit_lens, read_pins, spacing_px
from gellight.calibration.lens.measuring import add_lens, depth_feeler, figures
from gellight.calibration.lens.pins import dimples, imprints, marked
from gellight.calibration.records import MeasuredLens, PinGrid, PixelSize
from gellight.calibration.sensing import Capture, check_light, detector_of, next_press, wait_free
from gellight.calibration.session import Session
from gellight.frames.image_files import read_image
from gellight.reconstruction.lens.lens_file import has_lens
from gellight.reconstruction.pipeline import Reconstructor
from gellight.simulator.virtual_hand import VirtualHand

Floats = NDArray[np.float32]
_SOURCE = "the pin grid"


def collect_grid(session: Session) -> None:
    """Take pictures of the grid until pins were seen in every part of the view, or the user goes on without it."""
    reference, detector = session.folder.reference(), detector_of(session)
    seen = [_pins(session, read_image(path), reference) for path in _pictures(session)]
    wanted = _missing(seen, session.camera.image_shape)
    with session.offering("next"):
        while wanted:
            _announce(session, len(seen), wanted)
            with next_press(session, detector, VirtualHand.grid, lambda: _skipped(session)) as capture:
                if capture is None:
                    session.folder.forget_grid()
                    session.folder.finish(PinGrid(pictures=0))
                    return
                seen += _taken(session, capture, reference)
                wanted = _missing(seen, session.camera.image_shape)
        wait_free(session, detector)
    session.folder.finish(PinGrid(pictures=len(seen), pitch_mm=session.options.pin_pitch_mm))


def _announce(session: Session, done: int, wanted: str) -> None:
    session.display.update(
        instruction=f"Press the pin grid ({session.options.pin_pitch_mm:g} mm apart) flat into the gel, over the "
        "whole view, some tenths of a millimetre deep. Hold still, then lift. Without one, go on.",
        progress=Progress(done=done, wanted=done + 1, unit="pictures"),
        problem=wanted if done else session.display.problem,
    )


def _skipped(session: Session) -> bool:
    chosen = session.next_action()
    return chosen is not None and chosen[0] == "next"


def _taken(session: Session, capture: Capture, reference: Floats) -> list[Lattice]:
    """Keep the picture and return its pins; empty where it is refused, and then the reason is shown."""
    try:
        check_light(capture.image, _SOURCE)
        lattice = _pins(session, capture.image, reference)
    except InputError as error:
        session.refuse(error)
        return []
    session.folder.add_grid(capture.image)
    session.display.update(problem="")
    session.display.show(pins=marked(capture.image, lattice.points, np.empty((0, 2))))
    return [lattice]


def _pins(session: Session, picture: Picture, reference: Floats) -> Lattice:
    size, pitch = _sizes(session)
    contrasts = imprints(picture.astype(np.float32) - reference, spacing_px(size, pitch))
    return read_pins(contrasts, pixel_size_mm=size, pitch_mm=pitch, source=_SOURCE)


def _missing(seen: list[Lattice], image_shape: tuple[int, int]) -> str:
    """Say what is still missing; empty when the lens can be fitted everywhere."""
    if not seen:
        return "no picture yet"
    try:
        check_pins(seen, image_shape)
    except InputError as error:
        return str(error)
    return ""


def straighten(session: Session) -> None:
    """Fit the lens to the pins as the draft feels them, and add it to the draft; without a grid do nothing.

    Raises BundleError where the pins tell no lens; then the grid is asked for again, and nothing else.
    """
    grid, draft = session.folder.state.steps.lens, load_bundle(session.folder.draft)
    if grid is None or not grid.pictures or (has_lens(draft) and isinstance(grid, MeasuredLens)):
        return
    paths = _pictures(session)
    try:
        fit = _felt(session, draft, paths)
    except InputError as error:
        session.folder.forget_grid()
        raise BundleError(f"{error}. The presses are kept: go on, and press the grid again") from error
    add_lens(draft, fit, paths, session.folder.draft, overwrite=True)
    found = MeasuredLens(pitch_mm=grid.pitch_mm, **dict(figures(fit, draft)))
    session.folder.finish(found)
    session.display.add_figures("lens", found)
    session.display.show(pins=marked(read_image(paths[0]), fit.lattices[0].points, fit.expected_px[0]))


def _felt(session: Session, draft: Bundle, paths: list[Path]) -> LensFit:
    size, pitch = _sizes(session)
    feel = depth_feeler(Reconstructor(draft, undistorted=False))
    lattices = [
        read_pins(
            dimples(feel(read_image(path)), spacing_px(size, pitch)), pixel_size_mm=size, pitch_mm=pitch, source=_SOURCE
        )
        for path in paths
    ]
    return fit_lens(lattices, draft.image_shape, pitch)


def _pictures(session: Session) -> list[Path]:
    return [session.folder.path / record.file for record in session.folder.state.grids]


def _sizes(session: Session) -> tuple[tuple[float, float], float]:
    """Size of a pixel (x, y) and pitch of the grid, mm."""
    size, pitch = session.folder.figures(PixelSize).pixel_size_mm, session.options.pin_pitch_mm
    assert pitch is not None
    return (size, size), pitch
