"""How far pose and object part while the gel sticks: `python -m tests.benchmarks.tracking.pull`.

An object that is pressed in is pulled along the gel. Its imprint goes with it whether the gel sticks or slips; but gel
that sticks is drawn down behind the object and heaped before it, which is another shape. So each pull is told twice:
the gel slips without friction, or sticks everywhere (`sim_reference/fem/tangential.py`: what traction along the gel
does to the surface beside the contact). Pictures with noise, GelNet, a tracker that saw the press alone.
Pulls are by whole points of the grid: what a sharp edge does between two points is the grid's.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from gellight.bundle.bundle import load_bundle
from gellight.frame_path.pipeline import Reconstructor
from gellight.frames.frames import CameraFrame
from gellight.tracking.tracker import Tracker
from gellight.tracking.view import View
from gellight_touch import Felt, TouchSensor
from sim_reference.fem import tangential
from sim_reference.objects import object_height

OBJECTS, DEPTHS_MM, PULLS_MM = ("TSTEP", "PCONVEX", "WAVE"), (0.4, 0.8), (0.125, 0.25, 0.375)
STICKS = 50.0
"""coefficient of friction at which nothing slips"""
PIXEL_MM = (0.0588, 0.0588)


def pressed(touch: TouchSensor, name: str, depth_mm: float, pulled_mm: float) -> Felt:
    at = touch.layer.at_mm
    return touch.feel(-(object_height(name, at[None, :] - pulled_mm, at[:, None]) + depth_mm))


def stuck(touch: TouchSensor, felt: Felt, pulled_mm: float) -> Felt:
    """Return the surface of a gel that was pulled along: beside the contact, traction moves it in and out."""
    sheared = touch.drag(felt, (pulled_mm, 0.0, 0.0), friction=STICKS)
    layer = tangential.Layer(felt.contact.shape, touch.layer.spacing_mm, touch.geometry.gel_thickness_mm,
                             touch.geometry.poisson_ratio)  # fmt: skip
    traction = np.concatenate([sheared.state.traction, np.zeros((*felt.contact.shape, 1))], axis=2)
    moved = np.where(felt.contact, 0, layer.displacement(traction)[..., 2])
    return replace(felt, depth_mm=felt.depth_mm + moved.astype(np.float32))


def told_mm(touch: TouchSensor, reconstructor: Reconstructor, before: Felt, after: Felt) -> tuple[float, bool]:
    """Return what the tracker tells of a motion along x, mm, and whether it doubts."""
    tracker = Tracker()
    for number, felt in enumerate((before, after)):
        frame = reconstructor.reconstruct(CameraFrame(image=touch.picture(felt), time_s=number / 30, sequence=number))
        pose = tracker.follow(View.of(frame.depth_mm, frame.gradient_map, PIXEL_MM), number)
    return float(pose.motion[0, 3] + (pose.motion[0, :3] @ pose.origin_mm - pose.origin_mm[0])), pose.doubtful


def rows() -> Iterator[str]:
    touch, reconstructor = TouchSensor(size=512), Reconstructor(load_bundle("synthetic"))
    for name in OBJECTS:
        for depth_mm in DEPTHS_MM:
            before = pressed(touch, name, depth_mm, 0.0)
            parts = []
            for pulled_mm in PULLS_MM:
                slid = pressed(touch, name, depth_mm, pulled_mm)
                off = [
                    1e3 * (told_mm(touch, reconstructor, before, after)[0] - pulled_mm)
                    for after in (slid, stuck(touch, slid, pulled_mm))
                ]
                parts.append(f"{pulled_mm:.3f} mm: {off[0]:+.0f}, {off[1]:+.0f}")
            yield f"{name:8} {depth_mm} mm deep, um off while it slips, sticks: {'; '.join(parts)}"


if __name__ == "__main__":
    for row in rows():
        print(row, flush=True)
