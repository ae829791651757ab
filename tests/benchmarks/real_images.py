"""What real pictures say of several balls, several lights and marker dots: `python -m tests.benchmarks.real_images`.

`tests.helpers.places` says where the pictures may lie; docs/your-images.md has the figures.
"""

import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np

from gellight.base.errors import InputError
from gellight.frames.dots import find_dots
from gellight.frames.image_files import read_grey, read_image
from gellight.frames.view import View
from gellight.lab.optics.lights.ball_lights import check_lights, lights_from_balls
from gellight.lab.optics.lights.ball_series import BallSeries, held_out
from gellight.lab.optics.lights.channel_fit import channel_table
from gellight.lab.report.pictures import write_png
from gellight.lab.training.labelling import find_circle
from gellight.lab.training.labelling.circle import PressCircle, find_circles
from gellight.lab.training.labelling.plate import plate_grid, untouched_between
from gellight.lab.training.labelling.refinement import refine
from gellight.lab.training.presses import Ball, Press
from gellight.lab.training.training import TrainingOptions, train
from gellight.series.single_light_path import ChannelNetwork
from tests.helpers.places import real


def six_lights() -> None:
    """Half of 28 balls teach the lights and the networks of their channels, the others judge."""
    folder = real("oem_six_lights")
    ball = Ball(radius_mm=0.2465, pixel_size_mm=0.0068069)
    centres = np.loadtxt(folder / "balls.csv", delimiter=",", skiprows=1)
    presses = [
        Press(image=Path("balls"), center_x_px=x, center_y_px=y, contact_radius_px=0.99 * ball.radius_px)
        for x, y in centres.tolist()
    ]
    balls, flat = (
        np.stack([read_grey(folder / f"{kind}_light{number}.png", 1020) for number in range(1, 7)])
        for kind in ("balls", "flat")
    )
    for chosen in ([0, 1, 2, 3, 4, 5], [0, 2, 4]):
        learnt, judging = ([BallSeries(levels=balls[chosen], presses=tuple(presses[start::2]))] for start in (0, 1))
        lights = lights_from_balls(learnt, flat[chosen], ball, 1.0)
        print(f"{len(chosen)} lights: least squares {check_lights(lights, judging, ball)}")
        for seed in range(3):
            how = TrainingOptions(seed=seed)
            network, _ = train(channel_table(learnt, lights.untouched, ball), how)
            felt = ChannelNetwork(network, lights.untouched, source="trained").gradient_map
            print(f"  GelNet, seed {seed}: {held_out(felt, judging, ball)}")


def plate() -> None:
    """All balls of one picture, without a picture of the untouched gel."""
    folder = real("ball_plate")
    image, ball = read_image(folder / "scan001.png"), Ball(radius_mm=1.5875, pixel_size_mm=0.02953)
    begun_s = time.perf_counter()
    found = [
        one for one in find_circles(image, untouched_between(image, ball), ball=ball) if isinstance(one, PressCircle)
    ]
    grid = plate_grid(found, 6.35 / ball.pixel_size_mm)
    labels = np.loadtxt(folder / "balls.csv", delimiter=",", skiprows=1)[:, 2:]
    centres = np.array([(one.center_x_px, one.center_y_px) for one in found])
    apart = np.sort(np.hypot(*(labels[:, None] - centres[None]).transpose(2, 0, 1)).min(axis=1))
    print(f"plate: {len(found)} balls, {sum(grid.on_grid)} in the grid, {time.perf_counter() - begun_s:.0f} s")
    print(f"  mm per pixel {6.35 / grid.across_px:.5f} across, {6.35 / grid.down_px:.5f} down")
    print(f"  from the maker's centres, px: {apart.round(1).tolist()}")


def plate_centres() -> None:
    """How far the centres lie from a smooth grid, as found and refined by the light: half of the resolution."""
    path, ball = real("ball_plate") / "scan001.png", Ball(radius_mm=1.5875, pixel_size_mm=0.05906)
    full = read_image(path)
    image = cv2.resize(full, (full.shape[1] // 2, full.shape[0] // 2), interpolation=cv2.INTER_AREA)
    untouched = untouched_between(image, ball)
    found = [one for one in find_circles(image, untouched, ball=ball) if isinstance(one, PressCircle)]
    pitch_px = 6.35 / ball.pixel_size_mm
    on_grid = [one for one, inside in zip(found, plate_grid(found, pitch_px).on_grid, strict=True) if inside]
    with tempfile.TemporaryDirectory() as folder:
        write_png(Path(folder) / "plate.png", image)
        presses = [
            Press(image=Path(folder) / "plate.png", center_x_px=one.center_x_px, center_y_px=one.center_y_px,
                  contact_radius_px=one.contact_radius_px, found=True)
            for one in on_grid
        ]  # fmt: skip
        refined = refine(presses, untouched, ball).presses
    for words, some in (("as found", presses), ("refined", refined)):
        print(f"  {words}: {off_smooth_grid(some, pitch_px):.2f} px off a smooth grid, rms")


def off_smooth_grid(presses: Sequence[Press], pitch_px: float) -> float:
    """Return the rms distance, px, of the centres of a plate from a grid that a lens may bend: a cubic of its rows."""
    centres = np.array([(press.center_x_px, press.center_y_px) for press in presses])
    middle = centres[np.argmin(np.hypot(*(centres - centres.mean(axis=0)).T))]
    axes = pitch_px * np.eye(2)
    for _ in range(5):
        places = np.rint((centres - middle) @ np.linalg.inv(axes))
        straight, *_ = np.linalg.lstsq(np.column_stack([places, np.ones(len(places))]), centres, rcond=None)
        axes, middle = straight[:2], straight[2]
    across, down = (places - places.mean(axis=0)).T / 3
    bent = np.stack([across**a * down**b for a in range(4) for b in range(4 - a)], axis=1)
    left = centres - bent @ np.linalg.lstsq(bent, centres, rcond=None)[0]
    return float(np.sqrt((left**2).sum() / (len(presses) - bent.shape[1])))


def dots() -> None:
    """Twelve presses of a dotted gel, with and without its dots."""
    folder = real("dots")
    view = View.of_corners([(33, 58), (208, 61), (185, 244), (56, 250)], (320, 240), (320, 240))
    untouched = view.of(read_image(folder / "bg-0.jpg"), "bg-0.jpg")
    marks = find_dots(untouched)
    assert marks is not None
    print(f"dots: {marks}")
    ball = Ball(radius_mm=2.42, pixel_size_mm=0.1)
    found = {True: 0, False: 0}
    for number in range(12):
        image = view.of(read_image(folder / f"ball-{number}.jpg"), "a press")
        for filled in found:
            pictures = [marks.filled(one) if filled else one for one in (image, untouched)]
            with suppress(InputError):
                find_circle(pictures[0], pictures[1].astype(np.float32), ball=ball)
                found[filled] += 1
    print(f"  presses found of 12: {found[True]} with the dots filled, {found[False]} as they are")


if __name__ == "__main__":
    six_lights()
    plate()
    plate_centres()
    dots()
