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
from tests.firmware.helpers.fuzzing import CORPUS, Fuzzer, compile_fuzzer, fuzz
from tests.firmware.helpers.mutations import LOGIC
from tests.firmware.helpers.virtual_board import compile_library, run_core_tests
from tests.helpers.bench_board import BenchBoard, VirtualTransport

CHECKOUT = Path(__file__).parents[2]
SECONDS = 4
LEAST_REACHED = dict.fromkeys(
    ("commands", "controller", "crc", "light_commands", "packet", "ring", "sequencer", "trigger"), 92.0
) | {"config": 70.0, "events": 80.0, "heat": 65.0, "supply": 50.0, "watches": 88.0}
"""share of the lines of a file, %; the rest is for flash that fails, restarts, faults that no sound core makes, and for
a hot chip and a load switch, which no story has"""
TIME_UNIT_US = 1009
LONGEST_WAIT_US = 40 * TIME_UNIT_US
REPLAYED = sorted(CORPUS.glob("*.bin"))


@pytest.fixture(scope="module")
def fuzzer(tmp_path_factory: pytest.TempPathFactory) -> Fuzzer:
    return compile_fuzzer(tmp_path_factory.mktemp("fuzz") / "fuzzer")


def test_a_short_run_finds_nothing(fuzzer: Fuzzer) -> None:
    done = fuzz(fuzzer, SECONDS, seed=1)
    assert done.returncode == 0, done.stderr[-3000:]
    said = re.search(r"(\d+) executions|Done (\d+) runs", done.stdout + done.stderr)
    assert said
    assert int(said[1] or said[2]) > len(list(CORPUS.glob("*.bin")))


CONTROL_FAULTS = [
    ("control_count = count < setup.count ? count : setup.count;", "control_count = count;"),
    ("    control_data1 = !control_data1;\n", ""),
    ("    control_abort();\n    control_data1", "    control_data1"),
    ("    new_address = NO_ADDRESS;\n}\n\nvoid control_setup", "}\n\nvoid control_setup"),
    ("    if (new_address != NO_ADDRESS) {", "    if (new_address && new_address != NO_ADDRESS) {"),
    (" && setup.value <= LAST_ADDRESS", ""),
]


@pytest.mark.skipif(sys.platform != "linux", reason="maps registers at their places")
def test_control_transfers_of_a_rude_host_break_no_rule(tmp_path: Path) -> None:
    done = fuzz(compile_fuzzer(tmp_path / "control", what="control"), SECONDS, 1, corpus=False)
    assert done.returncode == 0, done.stderr[-3000:]


@pytest.mark.skipif(sys.platform != "linux", reason="maps registers at their places")
@pytest.mark.parametrize(("old", "new"), CONTROL_FAULTS)
def test_a_fault_of_endpoint_0_is_found(old: str, new: str, tmp_path: Path) -> None:
    shutil.copytree(CHECKOUT / "firmware", tmp_path / "firmware")
    path = tmp_path / "firmware/boards/rp2040/usb_control.c"
    assert path.read_text().count(old) == 1
    path.write_text(path.read_text().replace(old, new))
    done = fuzz(compile_fuzzer(tmp_path / "control", tmp_path, what="control"), 40, 1, corpus=False)
    assert done.returncode != 0


FLASH_FAULTS = [
    ("record->crc == crc32(0, record, sizeof *record - 4u)", "true"),
    ("return sound && config_valid(&record->configuration, &value);",
     "return config_valid(&record->configuration, &value) || sound;"),
]  # fmt: skip
"""what else protects a record (its page was erased, it reads back) also hides these faults from one another"""


def test_no_flash_leads_to_a_wrong_configuration(tmp_path: Path) -> None:
    done = fuzz(compile_fuzzer(tmp_path / "flash", what="flash"), SECONDS, 1, corpus=False)
    assert done.returncode == 0, done.stderr[-3000:]


@pytest.mark.parametrize(("old", "new"), FLASH_FAULTS)
def test_a_fault_of_the_configuration_is_found(old: str, new: str, tmp_path: Path) -> None:
    shutil.copytree(CHECKOUT / "firmware", tmp_path / "firmware")
    path = tmp_path / "firmware/core/config.c"
    assert path.read_text().count(old) == 1
    path.write_text(path.read_text().replace(old, new))
    done = fuzz(compile_fuzzer(tmp_path / "flash", tmp_path, what="flash"), 40, 1, corpus=False)
    assert done.returncode != 0


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


@pytest.mark.parametrize("name", ["limit off", "limit forgets the light on its way"])
def test_the_fuzzer_finds_a_planted_fault(name: str, tmp_path: Path) -> None:
    mutation = next(m for m in LOGIC if m.name == name)
    shutil.copytree(CHECKOUT / "firmware", tmp_path / "firmware")
    path = tmp_path / mutation.file
    path.write_text(path.read_text().replace(mutation.old, mutation.new))
    done = fuzz(compile_fuzzer(tmp_path / "fuzzer", tmp_path), 40, seed=1)
    assert done.returncode != 0


@pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc, for its ASan")
def test_the_tests_of_the_core_pass_under_asan(tmp_path: Path) -> None:
    library = compile_library(tmp_path / "core.so", "address,undefined")
    asan = subprocess.run(
        ["gcc", "-print-file-name=libasan.so"], capture_output=True, text=True, check=True
    ).stdout.strip()
    done = run_core_tests(library, LD_PRELOAD=asan, ASAN_OPTIONS="detect_leaks=0")
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]


def tell(board: BenchBoard, story: bytes) -> None:
    """The acts of firmware/fuzz/story.h, played to the image."""
    at, sequence = 0, 0
    while at + 2 <= len(story):
        what, amount = story[at] % 8, story[at + 1]
        if what in (0, 7):
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


@pytest.mark.parametrize("path", REPLAYED, ids=lambda path: path.stem)
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
