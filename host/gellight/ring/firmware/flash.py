"""Bring an image onto a board: into its boot loader, by UF2 copy or by PICOBOOT, and see that it runs."""

import logging
import os
import string
import struct
import sys
import time
from collections.abc import Collection, Iterable
from contextlib import closing
from pathlib import Path
from typing import Any

from gellight.base.errors import BoardError, InputError, first_line
from gellight.ring.enumerations import Check
from gellight.ring.firmware.image import FLASH_BASE, image_crc, image_family, to_uf2
from gellight.ring.firmware.targets import Target, committed_image, packaged, target_of
from gellight.ring.light_ring import LightRing, connect
from gellight.ring.transport import board_ports

logger = logging.getLogger(__name__)

MARK = "INFO_UF2.TXT"
BOARD_ID = "Board-ID:"
# The boot loader on USB, by the data sheets: RP2040 2.8.5, RP2350 5.6.
INTERFACE, OUT, IN = 1, 0x03, 0x84  # its number, and the endpoints
MAGIC = 0x431FD10B
EXCLUSIVE, REBOOT, ERASE, WRITE, EXIT_XIP, REBOOT2, READ = 0x01, 0x02, 0x03, 0x05, 0x06, 0x0A, 0x84
SECTOR, PAGE = 4096, 256  # what the flash erases and writes at once
TIMEOUT_MS = 5000  # chosen: an answer that takes as long does not come
WAIT_S = 10.0  # chosen: a board that is started anew needs some seconds until USB knows it
TOUCH_BAUD = 1200  # BAUD_TOUCH of firmware/boards/rp2/usb.c, and of Arduino boards


def mount_points(platform: str = sys.platform) -> list[Path]:
    """Return where the system mounts drives that are plugged in: folders, or letters on Windows."""
    if platform == "win32":
        return [Path(f"{letter}:/") for letter in string.ascii_uppercase]
    patterns = ("Volumes/*",) if platform == "darwin" else ("media/*/*", "run/media/*/*", "media/*")
    return [path for pattern in patterns for path in sorted(Path("/").glob(pattern))]


def drives(places: Iterable[Path] | None = None) -> list[Path]:
    """Return where boards in their boot loader are mounted."""
    return [path for path in (mount_points() if places is None else places) if _boot_loader(path)]


def _boot_loader(drive: Path) -> Target | None:
    """Return the chip whose boot loader a drive is; None for any other drive."""
    try:
        told = (drive / MARK).read_text(errors="replace")
    except OSError:  # no such file, or a drive without a medium or without leave to look
        return None
    names = {line.removeprefix(BOARD_ID).strip() for line in told.splitlines() if line.startswith(BOARD_ID)}
    return next((target for target in packaged().values() if target.drive in names), None)


def fitting(image: bytes | None, target: Target) -> bytes:
    """Return the image for the chip that waits: the one given, or the one that comes with this package.

    InputError where the one given is damaged or for another chip: its boot loader would ignore it without a word.
    """
    if image is None:
        return committed_image(target.name)
    image_crc(image)
    if image_family(image) != target.family:
        theirs = target_of(image_family(image)).chip
        raise InputError(
            f"the image is for the {theirs}, and an {target.chip} waits in its boot loader: leave --image away, or "
            f"give an image for the {target.chip}"
        )
    return image


def copy_uf2(image: bytes | None, drive: Path) -> bytes:
    """Copy an image to the drive of a boot loader, which starts it; return the image."""
    target = _boot_loader(drive)
    if target is None:
        chips = " or ".join(target.chip for target in packaged().values())
        raise InputError(f"{drive} is not the drive of an {chips} in its boot loader ({MARK} does not say so)")
    image = fitting(image, target)
    try:
        with (drive / target.image.name).open("wb") as file:
            file.write(to_uf2(image))
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        raise BoardError(
            f"copying to {drive} failed ({first_line(error)}): hold BOOTSEL, plug the board in, try again"
        ) from error
    return image


def touch(port: str) -> None:
    """Open a serial port at 1200 baud and close it, which asks the board for its boot loader."""
    import serial

    try:
        serial.Serial(port, TOUCH_BAUD, exclusive=True).close()
    except OSError as error:
        raise BoardError(
            f"cannot open {port} ({first_line(error)}): is the board plugged in and the port free?"
        ) from error


class Picoboot:
    """A board in its boot loader, driven through pyusb (RP2040 data sheet 2.8.5, RP2350 5.6)."""

    def __init__(self, *, backend: Any = None) -> None:
        """Claim the interface of the only board in its boot loader."""
        import usb.core
        import usb.util

        self._usb = usb
        found = waiting_boards(backend)
        if len(found) != 1:
            raise BoardError(f"{len(found)} boards are in their boot loader: hold BOOTSEL while you plug one in")
        self._device = found[0]
        self.target = _waiting(self._device)
        self._token = 0
        try:
            usb.util.claim_interface(self._device, INTERFACE)
            self._device.ctrl_transfer(0x41, 0x41, 0, INTERFACE, None, TIMEOUT_MS)
        except usb.core.USBError as error:
            raise BoardError(
                f"cannot use the boot loader ({first_line(error)}): install the udev rule or copy the UF2"
            ) from error

    def _command(self, command: int, arguments: bytes, *, data: bytes = b"", count: int = 0) -> bytes:
        """Send a command with its bytes, or take what it returns; both ends say when they are done."""
        self._token += 1
        length = len(data) or count
        head = struct.pack("<IIBBHI16s", MAGIC, self._token, command, len(arguments), 0, length, arguments)
        try:
            self._device.write(OUT, head, TIMEOUT_MS)
            if data:
                self._device.write(OUT, data, TIMEOUT_MS)
            answer = bytes(self._device.read(IN, count or 1, TIMEOUT_MS))
            if count:
                self._device.write(OUT, b"", TIMEOUT_MS)
        except self._usb.core.USBError as error:
            raise BoardError(f"the boot loader refused command 0x{command:02x} ({self._status()}): {error}") from error
        return answer

    def _status(self) -> str:
        """Say why the last command was refused."""
        try:
            told = bytes(self._device.ctrl_transfer(0xC1, 0x42, 0, INTERFACE, 16))
        except self._usb.core.USBError:
            return "and the board is gone: plug it in again, with BOOTSEL held"
        return f"status {struct.unpack_from('<I', told, 4)[0]}"

    def flash(self, image: bytes) -> None:
        """Erase, write and read back an image, sector by sector; BoardError if it reads back differently.

        The first page is what the boot ROM looks for: it is erased first and written last, so that a board whose
        flashing was cut short waits in its boot loader.
        """
        fitting(image, self.target)
        padded = image + b"\xff" * (-len(image) % SECTOR)
        self._command(EXCLUSIVE, b"\1")
        self._command(EXIT_XIP, b"")
        for at in range(0, len(padded), SECTOR):
            self._command(ERASE, struct.pack("<II", FLASH_BASE + at, SECTOR))
            if at:
                self._write(at, padded[at : at + SECTOR])
        self._write(PAGE, padded[PAGE:SECTOR])
        self._write(0, padded[:PAGE])

    def _write(self, at: int, data: bytes) -> None:
        """Write whole pages that are erased, and read them back."""
        where = struct.pack("<II", FLASH_BASE + at, len(data))
        self._command(WRITE, where, data=data)
        if self._command(READ, where, count=len(data)) != data:
            raise BoardError(f"the flash at 0x{FLASH_BASE + at:08x} reads back differently: it may be worn out")

    def reboot(self) -> None:
        """Start what is in flash."""
        if self.target.boot2:
            self._command(REBOOT, struct.pack("<III", 0, 0, 500))
        else:  # the older command is gone
            self._command(REBOOT2, struct.pack("<IIII", 0, 500, 0, 0))

    def close(self) -> None:
        """Let go of the board."""
        self._usb.util.dispose_resources(self._device)


def waiting_boards(backend: Any = None) -> list[Any]:
    """Return the devices of pyusb that are boards in their boot loader; none where pyusb finds no libusb."""
    import usb.core

    try:
        return [
            device
            for target in packaged().values()
            for device in usb.core.find(find_all=True, idVendor=target.usb[0], idProduct=target.usb[1], backend=backend)
            or []
        ]
    except usb.core.NoBackendError as error:
        logger.debug("no PICOBOOT: %s", error)
        return []


def _waiting(device: Any) -> Target:
    found = (device.idVendor, device.idProduct)
    return next(target for target in packaged().values() if target.usb == found)


def flash_board(image: bytes | None, *, port: str | None = None, places: Iterable[Path] | None = None,
                backend: Any = None, wait_s: float = WAIT_S) -> tuple[str, bytes]:  # fmt: skip
    """Flash the board behind a serial port, or the only one that waits in its boot loader.

    Return how it was done, and the image; where none is given, it is the one for the chip that waits. Raises BoardError
    where none appears, or where several wait, InputError where the image is for another chip: then nothing is written.
    """
    if port:
        touch(port)
    places = None if places is None else list(places)
    end = time.monotonic() + wait_s
    while time.monotonic() < end:
        mounted, waiting = drives(places), waiting_boards(backend)
        if max(len(mounted), len(waiting)) > 1:
            names = ", ".join(map(str, mounted)) or f"{len(waiting)} on USB"
            raise BoardError(f"several boards wait in their boot loader ({names}): unplug all but the one to flash")
        if mounted:
            return f"copied to {mounted[0]}", copy_uf2(image, mounted[0])
        if waiting and (written := _write(image, backend)):
            return "written by PICOBOOT", written
        time.sleep(0.1)
    raise BoardError(f"no boot loader of a board appeared within {wait_s:.0f} s: hold BOOTSEL while you plug it in")


def _write(image: bytes | None, backend: Any) -> bytes | None:
    """Write by PICOBOOT; None where the board may not be used, since its drive may still appear."""
    try:
        board = Picoboot(backend=backend)
    except BoardError as error:
        logger.debug("no PICOBOOT: %s", error)
        return None
    with closing(board):
        image = fitting(image, board.target)
        board.flash(image)
        board.reboot()
    return image


def check_board(image: bytes, before: Collection[str], *, wait_s: float = WAIT_S) -> str:
    """Open the board that has come back, and compare its image with this one; return where it is.

    `before` are the ports of other boards. The board adds its own flash up again, so that a UF2 that was copied is read
    back too. BoardError where it does not come back, does not answer, or holds another image.
    """
    with _open_returned(before, wait_s) as ring:
        runs, wanted = ring.hello.image_crc, image_crc(image)
        if runs != wanted:
            raise BoardError(f"the board runs image {runs:08x}, not {wanted:08x} that was written: flash it again")
        if ring.self_test().failed & Check.IMAGE:
            raise BoardError(f"the flash of the board does not hold image {wanted:08x} undamaged: flash it again")
        return ring.transport.url


def _open_returned(before: Collection[str], wait_s: float) -> LightRing:
    """Open the board at a port that was not there before; it may take a moment until everyone may use it."""
    end, why = time.monotonic() + wait_s, "no port of a board appeared"
    while time.monotonic() < end:
        for port in board_ports():
            try:
                if port.device not in before:
                    return connect(port.device)
            except BoardError as error:
                why = str(error)
        time.sleep(0.1)
    raise BoardError(
        f"the image was written, but the board did not come back within {wait_s:.0f} s ({why}): unplug it, plug it in, "
        "and see whether `gellight ring info` shows it"
    )
