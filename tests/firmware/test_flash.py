"""From sources to a board: UF2, ELF, reproducible builds, and the three ways of flashing."""

import contextlib
import shutil
from pathlib import Path
from types import SimpleNamespace
from zlib import crc32

import pytest
import usb.core

from firmware.tools import build
from firmware.tools.build import boot2_crc
from gellight.base.errors import BoardError, InputError
from gellight.ring.firmware import flash
from gellight.ring.firmware.image import (
    HEADER,
    from_uf2,
    header_at,
    image_crc,
    to_uf2,
)
from gellight.ring.light_ring import LightRing
from tests.firmware.helpers.boot_loader import BootRom, NoDevice, drive
from tests.helpers.bench_board import BenchBoard, VirtualTransport

CHECKOUT = Path(__file__).parents[2]


def test_the_emulator_loads_the_same_uf2(image: bytes, tmp_path: Path) -> None:
    """An independent reader of the format agrees."""
    from rp2040py.device.load_flash import load_uf2
    from rp2040py.rp2040 import RP2040

    chip = RP2040()
    (tmp_path / "image.uf2").write_bytes(to_uf2(image))
    load_uf2(str(tmp_path / "image.uf2"), chip)
    assert bytes(chip.flash[: len(image)]) == image


@pytest.mark.parametrize("at", [0, 4, 8, 12, 20, 24, 28, 508])
def test_a_damaged_uf2_is_refused(image: bytes, at: int) -> None:
    file = bytearray(to_uf2(image))
    file[at + (at == 8) * 1] ^= 0xFF if at != 8 else 0x20
    with pytest.raises(InputError):
        from_uf2(bytes(file))
    with pytest.raises(InputError, match="blocks"):
        from_uf2(to_uf2(image)[:-1])


def test_the_boot2_checksum_is_that_of_the_boot_rom() -> None:
    assert boot2_crc(b"123456789") == 0x0376E6E7  # CRC-32/MPEG-2, the check value of its catalogue entry


def test_a_damaged_image_is_noticed(image: bytes) -> None:
    damaged = bytearray(image)
    damaged[header_at(image) + 100] ^= 1
    with pytest.raises(InputError, match="damaged"):
        image_crc(bytes(damaged))
    with pytest.raises(InputError, match="no firmware image"):
        image_crc(b"")


def test_other_files_are_no_firmware() -> None:
    with pytest.raises(InputError, match="ELF"):
        build.flash_image(b"\x7fELF\x02\x01" + bytes(100), family=0, boot2=True)


@pytest.mark.nightly
def test_building_elsewhere_gives_the_same_bytes(tmp_path: Path) -> None:
    shutil.copytree(CHECKOUT / "firmware", tmp_path / "firmware")
    assert build.build(tmp_path) == build.build(CHECKOUT)


@pytest.mark.nightly
def test_the_other_compiler_builds_a_working_image() -> None:
    board = BenchBoard(build.build(CHECKOUT, compiler_name="gcc"))
    assert board.run_until(lambda: board.host.configured, 200_000)
    assert board.faults == []


@pytest.mark.nightly
def test_a_compilers_complaint_is_passed_on(tmp_path: Path) -> None:
    shutil.copytree(CHECKOUT / "firmware", tmp_path / "firmware")
    (tmp_path / "firmware/core/extra.c").write_text("int broken(void) { return 1L << 40; }\n")
    with pytest.raises(InputError, match=r"extra\.c"):
        build.build(tmp_path)
    with pytest.raises(InputError, match="zig or gcc"):
        build.build(CHECKOUT, compiler_name="tcc")
    with pytest.raises(InputError, match="checkout"):
        build.build(tmp_path / "nowhere")


# ---- onto a board ----


def test_a_copy_goes_to_the_drive_of_a_boot_loader(image: bytes, tmp_path: Path) -> None:
    mounted = drive(tmp_path / "media/me/RPI-RP2")
    drive(tmp_path / "media/me/OTHER", "SAMD21")
    places = list((tmp_path / "media/me").iterdir())
    assert flash.drives(places) == [mounted]
    how, _ = flash.flash_board(image, places=places, backend=NoDevice())
    assert str(mounted) in how
    assert from_uf2((mounted / "gellight-rp2040.uf2").read_bytes()) == image
    with pytest.raises(InputError, match="not the drive"):
        flash.copy_uf2(image, tmp_path)


def test_picoboot_writes_and_starts_the_image(image: bytes) -> None:
    rom = BootRom(bytes(64 * 1024))  # a flash full of zeros: writing without erasing would fail
    board = flash.Picoboot(backend=rom)
    board.flash(image)
    board.reboot()
    board.close()
    assert rom.flash[: len(image)] == image
    assert rom.rebooted
    emulated = BenchBoard(bytes(rom.flash))
    assert emulated.run_until(lambda: emulated.host.configured, 200_000)


def test_flash_that_does_not_take_its_bytes_is_noticed(image: bytes) -> None:
    class Worn(BootRom):
        def send(self, endpoint: int, data: bytes) -> None:
            super().send(endpoint, data)
            self.flash[5000] = image[5000] ^ 0xFF

    with pytest.raises(BoardError, match="worn out"):
        flash.Picoboot(backend=Worn()).flash(image)


class Unplugged(BootRom):
    """Loses its cable after that many bytes were written."""

    left = 0

    def _take_bytes(self, data: bytes) -> None:
        if len(data) > self.left:
            super()._take_bytes(data[: self.left].ljust(len(data), b"\xff"))
            raise usb.core.USBError("No such device", errno=19)
        self.left -= len(data)
        super()._take_bytes(data)


def test_a_board_that_is_gone_is_told_in_one_line(image: bytes) -> None:
    """It cannot say what its last command came to either."""

    class Gone(Unplugged):
        def control(self, kind: int, request: int, value: int) -> bytes:
            if (kind, request) == (0xC1, 0x42):
                raise usb.core.USBError("No such device", errno=19)
            return super().control(kind, request, value)

    with pytest.raises(BoardError, match=r"refused command .* the board is gone: plug it in again"):
        flash.Picoboot(backend=Gone()).flash(image)


def test_a_cut_while_flashing_leaves_a_board_that_waits_for_its_image(image: bytes) -> None:
    """Never boot2 of one image before half of another."""
    older = image[:4096] + bytes(60_000)
    for left in range(0, len(image) + 4096, 200):
        rom = Unplugged(older)
        rom.left = left
        with contextlib.suppress(BoardError):
            flash.Picoboot(backend=rom).flash(image)
        whole = bytes(rom.flash[: len(image)]) == image
        boots = boot2_crc(bytes(rom.flash[:252])) == int.from_bytes(rom.flash[252:256], "little")
        assert boots == whole, left
    assert whole


def test_no_board_is_a_remedy(image: bytes, tmp_path: Path) -> None:
    with pytest.raises(BoardError, match="hold BOOTSEL"):
        flash.flash_board(image, places=[], backend=NoDevice(), wait_s=0.2)
    with pytest.raises(BoardError, match="cannot open"):
        flash.touch(str(tmp_path / "ttyNONE"))


class _TwoDevices(BootRom):
    def enumerate_devices(self):  # type: ignore[no-untyped-def]
        return iter(("board", "another board"))


def test_nothing_is_written_where_several_boards_wait(image: bytes, tmp_path: Path) -> None:
    first, second = drive(tmp_path / "RPI-RP2"), drive(tmp_path / "RPI-RP21")
    with pytest.raises(BoardError, match=r"several boards.*RPI-RP2, .*RPI-RP21.*unplug all but"):
        flash.flash_board(image, places=[first, second], backend=NoDevice())
    two = _TwoDevices()
    for places in ([], [first]):
        with pytest.raises(BoardError, match="several boards"):
            flash.flash_board(image, places=places, backend=two)
    assert sorted(path.name for path in tmp_path.rglob("*.uf2")) == []
    assert set(two.flash) == {0xFF}
    with pytest.raises(BoardError, match="2 boards are in their boot loader"):
        flash.Picoboot(backend=two)


def test_drives_are_found_on_every_system(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Letters are tried below the current folder: a path that begins with one is relative here."""
    monkeypatch.chdir(tmp_path)
    drive(Path("E:"))
    assert flash.drives(flash.mount_points("win32")) == [Path("E:")]
    seen: list[str] = []
    monkeypatch.setattr(Path, "glob", lambda self, pattern: [seen.append(f"{self}{pattern}") or self / pattern])
    assert flash.mount_points("darwin") == [Path("/Volumes/*")]
    assert Path("/run/media/*/*") in flash.mount_points("linux")


# ---- and it runs ----


def open_port(monkeypatch: pytest.MonkeyPatch, path: str) -> None:
    monkeypatch.setattr(
        flash, "board_ports", lambda: [SimpleNamespace(device="/dev/other"), SimpleNamespace(device=path)]
    )


def test_the_board_is_opened_again_and_its_image_compared(image: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    other, (magic, count, _, family) = bytearray(image), HEADER.unpack_from(image, header_at(image))
    body = header_at(image) + HEADER.size
    other[body] ^= 1
    HEADER.pack_into(other, header_at(image), magic, count, crc32(other[body : body + count]), family)
    emulated, asked = BenchBoard(image), []

    def connect(url: str) -> LightRing:
        asked.append(url)
        return LightRing(VirtualTransport(emulated), keep_alive_s=None)

    monkeypatch.setattr(flash, "connect", connect)
    open_port(monkeypatch, "/dev/ring")
    flash.check_board(image, {"/dev/other"})
    assert asked == ["/dev/ring"]
    with pytest.raises(BoardError, match=f"runs image {image_crc(image):08x}, not {image_crc(bytes(other)):08x}"):
        flash.check_board(bytes(other), {"/dev/other"})


def test_a_flash_that_holds_another_byte_is_noticed(image: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    damaged = bytearray(image)
    damaged[damaged.index(b"GelLight light ring")] ^= 1
    ring = LightRing(VirtualTransport(BenchBoard(bytes(damaged))), keep_alive_s=None)
    monkeypatch.setattr(flash, "connect", lambda _: ring)
    open_port(monkeypatch, "/dev/ring")
    with pytest.raises(BoardError, match="does not hold image"):
        flash.check_board(image, {"/dev/other"})


def test_a_board_that_does_not_come_back_is_told(image: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    open_port(monkeypatch, "/dev/none")
    with pytest.raises(BoardError, match=r"did not come back within 0 s \(no port of a board appeared\)"):
        flash.check_board(image, {"/dev/other", "/dev/none"}, wait_s=0.2)
    with pytest.raises(BoardError, match=r"did not come back.*there is no /dev/none"):
        flash.check_board(image, {"/dev/other"}, wait_s=0.2)
