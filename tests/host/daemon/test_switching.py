"""What runs is exchanged as one: camera, frame path and watch always belong together."""

import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import gellight
from gellight.base.errors import ConfigError, GellightError
from gellight.base.settings import Settings
from gellight.bundle.bundle import Bundle
from gellight.daemon import active_pipeline, assembly
from gellight.daemon.configuration import PathKind
from gellight.daemon.session import SensorSession
from gellight.sensor.series_cameras import SeriesCamera
from tests.helpers.linear_sensor import verified_bundle, with_lights_of_its_own

SHAPE = (24, 32)
SMALL = {"image_width_px": SHAPE[1], "image_height_px": SHAPE[0], "pixel_size_mm": 1.176}
FITTING = {PathKind.NETWORK: False, PathKind.OWN_LIGHTS: True}
"""whether a series camera stands in front"""


@pytest.fixture
def ordinary(tmp_path: Path) -> Bundle:
    return verified_bundle(tmp_path / "ordinary", sensor="simulated", rgb=(200, 200, 200))


def opened(bundle: Bundle, monkeypatch: pytest.MonkeyPatch) -> SensorSession:
    monkeypatch.setattr("gellight.daemon.bundle_choice.load_bundle", lambda name: bundle)
    settings = {"sensor": {"url": "sim://?fps=200", "calibration": "it"}, "geometry": SMALL}
    return assembly.open_session(Settings.model_validate(settings))


def fits(session: SensorSession) -> bool:
    """Whether what stands in front of the camera is what the frame path takes."""
    in_series = isinstance(session._camera._camera, SeriesCamera)
    return in_series == FITTING[session._active.config.path]


def goes_on(session: SensorSession) -> None:
    """Two more frames come, without an error."""
    before = session.wait_frame(-1, 30).camera_frame.sequence
    assert session.wait_frame(before + 1, 30).camera_frame.sequence > before
    assert session.status()["error"] is None


def test_two_who_change_what_runs_at_once_take_turns(ordinary: Bundle, monkeypatch: pytest.MonkeyPatch) -> None:
    building, go_on = threading.Event(), threading.Event()
    build = active_pipeline.path_for

    def slowly(*parts: Any) -> Any:
        path = build(*parts)
        building.set()
        assert go_on.wait(20)
        return path

    series = with_lights_of_its_own(ordinary)
    with opened(ordinary, monkeypatch) as session:
        session.wait_frame(-1, 60)
        monkeypatch.setattr(active_pipeline, "path_for", slowly)
        first = threading.Thread(target=session.replace_bundle, args=(ordinary,))
        second = threading.Thread(target=session.replace_bundle, args=(series,))
        first.start()
        assert building.wait(20)
        second.start()
        second.join(0.3)
        assert second.is_alive(), "it waits for the first"
        go_on.set()
        first.join(30)
        second.join(30)
        assert session.bundle.source == "single lights"
        assert fits(session)
        goes_on(session)


def test_a_light_that_moves_on_needs_lights_to_move(ordinary: Bundle, monkeypatch: pytest.MonkeyPatch) -> None:
    with opened(with_lights_of_its_own(ordinary), monkeypatch) as session:
        settings = session._active.config.settings
        moving = settings.model_copy(update={"lighting": settings.lighting.model_copy(update={"light_mode": "free"})})
        session._active = replace(session._active, config=replace(session._active.config, settings=moving))
        with pytest.raises(ConfigError, match="free"):
            session.replace_bundle(ordinary)
        assert fits(session)
        goes_on(session)


def test_the_mode_of_files_that_wait_for_their_reader_is_changed_and_no_picture_is_missed(
    ordinary: Bundle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    for k in range(6):
        image = np.clip(np.rint(ordinary.reference), 0, 255).astype(np.uint8)
        assert cv2.imwrite(str(pictures / f"{k}.png"), image[..., ::-1])
    with gellight.connect(str(pictures), calibration=ordinary.source, every=True, patience_s=20) as sensor:
        seen = [sensor.next_frame().camera_frame.sequence]
        problems: list[GellightError] = []

        def change() -> None:
            try:
                sensor.mode("network")
            except GellightError as error:
                problems.append(error)

        changing = threading.Thread(target=change, daemon=True)
        changing.start()
        changing.join(10)
        assert not changing.is_alive(), "it waits for a reader who waits for it"
        assert problems == []
        seen += [frame.camera_frame.sequence for frame in sensor]
    assert len(seen) == 6
    assert seen == sorted(set(seen))


def test_a_picture_that_was_given_is_not_given_again_where_it_is_reconstructed_anew(
    ordinary: Bundle, tmp_path: Path
) -> None:
    """A reader may have taken it in the very moment in which the mode is changed."""
    image = np.clip(np.rint(ordinary.reference), 0, 255).astype(np.uint8)
    for k in range(3):
        assert cv2.imwrite(str(tmp_path / f"{k}.png"), image[..., ::-1])
    with gellight.connect(str(tmp_path), calibration=ordinary.source, every=True, patience_s=20) as sensor:
        first = sensor.next_frame()
        sensor.daemon.delivered.put(first)
        seen = [frame.camera_frame.sequence for frame in sensor]
    assert first.camera_frame.sequence not in seen
    assert len(seen) == 2
