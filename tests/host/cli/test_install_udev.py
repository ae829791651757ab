"""The udev rule: whose devices it opens, and how it is written."""

from collections.abc import Sequence
from pathlib import Path
from unittest.mock import Mock

import pytest

from gellight.base.errors import InputError
from gellight.sensor import udev
from tests.helpers.command_line import invoke


def test_the_udev_rule_opens_no_device_of_another_maker() -> None:
    """The number for tests is everybody's; the boot loader has no other."""
    rules = [line for line in udev.RULE.read_text().splitlines() if line.startswith("SUBSYSTEM")]
    ours = [rule for rule in rules if '"2e8a"' not in rule]
    assert len(ours) == 3
    assert all('{product}=="GelLight*"' in rule and '{idVendor}=="1209"' in rule for rule in ours)


def test_the_udev_rule_is_written_and_applied(tmp_path: Path) -> None:
    ran: list[Sequence[str]] = []
    assert not udev.installed(folder=tmp_path / "rules.d")
    target = udev.install(folder=tmp_path / "rules.d", run=ran.append)
    assert udev.installed(folder=tmp_path / "rules.d")
    assert [command[:2] for command in ran] == [("udevadm", "control"), ("udevadm", "trigger")]
    target.write_text("old")
    assert not udev.installed(folder=tmp_path / "rules.d")
    assert invoke("install-udev", "--print").output == udev.RULE.read_text()


def test_the_udev_rule_names_our_devices_and_comes_before_the_seat_rules() -> None:
    from gellight.ring.usb_numbers import PRODUCT, VENDOR

    text = udev.RULE.read_text()
    assert text.count(f'{{idVendor}}=="{VENDOR:04x}"') == text.count(f'{{idProduct}}=="{PRODUCT:04x}"') == 3
    assert udev.RULE.name < "73-seat-late.rules"


def test_a_rule_that_cannot_be_written_or_applied_is_told_with_the_way_out(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=r"cannot write .*: run `sudo .* install-udev`"):
        udev.install(folder=tmp_path / "file" / "rules.d", run=lambda command: None)
    with pytest.raises(InputError, match="is written, but `udevadm control --reload` failed"):
        udev.install(folder=tmp_path / "rules.d", run=Mock(side_effect=OSError("no udevadm")))
