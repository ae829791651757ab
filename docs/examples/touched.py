"""Show where a gel is touched in pictures, without a calibration: what changed, where, how large; no depth."""

import sys
from pathlib import Path

import cv2
import numpy as np
from scipy import ndimage

import gellight
from gellight.frames.dots import find_dots

sys.tracebacklimit = 0  # errors in one line
ANGLES = np.linspace(0, 2 * np.pi, 72, endpoint=False)
LEAST_GREY = 8  # what changes less at its strongest place is not taken for a touch


def changed(image, untouched, dots):
    """Return by how much each pixel changed, (H, W) grey levels, marker dots filled and drifting light left out."""
    seen, before = ((dots.filled(one) if dots else one).astype(float) for one in (image, untouched))
    difference = seen - before
    difference -= np.median(difference, axis=(0, 1))
    return ndimage.gaussian_filter(np.linalg.norm(difference, axis=2), 3)


def rim(change, start):
    """Return the (72, 2) places, px, where the change is largest on rays from `start`: there the gel is steepest."""
    x, y = start
    along = np.arange(1, min(change.shape) // 2)
    rays = [y + np.outer(np.sin(ANGLES), along), x + np.outer(np.cos(ANGLES), along)]
    largest = along[ndimage.map_coordinates(change, rays, order=1).argmax(axis=1)]
    radius = ndimage.median_filter(largest, 9, mode="wrap")
    return np.stack([x + radius * np.cos(ANGLES), y + radius * np.sin(ANGLES)], axis=1).astype(np.float32)


def centre(outline):
    """Return the centroid of what an (N, 2) outline encloses, px."""
    moments = cv2.moments(outline)
    return moments["m10"] / moments["m00"], moments["m01"] / moments["m00"]


def contact(change):
    """Return the (72, 2) outline of the one contact, px."""
    rows, columns = np.nonzero(change > change.max() / 2)
    whole = cv2.convexHull(np.stack([columns, rows], axis=1).astype(np.float32))
    return rim(change, centre(rim(change, centre(whole))))


def report(name, change, pixel_size_mm, out):
    """Print what was found in one picture, and draw it."""
    drawn = cv2.cvtColor(np.clip(change * 2, 0, 255).astype(np.uint8), cv2.COLOR_GRAY2BGR)
    said = f"nothing touches (largest change {change.max():.1f} grey levels)"
    if change.max() >= LEAST_GREY:
        outline = contact(change)
        cv2.polylines(drawn, [outline.astype(np.int32)], isClosed=True, color=(0, 255, 255))
        x, y = centre(outline)
        said = f"touched around ({x:.0f}, {y:.0f}) px, some {cv2.contourArea(outline) * pixel_size_mm**2:.1f} mm2"
    print(f"{name}: {said}")
    cv2.imwrite(str(out / f"{name}.png"), drawn)


def main(untouched_file, pictures, pixel_size_mm, out):
    """Take each picture of a folder, a pattern or a video in turn."""
    with gellight.open_camera(untouched_file) as camera:
        untouched = camera.read().image
    dots = find_dots(untouched)
    Path(out).mkdir(exist_ok=True)
    with gellight.open_camera(pictures) as camera:
        while True:
            try:
                frame = camera.read()
            except gellight.EndOfStream:
                break
            report(Path(frame.source).stem, changed(frame.image, untouched, dots), float(pixel_size_mm), Path(out))


if __name__ == "__main__":
    main(*sys.argv[1:])
