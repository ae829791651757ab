"""Bundles in service: only verified ones of the same sensor, the old ones kept, the board told, nothing half done."""

import errno
import json
import os
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gellight.base.errors import BundleError, GellightError
from gellight.base.settings import load_settings
from gellight.bundle.bundle import Bundle, load_bundle
from gellight.bundle.store import BundleStore
from gellight.daemon.assembly import open_session
from gellight.daemon.bundle_choice import bundle_of, sensor_name
from gellight.daemon.installing import install, remember, restore
from gellight.daemon.session import SensorSession
from gellight.frame_path.pipeline import Reconstructor
from gellight.opening import open_camera
from gellight.ring.light_ring import connect
from gellight.watch.monitor import SensorWatch
from tests.helpers.linear_sensor import verified_bundle
from tests.helpers.scripted_camera import LitCamera
from tests.helpers.sessions import session_of
from tests.helpers.waiting import eventually


@pytest.fixture
def store(tmp_path: Path) -> BundleStore:
    return BundleStore(tmp_path / "bundles")


class Stream:
    """A running sensor that remembers what it was given."""

    def __init__(self) -> None:
        self.taken: list[str] = []
        self.refuses = False

    def replace_bundle(self, bundle: Bundle) -> Callable[[], object]:
        if self.refuses:
            raise BundleError("it does not fit")
        self.taken.append(bundle.identity)
        return self.taken.pop


def test_the_old_bundle_can_be_restored_and_the_new_one_after_it_and_none_that_is_not_there(
    store: BundleStore, tmp_path: Path
) -> None:
    with pytest.raises(BundleError, match="no calibration bundle on this computer: run `gellight calibrate`"):
        store.current("GL-7")
    with pytest.raises(BundleError, match="had no other bundle before"):
        restore("", sensor="GL-7", store=store)
    stream, first, second = Stream(), verified_bundle(tmp_path / "first"), verified_bundle(tmp_path / "second")
    for one in (first, second):
        install(one, sensor="GL-7", store=store)
    restore("", sensor="GL-7", store=store, running=stream)
    assert store.current("GL-7").identity == first.identity
    restore(second.identity[:6], sensor="GL-7", store=store, running=stream)
    assert store.current("GL-7").identity == second.identity
    assert stream.taken == [first.identity, second.identity]
    with pytest.raises(BundleError, match="no bundle of identity 'ffff'"):
        restore("ffff", sensor="GL-7", store=store)


def test_what_did_not_pass_replaces_nothing(store: BundleStore, tmp_path: Path) -> None:
    stream, good = Stream(), verified_bundle(tmp_path / "good")
    install(good, sensor="GL-7", store=store, running=stream)
    bad = verified_bundle(tmp_path / "bad", metrics={"verification": {"depth_mm": 0.5, "normal_deg": 2.0}})
    with pytest.raises(BundleError, match="did not pass its verification"):
        install(bad, sensor="GL-7", store=store, running=stream)
    assert stream.taken == [good.identity]
    assert [entry.identity for entry in store.bundles()] == [good.identity]


def test_a_bundle_of_another_sensor_is_refused(store: BundleStore, tmp_path: Path) -> None:
    other = verified_bundle(tmp_path / "other", sensor="GL-8")
    with pytest.raises(BundleError, match="bundle of sensor 'GL-8', this is 'GL-7': nothing was replaced"):
        install(other, sensor="GL-7", store=store)
    install(other, sensor="GL-8", store=store)
    with pytest.raises(BundleError, match="this is 'GL-7'"):
        restore(other.identity, sensor="GL-7", store=store)


def test_a_bundle_that_the_running_sensor_cannot_use_is_not_in_service(store: BundleStore, tmp_path: Path) -> None:
    stream, good = Stream(), verified_bundle(tmp_path / "good")
    install(good, sensor="GL-7", store=store, running=stream)
    stream.refuses = True
    with pytest.raises(BundleError, match="does not fit"):
        install(verified_bundle(tmp_path / "large", shape=(48, 64)), sensor="GL-7", store=store, running=stream)
    assert store.current("GL-7").identity == good.identity


def test_a_damaged_bundle_is_listed_as_such_and_never_put_in_service(store: BundleStore, tmp_path: Path) -> None:
    first, second = verified_bundle(tmp_path / "first"), verified_bundle(tmp_path / "second")
    for one in (first, second):
        install(one, sensor="GL-7", store=store)
    (store.folder / "GL-7" / first.identity / "network.onnx").write_bytes(b"rust")
    damaged = next(entry for entry in store.bundles() if entry.identity == first.identity)
    assert "changed after calibration" in damaged.problem
    assert json.dumps(damaged.model_dump(mode="json"))
    with pytest.raises(BundleError, match="has no report"):
        store.find(second.identity).report()
    with pytest.raises(BundleError, match="changed after calibration"):
        restore("", sensor="GL-7", store=store)
    assert store.current("GL-7").identity == second.identity


@pytest.mark.parametrize("sensor", ["..", "a/b", ".hidden", "Ünit 3"])
def test_a_sensor_of_any_name_stays_inside_the_store(store: BundleStore, tmp_path: Path, sensor: str) -> None:
    install(verified_bundle(tmp_path / "one", sensor=sensor), sensor=sensor, store=store)
    assert store.sensors() == [sensor]
    assert store.current(sensor).path.parent.parent == store.folder


def test_the_board_remembers_the_bundle_is_lit_again_and_writes_only_what_is_new(
    store: BundleStore, tmp_path: Path
) -> None:
    with open_camera("sim://?programme=0") as camera:
        ring, name = camera.ring, sensor_name(camera)
        assert bundle_of(camera, store).manifest.sensor == "simulated", "nothing else is known of it yet"
        first, second = (
            verified_bundle(tmp_path / "first", sensor=name),
            verified_bundle(tmp_path / "second", sensor=name),
        )
        assert install(first, sensor=name, store=store, camera=camera).remembered
        assert ring.configuration().bundle == bytes.fromhex(first.identity)
        install(second, sensor=name, store=store)
        assert bundle_of(camera, store).identity == first.identity, "the board knows better than this computer"
        foreign = verified_bundle(tmp_path / "foreign", sensor="GL-8")
        remember(ring, bytes.fromhex(foreign.identity))
        with pytest.raises(BundleError, match=r"cannot be had here .* bring it with `gellight calibrate install"):
            bundle_of(camera, store)
        store.add(foreign)
        with pytest.raises(BundleError, match="bundle of sensor 'GL-8'"):
            bundle_of(camera, store)
    synthetic = load_bundle("synthetic")
    identity = bytes.fromhex(synthetic.identity)
    with connect("sim://") as ring:
        ring.light(synthetic.colours)
        remember(ring, identity)
        saves = ring.status().config_saves
        eventually(lambda: ring.status().current_ma >= 100)  # the LEDs are lit as before
        remember(ring, identity)
        assert ring.status().config_saves == saves
        assert ring.configuration().name.rstrip(b"\0") == b"GelLight", "the rest of the configuration is kept"


def test_auto_takes_the_bundle_of_this_sensor(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("platformdirs.user_data_path", lambda *_: tmp_path)
    settings = load_settings({"sensor.url": "sim://?board=0", "sensor.calibration": "auto"})
    with open_session(settings) as daemon:
        assert daemon.bundle.identity == load_bundle("synthetic").identity
    mine = load_bundle("synthetic")
    mine = mine.with_reference(np.clip(mine.reference + 0.5, 0, 255), frames=90)
    store = BundleStore()
    store.put_in_service(store.add(mine))
    with open_session(settings) as daemon:
        assert daemon.bundle.identity == mine.identity


def test_a_sensor_without_a_bundle_runs_with_that_of_the_simulated_one_unless_its_own_is_asked_for(
    tmp_path: Path,
) -> None:
    store = BundleStore(tmp_path / "store")
    camera = SimpleNamespace(ring=None, url="v4l2:///dev/video0?fps=30", bundle=None)
    assert bundle_of(camera, store, default="synthetic").identity == load_bundle("synthetic").identity  # type: ignore[arg-type]
    with pytest.raises(BundleError, match="has no calibration bundle"):
        bundle_of(camera, store)  # type: ignore[arg-type]
    assert sensor_name(camera) == "v4l2:///dev/video0", "other parameters are no other sensor"  # type: ignore[arg-type]


# ---- whole or not at all, wherever it fails ----


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
