"""Make press.webp, the moving picture of the README: a ball rolls over the simulated gel and a plate is pressed in.

    .venv/bin/python docs/pictures/press.py

Depth, normals and contact are measured from the camera's picture, as in every use; the truth is not looked at.
"""

from collections.abc import Iterator
from math import cos, pi, sin
from pathlib import Path

import cv2

import gellight
from gellight.lab.report.pictures import four_panels

STEPS = 16
FRAME_MS = 110
SCALE = 0.6


def presses() -> Iterator[tuple[str, float, float, float]]:
    """Yield object, depth in mm, x and y in mm: the ball goes in, round and out, then the plate in and out."""
    for step in range(STEPS + 1):
        turn = 2 * pi * step / STEPS
        yield "BALL", 1.0 * min(1.0, step / 4, (STEPS - step) / 4), 9 * cos(turn), 6 * sin(turn)
    for step in range(STEPS + 1):
        yield "QUCAVE", 0.9 * sin(pi * step / STEPS), 0.0, 0.0


def main() -> None:
    """Write the picture beside this file."""
    animation = cv2.Animation()
    reconstructor = gellight.Reconstructor(gellight.load_bundle("synthetic"))
    frames = []
    with gellight.open_camera("sim://") as camera:
        for press in presses():
            camera.stage.press(*press)
            camera.read()  # the shutter may have been open while the object moved
            sheet = four_panels(reconstructor.reconstruct(camera.read()))
            frames.append(cv2.resize(sheet[..., ::-1], None, fx=SCALE, fy=SCALE, interpolation=cv2.INTER_AREA))
    animation.frames, animation.durations = frames, [FRAME_MS] * len(frames)
    path = Path(__file__).with_suffix(".webp")
    if not cv2.imwriteanimation(str(path), animation, [cv2.IMWRITE_WEBP_QUALITY, 70]):
        raise SystemExit(f"{path} was not written")
    print(f"{path}: {len(frames)} frames, {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
