"""Daemons whose frames are made of formulas, for the tests of the stream."""

import socket
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from gellight.bundle.bundle import Bundle
from gellight.daemon.session import SensorSession
from gellight.frames.frames import CameraFrame, ExposureReport, LightLabel, LightState, Provenance, TactileFrame
from gellight.frames.measures import FrameMeasures
from tests.helpers.dashboard_source import bump
from tests.helpers.scripted_camera import ScriptedCamera
from tests.helpers.sessions import session_of

SHAPE = (48, 64)


class BumpReconstructor:
    """Feels a bump that is deeper in each frame; keeps what it gave by sequence number."""

    def __init__(self, bundle: Bundle | None = None, measures: FrameMeasures | None = None) -> None:
        self.measures = measures
        described = SimpleNamespace(sensor="formula", camera_height_mm=0.0)
        self.bundle: Any = bundle or SimpleNamespace(
            pixel_size_mm=(0.1, 0.2), image_shape=SHAPE, files={}, identity="0" * 16, manifest=described, metrics={},
            source="formula", controls={}, colours=None, check_fits=lambda camera, image_shape: None,
        )  # fmt: skip
        self.given: dict[int, TactileFrame] = {}

    def status(self) -> dict[str, object]:
        return {"mode": "formula"}

    def reconstruct(self, frame: CameraFrame) -> TactileFrame:
        felt = bump(0.5 + frame.sequence / 1000, 0.0, 0.0, shape=SHAPE)
        image = replace(felt.camera_frame, sequence=frame.sequence, time_s=frame.time_s)
        self.given[frame.sequence] = replace(felt, camera_frame=image, measures=self.measures)
        return self.given[frame.sequence]


def bump_daemon(
    frames: int = 10**9, period_s: float = 0.01, *, measures: FrameMeasures | None = None, bundle: Bundle | None = None
) -> tuple[SensorSession, BumpReconstructor]:
    """Return a daemon (not started) that gives that many frames, and what computes them."""
    reconstructor = BumpReconstructor(bundle, measures)
    camera: Any = ScriptedCamera(count=frames, period_s=period_s)
    camera.image_shape = SHAPE
    return session_of(camera, reconstructor), reconstructor


def full_frame() -> TactileFrame:
    """Return a frame that has everything a frame may have."""
    felt = bump(0.8, 1.0, -2.0, shape=SHAPE)
    lights = np.full(SHAPE, 9, np.uint8)
    followed = tuple(replace(one, number=7, age_s=0.3, velocity_mm_s=(2.0, -3.0)) for one in felt.contacts)
    return replace(
        felt,
        contacts=followed,
        camera_frame=replace(felt.camera_frame, label=LightLabel(state=LightState.CLEAN, group=3), sequence=2**40),
        exposures=ExposureReport(
            exposures=12, duration_s=0.4, moved=True, repetition_grey=1.5, repetition_limit_grey=1.0, misfit=0.3,
            lights=lights, moving=lights > 8, least_lights=5,
        ),
        provenance=Provenance(
            calibration="c" * 16, zero="d" * 16, pixel_size_mm=(0.05, 0.06), unix_s=1e9,
            ages_s={"taken": 0.01, "reconstructed": 0.03}, findings=("drift",), dropped=2,
        ),
    )  # fmt: skip


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as probe:
        return int(probe.getsockname()[1])
