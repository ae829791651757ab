"""`gellight selfcheck`: the host against the reference simulator, press by press."""

from typing import TYPE_CHECKING, Annotated

import typer

from gellight.cli.ending import Ending
from gellight.cli.options import AsJson, simulated_settings
from gellight.cli.showing import show

if TYPE_CHECKING:
    from gellight.frames.frames import SelfCheckResult

COLUMNS = (
    ("depth_error_mm", "depth um", 1e3),
    ("shape_error_mm", "shape um", 1e3),
    ("normal_error_deg", "normal deg", 1.0),
    ("contact_normal_error_deg", "in contact", 1.0),
    ("integral_error_mm", "integral um", 1e3),
    ("picture_error_grey", "picture grey", 1.0),
    ("indentation_mm", "depth mm", 1.0),
    ("true_indentation_mm", "true mm", 1.0),
)
VERDICTS = {"passed": "ok", "failed": "OUT OF BOUNDS", "not judged": "not judged"}


def command(
    sensor: Annotated[str | None, typer.Option(help="URL of a simulated sensor.", show_default="sim://")] = None,
    calibration: Annotated[str | None, typer.Option(help="Calibration bundle.", show_default="synthetic")] = None,
    as_json: AsJson = False,
) -> None:
    """Compare the simulated sensor with the reference simulator.

    The ball and the ten objects are pressed; depth, normals and picture are compared. The exit status is 1 when a
    comparison is out of its bounds, or when there are none for this sensor.
    """
    from gellight.daemon.active_pipeline import reconstructor_for  # not for the help: a second
    from gellight.daemon.assembly import chosen_bundle
    from gellight.lab.simulator.selfcheck import check_presses, refuse_unknown_truth
    from gellight.opening import open_camera

    settings = simulated_settings({"sensor.url": sensor, "sensor.calibration": calibration})
    results: list[tuple[str, SelfCheckResult]] = []
    with open_camera(settings.sensor.url, geometry=settings.geometry.overrides()) as camera:
        refuse_unknown_truth(camera)
        reconstructor = reconstructor_for(chosen_bundle(settings), settings.reconstruction)
        if not as_json:
            print(" ".join(["press".ljust(26), *(title.rjust(12) for _, title, _ in COLUMNS)]))
        for press, result in check_presses(camera, reconstructor):
            results.append((press, result))
            if not as_json:
                print(line(press, result))
    passed = all(result.passed for _, result in results)
    if as_json:
        show({"passed": passed, "presses": [{"press": p, **r.as_json()} for p, r in results]}, as_json)
    if not passed:
        raise typer.Exit(Ending.JUDGED_BAD)


def line(name: str, result: "SelfCheckResult") -> str:
    """Return one row of the table."""
    numbers = [f"{getattr(result, field) * scale:12.3f}" for field, _, scale in COLUMNS]
    return " ".join([name.ljust(26), *numbers, VERDICTS[result.verdict]])
