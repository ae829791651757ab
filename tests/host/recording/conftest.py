"""Recordings of some frames."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from gellight.bundle.bundle import Bundle
from gellight.frames.frames import CameraFrame, CaptureStamp
from gellight.recording.recording_file import DepthKind, RecordingWriter
from tests.helpers.linear_sensor import linear_bundle
from tests.helpers.recorded import SHAPE
from tests.helpers.streamed import full_frame


@pytest.fixture
def bundle(tmp_path: Path) -> Bundle:
    return linear_bundle(tmp_path / "bundle", shape=SHAPE)


@pytest.fixture
def record(tmp_path: Path, bundle: Bundle) -> Callable[..., Path]:
    """Write a recording of some frames, 30 a second."""

    def write(frames: list[CameraFrame], name: str = "a.mcap", depth: DepthKind = DepthKind.NONE) -> Path:
        with RecordingWriter(tmp_path / name, "left finger", depth=depth) as writer:
            for frame in frames:
                unix_s = 1e9 + frame.time_s
                writer.add(frame, CaptureStamp(zeroed=bundle, unix_s=unix_s))
                felt = full_frame()
                provenance = replace(felt.provenance, unix_s=unix_s)
                writer.add_tactile(replace(felt, camera_frame=frame, provenance=provenance))
        return tmp_path / name

    return write
