"""The core under ASan and UBSan: its own tests, a short fuzzing run, and the corpus replayed through the real image."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from gellight.ring import protocol as p
from gellight.ring.enumerations import Status
from gellight.ring.light_ring import LightRing
from gellight.ring.wire import Packet, decode, encode
from tests.firmware.emulator.analog import THERMISTOR_PIN, Divider
from tests.firmware.helpers.fuzzing import CORPUS, Fuzzer, compile_fuzzer, fuzz
from tests.firmware.helpers.mutations import LOGIC, Mutation, planted
from tests.firmware.helpers.virtual_board import compile_library, run_core_tests
from tests.helpers.bench_board import BenchBoard, VirtualTransport

CHECKOUT = Path(__file__).parents[2]
SECONDS = 4
LEAST_REACHED = dict.fromkeys(
    ("commands", "controller", "crc", "events", "heat", "light_commands", "packet", "ring", "sequencer", "supply",
     "thermistor", "trigger", "watches"), 92.0
) | {"config": 80.0, "lights": 90.0}  # fmt: skip
"""share of the lines of a file, %; the rest is for flash that fails, restarts, and faults that no sound core makes"""
TIME_UNIT_US = 1009
LONGEST_WAIT_US = 40 * TIME_UNIT_US
DAILY = 10
"""one in that many stories of the corpus is replayed by day"""
REPLAYED = [pytest.param(path, id=path.stem, marks=[pytest.mark.nightly] if number % DAILY else [])
            for number, path in enumerate(sorted(CORPUS.glob("*.bin")))]  # fmt: skip


@pytest.fixture(scope="module")
def fuzzer(tmp_path_factory: pytest.TempPathFactory) -> Fuzzer:
    return compile_fuzzer(tmp_path_factory.mktemp("fuzz") / "fuzzer")


def test_a_short_run_finds_nothing(fuzzer: Fuzzer) -> None:
    done = fuzz(fuzzer, SECONDS, seed=1)
    assert done.returncode == 0, done.stderr[-3000:]
    said = re.search(r"(\d+) executions|Done (\d+) runs", done.stdout + done.stderr)
    assert said
    assert int(said[1] or said[2]) > len(list(CORPUS.glob("*.bin")))


MAPS_REGISTERS = pytest.mark.skipif(sys.platform != "linux", reason="maps registers at their places")
USB, CONFIG = "firmware/boards/rp2/usb_control.c", "firmware/core/config.c"
ENDPOINT_0 = (
    Mutation("more than asked for", USB, "control_count = count < setup.count ? count : setup.count;",
             "control_count = count;"),
    Mutation("stuck toggle", USB, "    control_data1 = !control_data1;\n", ""),
    Mutation("nothing aborted", USB, "    control_abort();\n    control_data1", "    control_data1"),
    Mutation("address kept for the next", USB, "    new_address = NO_ADDRESS;\n}\n\nvoid control_setup",
             "}\n\nvoid control_setup"),
    Mutation("address 0 not taken", USB, "    if (new_address != NO_ADDRESS) {",
             "    if (new_address && new_address != NO_ADDRESS) {"),
    Mutation("any address", USB, " && setup.value <= LAST_ADDRESS", ""),
)  # fmt: skip
RECORDS = (
    Mutation("checksum ignored", CONFIG, "record->crc == crc32(0, record, sizeof *record - 4u)", "true"),
    Mutation("any configuration", CONFIG, "return sound && config_valid(&record->configuration, &value);",
             "return config_valid(&record->configuration, &value) || sound;"),
)  # fmt: skip
"""what else protects a record (its page was erased, it reads back) also hides these faults from one another"""
IN_THE_CORE = [m for m in LOGIC if m.name in ("limit off", "limit forgets the light on its way")]
PLANTED = [("control", m) for m in ENDPOINT_0] + [("flash", m) for m in RECORDS] + [("core", m) for m in IN_THE_CORE]


@pytest.mark.nightly
@pytest.mark.parametrize("what", [pytest.param("control", marks=MAPS_REGISTERS), "flash"])
def test_a_rude_host_and_a_spoilt_flash_break_no_rule(what: str, tmp_path: Path) -> None:
    done = fuzz(compile_fuzzer(tmp_path / "fuzzer", what=what), SECONDS, 1, corpus=False)
    assert done.returncode == 0, done.stderr[-3000:]


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("what", "fault"),
    [pytest.param(what, m, id=m.name, marks=MAPS_REGISTERS if what == "control" else ()) for what, m in PLANTED],
)
def test_the_fuzzers_find_a_planted_fault(what: str, fault: Mutation, copied_firmware: Path, tmp_path: Path) -> None:
    with planted(fault, copied_firmware) as checkout:
        fuzzer = compile_fuzzer(tmp_path / "fuzzer", checkout, what=what)
    assert fuzz(fuzzer, 40, seed=1, corpus=what == "core").returncode != 0


@pytest.mark.nightly
@pytest.mark.skipif(shutil.which("gcc") is None or shutil.which("gcov") is None, reason="needs gcc and its gcov")
def test_the_corpus_reaches_the_core(tmp_path: Path) -> None:
    """Or the fuzzer would have nothing to start from where it matters: sequences, for example, need a checksum."""
    folders = [CHECKOUT / "firmware" / name for name in ("fuzz", "boards/host", "core")]
    sources = [str(file) for folder in folders for file in sorted(folder.glob("*.c"))]
    program = [str(tmp_path / "fuzzer")]
    subprocess.run(["gcc", "-std=c11", "-O0", "--coverage", *(f"-I{folder}" for folder in folders), *sources, "-o",
                    *program], cwd=tmp_path, check=True)  # fmt: skip
    subprocess.run([*program, "0", "1", "-", *map(str, sorted(CORPUS.glob("*.bin")))], cwd=tmp_path, check=True)
    command = ["gcov", *tmp_path.glob("*.gcda")]
    told = subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    shares = re.findall(r"core/(\w+)\.c'\nLines executed:([\d.]+)%", told)
    reached = {name: float(share) for name, share in shares}
    assert set(reached) == {file.stem for file in folders[2].glob("*.c")}
    assert {name: share for name, share in reached.items() if share < LEAST_REACHED[name]} == {}


NEEDS_ASAN = pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc, for its ASan")


def core_under_asan(folder: Path, checkout: Path) -> subprocess.CompletedProcess[str]:
    library = compile_library(folder / "core.so", "address,undefined", checkout=checkout)
    asan = subprocess.run(
        ["gcc", "-print-file-name=libasan.so"], capture_output=True, text=True, check=True
    ).stdout.strip()
    return run_core_tests(library, LD_PRELOAD=asan, ASAN_OPTIONS="detect_leaks=0")


@pytest.mark.nightly
@NEEDS_ASAN
def test_the_tests_of_the_core_pass_under_asan(tmp_path: Path) -> None:
    done = core_under_asan(tmp_path, CHECKOUT)
    assert done.returncode == 0, f"ended with {done.returncode}:\n{done.stdout[-3000:]}\n{done.stderr}"


def tell(board: BenchBoard, story: bytes) -> None:
    """The acts of firmware/fuzz/story.h, played to the image."""
    at, sequence = 0, 0
    while at + 2 <= len(story):
        what, amount = story[at] % 8, story[at + 1]
        if what == 0:
            board.run(min(amount * TIME_UNIT_US, LONGEST_WAIT_US))
        elif what == 1:
            board.host.send(story[at + 2 : at + 2 + amount])
            at += amount
        elif what == 2:
            if amount > 124 or at + 3 + amount > len(story):
                return
            kind, payload = story[at + 2], story[at + 3 : at + 3 + amount]
            board.host.send(encode(Packet(kind, sequence & 0xFF, payload)))
            at += 1 + amount
            sequence += 1
        elif what == 3:
            board.set_trigger(not amount & 1)
        elif what == 4:
            (board.host.open if amount & 1 else board.host.close)()
        elif what == 6:
            sequence = commit(board, sequence, 1 + (amount & 31), amount >> 6)
        elif what == 7 and amount < 224:
            board.set_temperature(amount)
        elif what == 7:
            share = ((amount - 224) * 128 + 63) / 4096
            board.dividers[THERMISTOR_PIN] = Divider(to_ground=10e3 * share / (1 - share))
        board.run(500)
        at += 2


def commit(board: BenchBoard, sequence: int, steps: int, loops: int) -> int:
    """Commit with the checksum of what is staged, which the board tells when it refuses another."""
    code, checksum = p.COMMANDS["COMMIT"].code, 0
    for _ in range(2):
        before = board.host.received.count(0)  # a packet may be on its way
        board.host.send(encode(Packet(code, sequence & 0xFF, p.Commit(checksum, loops, steps).pack())))
        board.run(3_000)
        for stuffed in bytes(board.host.received).split(b"\0")[before:-1]:
            packet = decode(stuffed) if stuffed else Packet(0, 0, b"")
            if packet.type == code | p.REPLY and packet.payload[0] == Status.CHECKSUM:
                checksum = int.from_bytes(packet.payload[1:5], "little")
        sequence += 1
    return sequence


@pytest.mark.parametrize("path", REPLAYED)
def test_the_image_survives_what_the_fuzzer_found(path: Path, board: BenchBoard) -> None:
    board.run_until(lambda: board.host.configured, 200_000)
    board.host.open()
    tell(board, path.read_bytes())
    board.run(100_000)
    if board.in_bootloader:
        pytest.fail("the corpus should not hold the magic number of the boot loader")
    board.run_until(lambda: board.host.configured, 200_000)
    with LightRing(VirtualTransport(board), keep_alive_s=None) as ring:
        assert ring.status().current_ma <= 450
