"""From the plug to the depth map: discovery, recovery, `find`, `doctor` and `run` on the virtual sensor."""

import json
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gellight.bundle.bundle import Bundle, load_bundle, write_bundle
from gellight.lab.simulator.shutter import Shutter
from gellight.lab.simulator.simulated_camera import open_simulated
from tests.helpers.small_bundles import at_places
from tests.vm.machine.bench import LIT, ONE, TWO, Bench, sized
from tests.vm.machine.qemu import Guest, hardware_virtualisation

TIMING = {"readout_us": Shutter().readout_us, "delay_us": Shutter().readout_us + Shutter().transfer_us}
"""the virtual camera sends a picture when all of it was read and transferred, not while its first rows are read"""


def tiny_bundle(folder: Path, geometry: Mapping[str, float | int | str]) -> Bundle:
    """Write the bundle of a sensor with `geometry`, whose pixels each cover several of the shipped bundle's."""
    shipped = load_bundle("synthetic")
    with open_simulated("sim://?board=0&programme=0&noise=0", geometry) as camera:
        reference = camera.read().image.astype(np.float32)
    factor = shipped.image_shape[1] / reference.shape[1]
    return write_bundle(
        folder,
        sensor="virtual",
        reference=reference,
        reference_frames=1,
        noise_grey=1.0,
        pixel_size_mm=(float(geometry["pixel_size_mm"]),) * 2,
        network=at_places(shipped.network, factor, (factor - 1) / 2, (factor - 1) / 2),
        metrics={},
        led=shipped.manifest.led,
        camera={"exposure_us": 8000.0, "gain": 0.0, "white_balance_k": 4600.0, **TIMING},
    )


@pytest.fixture(scope="module", autouse=True)
def _heavy_modules(guest: Guest) -> None:
    """What several verbs import when they start."""
    guest.main.preload(
        "gellight.daemon.assembly",
        "gellight.lab.simulator.simulated_camera",
        "gellight.daemon.calibration_service",
        "gellight.dashboard.server",
    )


def test_discovery_pairs_camera_and_ring_by_their_usb_parent(guest: Guest, bench: Bench) -> None:
    bench.plug("one", 0)
    bench.plug("two", 3)
    found = guest.run("sensing:sensors")
    pairs = {sensor["serial"]: (sensor["port"], sensor["ring"]) for sensor in found["sensors"]}
    assert {serial: port for serial, (port, _) in pairs.items()} == {ONE: "1-1", TWO: "1-4"}
    assert len({ring for _, ring in pairs.values()}) == 2
    assert found["single cameras"] == len(found["ambiguities"]) == 0
    assert f"sensor://{ONE}" in found["only"]
    assert f"sensor://{TWO}" in found["only"]
    mixed = guest.run("sensing:refusal", url=f"v4l2://{camera_of(found, ONE)}?ring=serial://{TWO}")
    assert "ring and camera are of different sensors" in mixed
    assert f"use sensor://{TWO}" in mixed


def camera_of(found: dict[str, Any], serial: str) -> str:
    return next(str(sensor["camera"]) for sensor in found["sensors"] if sensor["serial"] == serial)


def test_a_sensor_that_is_plugged_into_another_port_goes_on(guest: Guest, bench: Bench) -> None:
    bench.plug("lit", 0)
    recovering = guest.start("sensing:recover", number=LIT, limit_s=60)
    recovering.event("streaming")
    bench.unplug("lit", aside=True)
    plugged = bench.plug("lit", 6, aside=True)
    found = recovering.result()
    print(
        f"recovery: first frame {found['back_s'] - plugged['attached_s']:.2f} s after the plug went in, "
        f"{found['back_s'] - found['lost_s']:.2f} s after the loss was noticed"
    )
    assert "reconnecting" in found["said"]
    assert found["status"]["reconnections"] == 1
    assert found["back_s"] > plugged["attached_s"] > found["lost_s"]
    assert found["sequences"] == sorted(set(found["sequences"])), "no frame comes twice or out of order"


def test_find_names_the_sensor_and_doctor_finds_it_well(guest: Guest, bench: Bench) -> None:
    bench.plug("lit", 2)
    listed = guest.run("sensing:gellight", arguments=["find", "--json"], limit_s=60)
    (sensor,) = json.loads(listed["out"])["sensors"]
    assert (sensor["url"], sensor["port"]) == (f"sensor://{LIT}", "1-3")
    found = guest.run("sensing:gellight", arguments=["doctor", "--json"], limit_s=250)
    findings = {(each["check"], each["level"]): each["text"] for each in json.loads(found["out"])["findings"]}
    print("\n".join(f"{level} {check}: {text}" for (check, level), text in findings.items()))
    assert ("board", "ok") in findings
    assert LIT in findings["board", "ok"]
    assert ("leds", "ok") in findings
    assert ("settings", "ok") in findings
    assert ("usb", "ok") in findings
    assert ("power", "ok") in findings


def test_the_udev_rule_gives_the_sensor_to_the_video_group(guest: Guest, bench: Bench) -> None:
    assert guest.run("sensing:gellight", arguments=["install-udev"], limit_s=60)["status"] == 0
    bench.plug("one", 0)
    assert guest.run("plugging:owners", serial=ONE) == {"camera": ["video", "660"], "ring": ["video", "660"]}


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bundle") / "tiny"
    tiny_bundle(folder, sized(80, 60))
    return folder


def test_run_streams_depth_and_serves_its_status_while_the_sensor_is_unplugged(
    guest: Guest, bench: Bench, bundle: Path
) -> None:
    bench.plug("lit", 0)
    frames = 200 if hardware_virtualisation() else 5  # an emulated processor takes seconds for one
    arguments = ["--sensor", "auto", "--calibration", str(bundle), "--frames", str(frames), "--json"]
    running = guest.start("sensing:run_through", arguments=arguments, limit_s=170)
    assert running.event("streaming")["status"]["error"] is None
    bench.unplug("lit", aside=True)
    away = running.event("away")
    plugged = bench.plug("lit", 6, aside=True)
    back = running.event("back")
    found = running.result()
    connected_s = back["at_s"] - plugged["attached_s"]
    print(f"run: {found['seconds']:.0f} s in the guest, connected {connected_s:.2f} s after the plug went in")
    print(found["out"])

    for status in (away["first"], away["later"]):
        assert status["error"], "as soon as the loss is noticed"
        assert status["camera"]["connection"] == "reconnecting"
    assert away["later"]["error"].startswith(f"reconnecting to sensor {LIT} since")
    assert away["later"]["camera"]["reconnecting_s"] >= away["first"]["camera"]["reconnecting_s"] + 0.4
    assert away["later"]["frames"] == away["first"]["frames"], "nothing is felt by a sensor that is away"
    assert back["status"]["camera"]["reconnections"] == 1

    assert found["status"] == 0, found["err"]
    summary = json.loads(found["out"].splitlines()[-1])
    assert summary["frames"] == frames
    assert summary["error"] is None
    board = bench.sensors["lit"].board
    assert not board.light_at(board.virtual_us(time.monotonic())).any(), "the LEDs are dark when the program has ended"
    assert summary["indentation_mm"] == pytest.approx(1.0, abs=0.15), "a ball 1 mm deep, at 0.47 mm a pixel"
