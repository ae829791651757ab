"""The service: its unit file, what systemd is told, and what `gellight status` says of what runs."""

import json
import os
import re
import signal
import socket
import sys
from collections.abc import Sequence
from pathlib import Path
from unittest.mock import Mock

import pytest

from gellight.base.errors import ConfigError, InputError
from gellight.base.process import ServiceManager
from gellight.base.settings import load_settings
from gellight.cli.service import unit
from gellight.sensor import udev
from tests.helpers import children
from tests.helpers.command_line import invoke, refused, succeeded

SENSOR = "sim://?object=BALL&depth=0.5&board=0&fps=10"


def listening(tmp_path: Path) -> socket.socket:
    """What systemd listens on."""
    manager = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    manager.bind(str(tmp_path / "notify"))
    manager.settimeout(60)
    return manager


def test_a_service_that_delivers_is_alive_and_one_that_stands_still_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
    with listening(tmp_path) as systemd:
        manager = ServiceManager()
        manager.ready()
        assert systemd.recv(100) == b"READY=1"
        manager.alive(5, away=False)
        assert systemd.recv(100) == b"WATCHDOG=1"
        manager.alive(5, away=False)  # nothing came since
        manager.alive(5, away=True)  # but now it is known why
        manager.alive(6, away=False)
        systemd.settimeout(0.1)
        assert [systemd.recv(100), systemd.recv(100)] == [b"WATCHDOG=1"] * 2
        with pytest.raises(TimeoutError):
            systemd.recv(100)


def test_what_runs_tells_systemd_and_is_shown_by_status_and_ends_with_0(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    surroundings = os.environ | {"NOTIFY_SOCKET": str(tmp_path / "notify")}
    assert invoke("status").exit_code == 1, "nothing runs"
    command = [
        *children.GELLIGHT,
        "run",
        "--sensor",
        SENSOR,
        "--set",
        "dashboard.port=0",
        "--set",
        "stream.name=finger",
    ]
    with listening(tmp_path) as systemd, children.started(command, env=surroundings, stderr=-3) as daemon:
        assert systemd.recv(100) == b"READY=1"
        assert systemd.recv(100) == b"WATCHDOG=1"
        shown = succeeded(invoke("status", "--json"))
        status = json.loads(shown.stdout)["finger"]
        assert (status["process"], status["error"], status["mode"]) == (daemon.pid, None, "network")
        assert "finger (process" in invoke("status").stdout
        second = children.gellight(*command[len(children.GELLIGHT) :], "--frames", "1", env=surroundings)
        assert second.returncode == 2
        assert f"published already by process {daemon.pid}" in second.stderr
        os.kill(daemon.pid, signal.SIGTERM)
        assert daemon.wait(60) == 0
    assert invoke("status").stdout.startswith("no daemon runs")


def test_the_unit_file_is_written_once_and_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    path = tmp_path / "systemd/user/gellight-left.service"
    done = invoke("service", "install", "--name", "left")
    assert f"systemctl --user enable --now {path.name}" in done.stdout, done.output
    assert path.read_text() == unit("auto", "left", 8420)
    assert "exists" in refused(invoke("service", "install", "--name", "left"))
    assert invoke("service", "remove", "--name", "left").exit_code == 0
    assert not path.exists()
    assert "left" in refused(invoke("service", "remove", "--name", "left"))


def test_the_unit_starts_this_installation_and_is_watched() -> None:
    lines = dict(line.split("=", 1) for line in unit("sensor://A 1%", "", 8420).splitlines() if "=" in line)
    assert lines["Type"] == "notify"
    assert lines["WatchdogSec"] == "30"
    assert lines["SystemCallFilter"] == "@system-service", "and what else it may not do"
    assert (lines["NoNewPrivileges"], lines["UMask"]) == ("yes", "0077")
    folder = Path(sys.executable).parent
    assert lines["ExecStart"] == f"{folder}/gellight run --sensor 'sensor://A 1%%' --set dashboard.port=8420"


NO_NAMES = ["", "**", "../../x", "a/b", "a b", "a\n", ".a", "-a", "ä", 65 * "a"]
VERBS = ["service remove", "service install --print"]


@pytest.mark.parametrize(
    ("verb", "name"), [(VERBS[0], name) for name in NO_NAMES] + [(verb, "a b") for verb in VERBS[1:]]
)
def test_what_is_no_name_of_a_sensor_is_refused_wherever_it_is_given(
    verb: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = invoke(*verb.split(), f"--name={name}")
    assert (result.exit_code, result.stdout, list(tmp_path.iterdir())) == (1, "", [])
    assert isinstance(result.exception, InputError)
    reason = "is not possible: give at most 64 letters" if name else "is empty: give it a value"
    assert reason in str(result.exception)


def test_settings_take_the_same_names() -> None:
    for name in NO_NAMES[1:]:
        with pytest.raises(ConfigError):
            load_settings({"stream.name": name})
    assert load_settings({"stream.name": 64 * "a"}).stream.name == 64 * "a"


@pytest.mark.parametrize("sensor", ["a\nExecStart=/bin/evil", "a\r", "\x1b[1m", "", " "])
def test_a_sensor_that_would_break_the_unit_file_is_refused(sensor: str) -> None:
    done = invoke("service", "install", "--sensor", sensor, "--print")
    assert done.stdout == ""
    reason = "is not possible" if sensor else "is empty"
    assert re.fullmatch(rf"--sensor .* {reason}: .*", refused(done))


# ---- the udev rule: whose devices it opens, and how it is written ----


def test_the_udev_rule_names_our_devices_and_no_others_and_comes_before_the_seat_rules() -> None:
    """The number for tests is everybody's; the boot loader has no other."""
    rules = [line for line in udev.RULE.read_text().splitlines() if line.startswith("SUBSYSTEM")]
    ours = [rule for rule in rules if '"2e8a"' not in rule]
    assert len(ours) == 3
    assert all('{product}=="GelLight*"' in rule and '{idVendor}=="1209"' in rule for rule in ours)
    from gellight.ring.transport import PRODUCT, VENDOR

    text = udev.RULE.read_text()
    assert text.count(f'{{idVendor}}=="{VENDOR:04x}"') == text.count(f'{{idProduct}}=="{PRODUCT:04x}"') == 3
    assert udev.RULE.name < "73-seat-late.rules"


def test_the_udev_rule_is_written_and_applied(tmp_path: Path) -> None:
    ran: list[Sequence[str]] = []
    assert not udev.installed(folder=tmp_path / "rules.d")
    target = udev.install(folder=tmp_path / "rules.d", run=ran.append)
    assert udev.installed(folder=tmp_path / "rules.d")
    assert [command[:2] for command in ran] == [("udevadm", "control"), ("udevadm", "trigger")]
    target.write_text("old")
    assert not udev.installed(folder=tmp_path / "rules.d")
    assert invoke("install-udev", "--print").output == udev.RULE.read_text()


def test_a_rule_that_cannot_be_written_or_applied_is_told_with_the_way_out(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=r"cannot write .*: run `sudo .* install-udev`"):
        udev.install(folder=tmp_path / "file" / "rules.d", run=lambda command: None)
    with pytest.raises(InputError, match="is written, but `udevadm control --reload` failed"):
        udev.install(folder=tmp_path / "rules.d", run=Mock(side_effect=OSError("no udevadm")))
