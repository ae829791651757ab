"""A simulated sensor that is watched, of 320 x 240 px: the same gel and light in a quarter of the pixels."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from gellight.bundle.bundle import Bundle
from gellight.lab.simulator.scene import Scene
from gellight.watch.monitor import SensorWatch
from sim_reference.camera import CameraResponse
from sim_reference.geometry import AS_BUILT
from tests.helpers.small_bundles import ordinary
from tests.helpers.watched_sensor import NOISE_GREY, WatchedSensor


@pytest.fixture(scope="session")
def halved() -> Bundle:
    """The synthetic bundle, for pictures of half its width."""
    return ordinary(block=2)


@pytest.fixture(scope="session")
def halved_scene() -> Scene:
    geometry = replace(AS_BUILT, image_width_px=320, image_height_px=240, pixel_size_mm=2 * 0.0588)
    return Scene(geometry, CameraResponse(noise_grey=NOISE_GREY))


@pytest.fixture
def new_sensor(halved_scene: Scene, halved: Bundle) -> Callable[[int], WatchedSensor]:
    """Make a sound sensor that is watched, with noise of this seed."""
    return lambda seed: WatchedSensor(halved_scene, SensorWatch(halved), seed)


@pytest.fixture
def whole_sensor(synthetic: Bundle) -> Callable[[int], WatchedSensor]:
    """Make one of 640 x 480 px, whose cells see a touch of half the size."""
    scene = Scene(AS_BUILT, CameraResponse(noise_grey=NOISE_GREY))
    return lambda seed: WatchedSensor(scene, SensorWatch(synthetic), seed)
