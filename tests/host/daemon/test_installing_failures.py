"""An installation happens whole or not at all, wherever it fails."""

import errno
import os
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest

from gellight.base.errors import BundleError, GellightError
from gellight.bundle.bundle import Bundle
from gellight.bundle.store import BundleStore
from gellight.daemon.installing import install
from gellight.daemon.session import SensorSession
from gellight.frame_path.pipeline import Reconstructor
from gellight.watch.monitor import SensorWatch
from tests.helpers.linear_sensor import verified_bundle
from tests.helpers.scripted_camera import LitCamera
from tests.helpers.sessions import session_of

SENSOR = "E660C06213842F2A"


class Service:
    """A sensor with a bundle in service: camera, board, store, stream."""

    def __init__(self, folder: Path, streams: bool) -> None:
        self.camera, self.store = LitCamera(), BundleStore(folder / "store")
        self.old = verified_bundle(folder / "old", sensor=SENSOR, rgb=(255, 200, 90), exposure_us=9000)
        self.new = verified_bundle(folder / "new", sensor=SENSOR, rgb=(80, 81, 82), exposure_us=12000)
        self.camera.adopt(self.old.controls, self.old.colours)
        self.daemon = session_of(self.camera, Reconstructor(self.old), watch=SensorWatch(self.old)) if streams else None
        self.running: SensorSession | None = None
        install(self.old, sensor=SENSOR, store=self.store, camera=self.camera)
        self.running = self.daemon
        self.camera.failures.reset()

    def install(self, bundle: Bundle) -> None:
        install(bundle, sensor=SENSOR, store=self.store, running=self.running, camera=self.camera)

    def state(self) -> dict[str, Any]:
        """What must not change."""
        return {
            "in service": self.store.current(SENSOR).identity,
            "history": self.store.history(SENSOR),
            "setting": self.camera.setting(),
            "board": self.camera.ring.memory,
        }


@pytest.fixture
def service(tmp_path: Path) -> Service:
    """The camera alone: with a daemon `test_running_states.py` says the same."""
    return Service(tmp_path, streams=False)


STEPS = ["exposure_us", "light 1", "configuration 1", "configuration 2", "blank 1", "configure 1", "configured 1",
         "light 2"]  # fmt: skip
"""what an installation asks of camera and board, in this order"""


@pytest.mark.parametrize("step", STEPS)
def test_what_fails_at_camera_or_board_changes_nothing(service: Service, step: str) -> None:
    before = service.state()
    failing = f"{step} 1" if " " not in step else step
    service.camera.failures.reset(failing)
    with pytest.raises(GellightError, match=f"^{step.split()[0]} failed$"):
        service.install(service.new)
    assert service.state() == before
    service.camera.failures.reset()
    service.install(service.new)
    assert service.store.current(SENSOR).identity == service.new.identity
    assert service.camera.setting()[0]["exposure_us"] == 12000
    assert service.camera.ring.lit[0, 0] == 80
    assert service.camera.ring.memory.bundle.hex() == service.new.identity


def test_a_history_that_was_renamed_but_not_flushed_is_put_back(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    from gellight.base.writing import write_file

    before, calls = service.state(), []

    def write_then_fail(path: Path, content: bytes) -> None:
        write_file(path, content)
        calls.append(content)
        if len(calls) == 1:
            raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr("gellight.bundle.store.write_file", write_then_fail)
    with pytest.raises(BundleError, match="Input/output error"):
        service.install(service.new)
    assert len(calls) == 2
    assert service.state() == before


@pytest.mark.parametrize("with_daemon", [True, False])
def test_what_cannot_be_taken_back_is_named(tmp_path: Path, with_daemon: bool) -> None:
    """The board is pulled while it writes its flash: it cannot be asked any more, and cannot be lit."""
    service = Service(tmp_path, with_daemon)
    with service.daemon or nullcontext():
        named_what_cannot_be_taken_back(service)


def named_what_cannot_be_taken_back(service: Service) -> None:
    service.camera.failures.reset("configured", "configuration 3", "light 2", "light 3", "light 4")
    with pytest.raises(BundleError) as caught:
        service.install(service.new)
    said = str(caught.value)
    streams = "the sensor streams with" if service.daemon else "camera and LEDs are set as"
    assert f"the board may remember bundle {service.new.identity} (configuration failed)" in said
    assert f"{streams} bundle {service.new.identity}" in said
    assert f"gellight calibrate restore {service.old.identity}" in said
    assert service.store.current(SENSOR).identity == service.old.identity
    if service.daemon:
        assert service.daemon.bundle.identity == service.new.identity, "it says so"
