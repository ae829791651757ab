"""What the doctor calls wrong: each bound just within, and just beyond."""

from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import pytest

from gellight.base.errors import CameraError
from gellight.lab.doctor import examination, sensor_checks
from gellight.lab.doctor.examination import check_power
from gellight.lab.doctor.sensor_checks import check_shutter
from gellight.sensor.findings import Finding, Level
from tests.helpers.clinic import Clinic
from tests.helpers.usb_tree import UsbTree

MODE = SimpleNamespace(fps=30.0)


STEADY = {"period_s": 1 / 30, "left_out": 0, "wander_s": 0.001, "farthest_s": 0.001}


COUNTS = dict.fromkeys(("wrong_stamps", "identical", "lost", "damaged", "duplicated"), 0) | {"delivered": 60}


def level_of(finding: Finding) -> str:
    return finding.level.value


@pytest.mark.parametrize(("fps", "level"), [(28.6, "ok"), (28.4, "warning"), (31.4, "ok"), (31.6, "warning")])
def test_a_rate_may_be_off_by_a_twentieth(fps: float, level: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sensor_checks, "cadence", lambda pictures: SimpleNamespace(period_s=1 / fps))
    assert level_of(sensor_checks.check_rate(Mock(mode=MODE), [])) == level


@pytest.mark.parametrize(("size", "level"), [(655_360, "ok"), (655_361, "warning")])
def test_a_camera_may_take_four_fifths_of_what_usb_2_reserves(size: int, level: str) -> None:
    """3 x 1024 x 8000 bytes a second."""
    assert level_of(sensor_checks.check_bandwidth(Mock(mode=MODE), [Mock(data=bytes(size))])) == level


@pytest.mark.parametrize(
    ("counts", "found", "level"),
    [
        ({"identical": 3}, {}, "ok"),
        ({"identical": 4}, {}, "warning"),
        ({"lost": 1, "damaged": 1, "duplicated": 1}, {}, "ok"),
        ({"lost": 1, "damaged": 2, "duplicated": 1}, {}, "warning"),
        ({}, {"left_out": 3}, "ok"),
        ({}, {"left_out": 4, "wander_s": 0.0041}, "warning"),
        ({}, {"left_out": 4, "wander_s": 0.0043}, "ok"),
        ({"wrong_stamps": 1}, {}, "problem"),
    ],
)
def test_three_frames_of_sixty_may_be_amiss(
    counts: dict[str, int], found: dict[str, float], level: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sensor_checks, "cadence", lambda pictures: SimpleNamespace(**{**STEADY, **found}))
    camera = Mock(counts=SimpleNamespace(**{**COUNTS, **counts}))
    assert level_of(sensor_checks.check_losses(camera, [])) == level


@pytest.mark.parametrize(("answer_s", "level"), [(0.0199, "ok"), (0.0201, "warning")])
def test_a_board_may_take_20_ms_to_answer(answer_s: float, level: str, clinic: Clinic) -> None:
    ring = SimpleNamespace(clock=lambda: clinic.kernel.sleep(answer_s))
    assert level_of(sensor_checks.check_ring_clock(ring, clinic.surroundings)) == level


@pytest.mark.parametrize(("lit_grey", "level"), [(11.9, "problem"), (12.1, "ok")])
def test_leds_brighten_the_picture_by_two_grey_levels(
    lit_grey: float, level: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    grey, ring = iter([10.0, lit_grey]), Mock(led_count=12)
    monkeypatch.setattr(sensor_checks, "_mean_grey", lambda camera: next(grey))
    assert level_of(sensor_checks.check_leds(ring, Mock())) == level
    assert (ring.light.call_args.args[0] == 40).all()


@pytest.mark.parametrize(("leds", "lit"), [(3, 1), (12, 3), (20, 5), (24, 5)])
def test_the_shutter_is_measured_by_few_leds_on_opposite_sides(
    leds: int, lit: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    measure = Mock(side_effect=CameraError("none"))
    monkeypatch.setattr(sensor_checks, "measure_shutter", measure)
    check_shutter(Mock(ring=Mock(led_count=leds)), Mock(), Mock())
    red, blue = (group.any(axis=1).nonzero()[0].tolist() for group in measure.call_args.args[1])
    assert (red, blue) == (list(range(lit)), list(range(leds // 2, leds // 2 + lit)))


@pytest.mark.parametrize(
    ("free", "year", "levels"),
    [(1_000_000_000, 2025, ["ok", "ok"]), (999_999_999, 2024, ["warning", "problem"])],
)
def test_a_gigabyte_has_to_be_free_and_the_date_to_be_plausible(
    free: int, year: int, levels: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(examination.shutil, "disk_usage", lambda folder: SimpleNamespace(free=free))
    monkeypatch.setattr(examination.time, "gmtime", lambda: SimpleNamespace(tm_year=year))
    found = [examination.check_disk(tmp_path), *examination.check_clock(tmp_path)]
    assert [level_of(finding) for finding in found] == levels


@pytest.mark.parametrize(
    ("mbps", "others", "levels"),
    [(479.0, 0, ["problem"]), (480.0, 0, ["ok"]), (480.0, 1, ["ok", "warning"]), (5000.0, 1, ["ok"])],
)
def test_a_camera_needs_480_mbit_s_and_shares_no_slow_bus(mbps: float, others: int, levels: list[str]) -> None:
    cameras = [SimpleNamespace(usb=SimpleNamespace(speed_mbps=mbps, port=f"1-{n}")) for n in range(1 + others)]
    found = Mock(with_cameras=lambda: [SimpleNamespace(camera=camera) for camera in cameras])
    sensor = SimpleNamespace(camera=cameras[0], name="one")
    assert [level_of(finding) for finding in examination.check_speed(found, sensor)] == levels


WEBCAM = (0x046D, 0x0825)


@pytest.mark.parametrize("refused", [False, True])
def test_a_ring_that_linux_refused_is_found_without_its_node(refused: bool, tmp_path: Path) -> None:
    """Beside the device of somebody else, of which nothing is said."""
    usb = UsbTree(tmp_path)
    usb.plug("1-3", ids=WEBCAM, refused=True)
    usb.plug("1-4.1", ids=WEBCAM, cameras=1)
    usb.plug("1-4.2", rings=int(not refused), refused=refused)
    (finding,) = check_power(usb.sysfs, {"1-4.1"})
    assert finding.level is (Level.PROBLEM if refused else Level.OK)
    if refused:
        assert "at USB 1-4.2 asks for more current than its hub gives, so Linux does not switch it on" in finding.text
        assert "a power supply of its own" in finding.remedy
