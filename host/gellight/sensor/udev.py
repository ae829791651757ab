"""The udev rule: who may use a sensor without being root."""

import os
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path

from gellight.base.errors import INSTALL_UDEV, InputError, first_line
from gellight.base.writing import make_folder, write_file

RULE = Path(__file__).parent / "60-gellight.rules"
FOLDER = Path("/etc/udev/rules.d")
COMMANDS = (
    ("udevadm", "control", "--reload"),
    ("udevadm", "trigger", "--subsystem-match=usb", "--subsystem-match=tty", "--subsystem-match=video4linux"),
)


def _run(command: Sequence[str]) -> None:
    subprocess.run(command, check=True, capture_output=True, text=True)


def installed(*, folder: Path = FOLDER) -> bool:
    """Whether the rule is there, as this version has it."""
    try:
        return (folder / RULE.name).read_bytes() == RULE.read_bytes()
    except OSError:
        return False


def install(*, folder: Path = FOLDER, run: Callable[[Sequence[str]], None] = _run) -> Path:
    """Write the rule and let udev apply it to what is plugged in; return where it is.

    Raises InputError where that is not allowed, or where there is no udev.
    """
    target = folder / RULE.name
    try:
        make_folder(folder)
        write_file(target, RULE.read_bytes())
    except OSError as error:
        raise InputError(f"cannot write {target} ({os.strerror(error.errno or 0)}): run {INSTALL_UDEV}") from error
    for command in COMMANDS:
        try:
            run(command)
        except (OSError, subprocess.CalledProcessError) as error:
            raise InputError(
                f"{target} is written, but `{' '.join(command)}` failed ({first_line(error)}): unplug the sensor and "
                "plug it in, or restart the computer"
            ) from error
    return target
