"""Step 6: fresh presses judge the draft; only what passes is written."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gellight.base.errors import InputError
from gellight.bundle.bundle import REPORT, Bundle, load_bundle, write_bundle
from gellight.calibration.circle import circle_of, drawn
from gellight.calibration.fitting import draft_path
from gellight.calibration.preparing import led_settings
from gellight.calibration.pressing import ball_of
from gellight.calibration.report import Shown, page
from gellight.calibration.rerender import Rerenderer
from gellight.calibration.sensing import Capture, Watcher, check_light, wait_free, wait_press
from gellight.calibration.session import Session
from gellight.frames.frames import CameraFrame, GroundTruth, TactileFrame
from gellight.frames.image_files import read_image
from gellight.reconstruction.errors import surface_errors
from gellight.reconstruction.lens.lens_file import FILE_NAME, has_lens, lens_of, read_record
from gellight.reconstruction.lens.undistortion import circle_on_gel
from gellight.reconstruction.pipeline import Reconstructor
from gellight.report.pictures import depth_picture
from gellight.training.baselines import fit_lookup_table, fit_polynomial
from gellight.training.presses import Ball, Press, PressTable, contact_circle
from gellight.training.validation import baseline_errors, press_error

Floats = NDArray[np.float32]
MORE_PRESSES = 12
"""so many more are asked for after a bad verdict"""


@dataclass(frozen=True)
class _Judge:
    """What every fresh press is held against."""

    draft: Bundle
    reconstructor: Reconstructor
    rerenderer: Rerenderer
    ball: Ball

    def figures(self, frame: CameraFrame, press: Press) -> tuple[TactileFrame, dict[str, float]]:
        """Return what is felt of a press, and what that says of the draft."""
        felt = self.reconstructor.reconstruct(frame)
        figures = figures_of(felt, self.on_gel(press), self.ball)
        seen = felt if not has_lens(self.draft) else Reconstructor(self.draft, undistorted=False).reconstruct(frame)
        figures["picture_grey"] = picture_error_grey(seen, press, self.rerenderer)
        return felt, figures | truth_figures(felt, frame.truth)

    def on_gel(self, press: Press) -> Press:
        """Return the circle of a press over the undistorted gel: the same where the bundle knows no lens."""
        if not has_lens(self.draft):
            return press
        seen = press.center_x_px, press.center_y_px, press.contact_radius_px
        x, y, radius = circle_on_gel(lens_of(read_record(self.draft)), self.draft.pixel_size_mm, seen)
        return replace(press, center_x_px=x, center_y_px=y, contact_radius_px=radius)


def verify(session: Session) -> Bundle | None:
    """Collect fresh presses, judge the draft by them, and write the bundle if it passes."""
    draft = load_bundle(draft_path(session))
    rerenderer = Rerenderer(draft.presses()["rows"], draft.image_shape)
    judge = _Judge(draft, Reconstructor(draft), rerenderer, ball_of(session))
    reference = session.folder.reference()
    watcher = Watcher(reference, draft.manifest.noise_grey)
    while len(session.folder.checks) < session.options.verifications:
        _announce(session)
        wait_free(session, watcher)
        if session.hand:
            number = len(session.folder.checks) + session.folder.steps.get("refused_checks", 0)
            session.hand.check(number, judge.ball.pixel_size_mm, session.camera.image_shape)
        capture = wait_press(session, watcher, lambda: False)
        assert capture is not None
        _take(session, capture, reference, judge)
        if session.hand:
            session.hand.lift()
    wait_free(session, watcher)
    _announce(session)
    return _conclude(session, draft, judge)


def _announce(session: Session) -> None:
    session.bulletin.post(
        instruction="Press the ball at fresh places, its whole contact in the picture: these presses judge the "
        "calibration and are not learnt from.",
        progress={"done": len(session.folder.checks), "wanted": session.options.verifications, "unit": "presses"},
    )


def _take(session: Session, capture: Capture, reference: Floats, judge: _Judge) -> None:
    image = capture.frame.image  # one frame, as the running sensor sees it
    try:
        check_light(image, "the press")
        circle = circle_of(capture.image, reference, judge.ball)
        _check_whole(circle.center_x_px, circle.center_y_px, circle.contact_radius_px, image.shape)
    except InputError as error:
        refused = session.folder.steps.get("refused_checks", 0) + 1
        if session.hand and refused > session.options.verifications:
            raise
        session.folder.finish("refused_checks", refused)
        session.bulletin.post(problem=str(error))
        return
    felt, figures = judge.figures(capture.frame, Press(image=session.folder.path, **circle.as_json()))
    record = session.folder.add("checks", image, circle.as_json(), figures=figures)
    session.bulletin.post(problem="", press={**record, "state": "checked"})
    session.bulletin.show(press=drawn(image, circle), verify=depth_picture(felt.depth_mm))


def _check_whole(x: float, y: float, radius: float, shape: tuple[int, ...]) -> None:
    if min(x, y, shape[1] - 1 - x, shape[0] - 1 - y) < radius:
        raise InputError(f"the contact at ({x:.0f}, {y:.0f}) px leaves the picture: press nearer to the middle")


def figures_of(felt: TactileFrame, press: Press, ball: Ball) -> dict[str, float]:
    """Return what a press says of a calibration by its circle on the gel alone, as every sensor can.

    depth_mm: mean absolute error inside the contact circle, mean removed, for a circle does not say how deep its rim
    lies. normal_deg: mean angle there.
    """
    error = press_error(press, ball, felt)
    return {
        "depth_mm": error.depth_mae_mm,
        "normal_deg": error.mean_deg,
        "indentation_mm": felt.contact.indentation_mm,
    }


def picture_error_grey(seen: TactileFrame, press: Press, rerenderer: Rerenderer) -> float:
    """Return the mean absolute difference from the re-rendered picture inside the circle; `seen` lies over the picture.

    Slopes that were felt wrong would make another picture than the one that was taken.
    """
    inside = contact_circle(press, (seen.depth_mm.shape[0], seen.depth_mm.shape[1]))
    predicted = rerenderer.difference(seen.gradient_map, *np.nonzero(inside))
    return float(np.abs(predicted - seen.difference[inside]).mean())


def truth_figures(felt: TactileFrame, truth: GroundTruth | None) -> dict[str, float]:
    """Return the errors against what only a simulator knows; nothing on a real sensor."""
    if truth is None:
        return {}
    error = surface_errors(felt, truth)
    return {
        "true_depth_mm": error.contact_depth_mm,
        "true_normal_deg": error.normal_deg,
        "true_contact_normal_deg": error.contact_normal_deg,
    }


def _conclude(session: Session, draft: Bundle, judge: _Judge) -> Bundle | None:
    figures = summary(session)
    figures["second_opinions"] = _second_opinions(session, draft, judge.ball)
    limits = session.options.limits
    passed = figures["depth_mm"] <= limits.depth_mm and figures["normal_deg"] <= limits.normal_deg
    verdict = {
        "passed": passed,
        "depth_um": round(1000 * figures["depth_mm"], 1),
        "normal_deg": round(figures["normal_deg"], 2),
        "text": _words(figures, passed, session),
    }
    session.bulletin.note("verify", figures)
    session.bulletin.post(verdict=verdict, instruction=str(verdict["text"]))
    if not passed:
        session.folder.want_more(MORE_PRESSES)
        return None
    report = page(session, verdict, figures, _shown(session, judge))
    bundle = _written(session, draft, figures, report)
    session.folder.finish("verify", figures)
    session.folder.close()
    session.bulletin.post(bundle=str(session.options.out))
    return bundle


def summary(session: Session) -> dict[str, Any]:
    """Return the means over the fresh presses."""
    each = [record["figures"] for record in session.folder.checks]
    return {"presses": len(each), **{name: float(np.mean([one[name] for one in each])) for name in each[0]}}


def _second_opinions(session: Session, draft: Bundle, ball: Ball) -> dict[str, dict[str, float]]:
    """Judge the look-up table and the polynomial, fitted to the same table, on the same fresh presses."""
    table = PressTable.of(draft)
    follow, reference = draft.manifest.follow_light, draft.reference
    found = {}
    for name, baseline in (("look-up table", fit_lookup_table(table)), ("polynomial", fit_polynomial(table))):
        errors = baseline_errors(baseline, session.folder.listed("checks"), reference, ball, follow_light=follow)
        found[name] = {
            "depth_mm": float(np.mean([error.depth_mae_mm for error in errors])),
            "normal_deg": float(np.mean([error.mean_deg for error in errors])),
        }
    return found


def _words(figures: dict[str, Any], passed: bool, session: Session) -> str:
    limits = session.options.limits
    measured = (
        f"{figures['presses']} fresh presses: depth within {1000 * figures['depth_mm']:.0f} µm, normals within "
        f"{figures['normal_deg']:.2f} degrees on average"
    )
    if passed:
        return f"Passed. {measured}."
    return (
        f"Not passed. {measured}; wanted are {1000 * limits.depth_mm:.0f} µm and {limits.normal_deg:g} degrees. "
        "Nothing was replaced. Press more, and check the radius of the ball."
    )


def _shown(session: Session, judge: _Judge) -> Shown:
    """The fresh press with the median depth error, reconstructed again."""
    records = session.folder.checks
    order = np.argsort([record["figures"]["depth_mm"] for record in records])
    chosen = int(order[len(order) // 2])
    press = session.folder.listed("checks")[chosen]
    image = read_image(press.image)
    frame = CameraFrame(image=image, time_s=0.0, sequence=0, source=str(press.image))
    return Shown(image, press, judge.on_gel(press), judge.reconstructor.reconstruct(frame), judge.ball)


def _written(session: Session, draft: Bundle, figures: dict[str, Any], report: str) -> Bundle:
    """Write the bundle with everything that was learnt."""
    steps, manifest = session.folder.steps, draft.manifest
    prepared = steps["prepare"]
    lens = {FILE_NAME: draft.files[FILE_NAME]} if has_lens(draft) else {}
    return write_bundle(
        session.options.out,
        sensor=session.options.sensor,
        reference=draft.reference,
        reference_frames=manifest.reference_frames,
        noise_grey=manifest.noise_grey,
        pixel_size_mm=manifest.pixel_size_mm,
        network=draft.network,
        network_name=manifest.network,
        follow_light=manifest.follow_light,
        metrics={
            **draft.metrics,
            "verification": figures,
            "pixel_size": steps["pixel_size"],
            "lens": steps.get("lens", {}),
            "prepare": prepared,
        },
        presses=draft.presses(),
        led=led_settings(prepared["led"]),
        camera=prepared["camera"],
        extra_files={REPORT: report.encode(), **lens},
        overwrite=session.options.overwrite,
    )
