"""Chips by their folders: their images, the RP2350 as far as it can be told without one, and a third by a folder."""

import shutil
import struct
import subprocess
import sys
from pathlib import Path

import pytest

from firmware.tools.build import build, find_target, in_checkout, sources, write_image
from gellight.base.errors import InputError
from gellight.ring.boards import find_board, presets
from gellight.ring.firmware import flash, targets
from gellight.ring.firmware.image import from_uf2, image_family, to_uf2
from gellight.ring.firmware.targets import committed_image
from tests.firmware.helpers.boot_loader import BootRom, NoDevice, drive
from tests.firmware.helpers.rp2350 import FLASH, RAM, RAM_BYTES, StartedChip, block_loop, uf2_blocks
from tests.helpers.bench_board import BenchBoard
from tests.helpers.places import CHECKOUT

RP2350_PRODUCT = 0x000F
SECURE_ARM = 0xE48BFF59
IMAGE_TYPE = 0x42


@pytest.fixture(scope="module")
def pico2() -> bytes:
    return committed_image("rp2350")


@pytest.mark.nightly
@pytest.mark.parametrize("name", in_checkout(CHECKOUT))
def test_each_folder_has_its_image_in_the_package(name: str) -> None:
    image = committed_image(name)
    assert to_uf2(build(CHECKOUT, target=name)) == to_uf2(image)
    assert targets.packaged()[name] == find_target(name)
    assert image_family(image) == find_target(name).family


def test_both_chips_run_the_same_core_and_the_same_usb() -> None:
    first, second = (set(sources(CHECKOUT, find_target(name))) for name in ("rp2040", "rp2350"))
    common = {path.name for path in first & second}
    assert {path.name for path in (CHECKOUT / "firmware/core").glob("*.c")} <= common
    assert {"usb.c", "usb_control.c", "usb_descriptors.c", "flash.c", "light.c", "pins.c", "main.c"} <= common


# ---- the RP2350 ----


def test_the_file_for_the_rp2350_says_so_in_every_block(pico2: bytes) -> None:
    blocks = uf2_blocks(to_uf2(pico2))
    assert {family for family, _, _ in blocks} == {SECURE_ARM}
    assert [address for _, address, _ in blocks] == [FLASH + 256 * k for k in range(len(blocks))]


def test_its_boot_rom_finds_a_program_and_its_vectors(pico2: bytes) -> None:
    """Data sheet 5.9.5.1, and 5.9.3.3: without an item that says otherwise the vectors are where the image begins."""
    assert block_loop(pico2) == [{IMAGE_TYPE: 0x10210142}]
    stack, reset = struct.unpack_from("<II", pico2)
    assert stack == RAM + (512 << 10)
    assert reset & 1
    assert FLASH < reset < FLASH + len(pico2)
    assert pico2.index(struct.pack("<I", 0x7188EBF2)) < 1024, "binary info"


@pytest.fixture(scope="module")
def chip(pico2: bytes) -> StartedChip:
    return StartedChip(pico2)


@pytest.mark.nightly
def test_a_cortex_m33_executes_its_start(chip: StartedChip, pico2: bytes) -> None:
    """Up to the main loop, in RAM: no instruction that it does not have, and USB is on."""
    assert chip.sleeps
    vectors = chip.register(0xE000ED08)
    assert RAM <= vectors < RAM + RAM_BYTES
    usb, trigger = (struct.unpack("<I", chip.core.mem_read(vectors + 4 * (16 + irq), 4))[0] for irq in (14, 21))
    assert usb & 1
    assert trigger & 1
    assert usb != trigger


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("address", "value"),
    [
        (0x4001003C, 0x01),  # clk_sys: PLL_SYS (8.1.6)
        (0x40050008, 120), (0x4005000C, 0x62000),  # 1440 MHz / 6 / 2 (8.6.5)
        (0x40058008, 100), (0x4005800C, 0x55000),  # 1200 MHz / 5 / 5
        (0x40010060, 1 << 11), (0x4001006C, 1 << 11),  # clk_usb, clk_adc: PLL_USB
        (0x40108018, 1), (0x4010801C, 12), (0x40108030, 1), (0x40108034, 12),  # ticks of 1 us (8.5)
        (0x40018008, 0x01FFFFF3),  # a watchdog resets all but the oscillators (7.4)
        (0x4003800C, 0x52), (0x40038010, 0x4A),  # pads of LEDs and trigger: not isolated any more (9.7)
        (0x40028014, 6), (0x4002801C, 5),  # to the PIO, to SIO (9.4)
        (0x50110040, 1),  # USB: device, PHY not isolated (12.7.6)
        (0x50110074, 0x9), (0x50110078, 0xC),
        (0x50000010, 1 | 2 << 2 | 1 << 4 | 0 << 13 | 0 << 17 | 1 << 23),  # DMA: by the FIFO of the PIO (12.6.10)
    ],
)  # fmt: skip
def test_its_registers_are_those_of_its_data_sheet(chip: StartedChip, address: int, value: int) -> None:
    assert value in [written for at, written in chip.writes if at == address]
    if address != 0x50000010:
        assert chip.register(address) == value


@pytest.mark.nightly
def test_nothing_is_written_where_the_rp2040_has_its_registers(chip: StartedChip) -> None:
    blocks = {
        0x40010, 0x40018, 0x40020, 0x40028, 0x40038, 0x40048, 0x40050, 0x40058, 0x400A0, 0x400B0, 0x400D8, 0x40108,
    }  # fmt: skip
    assert {address >> 12 for address, _ in chip.writes if address >> 28 == 4} <= blocks


# ---- onto a board ----


def test_the_drive_of_an_rp2350_gets_its_own_image(pico2: bytes, tmp_path: Path) -> None:
    mounted = drive(tmp_path / "media/me/RP2350", "RP2350")
    how, image = flash.flash_board(None, places=[mounted], backend=NoDevice())
    assert str(mounted) in how
    assert image == pico2
    assert from_uf2((mounted / "gellight-rp2350.uf2").read_bytes())[: len(pico2)] == pico2


@pytest.mark.parametrize(("board_id", "name"), [("RP2350", "rp2040"), ("RPI-RP2", "rp2350")])
def test_an_image_for_another_chip_is_refused(board_id: str, name: str, tmp_path: Path) -> None:
    mounted = drive(tmp_path / board_id, board_id)
    with pytest.raises(InputError, match=r"the image is for the RP2.*waits in its boot loader: leave --image away"):
        flash.flash_board(committed_image(name), places=[mounted], backend=NoDevice())
    assert not list(mounted.glob("*.uf2"))


def test_picoboot_writes_an_rp2350_and_starts_it_by_its_own_command(pico2: bytes) -> None:
    rom = BootRom(product=RP2350_PRODUCT)
    how, image = flash.flash_board(None, places=[], backend=rom)
    assert how == "written by PICOBOOT"
    assert rom.flash[: len(pico2)] == image == pico2
    assert rom.rebooted
    with pytest.raises(InputError, match="image is for the RP2040, and an RP2350 waits"):
        flash.flash_board(committed_image("rp2040"), places=[], backend=rom)


# ---- a third ----

MADE_UP = """
chip = "MADE1"
family = 0x12345678
drive = "MADE-UP"
usb = [0x1209, 0x0002]
shares = ["rp2", "rp2040"]
zig = "cortex_m0plus"
gcc = "cortex-m0plus"
boot2 = true

[boards.made-up]
name = "Made-up board"
data = 9
trigger = 10
output = 11
printed = "D9, D10, D11"
"""


@pytest.mark.nightly
def test_a_folder_alone_makes_another_board(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(CHECKOUT / "firmware", tmp_path / "firmware")
    folder = tmp_path / "firmware/boards/made_up"
    folder.mkdir()
    (folder / "board.toml").write_text(MADE_UP)
    shutil.copy(CHECKOUT / "firmware/boards/rp2040/board.ld", folder)
    image = build(tmp_path, target="made_up")
    assert image_family(image) == 0x12345678
    board = BenchBoard(image)
    assert board.run_until(lambda: board.host.configured, 200_000)
    assert board.faults == []

    made = find_target("made_up", tmp_path)
    assert presets([made])["made-up"].data_pin == 9
    package = tmp_path / "package"
    package.mkdir()
    monkeypatch.setattr(targets, "PACKAGED", package)
    targets.packaged.cache_clear()
    try:
        write_image(image, package / "gellight-made_up.uf2", made)
        mounted = drive(tmp_path / "MADE-UP", "MADE-UP")
        flash.flash_board(None, places=[mounted], backend=NoDevice())
        assert from_uf2((mounted / "gellight-made_up.uf2").read_bytes())[: len(image)] == image
    finally:
        targets.packaged.cache_clear()


def test_a_folder_that_tells_too_little_is_named(tmp_path: Path) -> None:
    path = tmp_path / "firmware/boards/poor/board.toml"
    path.parent.mkdir(parents=True)
    path.write_text('chip = "X"\n')
    with pytest.raises(InputError, match=r"poor/board\.toml does not describe a board"):
        build(tmp_path, target="poor")
    with pytest.raises(InputError, match="no target 'esp32': choose rp2040, rp2350"):
        build(CHECKOUT, target="esp32")
    assert find_board("pico2").name == "Raspberry Pi Pico 2"


def test_writing_an_image_to_no_folder_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    for place in (tmp_path / "none/x.uf2", tmp_path / "file/x.uf2"):
        with pytest.raises(InputError, match="cannot write"):
            write_image(committed_image(), place)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize(
    ("option", "said"),
    [
        ("--checkout", "does not hold the sources of the firmware: clone GelLight's repository"),
        ("--out", "give a name that ends with .uf2"),
    ],
)
def test_building_refuses_a_folder_without_sources_and_a_file_of_another_kind(
    tmp_path: Path, option: str, said: str
) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    place = tmp_path if option == "--checkout" else tmp_path / "notes.txt"
    command = [sys.executable, "-m", "firmware.tools.build", option, str(place)]
    done = subprocess.run(command, cwd=CHECKOUT, capture_output=True, text=True, timeout=60)
    assert done.returncode != 0
    assert said in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]
    assert (tmp_path / "notes.txt").read_text() == "mine"
