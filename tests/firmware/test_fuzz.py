"""The core under ASan and UBSan: its own tests, a short fuzzing run, and the corpus replayed through the real image."""

import shutil
import subprocess
from pathlib import Path

import pytest
from fuzzing import CORPUS, compile_fuzzer, fuzz
from mutations import LOGIC
from virtual_board import compile_library, run_core_tests

from gellight.board.chip import EmulatedBoard
from gellight.ring import LightRing
from gellight.transport import VirtualTransport
from gellight.wire import Packet, encode

CHECKOUT = Path(__file__).parents[2]
SECONDS = 6
TIME_UNIT_US = 1009
LONGEST_WAIT_US = 40 * TIME_UNIT_US
REPLAYED = sorted(CORPUS.glob("*.bin"))[::4]


@pytest.fixture(scope="module")
def fuzzer(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compile_fuzzer(tmp_path_factory.mktemp("fuzz") / "fuzzer")


def test_a_short_run_finds_nothing(fuzzer: Path) -> None:
    done = fuzz(fuzzer, SECONDS, seed=1)
    assert done.returncode == 0, done.stderr[-3000:]
    executions, _, inputs, _, places = done.stdout.split()[:5]
    assert int(executions) > 200
    assert int(inputs.rstrip(",")) >= len(list(CORPUS.glob("*.bin")))
    assert int(places) > 300


@pytest.mark.parametrize("name", ["limit off"])
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


def tell(board: EmulatedBoard, story: bytes) -> None:
    """The acts of firmware/fuzz/target.c, played to the image."""
    at, sequence = 0, 0
    while at + 2 <= len(story):
        what, amount = story[at] % 6, story[at + 1]
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
        board.run(500)
        at += 2


@pytest.mark.parametrize("path", REPLAYED, ids=lambda path: path.stem)
def test_the_image_survives_what_the_fuzzer_found(path: Path, board: EmulatedBoard) -> None:
    board.run_until(lambda: board.host.configured, 200_000)
    board.host.open()
    tell(board, path.read_bytes())
    board.run(100_000)
    if board.in_bootloader:
        pytest.fail("the corpus should not hold the magic number of the boot loader")
    board.run_until(lambda: board.host.configured, 200_000)
    with LightRing(VirtualTransport(board), keep_alive_s=None) as ring:
        assert ring.status().current_ma <= 450
