"""A running sensor put together of parts, where a test has its own camera or frame path."""

from typing import Any

from gellight.base.settings import ServiceSettings, Settings, WatchSettings
from gellight.daemon.active_pipeline import ActivePipeline
from gellight.daemon.configuration import STILL, ModeConfig, PathKind
from gellight.daemon.session import SensorSession
from gellight.frame_path.pipeline import FramePath
from gellight.frames.camera import Camera


def session_of(
    camera: Camera, path: FramePath, *, watch: Any = None, every: bool = False, realtime: bool = False
) -> SensorSession:
    """Return a session that runs `path` first; what replaces it is built as ever, and watched if `watch` is given."""
    settings = Settings(watch=WatchSettings(enabled=watch is not None), service=ServiceSettings(realtime=realtime))
    config = ModeConfig(bundle=path.bundle, settings=settings, pictures=None, light=STILL, path=PathKind.NETWORK)
    pipeline = ActivePipeline(config=config, path=path, watch=watch)
    return SensorSession(camera, path.bundle, settings, pipeline=pipeline, every=every)
