"""The section of the report about the presses of a prism."""

from pathlib import Path

from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.image_files import read_image
from gellight.lab.calibration.records import PrismVerification
from gellight.lab.calibration.report_pictures import small_pictures
from gellight.lab.calibration.state import PrismRecord
from gellight.lab.report.html import box, section, table
from gellight.lab.report.pictures import depth_picture, difference_picture, normal_picture


def prism_tiles(means: PrismVerification) -> list[tuple[str, str]]:
    """Return the headline: how far the normals of the faces are off."""
    return [
        (f"{means.normal_deg:.2f}°", f"mean angle between the normals on the faces of a prism of {means.angle_deg:g}°")
    ]


def prism_section(
    presses: list[PrismRecord], means: PrismVerification, folder: Path, reconstructor: Reconstructor
) -> str:
    """Return the section: what a prism feels like, each press of it, and pictures of the one that is felt worst.

    folder: that of the calibration.
    """
    worst = max(presses, key=lambda press: press.figures.normal_deg).press(folder, means.angle_deg)
    felt = reconstructor.reconstruct(worst.frame())
    scale = max(1000.0 * float(felt.depth_mm.max()), 100.0)
    shown = [
        (read_image(worst.image), "the press of the prism that is felt worst"),
        (difference_picture(felt.difference), "difference from the untouched gel"),
        (depth_picture(felt.depth_mm, scale_um=scale), f"depth felt, bright: {scale:.0f} µm"),
        (normal_picture(felt.normal_map), "normals felt"),
    ]
    return section(
        "Verification by a prism",
        f"<p>Faces of {means.angle_deg:g} degrees feel like {means.felt_deg:.2f} degrees. No network "
        "was trained on these presses. Errors are those on the faces where the gel lies on them, "
        "without the rounded edge.</p>",
        small_pictures(shown),
        box("wide", _table(presses)),
    )


def _table(presses: list[PrismRecord]) -> str:
    known = presses[0].figures.true_depth_mm is not None
    head = ["press", "edge px", "face px", "leans °", "feels like °", "normals °", "depth, mean taken off, µm",
            "picture, grey levels", *(["depth in contact µm"] if known else [])]  # fmt: skip
    rows = [
        [
            f"{press.number}",
            f"{press.edge_x1_px:.1f}, {press.edge_y1_px:.1f} to {press.edge_x2_px:.1f}, {press.edge_y2_px:.1f}",
            f"{press.face_px:.1f}",
            f"{abs(press.lean_deg):.1f} ± {press.lean_error_deg:.1f}",
            f"{one.felt_deg:.2f}",
            f"{one.normal_deg:.2f}",
            f"{1000 * one.depth_mm:.1f}",
            f"{one.picture_grey:.2f}",
            *([f"{1000 * one.known_depth_mm:.1f}"] if known else []),
        ]
        for press in presses
        for one in [press.figures]
    ]
    return table(head, rows)
