"""The doctor: every finding with its remedy, on a computer made of nothing."""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import pytest

from gellight.base.errors import BoardError, CameraError, InputError
from gellight.lab.doctor import examination, sensor_checks
from gellight.lab.doctor.sensor_checks import check_shutter, check_stamps
from gellight.sensor.discovery import discover
from gellight.sensor.findings import Level, ok, problem
from gellight.sensor.v4l2 import controls as c
from gellight.sensor.v4l2 import structures as v
from gellight.sensor.v4l2.options import parse_url
from gellight.sensor.v4l2.stamps import StampMeaning
from gellight.sensor.v4l2.stream import Picture
from gellight.sensor.v4l2.video_camera import V4l2Camera
from tests.helpers.clinic import MEASURED, WEBCAM, Clinic, TalkingRing, wrong
from tests.helpers.command_line import invoke
from tests.helpers.v4l2_pictures import jpeg, scene
from tests.helpers.virtual_sensor import virtual_sensor


def test_a_healthy_sensor_has_no_finding_that_needs_a_remedy(clinic: Clinic, tmp_path: Path) -> None:
    clinic.plug("1-2", "GL0001")
    findings = clinic.examine(tmp_path)
    assert wrong(findings) == {}
    checks = {finding.check for finding in findings}
    assert checks >= {"udev rule", "disk", "clock", "sensors", "usb", "permission", "formats", "settings", "rate",
                      "stamps", "bandwidth", "frames", "board", "leds", "shutter"}  # fmt: skip
    text = {finding.check: finding.text for finding in findings}
    assert "30.00 frames/s by the kernel's stamps" in text["rate"]
    assert clinic.all_dark()
    assert not clinic.kernel.opened


def plugged(**fault: Any) -> Callable[[Clinic], object]:
    """A camera that has a fault."""
    return lambda clinic: clinic.plug("1-2", "GL0001", **fault)


def without(number: int) -> Callable[[Clinic], object]:
    """A camera that lacks a control."""
    return lambda clinic: clinic.plug("1-2", "GL0001").controls.pop(number)


def repeating(clinic: Clinic) -> None:
    clinic.plug("1-2", "GL0001").payload = lambda number: clinic.look(number // 2)


def coming_loose(clinic: Clinic) -> None:
    camera = clinic.plug("1-2", "GL0001")

    def spoil(number: int) -> bytes:
        camera.controls[c.EXPOSURE_AUTO].value = 3
        return clinic.look(number)

    camera.payload = spoil


def unseen(clinic: Clinic) -> None:
    clinic.plug("1-2", "GL0001")
    clinic.blind = True


def tearing_jpegs(clinic: Clinic) -> None:
    whole = jpeg(scene(shape=(24, 32)))
    camera = clinic.plug("1-2", "GL0001", formats={"MJPG": {(32, 24): [30]}})
    camera.payload = lambda number: (
        (whole[:-40] if number % 4 == 1 else whole[:-2]) + bytes([number % 251]) + whole[-2:]
    )


@pytest.mark.parametrize(
    ("fault", "check", "words", "remedy"),
    [
        (plugged(stamp=lambda number, time_s: 98 + (time_s - 100) * 1.5), "rate", "20.00 frames/s", "exposure"),
        (plugged(missing=lambda number: number % 4 == 2), "frames", "lost", "cable"),
        (plugged(bad=lambda number: v.FLAG_ERROR * (number % 4 == 2)), "frames", "damaged", "cable"),
        (plugged(stamp=lambda number, time_s: time_s + 9), "clock", "cannot be true", "hwtimestamps"),
        (plugged(stamp=lambda number, time_s: time_s + 0.005 * (number % 7 == 3)), "stamps", "than the 2 ms", "a hub"),
        (
            plugged(missing=lambda number: number % 9 == 4, sequence=lambda number: number - (number + 4) // 9),
            "frames",
            "missing without a gap in the driver's numbers",
            "lower the rate",
        ),
        (repeating, "frames", "repeat the one before", ""),
        (without(c.EXPOSURE), "settings", "cannot be fixed", ""),
        (without(c.GAIN), "settings", "no gain", ""),
        (without(c.WHITE_BALANCE), "settings", "white_balance_k", ""),
        (coming_loose, "settings", "automatic exposure_us", ""),
        (unseen, "leds", "", "data wire"),
        (tearing_jpegs, "frames", "15 not whole", "cable"),
    ],
)
def test_what_is_wrong_with_frames_settings_and_light_is_found(
    clinic: Clinic, tmp_path: Path, fault: Callable[[Clinic], object], check: str, words: str, remedy: str
) -> None:
    fault(clinic)
    found = wrong(clinic.examine(tmp_path))[check]
    assert found.level is (Level.PROBLEM if check == "leds" else found.level)
    assert words in found.text
    assert remedy in found.remedy
    assert clinic.all_dark()


def test_a_camera_that_does_not_tell_its_rates_is_examined_too(clinic: Clinic, tmp_path: Path) -> None:
    clinic.plug("1-2", "GL0001", formats={"YUYV": {(32, 24): []}})
    findings = clinic.examine(tmp_path)
    assert wrong(findings) == {}
    assert "YUYV 32x24 at ? fps" in [finding.text for finding in findings]


def test_the_remedy_for_stamps_that_wander_is_one_that_helps(clinic: Clinic, tmp_path: Path) -> None:
    clinic.plug("1-2", "GL0001", stamp=lambda number, time_s: time_s + 0.005 * (number % 7 == 3))
    remedy = wrong(clinic.examine(tmp_path))["stamps"].remedy
    option = remedy.rpartition("?")[2]
    node = next(iter(clinic.kernel.cameras))
    with V4l2Camera(node, parse_url(f"v4l2://x?{option}")[1], kernel=clinic.kernel) as camera:
        pictures = [camera.picture() for _ in range(60)]
        assert check_stamps(camera, pictures).level is Level.OK
        assert camera.timing.stamp_error_s >= 0.0042, "5 ms, less what the steady rate takes of it"


def test_a_camera_that_stumbles_at_its_start_is_no_finding(clinic: Clinic, tmp_path: Path) -> None:
    clinic.plug("1-2", "GL0001", stamp=lambda number, time_s: time_s + 0.009 * (number == 1))
    assert wrong(clinic.examine(tmp_path)) == {}


@pytest.mark.parametrize("of_start", [True, False], ids=["stamps of the first packet", "stamps of the end"])
@pytest.mark.parametrize("told", [True, pytest.param(False, marks=pytest.mark.nightly)], ids=["told", "measured"])
def test_the_shutter_is_measured_and_what_is_to_be_given_is_right(
    monkeypatch: pytest.MonkeyPatch, told: bool, of_start: bool
) -> None:
    """With the options that it names, frames begin when they did."""
    late_s = 0.006
    if told:
        camera, shutter = Mock(ring=Mock(led_count=12)), replace(MEASURED, delay_s=-late_s)
        monkeypatch.setattr(sensor_checks, "measure_shutter", lambda camera, groups, timing: shutter)
    else:
        camera = virtual_sensor(monkeypatch, late_s=late_s, jitter_s=2e-4)
    meaning = StampMeaning(hardware_stamps=False, period_s=1 / 30, exposure_s=0.008)
    picture = Picture(data=b"", sequence=1, stamp_s=50.0, stamp_is_start=of_start, stamp_is_sound=True, arrived_s=51.0,
                      absent_s=49.0, repeats=False)  # fmt: skip
    true_start_s = meaning.start_s(picture) - late_s
    finding = check_shutter(camera, meaning, picture)
    assert (finding.level, finding.check) == (Level.OK, "shutter")
    options = parse_url("v4l2://x" + finding.text.split("give ")[1].split()[0])[1]
    assert options.readout_us == pytest.approx(12_000, abs=1000)
    given = replace(meaning, readout_s=options.readout_us * 1e-6, delay_s=options.delay_us * 1e-6)
    assert given.start_s(picture) == pytest.approx(true_start_s, abs=1e-3)
    assert given.camera_timing().stamp_error_s < meaning.camera_timing().stamp_error_s / 10
    camera.close()


def test_a_shutter_that_cannot_be_measured_is_a_warning_and_a_hot_board_a_problem(
    clinic: Clinic, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    why = "only 3 row bands saw the light change"
    monkeypatch.setattr(sensor_checks, "measure_shutter", Mock(side_effect=CameraError(why)))
    monkeypatch.setattr(TalkingRing, "dimmed", 2)
    clinic.plug("1-2", "GL0001")
    found = wrong(clinic.examine(tmp_path))
    assert (found["shutter"].level, found["board"].level) == (Level.WARNING, Level.PROBLEM)
    assert why in found["shutter"].text
    assert re.search("66 °C.*1/4|1/4.*66 °C", found["board"].remedy)
    assert clinic.all_dark()


def test_a_slow_board_a_slow_bus_and_a_shared_bus_are_found(
    clinic: Clinic, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(TalkingRing, "answer_s", 0.05)
    clinic.plug("1-2", "GL0001")
    clinic.usb.plug("1-7", serial="CAM", ids=WEBCAM, cameras=1)
    found = wrong(clinic.examine(tmp_path))
    assert "50.00 ms" in found["clock"].text
    assert "1 more cameras share USB bus 1" in found["usb"].text
    next(clinic.usb.root.rglob("1-2/speed")).write_text("12\n")
    findings = [finding for finding in clinic.examine(tmp_path) if finding.check == "usb"]
    assert "12 Mbit/s" in findings[0].text
    assert "cable" in findings[0].remedy


def test_a_node_that_others_have_open_is_told_and_one_that_may_not_be_used_is_not_opened(
    clinic: Clinic, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clinic.plug("1-2", "GL0001")
    monkeypatch.setattr(examination, "holders", lambda path: [(4711, "cheese")])
    found = wrong(clinic.examine(tmp_path))
    assert "also open in cheese (process 4711)" in found["permission"].text
    assert len(clinic.rings) == 1, "having it open is not yet using it: the checks go on"
    monkeypatch.setattr(examination.os, "access", lambda path, mode: False)
    assert "install-udev" in wrong(clinic.examine(tmp_path))["permission"].remedy
    assert len(clinic.rings) == 1


def test_a_fault_of_the_sensor_is_a_finding_too(clinic: Clinic, tmp_path: Path) -> None:
    clinic.plug("1-2", "GL0001", busy=True)
    assert "is in use by" in wrong(clinic.examine(tmp_path))["sensor"].text
    next(iter(clinic.kernel.cameras.values())).busy = False
    clinic.open_ring = Mock(side_effect=BoardError("the board speaks protocol 0.9: run `gellight firmware flash`"))  # type: ignore[method-assign]
    found = wrong(clinic.examine(tmp_path))["sensor"]
    assert (found.text, found.remedy) == ("the board speaks protocol 0.9", "run `gellight firmware flash`")


def test_a_computer_without_sensor_rule_disk_or_date_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clinic = Clinic(tmp_path / "computer")
    monkeypatch.setattr(examination.shutil, "disk_usage", lambda folder: SimpleNamespace(free=5e8))
    monkeypatch.setattr(examination.time, "gmtime", lambda: SimpleNamespace(tm_year=1970))
    clock = clinic.usb.sysfs / "devices/system/clocksource/clocksource0/current_clocksource"
    clock.parent.mkdir(parents=True)
    clock.write_text("hpet\n")
    findings = clinic.examine(tmp_path / "computer")
    found = wrong(findings)
    assert set(found) == {"udev rule", "disk", "clock", "sensors"}
    assert "0.5 GB" in found["disk"].text
    assert "believes it is 1970" in " ".join(finding.text for finding in findings)
    assert "gellight demo" in found["sensors"].remedy
    assert "sim://" not in found["sensors"].remedy, "the doctor looks at real sensors"


def test_ambiguous_and_missing_sensors_are_findings(clinic: Clinic, tmp_path: Path) -> None:
    clinic.plug("1-2", "GL0009")
    clinic.plug("1-3", "GL0009")
    found = [finding for finding in clinic.examine(tmp_path, "1-2") if finding.level is Level.PROBLEM]
    assert [finding.remedy for finding in found] == ["tell them apart as sensor://1-2 or sensor://1-3"]
    assert "no sensor is called GL0001" in wrong(clinic.examine(tmp_path, "GL0001"))["sensors"].text + str(found)


def test_sensors_are_listed_as_they_were_found(clinic: Clinic) -> None:
    for number in range(1, 6):
        clinic.plug(f"1-{number}", f"GL000{number}")
    found = discover(sysfs=clinic.usb.sysfs, dev=clinic.usb.dev)
    listed = [finding.text.partition(":")[0] for finding in examination.check_found(found, None)]
    assert listed == [f"GL000{number} at USB 1-{number}" for number in range(1, 6)]


def test_a_camera_without_a_ring_can_be_examined_by_its_node(clinic: Clinic, tmp_path: Path) -> None:
    clinic.plug("1-2", "GL0001")
    node = next(iter(clinic.kernel.cameras))
    clinic.usb.unplug("1-2")
    (camera,) = clinic.usb.plug("1-2", serial="CAM", ids=WEBCAM, cameras=1)
    clinic.kernel.cameras[camera] = clinic.kernel.cameras.pop(node)
    findings = clinic.examine(tmp_path, camera)
    assert wrong(findings) == {}
    assert "rate" in {finding.check for finding in findings}
    assert "board" not in {finding.check for finding in findings}
    assert "shares a USB parent" in wrong(clinic.examine(tmp_path))["sensors"].text


# ---- `gellight doctor` and `find` ----


def test_find_lists_sensors_and_what_is_left_over(clinic: Clinic, monkeypatch: pytest.MonkeyPatch) -> None:
    clinic.plug("1-2", "GL0001")
    clinic.usb.plug("1-7", serial="CAM", ids=WEBCAM, cameras=1)
    clinic.usb.plug("1-8", serial="RING", rings=1)
    usb = clinic.usb
    monkeypatch.setattr("gellight.cli.find.discover", lambda: discover(sysfs=usb.sysfs, dev=usb.dev))
    shown = invoke("find")
    assert shown.exit_code == 0
    assert "sensor://GL0001   USB 1-2, camera " in shown.output
    assert "camera without a ring: " in shown.output
    assert "ring without a camera: " in shown.output
    listed = json.loads(invoke("find", "--json").output)
    assert [sensor["url"] for sensor in listed["sensors"]] == ["sensor://GL0001"]
    assert listed["sensors"][0]["camera"]["speed_mbps"] == 480
    assert [len(listed[kind]) for kind in ("cameras", "rings", "ambiguities")] == [1, 1, 0]


def test_find_says_what_to_do_where_nothing_is_plugged_in(clinic: Clinic, monkeypatch: pytest.MonkeyPatch) -> None:
    usb = clinic.usb
    monkeypatch.setattr("gellight.cli.find.discover", lambda: discover(sysfs=usb.sysfs, dev=usb.dev))
    found = invoke("find")
    assert (found.exit_code, invoke("find", "--json").exit_code) == (0, 0), found.exception
    assert "no light ring are plugged in: check the cable; `" in found.output
    assert " demo` shows a simulated sensor" in found.output
    assert "--sensor" not in found.output, "it takes no such option"


def test_the_doctor_takes_every_name_that_is_printed_for_a_sensor(clinic: Clinic, tmp_path: Path) -> None:
    clinic.plug("1-2", "GL0001")
    clinic.plug("1-3", "GL0002")
    found = discover(sysfs=clinic.usb.sysfs, dev=clinic.usb.dev)
    first = found.called("GL0001")
    lit = f"v4l2://{first.camera.path}?ring={first.ring.path}"
    for name in ("sensor://GL0001", "sensor://1-2", "GL0001", "1-2", first.camera.path, first.camera.stable, lit):
        clinic.rings.clear()
        told = clinic.examine(tmp_path, name)
        assert set(wrong(told)) <= {"usb"}, f"{name}: only that two share a bus"
        assert [finding.check for finding in told].count("leds") == 1, name
        assert len(clinic.rings) == 1, name
    assert len([finding for finding in clinic.examine(tmp_path, "auto") if finding.check == "leds"]) == 2
    told = wrong(clinic.examine(tmp_path, f"v4l2://{first.camera.path}?ring=/dev/ttyACM77"))
    assert "no light ring is at /dev/ttyACM77" in told["sensors"].text
    with pytest.raises(InputError, match="sim:// is no real sensor"):
        clinic.examine(tmp_path, "sim://")


def test_doctor_prints_findings_and_exits_with_1_where_one_prevents_use(monkeypatch: pytest.MonkeyPatch) -> None:
    findings = [ok("disk", "1 GB"), problem("usb", "slow", "use another cable")]
    monkeypatch.setattr("gellight.lab.doctor.examination.examine", lambda name, surroundings, folder: iter(findings))
    training = ok("training", "numpy trains networks")
    monkeypatch.setattr("gellight.lab.training.training.check_trainer", lambda: training)
    shown = invoke("doctor")
    assert shown.exit_code == 1
    assert shown.output.splitlines()[1:3] == ["problem  usb         slow", f"{'':21}-> use another cable"]
    assert shown.output.splitlines()[3].split(maxsplit=2) == ["ok", "training", "numpy trains networks"]
    listed = json.loads(invoke("doctor", "--json").output)["findings"]
    assert listed[1] == {"level": "problem", "check": "usb", "text": "slow", "remedy": "use another cable"}
    findings.pop()
    assert invoke("doctor").exit_code == 0
