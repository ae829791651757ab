"""`gellight doctor` and `find`: what they print of sensors, and what they take for a name."""

import json
from pathlib import Path

import pytest

from gellight.base.errors import InputError
from gellight.sensor.discovery import discover
from gellight.sensor.findings import ok, problem
from tests.helpers.clinic import WEBCAM, Clinic, wrong
from tests.helpers.command_line import invoke


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
